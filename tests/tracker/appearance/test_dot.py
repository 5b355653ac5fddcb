"""The dot's model against brute-force pictures, and its precision against the bound."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, uniform_filter1d
from scipy.stats import norm

from tracker.appearance.disc import SHAPE, disc_point
from tracker.appearance.dot_fit import Dot, fit_dot, window_for
from tracker.appearance.lucas_kanade import READING, read_dot
from tracker.appearance.motion_blur import SHARES, best_share, share_limits, smear_misfits
from tracker.detect.sticks import Stick, edges_beside
from tracker.follow.marker import Marker


def brute_disc(x: float, y: float, radius: float, *, size: int, stretch: float = 1.0, fine: int = 25) -> np.ndarray:
    """Share of each pixel that an ellipse covers, by counting sub-pixels."""
    offsets = (np.arange(fine) + 0.5) / fine - 0.5
    at = (np.arange(size)[:, None] + offsets).ravel()
    inside = ((at[None, :] - x) / stretch) ** 2 + ((at[:, None] - y) * stretch) ** 2 < radius**2
    return inside.reshape(size, fine, size, fine).mean(axis=(1, 3))


@pytest.mark.parametrize("radius", [3.0, 6.2, 13.0, 20.0])
def test_a_sharp_dot_is_read_within_a_few_thousandths_of_a_pixel(radius: float) -> None:
    rng = np.random.default_rng(int(radius * 10))
    size = int(2 * radius + 24)
    template = None
    errors = []
    for _ in range(8):
        x, y = size / 2 + rng.uniform(-0.5, 0.5, 2)
        picture = np.rint(185.0 - 140.0 * brute_disc(x, y, radius, size=size)).astype(np.uint8)
        if template is None:
            fit = fit_dot(picture, x + 0.4, y - 0.3, radius_px=1.07 * radius, light_dot=False)
            assert fit is not None
            assert fit.radius_px == pytest.approx(radius, abs=0.05)
            template = Marker(fit)
        reading = template.read(picture, x + 0.3, y + 0.2)
        assert reading is not None
        assert reading["converged"]
        errors.append((reading["x"] - x, reading["y"] - y))
    # Whole grey levels alone (1/√12 of 140) would give 1e-3 px; the rest is the sharp rim on the pixels.
    assert np.sqrt(np.mean(np.square(errors))) < 0.006


def test_the_share_of_a_pixel_is_what_counting_gives() -> None:
    y, x = np.mgrid[-11:12, -11:12].astype(float)
    shape = np.zeros(1, SHAPE)
    shape["radius"], shape["edge"] = 7.3, 0.12
    ours = np.vectorize(lambda u, v: disc_point(u, v, shape[0])[0])(x - 0.31, y + 0.22)
    counted = brute_disc(11.31, 10.78, 7.3, size=23, fine=60)
    assert np.abs(ours - counted).max() < 0.06
    assert ours.sum() == pytest.approx(np.pi * 7.3**2, rel=2e-3)


@pytest.mark.parametrize("edge", [0.3, 0.6, 0.99, 1.01, 1.5, 3.0])
def test_a_blurred_rim_and_its_slopes_are_those_of_the_normal_step(edge: float) -> None:
    shape = np.zeros(1, SHAPE)
    shape["radius"], shape["edge"] = 8.0, edge
    fine = (np.arange(40) + 0.5) / 40 - 0.5
    v, u = np.meshgrid(1.3 + fine, fine, indexing="ij")
    nudge = 1e-4
    for x in np.linspace(5.0, 11.0, 25):
        inside, along_x, _, along_edge = disc_point(x, 1.3, shape[0])
        true = norm.sf((np.hypot(x + u, v) - 8.0) / edge).mean()
        # The logistic curve is right to 2e-4; the mean over a pixel of a soft rim adds as much.
        assert inside == pytest.approx(true, abs=5e-4)
        shape["edge"] = edge + nudge
        wider = disc_point(x, 1.3, shape[0])[0]
        shape["edge"] = edge
        assert along_edge == pytest.approx((wider - inside) / nudge, abs=1e-3)
        further = disc_point(x + nudge, 1.3, shape[0])[0]
        assert along_x == pytest.approx((further - inside) / nudge, abs=1e-3)


@pytest.mark.parametrize("light_dot", [False, True])
def test_errors_reach_the_bound_and_are_told_honestly(*, light_dot: bool) -> None:
    rng = np.random.default_rng(7)
    radius, noise, size = 5.0, 3.0, 31
    stick, step = (60.0, 120.0) if light_dot else (185.0, -140.0)
    first = stick + step * brute_disc(15.0, 15.0, radius, size=size)
    fit = fit_dot(np.rint(first).astype(np.uint8), 15.3, 14.8, radius_px=radius, light_dot=light_dot)
    assert fit is not None
    template = Marker(fit)
    errors, sigmas = [], []
    for _ in range(150):
        x, y = 15 + rng.uniform(-1, 1, 2)
        clean = stick + step * brute_disc(x, y, radius, size=size, fine=9)
        picture = np.clip(np.rint(clean + rng.normal(0, noise, clean.shape)), 0, 255).astype(np.uint8)
        reading = template.read(picture, x + 0.2, y - 0.2)
        assert reading is not None
        errors.append(reading["x"] - x)
        sigmas.append(np.sqrt(reading["covariance"][0]))
    # Cramér and Rao for a disc whose edge is a pixel wide: 1.06 (σ/C) √(w/r), w² = 12 · variance of the edge.
    bound = 1.06 * noise / abs(step) * np.sqrt(1.0 / radius)
    rms = float(np.sqrt(np.mean(np.square(errors))))
    assert rms < 1.35 * bound
    assert 0.8 < rms / np.mean(sigmas) < 1.25


def test_uneven_light_does_not_shift_a_dot() -> None:
    size, x, y = 41, 20.3, 19.8
    column = 1.0 + 0.006 * (np.arange(size) - 20.0)
    picture = np.rint((185.0 - 140.0 * brute_disc(x, y, 7.0, size=size)) * column[None, :]).astype(np.uint8)
    fit = fit_dot(picture, x + 0.5, y, radius_px=6.5, light_dot=False)
    assert fit is not None
    template = Marker(fit)
    reading = template.read(picture, x, y)
    assert reading is not None
    assert reading["slope"][0] == pytest.approx(0.006, abs=0.001)
    # The slope is averaged over frames and taken as known: then the dot stays where it is.
    template.record["slope"] = reading["slope"]
    again = template.read(picture, x, y)
    assert again is not None
    assert abs(again["x"] - x) < 0.004


def test_a_shape_seen_from_aside_is_measured() -> None:
    picture = np.rint(185.0 - 140.0 * brute_disc(20.1, 20.4, 8.0, size=41, stretch=1.06)).astype(np.uint8)
    fit = fit_dot(picture, 20.0, 20.0, radius_px=8.0, light_dot=False)
    assert fit is not None
    assert fit.stretch[0] == pytest.approx(0.06, abs=0.01)
    assert fit.stretch[1] == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize("edge", [0.3, 0.45, 0.8])
@pytest.mark.parametrize("smear", [(3.0, 1.0), (6.0, -8.0), (0.0, 20.0)])
def test_a_smeared_dot_is_read_within_a_hundredth_of_a_pixel(edge: float, smear: tuple[float, float]) -> None:
    rng, fine, size, radius = np.random.default_rng(5), 9, 47, 5.0
    at = (np.arange(size * fine) + 0.5) / fine - 0.5
    steps = int(4 * np.hypot(*smear))
    shares = (np.arange(steps) + 0.5) / steps - 0.5
    dot = Marker(Dot(0.0, 0.0, radius, edge, (0.0, 0.0), -140.0 / 185.0, window_for(radius, edge), 185.0, 0.0, 1.0))
    out, off = np.zeros(1, READING), []
    for _ in range(4):
        x, y = size // 2 + rng.uniform(-0.5, 0.5, 2)
        picture = sum(np.hypot(at - x - a * smear[0], at[:, None] - y - a * smear[1]) < radius for a in shares) / steps
        share = gaussian_filter(picture, edge * fine).reshape(size, fine, size, fine).mean(axis=(1, 3))
        luma = np.rint(185.0 - 140.0 * share).astype(np.uint8)
        assert read_dot(luma, x + 0.3, y - 0.2, dot.record[0], dot.look, smear, out[0])
        off += [out["x"][0] - x, out["y"][0] - y]
    assert np.sqrt(np.mean(np.square(off))) < 0.01


def test_noise_alone_is_no_dot() -> None:
    picture = np.random.default_rng(1).normal(120.0, 8.0, (41, 41)).astype(np.uint8)
    fit = fit_dot(picture, 20.0, 20.0, radius_px=5.0, light_dot=False)
    assert fit is None or fit.explained < 0.6


def dot_on_a_stick(
    blur_px: float, smear_px: float, *, beside_px: float = 0.0, fine: int = 9, size: int = 41
) -> np.ndarray:
    """Draw a dark dot of 4 px on a light stick of 13 px along x, blurred by a lens and smeared along y.

    ``beside_px`` is how far along y the middle of the stick is from the dot.
    """
    at = (np.arange(size * fine) + 0.5) / fine - 0.5 - size // 2
    picture = np.where(np.abs(at - beside_px)[:, None] < 6.5, 185.0, 95.0) * np.ones_like(at)
    picture[np.hypot(at[:, None], at) < 4.0] = 45.0
    picture = gaussian_filter(picture, blur_px * fine)
    if smear_px:
        picture = uniform_filter1d(picture, round(smear_px * fine), axis=0)
    return np.rint(picture.reshape(size, fine, size, fine).mean(axis=(1, 3))).astype(np.uint8)


@pytest.mark.parametrize("blur_px", [0.4, 0.7, 1.2])
@pytest.mark.parametrize("share", [0.0, 0.3, 0.6])
def test_the_blur_of_a_lens_is_not_taken_for_an_open_shutter(blur_px: float, share: float) -> None:
    step_px = 2.6
    fit = fit_dot(dot_on_a_stick(blur_px, 0.0), 20.0, 20.0, radius_px=4.0, light_dot=False, room_px=6.5)
    assert fit is not None
    shape = Marker(fit, strip_px=6.5, edges_px=(6.5, 6.5)).record["shape"][0]
    costs = np.empty(len(SHARES))
    luma = dot_on_a_stick(blur_px, share * step_px)
    assert smear_misfits(luma, (20.0, 20.0), shape, (0.0, step_px), costs)
    costs = np.log(costs + 1e-3)
    found, (low, high) = best_share(costs), share_limits(costs)
    assert low <= share <= high
    # What shows must be right to a step of the shares that are tried.
    assert found == 0.0 or found == pytest.approx(share, abs=0.15)
    assert found > 0.0 or low == 0.0


def test_what_was_never_looked_at_is_not_known() -> None:
    assert share_limits(np.zeros(len(SHARES))) == (0.0, 1.0)
    assert share_limits(2.0 * np.abs(SHARES - 0.6)) == (pytest.approx(0.45), pytest.approx(0.75))


@pytest.mark.parametrize("blur_px", [0.5, 1.0, 2.0, 3.0])
def test_a_sticks_edges_are_found_however_soft_the_picture_is(blur_px: float) -> None:
    y, x = np.mgrid[:181, :421].astype(float)
    sharp = np.where(np.abs(y - 92.0) < 40.0, 190.0, 90.0)
    for middle in (100.0, 320.0):
        sharp[np.hypot(x - middle, y - 90.0) < 16.0] = 50.0
    luma = np.rint(cv2.GaussianBlur(sharp, (0, 0), blur_px)).astype(np.uint8)
    dots = [fit_dot(luma, middle, 90.0, radius_px=16.0, light_dot=False) for middle in (100.0, 320.0)]
    assert dots[0] is not None
    assert dots[1] is not None
    assert edges_beside(luma, Stick(dots[0], dots[1], 0.0)) == pytest.approx((41.5, 37.5), abs=0.75)


@pytest.mark.parametrize("beside_px", [0.0, 1.5, -1.5])
@pytest.mark.parametrize("smear_px", [4.0, -7.0])
def test_a_smeared_dot_need_not_lie_in_the_middle_of_its_stick(beside_px: float, smear_px: float) -> None:
    blur_px = 0.7
    first = dot_on_a_stick(blur_px, 0.0, beside_px=beside_px, size=81)
    fit = fit_dot(first, 40.0, 40.0, radius_px=4.0, light_dot=False, room_px=5.0 - 0.5 * abs(beside_px))
    assert fit is not None
    edges_px = edges_beside(first, Stick(fit, replace(fit, x_px=76.0), 0.0))
    # To half a pixel, in steps of that.
    assert edges_px == pytest.approx((6.5 + beside_px, 6.5 - beside_px), abs=0.75)
    dot = Marker(fit, edges_px=edges_px)
    dot.record["shape"]["across"] = (0.0, 1.0)
    luma, out = dot_on_a_stick(blur_px, abs(smear_px), beside_px=beside_px, size=81), np.zeros(1, READING)
    assert read_dot(luma, 40.2, 39.8, dot.record[0], dot.look, (0.0, smear_px), out[0])
    assert (out["x"][0], out["y"][0]) == pytest.approx((40.0, 40.0), abs=0.15)
