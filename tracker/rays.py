"""From pixels to rays and on to the sticks' planes, with covariances carried along."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from torsight.core.camera import Intrinsics, Pose

_STEP_PX: Final = 0.25
_STOP: Final = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 60, 1e-12)


def undistort(position_px: NDArray[np.float64], intrinsics: Intrinsics) -> NDArray[np.float64]:
    """Return undistorted, normalised picture coordinates (n, 2) of pixels (n, 2); NaN stays NaN."""
    points = np.ascontiguousarray(position_px, dtype=np.float64).reshape(-1, 2)
    known = np.isfinite(points).all(axis=1)
    rays = np.full_like(points, np.nan)
    if known.any():
        rays[known] = cv2.undistortPoints(
            points[known].reshape(-1, 1, 2), intrinsics.matrix, intrinsics.distortion, criteria=_STOP
        ).reshape(-1, 2)
    return rays


def meet_plane(rays: NDArray[np.float64], pose: Pose, *, z_mm: float) -> NDArray[np.float64]:
    """Return where rays (n, 2) meet the plane at height ``z_mm``: world x and y, mm."""
    rotation = cv2.Rodrigues(pose.rvec)[0]
    centre = -rotation.T @ pose.tvec_mm
    directions = np.column_stack([rays, np.ones(len(rays))]) @ rotation
    reach = (z_mm - centre[2]) / directions[:, 2]
    return np.asarray(centre[:2] + reach[:, None] * directions[:, :2], dtype=np.float64)


def carry(
    function: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    position_px: NDArray[np.float64],
    covariance_px2: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return a smooth map of positions (n, 2) to (n, k), and the covariances (n, 2, 2) carried along, (n, k, k)."""
    value = function(position_px)
    slopes = []
    for axis in range(2):
        step = np.zeros(2)
        step[axis] = _STEP_PX
        slopes.append((function(position_px + step) - function(position_px - step)) / (2.0 * _STEP_PX))
    jacobian = np.stack(slopes, axis=-1)
    return value, jacobian @ covariance_px2 @ np.swapaxes(jacobian, -1, -2)
