"""A picture of the first frame with a grid, the numbered candidates, and the reason for rejecting each."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from torsight.core.units import Floats
from torsight.core.words.colours import GIVEN_COLOUR
from torsight.core.words.wording import capital
from torsight.markers.drawing import (
    DOT,
    PLAIN,
    REFUSED,
    SHOWN_PX,
    TEXT_PX,
    WHITE,
    Canvas,
    FrameView,
    draw_grid,
    marker_colours,
    marker_names,
    round_numbers,
    show_candidates,
    show_frame,
    show_named,
)

if TYPE_CHECKING:
    from torsight.core.words.colours import Colour
    from tracker.detect.candidates import Sighting

_CORNER_PX: Final = (60.0, 50.0)
"""Position of the frame's upper left corner in the picture."""
_LINE_CHARACTERS: Final = 98
_LIST_PX: Final = 0.53 * TEXT_PX * _LINE_CHARACTERS
_LINE_PX: Final = 1.25 * TEXT_PX
"""The list beside the frame: a letter is about half as wide as it is tall, a line a quarter taller than its letters."""
_GRID_LINES: Final = 16
"""Most lines of the grid along the frame's longer side."""
_GRID_SHARE: Final = 0.28
"""Share of white in the grid's lines: dots below them stay visible."""


def write_preview(
    path: Path,
    luma: NDArray[np.uint8],
    seen: Sighting,
    *,
    title: str,
    message: str = "",
    given_px: Floats | None = None,
    named_px: Floats | None = None,
) -> None:
    """Draw one frame (h, w) with a grid in pixels, the candidates with their numbers, and the markers that were found.

    ``message`` is the reason of a failure. Positions (4, 2) are in the order of :data:`torsight.core.tracks.MARKERS`:
    ``given_px`` by a person, ``named_px`` found automatically (only where it is known which stick moves).
    """
    height, width = luma.shape
    scale = SHOWN_PX / max(width, height)
    lines = _lines(seen, message=message or _found_words(seen, named_px), given=given_px is not None)
    tall = max(scale * height, _LINE_PX * (len(lines) + 1))
    canvas = Canvas.blank((70.0 + scale * width + 20.0 + _LIST_PX, 60.0 + tall + 50.0))
    canvas.text((12, 24), title, size_px=16, bold=True)
    view = show_frame(canvas.part((*_CORNER_PX, scale * width, scale * height)), luma)
    _grid(canvas, view, (width, height))
    show_candidates(view, seen.candidates)
    if named_px is not None:
        show_named(view, named_px, marker_names(), marker_colours())
    elif seen.sticks_px is not None:
        names = [f"stick {stick} {end}" for stick in (1, 2) for end in ("inner", "outer")]
        show_named(view, seen.sticks_px.reshape(4, 2), names, marker_colours())
    if given_px is not None:
        show_named(view, given_px, [f"{name}, given" for name in marker_names()], [GIVEN_COLOUR] * 4)
    _write_list(canvas.part((60.0 + scale * width + 20.0, _CORNER_PX[1], _LIST_PX, tall)), lines)
    canvas.save(path)


def _grid(canvas: Canvas, view: FrameView, size_px: tuple[int, int]) -> None:
    """Draw lines at round numbers of pixels, labelled at the border."""
    left, top = _CORNER_PX
    width, height = view.canvas.size_px
    lines = round_numbers(0.0, float(max(size_px)), most=_GRID_LINES)
    places = view.at(np.column_stack([lines, lines]))
    inside = [lines < size for size in size_px]
    ticks = [zip(places[some, axis], lines[some], strict=True) for axis, some in enumerate(inside)]
    over = Canvas(view.canvas.pixels.copy())
    draw_grid(canvas, over, (left, top, width, height), *ticks, colour=WHITE)
    view.canvas.pixels[:] = cv2.addWeighted(over.pixels, _GRID_SHARE, view.canvas.pixels, 1.0 - _GRID_SHARE, 0.0)
    view.canvas.frame_round()
    canvas.text((left + width / 2, top + height + 34), "x (px)", align="center")
    canvas.text_upwards((16, top + height / 2), "y (px)")


def _found_words(seen: Sighting, named_px: Floats | None) -> str:
    if seen.sticks_px is None:
        return seen.reason
    if named_px is None:
        return "Four markers were found; which stick moves is not seen in the first seconds."
    return "Four markers were found."


def _lines(seen: Sighting, *, message: str, given: bool) -> list[tuple[str, Colour]]:
    """Return the lines of the list beside the picture, each with its colour."""
    said = textwrap.wrap(capital(message), _LINE_CHARACTERS)
    lines = [(line, PLAIN) for line in said or [""]]
    if given:
        lines.append(("Rings in yellow: the positions that were given.", PLAIN))
    lines.append(("", PLAIN))
    for one in seen.candidates:
        colour = PLAIN if one.taken else DOT if one.is_dot else REFUSED
        text = f"{one.number:>2}  [{one.x_px:.1f}, {one.y_px:.1f}]  r {one.radius_px:.1f} px: {one.reason or 'marker'}"
        first, *more = textwrap.wrap(text, _LINE_CHARACTERS)
        lines += [(first, colour), *((f"      {line}", colour) for line in more)]
    if not seen.candidates:
        lines.append(("no place looks like a dot", PLAIN))
    return lines


def _write_list(canvas: Canvas, lines: Sequence[tuple[str, Colour]]) -> None:
    for number, (text, colour) in enumerate(lines):
        # Dark text with a mark in the colour of the ring: light colours cannot be read on white.
        y = round(_LINE_PX * number) + TEXT_PX
        canvas.text((14, y), text)
        if colour != PLAIN and not text.startswith("      "):
            canvas.pixels[y - 9 : y, 1:10] = colour[::-1]
