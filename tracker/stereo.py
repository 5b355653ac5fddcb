"""The actuator angle from two films: positions in space, and the rotation axis found from the tracks."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from torsight.core.axis import axis_in_space
from torsight.core.camera import Camera, require_second, require_size
from torsight.core.circles import axis_basis
from torsight.core.errors import NoResultError
from torsight.core.geometry import triangulate
from torsight.core.scale import check_scale
from torsight.core.threads import one_thread
from torsight.core.tracks import MARKERS, MarkerTracks
from tracker.noise import in_motion
from tracker.orient import Orientation, Points, from_plane

Floats = NDArray[np.float64]

_OFF_LINE: Final = 30.0
"""χ² above which a marker in both pictures is not the same point (one degree of freedom)."""
_PARALLEL: Final = 0.2
_FEWEST: Final = 30
"""Readings that tell a usual misfit."""


@one_thread()
def orient_pair(
    left: MarkerTracks, right: MarkerTracks, camera: Camera, *, known_mm: Mapping[str, float] | None = None
) -> Orientation:
    """Return the moving stick's orientation against the base stick, in space.

    Parameters
    ----------
    left, right : MarkerTracks
        Tracks of both films; one row per frame of the left one is returned.
    camera : Camera
        With the second camera.
    known_mm : mapping of str to float, optional
        Distances of the markers of ``base`` and ``moving``, measured by hand.

    Raises
    ------
    ConfigError
        When the camera file has no second camera, or is for another picture size.
    NoResultError
        When the markers are never seen in both films, or do not belong together.
    """
    second = require_second(camera, where="the camera file")
    require_size(camera.intrinsics, left.size_px, where="the left film")
    require_size(second.intrinsics, right.size_px, where="the right film", table="right.intrinsics")
    other = _matching(left, right)
    space = triangulate(
        left.position_px,
        right.position_px[other],
        left=camera.intrinsics,
        right=second,
        left_covariance_px2=left.covariance_px2,
        right_covariance_px2=right.covariance_px2[other],
    )
    position = np.where((other >= 0)[:, None, None], space.position_mm, np.nan)
    # Compression makes errors larger than the fits say, alike in all frames: its usual size is the measure.
    usual = _usual(space.chi_squared, in_motion(left.position_px[:, 2:]))
    _require_same_points(space.chi_squared)
    off = space.chi_squared > _OFF_LINE * max(1.0, usual / 0.455)
    position[off] = np.nan
    direction, point, report = _axis(position, space.covariance_mm2)
    u, v = axis_basis(direction)
    frame = np.stack([u, v, direction])
    in_frame = (position - point) @ frame.T
    across = np.stack([u, v])
    plane: list[Points] = [
        (in_frame[:, marker, :2], across @ space.covariance_mm2[:, marker] @ across.T) for marker in range(4)
    ]
    found = from_plane(left, plane, position_mm=in_frame, method="two cameras: points in space, axis from the tracks")
    # Both sticks' marker distances tell whether scale and geometry of the cameras are right.
    errors = np.repeat(found.error_scale, 2, axis=1)[..., None, None] ** 2
    scale = check_scale(in_frame, space.covariance_mm2 * errors, known_mm=known_mm)
    return found.with_report(axis=report, scale=scale.to_json())


def _usual(chi_squared: Floats, moves: NDArray[np.bool_]) -> float:
    """Return the usual of the misfits (n, 4); that of motion where it is larger, for at rest a codec freezes noise."""
    known = np.isfinite(chi_squared)
    if not known.any():
        return np.nan
    usual = float(np.median(chi_squared[known]))
    known[~moves] = known[:, :2] = False
    return max(usual, float(np.median(chi_squared[known]))) if known.sum() >= _FEWEST else usual


def _matching(left: MarkerTracks, right: MarkerTracks) -> NDArray[np.int64]:
    """Return for each left frame the right frame of its time; −1 where there is none within half a frame."""
    nearest = np.clip(np.searchsorted(right.time_s, left.time_s), 1, max(1, len(right) - 1))
    nearest = np.minimum(nearest, len(right) - 1)
    before = np.maximum(nearest - 1, 0)
    closer = np.abs(right.time_s[before] - left.time_s) <= np.abs(right.time_s[nearest] - left.time_s)
    index = np.where(closer, before, nearest).astype(np.int64)
    step_s = float(np.median(np.diff(left.time_s))) if len(left) > 1 else np.inf
    return np.where(np.abs(right.time_s[index] - left.time_s) <= 0.5 * step_s, index, -1)


def _require_same_points(chi_squared: Floats) -> None:
    for marker, name in enumerate(MARKERS):
        seen = chi_squared[:, marker][np.isfinite(chi_squared[:, marker])]
        if len(seen) == 0:
            raise NoResultError(
                "is never seen in both films at once",
                where=f"stereo pair, {name.replace('_', ' ')} marker",
                do="check that both films show the rig and start at the same time",
            )


def _axis(position: Floats, covariance: Floats) -> tuple[Floats, Floats, dict[str, Any]]:
    """Return direction of the axis, a point on it, and what is said of it."""
    moving, spread = position[:, 2:], covariance[:, 2:]
    try:
        axis = axis_in_space(moving, spread)
    except NoResultError:
        return _axis_of_still_sticks(position)
    report = {
        "from": "the circles of the moving markers",
        "arc_deg": float(np.rad2deg(axis.arc_rad)),
        "direction_sigma_deg": float(np.rad2deg(axis.direction_sigma_rad)),
        "tilt_deg": float(np.rad2deg(axis.tilt_rad)),
        "misfit": axis.misfit,
    }
    return axis.direction, axis.point_mm, report


def _axis_of_still_sticks(position: Floats) -> tuple[Floats, Floats, dict[str, Any]]:
    """Return the direction across both sticks, for a film in which the moving one hardly turns."""
    mean = np.nanmean(position, axis=0)
    base, moving = (stick / np.linalg.norm(stick) for stick in (mean[1] - mean[0], mean[3] - mean[2]))
    across = np.cross(base, moving)
    size = float(np.linalg.norm(across))
    if not np.isfinite(size) or size < _PARALLEL:
        raise NoResultError(
            "the rotation axis cannot be found: the stick hardly turns, and both sticks point the same way",
            where="stereo pair",
            limit="30 degrees of motion",
            do="film more of the motion",
        )
    across /= size
    if across @ mean.mean(axis=0) > 0:
        across = -across
    return across, mean[2], {"from": "both sticks' directions: the moving one turns too little for circles"}
