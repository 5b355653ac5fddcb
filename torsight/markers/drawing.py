"""Common parts of the pictures of a film's markers: a frame as background, and marks on it.

Figures are drawn without matplotlib's configured backend, which need not be installed. Positions are in pixels of the
frame, where pixel centres are whole numbers.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

from matplotlib.axes import Axes
from matplotlib.patches import Circle
from numpy.typing import NDArray

from torsight.core.units import Floats
from torsight.core.words.colours import Colour, hex_of

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
