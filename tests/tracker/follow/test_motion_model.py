"""What is predicted and what is learned of the motion, against closed forms and other libraries."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from tracker.follow.motion_model import extrapolated
from tracker.follow.redetect import direction
from tracker.follow.rotation_axis import AXIS, direction_from, learn_axis, on_circle, suppose_axis
from tracker.follow.state import KEPT, MARKER
from tracker.innovation import passes

TIMES_S = np.array([0.07, 0.1])


def marker_on(motion: np.ndarray, count: int) -> np.ndarray:
    """Return a marker that was last read on a motion, polynomials of time (x and y, highest power first)."""
    marker = np.zeros(1, MARKER)
    marker["count"] = count
    for k, time_s in enumerate(TIMES_S[KEPT - count :]):
        marker["history"][0, k] = [time_s, *(np.polyval(axis, time_s) for axis in motion)]
    return marker[0]


@pytest.mark.parametrize("count", range(1, KEPT + 1))
def test_a_motion_is_carried_on_as_far_as_its_readings_tell(count: int) -> None:
    motion = np.array([[-30.0, 200.0], [90.0, 120.0]])
    expected = [np.polyval(axis, 0.14 if count > 1 else TIMES_S[-1]) for axis in motion]
    found = extrapolated(marker_on(motion, count), np.zeros(1, AXIS)[0], 0.14)
    assert [found.real, found.imag] == pytest.approx(expected)


def test_a_stick_whose_axis_is_known_is_carried_on_around_it() -> None:
    axis, marker = np.zeros(1, AXIS)[0], np.zeros(1, MARKER)[0]
    axis["known"], axis["centre"] = 1, (210.0, 130.0)
    on_circle_at = lambda time_s: 210.0 + 130.0j + 80.0 * np.exp(4.0j * time_s)  # noqa: E731
    marker["count"], marker["history"] = 2, [[t, on_circle_at(t).real, on_circle_at(t).imag] for t in TIMES_S]
    assert extrapolated(marker, axis, 0.31) == pytest.approx(on_circle_at(0.31))


@pytest.mark.parametrize("freedom", range(1, 7))
def test_the_gate_is_three_standard_deviations(freedom: int) -> None:
    limit = stats.chi2.ppf(1.0 - 2.0 * stats.norm.sf(3.0), freedom)
    # The limits are given to two digits.
    assert passes(limit - 0.01, freedom)
    assert not passes(limit + 0.01, freedom)
    assert not passes(np.nan, freedom)


def stick(turn_rad: np.ndarray) -> tuple[np.ndarray, tuple[complex, ...]]:
    """Return both markers (n, 2, 2) of a stick about an axis, by complex numbers, with axis and arms."""
    centre, arms = 210.0 + 130.0j, (50.0 + 3.0j, 121.0 - 2.0j)
    points = centre + np.exp(1j * turn_rad)[:, None] * np.array(arms)
    return np.stack([points.real, points.imag], axis=-1), (centre, *arms)


def test_an_axis_is_learned_from_the_turns_of_a_stick() -> None:
    points, (centre, *_) = stick(np.deg2rad(np.arange(0.0, 80.0, 4.0)))
    own = learned(points, np.zeros(1, AXIS))
    assert own["known"]
    # Over this arc the scaled equations have a condition of 24; their ridge of 1e-9 then moves 200 px by 5e-6.
    assert own["centre"] == pytest.approx([centre.real, centre.imag], abs=1e-4)
    for inner, outer in points[::5].tolist():
        turn = direction(tuple(inner), tuple(outer))
        for end, place in enumerate((inner, outer)):
            assert on_circle(own, turn, end) == pytest.approx(place, abs=1e-4)
            assert np.exp(1j * direction_from(own, *place, end)) == pytest.approx(np.exp(1j * turn), abs=1e-6)


def learned(points: np.ndarray, axis: np.ndarray) -> np.ndarray:
    axis["last_rad"] = np.nan
    for inner, outer in points.tolist():
        learn_axis(axis[0], tuple(inner), tuple(outer))
    return axis[0]


def test_a_stick_that_hardly_turns_tells_its_axis_roughly() -> None:
    points, _ = stick(np.deg2rad(np.linspace(11.0, 18.0, 40)))
    jolt = np.random.default_rng(2).normal(0.0, 0.2, (40, *points.shape))
    found = [learned(points + one, np.zeros(1, AXIS)) for one in jolt]
    off_px = np.hypot(*(np.array([own["centre"] for own in found]) - [210.0, 130.0]).T)
    # The noise is a quarter of what is assumed, and noise of the stick's own direction doubles its effect.
    assert 0.3 < np.sqrt(np.mean(off_px**2) / 2.0) / np.median([own["sigma"] for own in found]) < 1.0


@pytest.mark.parametrize("apart_deg", [0.0, 20.0, 90.0, 180.0])
def test_the_axis_is_guessed_from_the_lines_of_both_sticks(apart_deg: float) -> None:
    other, _ = stick(np.zeros(1))
    own, _ = stick(np.deg2rad([apart_deg]))
    axis = np.zeros(1, AXIS)
    suppose_axis(axis[0], *(tuple(map(tuple, one[0].tolist())) for one in (other, own)), 6.0)
    off_px = np.hypot(*(learned(own, axis)["centre"] - [210.0, 130.0]))
    assert off_px < 2.0 * axis[0]["sigma"]
    # As well known as the lines where they cross steeply, and as half a stick's length where both are one line.
    assert axis[0]["sigma"] < (7.0 if apart_deg == 90.0 else 0.5 * 71.0)
