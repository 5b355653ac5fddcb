"""The synthetic camera against OpenCV, and its conventions against a film of another renderer."""

from __future__ import annotations

import tomllib
from pathlib import Path

import cv2
import numpy as np
import pytest

from torsight.core.files.storage import write_text
from torsight.core.optics.camera import camera_content, read_camera
from torsight.core.optics.geometry import project, ray_from_pixel
from torsight.core.units import DEG
from torsight.synthetic.filming.optics import View, camera_of, undistort, views
from torsight.synthetic.scene import scene_from

TILTED = {
    "camera": {
        "focal_px": 900.0,
        "tilt_deg": 25.0,
        "tilt_towards_deg": 130.0,
        "roll_deg": -20.0,
        "distortion": [-0.2, 0.05, 0.002, -0.001, 0.01],
        "axis_px": [30.0, -20.0],
        "centre_px": [5.0, 3.0],
    },
    "stereo": {"baseline_mm": 60.0, "toe_in_deg": 9.0},
}


@pytest.fixture
def points_mm() -> np.ndarray:
    return np.random.default_rng(1).uniform(-30.0, 30.0, (50, 3)) * [1.0, 1.0, 0.2]


def test_projection_is_that_of_the_tracking(points_mm: np.ndarray) -> None:
    for view in views(scene_from(TILTED)):
        rvec = cv2.Rodrigues(view.rotation)[0]
        seen = project(points_mm, view.intrinsics, rvec=rvec, tvec_mm=view.translation_mm)
        assert np.allclose(view.project(points_mm), seen, atol=1e-8)


def test_rays_are_those_of_the_tracking() -> None:
    view = views(scene_from(TILTED))[0]
    lens = view.intrinsics
    pixels = np.array([[0.0, 0.0], [639.0, 479.0], [100.0, 300.0]])
    seen = (pixels - lens.matrix[:2, 2]) / np.diag(lens.matrix)[:2]
    assert np.allclose(undistort(seen, lens.distortion), ray_from_pixel(pixels, lens)[0], atol=1e-9)


def test_plane_and_ray_meet_where_the_point_is(points_mm: np.ndarray) -> None:
    view = views(scene_from(TILTED))[1]
    flat = points_mm.copy()
    flat[:, 2] = 4.0
    lens = view.intrinsics
    seen = (view.project(flat) - lens.matrix[:2, 2]) / np.diag(lens.matrix)[:2]
    rays = np.column_stack([undistort(seen, lens.distortion), np.ones(len(flat))])
    met = rays @ view.plane_from_ray(4.0).T
    assert np.allclose(met[:, :2] / met[:, 2:], flat[:, :2], atol=1e-8)


def test_axis_points_to_the_camera_and_angles_grow_counter_clockwise() -> None:
    view = views(scene_from({}))[0]
    right, up = view.project(np.array([[10.0, 0.0, 0.0], [0.0, 10.0, 0.0]])) - view.project(np.zeros((1, 3)))
    assert right[0] > 0.0
    assert up[1] < 0.0
    nearer = view.jacobian(np.array([0.0, 0.0, 10.0]))
    assert np.linalg.det(nearer) < np.linalg.det(view.jacobian(np.zeros(3))) < 0.0


@pytest.mark.parametrize("stereo", [False, True])
def test_camera_file_says_what_the_camera_is(tmp_path: Path, points_mm: np.ndarray, *, stereo: bool) -> None:
    import tomli_w

    content = TILTED if stereo else {"camera": TILTED["camera"]}
    scene = scene_from(content)
    write_text(tmp_path / "camera.toml", tomli_w.dumps(camera_content(camera_of(scene))))
    camera = read_camera(tmp_path / "camera.toml")
    left = views(scene)[0]
    if not stereo:
        assert camera.pose is not None
        again = View(camera.intrinsics, cv2.Rodrigues(camera.pose.rvec)[0], camera.pose.tvec_mm)
        assert np.allclose(again.project(points_mm), left.project(points_mm), atol=1e-7)
        return
    assert camera.pose is None
    assert camera.right is not None
    inside_left = points_mm @ left.rotation.T + left.translation_mm
    inside_right = inside_left @ cv2.Rodrigues(camera.right.rvec)[0].T + camera.right.tvec_mm
    identity = View(camera.right.intrinsics, np.eye(3), np.zeros(3))
    assert np.allclose(identity.project(inside_right), views(scene)[1].project(points_mm), atol=1e-7)


@pytest.mark.shared_data
def test_conventions_are_those_of_another_renderers_film(shared_data: Path) -> None:
    camera = read_camera(shared_data / "film" / "camera.toml")
    markers = tomllib.loads((shared_data / "film" / "markers.toml").read_text())
    first_deg = float((shared_data / "film" / "truth.csv").read_text().splitlines()[1].split(",")[2])
    assert camera.pose is not None
    view = View(camera.intrinsics, cv2.Rodrigues(camera.pose.rvec)[0], camera.pose.tvec_mm)
    lens = camera.intrinsics
    directions = []
    for name, z_mm in (("base", camera.pose.base_z_mm), ("moving", camera.pose.moving_z_mm)):
        seen = (np.array(markers[name]) - lens.matrix[:2, 2]) / np.diag(lens.matrix)[:2]
        rays = np.column_stack([undistort(seen, lens.distortion), np.ones(2)])
        met = rays @ view.plane_from_ray(z_mm).T
        inner, outer = met[:, :2] / met[:, 2:]
        directions.append(np.arctan2(*(outer - inner)[::-1]) / DEG)
        # Both markers lie on a line through the axis.
        assert abs(inner[0] * outer[1] - inner[1] * outer[0]) / np.hypot(*outer) < 0.05
    # Markers are given to 0.1 px at 70 to 77 px distance: 0.05° each.
    assert (directions[1] - directions[0]) == pytest.approx(first_deg, abs=0.15)
