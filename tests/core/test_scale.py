"""Marker distances as a check of scale."""

import numpy as np
import pytest

from torsight.core.errors import NoResultError
from torsight.core.optics.scale import check_scale


def rig(*, stretch=1.0, squeeze=1.0, sigma_mm=0.05, frames=400, seed=0):
    """Return positions of a resting stick of 40 mm and a turning one of 25 mm; depth scaled by ``squeeze``."""
    rng = np.random.default_rng(seed)
    turn = np.linspace(0, 4, frames)
    points = np.zeros((frames, 4, 3))
    points[:, 1] = [24.0, 0.0, 32.0]
    points[:, 2] = [50.0, 0.0, 0.0]
    points[:, 3] = points[:, 2] + 25.0 * np.stack((np.cos(turn), 0 * turn, np.sin(turn)), axis=1)
    points = points * stretch * np.array([1.0, 1.0, squeeze]) + rng.normal(0, sigma_mm, points.shape)
    return points, np.broadcast_to(np.eye(3) * sigma_mm**2, (*points.shape, 3))


def test_lengths_are_within_their_sigma():
    scaled = []
    for seed in range(60):
        check = check_scale(*rig(seed=seed))
        scaled += [
            (check.sticks[name].length_mm - true) / check.sticks[name].sigma_mm
            for name, true in (("base", 40.0), ("moving", 25.0))
        ]
        assert check.complaints == ()
    assert np.mean(np.square(scaled)) == pytest.approx(1.0, abs=5 * np.sqrt(2 / 120))


def test_wrong_square_size_shows_on_both_sticks():
    check = check_scale(*rig(stretch=1.02), known_mm={"base": 40.0, "moving": 25.0})
    assert check.sticks["base"].ratio == pytest.approx(1.02, abs=0.001)
    assert check.sticks["moving"].ratio == pytest.approx(1.02, abs=0.001)
    assert [said.split(" is measured")[0] for said in check.complaints] == ["the base stick", "the moving stick"]


def test_wrong_depth_shows_as_a_length_that_depends_on_where_the_stick_points():
    check = check_scale(*rig(squeeze=1.05), known_mm={"base": 40.0, "moving": 25.0})
    assert any("moving stick's marker distance is not constant" in said for said in check.complaints)


def test_sticks_that_disagree_are_told():
    check = check_scale(*rig(), known_mm={"base": 40.0, "moving": 26.0})
    assert any("disagree on the scale by 3.8" in said for said in check.complaints)


def test_gaps_are_left_out_and_a_stick_never_seen_is_refused():
    points, covariance = rig()
    points[::3, 2] = np.nan
    assert check_scale(points, covariance).sticks["moving"].length_mm == pytest.approx(25.0, abs=0.02)
    points[:, 1] = np.nan
    with pytest.raises(NoResultError, match="base stick"):
        check_scale(points, covariance)
