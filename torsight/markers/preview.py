"""A picture of the first frame with a grid, the numbered candidates, and the reason for rejecting each.

Figures are drawn without matplotlib's configured backend, which need not be installed. Positions are in pixels of the
frame, where pixel centres are whole numbers.
"""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from numpy.typing import NDArray

from torsight.core.files.figure_file import write_figure
from torsight.core.tracks import MARKERS
from torsight.core.units import Floats
from torsight.core.words.colours import BASE_COLOUR, GIVEN_COLOUR, LIGHT, MOVING_COLOUR, Colour, hex_of
from torsight.core.words.wording import capital
from torsight.markers.beginning import SHOWN_PX

if TYPE_CHECKING:
    from tracker.detect.candidates import Sighting

_LINE_CHARACTERS: Final = 98
"""Longest line of the list beside the frame."""
_DOT: Final = LIGHT["held"]
_REFUSED: Final = "#cc79a7"
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
    figure = Figure((scale * luma.shape[1] / 100.0, scale * luma.shape[0] / 100.0), dpi=100.0)
    # The file is as much larger than the frame as the words around it need.
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_title(title, loc="left", fontweight="bold")
    show_frame(axes, luma)
    axes.locator_params(nbins=16)
    axes.tick_params(labelsize="small")
    axes.grid(color="white", alpha=0.28)
    axes.set(xlabel="x (px)", ylabel="y (px)")
    listed = []
    for one in seen.candidates:
        colour = _DOT if one.is_dot else _REFUSED
        if not one.taken:
            reach = max(1.5 * one.radius_px, 4.0)
            show_ring(axes, (one.x_px, one.y_px), reach, color=colour, linestyle="-" if one.is_dot else ":")
            show_label(axes, (one.x_px + 0.8 * reach, one.y_px - 0.8 * reach), str(one.number), colour)
        text = f"{one.number:>2}  [{one.x_px:.1f}, {one.y_px:.1f}]  r {one.radius_px:.1f} px: {one.reason or 'marker'}"
        label = textwrap.fill(text, _LINE_CHARACTERS, subsequent_indent=" " * 6)
        # Dark text with a mark in the colour of the ring: light colours cannot be read on white.
        listed += axes.plot([], [], "s", color="none" if one.taken else colour, label=label)
    colours = [BASE_COLOUR, BASE_COLOUR, MOVING_COLOUR, MOVING_COLOUR]
    names = [name.replace("_", " ") for name in MARKERS]
    if named_px is not None:
        show_named(axes, named_px, names, colours)
    elif seen.sticks_px is not None:
        sticks = [f"stick {stick} {end}" for stick in (1, 2) for end in ("inner", "outer")]
        show_named(axes, seen.sticks_px.reshape(4, 2), sticks, colours)
    said = [textwrap.fill(capital(message or _found_words(seen, named_px)), _LINE_CHARACTERS)]
    if given_px is not None:
        show_named(axes, given_px, [f"{name}, given" for name in names], [GIVEN_COLOUR] * 4)
        said.append("Rings in yellow: the positions that were given.")
    if not seen.candidates:
        said.append("no place looks like a dot")
    beside = axes.legend(
        handles=listed, title="\n".join(said), title_fontsize="small", alignment="left", frameon=False, **TEXT
    )
    beside.set_loc("upper left")
    beside.set_bbox_to_anchor((1.0, 1.0), axes.transAxes)
    write_figure(path, figure, bbox_inches="tight")


def _found_words(seen: Sighting, named_px: Floats | None) -> str:
    if seen.sticks_px is None:
        return seen.reason
    if named_px is None:
        return "Four markers were found; which stick moves is not seen in the first seconds."
    return "Four markers were found."


TEXT: Final[dict[str, Any]] = {"fontsize": "small"}
"""Style of text beside and on a frame."""


def show_frame(axes: Axes, luma: NDArray[Any], *, view_px: tuple[int, int, int, int] | None = None) -> None:
    """Draw a frame, or the part of it from ``(left, top)`` to before ``(right, bottom)``, over whole axes."""
    left, top, right, bottom = view_px or (0, 0, luma.shape[1], luma.shape[0])
    edges = (left - 0.5, right - 0.5, bottom - 0.5, top - 0.5)
    axes.imshow(luma[top:bottom, left:right], cmap="gray", vmin=0, vmax=255, extent=edges, aspect="auto")
    # What is drawn on the frame must not widen the axes.
    axes.autoscale(enable=False)


def show_ring(axes: Axes, centre_px: Sequence[float], radius_px: float, **style: Any) -> None:
    """Draw a circle round a position."""
    axes.add_patch(Circle((centre_px[0], centre_px[1]), radius_px, fill=False, linewidth=1.5, **style))


def show_label(axes: Axes, place_px: Sequence[float], words: str, colour: str, *, offset: float = 0.0) -> None:
    """Write black text on a coloured box, its lower left corner to the right of a position by an offset in points."""
    box = {"facecolor": colour, "edgecolor": "none", "pad": 2.0}
    axes.annotate(words, (place_px[0], place_px[1]), (offset, 2.0), textcoords="offset points", bbox=box, **TEXT)


def show_named(axes: Axes, places_px: Floats, names: Sequence[str], colours: Sequence[Colour]) -> None:
    """Draw positions (n, 2) as rings with a cross and a name."""
    for place, name, colour in zip(places_px.tolist(), names, map(hex_of, colours), strict=True):
        axes.plot(*place, "o", color=colour, markersize=13.0, markeredgewidth=1.5, markerfacecolor="none")
        axes.plot(*place, "+", color=colour)
        show_label(axes, place, name, colour, offset=11.0)
