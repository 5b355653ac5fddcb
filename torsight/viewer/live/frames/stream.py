"""A stream on this computer, or a film that another program is still writing."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final
from urllib.parse import urlsplit

import av

from torsight.core.errors import ConfigError, InputError, reason_of
from torsight.core.files.paths import LOOPBACK
from torsight.viewer.live.frames.camera_source import SILENT_S
from torsight.viewer.live.frames.intake import Picture, Pictures
from tracker.frames.display import Display, luma_of

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
