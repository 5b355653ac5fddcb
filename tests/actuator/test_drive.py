"""What a drive keeps of a record: the turns of its temperatures, and none of a transformation that nobody saw begin."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from torsight.actuator import fit_model
from torsight.actuator.drive import prepare_table
from torsight.actuator.fit_result import notes_of_drive
from torsight.actuator.model import ActuatorModel
from torsight.actuator.spec import reference_spec
from torsight.core.records import SyncedTable
from torsight.core.units import DEG

ROOM_C, HALF_S = 23.0, 400.0
TOPS = [(62.0, 0.6), (64.0, 0.5), (80.0, 0.4), (80.0, 0.5)]
"""Top of every half-cycle, A first, °C, and the rate at which it is reached, °C/s: then it cools by itself at once."""
START_RAD = 3.0


def read_at(rate_hz: float) -> SyncedTable:
    """Return a record without noise and with an angle that stands still."""
    time_s = np.arange(0.0, HALF_S * len(TOPS), 1.0 / rate_hz)
    temps_c = [np.full(len(time_s), ROOM_C) for _ in "ab"]
    for number, (top_c, rate) in enumerate(TOPS):
        own_s = time_s - HALF_S * number
        up_s = (top_c - ROOM_C) / rate
        heated = np.minimum(rate * own_s, (top_c - ROOM_C) * np.exp(-(own_s - up_s) / 40.0))
        temps_c[number % 2] += np.where((own_s >= 0.0) & (own_s < HALF_S), heated, 0.0)
    still = np.full(len(time_s), START_RAD)
    return SyncedTable(time_s, still, np.full(len(time_s), 0.01 * DEG), *temps_c)


def angle_after_tops(*, effects=(), row_rate_hz: float, rate_hz: float, **values: float) -> np.ndarray:
    """Return the angle at the end of every half-cycle of a programme that was read at a rate, degrees."""
    model = ActuatorModel(reference_spec(), effects)
    drive = prepare_table(read_at(rate_hz), row_rate_hz=row_rate_hz)
    angle_rad = model.angle_rad(drive, values)
    ends = np.append(np.flatnonzero(np.diff(drive.cycles.half)), len(drive) - 1)
    return angle_rad[ends] / DEG


@pytest.mark.parametrize("rate_hz", [11.0, 15.0, 30.0])
@pytest.mark.parametrize("shift_s", [0.0, 0.07])
def test_a_top_between_two_rows_ends_the_transformation_where_it_was(rate_hz: float, shift_s: float):
    clocks = {"effects": ("clock_offset",), "clock_offset_s": shift_s, "clock_drift_ppm": 0.0}
    fine = angle_after_tops(row_rate_hz=math.inf, rate_hz=rate_hz, **clocks)
    thinned = angle_after_tops(row_rate_hz=1.0, rate_hz=rate_hz, **clocks)
    # A row a second is up to 0.6 °C, 8°, from the top.
    np.testing.assert_allclose(thinned, fine, atol=0.02)


@cache
def whole_record() -> tuple[SyncedTable, ActuatorModel]:
    table, model = read_at(4.0), ActuatorModel(reference_spec())
    noise = 0.01 * DEG * np.random.default_rng(5).standard_normal(len(table))
    return replace(table, angle_rad=model.angle_rad(model.prepare(table), {}) + noise), model


@pytest.mark.parametrize("begins_at_c", [52.0, 45.0])
def test_a_record_that_begins_within_a_transformation_is_taken_from_where_both_springs_are_cold(begins_at_c: float):
    table, model = whole_record()
    first = int(np.argmax(table.temp_a_c > begins_at_c))
    if begins_at_c < 50.0:  # while it cools
        first = int(np.flatnonzero(table.temp_a_c[: len(table) // 3] > begins_at_c)[-1])
    drive = model.prepare(table.at(np.arange(len(table)) >= first))
    assert drive.left_out_s > 10.0
    assert max(drive.temp_a_c[0], drive.temp_b_c[0]) < model.spec.values["M_f_c"] + 0.5
    assert "are left out" in notes_of_drive(drive)[0]
    assert abs(fit_model(model, drive).values["tau_c_mnm"] - model.spec.values["tau_c_mnm"]) < 0.005


def test_where_nothing_is_heated_after_that_the_record_is_kept_and_it_is_said():
    table, model = whole_record()
    drive = model.prepare(table.at((table.time_s > 50.0) & (table.time_s < HALF_S)))
    assert drive.left_out_s == 0.0
    assert "no spring is heated once both are cold" in notes_of_drive(drive)[0]


def test_a_record_that_begins_cold_is_taken_whole():
    table, model = whole_record()
    for seconds in (0.0, 20.0):
        drive = model.prepare(table.at(table.time_s >= table.time_s[0] + seconds))
        assert drive.left_out_s is None
        assert notes_of_drive(drive) == []
