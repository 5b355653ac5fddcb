"""Sources of a live record: a playing film, a camera by number, a stream on this computer, a film that still grows."""

from __future__ import annotations

import re
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from torsight.core.errors import ConfigError
from torsight.viewer.live.frames.camera_source import Camera
from torsight.viewer.live.frames.intake import Picture, Pictures
from torsight.viewer.live.frames.stream import GrowingFilm, Stream
from tracker.frames.frame import FrameSource
from tracker.frames.source import open_source


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
