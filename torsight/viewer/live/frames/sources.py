"""Sources of a live record: a playing film, a camera by number, a stream on this computer, a film that still grows."""

from __future__ import annotations

import re
import statistics
import threading
import time
from collections import deque
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final
from urllib.parse import urlsplit

import av
import cv2
import numpy as np
from numpy.typing import NDArray

from torsight.core.errors import ConfigError, InputError, reason_of
from torsight.core.files.paths import LOOPBACK
from torsight.core.progress import ATTENTION_S, THOUGHT_S
from torsight.viewer.live.frames.intake import WAITING_FRAMES, Picture, Pictures
from tracker.frames.display import Display, luma_of
from tracker.frames.frame import FrameSource
from tracker.frames.source import open_source

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


LOOPBACK_HOSTS: Final = ("localhost", LOOPBACK, "::1")

_OPTIONS: Final[Mapping[str, Mapping[str, str]]] = {
    # Over UDP it would open ports to other computers.
    "rtsp": {"rtsp_transport": "tcp"},
    "udp": {"localaddr": LOOPBACK},
    "tcp": {},
    "http": {},
    "https": {},
    "rtmp": {},
}
"""Kinds of streams and what keeps each of them on this computer."""


def check_stream(url: str) -> str:
    """Return the kind of a stream on this computer."""
    parts = urlsplit(url)
    if parts.scheme not in _OPTIONS:
        raise ConfigError(
            "is no stream that can be watched",
            where="SOURCE",
            value=url,
            limit=", ".join(f"{name}://" for name in _OPTIONS),
            do="name a film by its path, a camera by its number",
        )
    if (parts.hostname or "") not in LOOPBACK_HOSTS:
        raise ConfigError(
            "is on another computer" if parts.hostname else "would listen to other computers",
            where="SOURCE",
            value=url,
            limit="a stream on this computer (localhost, 127.0.0.1)",
            do="relay it to a port of this computer",
        )
    return parts.scheme


class Stream(Pictures):
    """A stream on this computer in real time; times are the stream's own timestamps."""

    kind = "stream"

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self._options = {"fflags": "nobuffer", **_OPTIONS[check_stream(name)]}

    def frames(self, stop: threading.Event) -> Iterator[Picture]:
        """Give the stream's frames until it ends or is silent."""
        given = 0
        try:
            with av.open(self.name, options=self._options, timeout=SILENT_S) as container:
                for picture in _decoded(container, stop, name=self.name):
                    given += 1
                    yield picture
        except av.error.ExitError as error:
            if not given:
                raise self._unreadable(f"gave no picture within {SILENT_S:g} s") from error
            self.ended_because = f"no picture for {SILENT_S:g} s"
        except (av.error.FFmpegError, OSError) as error:
            if not given:
                raise self._unreadable(f"cannot be read ({reason_of(error)})") from error
            self.ended_because = reason_of(error)

    def _unreadable(self, what: str) -> InputError:
        return InputError(what, where=self.name, do="check that whatever sends it is running")


class GrowingFilm(Pictures):
    """A film that is still being written, which ends when it has not grown for a while.

    Its format is .mkv, .ts or .avi, which can be read before the file is finished.
    """

    kind = "growing film"
    waits = True

    def __init__(self, path: Path) -> None:
        if not path.is_file():
            raise InputError("no such film", where=str(path), do="start the recording first, or check the path")
        super().__init__(str(path))
        self._path = path

    def frames(self, stop: threading.Event) -> Iterator[Picture]:
        """Give the film's frames, including those that are written meanwhile."""
        growing = _Growing(self._path, stop)
        try:
            with av.open(growing) as container:
                yield from _decoded(container, stop, name=self.name)
        except (av.error.FFmpegError, OSError) as error:
            raise InputError(
                f"cannot be read ({reason_of(error)})",
                where=self.name,
                do="a film that grows must be .mkv or .ts: others can be read only when they are finished",
            ) from error
        finally:
            growing.close()


def _decoded(container: Any, stop: threading.Event, *, name: str) -> Iterator[Picture]:
    if not container.streams.video:
        raise InputError("has no video stream", where=name)
    stream = container.streams.video[0]
    # Decoding one frame per thread would delay frames.
    stream.thread_type = "SLICE"
    first: float | None = None
    missed, display = 0, Display()
    for packet in container.demux(stream):
        arrived_s = time.perf_counter()
        if stop.is_set():
            return
        try:
            pictures = packet.decode()
        except av.error.InvalidDataError:
            missed += 1
            continue
        for picture in pictures:
            timestamp = picture.time if picture.time is not None else arrived_s
            first = timestamp if first is None else first
            corrupt = bool(picture.is_corrupt)
            yield Picture(
                timestamp - first, luma_of(picture, display).copy(), corrupt, arrived_s=arrived_s, missed=missed
            )
            missed = 0


class _Growing:
    """A file that is read while it is written: at its end, reading waits for more."""

    def __init__(self, path: Path, stop: threading.Event) -> None:
        self._file = path.open("rb")
        self._stop = stop

    def read(self, size: int) -> bytes:
        """Return up to ``size`` bytes, nothing once the file has not grown for a while."""
        end = time.monotonic() + SILENT_S
        while not self._stop.is_set():
            data = self._file.read(size)
            if data:
                return data
            if time.monotonic() > end:
                break
            self._stop.wait(0.02)
        return b""

    def close(self) -> None:
        """Let go of the file."""
        self._file.close()


def open_pictures(source: str, *, speed: float = 1.0, fps: float | None = None, grows: bool = False) -> Pictures:
    """Open a source: a camera by its number, a stream on this computer, a film, or a row of pictures.

    A film plays at ``speed`` times its own pace; ``fps`` is the rate of pictures, or the rate to request from a camera.
    A film that ``grows`` is still being written: at its end more frames are waited for.

    Raises ConfigError when the stream is on another computer, or ``speed`` or ``fps`` is not above 0; InputError when
    there is no such camera, film or stream.
    """
    if not (np.isfinite(speed) and speed > 0.0):
        raise ConfigError("is no speed", where="--speed", value=speed, limit="above 0")
    if fps is not None and not (np.isfinite(fps) and fps > 0.0):
        raise ConfigError("is no frame rate", where="--fps", value=fps, limit="above 0")
    if re.fullmatch(r"\d+", source) and not Path(source).exists():
        return Camera(int(source), fps=fps)
    if re.match(r"[a-zA-Z][a-zA-Z0-9+.-]*://", source):
        return Stream(source)
    if grows:
        return GrowingFilm(Path(source))
    return Film(open_source(source, fps=fps), name=source, speed=speed)


def film_of(pictures: Pictures) -> str | None:
    """Return the film that is watched; None for a camera or a stream."""
    return pictures.name if isinstance(pictures, Film | GrowingFilm) else None


class Film(Pictures):
    """A film, or a row of pictures, at its own pace."""

    waits = True

    def __init__(self, source: FrameSource, *, name: str, speed: float) -> None:
        super().__init__(name)
        self.pixel_aspect = source.pixel_aspect
        self.speed = speed
        self._source = source

    def frames(self, stop: threading.Event) -> Iterator[Picture]:
        """Give the film's frames."""
        for frame in self._source:
            if stop.is_set():
                return
            yield Picture(frame.time_s, None if frame.luma is None else frame.luma.copy(), frame.damaged)

    def describe(self) -> dict[str, Any]:
        """Return the description of the film for ``track.json``."""
        return {**self._source.describe(), "speed": self.speed}
