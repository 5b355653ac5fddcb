"""Markers are found by themselves, whatever they look like, and told apart."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from tests.tracker.films import Rig
from tracker.detect.dots import dot_near, find_and_refuse
from tracker.detect.sticks import sticks_in

STILL = Rig(lambda t: np.full_like(t, 75.0), frames=1)
CASES = {
    "dark dots": STILL,
    "light dots": replace(STILL, stick=60.0, dot=200.0, ground=110.0),
    "small": replace(STILL, radius_px=3.0, half_width_px=5.0),
    "large": replace(
        STILL,
        radius_px=19.0,
        half_width_px=24.0,
        size=(480, 400),
        base_px=(60.0, 150.0),
        moving_px=(56.0, 140.0),
        hub_px=18.0,
    ),
    "very large": replace(
        STILL,
        radius_px=36.0,
        half_width_px=44.0,
        size=(800, 760),
        base_px=(110.0, 290.0),
        moving_px=(104.0, 270.0),
        hub_px=30.0,
        overhang_px=50.0,
    ),
    "one stick's dots over twice as large": replace(
        STILL, radius_px=4.5, base_radius_px=10.5, half_width_px=13.0, base_px=(45.0, 110.0), size=(400, 320)
    ),
    "uneven light": replace(STILL, uneven=0.9),
    "textured ground": replace(STILL, texture=28.0, ground=110.0),
    "noisy and faint": replace(STILL, noise=5.0, stick=150.0, dot=95.0),
    "narrow sticks": replace(STILL, half_width_px=6.8),
    "other dots": replace(STILL, extra_dots=[(100.0, 60.0, 5.0), (-60.0, 80.0, 5.0), (90.0, -70.0, 3.0)]),
    "tilted": replace(STILL, tilt_deg=(25.0, -15.0)),
}


@pytest.mark.parametrize("name", CASES)
def test_the_four_markers_are_found(name: str) -> None:
    rig = CASES[name]
    picture = next(rig.pictures())
    sticks = sticks_in(picture)
    assert sticks is not None
    truth = rig.marker_px(75.0)
    found = np.array([[dot.x_px, dot.y_px] for stick in sticks for dot in (stick.inner, stick.outer)])
    if np.hypot(*(found[0] - truth[0])) > 2.0:
        found = found[[2, 3, 0, 1]]
    # Inner markers first; five sigmas of the faintest case (σ/C = 0.09, r = 5) and the shift of a circle's centre
    # seen from aside.
    assert np.hypot(*(found - truth).T).max() < 0.3


def test_the_rim_of_a_dot_in_a_soft_large_picture_is_inside_its_window() -> None:
    rig = replace(CASES["very large"], half_width_px=60.0)
    sticks = sticks_in(cv2.GaussianBlur(next(rig.pictures()), (0, 0), 3.5))
    assert sticks is not None
    dots = [dot for stick in sticks for dot in (stick.inner, stick.outer)]
    # Two standard deviations: without its rim a dot that has moved is not found again.
    assert min(dot.window_px - dot.radius_px - 2.0 * dot.edge_px for dot in dots) > 0.0


@pytest.mark.parametrize("radius_px", [2.8, 4.0, 6.0, 9.0, 14.0, 22.0, 36.0])
def test_the_dots_of_a_whole_picture_are_those_that_are_found_near_each(radius_px: float) -> None:
    # A whole picture is searched at half the size first, the surroundings of a position in full: at any place of a dot
    # on the grid of pixels both find it.
    rng = np.random.default_rng(round(10.0 * radius_px))
    apart = 3.2 * radius_px + 6.0
    places = np.array([(x, y) for y in range(1, 5) for x in range(1, 6)]) * apart + rng.uniform(-0.5, 0.5, (20, 2))
    y, x = np.mgrid[: round(5.0 * apart), : round(6.0 * apart)]
    away = np.min([np.hypot(x - one, y - two) for one, two in places], axis=0)
    luma = 180.0 - 120.0 / (1.0 + np.exp(np.clip((away - radius_px) / 0.3, -50.0, 50.0)))
    picture = np.rint(luma + rng.normal(0.0, 3.0, luma.shape)).astype(np.uint8)
    dots, _ = find_and_refuse(picture)
    assert len(dots) == len(places)
    near = [dot_near(picture, *place, reach_px=3.0) for place in places.tolist()]
    found = np.array([min(np.hypot(dot.x_px - one.x_px, dot.y_px - one.y_px) for dot in dots) for one in near if one])
    # Both end at the same fit.
    assert len(found) == len(places)
    assert found.max() < 0.02


def test_a_picture_without_markers_has_none() -> None:
    rig = replace(STILL, texture=20.0)
    picture = next(replace(rig, base_px=(5000.0, 5100.0), moving_px=(5000.0, 5100.0)).pictures())
    assert sticks_in(picture) is None


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_background_is_not_taken_where_clear_dots_are_of_no_use(seed: int) -> None:
    # Sizes 4:1 are no markers of one rig; what else looks like sticks is texture, however well it fits.
    rig = replace(
        STILL,
        radius_px=4.0,
        base_radius_px=16.0,
        half_width_px=20.0,
        base_px=(60.0, 150.0),
        moving_px=(56.0, 140.0),
        size=(480, 400),
        texture=28.0,
        seed=seed,
    )
    assert sticks_in(next(rig.pictures())) is None


def test_a_given_dot_nearly_as_wide_as_its_stick_is_found() -> None:
    # A yellow sticker on white paper before a dark ground: the ground contrasts four times as much as the dot.
    y, x = np.mgrid[:600, :960] / 6.0
    picture = np.where(np.abs(y - 50.0) < 11.0, 208.0, 75.0)
    picture[np.hypot(x - 80.3, y - 50.2) < 9.0] = 169.0
    luma = picture.reshape(100, 6, 160, 6).mean(axis=(1, 3)) + np.random.default_rng(1).normal(0.0, 1.5, (100, 160))
    dot = dot_near(np.rint(luma).astype(np.uint8), 80.0, 49.0, reach_px=12.0)
    assert dot is not None
    # Pixel centres are at whole numbers.
    assert (dot.x_px, dot.y_px, dot.radius_px) == pytest.approx((80.3 - 5 / 12, 50.2 - 5 / 12, 9.0), abs=0.1)
