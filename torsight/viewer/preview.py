"""A small video of the film for the viewer; what is measured is always the film itself."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from torsight.core.progress import Progress, silent

if TYPE_CHECKING:
    from tracker.source import Frame

WIDEST_PX: Final = 640
MOST_FRAMES: Final = 1500
RATE_HZ: Final = 25
"""Rate of the preview's own clock; the recording says which film time each of its frames belongs to."""

_CODECS: Final = (
    # Shows in the viewer out of the box.
    ("libsvtav1", {"preset": "10", "crf": "38", "g": "50"}),
    # The viewer needs an ffmpeg executable for this one.
    ("libx264", {"preset": "veryfast", "crf": "26", "g": "50"}),
)

# Videos hold black to white as 16 to 235.
_VIDEO_LEVELS: Final = np.round(16.0 + np.arange(256) * (219.0 / 255.0)).astype(np.uint8)


@dataclass(frozen=True, slots=True, eq=False)
class Preview:
    """A preview on disk.

    Attributes
    ----------
    path : Path
        The mp4.
    frame : (k,) int64
        Which frames of the film it holds, in order.
    scale : float
        Pixels of the preview per pixel of the film.
    size_px : (int, int)
        Width and height of the preview.
    """

    path: Path
    frame: NDArray[np.int64]
    scale: float
    size_px: tuple[int, int]


def write_preview(film: str | Path, path: Path, *, frame_count: int, progress: Progress = silent) -> Preview:
    """Write an mp4 of at most :data:`MOST_FRAMES` frames, evenly chosen among ``frame_count``, in grey.

    ``progress`` is told after every frame that was looked at.

    Raises
    ------
    InputError
        When the film cannot be read.
    """
    import av

    from tracker.source import open_source

    source = open_source(film)
    stride = max(1, math.ceil(frame_count / MOST_FRAMES))
    scale = min(1.0, WIDEST_PX / source.size_px[0])
    # Encoders of 4:2:0 pictures need even sizes.
    width, height = (max(2, 2 * round(size * scale / 2)) for size in source.size_px)
    # The encoder tells its settings on standard error unless it is told to keep to errors.
    os.environ.setdefault("SVT_LOG", "1")
    chosen: list[int] = []
    with av.open(str(path), "w", format="mp4") as container:
        codec, options = next(one for one in _CODECS if one[0] in av.codecs_available)
        stream: Any = container.add_stream(codec, rate=RATE_HZ, options=options)
        stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
        last = np.zeros((height, width), np.uint8)
        for frame in source:
            if frame.index >= frame_count:
                break
            progress("recording", frame.index, frame_count)
            if frame.index % stride:
                continue
            last = _fitted(frame, last)
            picture = _picture(last)
            picture.pts = len(chosen)
            container.mux(stream.encode(picture))
            chosen.append(frame.index)
        container.mux(stream.encode())
    return Preview(path, np.array(chosen, dtype=np.int64), width / source.size_px[0], (width, height))


def _fitted(frame: Frame, last: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the frame at the preview's size; one that could not be decoded shows the last picture."""
    import cv2

    if frame.luma is None:
        return last
    if frame.luma.shape == last.shape:
        return frame.luma
    return np.asarray(cv2.resize(frame.luma, last.shape[::-1], interpolation=cv2.INTER_AREA), dtype=np.uint8)


def _picture(luma: NDArray[np.uint8]) -> Any:
    import av

    colourless = np.full((luma.shape[0] // 2, luma.shape[1]), 128, np.uint8)
    return av.VideoFrame.from_ndarray(np.vstack([_VIDEO_LEVELS[luma], colourless]), format="yuv420p")
