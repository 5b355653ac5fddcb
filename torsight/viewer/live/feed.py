"""To the screen: a queue that drops its oldest entries, a thread that empties it, a process that talks to the viewer.

A viewer that is absent, late, stopped or killed holds up that process at most. Whatever is shown was handed over
before; whatever cannot be handed over in time is left out, and only there.
"""

from __future__ import annotations

import contextlib
import socket
import threading
import time
from collections import deque
from collections.abc import Callable
from multiprocessing import get_context
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from torsight.viewer.layout import FRAME, TIME
from torsight.viewer.overlay import Overlay, colour_of
from torsight.viewer.program import LOOPBACK, step_back

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

    import rerun as rr

MOST_WAITING: Final = 300
"""Entries that may wait to be shown."""
MEMORY: Final = "256MB"
"""What is kept for a viewer that comes late."""
PICTURE_PX: Final = 640
END_S: Final = 2.0


class Feed:
    """Hands pictures, curves and events to the viewer's side.

    Parameters
    ----------
    port : int
        Port of this computer at which viewers find the record.
    """

    def __init__(self, port: int) -> None:
        self.port = port
        self.left_out = 0
        self._waiting: deque[tuple[Any, ...]] = deque()
        self._changed = threading.Condition()
        self._ended = False
        context = get_context("spawn")
        self._here, there = context.Pipe()
        self._process = context.Process(target=serve, args=(there, port), daemon=True, name="viewer feed")
        self._process.start()
        there.close()
        self._thread = threading.Thread(target=self._hand_over, name="feed", daemon=True)
        self._thread.start()

    @property
    def address(self) -> str:
        """What a viewer opens to see the record."""
        return f"rerun+http://{LOOPBACK}:{self.port}/proxy"

    def wait_until_open(self, limit_s: float = 60.0) -> bool:
        """Wait until viewers can connect, and return whether they can."""
        end = time.monotonic() + limit_s
        while self._process.is_alive() and time.monotonic() < end:
            with contextlib.suppress(OSError), socket.create_connection((LOOPBACK, self.port), timeout=0.5):
                return True
            time.sleep(0.1)
        return False

    @property
    def running(self) -> bool:
        """Whether the viewer's side still takes entries."""
        return self._process.is_alive() and self._thread.is_alive()

    def put(self, *entry: Any) -> None:
        """Queue one entry; the oldest one goes where too many wait."""
        with self._changed:
            self._waiting.append(entry)
            if len(self._waiting) > MOST_WAITING:
                self._waiting.popleft()
                self.left_out += 1
            self._changed.notify()

    def close(self) -> None:
        """Give what waits a moment to be shown, then end the viewer's side."""
        with self._changed:
            self._ended = True
            self._changed.notify()
        self._thread.join(END_S)
        self._process.join(END_S)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()

    def _hand_over(self) -> None:
        while True:
            with self._changed:
                while not self._waiting and not self._ended:
                    self._changed.wait()
                if not self._waiting:
                    self._here.close()
                    return
                entry = self._waiting.popleft()
            try:
                self._here.send(entry)
            except (BrokenPipeError, ConnectionError, OSError):
                return


# --- in the process of its own ------------------------------------------------------------------------------------


def serve(connection: Connection, port: int) -> None:
    """Log what comes through the connection, until it closes."""
    import signal

    import rerun as rr

    from torsight.viewer import layout

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    step_back()
    stream = rr.RecordingStream(layout.APPLICATION)
    sink = rr.GrpcServerSink(bind_ip=LOOPBACK, port=port, server_memory_limit=MEMORY)
    stream.set_sinks(sink, default_blueprint=layout.blueprint())
    layout.log_styles(stream)
    layout.log_sizes(stream)
    while True:
        try:
            kind, *entry = connection.recv()
        except (EOFError, ConnectionError, OSError):
            break
        _LOGGERS[kind](stream, *entry)
    stream.flush(timeout_sec=1.0)


def _log_frame(
    stream: rr.RecordingStream,
    time_s: float,
    frame: int,
    angle_deg: float,
    luma: NDArray[np.uint8] | None,
    drawn: Overlay | None,
) -> None:
    import rerun as rr

    stream.set_time(TIME, duration=time_s)
    stream.set_time(FRAME, sequence=frame)
    if np.isfinite(angle_deg):
        stream.log("angle/measured", rr.Scalars(angle_deg))
    if luma is None or drawn is None:
        return
    stream.log("film/picture", rr.EncodedImage(contents=_jpeg(luma), media_type="image/jpeg"))
    shades = [colour_of(name) for name in drawn.names]
    stream.log("film/markers", rr.Points2D(drawn.points_px, colors=shades, labels=drawn.names))
    lines, colours, words = drawn.strokes()
    stream.log("film/sticks", rr.LineStrips2D(lines, colors=colours, labels=words))


def _jpeg(luma: NDArray[np.uint8]) -> bytes:
    import cv2

    return bytes(cv2.imencode(".jpg", luma, (cv2.IMWRITE_JPEG_QUALITY, 75))[1].tobytes())


def _log_series(
    stream: rr.RecordingStream, entity: str, time_s: NDArray[np.float64], values: NDArray[np.float64]
) -> None:
    import rerun as rr

    stream.send_columns(
        entity, indexes=[rr.TimeColumn(TIME, duration=time_s)], columns=rr.Scalars.columns(scalars=values)
    )


def _log_event(stream: rr.RecordingStream, time_s: float, level: str, text: str) -> None:
    import rerun as rr

    stream.set_time(TIME, duration=time_s)
    stream.log("events", rr.TextLog(text, level=level))


def _log_summary(stream: rr.RecordingStream, text: str) -> None:
    import rerun as rr

    stream.log("summary", rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN), static=True)


_LOGGERS: Final[dict[str, Callable[..., None]]] = {
    "frame": _log_frame,
    "series": _log_series,
    "event": _log_event,
    "summary": _log_summary,
}
