"""Drawing against brute force and plain geometry."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from torsight.core.units import DEG
from torsight.synthetic.filming.camera_work import Bar, marker_points
from torsight.synthetic.filming.optics import View, undistort, views
from torsight.synthetic.filming.picture import MARGIN_PX, edge_share, expose
from torsight.synthetic.filming.studio import Studio
from torsight.synthetic.scene import Scene, scene_from

STILL = np.zeros(2)
CLEAN = {"texture": 0.0, "read_noise": 0.0, "shot_noise": 0.0, "background": 100.0}


def clean_scene(small_scene: dict, **light) -> tuple[Scene, View]:
    scene = scene_from({**small_scene, "light": {**CLEAN, **light}})
    return scene, views(scene)[0]


def draw(scene: Scene, view: View, stick_deg: float, **how) -> np.ndarray:
    settings = {"shift_px": STILL, "gain": 1.0, "bars": [], "lit": False, **how}
    angles = np.atleast_1d(np.array(stick_deg)) * DEG
    return Studio(scene, view, purpose="0").frame(angles, **settings).astype(np.float64)


def brute_force(scene: Scene, view: View, stick_deg: float, grid: int = 9) -> np.ndarray:
    """Return the unblurred picture, averaged over a grid of points in every pixel."""
    width, height = view.intrinsics.size_px
    offsets = (np.arange(grid) + 0.5) / grid - 0.5
    lens, sticks = view.intrinsics, scene.sticks
    total = np.zeros((height, width))
    for dy in offsets:
        for dx in offsets:
            pixels = np.stack(np.meshgrid(np.arange(width) + dx, np.arange(height) + dy), axis=-1)
            rays = undistort((pixels - lens.matrix[:2, 2]) / np.diag(lens.matrix)[:2], lens.distortion)
            rays = np.concatenate([rays, np.ones((height, width, 1))], axis=-1)
            value = np.full((height, width), scene.light.background)
            for moving, z_mm in enumerate((scene.camera.base_z_mm, scene.camera.moving_z_mm)):
                met = rays @ view.plane_from_ray(z_mm).T
                x, y = met[..., 0] / met[..., 2], met[..., 1] / met[..., 2]
                direction = (sticks.base_deg + moving * stick_deg) * DEG
                u, v = x * np.cos(direction) + y * np.sin(direction), y * np.cos(direction) - x * np.sin(direction)
                inside = (np.abs(v) < sticks.width_mm / 2) & (u > -sticks.width_mm / 2) & (u < sticks.length_mm)
                value[inside] = sticks.level
                for radius in (sticks.inner_mm, sticks.outer_mm):
                    value[np.hypot(u - radius, v) < sticks.dot_mm] = sticks.dot_level
                if moving:
                    value[np.hypot(u, v) < sticks.hub_mm] = sticks.hub_level
            total += value
    return total / grid**2


def test_edge_share_is_a_blurred_step() -> None:
    assert edge_share(0.0, 0.7) == 0.5
    assert edge_share(5.0, 0.7) == 0.0
    assert edge_share(-5.0, 0.7) == 1.0
    assert edge_share(0.7, 0.7) == pytest.approx(0.15866, abs=1e-5)


def test_picture_is_that_of_brute_force(small_scene: dict) -> None:
    import cv2

    scene, view = clean_scene(small_scene, blur_px=0.8)
    exact = cv2.GaussianBlur(brute_force(scene, view, 63.0), (0, 0), 0.8)
    found = draw(scene, view, 63.0)
    difference = found - exact
    # Where edges of two shapes cross, shares are multiplied instead of measured: small, and only there.
    assert np.sqrt(np.mean(difference**2)) < 0.5 + 0.3
    assert np.percentile(np.abs(difference), 99.9) < 4.0
    for x, y in view.project(marker_points(scene, 63.0 * DEG)).round().astype(int):
        # Second order in curvature, and a grid of 9 × 9 points per pixel.
        assert np.abs(difference[y - 6 : y + 7, x - 6 : x + 7]).max() < 5.0


@pytest.mark.parametrize("shift_px", [(0.0, 0.0), (2.37, -1.61)])
def test_dots_are_where_the_camera_projects_them(small_scene: dict, shift_px: tuple[float, float]) -> None:
    scene, view = clean_scene(small_scene)
    stick_deg, shift = 140.0, np.array(shift_px)
    picture = draw(scene, view, stick_deg, shift_px=shift)
    expected = view.project(marker_points(scene, stick_deg * DEG)) + shift
    for x, y in expected:
        # The darkness of a dot on its stick, centred; 8-bit steps leave 0.29 / sqrt(pixels) of noise.
        i, j = round(x), round(y)
        rows, columns = np.mgrid[j - 6 : j + 7, i - 6 : i + 7]
        near = np.hypot(columns - x, rows - y) < 5.5
        dark = (scene.sticks.level - picture[j - 6 : j + 7, i - 6 : i + 7]) * near
        centre = np.array([np.sum(dark * columns), np.sum(dark * rows)]) / dark.sum()
        # Perspective moves an ellipse's middle off the projected centre by r² sin(tilt) / (2 z f)·f: 0.01 px here.
        assert np.allclose(centre, (x, y), atol=0.03)


def test_moving_stick_covers_the_base_stick(small_scene: dict) -> None:
    scene, view = clean_scene({**small_scene, "camera": {"width_px": 320, "height_px": 240, "focal_px": 800.0}})
    covered = draw(scene, view, 0.0)
    points = view.project(marker_points(scene, 0.0))
    between = points[2:].mean(axis=0).round().astype(int)
    assert covered[between[1], between[0]] == pytest.approx(scene.sticks.level, abs=1.0)
    swapped = replace(scene, sticks=replace(scene.sticks, dot_level=200.0, level=40.0))
    light_dots = draw(swapped, view, 90.0)
    x, y = view.project(marker_points(swapped, 90.0 * DEG))[3].round().astype(int)
    assert light_dots[y, x] > 190.0


def test_blur_of_motion_is_the_mean_of_the_moments(small_scene: dict) -> None:
    scene, view = clean_scene(small_scene)
    moments = [30.0, 31.0, 32.0, 33.0]
    together = draw(scene, view, moments)
    apart = np.mean([draw(scene, view, moment) for moment in moments], axis=0)
    # Each picture is rounded to a grey level.
    assert np.abs(together - apart).max() <= 1.0
    assert Studio(scene, view, purpose="0").poses(10.0 * DEG) > 5


def test_noise_has_the_stated_variance(small_scene: dict) -> None:
    scene, view = clean_scene(small_scene, read_noise=2.0, shot_noise=0.05)
    patch = draw(scene, view, 0.0, gain=0.8)[:60, :60]
    # Background 100 at gain 0.8, plus the variance 1/12 of rounding.
    assert patch.mean() == pytest.approx(80.0, abs=4 * 2.9 / 60)
    assert patch.var() == pytest.approx(4.0 + 0.05 * 80.0 + 1 / 12, rel=0.1)


def test_grey_levels_stay_within_eight_bits() -> None:
    picture = np.array([[-5.0, 300.0]], np.float32)
    out = np.empty((1, 2), np.uint8)
    one, zero = np.float32(1.0), np.float32(0.0)
    expose(picture, one, zero, zero, np.zeros(2, np.float32), out)
    assert out.tolist() == [[0, 255]]


def test_bars_and_lamp_stand_in_front(small_scene: dict) -> None:
    scene, view = clean_scene({**small_scene, "led": {"radius_px": 5.0, "position_px": [20.0, 20.0]}})
    bar = Bar(np.array([-10.0, 120.0, 330.0, 120.0]), 8.0, 60.0)
    dark, lit = (draw(scene, view, 200.0, bars=[bar], lit=on) for on in (False, True))
    assert np.all(dark[117:124] == 60.0)
    assert lit[20, 20] - dark[20, 20] == pytest.approx(210.0, abs=1.0)


def test_rays_reach_beyond_the_picture(small_scene: dict) -> None:
    _, view = clean_scene(small_scene)
    assert view.rays(MARGIN_PX).shape == (240 + 2 * MARGIN_PX, 320 + 2 * MARGIN_PX, 2)
