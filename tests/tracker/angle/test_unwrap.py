"""Whole turns across gaps."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tracker.angle.unwrap import unwrap


def folded(angle_rad: np.ndarray) -> np.ndarray:
    return np.angle(np.exp(1j * angle_rad))


@settings(max_examples=40, deadline=None)
@given(
    start=st.floats(-3.1, 3.1),
    range_rad=st.floats(-12.0, 12.0),
    gap=st.integers(0, 60),
    first=st.integers(20, 200),
    delay_s=st.floats(-5.0, 5.0),
)
def test_a_smooth_motion_comes_back_whatever_the_gap(
    start: float, range_rad: float, gap: int, first: int, delay_s: float
) -> None:
    time_s = np.arange(300) / 30.0
    true = start + range_rad * (1.0 - np.cos(2 * np.pi * time_s / 16.0)) / 2.0
    seen = folded(true)
    seen[first : first + gap] = np.nan
    whole, certain = unwrap(time_s + delay_s, seen)
    known = np.isfinite(seen)
    assert np.isnan(whole[~known]).all()
    wrong = np.abs(whole - true)[known] > 1e-6
    # Wrong only where it says that it may be: that is what the flag is for.
    assert not (wrong & certain[known]).any()
    if gap * abs(range_rad) < 300:
        assert not wrong.any()


def test_the_first_angle_lies_within_a_half_turn() -> None:
    time_s = np.arange(10) / 30.0
    for start in (3.5, -3.5, np.pi, -np.pi):
        whole, _ = unwrap(time_s, np.full(10, start))
        assert -np.pi < whole[0] <= np.pi


def test_a_gap_that_allows_two_answers_is_marked() -> None:
    time_s = np.arange(400) / 30.0
    true = 20.0 * (1.0 - np.cos(2 * np.pi * time_s / 6.0))
    seen = folded(true)
    seen[120:270] = np.nan
    _, certain = unwrap(time_s, seen)
    assert certain[:120].all()
    assert not certain[270:].any()


def test_dropped_frames_do_not_cost_a_turn() -> None:
    time_s = np.arange(600) / 30.0
    true = 2.2 * time_s * 5.0
    kept = np.sort(np.random.default_rng(5).choice(600, 480, replace=False))
    whole, certain = unwrap(time_s[kept], folded(true[kept]))
    assert certain.all()
    assert np.ptp(whole - true[kept]) < 1e-9


@pytest.mark.parametrize("lost", [3, 20, 39])
def test_a_lost_frame_of_a_time_lapse_costs_no_turn(lost: int) -> None:
    # A frame every 2 s, turned by up to 24 degrees since the frame before.
    time_s = 2.0 * np.arange(80)
    true = 1.5 * np.sin(0.14 * time_s)
    whole, certain = unwrap(time_s, np.where(np.arange(80) == lost, np.nan, true))
    assert certain.all()
    np.testing.assert_allclose(whole[np.arange(80) != lost], np.delete(true, lost))


@pytest.mark.parametrize("lost", range(30, 40))
def test_a_frame_that_is_lost_as_the_stick_starts_costs_no_turn(lost: int) -> None:
    # From rest to 19 degrees a frame: the speed before the gap is not that of the time before.
    time_s = np.arange(90) / 30.0
    share = np.clip((time_s - 1.0) / 0.25, 0.0, 1.0)
    true = np.deg2rad(95.0) * share**2 * (3.0 - 2.0 * share)
    seen = np.where(np.arange(90) == lost, np.nan, true)
    whole, certain = unwrap(time_s, seen)
    assert certain.all()
    np.testing.assert_allclose(whole, seen)


@pytest.mark.parametrize("seed", range(6))
def test_a_motion_that_jumps_by_less_than_a_quarter_turn_keeps_its_turns(seed: int) -> None:
    rng, time_s = np.random.default_rng(seed), np.arange(300) / 30.0
    jumps = np.where(rng.random(300) < 0.06, rng.uniform(-70.0, 70.0, 300), 0.0)
    true = np.deg2rad(40.0 * time_s + np.cumsum(jumps))
    seen = folded(true)
    for first in (60, 140, 220):
        seen[first : first + 5] = np.nan
    whole, certain = unwrap(time_s, seen)
    known = np.isfinite(seen)
    assert certain.all()
    np.testing.assert_allclose((whole - true)[known], np.round((whole[0] - true[0]) / np.pi) * np.pi, atol=1e-9)


def test_a_fast_stroke_that_is_not_seen_is_not_certain_where_the_turn_is_wrong() -> None:
    # What is lost is what is fast: the slow ends alone show no great acceleration.
    time_s = np.arange(300) / 30.0
    for range_deg in np.linspace(90.0, 400.0, 63):
        share = 1.0 - np.exp(-(time_s % 2.5) / 0.4)
        true = np.deg2rad(range_deg * np.where(time_s // 2.5 % 2 == 0, share, share.max() - share))
        rate = np.abs(np.gradient(true))
        seen = np.where(rate > np.quantile(rate, 0.85), np.nan, folded(true))
        whole, certain = unwrap(time_s, seen)
        off = whole - true - (whole - true)[np.isfinite(seen)][0]
        assert not ((np.abs(off) > 1.0) & certain).any()


def test_nothing_known_is_nothing() -> None:
    whole, certain = unwrap(np.arange(5.0), np.full(5, np.nan))
    assert np.isnan(whole).all()
    assert certain.all()


def cut_out(true: np.ndarray, first: int, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return times, angles and the true ones of a film from which frames were cut out, with its own steady times."""
    true = np.delete(true, np.s_[first : first + count])
    seen = folded(true)
    # At the cut no marker is where it is expected.
    seen[first] = np.nan
    return np.arange(len(true)) / 30.0, seen, true


def test_a_cut_between_cycles_of_the_same_range_costs_no_turn() -> None:
    true = 0.8 * (1.0 - np.cos(2 * np.pi * np.arange(1200) / 150.0)) - 1.0
    for first in (310, 350, 390):
        for count in (50, 95):
            time_s, seen, true_left = cut_out(true, first, count)
            whole, certain = unwrap(time_s, seen)
            assert certain.all()
            np.testing.assert_allclose(np.delete(whole - true_left, first), 0.0, atol=1e-9)


def test_a_cut_between_unlike_ranges_is_not_certain() -> None:
    # Of the range 0 to 92 degrees each side shows its own part.
    true = 0.8 * (1.0 - np.cos(2 * np.pi * np.arange(150) / 150.0)) - 1.0
    time_s, seen, _ = cut_out(true, 40, 45)
    _, certain = unwrap(time_s, seen)
    assert certain[:40].all()
    assert not certain[40:].any()
