"""A camera of this computer: its pictures, the times at which they were taken, and the number of lost pictures."""

from __future__ import annotations

import statistics
import threading
import time
from collections import deque
from collections.abc import Iterator
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from torsight.core.errors import InputError
from torsight.core.progress import ATTENTION_S, THOUGHT_S
from torsight.viewer.live.frames.intake import WAITING_FRAMES, Picture, Pictures

SILENT_S: Final = ATTENTION_S
"""A camera or a stream that gives no picture for this long has ended."""

_RECENT_S: Final = THOUGHT_S
"""A driver's timestamp is taken as an instant of this computer's clock where it is no older than this: a larger delay
would be noticed by anyone who looks at rig and screen."""
_STEPS: Final = WAITING_FRAMES + 1
"""Number of time steps whose median is the usual step: a second of a usual camera, and an odd number."""


def open_capture(number: int, fps: float | None) -> cv2.VideoCapture:
    """Open OpenCV's capture of a camera, at a rate if one is given, without OpenCV's messages."""
    level = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(0)
    try:
        capture = cv2.VideoCapture(number)
    finally:
        cv2.utils.logging.setLogLevel(level)
    if fps is not None and capture.isOpened():
        capture.set(cv2.CAP_PROP_FPS, fps)
    return capture


class Camera(Pictures):
    """A camera by its number; times are those of its driver where it gives them, else those of arrival.

    ``fps`` is the rate to ask of it. That there is none is an :class:`~torsight.core.errors.InputError`.
    """

    kind = "camera"

    def __init__(self, number: int, *, fps: float | None = None) -> None:
        super().__init__(f"camera {number}")
        self._capture = open_capture(number, fps)
        if not self._capture.isOpened():
            raise InputError(
                "there is no camera of this number, or another program has it",
                where=self.name,
                do="plug it in, close other programs, or try another number; a film is given by its path",
            )

    def frames(self, stop: threading.Event) -> Iterator[Picture]:
        """Give the camera's pictures until it goes silent."""
        clock = _Timestamps()
        last = time.perf_counter()
        try:
            while not stop.is_set():
                good = self._capture.grab()
                now = time.perf_counter()
                if not good:
                    if now - last > SILENT_S:
                        self.ended_because = f"no picture for {SILENT_S:g} s; it may have been unplugged"
                        return
                    stop.wait(0.01)
                    continue
                last = now
                taken_s, missed = clock.of(now, 1e-3 * self._capture.get(cv2.CAP_PROP_POS_MSEC))
                read, picture = self._capture.retrieve()
                luma = _luma(picture) if read else None
                yield Picture(taken_s - clock.begin_s, luma, not read, arrived_s=taken_s, missed=missed)
        finally:
            self._capture.release()


def _luma(picture: Any) -> NDArray[np.uint8]:
    grey = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY) if np.ndim(picture) == 3 else picture
    return np.asarray(grey, dtype=np.uint8)


class _Timestamps:
    """Times at which the pictures were taken, and the number of lost pictures before each."""

    def __init__(self) -> None:
        self.begin_s = 0.0
        self._last_s: float | None = None
        self._by_driver = False
        self._steps: deque[float] = deque(maxlen=_STEPS)

    def of(self, now_s: float, driver_s: float) -> tuple[float, int]:
        """Return the time of a picture on this computer's clock, and the number of lost pictures just before it."""
        by_driver = 0.0 <= now_s - driver_s < _RECENT_S and driver_s > 0.0
        if self._last_s is None:
            self._by_driver = by_driver
        taken_s = driver_s if self._by_driver and by_driver else now_s
        if self._last_s is None:
            self.begin_s = self._last_s = taken_s
            return taken_s, 0
        # A driver whose timestamps repeat or go back is not used; the computer's clock is used instead.
        taken_s = taken_s if taken_s > self._last_s else max(now_s, self._last_s + 1e-6)
        step_s, self._last_s = taken_s - self._last_s, taken_s
        usual_s = statistics.median(self._steps) if len(self._steps) >= 5 else None
        self._steps.append(step_s)
        steps = 1 if usual_s is None else round(step_s / usual_s)
        # A double step is a lost picture; an arrival, unlike a timestamp, may be late by one step, because of other
        # programs.
        return taken_s, steps - 1 if steps > (1 if self._by_driver else 2) else 0
