"""Pixels to rays, planes and points in space, for tracking and calibration.

Camera coordinates are OpenCV's: x to the right, y down, z forward, mm. A *ray* here is the pair (X/Z, Y/Z) of an ideal
camera; the lens maps a ray to a pixel by (Brown's model, r² = x² + y²)::

    x' = x (1 + k1 r² + k2 r⁴ + k3 r⁶) + 2 p1 x y + p2 (r² + 2 x²),   u = fx x' + cx
    y' = y (1 + k1 r² + k2 r⁴ + k3 r⁶) + p1 (r² + 2 y²) + 2 p2 x y,   v = fy y' + cy

Every function takes arrays with any leading shape and propagates NaN.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from torsight.core.units import Floats

if TYPE_CHECKING:
    from torsight.core.optics.camera import Intrinsics, Pose, RightCamera

_MOST_STEPS: Final = int(np.finfo(np.float64).nmant)
"""Most Newton steps, as many as a method takes that gains a bit in each: lenses with k1 from −0.4 to 0.2 take 3 to 9,
points in two pictures 5; where the model folds over there is no ray."""
_LAST_STEP: Final = math.sqrt(np.finfo(np.float64).eps)
"""Size of the last step, in units of the focal length, or of the depth of a point in space: Newton's steps are squared
from one to the next, so that the one after it would be a rounding error."""


def rotation_matrix(rvec: Floats) -> Floats:
    """Return the rotation matrix (3, 3) of a rotation vector."""
    import cv2

    return np.asarray(cv2.Rodrigues(np.asarray(rvec, np.float64).reshape(3))[0])


def rotation_vector(matrix: Floats) -> Floats:
    """Return the rotation vector (3,) of a rotation matrix; its length is at most π."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_matrix(matrix).as_rotvec())


def cross_matrix(vector: Floats) -> Floats:
    """Return the matrix (3, 3) that multiplies as the cross product with ``vector`` from the left."""
    x, y, z = (float(value) for value in vector)
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def homogeneous(ray: Floats) -> Floats:
    """Return rays X/Z, Y/Z (..., 2) as directions (..., 3) with Z = 1."""
    return np.concatenate((ray, np.ones_like(ray[..., :1])), axis=-1)


def applied(matrix: Floats, vector: Floats) -> Floats:
    """Return each matrix (..., m, n) times its vector (..., n)."""
    return np.asarray((matrix @ vector[..., None])[..., 0])


def carried(covariance: Floats, slopes: Floats) -> Floats:
    """Return the covariances (..., m, m) of mapped values, from the derivatives (..., m, n) of the map."""
    return np.asarray(slopes @ covariance @ np.swapaxes(slopes, -1, -2))


def distort(ray: Floats, distortion: Floats) -> tuple[Floats, Floats]:
    """Return rays X/Z, Y/Z (..., 2) distorted by the lens (k1, k2, p1, p2, k3), and the Jacobian (..., 2, 2)."""
    k1, k2, p1, p2, k3 = (float(value) for value in distortion)
    x, y = ray[..., 0], ray[..., 1]
    r2 = x * x + y * y
    gain = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    slope = k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3)
    bent = np.stack(
        (x * gain + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x), y * gain + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y),
        axis=-1,
    )
    mixed = 2.0 * (x * y * slope + p1 * x + p2 * y)
    derivative = np.stack(
        (
            np.stack((gain + 2.0 * x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x, mixed), axis=-1),
            np.stack((mixed, gain + 2.0 * y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x), axis=-1),
        ),
        axis=-2,
    )
    return bent, derivative


def pixel_from_ray(ray: Floats, intrinsics: Intrinsics) -> Floats:
    """Return the pixel position (..., 2) at which the camera shows a ray (..., 2)."""
    bent, _ = distort(ray, intrinsics.distortion)
    return np.asarray(bent * _focal(intrinsics) + _centre(intrinsics))


def ray_from_pixel(position_px: Floats, intrinsics: Intrinsics) -> tuple[Floats, Floats]:
    """Undistort pixel positions (..., 2) by Newton's method, to rounding.

    Returns the rays X/Z, Y/Z (..., 2), NaN where the position is NaN or the lens model folds over and no ray leads to
    the position, and their Jacobian with respect to the pixel position (..., 2, 2), 1/px.
    """
    bent = (np.asarray(position_px, np.float64) - _centre(intrinsics)) / _focal(intrinsics)
    ray = bent.copy()
    with np.errstate(all="ignore"):
        for _ in range(_MOST_STEPS):
            value, derivative = distort(ray, intrinsics.distortion)
            step = applied(_inverse_2x2(derivative), value - bent)
            ray = ray - step
            if not np.any(np.abs(step) > _LAST_STEP):
                break
        value, derivative = distort(ray, intrinsics.distortion)
        determinant = derivative[..., 0, 0] * derivative[..., 1, 1] - derivative[..., 0, 1] ** 2
        good = (determinant > 0.0) & np.all(np.abs(value - bent) < _LAST_STEP, axis=-1)
        ray = np.where(good[..., None], ray, np.nan)
        inverse = _inverse_2x2(derivative) / _focal(intrinsics)
    return ray, np.where(good[..., None, None], inverse, np.nan)


def project(
    point_mm: Floats, intrinsics: Intrinsics, *, rvec: Floats | None = None, tvec_mm: Floats | None = None
) -> Floats:
    """Return the pixel positions (..., 2) of points in space (..., 3); NaN behind the camera.

    ``rvec`` and ``tvec_mm`` (camera from the points' frame) are left out for points in camera coordinates.
    """
    point = np.asarray(point_mm, np.float64)
    if rvec is not None:
        point = point @ rotation_matrix(rvec).T
    if tvec_mm is not None:
        point = point + tvec_mm
    with np.errstate(all="ignore"):
        ray = np.where(point[..., 2:] > 0.0, point[..., :2] / point[..., 2:], np.nan)
    return pixel_from_ray(ray, intrinsics)


def on_plane(position_px: Floats, intrinsics: Intrinsics, *, pose: Pose, z_mm: float) -> tuple[Floats, Floats]:
    """Return the intersections of the lines of sight of pixel positions (..., 2) with the world's plane at a height.

    First the points (..., 3), mm, NaN where the line of sight is parallel to the plane or meets it behind the camera;
    then the Jacobian (..., 2, 2) of world x and y with respect to the pixel position, mm/px: a covariance in pixels
    becomes ``jacobian @ covariance_px2 @ jacobian.T``.
    """
    ray, ray_derivative = ray_from_pixel(position_px, intrinsics)
    rotation = rotation_matrix(pose.rvec)
    line = homogeneous(ray) @ rotation
    eye = -rotation.T @ pose.tvec_mm
    with np.errstate(all="ignore"):
        depth = (z_mm - eye[2]) / line[..., 2]
        depth = np.where(depth > 0.0, depth, np.nan)
        point = eye + depth[..., None] * line
        # d(eye + s·line)/d(ray), where s depends on the line's z: s·(row_xy − line_xy·row_z / line_z)
        rows = rotation[:2, :]
        slide = rows[:, :2] - line[..., None, :2] * rows[:, 2:] / line[..., 2, None, None]
        by_ray = np.swapaxes(depth[..., None, None] * slide, -1, -2)
    point[..., 2] = np.where(np.isfinite(point[..., 0]), z_mm, np.nan)
    return point, by_ray @ ray_derivative


@dataclass(frozen=True, slots=True, eq=False)
class SpacePoints:
    """Points in space (..., 3), from both pictures of a stereo pair, with their covariances (..., 3, 3).

    They are in the left camera's coordinates, NaN where a picture has no position. ``chi_squared`` is the misfit of the
    four picture coordinates relative to their sigmas, with one degree of freedom: about 1 for a consistent pair.
    """

    position_mm: Floats
    covariance_mm2: Floats
    chi_squared: Floats


def triangulate(
    left_px: Floats,
    right_px: Floats,
    *,
    left: Intrinsics,
    right: RightCamera,
    left_covariance_px2: Floats,
    right_covariance_px2: Floats,
) -> SpacePoints:
    """Return the maximum-likelihood points in space for both pictures, with covariance.

    Positions are (..., 2), of the same points in both pictures, their covariances (..., 2, 2).
    """
    rays, weights = [], []
    for position, intrinsics, covariance in (
        (left_px, left, left_covariance_px2),
        (right_px, right.intrinsics, right_covariance_px2),
    ):
        ray, derivative = ray_from_pixel(position, intrinsics)
        rays.append(ray)
        with np.errstate(all="ignore"):
            weights.append(_inverse_2x2(carried(covariance, derivative)))
    rotation, shift = rotation_matrix(right.rvec), right.tvec_mm
    point = meeting_point(rays[0], rays[1], rotation=rotation, shift=shift)
    for _ in range(_MOST_STEPS):
        normal, gradient, _ = _normal_equations(point, rays, weights, rotation=rotation, shift=shift)
        step = applied(_inverse_3x3(normal), gradient)
        point = point - step
        if not np.any(np.abs(step) > _LAST_STEP * np.abs(point[..., 2:])):
            break
    normal, _, chi_squared = _normal_equations(point, rays, weights, rotation=rotation, shift=shift)
    front = (point[..., 2] > 0.0) & ((point @ rotation.T + shift)[..., 2] > 0.0)
    return SpacePoints(
        position_mm=np.where(front[..., None], point, np.nan),
        covariance_mm2=np.where(front[..., None, None], _inverse_3x3(normal), np.nan),
        chi_squared=np.where(front, chi_squared, np.nan),
    )


def meeting_point(left: Floats, right: Floats, *, rotation: Floats, shift: Floats) -> Floats:
    """Return the middle (..., 3) of the shortest connection of two lines of sight, in left coordinates.

    The rays (..., 2) are those of the same point; rotation and shift are the right camera's from the left one's.
    """
    along, other = homogeneous(left), homogeneous(right) @ rotation
    eye = -rotation.T @ shift
    # The two normal equations of |s · along − eye − t · other|², solved.
    aa, bb = np.sum(along * along, axis=-1), np.sum(other * other, axis=-1)
    ab = np.sum(along * other, axis=-1)
    ae, be = along @ eye, other @ eye
    with np.errstate(all="ignore"):
        scale = aa * bb - ab * ab
        near = (bb * ae - ab * be) / scale
        far = (ab * ae - aa * be) / scale
    return np.asarray(0.5 * (near[..., None] * along + eye + far[..., None] * other))


def _normal_equations(
    point: Floats, rays: list[Floats], weights: list[Floats], *, rotation: Floats, shift: Floats
) -> tuple[Floats, Floats, Floats]:
    """Return the Gauss-Newton matrix, the gradient and the misfit of points against both pictures."""
    normal = np.zeros((*point.shape[:-1], 3, 3))
    gradient = np.zeros(point.shape)
    misfit = np.zeros(point.shape[:-1])
    for ray, weight, (turn, move) in zip(rays, weights, ((np.eye(3), np.zeros(3)), (rotation, shift)), strict=True):
        seen = point @ turn.T + move
        with np.errstate(all="ignore"):
            depth = seen[..., 2:]
            error = seen[..., :2] / depth - ray
            slope = (turn[:2] - (seen[..., :2] / depth)[..., None] * turn[2]) / depth[..., None]
        pull = np.swapaxes(slope, -1, -2) @ weight
        normal = normal + pull @ slope
        gradient = gradient + applied(pull, error)
        misfit = misfit + np.einsum("...i,...ij,...j->...", error, weight, error)
    return normal, gradient, misfit


def epipolar_distance_px(left_px: Floats, right_px: Floats, *, left: Intrinsics, right: RightCamera) -> Floats:
    """Return the distances (..., 2) of matching points from their epipolar lines, in the left and the right picture.

    They are in px of an undistorted picture of the same focal length.
    """
    rays = [homogeneous(ray_from_pixel(*seen)[0]) for seen in ((left_px, left), (right_px, right.intrinsics))]
    essential = cross_matrix(right.tvec_mm) @ rotation_matrix(right.rvec)
    line_right, line_left = rays[0] @ essential.T, rays[1] @ essential
    product = np.sum(rays[1] * line_right, axis=-1)
    with np.errstate(all="ignore"):
        distances = [
            np.abs(product) / np.hypot(line[..., 0], line[..., 1]) * float(np.mean(_focal(intrinsics)))
            for line, intrinsics in ((line_left, left), (line_right, right.intrinsics))
        ]
    return np.stack(distances, axis=-1)


def _focal(intrinsics: Intrinsics) -> Floats:
    return np.array([intrinsics.matrix[0, 0], intrinsics.matrix[1, 1]])


def _centre(intrinsics: Intrinsics) -> Floats:
    return np.array([intrinsics.matrix[0, 2], intrinsics.matrix[1, 2]])


def _inverse_2x2(matrix: Floats) -> Floats:
    a, b, c, d = matrix[..., 0, 0], matrix[..., 0, 1], matrix[..., 1, 0], matrix[..., 1, 1]
    turned = np.stack((np.stack((d, -b), axis=-1), np.stack((-c, a), axis=-1)), axis=-2)
    return np.asarray(turned / (a * d - b * c)[..., None, None])


def _inverse_3x3(matrix: Floats) -> Floats:
    """Invert by cofactors: a NaN or singular matrix becomes NaN instead of stopping the whole array."""
    rows = [matrix[..., index, :] for index in range(3)]
    columns = [np.cross(rows[1], rows[2]), np.cross(rows[2], rows[0]), np.cross(rows[0], rows[1])]
    with np.errstate(all="ignore"):
        return np.asarray(np.stack(columns, axis=-1) / np.sum(rows[0] * columns[0], axis=-1)[..., None, None])
