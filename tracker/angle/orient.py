"""From marker positions to the actuator angle, with one camera."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from torsight.core.errors import NoResultError
from torsight.core.optics.axis import Axis, axis_in_picture, pose_from_axis
from torsight.core.optics.camera import Camera, Intrinsics, Pose, require_size
from torsight.core.optics.geometry import carried as carried_by
from torsight.core.optics.geometry import on_plane, rotation_matrix
from torsight.core.parallel.threads import one_thread
from torsight.core.series import bridged, known_median
from torsight.core.tracks import MarkerTracks
from torsight.core.units import Flags, Floats
from tracker.angle.camera_motion import flattened, unmoved
from tracker.angle.length_noise import in_motion, witness
from tracker.angle.plane import Orientation, from_plane, joined_errors, scaled, stick_errors, variance_by
from tracker.angle.row_time import Readout
from tracker.angle.tilt.estimate import fit_tilt
from tracker.angle.tilt.models import KNOWN, Tilt
from tracker.angle.tilt.paths import rectify
from tracker.angle.views import in_one_plane, joined, views_of
from tracker.stick_direction import Points


@one_thread()
def orient(tracks: MarkerTracks, camera: Camera | None, *, pixel_aspect: float = 1.0) -> Orientation:
    """Return the moving stick's orientation against the base stick.

    Parameters
    ----------
    tracks : MarkerTracks
        Positions of the markers.
    camera : Camera or None
        With a pose: rays are intersected with each stick's plane. With the lens alone: the axis is estimated from the
        markers' own paths. None: the picture's plane is the plane of motion, corrected for tilt where the paths
        determine it.
    pixel_aspect : float
        Width of a pixel over its height, for pictures without a camera file.

    Raises
    ------
    ConfigError
        When the camera file is for another picture size.
    """
    if camera is None:
        return _without_camera(tracks, pixel_aspect)
    require_size(camera, tracks.size_px, film="the film")
    still, pose, readout = unmoved(tracks, camera.intrinsics), camera.pose, Readout.of(tracks)
    open_rad2 = np.zeros(len(tracks))
    if pose is not None:
        tracks, method = still.tracks, "camera file: rays met with each stick's plane"
        tilt = {"known": True, "from": "the camera file", "tilt_deg": _tilt_deg(pose)}
    else:
        paths = still.paths
        try:
            axis = axis_in_picture(paths.position_px[:, 2:], paths.covariance_px2[:, 2:], camera.intrinsics)
        except NoResultError:
            # Too little motion to determine the axis: the lens is corrected, the tilt stays unknown.
            return _without_camera(tracks, pixel_aspect, intrinsics=camera.intrinsics)
        tracks, method = still.tracks, "lens file, axis from the markers' own ellipses"
        pose, open_rad2 = pose_from_axis(axis), _axis_variance(tracks, camera.intrinsics, axis)
        tilt = _tilt_by_lens(axis, open_rad2)
    plane, position_mm = in_planes(tracks, camera.intrinsics, pose)
    plane, rolling = read_at_once(plane, readout, in_motion(tracks.position_px[:, 2:]))
    found = from_plane(
        tracks,
        plane,
        position_mm=None if camera.pose is None else position_mm,
        method=method,
        across=rolling.across,
        systematic_rad2=open_rad2 + rolling.variance,
    )
    return found.with_report(tilt=tilt, rolling_shutter=rolling.report)


def _tilt_by_lens(axis: Axis, open_rad2: Floats) -> dict[str, Any]:
    """Return the entry of ``track.json`` on a tilt from the lens; ``open_rad2`` (n,) is its variance of the angle."""
    error = float(np.sqrt(np.nanmean(open_rad2))) if np.isfinite(open_rad2).any() else np.nan
    return {
        "known": error < KNOWN,
        "from": "the markers' own ellipses and the lens",
        "tilt_deg": float(np.rad2deg(axis.tilt_rad)),
        "sigma_deg": float(np.rad2deg(axis.direction_sigma_rad)),
        "arc_deg": float(np.rad2deg(axis.arc_rad)),
        "error_it_can_make_deg": float(np.rad2deg(error)),
    }


def _axis_variance(tracks: MarkerTracks, intrinsics: Intrinsics, axis: Axis) -> Floats:
    """Return the variance (n,) of the angle by the uncertainty of the axis' direction."""

    def angle(direction: Floats) -> Floats:
        turned = replace(axis, direction=direction / np.linalg.norm(direction))
        plane, _ = in_planes(tracks, intrinsics, pose_from_axis(turned))
        return _against_still([points for points, _ in plane])

    # Interpolated over frames in which one of the moving markers is hidden.
    return bridged(variance_by(angle, axis.direction, axis.direction_covariance))


def _against_still(points: list[Floats]) -> Floats:
    """Return the moving stick's direction (n,) against that of the base's median offset."""
    base, moving = points[1] - points[0], points[3] - points[2]
    still = np.arctan2(np.nanmedian(base[:, 1]), np.nanmedian(base[:, 0])) if np.isfinite(base).any() else np.nan
    return np.asarray(np.arctan2(moving[:, 1], moving[:, 0]) - still)


@dataclass(frozen=True, slots=True, eq=False)
class _Seen:
    """A view without a camera file: its tracks as by a fixed camera, the markers' plane, its tilt, and variances."""

    still: MarkerTracks
    plane: list[Points]
    tilt: Tilt
    readout: Readout
    variance_rad2: Floats

    @classmethod
    def of(cls, tracks: MarkerTracks, pixel_aspect: float, intrinsics: Intrinsics | None, *, carried: bool) -> _Seen:
        """Return the view, in the picture's plane, corrected for tilt where the markers' paths determine it."""
        still = paths = tracks
        if carried:
            # No tilt explains the paths.
            paths = replace(tracks, position_px=np.full_like(tracks.position_px, np.nan))
        else:
            still, paths, *_ = unmoved(tracks, intrinsics, pixel_aspect=pixel_aspect)
        flat, readout = _in_half_widths(still, pixel_aspect, intrinsics), Readout.of(tracks)
        scale = witness(flat[2:], moves=in_motion(still.position_px[:, 2:])).scale
        inner, outer = (scaled(points, scale) for points in _in_half_widths(paths, pixel_aspect, intrinsics)[2:])
        tilt = fit_tilt(inner, outer, readout, half_px=0.5 * still.size_px[0])
        places, slopes = _from_above(flat, tilt.values, readout)
        plane = [(at, carried_by(own[1], by)) for at, own, by in zip(places, flat, slopes, strict=True)]
        return cls(still, plane, tilt, readout, _variance(flat, tilt, readout))


def _without_camera(tracks: MarkerTracks, pixel_aspect: float, *, intrinsics: Intrinsics | None = None) -> Orientation:
    """Return the orientation in the picture's plane, corrected for the tilt of each view."""
    views = views_of(tracks)
    parts = [_Seen.of(one.of(tracks), pixel_aspect, intrinsics, carried=one.carried) for one in views]
    longest = max(range(len(views)), key=lambda k: views[k].rank)
    main, errors = parts[longest], None
    still, plane, variance = main.still, main.plane, main.variance_rad2
    if len(parts) > 1:
        # Lengths are those of one view, and change while the camera is carried.
        own = [
            None if view.carried else stick_errors(one.still, one.plane, across=one.tilt.across)
            for view, one in zip(views, parts, strict=True)
        ]
        errors = joined_errors(own, [view.end - view.first for view in views], longest)
        still, plane = joined([one.still for one in parts]), in_one_plane(views, [one.plane for one in parts])
        variance = np.concatenate([one.variance_rad2 for one in parts])
    found = from_plane(
        still,
        plane,
        position_mm=None,
        method="no camera file: the picture's plane, corrected for tilt"
        if main.tilt.known
        else "no camera file: the picture's plane, its tilt unknown",
        across=main.tilt.across,
        systematic_rad2=variance,
        errors=errors,
    )
    return found.with_report(tilt=main.tilt.report(), rolling_shutter=_rolling_report(main.tilt, main.readout))


def _from_above(flat: list[Points], values: Floats, readout: Readout) -> tuple[list[Floats], list[Floats]]:
    """Return the markers as seen along the axis, at their frames' timestamps; and the derivatives of the map."""
    places, slopes = zip(*(rectify(points, values) for points, _ in flat), strict=True)
    return [*places[:2], *readout.at_timestamps(places[2:], values[5:])], list(slopes)


@dataclass(frozen=True, slots=True, eq=False)
class Rolling:
    """Variance (n,) of the angle by the uncertainty of the read-out, and the read-out's entry of ``track.json``.

    For ``across`` see :class:`tracker.angle.tilt.models.Tilt`.
    """

    variance: Floats
    report: dict[str, Any]
    across: float = 1.0


def read_at_once(plane: list[Points], readout: Readout, moves: Flags) -> tuple[list[Points], Rolling]:
    """Return positions in a known plane, corrected for the rows' delay as far as the paths show one.

    ``moves`` (n,) marks the frames in which the moving stick moves in the picture.
    """
    px = known_median(_length(readout.place[:, 1] - readout.place[:, 0], readout.size_px))
    usual = known_median(_length(plane[3][0] - plane[2][0])) / px if px > 0.0 else np.nan
    if not usual > 0.0:
        return plane, Rolling(np.zeros(len(readout.time_s)), readout.report(np.zeros(2), np.zeros(2), shown=0.0))
    half = usual * 0.5 * readout.size_px[0]
    flat = [(points / half, covariance / half**2) for points, covariance in plane]
    scale = witness(flat[2:], moves=moves).scale
    inner, outer = (scaled(points, scale) for points in flat[2:])
    tilt = fit_tilt(inner, outer, readout, half_px=0.5 * readout.size_px[0], known=True)
    moving = readout.at_timestamps([plane[2][0], plane[3][0]], tilt.values[5:])
    found = [*plane[:2], *((at, own[1]) for at, own in zip(moving, plane[2:], strict=True))]
    return found, Rolling(_variance(flat, tilt, readout), _rolling_report(tilt, readout), tilt.across)


def _length(offset: Floats, size: tuple[float, float] = (1.0, 1.0)) -> Floats:
    return np.asarray(np.hypot(offset[:, 0] * size[0], offset[:, 1] * size[1]))


def _rolling_report(tilt: Tilt, readout: Readout) -> dict[str, Any]:
    return readout.report(tilt.values[5:], np.sqrt(np.diag(tilt.covariance)[5:]), shown=tilt.rolling)


def _in_half_widths(tracks: MarkerTracks, pixel_aspect: float, intrinsics: Intrinsics | None) -> list[Points]:
    """Return the markers relative to the picture's middle in units of half its width, undistorted where possible."""
    places, covariance, pixel = flattened(tracks, intrinsics, pixel_aspect)
    width, height = tracks.size_px
    half, middle = 0.5 * pixel * width, np.zeros(2)
    if intrinsics is None:
        half, middle = 0.5 * pixel_aspect * width, 0.5 * np.array([pixel_aspect * (width - 1), height - 1])
    # Flips y, from down to up.
    up = np.array([1.0, -1.0])
    places, covariance = (places - middle) * up / half, covariance * np.outer(up, up) / half**2
    return [(places[:, marker], covariance[:, marker]) for marker in range(4)]


def _variance(flat: list[Points], tilt: Tilt, readout: Readout) -> Floats:
    """Return the variance (n,) of the angle by the uncertainty of tilt and read-out."""

    def angle(values: Floats) -> Floats:
        return _against_still(_from_above(flat, values, readout)[0])

    # Interpolated over frames in which one of the moving markers is hidden.
    return bridged(variance_by(angle, tilt.values, tilt.covariance))


def _tilt_deg(pose: Pose) -> float:
    """Return the angle between the axis and the line of sight to it."""
    centre = -rotation_matrix(pose.rvec).T @ pose.tvec_mm
    return float(np.rad2deg(np.arccos(np.clip(centre[2] / np.linalg.norm(centre), -1.0, 1.0))))


def in_planes(
    tracks: MarkerTracks, intrinsics: Intrinsics, pose: Pose, *, height_mm: Floats | None = None
) -> tuple[list[Points], Floats]:
    """Return the intersections of the lines of sight with the markers' planes across the axis, the z axis of ``pose``.

    Both as points in each marker's plane, with covariances, and in space (n, 4, 3). The planes are those of the sticks
    in ``pose``, or at the heights ``height_mm`` (4,).
    """
    if height_mm is None:
        height_mm = np.repeat([pose.base_z_mm, pose.moving_z_mm], 2)
    plane: list[Points] = []
    position_mm = np.full((len(tracks), 4, 3), np.nan)
    for marker, z_mm in enumerate(height_mm.tolist()):
        found, slopes = on_plane(tracks.position_px[:, marker], intrinsics, pose=pose, z_mm=z_mm)
        plane.append((found[:, :2], carried_by(tracks.covariance_px2[:, marker], slopes)))
        position_mm[:, marker] = found
    return plane, position_mm
