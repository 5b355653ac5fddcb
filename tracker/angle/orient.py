"""From marker positions to the actuator angle, with one camera."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from torsight.core.errors import ConfigError, NoResultError
from torsight.core.optics.axis import Axis, axis_in_picture, pose_from_axis
from torsight.core.optics.camera import Camera, Intrinsics, Pose, require_size
from torsight.core.optics.geometry import on_plane, ray_from_pixel, rotation_matrix
from torsight.core.threads import one_thread
from torsight.core.tracks import MarkerTracks
from tracker.angle.camera_motion import Unmoved, unmoved
from tracker.angle.length_noise import in_motion
from tracker.angle.plane import Orientation, Points, from_plane, scaled, stick_witness
from tracker.angle.tilt import KNOWN, Tilt, fit_tilt, rectify


@one_thread()
def orient(tracks: MarkerTracks, camera: Camera | None, *, pixel_aspect: float = 1.0) -> Orientation:
    """Return the moving stick's orientation against the base stick.

    Parameters
    ----------
    tracks : MarkerTracks
        Where the markers are.
    camera : Camera or None
        With a pose: rays are met with each stick's plane. With the lens alone: the axis is found from the markers' own
        paths. None: the picture's plane is the plane of motion, corrected for tilt where the paths tell it.
    pixel_aspect : float
        Width of a pixel over its height, for pictures without a camera file.

    Raises
    ------
    ConfigError
        When the camera file is for another picture size, or its axis points away from the camera.
    """
    if camera is None:
        return _without_camera(unmoved(tracks, pixel_aspect=pixel_aspect), pixel_aspect)
    require_size(camera.intrinsics, tracks.size_px, where="the film")
    if camera.pose is not None:
        _check_pose(camera.pose)
        tracks = unmoved(tracks, camera.intrinsics).tracks
        plane, position_mm = in_planes(tracks, camera.intrinsics, camera.pose)
        method = "camera file: rays met with each stick's plane"
        found = from_plane(tracks, plane, position_mm=position_mm, method=method)
        tilt = {"known": True, "from": "the camera file", "tilt_deg": _tilt_deg(camera.pose)}
        return found.with_report(tilt=tilt)
    still = unmoved(tracks, camera.intrinsics)
    tracks = still.tracks
    try:
        axis = axis_in_picture(still.paths.position_px[:, 2:], tracks.covariance_px2[:, 2:], camera.intrinsics)
    except NoResultError:
        # Too little motion to see the axis: the lens is taken out, the tilt stays unknown.
        return _without_camera(still, pixel_aspect, intrinsics=camera.intrinsics)
    plane, _ = in_planes(tracks, camera.intrinsics, pose_from_axis(axis))
    open_rad2 = _axis_variance(tracks, camera.intrinsics, axis)
    method = "lens file, axis from the markers' own ellipses"
    found = from_plane(tracks, plane, position_mm=None, method=method, systematic_rad2=open_rad2)
    error = float(np.sqrt(np.nanmean(open_rad2))) if np.isfinite(open_rad2).any() else np.nan
    tilt = {
        "known": error < KNOWN,
        "from": "the markers' own ellipses and the lens",
        "tilt_deg": float(np.rad2deg(axis.tilt_rad)),
        "sigma_deg": float(np.rad2deg(axis.direction_sigma_rad)),
        "arc_deg": float(np.rad2deg(axis.arc_rad)),
        "error_it_can_make_deg": float(np.rad2deg(error)),
    }
    return found.with_report(tilt=tilt)


def _axis_variance(tracks: MarkerTracks, intrinsics: Intrinsics, axis: Axis) -> NDArray[np.float64]:
    """Return the variance of the angle by what is not known of the axis."""

    def angle(direction: NDArray[np.float64]) -> NDArray[np.float64]:
        turned = replace(axis, direction=direction / np.linalg.norm(direction))
        plane, _ = in_planes(tracks, intrinsics, pose_from_axis(turned))
        return _against_still([points for points, _ in plane])

    sizes, ways = np.linalg.eigh(axis.direction_covariance)
    variance = np.zeros(len(tracks))
    # The third way is along the direction itself, which has no length to be wrong.
    for size, way in zip(sizes[1:], ways.T[1:], strict=True):
        step = float(np.sqrt(max(size, 0.0))) * way
        change = angle(axis.direction + step) - angle(axis.direction - step)
        variance += (0.5 * np.angle(np.exp(1j * change))) ** 2
    return variance


def _against_still(points: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Return the moving stick's direction against the base's usual one."""
    base, moving = points[1] - points[0], points[3] - points[2]
    still = np.arctan2(np.nanmedian(base[:, 1]), np.nanmedian(base[:, 0])) if np.isfinite(base).any() else np.nan
    return np.asarray(np.arctan2(moving[:, 1], moving[:, 0]) - still)


def _without_camera(still: Unmoved, pixel_aspect: float, *, intrinsics: Intrinsics | None = None) -> Orientation:
    """Take the picture's plane for the plane of motion, corrected for what the markers' paths tell of the tilt."""
    flat = _in_half_widths(still.tracks, pixel_aspect, intrinsics)
    paths = _in_half_widths(still.paths, pixel_aspect, intrinsics)[2:]
    scale = stick_witness(flat[2:], in_motion(still.tracks.position_px[:, 2:])).scale
    inner, outer = (scaled(points, scale) for points in paths)
    tilt = fit_tilt(inner[0], outer[0], inner[1], outer[1], half_px=0.5 * still.tracks.size_px[0])
    plane = []
    for points, covariance in flat:
        seen, slopes = rectify(points, tilt.values)
        plane.append((seen, _carried(covariance, slopes)))
    found = from_plane(
        still.tracks,
        plane,
        position_mm=None,
        method="no camera file: the picture's plane, corrected for tilt"
        if tilt.known
        else "no camera file: the picture's plane, its tilt unknown",
        systematic_rad2=_tilt_variance(flat, tilt),
    )
    return found.with_report(tilt=tilt.report())


def _in_half_widths(tracks: MarkerTracks, pixel_aspect: float, intrinsics: Intrinsics | None) -> list[Points]:
    """Return the markers from the picture's middle in units of half its width, without the lens where it is known."""
    width, height = tracks.size_px
    half, middle = 0.5 * pixel_aspect * width, np.zeros(2)
    if intrinsics is None:
        middle = np.array([0.5 * pixel_aspect * (width - 1), -0.5 * (height - 1)])
        flat = [_picture_plane(tracks, marker, pixel_aspect) for marker in range(4)]
    else:
        half = 0.5 * width / float(intrinsics.matrix[0, 0])
        flat = [_lens_plane(tracks, marker, intrinsics) for marker in range(4)]
    return [((points - middle) / half, covariance / half**2) for points, covariance in flat]


def _tilt_variance(flat: list[Points], tilt: Tilt) -> NDArray[np.float64]:
    """Return the variance of the angle by what is not known of the tilt."""

    def angle(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return _against_still([rectify(points, values)[0] for points, _ in flat])

    slopes = []
    for index in range(len(tilt.values)):
        step = np.zeros(len(tilt.values))
        step[index] = 1e-4
        change = angle(tilt.values + step) - angle(tilt.values - step)
        slopes.append(np.angle(np.exp(1j * change)) / 2e-4)
    jacobian = np.stack(slopes, axis=1)
    return np.asarray(np.einsum("ni,ij,nj->n", jacobian, tilt.covariance, jacobian), dtype=np.float64)


def _picture_plane(tracks: MarkerTracks, marker: int, pixel_aspect: float) -> Points:
    """Return positions with y up and square pixels."""
    turn = np.array([[pixel_aspect, 0.0], [0.0, -1.0]])
    return tracks.position_px[:, marker] @ turn.T, turn @ tracks.covariance_px2[:, marker] @ turn.T


def _lens_plane(tracks: MarkerTracks, marker: int, intrinsics: Intrinsics) -> Points:
    """Return positions with the lens taken out, y up."""
    flip = np.array([[1.0, 0.0], [0.0, -1.0]])
    rays, slopes = ray_from_pixel(tracks.position_px[:, marker], intrinsics)
    slopes = flip @ slopes
    return rays @ flip, _carried(tracks.covariance_px2[:, marker], slopes)


def _carried(covariance_px2: NDArray[np.float64], slopes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return covariances as a map with these derivatives carries them along."""
    return np.asarray(slopes @ covariance_px2 @ np.swapaxes(slopes, -1, -2), dtype=np.float64)


def _check_pose(pose: Pose) -> None:
    rotation = rotation_matrix(pose.rvec)
    centre = -rotation.T @ pose.tvec_mm
    if centre[2] <= max(pose.base_z_mm, pose.moving_z_mm):
        raise ConfigError(
            "the world's z axis points away from the camera",
            where="the camera file, [pose]",
            value=f"the camera is at z = {centre[2]:.1f} mm",
            limit=f"above the sticks' planes, at {max(pose.base_z_mm, pose.moving_z_mm):g} mm",
            do="turn the board's axes over: z is the rotation axis, towards the camera",
        )


def _tilt_deg(pose: Pose) -> float:
    """Return the angle between the axis and the line of sight to it."""
    centre = -rotation_matrix(pose.rvec).T @ pose.tvec_mm
    return float(np.rad2deg(np.arccos(np.clip(centre[2] / np.linalg.norm(centre), -1.0, 1.0))))


def in_planes(
    tracks: MarkerTracks, intrinsics: Intrinsics, pose: Pose, *, height_mm: NDArray[np.float64] | None = None
) -> tuple[list[Points], NDArray[np.float64]]:
    """Return where the lines of sight to the four markers meet their planes across the axis.

    Parameters
    ----------
    tracks : MarkerTracks
        Where the camera sees them.
    intrinsics, pose : Intrinsics, Pose
        The camera; z of the world is the axis.
    height_mm : (4,) float64, optional
        Height of each marker's plane; that of its stick in ``pose`` otherwise.

    Returns
    -------
    list of Points
        In the plane, one of each marker.
    (n, 4, 3) float64
        The same with the height.
    """
    if height_mm is None:
        height_mm = np.repeat([pose.base_z_mm, pose.moving_z_mm], 2)
    plane: list[Points] = []
    position_mm = np.full((len(tracks), 4, 3), np.nan)
    for marker, z_mm in enumerate(height_mm.tolist()):
        found, slopes = on_plane(tracks.position_px[:, marker], intrinsics, pose=pose, z_mm=z_mm)
        plane.append((found[:, :2], _carried(tracks.covariance_px2[:, marker], slopes)))
        position_mm[:, marker] = found
    return plane, position_mm
