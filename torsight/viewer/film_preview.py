"""A small video of the film for the viewer; measurements always use the film itself."""

from __future__ import annotations

import contextlib
import json
import math
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import IO, TYPE_CHECKING, Final, cast

import numpy as np
from numpy.typing import NDArray

from torsight.core.errors import NoResultError
from torsight.core.progress import STUCK_S, Progress, silent
from torsight.core.units import Ints
from torsight.viewer import encoding
from torsight.viewer.view_layout import WINDOW_PX
from tracker.frames.frame import DEFAULT_FPS

if TYPE_CHECKING:
    from tracker.frames.frame import Frame

WIDEST_PX: Final = WINDOW_PX[0] // 2
"""Width of the preview; a wider film is shrunk. Its pane takes four tenths of the window."""
RATE_HZ: Final = round(DEFAULT_FPS)
"""Rate of the preview's own clock, the usual one: any rate would do, because the recording gives the film time of each
frame of the preview."""
MOST_FRAMES: Final = 60 * RATE_HZ
"""Frames of the preview: a minute of it."""

ENCODER: Final = Path(encoding.__file__)
CODECS: Final = ("libsvtav1", "libsvtav1", "libx264")
"""Encoders, tried in order until one finishes. The viewer decodes AV1 itself; for H.264 it needs ffmpeg."""

# Videos hold black to white as 16 to 235.
_VIDEO_LEVELS: Final = np.round(16.0 + np.arange(256) * (219.0 / 255.0)).astype(np.uint8)


@dataclass(frozen=True, slots=True, eq=False)
class Preview:
    """A preview on disk: the mp4 and its size, which frames (k,) it holds, and its pixels per pixel of the film."""

    path: Path
    frame: Ints
    scale: float
    size_px: tuple[int, int]


def write_preview(film: str | Path, path: Path, *, frame_count: int, progress: Progress = silent) -> Preview:
    """Write an mp4 of at most :data:`MOST_FRAMES` frames, evenly chosen among ``frame_count``, in grey.

    ``progress`` is called after every frame that was read.

    Raises InputError when the film cannot be read; OSError when the file cannot be written; NoResultError when no
    encoder finishes.
    """
    said = ""
    for codec in CODECS:
        try:
            return _encoded(film, path, codec=codec, frame_count=frame_count, progress=progress)
        except _StuckError as error:
            said = str(error)
    raise NoResultError(
        "the film's small copy for the viewer could not be encoded",
        where=str(film),
        value=said or None,
        limit=f"{STUCK_S:g} s for one picture",
        do="is this computer very busy? The measurements are saved: the same command with --resume tries again",
    )


class _StuckError(Exception):
    """An encoder that ended before its work was done; with its message."""


def _encoded(film: str | Path, path: Path, *, codec: str, frame_count: int, progress: Progress) -> Preview:
    from tracker.frames.source import open_source

    source = open_source(film)
    stride = max(1, math.ceil(frame_count / MOST_FRAMES))
    scale = min(1.0, WIDEST_PX / source.size_px[0])
    # Encoders of 4:2:0 pictures need even sizes.
    width, height = (max(2, 2 * round(size * scale / 2)) for size in source.size_px)
    chosen: list[int] = []
    last = np.zeros((height, width), np.uint8)
    words = [str(path), codec, str(width), str(height), str(RATE_HZ), str(STUCK_S)]
    with subprocess.Popen(
        [sys.executable, "-P", str(ENCODER), *words], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as encoder:
        pictures, said = cast("IO[bytes]", encoder.stdin), cast("IO[bytes]", encoder.stdout)
        try:
            with contextlib.suppress(BrokenPipeError):  # then its exit code says why
                for frame in source:
                    if frame.index >= frame_count:
                        break
                    progress("recording", frame.index, frame_count)
                    if frame.index % stride:
                        continue
                    last = _fitted(frame, last)
                    pictures.write(encoding.PICTURE + _VIDEO_LEVELS[last].tobytes())
                    chosen.append(frame.index)
                pictures.write(encoding.END)
                pictures.close()
            answer = said.read()
        except BaseException:
            encoder.kill()
            raise
        finally:
            # An error from data still buffered for an encoder that has ended must not hide why the encoder ended.
            with contextlib.suppress(BrokenPipeError):
                pictures.close()
    if encoder.returncode != 0:
        raise _StuckError(trouble_of(answer))
    return Preview(path, np.array(chosen, dtype=np.int64), width / source.size_px[0], (width, height))


def trouble_of(said: str | bytes) -> str:
    """Raise the disk error that a child process reported; return any other error message, empty where there is none."""
    try:
        trouble = json.loads(said)
    except ValueError:
        return ""
    if trouble["errno"] is not None:
        raise OSError(trouble["errno"], trouble["message"])
    return str(trouble["message"])


def _fitted(frame: Frame, last: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the frame at the preview's size; one that could not be decoded shows the last picture."""
    import cv2

    if frame.luma is None:
        return last
    if frame.luma.shape == last.shape:
        return frame.luma
    return np.asarray(cv2.resize(frame.luma, last.shape[::-1], interpolation=cv2.INTER_AREA), dtype=np.uint8)
