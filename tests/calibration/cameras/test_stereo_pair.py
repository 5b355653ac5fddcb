"""Two cameras of known arrangement."""

from dataclasses import replace

import numpy as np
import pytest
from made_up_views import (
    LENS,
    RIGHT_LENS,
    RIGHT_RVEC,
    RIGHT_TVEC_MM,
    SIZE_PX,
    exact_view,
    in_right,
    poses,
)

from calibration.cameras.lens import calibrate_lens
from calibration.cameras.stereo_pair import calibrate_pair
from torsight.core.errors import NoResultError


def lenses(seed, *, sigma_px=0.15, count=12, spoiled=None, right_index=lambda index: index):
    rng = np.random.default_rng(seed)
    where = poses(count, seed)
    left = [exact_view(pose, index, lens=LENS, sigma_px=sigma_px, rng=rng) for index, pose in enumerate(where)]
    right = [
        exact_view(in_right(pose), right_index(index), lens=RIGHT_LENS, sigma_px=sigma_px, rng=rng)
        for index, pose in enumerate(where)
    ]
    if spoiled is not None:
        # The board moved between the two exposures: each picture is fine by itself.
        moved = where[spoiled] + np.array([0, 0, 0, 4.0, 0, 0])
        right[spoiled] = exact_view(in_right(moved), spoiled, lens=RIGHT_LENS, sigma_px=sigma_px, rng=rng)
    return calibrate_lens(left, SIZE_PX), calibrate_lens(right, SIZE_PX)


def test_without_noise_the_arrangement_is_exact():
    pair = calibrate_pair(*lenses(1, sigma_px=0.0))
    assert pair.right.rvec == pytest.approx(RIGHT_RVEC, abs=1e-5)
    assert pair.right.tvec_mm == pytest.approx(RIGHT_TVEC_MM, abs=1e-2)
    assert pair.epipolar_px.max() < 1e-3


def test_arrangement_lies_within_its_sigma():
    scaled = []
    true = np.concatenate((RIGHT_RVEC, RIGHT_TVEC_MM))
    for seed in range(4):
        pair = calibrate_pair(*lenses(seed))
        scaled.append((np.concatenate((pair.right.rvec, pair.right.tvec_mm)) - true) / pair.sigma)
        # Two lines of sight with 0.15 px each way: the mean distance from a line is σ√(2/π)·√2, half of it left to fit.
        assert 0.05 < pair.epipolar_px.mean() < 0.25
    # A jackknife over 12 groups is itself known to 20 %; 24 values.
    assert np.sqrt(np.mean(np.square(scaled))) == pytest.approx(1.0, abs=0.2 + 5 / np.sqrt(2 * 24))


def test_pair_that_was_not_taken_at_one_instant_is_set_aside():
    pair = calibrate_pair(*lenses(2, spoiled=4))
    assert [item.view for item in pair.aside] == [4]
    assert "the two pictures disagree" in pair.aside[0].why
    assert 4 not in pair.index


def test_cameras_that_never_see_the_board_together_are_refused():
    with pytest.raises(NoResultError, match="0 pairs"):
        calibrate_pair(*lenses(3, right_index=lambda index: index + 100))


def test_only_corners_that_both_see_are_paired():
    left, right = lenses(4, sigma_px=0.0)
    few = [
        replace(
            view,
            corner=view.corner[10:],
            points_mm=view.points_mm[10:],
            corners_px=view.corners_px[10:],
            wide_px=view.wide_px[10:],
        )
        for view in right.views
    ]
    pair = calibrate_pair(left, calibrate_lens(few, SIZE_PX))
    assert pair.right.tvec_mm == pytest.approx(RIGHT_TVEC_MM, abs=1e-2)
