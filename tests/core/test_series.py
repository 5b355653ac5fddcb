"""Runs of a condition, and the scatter of readings on top of a motion."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from torsight.core.series import runs, scatter


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


@pytest.mark.parametrize("stride", [1, 2, 4])
def test_scatter_is_that_of_the_readings_whatever_moves_slowly_and_whatever_glitches(stride: int) -> None:
    rng = np.random.default_rng(7)
    at = np.arange(20_000)
    value = 300.0 * np.sin(at / 2000.0) + 0.05 * rng.standard_normal(len(at))
    value[::500] += 40.0
    assert scatter(value[:8000], value[8000:8005], value[8005:], stride=stride) == pytest.approx(0.05, rel=0.05)
