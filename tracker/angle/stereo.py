"""The actuator angle from two films: the angle on circles that all frames share.

Depth from two pictures is several times less precise than the position within one. So depth is used only for quantities
that all frames determine together: the rotation axis, the moving markers' circles about it, and the positions of the
base's markers (:mod:`torsight.core.optics.circles`). In a single frame only the angle remains unknown; it is estimated
from all markers that either film shows.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from torsight.core.errors import NoResultError
from torsight.core.optics.axis import Axis, axis_from_pair
from torsight.core.optics.camera import Camera
from torsight.core.optics.circles import Circles, Turns, axis_basis
from torsight.core.optics.geometry import SpacePoints, project
from torsight.core.optics.scale import check_scale
from torsight.core.parallel.threads import one_thread
from torsight.core.series import known_median
from torsight.core.tracks import MarkerTracks
from torsight.core.units import Floats
from tracker.angle.length_noise import in_motion
from tracker.angle.orient import Rolling, in_planes, read_at_once
from tracker.angle.plane import (
    Moving,
    Orientation,
    against_base,
    floor_of,
    moving_direction,
    stick_errors,
    variance_by,
)
from tracker.angle.reference_direction import steady_direction
from tracker.angle.row_time import Readout
from tracker.angle.stereo_films import MISREAD, Film, films_of, fused, same_points, triangulated
from tracker.detect.sticks import PARALLEL
from tracker.innovation import passes
from tracker.stick_direction import Points, stick_direction

_FLAT: Final = np.deg2rad(0.03)
"""Prior standard deviation of the slope of the base's line of markers against the plane across the axis: a hundredth of
a millimetre over 20. One camera with known planes takes it as zero."""


@dataclass(frozen=True, slots=True, eq=False)
class _Rig:
    """Geometry that all frames share.

    ``direction`` and ``point`` define the axis, ``height_mm`` (4,) are the markers' heights along it, ``rise_sigma_mm``
    is the standard deviation of the height of the base's outer marker above its inner one; ``circles`` is None where
    the stick turns too little to show them; ``report`` is for ``track.json``.
    """

    direction: Floats
    point: Floats
    height_mm: Floats
    circles: Circles | None
    report: dict[str, Any]
    rise_sigma_mm: float = 0.0

    @property
    def frame(self) -> Floats:
        """u, v and the axis' direction (3, 3)."""
        return np.stack((*axis_basis(self.direction), self.direction))


@one_thread()
def orient_pair(
    left: MarkerTracks, right: MarkerTracks, camera: Camera, *, known_mm: Mapping[str, float] | None = None
) -> Orientation:
    """Return the moving stick's orientation against the base stick.

    Every angle is the most likely one for the pixels of both pictures (of one, where the other shows no marker of the
    moving stick), with the markers on their circles about the axis and the base at its place; motion of either camera
    is measured on the base stick, and removed.

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
        When a marker is never seen in both films simultaneously, or the axis cannot be found.
    """
    films, space = same_points(films_of(left, right, camera))
    rig = _first_rig(films, space)
    read, rollings = _at_timestamps(films, rig)
    if any(rolling.report["known"] for rolling in rollings):
        # The rolling shutter biased the axis, and so the delay that was estimated about that axis.
        rig = _first_rig(read, space)
        read, rollings = _at_timestamps(films, rig)
    films = read
    # The errors of each film from its own sticks' lengths in their planes; then the axis again, with those errors.
    errors = [stick_errors(film.tracks, _on_planes(film, rig)) for film in films]
    scaled_films = [film.scaled(error) for film, error in zip(films, errors, strict=True)]
    space = triangulated(scaled_films)
    if rig.circles is not None:
        axis, circles = axis_from_pair(*(film.sight() for film in scaled_films), noise_px=_noise_px(scaled_films))
        rig = _rig_of(axis, circles)
    in_frame = (space.position_mm - rig.point) @ rig.frame.T
    rig = _with_base(rig, in_frame, rig.frame @ space.covariance_mm2 @ rig.frame.T)
    plane = fused([_on_planes(film, rig) for film in scaled_films])
    base_rad, base_variance = stick_direction(plane[0], plane[1])
    if rig.circles is None:
        moving = moving_direction(plane, np.ones(len(left)))
        method = "two cameras: positions in planes across both sticks"
    else:
        moving = _on_circles(rig.circles, scaled_films, films, rig=rig, space=space)
        method = "two cameras: the angle on the markers' circles, axis and circles from the tracks"
    # The mean of both films, whose errors are independent.
    unread = 0.25 * sum(rolling.variance for rolling in rollings)
    found = against_base(
        films[0].tracks,
        replace(moving, variance_rad2=moving.variance_rad2 + unread),
        (base_rad, base_variance),
        errors=errors[0],
        floor_rad2=floor_of(films[0].tracks)[0] + films[1].tracks.choice_rad2,
        position_mm=_positions(in_frame, plane, rig),
        method=method,
    )
    noise = {
        **found.report["noise"],
        "error_over_white_noise_right": {"base": errors[1].base.scale, "moving": errors[1].moving.scale},
    }
    # Both sticks' marker distances check scale and geometry of the cameras.
    scale = check_scale(in_frame, space.covariance_mm2, known_mm=known_mm)
    return found.with_report(
        axis=rig.report,
        noise=noise,
        scale=scale.to_json(),
        rolling_shutter=rollings[0].report,
        rolling_shutter_right=rollings[1].report,
    )


def _at_timestamps(films: list[Film], rig: _Rig) -> tuple[list[Film], list[Rolling]]:
    """Return the films with the moving markers moved to their frames' timestamps, and the read-out of each film.

    Each film has its own read-out, which is estimated from its paths in the planes across the axis as for one camera.
    """
    read, rollings = [], []
    for film in films:
        plane, rolling = read_at_once(
            _on_planes(film, rig), Readout.of(film.tracks), in_motion(film.tracks.position_px[:, 2:])
        )
        rollings.append(rolling)
        if not rolling.report["known"]:
            read.append(film)
            continue
        pose, position = film.pose(rig.direction, rig.point), film.tracks.position_px.copy()
        for marker in (2, 3):
            point = np.pad(plane[marker][0], ((0, 0), (0, 1)), constant_values=rig.height_mm[marker])
            position[:, marker] = project(point, film.intrinsics, rvec=pose.rvec, tvec_mm=pose.tvec_mm)
        read.append(replace(film, tracks=replace(film.tracks, position_px=position)))
    return read, rollings


def _noise_px(films: list[Film]) -> float:
    """Return the standard deviation of a moving marker's position, px, from the median of the variances."""
    spread = np.stack([np.trace(film.tracks.covariance_px2[:, 2:], axis1=-2, axis2=-1) for film in films])
    return float(np.sqrt(0.5 * known_median(spread)))


def _first_rig(films: list[Film], space: SpacePoints) -> _Rig:
    """Return the axis and the markers' heights, with the unscaled covariances of the dots' fits."""
    try:
        axis, circles = axis_from_pair(*(film.sight() for film in films), noise_px=_noise_px(films))
    except NoResultError:
        rig = _rig_of_still_sticks(space.position_mm)
    else:
        rig = _rig_of(axis, circles)
    height = np.nanmedian((space.position_mm[:, :2] - rig.point) @ rig.direction, axis=0)
    return replace(rig, height_mm=np.concatenate((height, rig.height_mm[2:])))


def _rig_of(axis: Axis, circles: Circles) -> _Rig:
    """Return the rig from a fit of the circles; the base's heights are NaN."""
    report = {
        "from": "the circles of the moving markers",
        "arc_deg": float(np.rad2deg(axis.arc_rad)),
        "direction_sigma_deg": float(np.rad2deg(axis.direction_sigma_rad)),
        "tilt_deg": float(np.rad2deg(axis.tilt_rad)),
        "misfit": axis.misfit,
    }
    height = np.concatenate((np.full(2, np.nan), axis.height_mm))
    return _Rig(axis.direction, axis.point_mm, height, circles, report)


def _rig_of_still_sticks(position: Floats) -> _Rig:
    """Return a rig whose axis is perpendicular to both sticks, for a film in which the moving one hardly turns."""
    mean = np.nanmean(position, axis=0)
    base, moving = (stick / np.linalg.norm(stick) for stick in (mean[1] - mean[0], mean[3] - mean[2]))
    across = np.cross(base, moving)
    size = float(np.linalg.norm(across))
    if not np.isfinite(size) or size < PARALLEL:
        raise NoResultError(
            "the rotation axis cannot be found: the stick hardly turns, and both sticks point the same way",
            where="stereo pair",
            limit="30 degrees of motion",
            do="film more of the motion",
        )
    across /= size
    if across @ mean.mean(axis=0) > 0:
        across = -across
    height = (mean - mean[2]) @ across
    report = {"from": "both sticks' directions: the moving one turns too little for circles"}
    return _Rig(across, mean[2], height, None, report)


def _with_base(rig: _Rig, in_frame: Floats, covariance: Floats) -> _Rig:
    """Return the rig with the heights of the base's markers, from markers (n, 4, 3) in the axis' frame."""
    base = in_frame[:, :2]
    middle = float(np.nanmedian(base[..., 2]))
    if rig.circles is None:
        return replace(rig, height_mm=np.array([middle, middle, 0.0, 0.0]))
    length = float(np.nanmedian(np.linalg.norm(base[:, 1] - base[:, 0], axis=1)))
    rises, variances = steady_direction(base[:, 1, 2] - base[:, 0, 2], covariance[:, :2, 2, 2].sum(axis=1))
    rise, variance, flat = known_median(rises), known_median(variances), (_FLAT * length) ** 2
    if passes(rise**2 / (flat + variance), 1):
        # Otherwise the film shows that the base is not as flat as sticks usually are.
        rise, variance = (flat / (flat + variance) * one for one in (rise, variance))
    half = 0.5 * rise
    height = np.array([middle - half, middle + half, *rig.height_mm[2:]])
    return replace(rig, height_mm=height, rise_sigma_mm=math.sqrt(variance))


def _stick(radii: Floats, between_rad: float) -> Floats:
    """Return the vector (2,) from the first marker to the second, for a first marker at angle zero."""
    return np.array([radii[1] * np.cos(between_rad) - radii[0], radii[1] * np.sin(between_rad)])


def _on_planes(film: Film, rig: _Rig) -> list[Points]:
    """Return the intersections of a film's lines of sight with the markers' planes."""
    pose = film.pose(rig.direction, rig.point)
    return in_planes(film.tracks, film.intrinsics, pose, height_mm=rig.height_mm)[0]


def _positions(in_frame: Floats, plane: list[Points], rig: _Rig) -> Floats:
    """Return the markers (n, 4, 3) in the axis' frame: triangulated, or in their plane where one film shows them."""
    position = in_frame.copy()
    for marker in range(4):
        gone = ~np.isfinite(position[:, marker]).all(axis=1) & np.isfinite(plane[marker][0]).all(axis=1)
        position[gone, marker, :2] = plane[marker][0][gone]
        position[gone, marker, 2] = rig.height_mm[marker]
    return position


def _on_circles(circles: Circles, films: list[Film], bare: list[Film], *, rig: _Rig, space: SpacePoints) -> Moving:
    """Return the moving stick's direction from its markers' positions on their circles.

    ``bare`` are the films with the unscaled covariances of the fits, for the bound that the pictures' noise sets.
    """
    whole = replace(circles, sights=[film.sight() for film in films])
    turns, usual = _without_misread(whole)
    bound = replace(whole, sights=[film.sight() for film in bare]).turns(near_rad=turns.angle_rad)
    rolled = np.mean([film.turn_rad2 for film in films], axis=0)
    variance = (
        turns.variance_rad2 * usual + _shared_variance(whole, turns.angle_rad, films, rig=rig, space=space) + rolled
    )
    offset = np.arctan2(*_stick(whole.radii, whole.between_rad)[::-1])
    alone = sum(sight.seen.sum(axis=1) for sight in whole.sights) == 1
    return Moving(turns.angle_rad + offset, variance, alone, known_median(bound.variance_rad2))


def _without_misread(whole: Circles) -> tuple[Turns, float]:
    """Return the stick's angle in every frame without misread positions, and the usual χ² per degree of freedom.

    A frame whose χ² is an outlier is fitted again without each of its positions in turn; the best fit is kept, or NaN
    where all are outliers.
    """
    turns = whole.turns()
    share = turns.chi_squared / np.maximum(turns.freedom, 1.0)
    told = turns.freedom > 1.0
    usual = max(1.0, known_median(share[told]))
    fit = told & (turns.chi_squared < MISREAD * usual)
    usual = max(1.0, float(turns.chi_squared[fit].sum() / turns.freedom[fit].sum())) if fit.any() else usual
    rows = np.flatnonzero(turns.chi_squared > MISREAD * usual)
    best = _columns(turns)[:, rows]
    for number, marker in itertools.product(range(len(whole.sights)), (0, 1)):
        sights = [sight.rows(rows) for sight in whole.sights]
        sights[number] = sights[number].without(marker)
        other = replace(whole, sights=sights).turns()
        better = np.isfinite(other.angle_rad) & (other.freedom > 0.0) & (other.chi_squared < best[2])
        best = np.where(better, _columns(other), best)
    best[:2, best[2] > MISREAD * usual] = np.nan
    columns = _columns(turns)
    columns[:, rows] = best
    return Turns(*columns), usual


def _columns(turns: Turns) -> Floats:
    return np.stack((turns.angle_rad, turns.variance_rad2, turns.chi_squared, turns.freedom))


def _shared_variance(whole: Circles, near_rad: Floats, films: list[Film], *, rig: _Rig, space: SpacePoints) -> Floats:
    """Return the variance (n,) of the angle by the uncertainty of axis, circles, and the base's slope."""
    near_rad = np.nan_to_num(near_rad)
    base = np.nanmedian(space.position_mm[:, :2], axis=0)
    places = [_usual_place(film) for film in films]
    rise = float(rig.height_mm[1] - rig.height_mm[0])

    def angle(values: Floats) -> Floats:
        circles = replace(whole, values=values[:-1])
        middle = float(np.mean((base - circles.point) @ circles.direction))
        height = middle + 0.5 * values[-1] * np.array([-1.0, 1.0, 0.0, 0.0])
        now = replace(rig, direction=circles.direction, point=circles.point, height_mm=height)
        plane = fused([_on_planes(film, now) for film in places])
        base_rad, _ = stick_direction(plane[0], plane[1])
        offset = np.arctan2(*_stick(circles.radii, circles.between_rad)[::-1])
        return np.asarray(whole.turns(values=circles.values, near_rad=near_rad).angle_rad + offset - base_rad)

    values = np.append(whole.values, rise)
    covariance = np.zeros((len(values), len(values)))
    covariance[:-1, :-1], covariance[-1, -1] = whole.covariance, rig.rise_sigma_mm**2
    return variance_by(angle, values, covariance)


def _usual_place(film: Film) -> Film:
    """Return a film of one frame, with every marker at the median of its positions."""
    tracks = MarkerTracks(
        frame=np.zeros(1, np.int64),
        time_s=np.zeros(1),
        position_px=np.nanmedian(film.tracks.position_px, axis=0)[None],
        covariance_px2=np.nanmedian(film.tracks.covariance_px2, axis=0)[None],
        valid=np.ones((1, 4), np.bool_),
        size_px=film.tracks.size_px,
    )
    return replace(film, tracks=tracks)
