"""Frames as they arrive: a film at its own pace, a camera, a stream, a film that is still being written."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

WAITING_FRAMES: Final = 6
"""Frames that may wait for the tracker; the oldest of more gives up its picture."""

WAITING_AT_START: Final = 400
"""Frames that may wait while the markers are looked for, which takes a second or two."""


@dataclass(slots=True, eq=False)
class LiveFrame:
    """One frame as it arrived.

    Attributes
    ----------
    index : int
        From 0, none missing: a frame that was dropped keeps its number and its time.
    time_s : float
        On the film's clock, from the first frame.
    luma : (h, w) uint8 or None
        Brightness; None where the frame was dropped or could not be decoded.
    arrived_s : float
        ``time.perf_counter()`` when it was there.
    damaged, dropped : bool
        Why there is no (whole) picture.
    """

    index: int
    time_s: float
    luma: NDArray[np.uint8] | None
    arrived_s: float
    damaged: bool = False
    dropped: bool = False


class Pictures(Protocol):
    """What gives pictures one after the other, with their times."""

    name: str
    speed: float | None
    """Factor on the film's own pace; None where pictures come when they come."""

    def frames(self, stop: threading.Event) -> Iterator[tuple[float, NDArray[np.uint8] | None, bool]]:
        """Give time (s), luma and whether it is damaged, until the end or until ``stop``."""

    def describe(self) -> dict[str, Any]:
        """Return what is known of the source, for ``track.json``."""


class Intake:
    """Reads pictures in a thread of its own and hands them on; drops the oldest picture rather than fall behind.

    Parameters
    ----------
    pictures : Pictures
        The source.
    """

    def __init__(self, pictures: Pictures) -> None:
        self.pictures = pictures
        self.dropped = 0
        self.error: Exception | None = None
        self._patience = WAITING_AT_START
        self._go = threading.Event()
        self._stop = threading.Event()
        self._frames: deque[LiveFrame] = deque()
        self._changed = threading.Condition()
        self._ended = False
        self._thread = threading.Thread(target=self._read, name="intake", daemon=True)

    def start(self) -> None:
        """Begin to read."""
        self._thread.start()

    def go(self) -> None:
        """Let a film play on past its first frame."""
        self._go.set()

    def hurry(self) -> None:
        """Keep few frames waiting from now on: the markers are found, and what waited has been taken."""
        self._patience = WAITING_FRAMES

    def stop(self) -> None:
        """Read no more; frames that wait can still be taken."""
        self._stop.set()
        self._go.set()

    @property
    def ended(self) -> bool:
        """Whether no frame will come any more."""
        with self._changed:
            return self._ended and not self._frames

    def take(self, wait_s: float) -> LiveFrame | None:
        """Return the next frame, or None where none came in time."""
        with self._changed:
            if not self._frames and not self._ended:
                self._changed.wait(wait_s)
            return self._frames.popleft() if self._frames else None

    @property
    def waiting(self) -> int:
        """How many frames wait."""
        with self._changed:
            return len(self._frames)

    def _read(self) -> None:
        try:
            self._read_all()
        except Exception as error:  # noqa: BLE001 - told by the session that takes the frames
            self.error = error
        finally:
            with self._changed:
                self._ended = True
                self._changed.notify_all()

    def _read_all(self) -> None:
        speed = self.pictures.speed
        begin: float | None = None
        first_s = 0.0
        for index, (time_s, luma, damaged) in enumerate(self.pictures.frames(self._stop)):
            if speed is not None and index > 0:
                if begin is None:
                    self._go.wait()
                    begin = time.perf_counter()
                if self._stop.wait(max(0.0, begin + (time_s - first_s) / speed - time.perf_counter())):
                    return
            elif index == 0:
                first_s = time_s
            self._put(LiveFrame(index, time_s, luma, time.perf_counter(), damaged=damaged))
            if self._stop.is_set():
                return

    def _put(self, frame: LiveFrame) -> None:
        with self._changed:
            self._frames.append(frame)
            with_picture = [one for one in self._frames if one.luma is not None]
            for late in with_picture[: max(0, len(with_picture) - self._patience)]:
                late.luma, late.dropped = None, True
                self.dropped += 1
            self._changed.notify_all()
