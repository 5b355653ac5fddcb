"""What a drive keeps of a record: the turns of its temperatures, and none of a transformation that nobody saw begin."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from torsight.actuator import fit_model
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
    drive = model.prepare(read_at(rate_hz), row_rate_hz=row_rate_hz)
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


@pytest.mark.parametrize("seed", [1, 2])
def test_a_wire_behind_a_slow_sensor_is_off_by_as_many_sigmas_as_its_sensor(seed: int):
    """The noise of a sensor that is late by 5 s makes more of an error of its wire than of itself."""
    table = read_at(4.0)
    rng, lag_s, keep = np.random.default_rng(seed), 5.0, np.exp(-0.25 / 5.0)
    read = [one.copy() for one in (table.temp_a_c, table.temp_b_c)]
    for late, wire in zip(read, (table.temp_a_c, table.temp_b_c), strict=True):
        for k in range(1, len(wire)):
            # On a ramp it is late by its time constant.
            behind_c = (wire[k] - wire[k - 1]) / 0.25 * lag_s
            late[k] = wire[k] - behind_c + (late[k - 1] - wire[k - 1] + behind_c) * keep
    noisy = [late + 0.05 * rng.standard_normal(len(late)) for late in read]
    late_table = replace(table, temp_a_c=noisy[0], temp_b_c=noisy[1])
    drive = ActuatorModel(reference_spec()).prepare(late_table, row_rate_hz=math.inf)
    off = drive.sensors.off_by((drive.temp_sigma_c, drive.temp_sigma_c))
    (share, *right), (_, *wrong) = drive.sensors.lag_correction(lag_s), off.lag_correction(lag_s)
    at_lag = [low[0] + share * (high[0] - low[0]) for low, high in (right, wrong)]
    wire_sigma_c = drive.temp_sigma_c + at_lag[1] - at_lag[0]
    error_c = drive.temp_a_c + at_lag[0] - table.temp_a_c
    driven = (drive.cycles.active == 0) & (table.temp_a_c > 30.0)
    assert 0.5 < np.sqrt(np.mean((error_c[driven] / wire_sigma_c[driven]) ** 2)) < 1.5
    assert np.median(wire_sigma_c[driven] / drive.temp_sigma_c[driven]) > 1.1


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
    assert "nothing is heated once both are cold" in notes_of_drive(drive)[0]


def test_a_record_that_begins_cold_is_taken_whole():
    table, model = whole_record()
    for seconds in (0.0, 20.0):
        drive = model.prepare(table.at(table.time_s >= table.time_s[0] + seconds))
        assert drive.left_out_s is None
        assert notes_of_drive(drive) == []
