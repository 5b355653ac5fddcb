"""Lens, planes and triangulation against OpenCV's projection, finite differences and statistics."""

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from torsight.core.optics.camera import Intrinsics, Pose, RightCamera
from torsight.core.optics.geometry import (
    epipolar_distance_px,
    on_plane,
    pixel_from_ray,
    project,
    ray_from_pixel,
    rotation_matrix,
    rotation_vector,
    triangulate,
)

MATRIX = np.array([[1200.0, 0.0, 319.5], [0.0, 1190.0, 239.5], [0.0, 0.0, 1.0]])
LENS = Intrinsics((640, 480), MATRIX, np.array([-0.15, 0.05, 0.001, -0.002, 0.02]))
POSE = Pose(np.array([-2.98, -0.01, 0.13]), np.array([3.0, -2.0, 300.0]), 0.0, 6.0)
RIGHT = RightCamera(LENS, np.array([0.02, -0.2, 0.01]), np.array([-80.0, 1.0, 5.0]))


@pytest.fixture
def points_mm() -> np.ndarray:
    return np.random.default_rng(4).uniform([-60, -50, 250], [60, 50, 400], (50, 3))


def opencv_px(points_mm, rvec, tvec_mm, intrinsics=LENS):
    pixels, _ = cv2.projectPoints(points_mm, rvec, tvec_mm, intrinsics.matrix, intrinsics.distortion)
    return pixels.reshape(-1, 2)


@pytest.mark.parametrize("rvec", [(0.0, 0.0, 0.0), (1e-11, 0.0, 2e-11), (0.3, -0.2, 0.1), (0.0, np.pi, 0.0)])
def test_rotations_are_those_of_another_library(rvec):
    expected = Rotation.from_rotvec(rvec).as_matrix()
    assert rotation_matrix(np.array(rvec)) == pytest.approx(expected, abs=1e-15)
    assert rotation_vector(expected) == pytest.approx(np.array(rvec), abs=1e-14)


@pytest.mark.parametrize("short_of_half_a_turn", [0.0, 1e-9, 1e-4, 0.1, 0.3])
def test_rotation_vector_undoes_rotation_near_half_a_turn(short_of_half_a_turn):
    axis = np.array([0.6, -0.48, 0.64])
    expected = rotation_matrix((np.pi - short_of_half_a_turn) * axis)
    assert rotation_matrix(rotation_vector(expected)) == pytest.approx(expected, abs=1e-14)


def test_projection_agrees_with_opencv(points_mm):
    rvec, tvec_mm = np.array([0.1, -0.2, 0.3]), np.array([4.0, 5.0, 60.0])
    ours = project(points_mm, LENS, rvec=rvec, tvec_mm=tvec_mm)
    assert ours == pytest.approx(opencv_px(points_mm, rvec, tvec_mm), abs=1e-9)


def test_ray_undoes_projection(points_mm):
    ray, _ = ray_from_pixel(opencv_px(points_mm, np.zeros(3), np.zeros(3)), LENS)
    assert ray == pytest.approx(points_mm[:, :2] / points_mm[:, 2:], abs=1e-12)


def test_where_the_lens_folds_over_there_is_no_ray():
    barrel = Intrinsics((640, 480), MATRIX, np.array([-0.4, 0.0, 0.0, 0.0, 0.0]))
    # x (1 − 0.4 x²) has its maximum 0.6086 at x = 1/√1.2; nothing is seen farther out.
    edge_px = np.array([319.5 + 1200 * 0.60, 239.5]), np.array([319.5 + 1200 * 0.62, 239.5])
    assert np.isfinite(ray_from_pixel(edge_px[0], barrel)[0]).all()
    assert np.isnan(ray_from_pixel(edge_px[1], barrel)[0]).all()


def test_nan_goes_in_and_comes_out():
    ray, derivative = ray_from_pixel(np.array([[np.nan, np.nan], [100.0, 100.0]]), LENS)
    assert np.isnan(ray[0]).all()
    assert np.isnan(derivative[0]).all()
    assert np.isfinite(ray[1]).all()
    assert np.isnan(project(np.array([0.0, 0.0, -100.0]), LENS)).all()


@pytest.mark.parametrize("function", ["ray", "plane"])
def test_derivatives_are_those_of_small_steps(function, points_mm):
    pixels = opencv_px(points_mm, np.zeros(3), np.zeros(3))

    def evaluate(positions):
        if function == "ray":
            return ray_from_pixel(positions, LENS)
        point, derivative = on_plane(positions, LENS, pose=POSE, z_mm=6.0)
        return point[..., :2], derivative

    _, derivative = evaluate(pixels)
    for axis in range(2):
        step = np.eye(2)[axis] * 1e-3
        numeric = (evaluate(pixels + step)[0] - evaluate(pixels - step)[0]) / 2e-3
        assert derivative[..., axis] == pytest.approx(numeric, rel=1e-6, abs=1e-7 * np.abs(numeric).max())


def test_plane_gives_back_the_world():
    world = np.random.default_rng(5).uniform([-30, -30, 6], [30, 30, 6], (40, 3))
    point, _ = on_plane(opencv_px(world, POSE.rvec, POSE.tvec_mm), LENS, pose=POSE, z_mm=6.0)
    assert point == pytest.approx(world, abs=1e-9)


def test_direction_on_a_plane_does_not_depend_on_its_height():
    pixels = np.array([[250.0, 250.0], [400.0, 300.0]])
    low, high = (on_plane(pixels, LENS, pose=POSE, z_mm=z)[0] for z in (-20.0, 20.0))
    slopes = [np.arctan2(*(points[1] - points[0])[1::-1]) for points in (low, high)]
    assert slopes[0] == pytest.approx(slopes[1], abs=1e-12)


def triangulated(points_mm, noise_px, rng):
    left = opencv_px(points_mm, np.zeros(3), np.zeros(3)) + rng.normal(0, 1, (len(points_mm), 2)) * noise_px
    right = opencv_px(points_mm, RIGHT.rvec, RIGHT.tvec_mm) + rng.normal(0, 1, left.shape) * noise_px
    covariance = np.broadcast_to(np.eye(2) * max(noise_px, 1e-3) ** 2, (*left.shape, 2))
    return triangulate(
        left, right, left=LENS, right=RIGHT, left_covariance_px2=covariance, right_covariance_px2=covariance
    )


def test_triangulation_without_noise_is_exact(points_mm):
    points = triangulated(points_mm, 0.0, np.random.default_rng(0))
    assert points.position_mm == pytest.approx(points_mm, abs=1e-8)


def test_triangulation_covariance_is_the_scatter(points_mm):
    rng = np.random.default_rng(6)
    many = [triangulated(points_mm, 0.1, rng) for _ in range(40)]
    error = np.stack([points.position_mm - points_mm for points in many])
    scaled = np.einsum(
        "sni,snij,snj->sn", error, np.linalg.inv(np.stack([points.covariance_mm2 for points in many])), error
    )
    # Mean of 2000 χ² values with 3 (and 1) degrees of freedom, to five standard errors.
    assert scaled.mean() == pytest.approx(3.0, abs=5 * np.sqrt(6 / 2000))
    misfit = np.stack([points.chi_squared for points in many])
    assert misfit.mean() == pytest.approx(1.0, abs=5 * np.sqrt(2 / 2000))


def test_point_that_one_picture_lacks_is_not_known(points_mm):
    left = opencv_px(points_mm, np.zeros(3), np.zeros(3))
    right = opencv_px(points_mm, RIGHT.rvec, RIGHT.tvec_mm)
    right[3] = np.nan
    covariance = np.broadcast_to(np.eye(2) * 0.01, (*left.shape, 2))
    points = triangulate(
        left, right, left=LENS, right=RIGHT, left_covariance_px2=covariance, right_covariance_px2=covariance
    )
    assert np.isnan(points.position_mm[3]).all()
    assert np.isnan(points.covariance_mm2[3]).all()
    assert np.isfinite(np.delete(points.position_mm, 3, axis=0)).all()


def test_epipolar_distance_is_how_far_a_point_is_off_the_line(points_mm):
    plain = Intrinsics((640, 480), np.array([[1000.0, 0, 320], [0, 1000, 240], [0, 0, 1]]), np.zeros(5))
    beside = RightCamera(plain, np.zeros(3), np.array([-80.0, 0.0, 0.0]))
    left = opencv_px(points_mm, np.zeros(3), np.zeros(3), plain)
    right = opencv_px(points_mm, np.zeros(3), beside.tvec_mm, plain)
    # Cameras side by side: epipolar lines are rows, so the distance is the difference of rows.
    distance = epipolar_distance_px(left, right + np.array([0.0, 0.7]), left=plain, right=beside)
    assert distance == pytest.approx(np.full(left.shape, 0.7), abs=1e-9)
    assert pixel_from_ray(np.zeros(2), plain) == pytest.approx([320, 240])
