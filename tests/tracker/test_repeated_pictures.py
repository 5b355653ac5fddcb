"""Pictures that repeat the one before them, by the motion of the markers."""

from __future__ import annotations

import numpy as np
import pytest

from tracker.repeated_pictures import over_repeats, repeats

SIGMA_PX = 0.03
ARMS_PX = np.array([50.0, 140.0])
TIME_S = np.arange(150) / 30.0


def swing(time_s: np.ndarray) -> np.ndarray:
    return 0.7 + 0.9 * np.sin(2.2 * time_s)


def seen(angle_rad: np.ndarray, repeated: np.ndarray) -> np.ndarray:
    """Markers (n, 2, 2) at an angle, with noise that a repeated picture repeats."""
    noise = np.random.default_rng(3).normal(0.0, SIGMA_PX, (len(angle_rad), 2, 2))
    for k in np.flatnonzero(repeated):
        noise[k] = noise[k - 1]
    return np.stack([np.cos(angle_rad), np.sin(angle_rad)], axis=-1)[:, None] * ARMS_PX[:, None] + noise


def found(angle_rad: np.ndarray, repeated: np.ndarray) -> np.ndarray:
    return repeats(seen(angle_rad, repeated), np.full((len(angle_rad), 2), SIGMA_PX))


@pytest.mark.parametrize("rate", [24.0, 20.0, 15.0, 10.0])
def test_a_film_converted_to_another_rate_is_honest(rate: float) -> None:
    number = np.floor(TIME_S * rate + 1e-6)
    again = np.diff(number, prepend=-1.0) == 0.0
    shown = swing(number / rate)
    repeated = found(shown, again)
    # At a turning point steps are lost in the noise.
    assert (repeated != again).sum() <= 4
    angle, variance = over_repeats(TIME_S, shown, repeated)
    pull = (angle - swing(TIME_S)) / np.sqrt(variance + (SIGMA_PX / ARMS_PX.sum()) ** 2)
    assert np.sqrt(np.mean(pull**2)) < 1.2
    assert np.abs(angle - swing(TIME_S)).max() < np.abs(shown - swing(TIME_S)).max() + 1e-12


def test_a_picture_in_place_of_a_missing_one_costs_its_own_frame_alone() -> None:
    again = np.arange(150) % 6 == 5
    true = swing(TIME_S)
    shown = np.where(again, np.roll(true, 1), true)
    angle, variance = over_repeats(TIME_S, shown, found(shown, again))
    # At a turning point steps are lost in the noise.
    assert np.count_nonzero(variance[~again]) <= 2
    assert np.abs(angle - true)[again].max() < 0.1 * np.abs(shown - true).max()
    assert (np.abs(angle - true) <= np.sqrt(variance) + 1e-3).all()


@pytest.mark.parametrize(
    "angle_rad",
    [
        swing(TIME_S),
        0.2 * TIME_S,
        # A stick that jumps, and rests for half a second.
        0.3 * np.floor(TIME_S / 0.5),
        np.zeros(150),
        0.5 * np.cumsum(np.random.default_rng(1).normal(0.0, 0.05, 150)),
    ],
)
def test_a_film_without_repeats_has_none(angle_rad: np.ndarray) -> None:
    none = np.zeros(150, bool)
    assert not found(angle_rad, none).any()
    angle, variance = over_repeats(TIME_S, angle_rad, none)
    np.testing.assert_array_equal(angle, angle_rad)
    assert not variance.any()


def test_markers_that_are_not_seen_are_no_repeats() -> None:
    place = seen(swing(TIME_S), np.zeros(150, bool))
    place[40:60], place[80:90, 1], place[100] = np.nan, np.nan, np.nan
    assert not repeats(place, np.full((150, 2), SIGMA_PX)).any()
    assert not repeats(place[:1], np.full((1, 2), SIGMA_PX)).any()
    assert not repeats(place[:0], np.full((0, 2), SIGMA_PX)).any()
