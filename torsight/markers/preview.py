"""A picture of the first frame with a grid, the numbered candidates, and the reason for rejecting each."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from torsight.core.tracks import MARKERS
from torsight.core.units import Floats
from torsight.core.words.colours import BASE_COLOUR, GIVEN_COLOUR, LIGHT, MOVING_COLOUR, Colour, rgb
from torsight.core.words.wording import capital
from torsight.markers.beginning import SHOWN_PX
from torsight.markers.sheet import BLACK, MARGIN_PX, RING_PX, WHITE, Sheet, letters_in, ticks

if TYPE_CHECKING:
    from collections.abc import Callable

    from tracker.detect.candidates import Candidate, Sighting

_DOT: Final = rgb(LIGHT["held"])
_REFUSED: Final = (204, 121, 167)
"""A dot that was not taken; a candidate that is no dot."""


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
    scale = SHOWN_PX / max(luma.shape)
    frame = cv2.resize(luma, None, fx=scale, fy=scale, interpolation=cv2.INTER_LINEAR)
    # The list beside the frame has lines of 18 px, and a mark before each.
    list_px, line_px = 680, 18
    longest = letters_in(list_px - 16)
    said = textwrap.wrap(capital(message or _found_words(seen, named_px)), longest)
    said += ["Rings in yellow: the positions that were given."] if given_px is not None else []
    listed: list[tuple[Colour | None, str]] = [
        (_colour(one), line) for one in seen.candidates for line in _lines(one, longest)
    ] or [(None, "no place looks like a dot")]
    beside = MARGIN_PX + frame.shape[1] + 20
    rows = max(frame.shape[0] + 30, line_px * (len(said) + len(listed) + 1))
    sheet = Sheet(beside + list_px, MARGIN_PX + rows)
    sheet.text(title, MARGIN_PX, 24, size=16, bold=True)
    sheet.pixels[MARGIN_PX : MARGIN_PX + frame.shape[0], MARGIN_PX : MARGIN_PX + frame.shape[1]] = frame[..., None]

    def at(x_px: float, y_px: float) -> Floats:
        return np.asarray(scale * (np.array([x_px, y_px]) + 0.5) + MARGIN_PX - 0.5)

    _draw_grid(sheet, at, luma.shape[::-1])
    right, bottom = MARGIN_PX + frame.shape[1], MARGIN_PX + frame.shape[0]
    corners = [[MARGIN_PX - 1, MARGIN_PX - 1], [right, MARGIN_PX - 1], [right, bottom], [MARGIN_PX - 1, bottom]]
    sheet.line(np.array([*corners, corners[0]], float), BLACK)
    for one in seen.candidates:
        if not one.taken:
            reach = scale * max(1.5 * one.radius_px, 4.0)
            place = at(one.x_px, one.y_px)
            sheet.ring(place, reach, _colour(one), cross=False)
            sheet.text(str(one.number), place[0] + 0.8 * reach, place[1] - 0.8 * reach, on=_colour(one))
    for (x_px, y_px), name, colour in _marks(seen, given_px, named_px):
        place = at(x_px, y_px)
        sheet.ring(place, RING_PX, colour)
        sheet.text(name, place[0] + 15.0, place[1] - 3.0, on=colour)
    for number, line in enumerate(said):
        sheet.text(line, beside, MARGIN_PX + 12 + line_px * number)
    for number, (colour_or_none, line) in enumerate(listed, len(said) + 1):
        top = MARGIN_PX + 12 + line_px * number
        if colour_or_none is not None:
            # Dark text with a mark in the colour of the ring: light colours cannot be read on white.
            sheet.text("  ", beside, top, on=colour_or_none)
        sheet.text(line, beside + 16, top)
    sheet.write(path)


def _marks(seen: Sighting, given_px: Floats | None, named_px: Floats | None) -> list[tuple[Floats, str, Colour]]:
    """Return position, name and colour of every marker that was found or given."""
    names = [name.replace("_", " ") for name in MARKERS]
    colours = [BASE_COLOUR, BASE_COLOUR, MOVING_COLOUR, MOVING_COLOUR]
    marks = list[tuple[Floats, str, Colour]]()
    if named_px is not None:
        marks += zip(named_px, names, colours, strict=True)
    elif seen.sticks_px is not None:
        sticks = [f"stick {stick} {end}" for stick in (1, 2) for end in ("inner", "outer")]
        marks += zip(seen.sticks_px.reshape(4, 2), sticks, colours, strict=True)
    if given_px is not None:
        marks += [(place, f"{name}, given", GIVEN_COLOUR) for place, name in zip(given_px, names, strict=True)]
    return marks


def _colour(one: Candidate) -> Colour:
    return _DOT if one.is_dot else _REFUSED


def _lines(one: Candidate, longest: int) -> list[str]:
    text = f"{one.number:>2}  [{one.x_px:.1f}, {one.y_px:.1f}]  r {one.radius_px:.1f} px: {one.reason or 'marker'}"
    return textwrap.wrap(text, longest, subsequent_indent=" " * 6)


def _draw_grid(sheet: Sheet, at: Callable[[float, float], Floats], size_px: tuple[int, int]) -> None:
    """Draw lines over the frame with their pixel numbers beside it."""
    width, height = size_px
    columns, rows = (ticks(0.0, size - 1.0, about=16) for size in size_px)
    for number in columns:
        ends = np.array([at(number, -0.5), at(number, height - 0.5)])
        sheet.tint(np.concatenate([ends, ends[::-1] + np.array([1.0, 0.0])]), WHITE, 0.28)
        sheet.text(f"{number:g}", ends[1, 0] - 10, ends[1, 1] + 16)
    for number in rows:
        ends = np.array([at(-0.5, number), at(width - 0.5, number)])
        sheet.tint(np.concatenate([ends, ends[::-1] + np.array([0.0, 1.0])]), WHITE, 0.28)
        sheet.text(f"{number:g}", ends[0, 0] - 4, ends[0, 1] + 5, right=True)


def _found_words(seen: Sighting, named_px: Floats | None) -> str:
    if seen.sticks_px is None:
        return seen.reason
    if named_px is None:
        return "Four markers were found; which stick moves is not seen in the first seconds."
    return "Four markers were found."
