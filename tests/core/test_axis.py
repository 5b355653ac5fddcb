"""The rotation axis from the markers' circles, against rigs of known geometry."""

import cv2
import numpy as np
import pytest

from torsight.core.errors import NoResultError
from torsight.core.optics.axis import axis_from_pair, axis_in_picture, pose_from_axis
from torsight.core.optics.camera import Intrinsics, RightCamera
from torsight.core.optics.circles import Sight, axis_basis
from torsight.core.optics.geometry import on_plane, rotation_matrix

LENS = Intrinsics(
    (640, 480),
    np.array([[1200.0, 0.0, 319.5], [0.0, 1190.0, 239.5], [0.0, 0.0, 1.0]]),
    np.array([-0.15, 0.05, 0.001, -0.002, 0.02]),
)
RIGHT = RightCamera(LENS, np.array([0.02, 0.2, 0.01]), np.array([-60.0, 1.0, 5.0]))
SIGMA_PX = 0.03


def rig(tilt_deg, angle_rad, *, azimuth_rad=0.7, distance_mm=300.0, radii_mm=(8.0, 25.0)):
    """Return direction, centre and positions (n, 2, 3) of two markers on one ray of a turning disk."""
    tilt = np.radians(tilt_deg)
    direction = np.array([np.sin(tilt) * np.cos(azimuth_rad), np.sin(tilt) * np.sin(azimuth_rad), -np.cos(tilt)])
    centre = np.array([5.0, -3.0, distance_mm])
    # Any two unit vectors across the axis, not the ones that the code under test chooses.
    first = np.cross(direction, [0.3, 0.9, 0.1])
    first /= np.linalg.norm(first)
    second = np.cross(direction, first)
    wave = np.cos(angle_rad)[:, None] * first + np.sin(angle_rad)[:, None] * second
    return direction, centre, np.stack([centre + radius * wave for radius in radii_mm], axis=1)


def seen(points_mm, rng, *, rvec=(0.0, 0.0, 0.0), tvec_mm=(0.0, 0.0, 0.0), sigma_px=SIGMA_PX):
    pixels, _ = cv2.projectPoints(
        points_mm.reshape(-1, 3), np.array(rvec), np.array(tvec_mm), LENS.matrix, LENS.distortion
    )
    pixels = pixels.reshape(*points_mm.shape[:-1], 2)
    covariance = np.broadcast_to(np.eye(2) * max(sigma_px, 1e-4) ** 2, (*pixels.shape, 2))
    return pixels + rng.normal(0, 1, pixels.shape) * sigma_px, covariance


def from_pair(points_mm, rng, *, sigma_px=SIGMA_PX):
    left, covariance = seen(points_mm, rng, sigma_px=sigma_px)
    right, _ = seen(points_mm, rng, rvec=RIGHT.rvec, tvec_mm=RIGHT.tvec_mm, sigma_px=sigma_px)
    other = Sight.of(right, covariance, LENS, rotation=rotation_matrix(RIGHT.rvec), shift=RIGHT.tvec_mm)
    return axis_from_pair(Sight.of(left, covariance, LENS), other, noise_px=max(sigma_px, 1e-4))[0]


@pytest.mark.parametrize("tilt_deg", [0.0, 7.0, 30.0])
def test_axis_in_picture_without_noise(tilt_deg):
    direction, centre, points = rig(tilt_deg, np.radians(np.linspace(0, 250, 80)))
    axis = axis_in_picture(*seen(points, np.random.default_rng(0), sigma_px=0.0), LENS)
    assert axis.direction == pytest.approx(direction, abs=1e-6)
    # Lengths come in units of the markers' distance, 25 − 8 mm.
    assert axis.point_mm * 17.0 == pytest.approx(centre, rel=1e-5)
    assert axis.radius_mm * 17.0 == pytest.approx([8.0, 25.0], rel=1e-5)
    assert np.degrees(axis.arc_rad) == pytest.approx(250, abs=0.1)


def test_axis_from_a_pair_without_noise():
    direction, centre, points = rig(12.0, np.radians(np.linspace(0, 120, 60)))
    points[:, 1] += 3.0 * direction
    axis = from_pair(points, np.random.default_rng(0), sigma_px=0.0)
    assert axis.direction == pytest.approx(direction, abs=1e-7)
    assert axis.point_mm == pytest.approx(centre, abs=1e-5)
    assert axis.radius_mm == pytest.approx([8.0, 25.0], abs=1e-5)
    assert axis.height_mm == pytest.approx([0.0, 3.0], abs=1e-4)


@pytest.mark.parametrize("cameras", [1, 2])
def test_axis_lies_within_its_own_sigma(cameras):
    rng, frames = np.random.default_rng(1), 60
    direction, _, points = rig(9.0, np.radians(np.linspace(0, 200, frames)))
    scaled, misfit = [], []
    # A pair's fit has more than twice the residuals.
    draws = 25 if cameras == 1 else 10
    for _ in range(draws):
        axis = axis_in_picture(*seen(points, rng), LENS) if cameras == 1 else from_pair(points, rng)
        scaled.append(np.arccos(min(1.0, axis.direction @ direction)) / axis.direction_sigma_rad)
        misfit.append(axis.misfit)
    # Two tilts, each at most one sigma wide: the mean square is at most 2, within the scatter of the draws.
    assert np.mean(np.square(scaled)) < 2.0 + 5 * 2.0 * np.sqrt(1 / draws)
    assert np.mean(np.square(scaled)) > 0.5
    # χ² per degree of freedom of 3 residuals a frame, 7 of two cameras, each time.
    assert np.mean(misfit) == pytest.approx(1.0, abs=5 * np.sqrt(0.5 / (frames * (4 * cameras - 1)) / draws) + 0.005)


def test_without_perspective_the_mirror_image_fits_almost_as_well():
    rng = np.random.default_rng(2)
    turn = np.radians(np.linspace(0, 90, 60))
    near = axis_in_picture(*seen(rig(8.0, turn, distance_mm=200.0)[2], rng), LENS)
    far = axis_in_picture(*seen(rig(8.0, turn, distance_mm=6000.0)[2], rng), LENS)
    assert near.mirror_gap > 100.0
    assert far.mirror_gap < 30.0


def test_angle_through_the_found_axis_is_the_angle_of_the_rig():
    rng = np.random.default_rng(3)
    turn = np.radians(np.linspace(-40, 400, 300))
    _, _, points = rig(20.0, turn)
    pixels, covariance = seen(points, rng)
    pose = pose_from_axis(axis_in_picture(pixels, covariance, LENS), length_mm=17.0)
    world, _ = on_plane(pixels, LENS, pose=pose, z_mm=0.0)
    angle = np.arctan2(*(world[:, 1] - world[:, 0])[:, 1::-1].T)
    error_deg = np.degrees(np.unwrap(angle) - turn)
    error_deg -= error_deg.mean()
    # Both ends of 17 mm seen at 4 px/mm, tilted by 20°, and the axis' own error of a few hundredths of a degree.
    noise_deg = np.degrees(np.sqrt(2) * SIGMA_PX / (17.0 * 4.0 * np.cos(np.radians(20))))
    assert np.sqrt(np.mean(error_deg**2)) < 1.2 * noise_deg
    # Ignoring the tilt costs ψ²/4 = 1.7° of twice-per-turn error.
    flat = np.unwrap(np.arctan2(-np.diff(pixels[..., 1], axis=1), np.diff(pixels[..., 0], axis=1)).ravel())
    assert np.ptp(np.degrees(flat - turn)) > 20 * noise_deg


def test_across_the_axis_is_counter_clockwise_as_displayed():
    direction = np.array([0.0, 0.0, -1.0])
    u, v = axis_basis(direction)
    # The picture's y points down: what points up the picture is at +90°.
    assert v == pytest.approx([0.0, -1.0, 0.0])
    assert np.cross(u, v) == pytest.approx(direction)


@pytest.mark.parametrize(("frames", "arc_deg", "said"), [(5, 200.0, "5 frames"), (60, 10.0, "10°")])
def test_what_cannot_show_an_axis_is_refused(frames, arc_deg, said):
    _, _, points = rig(5.0, np.radians(np.linspace(0, arc_deg, frames)))
    rng = np.random.default_rng(0)
    with pytest.raises(NoResultError, match=said):
        axis_in_picture(*seen(points, rng, sigma_px=0.001), LENS)
    with pytest.raises(NoResultError, match=said):
        from_pair(points, rng, sigma_px=0.001)


def test_pose_has_the_axis_as_z_towards_the_camera():
    direction, centre, points = rig(15.0, np.radians(np.linspace(0, 90, 40)))
    pose = pose_from_axis(from_pair(points, np.random.default_rng(0), sigma_px=0.0), base_z_mm=-4.0)
    assert rotation_matrix(pose.rvec)[:, 2] == pytest.approx(direction, abs=1e-6)
    assert pose.tvec_mm == pytest.approx(centre, abs=1e-4)
    assert pose.base_z_mm == -4.0
