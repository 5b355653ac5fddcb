"""A picture to draw on, of the markers of a film."""

from __future__ import annotations

import math
from pathlib import Path
from string import ascii_lowercase
from typing import Any, Final

import cv2
import numpy as np

from torsight.core.files.storage import write_bytes
from torsight.core.units import Floats
from torsight.core.words.colours import Colour

BLACK: Final = (0, 0, 0)
WHITE: Final = (255, 255, 255)
MARGIN_PX: Final = 40
"""Room for two lines of text: beside a frame, above it, at the picture's edge."""
RING_PX: Final = 9.0
"""Radius of the ring around a marker that is not drawn to scale."""
_FINE: Final = 4
"""Binary digits of a pixel to which OpenCV draws."""
_QUICK: Final = (cv2.IMWRITE_PNG_COMPRESSION, 1, cv2.IMWRITE_PNG_FILTER, cv2.IMWRITE_PNG_FILTER_UP)
"""OpenCV tries five filters on every row: one of them takes half the time, and the file is no larger."""


class Sheet:
    """A white picture to draw on: by OpenCV, which the tracker has loaded; matplotlib takes as long as tracking starts.

    Positions are in pixels, y down; colours are red, green, blue.
    """

    def __init__(self, width: int, height: int) -> None:
        self.pixels = np.full((height, width, 3), 255, np.uint8)
        self._font: Any = cv2.FontFace("sans")

    def text(
        self,
        words: str,
        x: float,
        y: float,
        *,
        size: int = 13,
        bold: bool = False,
        right: bool = False,
        on: Colour | None = None,
    ) -> None:
        """Write words from a position, or up to it, with their lower edge there, ``on`` a colour or nothing."""
        weight = 700 if bold else 400
        width = cv2.getTextSize((1, 1), words, (0, 0), self._font, size, weight)[2] if right or on else 0
        left, base = round(x - width * right), round(y)
        if on is not None:
            cv2.rectangle(self.pixels, (left - 2, base - size), (left + width + 2, base + 3), on[::-1], cv2.FILLED)
        cv2.putText(self.pixels, words, (left, base), BLACK, self._font, size, weight)

    def line(self, points: Floats, colour: Colour) -> None:
        """Draw a line through points (n, 2)."""
        whole = np.rint(points * 2**_FINE).astype(np.int32)
        cv2.polylines(self.pixels, [whole], isClosed=False, color=colour[::-1], lineType=cv2.LINE_AA, shift=_FINE)

    def dashed(self, x: float, top: float, bottom: float, *, dash: int) -> None:
        """Draw an upright line of dashes, each as long as the gap after it."""
        for y in range(round(top), round(bottom), 2 * dash):
            self.line(np.array([[x, y], [x, min(y + dash, bottom)]]), BLACK)

    def ring(self, centre: Floats, radius: float, colour: Colour, *, cross: bool = True) -> None:
        """Draw a circle, with a cross in it."""
        x, y, fine = np.rint(np.append(centre, radius) * 2**_FINE).astype(int).tolist()
        cv2.circle(self.pixels, (x, y), fine, colour[::-1], 2, cv2.LINE_AA, _FINE)
        for off in ((4.0, 0.0), (0.0, 4.0)) if cross else ():
            self.line(np.stack([centre - off, centre + off]), colour)

    def tint(self, outline: Floats, colour: Colour, share: float) -> None:
        """Mix a colour into the inside of a polygon (n, 2)."""
        # A film may have a gap every few frames: only the part around each polygon is mixed.
        size = np.array(self.pixels.shape[1::-1])
        left, top = np.clip(np.floor(outline.min(axis=0)).astype(int) - 2, 0, size)
        right, bottom = np.clip(np.ceil(outline.max(axis=0)).astype(int) + 3, 0, size)
        part = self.pixels[top:bottom, left:right]
        over, inside = part.copy(), np.rint((outline - (left, top)) * 2**_FINE).astype(np.int32)
        cv2.fillPoly(over, [inside], colour[::-1], cv2.LINE_AA, _FINE)
        part[:] = cv2.addWeighted(over, share, part, 1.0 - share, 0.0)

    def write(self, path: Path) -> None:
        """Write the picture as a PNG file, compressed quickly."""
        _, coded = cv2.imencode(".png", self.pixels, _QUICK)
        write_bytes(path, coded.tobytes())


def letters_in(width_px: float) -> int:
    """Return the number of letters that a line of a sheet holds."""
    drawn_px = cv2.getTextSize((1, 1), ascii_lowercase, (0, 0), cv2.FontFace("sans"), 13, 400)[2]
    return int(width_px / drawn_px * len(ascii_lowercase))


def ticks(low: float, high: float, *, about: int = 6) -> list[float]:
    """Return round numbers between two bounds."""
    rough = (high - low) / about
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(size * power for size in (1.0, 2.0, 5.0, 10.0) if size * power >= rough)
    return [number * step for number in range(math.ceil(low / step), math.floor(high / step) + 1)]
