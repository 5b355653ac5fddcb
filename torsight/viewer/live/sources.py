"""What can be watched: a film that plays, a camera by number, a stream on this computer, a film that still grows."""

from __future__ import annotations

import re
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final
from urllib.parse import urlsplit

import numpy as np
from numpy.typing import NDArray

from torsight.core.errors import ConfigError, InputError

if TYPE_CHECKING:
    from torsight.viewer.live.intake import Pictures
    from tracker.source import FrameSource

LOOPBACK_HOSTS: Final = ("localhost", "127.0.0.1", "::1", "")
IDLE_S: Final = 10.0
"""A film that has not grown for this long, or a stream that was silent, has ended."""


def open_pictures(source: str, *, speed: float = 1.0, fps: float | None = None, grows: bool = False) -> Pictures:
    """Open what is to be watched.

    Parameters
    ----------
    source : str
        Number of a camera, URL of a stream on this computer, film, folder or glob of pictures.
    speed : float
        How much faster than its own pace a film plays.
    fps : float, optional
        Frame rate of pictures.
    grows : bool
        The film is still being written: wait for more where it ends.

    Raises
    ------
    ConfigError
        When the stream is on another computer, or ``speed`` is not above 0.
    InputError
        When there is no such camera, film or stream.
    """
    if not (np.isfinite(speed) and speed > 0.0):
        raise ConfigError("is no speed", where="--speed", value=speed, limit="above 0")
    if re.fullmatch(r"\d+", source):
        return Camera(int(source))
    if re.match(r"[a-z][a-z0-9+.-]*://", source):
        host = urlsplit(source).hostname or ""
        if host not in LOOPBACK_HOSTS:
            raise ConfigError(
                "is on another computer",
                where="SOURCE",
                value=source,
                limit="a stream on this computer (localhost, 127.0.0.1)",
                do="relay it to a port of this computer",
            )
        return Stream(source)
    if grows:
        path = Path(source)
        if not path.is_file():
            raise InputError("no such film", where=source, do="start the recording first, or check the path")
        return Stream(source, grows=True)
    from tracker.source import open_source

    return Film(open_source(source, fps=fps), name=source, speed=speed)


class Film:
    """A film, or a row of pictures, at its own pace."""

    def __init__(self, source: FrameSource, *, name: str, speed: float) -> None:
        self.name = name
        self.speed: float | None = speed
        self._source = source

    def frames(self, stop: threading.Event) -> Iterator[tuple[float, NDArray[np.uint8] | None, bool]]:
        """Give the film's frames."""
        for frame in self._source:
            if stop.is_set():
                return
            yield frame.time_s, None if frame.luma is None else frame.luma.copy(), frame.damaged

    def describe(self) -> dict[str, Any]:
        """Return what is known of the film."""
        return {**self._source.describe(), "speed": self.speed}


class Camera:
    """A camera of this computer, by its number; times are those at which its pictures were there."""

    speed: float | None = None

    def __init__(self, number: int) -> None:
        import cv2

        self.name = f"camera {number}"
        self._capture = cv2.VideoCapture(number)
        if not self._capture.isOpened():
            raise InputError(
                "there is no camera of this number, or another program has it",
                where=self.name,
                do="plug it in, close other programs, or try another number",
            )

    def frames(self, stop: threading.Event) -> Iterator[tuple[float, NDArray[np.uint8] | None, bool]]:
        """Give the camera's pictures until it goes silent."""
        import cv2

        begin: float | None = None
        last = time.perf_counter()
        try:
            while not stop.is_set():
                good = self._capture.grab()
                now = time.perf_counter()
                if not good:
                    if now - last > IDLE_S:
                        return
                    stop.wait(0.01)
                    continue
                last = now
                begin = now if begin is None else begin
                read, picture = self._capture.retrieve()
                if read and picture.ndim == 3:
                    picture = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
                yield now - begin, np.asarray(picture, dtype=np.uint8) if read else None, not read
        finally:
            self._capture.release()

    def describe(self) -> dict[str, Any]:
        """Return what is known of the camera."""
        return {"kind": "camera", "name": self.name}


class Stream:
    """A stream, or a film that still grows, as it comes; times are its own stamps."""

    speed: float | None = None

    def __init__(self, name: str, *, grows: bool = False) -> None:
        self.name = name
        self._grows = grows

    def frames(self, stop: threading.Event) -> Iterator[tuple[float, NDArray[np.uint8] | None, bool]]:
        """Give the stream's frames until it ends or is silent."""
        import av

        growing = _Growing(Path(self.name), stop) if self._grows else None
        try:
            with av.open(growing or self.name, timeout=None if self._grows else IDLE_S) as container:
                if not container.streams.video:
                    raise InputError("has no video stream", where=self.name)
                yield from self._decoded(container, stop)
        except av.error.ExitError:
            return
        except (av.error.FFmpegError, OSError) as error:
            raise InputError(
                f"cannot be read ({error.strerror or error})",
                where=self.name,
                do="check that it is running; a film that grows must be .mkv or .ts",
            ) from error
        finally:
            if growing is not None:
                growing.close()

    def _decoded(self, container: Any, stop: threading.Event) -> Iterator[tuple[float, NDArray[np.uint8] | None, bool]]:
        import av

        first: float | None = None
        for packet in container.demux(container.streams.video[0]):
            if stop.is_set():
                return
            try:
                pictures = packet.decode()
            except av.error.InvalidDataError:
                continue
            for picture in pictures:
                stamp = picture.time if picture.time is not None else time.perf_counter()
                first = stamp if first is None else first
                yield stamp - first, luma_of(picture), bool(picture.is_corrupt)

    def describe(self) -> dict[str, Any]:
        """Return what is known of the stream."""
        return {"kind": "growing film" if self._grows else "stream", "name": self.name}


def luma_of(picture: Any) -> NDArray[np.uint8]:
    """Return the brightness of a decoded frame; its first plane where that is it."""
    if str(picture.format.name).startswith(("yuv4", "yuvj4", "gray", "nv12")) and "1" not in picture.format.name[7:]:
        plane = picture.planes[0]
        rows = np.frombuffer(plane, np.uint8).reshape(-1, plane.line_size)
        return rows[: picture.height, : picture.width].copy()
    return np.asarray(picture.to_ndarray(format="gray"), dtype=np.uint8)


class _Growing:
    """A file that is read while it is written: at its end, reading waits for more."""

    def __init__(self, path: Path, stop: threading.Event) -> None:
        self._file = path.open("rb")
        self._stop = stop

    def read(self, size: int) -> bytes:
        """Return up to ``size`` bytes, nothing once the file has not grown for a while."""
        end = time.monotonic() + IDLE_S
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
