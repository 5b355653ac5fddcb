"""From marker positions to the actuator angle, with one camera."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from torsight.core.camera import Camera
from torsight.core.errors import ConfigError
from torsight.core.tracks import MarkerTracks, StickAngles
from torsight.core.units import DEG
from tracker.noise import LengthWitness, witness
from tracker.rays import carry, meet_plane, undistort
from tracker.steady import steady_direction
from tracker.unwrap import unwrap

_PLANES: Final = (0, 0, 1, 1)
_FLOOR_PX: Final = 0.003
"""What remains of the pixels' own pattern in a position, measured over radii of 3 to 12 px and sharp to soft lenses."""


@dataclass(frozen=True, slots=True, eq=False)
class Orientation:
    """The angle of a film and how it was had.

    Attributes
    ----------
    angles : StickAngles
        The actuator angle, frame by frame.
    position_mm : (n, 4, 3) float64 or None
        Markers in space, where a camera file tells scale.
    report : dict
        For ``track.json``: method, noise, tilt.
    error_scale : (float, float)
        Errors of base and moving markers over those that their covariances from the fits say.
    """

    angles: StickAngles
    position_mm: NDArray[np.float64] | None
    report: dict[str, Any] = field(default_factory=dict)
    error_scale: tuple[float, float] = (1.0, 1.0)

    def with_errors(self, tracks: MarkerTracks) -> MarkerTracks:
        """Return tracks whose covariances are those of the errors that the sticks' lengths show."""
        scale = np.repeat(np.array(self.error_scale), 2)[:, None, None] ** 2
        return replace(tracks, covariance_px2=tracks.covariance_px2 * scale + _FLOOR_PX**2 * np.eye(2))


def orient(tracks: MarkerTracks, camera: Camera | None, *, pixel_aspect: float = 1.0) -> Orientation:
    """Return the moving stick's orientation against the base stick.

    Parameters
    ----------
    tracks : MarkerTracks
        Where the markers are.
    camera : Camera or None
        With a pose: rays are met with each stick's plane. None: the picture's plane is the plane of motion.
    pixel_aspect : float
        Width of a pixel over its height, for pictures without a camera file.

    Raises
    ------
    ConfigError
        When the camera file is for another picture size, has no pose, or its axis points away from the camera.
    """
    if camera is None:
        plane = [_picture_plane(tracks, m, pixel_aspect) for m in range(4)]
        position_mm = None
        method = "picture plane"
    else:
        plane, position_mm = _in_planes(tracks, camera)
        method = "camera file: rays met with each stick's plane"
    return from_plane(tracks, plane, position_mm=position_mm, method=method)


Points = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Positions (n, 2) in a plane seen from the camera, y up, and covariances (n, 2, 2)."""


def from_plane(
    tracks: MarkerTracks,
    plane: list[Points],
    *,
    position_mm: NDArray[np.float64] | None,
    method: str,
) -> Orientation:
    """Return the angle from the markers' positions in planes across the axis."""
    base = witness(plane[0][0], plane[1][0], plane[0][1], plane[1][1])
    moving = witness(plane[2][0], plane[3][0], plane[2][1], plane[3][1])
    scale = moving.scale
    floor = _floor(tracks)
    base_rad, base_variance = _direction(plane[0], plane[1])
    moving_rad, moving_variance = _direction(plane[2], plane[3])
    base_rad[base.outlier] = np.nan
    moving_rad[moving.outlier] = np.nan
    base_rad = _continuous(base_rad)
    steady_rad, steady_variance = steady_direction(base_rad, base_variance * max(scale, base.scale) ** 2)
    variance = moving_variance * scale**2 + steady_variance + floor[0] + floor[1]
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
    report = {"method": method, "noise": noise}
    return Orientation(angles, position_mm, report, (max(scale, base.scale), scale))


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


def _in_planes(tracks: MarkerTracks, camera: Camera) -> tuple[list[Points], NDArray[np.float64]]:
    check_size(tracks.size_px, camera)
    pose = camera.pose
    if pose is None:
        raise ConfigError(
            "has no [pose] and [planes]",
            where="the camera file",
            do="calibrate the pose of the axis, or give both films of the stereo pair",
        )
    heights = (pose.base_z_mm, pose.moving_z_mm)
    plane: list[Points] = []
    position_mm = np.full((len(tracks), 4, 3), np.nan)
    for marker in range(4):
        z_mm = heights[_PLANES[marker]]

        def to_plane(pixels: NDArray[np.float64], z_mm: float = z_mm) -> NDArray[np.float64]:
            return meet_plane(undistort(pixels, camera.intrinsics), pose, z_mm=z_mm)

        points = carry(to_plane, tracks.position_px[:, marker], tracks.covariance_px2[:, marker])
        plane.append(points)
        position_mm[:, marker, :2] = points[0]
        position_mm[:, marker, 2] = np.where(np.isfinite(points[0][:, 0]), z_mm, np.nan)
    return plane, position_mm


def check_size(size_px: tuple[int, int], camera: Camera) -> None:
    """Refuse a camera file for another picture size.

    Raises
    ------
    ConfigError
        Naming both sizes.
    """
    width, height = camera.intrinsics.size_px
    if (width, height) != size_px:
        raise ConfigError(
            "the camera file is for another picture size",
            where="[intrinsics] width, height",
            value=f"{width} × {height}",
            limit=f"{size_px[0]} × {size_px[1]}, the size of the film",
            do="calibrate the camera at the size at which it films",
        )
