"""To the screen: a queue that drops its oldest entries, a thread that empties it, a process that serves the viewer.

A viewer that is absent, late, stopped or killed delays at most that process, never the measurement. Entries that cannot
be handed over in time are missing on the screen, not in the record.
"""

from __future__ import annotations

import contextlib
import signal
import socket
import threading
import time
from collections import deque
from collections.abc import Callable
from multiprocessing import get_context
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from torsight.core.files.paths import LOOPBACK
from torsight.core.files.small_pictures import encoded
from torsight.core.progress import AT_ONCE_S, ATTENTION_S, STUCK_S, THOUGHT_S
from torsight.viewer import view_layout
from torsight.viewer.live.frames.intake import WAITING_FRAMES
from torsight.viewer.live.priority import LOGGING, served_first, step_back_others
from torsight.viewer.overlay import Overlay, colour_of
from torsight.viewer.program import address_of
from torsight.viewer.view_layout import FRAME, TIME, log_series

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

    import rerun as rr

_BIN_S: Final = AT_ONCE_S / 1000
"""Width of a bin: a thousandth of the latency that a person perceives as immediate, 0.1 ms."""
_BINS: Final = round(2.0 / _BIN_S)
CELLS: Final = _BINS + 1
"""Size of the buffer in numbers of 64 bits; the last number is the longest duration in nanoseconds."""


class Latency:
    """Counts durations in bins of 0.1 ms up to two seconds.

    The counts may be in a buffer of :data:`CELLS` whole numbers of 64 bits that another process reads.
    """

    def __init__(self, shared: Any = None) -> None:
        cells = np.zeros(CELLS, np.int64) if shared is None else np.frombuffer(shared, np.int64)
        self._count, self._most_ns = cells[:-1], cells[-1:]

    def add(self, duration_s: float) -> None:
        """Count one duration."""
        self._count[min(max(int(duration_s / _BIN_S), 0), _BINS - 1)] += 1
        self._most_ns[0] = max(int(self._most_ns[0]), round(duration_s * 1e9))

    def percentile_ms(self, percent: float) -> float:
        """Return the duration that this percentage of the latencies does not exceed, ms; NaN where none was counted."""
        total = int(self._count.sum())
        if total == 0:
            return float("nan")
        place = int(np.searchsorted(np.cumsum(self._count), percent / 100.0 * total))
        return min((place + 1) * _BIN_S, max(self._most_s, _BIN_S)) * 1e3

    @property
    def _most_s(self) -> float:
        return float(self._most_ns[0]) * 1e-9

    def to_json(self) -> dict[str, Any]:
        """Return count, median, 99 % and the longest."""
        return {
            "frames": int(self._count.sum()),
            "median_ms": self.percentile_ms(50.0),
            "p99_ms": self.percentile_ms(99.0),
            "longest_ms": self._most_s * 1e3,
        }


MOST_WAITING: Final = round(ATTENTION_S) * WAITING_FRAMES
"""Entries that may wait to be shown: those of a usual camera in the time for which a person waits."""
MEMORY: Final = "256MB"
"""Memory for a viewer that connects late."""
END_S: Final = 2.0 * THOUGHT_S
"""Time for the viewer's side to end; afterwards it is no longer waited for."""


class Feed:
    """Hands pictures, curves and events to the viewer's side, which viewers find at a port of this computer."""

    def __init__(self, port: int) -> None:
        self.port = port
        self.left_out = 0
        context = get_context("spawn")
        counts = context.RawArray("q", CELLS)
        self.latency = Latency(counts)
        """Latencies from a frame to its logged angle."""
        self._waiting: deque[tuple[Any, ...]] = deque()
        self._changed = threading.Condition()
        self._ended = False
        self._here, there = context.Pipe()
        self._process = context.Process(target=serve, args=(there, port, counts), daemon=True, name="viewer feed")
        self._process.start()
        there.close()
        self._thread = threading.Thread(target=self._hand_over, name="feed", daemon=True)
        self._thread.start()

    @property
    def address(self) -> str:
        """Address that a viewer opens to show the record."""
        return address_of(self.port)

    def wait_until_open(self, limit_s: float = STUCK_S) -> bool:
        """Wait until viewers can connect, and return whether they can."""
        end = time.monotonic() + limit_s
        while self._process.is_alive() and time.monotonic() < end:
            with contextlib.suppress(OSError), socket.create_connection((LOOPBACK, self.port), timeout=0.5):
                return True
            time.sleep(0.05)
        return False

    @property
    def running(self) -> bool:
        """Whether the viewer's side still accepts entries."""
        return self._process.is_alive() and self._thread.is_alive()

    @property
    def waiting(self) -> int:
        """Number of entries that wait to be shown."""
        return len(self._waiting)

    def put(self, *entry: Any) -> None:
        """Queue one entry; the oldest one is dropped where too many wait."""
        with self._changed:
            self._waiting.append(entry)
            if len(self._waiting) > MOST_WAITING:
                self._waiting.popleft()
                self.left_out += 1
            self._changed.notify()

    def close(self) -> None:
        """Give waiting entries a moment to be shown, then end the viewer's side."""
        with self._changed:
            self._ended = True
            self._changed.notify()
        self._thread.join(END_S)
        self._process.join(END_S)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()

    def _hand_over(self) -> None:
        with served_first(LOGGING):
            while (entry := self._next()) is not None:
                try:
                    self._here.send(_packed(*entry))
                except (BrokenPipeError, ConnectionError, OSError):
                    return
        self._here.close()

    def _next(self) -> tuple[Any, ...] | None:
        """Wait for the next entry; None once the record has ended and no entry waits any more."""
        with self._changed:
            while not self._waiting and not self._ended:
                self._changed.wait()
            return self._waiting.popleft() if self._waiting else None


def _packed(kind: str, *entry: Any) -> tuple[Any, ...]:
    """Return an entry in the form in which it is sent: a picture as JPEG, which passes the pipe faster."""
    if kind != "picture":
        return (kind, *entry)
    time_s, frame, luma, drawn = entry
    return (kind, time_s, frame, encoded(luma, ".jpg", quality=75), drawn)


# --- in the process of its own ------------------------------------------------------------------------------------


def serve(connection: Connection, port: int, counts: Any) -> None:
    """Log the entries that arrive through the connection, until it closes."""
    import rerun as rr

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    latency = Latency(counts)
    stream = rr.RecordingStream(view_layout.APPLICATION)
    sink = rr.GrpcServerSink(bind_ip=LOOPBACK, port=port, server_memory_limit=MEMORY)
    stream.set_sinks(sink, default_blueprint=view_layout.blueprint())
    view_layout.log_styles(stream)
    view_layout.log_sizes(stream)
    # The threads that serve the viewers have the lowest priority.
    step_back_others()
    with served_first(LOGGING):
        while True:
            try:
                kind, *entry = connection.recv()
            except (EOFError, ConnectionError, OSError):
                break
            arrived_s = _LOGGERS[kind](stream, *entry)
            if arrived_s is not None:
                latency.add(time.perf_counter() - arrived_s)
    stream.flush(timeout_sec=1.0)


def _log_angle(
    stream: rr.RecordingStream, time_s: float, frame: int, angle_deg: float, arrived_s: float | None
) -> float | None:
    """Log one angle, and return the arrival time of its frame if latency counts."""
    import rerun as rr

    if np.isfinite(angle_deg):
        _set_times(stream, time_s, frame)
        stream.log("angle/measured", rr.Scalars(angle_deg))
    return arrived_s


def _log_picture(stream: rr.RecordingStream, time_s: float, frame: int, jpeg: bytes, drawn: Overlay) -> None:
    import rerun as rr

    _set_times(stream, time_s, frame)
    stream.log("film/picture", rr.EncodedImage(contents=jpeg, media_type="image/jpeg"))
    shades = [colour_of(name) for name in drawn.names]
    stream.log("film/markers", rr.Points2D(drawn.points_px, colors=shades, labels=drawn.names))
    lines, colours, words = drawn.strokes()
    stream.log("film/sticks", rr.LineStrips2D(lines, colors=colours, labels=words))


def _set_times(stream: rr.RecordingStream, time_s: float, frame: int) -> None:
    stream.set_time(TIME, duration=time_s)
    stream.set_time(FRAME, sequence=frame)


def _log_event(stream: rr.RecordingStream, time_s: float, level: str, text: str) -> None:
    import rerun as rr

    stream.set_time(TIME, duration=time_s)
    stream.log("events", rr.TextLog(text, level=level))


def _log_summary(stream: rr.RecordingStream, text: str) -> None:
    import rerun as rr

    stream.log("summary", rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN), static=True)


_LOGGERS: Final[dict[str, Callable[..., float | None]]] = {
    "angle": _log_angle,
    "picture": _log_picture,
    "series": log_series,
    "event": _log_event,
    "summary": _log_summary,
}
