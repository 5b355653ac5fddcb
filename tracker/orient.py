"""From marker positions to the actuator angle, with one camera."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from torsight.core.axis import Axis, axis_in_picture, pose_from_axis
from torsight.core.camera import Camera, Intrinsics, Pose, require_size
from torsight.core.errors import ConfigError, NoResultError
from torsight.core.frozen import Frozen
from torsight.core.geometry import on_plane, ray_from_pixel, rotation_matrix
from torsight.core.shown import Shown
from torsight.core.threads import one_thread
from torsight.core.tracks import MarkerTracks, StickAngles
from torsight.core.units import DEG
from tracker.lone import lone_direction
from tracker.noise import LengthWitness, in_motion, witness
from tracker.steady import steady_direction
from tracker.tilt import KNOWN, Tilt, fit_tilt, rectify
from tracker.unmoved import Unmoved, unmoved
from tracker.unwrap import unwrap

_PLANES: Final = (0, 0, 1, 1)
_FLOOR_PX: Final = 0.003
"""What remains of the pixels' own pattern in a position, measured over radii of 3 to 12 px and sharp to soft lenses."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Orientation(Frozen, Shown):
    """The angle of a film and how it was had.

    Attributes
    ----------
    angles : StickAngles
        The actuator angle, frame by frame.
    position_mm : (n, 4, 3) float64 or None
        Markers in space, where a camera file tells scale.
    report : mapping
        For ``track.json``: method, noise, tilt.
    error_scale : (n, 2) float64
        Errors of base and moving markers over those that their covariances from the fits say, frame by frame.
    """

    angles: StickAngles
    position_mm: NDArray[np.float64] | None
    error_scale: NDArray[np.float64]
    report: Mapping[str, Any] = field(default_factory=dict)

    def with_report(self, **entries: Any) -> Orientation:
        """Return the orientation with further entries for ``track.json``."""
        return replace(self, report={**self.report, **entries})

    def facts(self) -> dict[str, str]:
        """Return the angle, its uncertainty and how it was had."""
        return {**self.angles.facts(), "method": str(self.report.get("method", ""))}

    def _columns(self) -> dict[str, Any]:
        return dict(self.angles.to_frame())

    def _draw(self, axes: Any) -> None:
        self.angles.plot(axes)

    def with_errors(self, tracks: MarkerTracks) -> MarkerTracks:
        """Return tracks whose covariances are those of the errors that the sticks' lengths show."""
        scale = np.repeat(self.error_scale, 2, axis=1)[..., None, None] ** 2
        return replace(tracks, covariance_px2=tracks.covariance_px2 * scale + _FLOOR_PX**2 * np.eye(2))


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
        plane, position_mm = _in_planes(tracks, camera.intrinsics, camera.pose)
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
    plane, _ = _in_planes(tracks, camera.intrinsics, pose_from_axis(axis))
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
        plane, _ = _in_planes(tracks, intrinsics, pose_from_axis(turned))
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
    scale = _witness(flat[2:], in_motion(still.tracks.position_px[:, 2:])).scale
    inner, outer = (_scaled(points, scale) for points in paths)
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


Points = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Positions (n, 2) in a plane seen from the camera, y up, and covariances (n, 2, 2)."""


def from_plane(
    tracks: MarkerTracks,
    plane: list[Points],
    *,
    position_mm: NDArray[np.float64] | None,
    method: str,
    systematic_rad2: NDArray[np.float64] | None = None,
) -> Orientation:
    """Return the angle from the markers' positions in planes across the axis.

    ``systematic_rad2`` (n,) is variance of the angle that positions do not show, such as by an unknown tilt.
    """
    base_moves, moves = in_motion(tracks.position_px[:, :2]), in_motion(tracks.position_px[:, 2:])
    base, moving = _witness(plane[:2], base_moves), _witness(plane[2:], moves)
    # The base's noise is frozen longest of all: the other stick tells what it hides.
    of_base = np.where(base_moves, max(base.scale, moving.scale), max(base.still, moving.still))
    error_scale = np.stack([of_base, np.where(moves, moving.scale, moving.still)], axis=1)
    base_scale, scale = error_scale.T
    floor = _floor(tracks)
    base_rad, base_variance = _direction(plane[0], plane[1])
    moving_rad, moving_variance = _direction(plane[2], plane[3])
    base_rad[base.outlier] = np.nan
    moving_rad[moving.outlier] = np.nan
    lone = lone_direction((plane[0], plane[1]), (_scaled(plane[2], scale), _scaled(plane[3], scale)), moving_rad)
    one = np.isfinite(lone.angle_rad)
    moving_rad = np.where(one, lone.angle_rad, moving_rad)
    base_rad = _continuous(base_rad)
    steady_rad, steady_variance = steady_direction(base_rad, base_variance * base_scale**2)
    variance = np.where(one, lone.variance_rad2, moving_variance * scale**2) + steady_variance + floor[0] + floor[1]
    if systematic_rad2 is not None:
        variance = variance + systematic_rad2
    angle_rad, certain = unwrap(tracks.time_s, moving_rad - steady_rad)
    valid = np.isfinite(angle_rad) & np.isfinite(variance)
    angles = StickAngles(
        frame=tracks.frame,
        time_s=tracks.time_s,
        angle_rad=np.where(valid, angle_rad, np.nan),
        # Where the whole turn is not certain the angle may be off by one: the sigma says so.
        sigma_rad=np.where(valid, np.sqrt(variance) + np.where(certain, 0.0, 2.0 * np.pi), np.nan),
        valid=valid,
        branch_certain=certain,
    )
    noise = _noise_report(base, moving)
    noise["angle_bound_deg"] = float(np.sqrt(np.nanmedian(moving_variance))) / DEG if valid.any() else None
    report = {"method": method, "noise": noise, "from_one_marker": int((valid & one).sum())}
    return Orientation(angles, position_mm, error_scale, report)


def _witness(stick: list[Points], moves: NDArray[np.bool_]) -> LengthWitness:
    """Return what the length of a stick says, from its inner and outer marker."""
    inner, outer = stick
    return witness(inner[0], outer[0], inner[1], outer[1], moves=moves)


def _scaled(points: Points, scale: float | NDArray[np.float64]) -> Points:
    """Return positions with the errors that the stick's length shows, in every frame or in each (n,)."""
    return points[0], points[1] * np.reshape(scale, (-1, 1, 1)) ** 2


def _floor(tracks: MarkerTracks) -> tuple[float, float]:
    """Return the variance of both sticks' directions that no averaging takes away, rad²."""
    found: list[float] = []
    for first in (0, 2):
        offset = tracks.position_px[:, first + 1] - tracks.position_px[:, first]
        length = np.hypot(offset[:, 0], offset[:, 1])
        known = length[np.isfinite(length)]
        found.append(2.0 * _FLOOR_PX**2 / float(np.median(known)) ** 2 if len(known) else 0.0)
    return found[0], found[1]


def _noise_report(base: LengthWitness, moving: LengthWitness) -> dict[str, Any]:
    return {
        "error_over_white_noise": {"base": base.scale, "moving": moving.scale},
        "impossible_lengths": {"base": int(base.outlier.sum()), "moving": int(moving.outlier.sum())},
    }


def _direction(inner: Points, outer: Points) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return a stick's direction and its variance."""
    offset = outer[0] - inner[0]
    square = np.sum(offset**2, axis=1)
    across = np.stack([-offset[:, 1], offset[:, 0]], axis=1)
    variance = np.einsum("ni,nij,nj->n", across, inner[1] + outer[1], across) / square**2
    return np.arctan2(offset[:, 1], offset[:, 0]), variance


def _continuous(angle_rad: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a direction that hardly changes, free of jumps by whole turns."""
    known = np.isfinite(angle_rad)
    if not known.any():
        return angle_rad
    middle = np.angle(np.mean(np.exp(1j * angle_rad[known])))
    return np.asarray(middle + np.angle(np.exp(1j * (angle_rad - middle))), dtype=np.float64)


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


def _in_planes(tracks: MarkerTracks, intrinsics: Intrinsics, pose: Pose) -> tuple[list[Points], NDArray[np.float64]]:
    heights = (pose.base_z_mm, pose.moving_z_mm)
    plane: list[Points] = []
    position_mm = np.full((len(tracks), 4, 3), np.nan)
    for marker in range(4):
        z_mm = heights[_PLANES[marker]]
        found, slopes = on_plane(tracks.position_px[:, marker], intrinsics, pose=pose, z_mm=z_mm)
        plane.append((found[:, :2], _carried(tracks.covariance_px2[:, marker], slopes)))
        position_mm[:, marker] = found
    return plane, position_mm
