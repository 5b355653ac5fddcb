"""A picture of the first frame with a grid, the numbered candidates, and the reason for rejecting each."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from torsight.core.files.figure_file import write_figure
from torsight.core.units import Floats
from torsight.core.words.colours import GIVEN_COLOUR
from torsight.core.words.wording import capital
from torsight.markers.beginning import SHOWN_PX
from torsight.markers.drawing import (
    DOT,
    MARKER_COLOURS,
    PX,
    REFUSED,
    TEXT_PX,
    axes_in,
    blank,
    marker_names,
    show_candidates,
    show_frame,
    show_named,
)

if TYPE_CHECKING:
    from tracker.detect.candidates import Sighting

_CORNER_PX: Final = (60.0, 50.0)
"""Position of the frame's upper left corner in the picture."""
_LINE_CHARACTERS: Final = 98
_LIST_PX: Final = 0.53 * TEXT_PX * _LINE_CHARACTERS
_LINE_PX: Final = 1.25 * TEXT_PX
"""The list beside the frame: a letter is about half as wide as it is tall, a line a quarter taller than its letters."""


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
    high, wide = scale * luma.shape[0], scale * luma.shape[1]
    lines = _lines(seen, message=message or _found_words(seen, named_px), given=given_px is not None)
    (left, top), tall = _CORNER_PX, max(high, _LINE_PX * (len(lines) + 1))
    figure = blank(left + wide + 30.0 + _LIST_PX, top + tall + 60.0)
    axes = axes_in(figure, (left, top, wide, high))
    axes.set_title(title, loc="left", fontsize=16.0 * PX, fontweight="bold")
    show_frame(axes, luma)
    axes.locator_params(nbins=16)
    axes.grid(color="white", alpha=0.28)
    axes.set(xlabel="x (px)", ylabel="y (px)")
    show_candidates(axes, seen.candidates)
    if named_px is not None:
        show_named(axes, named_px, marker_names(), MARKER_COLOURS)
    elif seen.sticks_px is not None:
        names = [f"stick {stick} {end}" for stick in (1, 2) for end in ("inner", "outer")]
        show_named(axes, seen.sticks_px.reshape(4, 2), names, MARKER_COLOURS)
    if given_px is not None:
        show_named(axes, given_px, [f"{name}, given" for name in marker_names()], [GIVEN_COLOUR] * 4)
    beside = axes_in(figure, (left + wide + 20.0, top, _LIST_PX, tall))
    beside.set(xlim=(0.0, _LIST_PX), ylim=(tall, 0.0))
    beside.set_axis_off()
    for number, (text, colour) in enumerate(lines):
        y = _LINE_PX * number + TEXT_PX
        # Dark text with a mark in the colour of the ring: light colours cannot be read on white.
        beside.text(14.0, y, text, fontsize=PX * TEXT_PX)
        beside.text(0.0, y, "■" if colour else "", color=colour, fontsize=PX * TEXT_PX)
    write_figure(path, figure)


def _found_words(seen: Sighting, named_px: Floats | None) -> str:
    if seen.sticks_px is None:
        return seen.reason
    if named_px is None:
        return "Four markers were found; which stick moves is not seen in the first seconds."
    return "Four markers were found."


def _lines(seen: Sighting, *, message: str, given: bool) -> list[tuple[str, str | None]]:
    """Return the lines of the list beside the picture, each with the colour of its mark."""
    said = textwrap.wrap(capital(message), _LINE_CHARACTERS)
    lines: list[tuple[str, str | None]] = [(line, None) for line in said or [""]]
    if given:
        lines.append(("Rings in yellow: the positions that were given.", None))
    lines.append(("", None))
    for one in seen.candidates:
        colour = None if one.taken else DOT if one.is_dot else REFUSED
        text = f"{one.number:>2}  [{one.x_px:.1f}, {one.y_px:.1f}]  r {one.radius_px:.1f} px: {one.reason or 'marker'}"
        first, *more = textwrap.wrap(text, _LINE_CHARACTERS)
        lines += [(first, colour), *((f"      {line}", None) for line in more)]
    if not seen.candidates:
        lines.append(("no place looks like a dot", None))
    return lines
