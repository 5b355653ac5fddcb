"""Account of a calibration: the table ``[calibration]`` of ``CAMERA.toml``, lines for the terminal, a picture."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from calibration.axis import DiskPose
from calibration.boards.board_file import Board
from calibration.cameras.lens import PARAMETERS
from calibration.cameras.stereo_pair import PairCalibration
from calibration.quality.calibration_verdict import CELLS, cells_covered
from calibration.stage import Calibration, Side
from calibration.views.board_views import Seen
from torsight.core.files.figure_file import write_figure
from torsight.core.files.provenance import versions


def account(calibration: Calibration, *, earlier: dict[str, Any] | None = None) -> dict[str, Any]:
    """Return the table ``[calibration]``: board, pictures with hashes and errors, uncertainty, versions, date.

    ``earlier`` is the table of a known camera to which only the pose was added.
    """
    content: dict[str, Any] = dict(earlier or {})
    if calibration.left is not None:
        content = {
            "verdict": calibration.verdict.word,
            "reasons": list(calibration.verdict.reasons),
            "versions": versions(),
            "board": calibration.board.content(),
            "left": _lens(calibration.left),
        }
    if calibration.right is not None and calibration.pair is not None:
        content["right"] = _lens(calibration.right)
        content["pair"] = _pair(calibration.pair)
    if calibration.disk is not None and calibration.disk_seen is not None:
        content["axis"] = _axis(calibration.board, calibration.disk, calibration.disk_seen)
    return content


def summary(calibration: Calibration) -> list[str]:
    """Return the lines that the command prints at its end."""
    lines: list[str] = []
    for name, side in (("Camera", calibration.left), ("Right camera", calibration.right)):
        if side is not None:
            lines += _lens_lines(name, side)
    pair = calibration.pair
    if pair is not None:
        lines += [
            (
                f"Pair            {len(pair.index)} pairs, error {pair.rms_px:.3f} px rms, "
                f"epipolar error {pair.epipolar_px.mean():.3f} px in the mean"
            ),
            f"  baseline      {pair.baseline_mm:.2f} ± {pair.baseline_sigma_mm:.2f} mm",
            *(f"  set aside     pair {item.view + 1}: {item.why}" for item in pair.aside),
        ]
    disk = calibration.disk
    if disk is not None:
        lines.append(
            f"Rotation axis   tilted by {disk.tilt_deg:.2f}° to the line of sight, ± {disk.direction_sigma_deg:.2f}°; "
            f"board fits to {disk.error_px:.2f} px"
        )
        if len(disk.turned_deg) > 1:
            lines.append(
                f"  from          {len(disk.turned_deg)} positions of the disk; the board lies "
                f"{disk.wobble_deg:.2f}° off the plane across the axis"
            )
    if calibration.left is not None:
        lines.append(f"Verdict         {calibration.verdict.word}")
        lines += [f"  because       {reason}" for reason in calibration.verdict.reasons]
    return lines


def _lens_lines(name: str, side: Side) -> list[str]:
    lens, views = side.lens, side.lens.views
    matrix, sigma = lens.fit.intrinsics.matrix, lens.sigma
    kept = lens.kept_views
    covered = 100.0 * float(cells_covered(kept, side.seen.size_px).mean())
    missing = [source for source in side.seen.sources if source.note]
    lines = [
        (
            f"{name:<15} {len(kept)} of {len(views)} views used, error {lens.fit.mean_px:.3f} px in the mean "
            f"({lens.fit.rms_px:.3f} px rms), {covered:.0f} % of the picture covered"
        ),
        f"  focal length  {matrix[0, 0]:.2f} ± {sigma[0]:.2f} px, {matrix[1, 1]:.2f} ± {sigma[1]:.2f} px",
        f"  centre        {matrix[0, 2]:.2f} ± {sigma[2]:.2f} px, {matrix[1, 2]:.2f} ± {sigma[3]:.2f} px",
    ]
    lines += [f"  set aside     {views[item.view].name}: {item.why}" for item in lens.aside]
    lines += [f"  left out      {source.name}: {source.note}" for source in missing[:5]]
    if len(missing) > 5:
        lines.append(f"  left out      {len(missing) - 5} more")
    if lens.aside:
        lines.append(
            f"  with all      {len(views)} views and customary windows: error {lens.first.rms_px:.3f} px rms, "
            f"focal length {lens.first.intrinsics.matrix[0, 0]:.2f} px"
        )
    return lines


def _lens(side: Side) -> dict[str, Any]:
    lens = side.lens
    kept = lens.kept_views
    content: dict[str, Any] = {
        "width": side.seen.size_px[0],
        "height": side.seen.size_px[1],
        "views_found": len(lens.views),
        "views_used": len(kept),
        "error_mean_px": lens.fit.mean_px,
        "error_rms_px": lens.fit.rms_px,
        "coverage": float(cells_covered(kept, side.seen.size_px).mean()),
        "orientations_deg": lens.fit.orientations_deg,
        "sigma": _named(lens.sigma),
        "sigma_within_views": _named(lens.fit.sigma),
        "sigma_between_views": _named(lens.between_views),
        "all_views": {
            "error_rms_px": lens.first.rms_px,
            "error_mean_px": lens.first.mean_px,
            "fx_px": float(lens.first.intrinsics.matrix[0, 0]),
            "fy_px": float(lens.first.intrinsics.matrix[1, 1]),
        },
        "pictures": _pictures(side),
    }
    if side.seen.device:
        content["device"] = side.seen.device
    return content


def _named(values: Any) -> dict[str, float]:
    return {name: float(value) for name, value in zip(PARAMETERS, values, strict=True)}


def _pictures(side: Side) -> list[dict[str, Any]]:
    lens = side.lens
    place = {view.index: number for number, view in enumerate(lens.views)}
    error = dict(zip(lens.kept.tolist(), lens.fit.error_px.tolist(), strict=True))
    why = {item.view: item.why for item in lens.aside}
    rows: list[dict[str, Any]] = []
    for source in side.seen.sources:
        view = place.get(source.index)
        row: dict[str, Any] = {"name": source.name, "sha256": source.sha256, "used": view in error}
        if view is None:
            row["why"] = source.note
        else:
            row["error_px"] = error.get(view, float(lens.first.error_px[view]))
            row |= {"why": why[view]} if view in why else {}
        rows.append(row)
    return rows


def _pair(pair: PairCalibration) -> dict[str, Any]:
    return {
        "pairs_used": len(pair.index),
        "baseline_mm": pair.baseline_mm,
        "baseline_sigma_mm": pair.baseline_sigma_mm,
        "rvec_sigma": pair.sigma[:3].tolist(),
        "tvec_sigma_mm": pair.sigma[3:].tolist(),
        "error_rms_px": pair.rms_px,
        "epipolar_mean_px": float(pair.epipolar_px.mean()),
        "epipolar_px": pair.epipolar_px.tolist(),
        "set_aside": [{"pair": item.view, "why": item.why} for item in pair.aside],
    }


def _axis(board: Board, disk: DiskPose, seen: Seen) -> dict[str, Any]:
    return {
        "board": board.content(),
        "pictures": [{"name": source.name, "sha256": source.sha256} for source in seen.sources],
        "tilt_deg": disk.tilt_deg,
        "direction_sigma_deg": disk.direction_sigma_deg,
        "place_sigma_mm": disk.place_sigma_mm,
        "error_px": disk.error_px,
        "turned_deg": list(disk.turned_deg),
        "board_off_plane_deg": disk.wobble_deg,
    }


_EMPTY: Final = "#f4d7d3"
_ASIDE: Final = "#999999"


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
    # The arrow of the 95 % error has a quarter of the distance of the corners of a board of usual size that fills the
    # picture, so that arrows do not touch.
    enlarged = 0.03 * width / max(float(np.quantile(size, 0.95)), 1e-6)
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
