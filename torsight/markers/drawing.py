"""Common parts of the pictures of a film's markers: a canvas, a frame as background, candidates, named markers.

They are drawn with OpenCV, which a track has loaded anyway: importing a plotting library takes longer than tracking a
short film.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from torsight.core.files.small_pictures import encoded
from torsight.core.files.storage import write_bytes
from torsight.core.series import runs
from torsight.core.tracks import MARKERS
from torsight.core.units import Floats
from torsight.core.words.colours import BASE_COLOUR, LIGHT, MOVING_COLOUR, Colour, rgb

if TYPE_CHECKING:
    from tracker.detect.candidates import Candidate

Box = tuple[float, float, float, float]
"""Left, top, width, height in pixels."""
Ticks = Iterable[tuple[float, float]]
"""Lines of a grid: position in pixels of the plot, number."""
SHOWN_PX: Final = 960
"""Longer side of a frame in a page or a picture: smaller ones are enlarged, larger ones shrunk."""
DOT: Final = rgb(LIGHT["held"])
"""A dot that was not taken."""
REFUSED: Final[Colour] = (204, 121, 167)
"""A candidate that is no dot."""
PLAIN: Final[Colour] = (51, 51, 51)
WHITE: Final[Colour] = (255, 255, 255)
BLACK: Final[Colour] = (0, 0, 0)
TEXT_PX: Final = 12
"""Usual height of letters."""
_REGULAR: Final = 400
_BOLD: Final = 600
"""Weights of the font, as in CSS."""
_SHIFT: Final = 4
"""Binary digits of a coordinate after the point, for OpenCV's anti-aliased lines."""
_BEFORE: Final = {"left": 0.0, "center": 0.5, "right": 1.0}
"""Share of a line of text that lies before its position, by alignment."""
_DOT_PX: Final = 2
"""Length of the pieces of a dotted ring, and of the gaps between them."""


class Canvas:
    """A picture (h, w, 3) that is changed in place, with OpenCV's order of channels: blue, green, red.

    Positions are x and y in pixels from the upper left pixel, colours are given as red, green, blue.
    """

    def __init__(self, pixels: NDArray[np.uint8]) -> None:
        self.pixels = pixels
        self._face: Any = cv2.FontFace("sans")

    @staticmethod
    def blank(size_px: tuple[float, float]) -> Canvas:
        """Return a white canvas of a width and height."""
        return Canvas(np.full((round(size_px[1]), round(size_px[0]), 3), 255, np.uint8))

    def part(self, box_px: Box) -> Canvas:
        """Return a part ``(left, top, width, height)`` as a canvas: drawings are clipped at its border."""
        left, top, width, height = (round(value) for value in box_px)
        return Canvas(self.pixels[top : top + height, left : left + width])

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height."""
        return self.pixels.shape[1], self.pixels.shape[0]

    def text(
        self,
        place_px: tuple[float, float],
        words: str,
        *,
        colour: Colour = PLAIN,
        size_px: int = TEXT_PX,
        bold: bool = False,
        align: str = "left",
    ) -> None:
        """Write one line of text; its base line begins, is centred or ends at a position."""
        before = _BEFORE[align] * self.width_of(words)
        at = (round(place_px[0] - before), round(place_px[1]))
        cv2.putText(self.pixels, words, at, colour[::-1], self._face, size_px, _BOLD if bold else _REGULAR)

    def text_upwards(self, place_px: tuple[float, float], words: str) -> None:
        """Write one line of text upwards, its middle at a position."""
        _, _, wide, tall = self._extent(words)
        line = Canvas.blank((wide + 4, tall + 8))
        line.text((2, tall), words)
        turned = cv2.rotate(line.pixels, cv2.ROTATE_90_COUNTERCLOCKWISE)
        top, left = round(place_px[1] - turned.shape[0] / 2), round(place_px[0] - turned.shape[1] / 2)
        self.pixels[max(top, 0) : top + turned.shape[0], left : left + turned.shape[1]] = turned[max(-top, 0) :]

    def label(self, place_px: tuple[float, float], words: str, colour: Colour) -> None:
        """Write black text on a coloured box, its lower left corner at a position, or as near as there is room."""
        _, top, wide, tall = self._extent(words)
        x = max(0, min(round(place_px[0]), self.size_px[0] - wide - 7))
        y = max(tall + 3, round(place_px[1]))
        cv2.rectangle(self.pixels, (x, y - tall - 3), (x + wide + 6, y), colour[::-1], cv2.FILLED)
        self.text((x + 3, y - tall - 1 - top), words, colour=BLACK)

    def width_of(self, words: str) -> int:
        """Return the width of a line of text in pixels."""
        return self._extent(words)[2]

    def _extent(self, words: str) -> tuple[int, int, int, int]:
        left, top, wide, tall = cv2.getTextSize((1, 1), words, (0, 0), self._face, TEXT_PX, _REGULAR)
        return int(left), int(top), int(wide), int(tall)

    def line(self, points_px: Floats, colour: Colour, *, width_px: int = 1) -> None:
        """Draw the line through positions (n, 2); it is interrupted at NaN."""
        for begin, end in runs(np.asarray(np.isfinite(points_px).all(axis=1))):
            places = [_fixed(points_px[begin:end])]
            cv2.polylines(self.pixels, places, False, colour[::-1], width_px, cv2.LINE_AA, _SHIFT)

    def dashes(self, x_px: float, *, dash_px: int) -> None:
        """Draw a vertical line over the whole height, in dashes with gaps of the same length."""
        x = min(max(round(x_px), 0), self.size_px[0] - 1)
        for top in range(0, self.size_px[1], 2 * dash_px):
            self.pixels[top : top + dash_px, x] = PLAIN[::-1]

    def ring(self, centre_px: tuple[float, float], radius_px: float, colour: Colour) -> None:
        """Draw a circle, two pixels wide."""
        x, y = _fixed(np.array(centre_px)).tolist()
        cv2.circle(self.pixels, (x, y), round(radius_px * 2**_SHIFT), colour[::-1], 2, cv2.LINE_AA, _SHIFT)

    def dotted_ring(self, centre_px: tuple[float, float], radius_px: float, colour: Colour) -> None:
        """Draw a circle of short pieces, two pixels wide."""
        parts = max(6, round(math.pi * radius_px / _DOT_PX))
        angles = np.arange(2 * parts).reshape(parts, 2) * math.pi / parts
        for x, y in np.stack([np.cos(angles), np.sin(angles)], axis=1):
            self.line(np.array(centre_px) + radius_px * np.column_stack([x, y]), colour, width_px=2)

    def cross(self, centre_px: tuple[float, float], reach_px: float, colour: Colour) -> None:
        """Draw an upright cross."""
        x, y = centre_px
        self.line(np.array([[x - reach_px, y], [x + reach_px, y]]), colour)
        self.line(np.array([[x, y - reach_px], [x, y + reach_px]]), colour)

    def tint(self, polygons_px: Sequence[Floats], colour: Colour, share: float) -> None:
        """Fill separate polygons (n, 2) with a colour, with an opacity from 0 to 1."""
        over = self.pixels.copy()
        for corners_px in polygons_px:
            cv2.fillPoly(over, [_fixed(corners_px)], colour[::-1], cv2.LINE_AA, _SHIFT)
        self.pixels[:] = cv2.addWeighted(over, share, self.pixels, 1.0 - share, 0.0)

    def frame_round(self) -> None:
        """Draw the border of this canvas."""
        width, height = self.size_px
        cv2.rectangle(self.pixels, (0, 0), (width - 1, height - 1), PLAIN[::-1], 1)

    def save(self, path: Path) -> None:
        """Write a PNG, the same bytes for the same content."""
        write_bytes(path, encoded(self.pixels, ".png"))


@dataclass(frozen=True, slots=True)
class FrameView:
    """A part of a frame that fills a canvas: its first column and row, and canvas pixels per pixel of the frame."""

    canvas: Canvas
    left_px: int
    top_px: int
    scale_x: float
    scale_y: float

    def at(self, places_px: Floats) -> Floats:
        """Convert positions (..., 2) from the frame to the canvas; pixel centres are whole numbers in both."""
        corner = np.array([self.left_px, self.top_px]) - 0.5
        return np.asarray((places_px - corner) * np.array([self.scale_x, self.scale_y]) - 0.5, dtype=np.float64)


def show_frame(
    canvas: Canvas, luma: NDArray[np.uint8], *, view_px: tuple[int, int, int, int] | None = None
) -> FrameView:
    """Draw a frame, or the part of it from ``(left, top)`` to before ``(right, bottom)``, over a whole canvas.

    A part with more pixels than the canvas is shrunk by means over areas, so that thin marks stay visible.
    """
    left, top, right, bottom = view_px or (0, 0, luma.shape[1], luma.shape[0])
    part = np.ascontiguousarray(luma[top:bottom, left:right])
    width, height = canvas.size_px
    view = FrameView(canvas, left, top, width / part.shape[1], height / part.shape[0])
    how = cv2.INTER_AREA if min(view.scale_x, view.scale_y) < 1.0 else cv2.INTER_NEAREST
    canvas.pixels[:] = cv2.cvtColor(cv2.resize(part, (width, height), interpolation=how), cv2.COLOR_GRAY2BGR)
    return view


def show_stick(view: FrameView, points_px: Floats, *, colour: Colour, radius_px: float) -> None:
    """Draw the tracked markers (2, 2) of a stick, and the line between them; NaN for a marker that was not tracked."""
    places = view.at(points_px)
    view.canvas.line(places, colour)
    for x, y in places[np.isfinite(places).all(axis=1)].tolist():
        view.canvas.ring((x, y), 1.6 * radius_px * view.scale_x, colour)
        view.canvas.cross((x, y), 3.5, colour)


def show_candidates(view: FrameView, candidates: Sequence[Candidate]) -> None:
    """Draw the candidates that were not taken, each with its number."""
    for one in candidates:
        if one.taken:
            continue
        colour = DOT if one.is_dot else REFUSED
        x, y = view.at(np.array([one.x_px, one.y_px])).tolist()
        reach = max(1.5 * one.radius_px, 4.0) * view.scale_x
        ring = view.canvas.ring if one.is_dot else view.canvas.dotted_ring
        ring((x, y), reach, colour)
        view.canvas.label((x + 0.8 * reach, y - 0.8 * reach), str(one.number), colour)


def show_named(view: FrameView, places_px: Floats, names: Sequence[str], colours: Sequence[Colour]) -> None:
    """Draw positions (n, 2) as rings with a cross and a name."""
    for (x, y), name, colour in zip(view.at(places_px).tolist(), names, colours, strict=True):
        view.canvas.ring((x, y), 9.0, colour)
        view.canvas.cross((x, y), 5.0, colour)
        view.canvas.label((x + 13.0, y - 4.0), name, colour)


def draw_grid(canvas: Canvas, plot: Canvas, box_px: Box, across: Ticks, up: Ticks, *, colour: Colour) -> None:
    """Draw lines over a plot, which is a part of the canvas, and write their numbers below it and to its left."""
    left, top, width, height = (round(value) for value in box_px)
    for x, number in across:
        plot.line(np.array([[x, 0.0], [x, height]]), colour)
        canvas.text((left + x, top + height + 16), f"{number:g}".replace("-", "−"), align="center")
    for y, number in up:
        plot.line(np.array([[0.0, y], [width, y]]), colour)
        canvas.text((left - 6, top + y + 4), f"{number:g}".replace("-", "−"), align="right")


def marker_names() -> list[str]:
    """Return the markers' names as words."""
    return [name.replace("_", " ") for name in MARKERS]


def marker_colours() -> list[Colour]:
    """Return the colours of the four markers."""
    return [BASE_COLOUR, BASE_COLOUR, MOVING_COLOUR, MOVING_COLOUR]


def round_numbers(low: float, high: float, *, most: int) -> Floats:
    """Return at most ``most`` multiples of 1, 2 or 5 times a power of ten from ``low`` to ``high``."""
    # Matplotlib has such a function, but importing it takes a tenth of the time in which a film's tracking starts.
    power = 10.0 ** np.floor(np.log10((high - low) / most))
    steps = (power * step for step in (1.0, 2.0, 5.0, 10.0, 20.0))
    # Adding zero turns −0 into 0.
    found = (np.arange(np.ceil(low / step), np.floor(high / step) + 1.0) * step + 0.0 for step in steps)
    return next(numbers for numbers in found if len(numbers) <= most)


def _fixed(places_px: Floats) -> NDArray[np.int32]:
    """Return positions in OpenCV's fixed-point numbers; those far outside are clipped to the range of these numbers."""
    return np.clip(np.rint(places_px * 2.0**_SHIFT), -(2**24), 2**24).astype(np.int32)
