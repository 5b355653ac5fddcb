"""Common parts of the pictures of a film's markers: a frame as background, candidates, named markers.

They are drawn on figures of their own: matplotlib's configured backend does not matter and need not be installed.
Positions are in pixels of the frame, where pixel centres are whole numbers.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from numpy.typing import NDArray

from torsight.core.tracks import MARKERS
from torsight.core.units import Floats
from torsight.core.words.colours import BASE_COLOUR, LIGHT, MOVING_COLOUR, Colour, hex_of

if TYPE_CHECKING:
    from tracker.detect.candidates import Candidate

DOT: Final = LIGHT["held"]
"""A dot that was not taken."""
REFUSED: Final = "#cc79a7"
"""A candidate that is no dot."""
TEXT_PX: Final = 12
"""Usual height of letters."""
PX: Final = 0.72
"""Points, matplotlib's unit of letters and lines, per pixel at its usual 100 pixels per inch."""
MARKER_COLOURS: Final = (BASE_COLOUR, BASE_COLOUR, MOVING_COLOUR, MOVING_COLOUR)
"""In the order of the markers."""


def blank(width_px: float, height_px: float) -> Figure:
    """Return an empty figure."""
    return Figure((width_px / 100.0, height_px / 100.0), dpi=100.0)


def axes_in(figure: Figure, box_px: tuple[float, float, float, float]) -> Axes:
    """Return axes that fill a part of a figure: left, top, width, height in pixels."""
    (left, top, width, height), (wide, tall) = box_px, figure.get_size_inches() * figure.dpi
    axes = figure.add_axes((left / wide, 1.0 - (top + height) / tall, width / wide, height / tall))
    axes.tick_params(labelsize=PX * TEXT_PX)
    return axes


def show_frame(axes: Axes, luma: NDArray[np.uint8], *, view_px: tuple[int, int, int, int] | None = None) -> None:
    """Draw a frame, or the part of it from ``(left, top)`` to before ``(right, bottom)``, over whole axes."""
    left, top, right, bottom = view_px or (0, 0, luma.shape[1], luma.shape[0])
    edges = (left - 0.5, right - 0.5, bottom - 0.5, top - 0.5)
    axes.imshow(luma[top:bottom, left:right], cmap="gray", vmin=0, vmax=255, extent=edges, aspect="auto")
    # What is drawn on the frame must not widen the axes.
    axes.autoscale(enable=False)


def show_stick(axes: Axes, points_px: Floats, *, colour: Colour, radius_px: float) -> None:
    """Draw the tracked markers (2, 2) of a stick, and the line between them; NaN for a marker that was not tracked."""
    axes.plot(*points_px.T, "+-", color=hex_of(colour), linewidth=PX, markersize=7.0 * PX)
    for x, y in points_px[np.isfinite(points_px).all(axis=1)].tolist():
        _ring(axes, (x, y), 1.6 * radius_px, color=hex_of(colour))


def show_candidates(axes: Axes, candidates: Sequence[Candidate]) -> None:
    """Draw the candidates that were not taken, each with its number."""
    for one in candidates:
        if one.taken:
            continue
        reach, colour = max(1.5 * one.radius_px, 4.0), DOT if one.is_dot else REFUSED
        _ring(axes, (one.x_px, one.y_px), reach, color=colour, linestyle="-" if one.is_dot else ":")
        _label(axes, (one.x_px + 0.8 * reach, one.y_px - 0.8 * reach), str(one.number), colour)


def show_named(axes: Axes, places_px: Floats, names: Sequence[str], colours: Sequence[Colour]) -> None:
    """Draw positions (n, 2) as rings with a cross and a name."""
    for place, name, colour in zip(places_px.tolist(), names, map(hex_of, colours), strict=True):
        ring: dict[str, Any] = {"markersize": 18.0 * PX, "markeredgewidth": 2.0 * PX, "markerfacecolor": "none"}
        axes.plot(*place, "o", color=colour, **ring)
        axes.plot(*place, "+", color=colour, markersize=10.0 * PX)
        _label(axes, place, name, colour, offset_px=(13.0, 4.0))


def marker_names() -> list[str]:
    """Return the markers' names as words."""
    return [name.replace("_", " ") for name in MARKERS]


def _ring(axes: Axes, centre: tuple[float, float], radius: float, **style: Any) -> None:
    axes.add_patch(Circle(centre, radius, fill=False, linewidth=2.0 * PX, **style))


def _label(
    axes: Axes, place: Sequence[float], words: str, colour: str, *, offset_px: tuple[float, float] = (0.0, 0.0)
) -> None:
    """Write black text on a coloured box, its lower left corner at an offset to the right and upwards of a position."""
    across, up = offset_px
    box = {"facecolor": colour, "edgecolor": "none", "pad": 2.0}
    style: dict[str, Any] = {"textcoords": "offset points", "fontsize": PX * TEXT_PX, "bbox": box}
    axes.annotate(words, (place[0], place[1]), (PX * across, PX * up), **style)
