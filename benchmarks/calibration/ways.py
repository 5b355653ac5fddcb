"""The ways from marker positions to the angle that the benchmarks of this folder compare."""

from __future__ import annotations

import numpy as np

from torsight.core.optics.axis import axis_in_picture, pose_from_axis
from torsight.core.optics.camera import Camera, Intrinsics, Pose
from torsight.core.optics.circles import axis_basis
from torsight.core.optics.geometry import on_plane, ray_from_pixel
from torsight.core.tracks import MarkerTracks
from tracker.angle.stereo import orient_pair

Z = np.array([0.0, 0.0, 1.0])


Points = tuple[np.ndarray, np.ndarray]
"""Positions (n, 4, 2) in px and covariances (n, 4, 2, 2)."""


def angles_by_way(left: Points, right: Points | None, known: Camera) -> dict[str, np.ndarray]:
    """Return the angle (n,) in rad for each way; ``known`` holds lens, pose and right camera.

    picture as it is: nothing is corrected. lens only: distortion is taken out. tilt only: the pose is used with a lens
    without distortion. lens and tilt: both. lens and circles: the pose is found from the markers' own paths. stereo:
    the markers' places on their circles, from both pictures.
    """
    left_px, left_covariance = left
    pinhole = Intrinsics(known.intrinsics.size_px, known.intrinsics.matrix, np.zeros(5))
    found = axis_in_picture(left_px[:, 2:], left_covariance[:, 2:], known.intrinsics)
    ray = ray_from_pixel(left_px, known.intrinsics)[0]
    return {
        "picture as it is": _flat(left_px),
        "lens only": _flat(ray),
        "tilt only": _on_planes(left_px, pinhole, known.pose),
        "lens and tilt": _on_planes(left_px, known.intrinsics, known.pose),
        "lens and circles": _on_planes(left_px, known.intrinsics, pose_from_axis(found)),
        "stereo": np.full(len(left_px), np.nan) if right is None else _in_space(left, right, known),
    }


def error_deg(angle_rad: np.ndarray, truth_rad: np.ndarray) -> np.ndarray:
    """Return the angle's error in degrees, without its mean: a constant is the zero of the angle, not its error."""
    error = np.angle(np.exp(1j * (angle_rad - truth_rad)))
    known = np.exp(1j * error[np.isfinite(error)])
    middle = np.angle(known.mean()) if len(known) else 0.0
    return np.degrees(np.angle(np.exp(1j * (error - middle))))


def _in_space(left: Points, right: Points, known: Camera) -> np.ndarray:
    tracks = [
        MarkerTracks(
            frame=np.arange(len(position)),
            # The films of a pair have the same frames; only their order counts.
            time_s=np.arange(len(position)) / 30.0,
            position_px=position,
            covariance_px2=covariance,
            valid=np.isfinite(position).all(axis=-1),
            size_px=intrinsics.size_px,
        )
        for (position, covariance), intrinsics in ((left, known.intrinsics), (right, known.right.intrinsics))
    ]
    return orient_pair(*tracks, known).angles.angle_rad


def _flat(position: np.ndarray) -> np.ndarray:
    sticks = position[:, 1::2] - position[:, ::2]
    direction = np.arctan2(-sticks[..., 1], sticks[..., 0])
    return direction[:, 1] - direction[:, 0]


def _on_planes(position_px: np.ndarray, intrinsics: Intrinsics, pose: Pose) -> np.ndarray:
    planes = [
        on_plane(position_px[:, part], intrinsics, pose=pose, z_mm=height)[0]
        for part, height in ((slice(0, 2), pose.base_z_mm), (slice(2, 4), pose.moving_z_mm))
    ]
    return _about(np.concatenate(planes, axis=1), Z)


def _about(position_mm: np.ndarray, direction: np.ndarray) -> np.ndarray:
    sticks = (position_mm[:, 1::2] - position_mm[:, ::2]) @ np.stack(axis_basis(direction), axis=1)
    return np.diff(np.arctan2(sticks[..., 1], sticks[..., 0]), axis=1)[:, 0]
