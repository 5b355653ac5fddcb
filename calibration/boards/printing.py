"""Printing of boards, and of a pair of tags for the sticks: in true scale as SVG or PDF, and as a picture.

A drawing is a list of black rectangles and lines of text on a page, in mm from its top left corner. A bar of 100 mm
below the board serves to check the printer's scale.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import cv2
import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Outline
from scipy.constants import inch, milli

from calibration.boards.board_file import Board, dictionary_of
from torsight.core.errors import ConfigError
from torsight.core.files.figure_file import UNDATED, write_figure
from torsight.core.files.paths import AnyPath
from torsight.core.series import runs
from torsight.core.words.shown import Shown

PAGES_MM: Final = {
    "a5": (210.0, 148.0),
    "a4": (297.0, 210.0),
    "a3": (420.0, 297.0),
    "a2": (594.0, 420.0),
    "letter": (279.4, 215.9),
    "tabloid": (431.8, 279.4),
}
"""Width and height of a page in landscape format."""

_MM_PER_INCH: Final = inch / milli
_POINTS_PER_MM: Final = 72.0 / _MM_PER_INCH
"""A point in PDF is 1/72 inch (ISO 32000-1, 8.3.2.3)."""


@dataclass(frozen=True, slots=True)
class Layout:
    """Sizes of the elements on a page around the pattern, mm.

    The margin is larger than the 6.4 mm that ordinary printers do not reach; the foot contains the text and the bar for
    checking the scale (0.5 mm on a ruler are half a per cent of it). The font size is 9 points. Tags are cut along
    ticks around their white border, ``tag_border`` modules wide: the detector and the fit need one.
    """

    margin_mm: float = 8.0
    foot_mm: float = 10.0
    bar_mm: float = 100.0
    text_mm: float = 3.2
    line_mm: float = 6.0
    tick_mm: float = 4.0
    tick_width_mm: float = 0.2
    tag_border: float = 1.5


LAYOUT: Final = Layout()


@dataclass(frozen=True, slots=True)
class Rectangle:
    """A black rectangle; mm from the page's top left corner."""

    x_mm: float
    y_mm: float
    width_mm: float
    height_mm: float


@dataclass(frozen=True, slots=True)
class Text:
    """A line of text; its left end and base line in mm from the page's top left corner."""

    x_mm: float
    y_mm: float
    words: str


@dataclass(frozen=True, slots=True, repr=False)
class Drawing(Shown):
    """A page and its content."""

    page_mm: tuple[float, float]
    rectangles: tuple[Rectangle, ...]
    texts: tuple[Text, ...]

    def facts(self) -> dict[str, str]:
        """Return the page's size, the number of its rectangles, and its text."""
        words = "; ".join(item.words for item in self.texts)
        size = f"{self.page_mm[0]:g} × {self.page_mm[1]:g} mm"
        return {"page": size, "black": f"{len(self.rectangles)} rectangles", "words": words}

    def _columns(self) -> dict[str, Any]:
        names = ("x_mm", "y_mm", "width_mm", "height_mm")
        return {name: [getattr(item, name) for item in self.rectangles] for name in names}

    def _draw(self, axes: Any) -> None:
        self.paint(axes)
        axes.set(xlim=(0.0, self.page_mm[0]), ylim=(self.page_mm[1], 0.0))
        axes.set(xlabel="across the page, mm", ylabel="down the page, mm", aspect="equal")

    def paint(self, axes: Any) -> None:
        """Draw the content of the page, with axes in millimetres."""
        corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]])
        places = [(item.x_mm, item.y_mm) + corners * (item.width_mm, item.height_mm) for item in self.rectangles]
        codes = [Outline.MOVETO, *3 * [Outline.LINETO], Outline.CLOSEPOLY] * len(places)
        # One outline, so that there is no seam between touching shapes; to scale, not snapped to whole pixels.
        axes.add_patch(PathPatch(Outline(np.concatenate(places), codes), facecolor="black", linewidth=0.0, snap=False))
        for item in self.texts:
            axes.text(item.x_mm, item.y_mm, item.words, size=LAYOUT.text_mm * _POINTS_PER_MM)


def draw_board(board: Board, *, page: str = "a4") -> Drawing:
    """Return the board in the middle of a page, with a caption and a bar of 100 mm to check the scale.

    Raises ConfigError when the board with its white border is larger than the page.
    """
    width_mm, height_mm = PAGES_MM[page]
    across, down = (count * board.square_mm for count in board.squares)
    room = width_mm - 2.0 * LAYOUT.margin_mm, height_mm - 2.0 * LAYOUT.margin_mm - LAYOUT.foot_mm
    if across > room[0] or down > room[1]:
        largest = min(room[0] / board.squares[0], room[1] / board.squares[1])
        raise ConfigError(
            f"the board does not fit on a page {page}",
            where="square_mm",
            value=f"{across:g} × {down:g} mm",
            limit=f"{room[0]:g} × {room[1]:g} mm: squares of up to {np.floor(largest * 10) / 10:g} mm",
            do="take a larger --page, smaller or fewer squares",
        )
    left, top = 0.5 * (width_mm - across), 0.5 * (height_mm - LAYOUT.foot_mm - down)
    foot = height_mm - LAYOUT.margin_mm
    bar, words = check_bar(page)
    caption = f"{board.describe().removeprefix('a ')}, {board.square_mm:g} mm; print at 100 %"
    shapes = (*_pattern(board, left, top), bar)
    return Drawing((width_mm, height_mm), shapes, (Text(LAYOUT.margin_mm, foot, caption), words))


def _pattern(board: Board, x_mm: float, y_mm: float) -> list[Rectangle]:
    """Return the black parts of a board whose top left corner is at (x, y)."""
    across, down = board.squares
    side = board.square_mm
    # The first square is black; OpenCV's older ChArUco pattern starts with a marker where the rows are even.
    start = 1 if board.legacy and down % 2 == 0 else 0
    squares = [(row, column) for row in range(down) for column in range(across)]
    black = [place for place in squares if (sum(place) + start) % 2 == 0]
    shapes = [Rectangle(x_mm + column * side, y_mm + row * side, side, side) for row, column in black]
    if board.kind == "charuco":
        border = 0.5 * (side - board.marker_mm)
        for number, (row, column) in enumerate(place for place in squares if place not in black):
            left, top = x_mm + (column * side + border), y_mm + (row * side + border)
            shapes += draw_tag(board.dictionary, number, left, top, side_mm=board.marker_mm)
    return shapes


def draw_tag(dictionary_name: str, number: int, x_mm: float, y_mm: float, *, side_mm: float) -> list[Rectangle]:
    """Return a tag with the top left corner of its black square at (x, y); black modules are joined along rows."""
    dictionary = dictionary_of(dictionary_name)
    modules = dictionary.markerSize + 2  # with a black frame of one module
    bits = np.asarray(cv2.aruco.generateImageMarker(dictionary, number, modules)) == 0
    module = side_mm / modules
    shapes = []
    for row, cells in enumerate(bits):
        for start, end in runs(cells):
            shapes.append(Rectangle(x_mm + start * module, y_mm + row * module, (end - start) * module, module))
    return shapes


def check_bar(page: str) -> tuple[Rectangle, Text]:
    """Return a bar of 100 mm in the lower right corner of a page, to check the printer's scale, and its label.

    On a page that is too narrow the bar is shorter, and its label states the length.
    """
    width_mm, height_mm = PAGES_MM[page]
    foot = height_mm - LAYOUT.margin_mm
    bar = min(LAYOUT.bar_mm, float(np.floor((width_mm - 2.0 * LAYOUT.margin_mm) / 10.0) * 10.0))
    left = width_mm - LAYOUT.margin_mm - bar
    return Rectangle(left, foot - 1.0, bar, 1.0), Text(left, foot - 2.0, f"{bar:g} mm: measure it on the print")


def _page(drawing: Drawing, *, dpi: float) -> Figure:
    """Return the page as a figure of whole pixels, with axes in millimetres."""
    size_px = np.round(np.array(drawing.page_mm) / _MM_PER_INCH * dpi)
    figure = Figure(figsize=tuple(size_px / dpi), dpi=dpi, facecolor="white")
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    width_mm, height_mm = size_px / dpi * _MM_PER_INCH
    axes.set(xlim=(0.0, width_mm), ylim=(height_mm, 0.0))
    axes.axis("off")
    drawing.paint(axes)
    return figure


def write_board(path: AnyPath, drawing: Drawing, *, dpi: float = 300.0) -> None:
    """Write the page; the suffix (svg, pdf or png) decides the format.

    Raises ConfigError for another suffix.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in UNDATED:
        raise ConfigError(
            "is no format for a board", where=str(path), value=suffix or "no suffix", limit=", ".join(UNDATED)
        )
    with mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": "torsight"}):
        # Vector formats have no pixels: round the page's size to a thousandth of a point.
        write_figure(path, _page(drawing, dpi=dpi if suffix == ".png" else 72_000.0))


def usual_board(kind: str, *, page: str = "a4") -> Board:
    """Return a board that fills a page well: 9 × 6 inner corners, or ChArUco of 10 × 7 squares."""
    width_mm, height_mm = PAGES_MM[page]
    room = min((width_mm - 2.0 * LAYOUT.margin_mm) / 10.0, (height_mm - 2.0 * LAYOUT.margin_mm - LAYOUT.foot_mm) / 7.0)
    square_mm = float(np.floor(room))
    if kind == "chessboard":
        return Board("chessboard", columns=9, rows=6, square_mm=square_mm)
    marker_mm = round(0.7 * square_mm, 1)
    return Board("charuco", columns=10, rows=7, square_mm=square_mm, marker_mm=marker_mm, dictionary="DICT_5X5_50")


def tag_pair(family: str, *, base_id: int, moving_id: int, side_mm: float) -> dict[str, Any]:
    """Return a pair of tags as keys of ``MARKERS.toml``; a family or a number that does not exist is refused.

    ``side_mm`` is the side of the black squares.
    """
    name = f"DICT_{family.removeprefix('DICT_')}"
    if not isinstance(getattr(cv2.aruco, name, None), int):
        usual = "4X4_50, 5X5_50, 6X6_50, APRILTAG_16h5, APRILTAG_25h9, APRILTAG_36h11"
        raise ConfigError("is no family of tags", where="--family", value=family, limit=f"one of OpenCV's, as {usual}")
    count = len(dictionary_of(name).bytesList)
    ids = {"base_id": base_id, "moving_id": moving_id}
    for option, number in zip(("--base-id", "--moving-id"), ids.values(), strict=True):
        if not 0 <= number < count:
            raise ConfigError("is no tag of this family", where=option, value=number, limit=f"0 to {count - 1}")
    if base_id == moving_id:
        raise ConfigError(
            "both sticks would have the tag of one number",
            where="--base-id and --moving-id",
            value=base_id,
            limit="two different numbers",
        )
    return {"kind": "tag", "family": name.removeprefix("DICT_"), **ids, "base_mm": side_mm, "moving_mm": side_mm}


def draw_tags(pair: Mapping[str, Any], *, page: str = "a4") -> Drawing:
    """Return both tags of a pair (:func:`tag_pair`) on a page, with ticks to cut along and a bar to check the scale."""
    width_mm, height_mm = PAGES_MM[page]
    family, side_mm = pair["family"], pair["base_mm"]
    border_mm = LAYOUT.tag_border * side_mm / (dictionary_of(f"DICT_{family}").markerSize + 2)
    whole_mm = side_mm + 2.0 * border_mm
    room_mm = (
        0.5 * width_mm - LAYOUT.margin_mm - 2.0 * LAYOUT.tick_mm,
        height_mm - 2.0 * LAYOUT.margin_mm - 4.0 * LAYOUT.line_mm,
    )
    if whole_mm > min(room_mm):
        raise ConfigError(
            f"the tags do not fit on a page {page}",
            where="--side-mm",
            value=f"{side_mm:g}, {whole_mm:.0f} mm with the white border",
            limit=f"{min(room_mm) * side_mm / whole_mm:.0f}",
            do="take smaller tags or a larger --page",
        )
    shapes: list[Rectangle] = []
    words: list[Text] = []
    top = LAYOUT.margin_mm + 2.0 * LAYOUT.tick_mm
    for place, stick in enumerate(("base", "moving")):
        number = pair[f"{stick}_id"]
        left = LAYOUT.margin_mm + LAYOUT.tick_mm + place * 0.5 * width_mm
        shapes += draw_tag(f"DICT_{family}", number, left + border_mm, top + border_mm, side_mm=side_mm)
        shapes += _ticks(left, top, whole_mm)
        below = top + whole_mm + LAYOUT.tick_mm + LAYOUT.line_mm
        words.append(Text(left, below, f"{stick} stick: {family}, number {number}"))
        words.append(Text(left, below + LAYOUT.line_mm, "left edge towards the axis, top edge along the stick"))
    bar, label = check_bar(page)
    foot = Text(LAYOUT.margin_mm, height_mm - LAYOUT.margin_mm, f"black squares of {side_mm:g} mm; print at 100 %")
    return Drawing((width_mm, height_mm), (*shapes, bar), (*words, foot, label))


def _ticks(left_mm: float, top_mm: float, whole_mm: float) -> list[Rectangle]:
    """Return short lines outside the corners of the white border."""
    found: list[Rectangle] = []
    for x in (left_mm, left_mm + whole_mm):
        for y in (top_mm, top_mm + whole_mm):
            out_x = x - LAYOUT.tick_mm if x == left_mm else x
            out_y = y - LAYOUT.tick_mm if y == top_mm else y
            found.append(Rectangle(out_x, y - 0.5 * LAYOUT.tick_width_mm, LAYOUT.tick_mm, LAYOUT.tick_width_mm))
            found.append(Rectangle(x - 0.5 * LAYOUT.tick_width_mm, out_y, LAYOUT.tick_width_mm, LAYOUT.tick_mm))
    return found
