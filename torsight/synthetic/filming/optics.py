"""The synthetic camera: world to picture, and every pixel back to a plane across the rotation axis.

Projection and lens are OpenCV's own, not those of :mod:`torsight.core.optics.geometry`, so that the project's reading
of camera files can be checked against them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from torsight.core.optics.camera import Camera, Intrinsics, Pose, RightCamera
from torsight.core.units import DEG, Floats
from torsight.synthetic.scene import CameraSettings, Scene

_UNTIL_IT_CONVERGES: Final = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 60, 1e-12)
"""End of OpenCV's iteration: most steps, and the distance in units of the focal length, 1e-9 px."""


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """One camera in the world of the rotation axis: its lens, camera from world, and the world's origin in it."""

    intrinsics: Intrinsics
    rotation: Floats
    translation_mm: Floats

    def project(self, points_mm: Floats) -> Floats:
        """Return pixel positions (n, 2) of points (n, 3) in the world."""
        turn, lens = cv2.Rodrigues(self.rotation)[0], self.intrinsics
        seen = cv2.projectPoints(points_mm, turn, self.translation_mm, lens.matrix, lens.distortion)[0]
        return np.asarray(seen, np.float64).reshape(-1, 2)

    def plane_from_ray(self, z_mm: float) -> Floats:
        """Return the homography (3, 3) from undistorted rays (x, y, 1) to (X, Y, 1) in the plane at height z."""
        columns = np.column_stack(
            [self.rotation[:, 0], self.rotation[:, 1], self.rotation[:, 2] * z_mm + self.translation_mm]
        )
        return np.asarray(np.linalg.inv(columns), np.float64)

    def rays(self, margin_px: int) -> Floats:
        """Return undistorted rays (h + 2m, w + 2m, 2) of all pixels and a margin around the picture."""
        width, height = self.intrinsics.size_px
        k = self.intrinsics.matrix
        x = (np.arange(-margin_px, width + margin_px) - k[0, 2]) / k[0, 0]
        y = (np.arange(-margin_px, height + margin_px) - k[1, 2]) / k[1, 1]
        return undistort(np.stack(np.meshgrid(x, y), axis=-1), self.intrinsics.distortion)

    def jacobian(self, point_mm: Floats) -> Floats:
        """Return d(pixel)/d(X, Y) (2, 2) at a point of the world, px/mm."""
        step = 0.01  # mm: the error of central differences grows with the square of the step, rounding with its inverse
        offsets = np.array([[step, 0, 0], [-step, 0, 0], [0, step, 0], [0, -step, 0]])
        seen = self.project(point_mm + offsets)
        return np.column_stack([seen[0] - seen[1], seen[2] - seen[3]]) / (2.0 * step)


def undistort(seen: Floats, coefficients: Floats) -> Floats:
    """Return the normalised image points (..., 2) whose distorted positions are ``seen``, to 1e-12."""
    flat = cv2.undistortPoints(seen.reshape(-1, 1, 2), np.eye(3), coefficients, criteria=_UNTIL_IT_CONVERGES)
    return np.asarray(flat, np.float64).reshape(seen.shape)


def rotation_about(axis: Floats, angle_rad: float) -> Floats:
    """Return the rotation (3, 3) about an axis of any length."""
    return Rotation.from_rotvec(angle_rad * axis / np.linalg.norm(axis)).as_matrix()


def views(scene: Scene) -> tuple[View, ...]:
    """Return the scene's camera, or the left and the right one."""
    left = _left(scene.camera)
    if scene.stereo.baseline_mm == 0.0:
        return (left,)
    turn = rotation_about(np.array([0.0, 1.0, 0.0]), scene.stereo.toe_in_deg * DEG)
    shift = turn @ np.array([-scene.stereo.baseline_mm, 0.0, 0.0])
    right = View(left.intrinsics, turn @ left.rotation, turn @ left.translation_mm + shift)
    return (left, right)


def _left(settings: CameraSettings) -> View:
    matrix = np.eye(3)
    matrix[0, 0] = matrix[1, 1] = settings.focal_px
    matrix[0, 2] = (settings.width_px - 1) / 2.0 + settings.centre_px[0]
    matrix[1, 2] = (settings.height_px - 1) / 2.0 + settings.centre_px[1]
    # World z towards the camera and y up in the picture: half a turn about x; then tilt and roll in the camera.
    facing = np.diag([1.0, -1.0, -1.0])
    towards = settings.tilt_towards_deg * DEG
    tilt_axis = np.array([math.sin(towards), math.cos(towards), 0.0])
    tilt = rotation_about(tilt_axis, settings.tilt_deg * DEG)
    roll = rotation_about(np.array([0.0, 0.0, 1.0]), settings.roll_deg * DEG)
    offset_mm = np.array(settings.axis_px) / settings.focal_px * settings.distance_mm
    return View(
        intrinsics=Intrinsics((settings.width_px, settings.height_px), matrix, np.array(settings.distortion)),
        rotation=roll @ tilt @ facing,
        translation_mm=np.array([*offset_mm, settings.distance_mm]),
    )


def camera_of(scene: Scene) -> Camera:
    """Return the scene's camera as ``camera.toml`` describes it."""
    seen = views(scene)
    left = seen[0]
    if len(seen) == 2:
        motion = seen[1].rotation @ left.rotation.T
        return Camera(
            intrinsics=left.intrinsics,
            right=RightCamera(
                intrinsics=seen[1].intrinsics,
                rvec=Rotation.from_matrix(motion).as_rotvec(),
                tvec_mm=seen[1].translation_mm - motion @ left.translation_mm,
            ),
        )
    return Camera(
        intrinsics=left.intrinsics,
        pose=Pose(
            rvec=Rotation.from_matrix(left.rotation).as_rotvec(),
            tvec_mm=left.translation_mm,
            base_z_mm=scene.camera.base_z_mm,
            moving_z_mm=scene.camera.moving_z_mm,
        ),
    )
