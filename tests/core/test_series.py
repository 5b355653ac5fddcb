"""Runs of a condition, and the scatter of readings on top of a motion."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from torsight.core.series import constant_runs, correlation_time, extremes, robust_sigma, runs, scatter


@given(st.lists(st.booleans()))
def test_runs_hold_where_the_flag_does_and_do_not_touch(flags: list[bool]) -> None:
    flag = np.array(flags, dtype=bool)
    found = runs(flag)
    rebuilt = np.zeros(len(flag), dtype=bool)
    for begin, end in found:
        assert begin < end
        rebuilt[begin:end] = True
    assert np.array_equal(rebuilt, flag)
    assert all(earlier[1] < later[0] for earlier, later in itertools.pairwise(found))


@given(st.lists(st.integers(0, 2)))
def test_runs_of_one_value_cover_the_series(values: list[int]) -> None:
    value = np.array(values)
    expected = [(len(list(group)), key) for key, group in itertools.groupby(values)]
    found = constant_runs(value)
    assert [(end - begin, value[begin]) for begin, end in found] == expected
    assert [begin for begin, _ in found] == list(itertools.accumulate([0, *(length for length, _ in expected)]))[:-1]


@given(st.lists(st.integers(-20, 20), min_size=2, max_size=60), st.integers(1, 12))
def test_extremes_are_those_between_which_nothing_turns_back_by_the_threshold(values: list[int], least: int) -> None:
    value = np.array(values, dtype=np.float64)
    turns = extremes(value, float(least))
    assert turns == sorted(turns)
    for first, second, third in zip(turns[1:], turns[2:], turns[3:], strict=False):
        assert (value[second] - value[first]) * (value[third] - value[second]) < 0
    for first, last in itertools.pairwise(turns[1:-1]):
        way = value[first : last + 1] * np.sign(value[last] - value[first])
        assert way[-1] - way[0] >= least
        # On the way nothing goes back by the threshold, and nothing goes beyond either end.
        assert np.max(np.maximum.accumulate(way) - way) < least
        assert way[0] == way.min()
        assert way[-1] == way.max()


@pytest.mark.parametrize("order", [2, 3])
def test_scatter_is_that_of_white_noise_for_every_order(order: int) -> None:
    noise = np.random.default_rng(3).standard_normal(20_000)
    # The median of 20,000 sizes has a standard error of about 1 %.
    assert scatter(noise, order=order) == pytest.approx(1.0, abs=0.04)
    assert robust_sigma(noise) == pytest.approx(1.0, abs=0.04)


@pytest.mark.parametrize("stride", [1, 2, 4])
def test_scatter_is_that_of_the_readings_whatever_moves_slowly_and_whatever_glitches(stride: int) -> None:
    rng = np.random.default_rng(7)
    at = np.arange(20_000)
    value = 300.0 * np.sin(at / 2000.0) + 0.05 * rng.standard_normal(len(at))
    value[::500] += 40.0
    assert scatter(value[:8000], value[8000:8005], value[8005:], stride=stride) == pytest.approx(0.05, rel=0.05)


@pytest.mark.parametrize("pieces", [1, 8])
def test_correlation_time_of_a_known_process(pieces):
    rng = np.random.default_rng(4)
    keep, x = 0.95, np.zeros(40_000)
    for k in range(1, len(x)):
        x[k] = keep * x[k - 1] + rng.standard_normal()
    # (1 + a) / (1 − a) = 39 samples.
    assert correlation_time(np.split(x, pieces)) == pytest.approx(39.0, rel=0.2)
    assert correlation_time(np.split(rng.standard_normal(8000), pieces)) == pytest.approx(1.0, abs=0.3)
    assert correlation_time([x[:3]]) == 1.0
