"""A picture of the first frame with a grid, the candidates by number, and why each was refused."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from torsight.markers.drawing import (
    DOT,
    GIVEN,
    PLAIN,
    REFUSED,
    SHOWN_PX,
    marker_colours,
    marker_names,
    new_figure,
    panel,
    save,
    show_candidates,
    show_frame,
    show_named,
    wrapped,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from tracker.detect.candidates import Sighting

_LIST_PX: Final = 620.0
_LINE_PX: Final = 15.0
_LINE_CHARACTERS: Final = 98
_GRID_LINES: Final = 16
"""Most lines of the grid along the frame's longer side."""


def write_preview(
    path: Path,
    luma: NDArray[np.uint8],
    seen: Sighting,
    *,
    title: str,
    message: str = "",
    given_px: NDArray[np.float64] | None = None,
    named_px: NDArray[np.float64] | None = None,
) -> None:
    """Draw one frame with a grid in pixels, the candidates with their numbers, and the markers that were found.

    Parameters
    ----------
    path : Path
        The PNG file.
    luma : (h, w) uint8
        The frame.
    seen : Sighting
        What automatic detection made of it.
    title : str
        First line.
    message : str
        Why nothing came of it, where it failed; what the detection itself says otherwise.
    given_px : (4, 2) float64, optional
        Positions that a person gave, order of :data:`torsight.core.tracks.MARKERS`.
    named_px : (4, 2) float64, optional
        The markers that were found, in the same order, where it is known which stick moves.

    Raises
    ------
    OutputError
        When the file cannot be written.
    """
    height, width = luma.shape
    scale = SHOWN_PX / max(width, height)
    lines = _lines(seen, message=message or _found_words(seen, named_px), given=given_px is not None)
    tall = max(scale * height, _LINE_PX * (len(lines) + 1))
    figure = new_figure((70.0 + scale * width + 20.0 + _LIST_PX, 60.0 + tall + 50.0))
    figure.text(0.01, 0.985, title, fontsize=11, weight="bold", va="top", color=PLAIN)
    axes = panel(figure, (60.0, 50.0, scale * width, scale * height))
    show_frame(axes, luma)
    _grid(axes, (width, height))
    show_candidates(axes, seen.candidates)
    if named_px is not None:
        show_named(axes, named_px, marker_names(), marker_colours())
    elif seen.sticks_px is not None:
        names = [f"stick {stick} {end}" for stick in (1, 2) for end in ("inner", "outer")]
        show_named(axes, seen.sticks_px.reshape(4, 2), names, marker_colours())
    if given_px is not None:
        show_named(axes, given_px, [f"{name}, given" for name in marker_names()], [GIVEN] * 4)
    _write_list(panel(figure, (60.0 + scale * width + 20.0, 50.0, _LIST_PX, tall)), lines)
    save(figure, path)


def _grid(axes: Axes, size_px: tuple[int, int]) -> None:
    """Draw lines at round numbers of pixels, labelled at the border."""
    from matplotlib.ticker import MaxNLocator, MultipleLocator

    edges = MaxNLocator(nbins=_GRID_LINES, steps=[1, 2, 5, 10], integer=True).tick_values(0, max(size_px))
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MultipleLocator(float(edges[1] - edges[0])))
    axes.tick_params(labelsize=8, length=3)
    axes.grid(color="white", alpha=0.28, lw=0.6)
    axes.set_xlabel("x (px)", fontsize=8)
    axes.set_ylabel("y (px)", fontsize=8)


def _found_words(seen: Sighting, named_px: NDArray[np.float64] | None) -> str:
    if seen.sticks_px is None:
        return seen.reason
    if named_px is None:
        return "Four markers were found; which stick moves is not seen in the first seconds."
    return "Four markers were found."


def _lines(seen: Sighting, *, message: str, given: bool) -> list[tuple[str, str]]:
    """Return the lines of the list beside the picture, each with its colour."""
    lines = [(line, PLAIN) for line in wrapped(message[:1].upper() + message[1:], _LINE_CHARACTERS)]
    if given:
        lines.append(("Rings in yellow: the positions that were given.", PLAIN))
    lines.append(("", PLAIN))
    for one in seen.candidates:
        colour = PLAIN if one.taken else DOT if one.is_dot else REFUSED
        text = f"{one.number:>2}  [{one.x_px:.1f}, {one.y_px:.1f}]  r {one.radius_px:.1f} px: {one.reason or 'marker'}"
        first, *more = wrapped(text, _LINE_CHARACTERS)
        lines += [(first, colour), *((f"      {line}", colour) for line in more)]
    if not seen.candidates:
        lines.append(("no place looks like a dot", PLAIN))
    return lines


def _write_list(axes: Axes, lines: Sequence[tuple[str, str]]) -> None:
    axes.set_axis_off()
    tall = axes.get_window_extent().height
    for number, (text, colour) in enumerate(lines):
        # Dark text with a mark in the colour of the ring: light colours cannot be read on white.
        y = 1.0 - _LINE_PX * number / tall
        axes.text(0.02, y, text, transform=axes.transAxes, fontsize=8, va="top", color=PLAIN)
        if colour != PLAIN and not text.startswith("      "):
            axes.plot([0.005], [y - 0.4 * _LINE_PX / tall], "s", color=colour, ms=6, transform=axes.transAxes)
