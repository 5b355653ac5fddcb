"""The time and height of a marker's slip, where rows are means over unlike spans."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from torsight.actuator import ActuatorModel, Drive, reference_spec
from torsight.actuator.effects.marker_slip import seen, step
from torsight.core.records import SyncedTable
from torsight.core.units import DEG

EVERY_S = 0.05


@pytest.mark.parametrize("slip_s", [412.3, 413.9, 415.0, 416.2, 630.4])
def test_a_step_is_that_of_rows_that_are_means(slip_s):
    fine_s = np.arange(0.0, 1000.0, EVERY_S)
    time_s = np.concatenate([np.arange(1.0, 400.0, 0.9), np.arange(400.0, 450.0, 5.0), np.arange(450.0, 999.0, 1.7)])
    gap = np.diff(time_s)
    half_s = 0.5 * np.minimum(np.append(gap, gap[-1]), np.insert(gap, 0, gap[0]))
    means = np.array([np.mean(fine_s[np.abs(fine_s - t) <= h] >= slip_s) for t, h in zip(time_s, half_s, strict=True)])
    share = step(time_s, at_s=slip_s)
    np.testing.assert_allclose(share, means, atol=2.0 * EVERY_S / half_s.min())
    assert np.count_nonzero((means > 0.0) & (means < 1.0)) <= 1


TIME_S = np.arange(0.0, 600.0, 0.25)
FITTED_S = np.arange(0.0, 600.0, 5.0)
CLAIMED = {"slip_time_s": 300.0, "slip_deg": 3.0}


def angle(slid: np.ndarray | float, *, speed_deg_s: float = 1.5) -> np.ndarray:
    """Return an angle in motion, rad, that begins slowly and has some noise, beside what a marker has slid."""
    moved_deg = speed_deg_s * (TIME_S + 20.0 * np.exp(-TIME_S / 20.0)) + 15.0 * np.sin(TIME_S / 90.0)
    return (moved_deg + slid + 0.05 * np.random.default_rng(4).standard_normal(len(TIME_S))) * DEG


def tracked(angle_rad: NDArray[np.float64]) -> Drive:
    """Return the prepared record of these angles (n,), with A heated once."""
    heated_c, room_c = 23.0 + np.clip(0.1 * TIME_S, 0.0, 50.0), np.full(len(TIME_S), 23.0)
    table = SyncedTable(TIME_S, np.zeros(len(TIME_S)), np.full(len(TIME_S), 0.05 * DEG), heated_c, room_c)
    drive = ActuatorModel(reference_spec()).prepare(table)
    np.testing.assert_array_equal(drive.time_s, TIME_S)
    return replace(drive, angle_rad=angle_rad)


@pytest.mark.parametrize("lasts_s", [0.0, 3.0, 12.0])
@pytest.mark.parametrize("speed_deg_s", [0.0, 1.5])
def test_a_slip_that_is_there_is_not_held_against_it(lasts_s: float, speed_deg_s: float) -> None:
    slid = 3.0 * np.clip((TIME_S - 301.0) / max(lasts_s, 1e-9) + 0.5, 0.0, 1.0)
    assert seen(tracked(angle(slid, speed_deg_s=speed_deg_s)), FITTED_S, CLAIMED) > -1.0


@pytest.mark.parametrize("speed_deg_s", [0.0, 1.5])
def test_a_slip_where_the_tracker_saw_none_is_as_good_as_excluded(speed_deg_s: float) -> None:
    assert seen(tracked(angle(0.0, speed_deg_s=speed_deg_s)), FITTED_S, CLAIMED) < -50.0


def test_behind_a_hand_a_slip_may_hide() -> None:
    hidden = np.where(np.abs(TIME_S - 300.0) < 2.0, np.nan, angle(3.0 * (TIME_S > 300.5)))
    assert seen(tracked(hidden), FITTED_S, CLAIMED) > -1.0
    unseen = np.where(np.abs(TIME_S - 300.0) < 40.0, np.nan, angle(0.0))
    assert seen(tracked(unseen), FITTED_S, CLAIMED) == 0.0
