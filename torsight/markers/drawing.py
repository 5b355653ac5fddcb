"""What the pictures of a film's markers share: the canvas, a frame as background, candidates, named markers."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from torsight.core.files.storage import atomic_path
from torsight.core.tracks import MARKERS
from torsight.core.words.colours import BASE_COLOUR, MOVING_COLOUR, hex_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from tracker.detect.candidates import Candidate

DPI: Final = 100
SHOWN_PX: Final = 960
"""Longer side of a frame in a page or a picture: smaller ones are enlarged, larger ones shrunk."""
BASE: Final = hex_of(BASE_COLOUR)
MOVING: Final = hex_of(MOVING_COLOUR)
GIVEN: Final = "#f0e442"
"""A position that a person gave."""
DOT: Final = "#e69f00"
"""A dot that was not taken."""
REFUSED: Final = "#cc79a7"
"""A place that is no dot."""
PLAIN: Final = "#333333"


def new_figure(size_px: tuple[float, float]) -> Figure:
    """Return an empty figure of this size for a picture file."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(size_px[0] / DPI, size_px[1] / DPI), dpi=DPI, facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def panel(figure: Figure, box_px: tuple[float, float, float, float]) -> Axes:
    """Return axes at ``(left, top, width, height)`` in pixels of the figure, top counted from above."""
    left, top, width, height = box_px
    across, down = figure.get_size_inches() * DPI
    return figure.add_axes((left / across, 1.0 - (top + height) / down, width / across, height / down))


def save(figure: Figure, path: Path) -> None:
    """Write a figure as PNG, the same bytes for the same content.

    Raises
    ------
    OutputError
        When the file cannot be written.
    """
    with atomic_path(path) as temporary:
        figure.savefig(temporary, format="png", dpi=DPI, metadata={"Software": None})


def show_frame(
    axes: Axes, luma: NDArray[np.uint8], *, view_px: tuple[float, float, float, float] | None = None
) -> None:
    """Draw a frame, or the part ``(left, top, right, bottom)`` of it, without ticks.

    What has more pixels than the axes is shrunk before, by means over areas: thin marks stay visible.
    """
    import cv2

    height, width = luma.shape
    left, top, right, bottom = view_px or (-0.5, -0.5, width - 0.5, height - 0.5)
    first_x, first_y = max(0, int(left)), max(0, int(top))
    part = luma[first_y : min(height, int(np.ceil(bottom)) + 1), first_x : min(width, int(np.ceil(right)) + 1)]
    edges = (first_x - 0.5, first_x + part.shape[1] - 0.5, first_y + part.shape[0] - 0.5, first_y - 0.5)
    room = axes.get_window_extent()
    shrink = min(room.width / part.shape[1], room.height / part.shape[0])
    if shrink < 1.0:
        size = (max(1, round(shrink * part.shape[1])), max(1, round(shrink * part.shape[0])))
        part = np.asarray(cv2.resize(np.ascontiguousarray(part), size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
    axes.imshow(part, cmap="gray", vmin=0, vmax=255, extent=edges, interpolation="nearest", aspect="equal")
    axes.set_xlim(left, right)
    axes.set_ylim(bottom, top)
    axes.set_xticks([])
    axes.set_yticks([])


def show_stick(axes: Axes, points_px: NDArray[np.float64], *, colour: str, radius_px: float) -> None:
    """Draw the markers (2, 2) of a stick that were read, and the line between them; NaN where one was not."""
    from matplotlib.patches import Circle

    axes.plot(points_px[:, 0], points_px[:, 1], color=colour, lw=1.2, alpha=0.9)
    for x, y in points_px[np.isfinite(points_px).all(axis=1)].tolist():
        axes.add_patch(Circle((x, y), 1.6 * radius_px, fill=False, color=colour, lw=1.6))
        axes.plot([x], [y], "+", color=colour, ms=5, mew=1.0)


def show_candidates(axes: Axes, candidates: Sequence[Candidate]) -> None:
    """Draw the candidates that were not taken, each with its number."""
    from matplotlib.patches import Circle

    for one in candidates:
        if one.taken:
            continue
        colour = DOT if one.is_dot else REFUSED
        reach = max(1.5 * one.radius_px, 4.0)
        line = "-" if one.is_dot else ":"
        axes.add_patch(Circle((one.x_px, one.y_px), reach, fill=False, color=colour, lw=1.4, ls=line))
        tag(axes, (one.x_px + reach, one.y_px - reach), str(one.number), colour)


def show_named(axes: Axes, places_px: NDArray[np.float64], names: Sequence[str], colours: Sequence[str]) -> None:
    """Draw places (n, 2) as rings with a cross and a name."""
    for (x, y), name, colour in zip(places_px.tolist(), names, colours, strict=True):
        axes.plot([x], [y], "o", mfc="none", mec=colour, ms=13, mew=1.8)
        axes.plot([x], [y], "+", color=colour, ms=7, mew=1.0)
        axes.annotate(
            name, (x, y), xytext=(10, 4), textcoords="offset points", color="black", fontsize=8, bbox=_label(colour)
        )


def marker_names() -> list[str]:
    """Return the markers' names as words."""
    return [name.replace("_", " ") for name in MARKERS]


def marker_colours() -> list[str]:
    """Return the colours of the four markers."""
    return [BASE, BASE, MOVING, MOVING]


def tag(axes: Axes, place_px: tuple[float, float], text: str, colour: str) -> None:
    """Write a short label at a place of the picture."""
    axes.annotate(text, place_px, color="black", fontsize=7, ha="left", va="bottom", bbox=_label(colour), clip_on=True)


def _label(colour: str) -> dict[str, object]:
    return {"boxstyle": "round,pad=0.15", "fc": colour, "ec": "none", "alpha": 0.85}


def wrapped(text: str, width: int) -> list[str]:
    """Return a text in lines of at most ``width`` characters, and no empty list."""
    return textwrap.wrap(text, width) or [""]
