"""Frames as they arrive: a film at its own pace, a camera, a stream, a film that is still being written."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from torsight.viewer.live.priority import INTAKE, served_first
from tracker.frames.frame import DEFAULT_FPS

WAITING_FRAMES: Final = round(DEFAULT_FPS)
"""Frames that may wait for the tracker, a second of a usual camera: the tracker is many times faster than the camera.
Beyond this number the oldest frame loses its picture, unless the source can wait."""

WAITING_AT_START: Final = 400
"""Frames that may wait while the markers are searched for, which takes a second or two: 1.7 s of the fastest cameras of
phones, 240 frames per second."""


@dataclass(slots=True, eq=False)
class Picture:
    """A picture of a source with its time on the source's clock, counted from the first picture.

    ``luma`` (h, w) is None where the picture was dropped or could not be decoded; ``damaged``: it was decoded
    incompletely; ``missed`` is the number of pictures that the source lost just before. ``arrived_s`` is
    ``time.perf_counter()`` at its arrival; 0: the moment at which it is handed over, or, for a film, at which it is due
    after that. The intake numbers pictures from 0 without gaps: one that was ``dropped`` keeps its number and its time.
    """

    time_s: float
    luma: NDArray[np.uint8] | None
    damaged: bool = False
    arrived_s: float = 0.0
    missed: int = 0
    index: int = 0
    dropped: bool = False


class Pictures:
    """Base class of sources, which give pictures one after the other with their times."""

    kind: ClassVar[str]
    """Description of the source, in words."""
    speed: float | None = None
    """Factor on the film's own pace; None where the pictures arrive in real time."""
    waits = False
    """Whether the source can wait without losing pictures, as a file can."""
    pixel_aspect = 1.0
    """Width of a pixel over its height."""
    ended_because = ""
    """Reason for the end of the pictures, where the source ended unexpectedly; else empty."""

    def __init__(self, name: str) -> None:
        self.name = name

    def frames(self, stop: threading.Event) -> Iterator[Picture]:
        """Give the pictures, until the end or until ``stop``."""
        raise NotImplementedError

    def describe(self) -> dict[str, Any]:
        """Return the description of the source for ``track.json``."""
        return {"kind": self.kind, "name": self.name}


def comes_in_time(pictures: Pictures) -> bool:
    """Return whether pictures arrive in real time, so that latency is counted; not for a film in fast motion."""
    return not pictures.waits if pictures.speed is None else pictures.speed <= 1.0


class Intake:
    """Reads pictures in a separate thread and queues them.

    Where a source cannot wait and the queue is full, the oldest picture is dropped; its frame keeps number and time.
    """

    def __init__(self, pictures: Pictures) -> None:
        self.pictures = pictures
        self.dropped = 0
        self.error: Exception | None = None
        self._patience = WAITING_AT_START
        self._go = threading.Event()
        self._stop = threading.Event()
        self._frames: deque[Picture] = deque()
        self._changed = threading.Condition()
        self._ended = False
        self._thread = threading.Thread(target=self._read, name="intake", daemon=True)

    def start(self) -> None:
        """Begin to read."""
        self._thread.start()

    def go(self) -> None:
        """Let a film play beyond its first frame."""
        self._go.set()

    def hurry(self) -> None:
        """Shorten the queue of waiting frames: called once the markers are found."""
        self._patience = WAITING_FRAMES

    def stop(self) -> None:
        """Stop reading; waiting frames can still be taken."""
        self._stop.set()
        self._go.set()

    @property
    def ended(self) -> bool:
        """Whether no frame will come any more."""
        with self._changed:
            return self._ended and not self._frames

    def take(self, wait_s: float) -> Picture | None:
        """Return the next frame, or None where none came in time."""
        with self._changed:
            if not self._frames and not self._ended:
                self._changed.wait(wait_s)
            if not self._frames:
                return None
            self._changed.notify_all()
            return self._frames.popleft()

    @property
    def waiting(self) -> int:
        """How many frames wait."""
        with self._changed:
            return len(self._frames)

    def _read(self) -> None:
        try:
            self._read_all()
        except Exception as error:  # noqa: BLE001 - raised by the session that takes the frames
            self.error = error
        finally:
            with self._changed:
                self._ended = True
                self._changed.notify_all()

    def _read_all(self) -> None:
        pace = _Pace(self.pictures.speed)
        with served_first(INTAKE, wanted=comes_in_time(self.pictures)):
            for index, picture in enumerate(self.pictures.frames(self._stop)):
                if index == 1 and self.pictures.waits:
                    # A film waits at its first frame until this frame is measured.
                    self._go.wait()
                given_s = time.perf_counter()
                due_s = pace.due_s(picture.time_s)
                if due_s is not None and self._stop.wait(max(0.0, due_s - time.perf_counter())):
                    return
                picture.index, picture.arrived_s = index, picture.arrived_s or max(given_s, due_s or given_s)
                pace.hold(self._put(picture))
                if self._stop.is_set():
                    return

    def _put(self, frame: Picture) -> float:
        """Let a frame wait for the tracker, and return for how long (s) there was no room for it."""
        with self._changed:
            begin_s = time.perf_counter()
            while self.pictures.waits and len(self._frames) >= self._patience and not self._stop.is_set():
                self._changed.wait(0.1)
                frame.arrived_s = time.perf_counter()
            held_s = max(0.0, frame.arrived_s - begin_s)
            self._frames.append(frame)
            if not self.pictures.waits:
                self._drop_beyond(self._patience)
            self._changed.notify_all()
        return held_s

    def _drop_beyond(self, count: int) -> None:
        """Drop the oldest waiting pictures beyond ``count``; their frames stay."""
        with_picture = [one for one in self._frames if one.luma is not None]
        for late in with_picture[: max(0, len(with_picture) - count)]:
            late.luma, late.dropped = None, True
            self.dropped += 1


class _Pace:
    """Instants at which the frames of a film are due, by the film's clock from the second frame on."""

    def __init__(self, speed: float | None) -> None:
        self._speed = speed
        self._begin: tuple[float, float] | None = None
        self._first_s: float | None = None

    def due_s(self, time_s: float) -> float | None:
        """Return the instant at which a frame is due; None where pictures arrive in real time."""
        if self._speed is None:
            return None
        if self._first_s is None:
            self._first_s = time_s
            return time.perf_counter()
        if self._begin is None:
            self._begin = (time.perf_counter(), self._first_s)
        begin, first_s = self._begin
        return begin + (time_s - first_s) / self._speed

    def hold(self, seconds: float) -> None:
        """Delay all later frames by the time for which the last frame found no room."""
        if self._begin is not None:
            self._begin = (self._begin[0] + seconds, self._begin[1])
