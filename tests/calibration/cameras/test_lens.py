"""A lens from views of known geometry: intervals, bad views, what is refused."""

import cv2
import numpy as np
import pytest
from made_up_views import LENS, SIZE_PX, exact_view, poses

from calibration.cameras.lens import calibrate_lens, fit_lens, jackknife_sigma, lens_values, spread_deg
from calibration.views.detect import find_board
from torsight.core.errors import NoResultError
from torsight.core.parallel.threads import one_thread

TRUE = lens_values(LENS)


def views(seed, *, count=12, sigma_px=0.15, **options):
    rng = np.random.default_rng(seed)
    return [
        exact_view(pose, index, sigma_px=sigma_px, rng=rng) for index, pose in enumerate(poses(count, seed, **options))
    ]


def test_without_noise_the_lens_is_exact():
    lens = calibrate_lens(views(1, sigma_px=0.0), SIZE_PX)
    assert lens_values(lens.fit.intrinsics)[:4] == pytest.approx(TRUE[:4], abs=2e-3)
    assert lens_values(lens.fit.intrinsics)[4:] == pytest.approx(TRUE[4:], abs=2e-3)
    assert lens.fit.rms_px < 1e-3


def test_intervals_hold_the_truth_as_often_as_they_say():
    scaled = []
    for seed in range(40):
        with one_thread():
            fit = fit_lens(views(seed), SIZE_PX)
        scaled.append((lens_values(fit.intrinsics) - TRUE) / fit.sigma)
    inside = np.mean(np.abs(scaled) < 1.96)
    # 360 values of which perhaps a third are independent: five standard errors of 0.95.
    assert inside == pytest.approx(0.95, abs=5 * np.sqrt(0.95 * 0.05 / 120))
    assert np.sqrt(np.mean(np.square(scaled))) == pytest.approx(1.0, abs=5 / np.sqrt(2 * 120))


def test_drawn_pictures_give_the_lens_within_its_sigma(drawn):
    board, _, pictures = drawn
    seen = [find_board(grey, board, index=index) for index, grey in enumerate(pictures)]
    lens = calibrate_lens(seen, SIZE_PX)
    assert not lens.aside
    assert np.all(np.abs(lens_values(lens.fit.intrinsics) - TRUE) < 4.0 * lens.sigma)
    assert lens.sigma[0] / TRUE[0] < 0.003


def test_bad_view_is_set_aside_and_does_no_harm():
    good = views(5)
    bad = exact_view(poses(12, 5)[3], 3, sigma_px=2.0, rng=np.random.default_rng(0))
    lens = calibrate_lens([*good[:3], bad, *good[4:]], SIZE_PX)
    assert [item.view for item in lens.aside] == [3]
    assert "px off" in lens.aside[0].why
    alone = calibrate_lens([*good[:3], *good[4:]], SIZE_PX)
    assert lens_values(lens.fit.intrinsics) == pytest.approx(lens_values(alone.fit.intrinsics), rel=1e-9)
    assert lens.first.error_px[3] > 3 * np.median(lens.first.error_px)


def test_view_whose_corners_depend_on_the_window_is_set_aside():
    seen = views(6)
    seen[7] = exact_view(poses(12, 6)[7], 7, sigma_px=0.15, rng=np.random.default_rng(1), wide_px=1.5)
    lens = calibrate_lens(seen, SIZE_PX)
    assert [item.view for item in lens.aside] == [7]
    assert "with the window" in lens.aside[0].why


def test_no_view_is_set_aside_where_all_are_alike():
    assert not any(calibrate_lens(views(seed), SIZE_PX).aside for seed in range(5))


def test_same_digits_on_any_number_of_threads():
    seen = views(8)
    before = cv2.getNumThreads()
    results = []
    try:
        for threads in (1, 2, 4):
            cv2.setNumThreads(threads)
            results.append(lens_values(calibrate_lens(seen, SIZE_PX).fit.intrinsics))
            assert cv2.getNumThreads() == threads
    finally:
        cv2.setNumThreads(before)
    assert np.array_equal(results[0], results[1])
    assert np.array_equal(results[0], results[2])


@pytest.mark.parametrize("count", [1, 2, 3])
def test_too_few_views_are_refused(count):
    with pytest.raises(NoResultError, match=f"the board in {count} picture.*at least 4"):
        calibrate_lens(views(1, count=count), SIZE_PX)


def test_views_from_the_same_side_are_refused():
    with pytest.raises(NoResultError, match="all views are from the same side"):
        calibrate_lens(views(1, tilt_deg=2.0), SIZE_PX)
    leaned = [exact_view(np.array([0.5, 0.2, 0.1, *pose[3:]]), index) for index, pose in enumerate(poses(12, 0))]
    with pytest.raises(NoResultError, match=r"within \d\.\d° of one orientation"):
        calibrate_lens(leaned, SIZE_PX)


def test_jackknife_of_a_mean_is_its_standard_error():
    data = np.random.default_rng(0).normal(0, 1, 30)
    left_out = np.array([[np.delete(data, place).mean()] for place in range(30)])
    expected = data.std(ddof=1) / np.sqrt(30)
    assert jackknife_sigma(left_out, np.array([data.mean()])) == pytest.approx([expected], rel=1e-9)


def test_spread_is_the_largest_angle():
    normals = np.array([[0, 0, 1], [np.sin(0.3), 0, np.cos(0.3)], [-np.sin(0.2), 0, np.cos(0.2)]])
    assert spread_deg(normals) == pytest.approx(np.degrees(0.5))
