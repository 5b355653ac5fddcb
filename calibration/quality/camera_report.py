"""The table ``[calibration]`` of ``CAMERA.toml``, and the lines that the command prints."""

from __future__ import annotations

from typing import Any

from calibration.axis.board_on_disk import DiskPose
from calibration.boards.board_file import Board
from calibration.cameras.lens import PARAMETERS
from calibration.cameras.stereo_pair import PairCalibration
from calibration.quality.calibration_verdict import cells_covered
from calibration.stage import Calibration, Side
from calibration.views.board_views import Seen
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
