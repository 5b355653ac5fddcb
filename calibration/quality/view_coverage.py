"""A picture of the coverage: the positions of all corners, their errors, and the empty cells."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from calibration.quality.calibration_verdict import CELLS, cells_covered
from calibration.stage import Side
from torsight.core.files.figure_file import write_figure

_EMPTY: Final = "#f4d7d3"
_ASIDE: Final = "#999999"
_ARROW_SHARE: Final = 0.03
"""Length of the arrow of the 95 % error, as a share of the picture's width: a quarter of the distance of the corners of
a board of usual size that fills the picture, so that arrows do not touch."""


def draw_coverage(path: Path, sides: list[tuple[str, Side]]) -> None:
    """Draw the corners of all views of each camera; the suffix of the path (png, svg, pdf) decides the format.

    Corners are coloured by their error, with arrows in its direction (enlarged by the factor in the title); cells
    without a corner are shaded; corners of views that were set aside are grey crosses.
    """
    figure = Figure(figsize=(7.5 * len(sides), 6.2), layout="constrained")
    for place, (name, side) in enumerate(sides):
        axes = figure.add_subplot(1, len(sides), place + 1)
        points = _draw_side(axes, name, side)
        figure.colorbar(points, ax=axes, label="error of the corner, px", shrink=0.8)
    write_figure(path, figure, dpi=110)


def _draw_side(axes: Axes, name: str, side: Side) -> Any:
    width, height = side.seen.size_px
    kept, aside = side.lens.kept_views, side.lens.aside_views
    covered = cells_covered(kept, side.seen.size_px)
    for row, column in np.argwhere(~covered):
        axes.axvspan(
            column * width / CELLS[0] - 0.5,
            (column + 1) * width / CELLS[0] - 0.5,
            ymin=1.0 - (row + 1) / CELLS[1],
            ymax=1.0 - row / CELLS[1],
            color=_EMPTY,
            linewidth=0,
        )
    corners = np.concatenate([view.corners_px for view in kept])
    residual = np.concatenate(side.lens.fit.residual_px)
    size = np.linalg.norm(residual, axis=1)
    enlarged = _ARROW_SHARE * width / max(float(np.quantile(size, 0.95)), 1e-6)
    axes.quiver(
        corners[:, 0], corners[:, 1], residual[:, 0] * enlarged, residual[:, 1] * enlarged,
        angles="xy", scale_units="xy", scale=1.0, width=0.0015, color="#444444",
    )  # fmt: skip
    points = axes.scatter(
        corners[:, 0], corners[:, 1], c=size, s=10, cmap="viridis", vmin=0.0, vmax=float(np.quantile(size, 0.98))
    )
    if aside:
        away = np.concatenate([view.corners_px for view in aside])
        label = "set aside: " + ", ".join(view.name for view in aside)
        axes.plot(away[:, 0], away[:, 1], "x", color=_ASIDE, markersize=4, label=label)
        axes.legend(loc="upper left", fontsize="small")
    axes.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5), aspect="equal", xlabel="x, px", ylabel="y, px")
    axes.set_title(
        f"{name}: {100 * covered.mean():.0f} % of the picture covered by {len(kept)} views\n"
        f"arrows: error × {enlarged:.0f}; shaded: no corner seen",
        fontsize="medium",
    )
    return points
