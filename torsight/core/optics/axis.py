"""The rotation axis from the paths of the moving stick's markers.

A marker on a turning stick keeps its height along the axis and its distance from the axis. Two cameras determine both
in space. One camera's picture does not show the height, but two markers that keep their distances from the axis and the
angle between them determine the axis' tilt: seen along a tilted axis the circles become ellipses, and perspective
distinguishes the near side from the far side. Both cases are the same fit,
:class:`torsight.core.optics.circles.Circles`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from torsight.core.errors import NoResultError
from torsight.core.minimise import jacobian_of
from torsight.core.optics.camera import Intrinsics, Pose
from torsight.core.optics.circles import Circles, Sight, axis_basis, on_unit_plane, tilted
from torsight.core.optics.geometry import meeting_point, rotation_vector
from torsight.core.optics.hanging import USUAL_PX, spread_rows
from torsight.core.units import Floats

_FEWEST_FRAMES: Final = 8
"""Number of frames with both moving markers below which no axis is fitted: each gives three equations beyond its own
angle, and nine values are shared, so that eight frames give more than twice the necessary equations."""
_SMALLEST_ARC_RAD: Final = np.pi / 6
"""Part of a turn, 30°, that these frames must span: a shorter arc fits circles of many tilts."""
_LEAST_ACROSS: Final = math.sqrt(0.5)
"""Least part of the moving stick's length across its axis: a stick lies more across the axis than along it."""
_TILTS_RAD: Final = np.arange(0.05, 1.2, 0.05)
_TURNS_RAD: Final = np.arange(0.0, 2.0 * np.pi, np.pi / 12)
"""Start values of the axis' tilt and its direction, on a grid within the fit's range of convergence."""


@dataclass(frozen=True, slots=True, eq=False)
class Axis:
    """A rotation axis in the (left) camera's coordinates."""

    point_mm: Floats
    """(3,): A point on the axis, in the plane of the first marker. From one camera lengths are in units of the distance
    of the moving stick's two markers, until this distance is known in mm."""
    direction: Floats
    """(3,): Unit vector along the axis, towards the camera."""
    direction_sigma_rad: float
    """Largest standard deviation of the axis' tilt over all directions; correlated errors are included."""
    radius_mm: Floats
    height_mm: Floats
    """(k,): Radius of each marker's circle, and its height along ``direction`` above ``point_mm``."""
    misfit: float
    """Root of χ² per degree of freedom: 1 where the residuals agree with the positions' sigmas."""
    arc_rad: float
    """Part of a turn that the paths cover."""
    mirror_gap: float = np.inf
    """Gain in χ² over the mirror-image tilt, which one camera can distinguish by perspective alone; infinite for two
    cameras. Below about 10 the sign of the tilt is not certain (angles hardly depend on it)."""
    direction_covariance: Floats = field(default_factory=lambda: np.zeros((3, 3)))
    """(3, 3): Covariance of ``direction``, including errors that are correlated with the stick's direction."""

    @property
    def tilt_rad(self) -> float:
        """Angle between the axis and the camera's line of sight to it."""
        return tilt_of(self.point_mm, self.direction)


def axis_from_pair(left: Sight, right: Sight, *, noise_px: float) -> tuple[Axis, Circles]:
    """Fit one axis to the circles of the moving stick's markers, inner and outer, in the pictures of two cameras.

    The axis is in the left camera's coordinates, and in mm if the cameras' distance is. ``noise_px`` is the usual
    standard deviation of a marker's position. The fit is returned, too, for the angles of all frames.

    Raises NoResultError when too few positions are known, or the markers turned too little.
    """
    seen = np.concatenate((left.seen, right.seen), axis=1)
    whole = np.asarray(seen.all(axis=1))
    _require_frames(int(whole.sum()))
    stick = np.where(
        np.asarray(left.seen.all(axis=1))[:, None], left.ray[:, 1] - left.ray[:, 0], right.ray[:, 1] - right.ray[:, 0]
    )
    rows = spread_rows(np.arctan2(stick[:, 1], stick[:, 0]), whole)
    sights = [left.rows(rows), right.rows(rows)]
    points = meeting_point(sights[0].ray, sights[1].ray, rotation=right.rotation, shift=right.shift)
    _require_turn(points[:, 1] - points[:, 0])
    found = [Circles.begun(sights, start, points).fitted() for start in _directions_in_space(points)]
    first = min(found, key=lambda item: item.chi_squared).without_far()
    arc_rad = _arc(first)
    best = first.weighed(usual=USUAL_PX / noise_px).fitted()
    return _axis_of(best, first, arc_rad=arc_rad), best


def axis_in_picture(position_px: Floats, covariance_px2: Floats, intrinsics: Intrinsics) -> Axis:
    """Fit the axis to the paths (n, 2, 2) of the moving stick's inner and outer marker in one camera's picture.

    Positions are NaN where not known. The unit of length is the distance of the two markers, which are assumed to lie
    in one plane across the axis.

    Raises NoResultError when too few positions are known, or the markers turned too little.
    """
    stick = position_px[:, 1] - position_px[:, 0]
    known = np.asarray(np.isfinite(position_px).all(axis=(1, 2)), dtype=np.bool_)
    rows = spread_rows(np.arctan2(stick[:, 1], stick[:, 0]), known)
    _require_frames(len(rows))
    sight = Sight.of(position_px[rows], covariance_px2[rows], intrinsics)
    _, lines = sight.lines
    found = [
        Circles.begun([sight], start, on_unit_plane(lines, start, lines.mean(axis=(0, 1)))).fitted()
        for start in _start_directions(lines)
    ]
    found.sort(key=lambda item: item.chi_squared)
    first = found[0]
    distinct = [item for item in found[1:] if item.direction @ first.direction < np.cos(1e-3)]
    arc_rad = _arc(first)
    white_px = float(np.sqrt(0.5 * np.median(np.trace(covariance_px2[rows], axis1=-2, axis2=-1))))
    best = first.weighed(usual=USUAL_PX / white_px).fitted()
    r1, r2 = best.radii
    length = float(np.sqrt(r1**2 + r2**2 - 2.0 * r1 * r2 * np.cos(best.between_rad)))
    gap = float(distinct[0].chi_squared - first.chi_squared) if distinct else np.inf
    return _axis_of(best, first, arc_rad=arc_rad, unit=length, mirror_gap=gap)


def _axis_of(best: Circles, first: Circles, *, arc_rad: float, unit: float = 1.0, mirror_gap: float = np.inf) -> Axis:
    """Return the axis from a fit; ``first`` is the fit with all errors taken as independent."""
    turned = jacobian_of(lambda tilt: tilted(best.frame, tilt), best.values[:2])
    tilt = best.covariance[:2, :2]
    return Axis(
        point_mm=best.point / unit,
        direction=best.direction,
        direction_sigma_rad=float(np.sqrt(np.linalg.eigvalsh(tilt)[-1])),
        direction_covariance=turned @ tilt @ turned.T,
        radius_mm=best.radii / unit,
        height_mm=np.array([0.0, best.rise / unit]),
        misfit=float(np.sqrt(first.chi_squared / max(first.residuals - int(first.free.sum()), 1))),
        arc_rad=arc_rad,
        mirror_gap=mirror_gap,
    )


def pose_from_axis(axis: Axis, *, length_mm: float = 1.0, base_z_mm: float = 0.0) -> Pose:
    """Return the pose of the world whose z axis is the rotation axis, with its origin in the moving markers' plane.

    ``length_mm`` is the axis' unit of length: for an axis from one camera the distance of the moving stick's markers.
    The base stick's markers are ``base_z_mm`` above those of the moving stick; this affects positions, not the angle.
    """
    return pose_along(axis.point_mm * length_mm, axis.direction, base_z_mm=base_z_mm, moving_z_mm=0.0)


def pose_along(origin_mm: Floats, direction: Floats, *, base_z_mm: float, moving_z_mm: float) -> Pose:
    """Return the pose of the world with the given origin and z axis, a unit vector; both (3,) in camera coordinates."""
    u, v = axis_basis(direction)
    return Pose(
        rvec=rotation_vector(np.stack((u, v, direction), axis=1)),
        tvec_mm=origin_mm,
        base_z_mm=base_z_mm,
        moving_z_mm=moving_z_mm,
    )


def tilt_of(point_mm: Floats, direction: Floats) -> float:
    """Return the angle between a unit vector towards the camera and the line of sight to its point, rad."""
    toward = -point_mm / np.linalg.norm(point_mm)
    return float(np.arccos(np.clip(toward @ direction, -1.0, 1.0)))


def _directions_in_space(points: Floats) -> list[Floats]:
    """Return start directions of the axis, towards the camera, from markers in space (n, 2, 3).

    One is normal to the markers' motion, the other to the stick.
    """
    middle = points.mean(axis=(0, 1))
    stick = points[:, 1] - points[:, 0]
    away = (points - points.mean(axis=0)).reshape(-1, 3)
    found = [np.linalg.eigh(vectors.T @ vectors)[1][:, 0] for vectors in (away, stick)]
    return [direction if direction @ middle < 0 else -direction for direction in found]


def _start_directions(lines: Floats) -> list[Floats]:
    """Return the axis direction for which the paths are most circular, and its mirror image."""
    toward = -lines.mean(axis=(0, 1))
    toward /= np.linalg.norm(toward)
    u, v = axis_basis(toward)
    tilt = np.append(0.0, np.repeat(_TILTS_RAD, len(_TURNS_RAD)))[:, None]
    turn = np.append(0.0, np.tile(_TURNS_RAD, len(_TILTS_RAD)))[:, None]
    aside = np.cos(turn) * u + np.sin(turn) * v
    tried = np.cos(tilt) * toward + np.sin(tilt) * aside
    across = (np.cos(tilt) * aside - np.sin(tilt) * toward, np.cos(turn) * v - np.sin(turn) * u)
    first = tried[int(np.argmin(_roundness(lines, tried, across)))]
    mirrored = 2.0 * (first @ toward) * toward - first
    return [first, mirrored / np.linalg.norm(mirrored)]


def _roundness(lines: Floats, directions: Floats, across: tuple[Floats, Floats]) -> Floats:
    """Return the relative variance (k,) of the radii of paths (n, 2, 3) about each of the axis directions (k, 3).

    ``across`` are two unit vectors (k, 3) across each direction.
    """
    through = lines.mean(axis=(0, 1))
    depth = (directions @ through) / (lines @ directions.T)
    x, y = (depth * (lines @ vector.T) for vector in across)
    # The circles' common centre by linear least squares; centring each marker's terms eliminates its radius.
    square = x**2 + y**2
    less = [part - part.mean(axis=0) for part in (x, y, square)]
    xx, xy, xs, yy, ys = (np.sum(less[i] * less[j], axis=(0, 1)) for i, j in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2)))
    normal = np.stack((xx, xy, xy, yy), axis=-1).reshape(-1, 2, 2)
    centre = 0.5 * np.linalg.pinv(normal, hermitian=True) @ np.stack((xs, ys), axis=-1)[..., None]
    radius = np.hypot(x - centre[:, 0, 0], y - centre[:, 1, 0])
    return np.asarray(np.sum((radius - radius.mean(axis=0)) ** 2, axis=(0, 1)) / np.sum(radius**2, axis=(0, 1)))


def _arc(circles: Circles) -> float:
    """Return the range of the stick's angle, rad; a range that is too small is refused."""
    arc_rad = float(np.ptp(np.unwrap(circles.turns().angle_rad)))
    if arc_rad < _SMALLEST_ARC_RAD:
        raise _too_small(arc_rad)
    return arc_rad


def _require_turn(stick: Floats) -> None:
    """Refuse sticks (n, 3) in space that turn too little about any axis that they can have.

    Such an arc hardly determines the circles, and their fit would take hundreds of steps before it is refused.
    """
    direction = stick / np.linalg.norm(stick, axis=1, keepdims=True)
    turn_rad = float(np.arccos(np.clip((direction @ direction.T).min(), -1.0, 1.0)))
    # A part s of the stick across the axis: sin(turn / 2) = s sin(arc / 2).
    if math.sin(0.5 * turn_rad) < _LEAST_ACROSS * math.sin(0.5 * _SMALLEST_ARC_RAD):
        raise _too_small(turn_rad)


def _too_small(arc_rad: float) -> NoResultError:
    return NoResultError(
        "the markers turn too little to find the rotation axis",
        value=f"{np.degrees(arc_rad):.0f}°",
        limit=f"at least {np.degrees(_SMALLEST_ARC_RAD):.0f}° of a turn",
        do="film a larger motion, or measure the axis with a board on the disk",
    )


def _require_frames(count: int) -> None:
    if count < _FEWEST_FRAMES:
        raise NoResultError(
            "too few frames show both moving markers to find the rotation axis",
            value=f"{count} frames",
            limit=f"at least {_FEWEST_FRAMES}",
            do="film a longer motion, or measure the axis with a board on the disk",
        )
