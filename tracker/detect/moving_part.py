"""What moves in a film, by its pictures alone: whether anything does, and the motion blur that hides dots on it."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from torsight.core.units import Flags
from tracker.appearance.lucas_kanade import Luma
from tracker.detect.dots import FAINTEST, SMALLEST_PX
from tracker.frames.frame import Frame, pictures_of

SHARPER: Final = "film with a shorter shutter time and more light, or move more slowly"
_MOVED_GREY: Final = 25
"""Smallest change of a pixel that is motion and not noise (of 2 to 8 grey levels)."""
MOVED_PX: Final = 60
"""Fewest moved pixels from which motion blur or interlacing is judged: a few dots' area."""
LOOKED_AT: Final = 5
"""Number of frames that are examined, each with the next one, and of frames with which they are compared."""
_WINDOW: Final = np.ones((9, 9), np.uint8)
_SMEARED: Final = 1.25
"""Width of the edges of what moves, over that of edges at rest, above which motion blur hides dots. On drawn films with
5 to 60 px of motion per frame it is 0.99 to 1.04 where they are sharp, and 1.5 to 2.7 where no dots are found."""


def differs(picture: Luma, other: Luma) -> bool:
    """Return whether two pictures differ by the contrast of the faintest dot, on the area of the smallest one.

    Sums over that area are compared, in whose means noise is five times smaller.
    """
    side = round(2.0 * SMALLEST_PX)
    one, two = (cv2.boxFilter(each, cv2.CV_16U, (side, side), normalize=False) for each in (picture, other))
    return int(np.count_nonzero(cv2.absdiff(one, two) > FAINTEST * side**2)) > side**2


def motion_blur(source: Iterable[Frame], first: int, last: int) -> str | None:
    """Return the motion blur in the frames ``first`` to ``last`` of a source in words, empty where what moves is sharp.

    None where nothing moves.
    """
    looked = np.unique(np.linspace(first, last - 1, LOOKED_AT).astype(int))
    found = pictures_of(source, {*looked.tolist(), *(looked + 1).tolist()})
    pairs = [(found[index], found[index + 1]) for index in looked.tolist() if {index, index + 1} <= set(found)]
    widths = [width for pair in pairs if (width := _width_of_moving(*pair)) is not None]
    if not widths:
        return None
    width = float(np.median(widths))
    return f"motion blur: edges of what moves are {width:.1f} times as wide as others" if width > _SMEARED else ""


def _width_of_moving(picture: Luma, after: Luma) -> float | None:
    """Return the width of a picture's edges where it differs from the next one, over that elsewhere.

    None where nothing moved. The width is the change of brightness nearby over the steepest gradient there.
    """
    moved = moved_in(picture, after)
    if moved.sum() < MOVED_PX:
        return None
    gradient, change = edges_in(picture)
    width, edges = change / np.maximum(cv2.dilate(gradient, _WINDOW), 1.0), change > _MOVED_GREY
    parts = [width[edges & part] for part in (moved, ~moved)]
    return float(np.median(parts[0]) / np.median(parts[1])) if all(map(len, parts)) else None


def moved_in(picture: Luma, other: Luma) -> Flags:
    """Return the mask (h, w) of the pixels in which two pictures differ by more than noise."""
    return np.asarray(cv2.absdiff(picture, other) > _MOVED_GREY)


def edges_in(picture: Luma) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the gradient of a picture (h, w), grey levels per px, and the change of brightness around every pixel."""
    gradient = np.hypot(*(cv2.Sobel(picture, cv2.CV_32F, *order, ksize=3) / 8.0 for order in ((1, 0), (0, 1))))
    change = cv2.dilate(picture, _WINDOW).astype(np.float32) - cv2.erode(picture, _WINDOW)
    return gradient.astype(np.float32, copy=False), change
