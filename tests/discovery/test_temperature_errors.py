"""Errors of the temperatures, as they reach the model."""

from __future__ import annotations

import numpy as np
import pytest

from tests.actuator.test_conditioning import logged
from torsight.actuator import ActuatorModel, reference_spec
from torsight.actuator.record.conditioning import Readings
from torsight.core.records import SyncedTable
from torsight.core.units import DEG
from torsight.discovery.actuator.temperature_errors import lasting_errors, lasting_sums, smooth_errors, with_errors


@pytest.mark.parametrize("lag_s", [3.0, 9.0])
def test_errors_grow_where_the_lag_of_a_sensor_is_undone(lag_s: float) -> None:
    time_s, _, read_c = logged(0.25, 0.15, lag_s=lag_s)
    room_c = 23.0 + 0.15 * np.random.default_rng(2).standard_normal(len(time_s))
    still = np.full(len(time_s), 177.6 * DEG)
    table = SyncedTable(time_s, still, np.full(len(time_s), 0.05 * DEG), read_c, room_c)
    model = ActuatorModel(reference_spec(), ("sensor_lag",))
    drive = model.prepare(table, where="record")
    values = {**model.nominal(), "lag_s": lag_s, "lag_delay_share": 0.0}
    exact_c = model.ports(drive, values).temp_a_c
    drawn = [with_errors(drive, one) for seed in range(7) for one in smooth_errors(drive, seed=seed)]
    spread_c = np.std([model.ports(one, values).temp_a_c - exact_c for one in drawn], axis=0)
    stated_c = Readings.of(time_s, read_c).behind(time_s, lag_s).sigma_c
    # The driven spring is A throughout. A standard deviation of 42 draws is known to 11 %; rows share it.
    assert np.median(spread_c / stated_c) == pytest.approx(1.0, abs=0.11)
    assert np.mean(stated_c) > np.mean(drive.temp_sigma_c)


def test_the_error_of_a_top_stays_small_behind_a_slow_sensor() -> None:
    # Without noise and digits only the tops are uncertain, which lie between two rows.
    rows_s = np.arange(0.0, 500.0, 0.25)
    read_c = 23.0 + np.where(rows_s < 160.1, 0.3 * rows_s, 48.03 * np.exp(-(rows_s - 160.1) / 60.0))
    room_c = np.full(len(rows_s), 23.0)
    still = np.full(len(rows_s), 177.6 * DEG)
    table = SyncedTable(rows_s, still, np.full(len(rows_s), 0.05 * DEG), read_c, room_c)
    model = ActuatorModel(reference_spec(), ("sensor_lag",))
    drive = model.prepare(table, where="record")
    values = {**model.nominal(), "lag_s": 3.0, "lag_delay_share": 0.0}
    exact_c = model.ports(drive, values).temp_a_c
    stated_c = Readings.of_rows(rows_s, read_c).behind(rows_s, 3.0).sigma_c
    errors = lasting_errors(drive)
    assert errors
    for error in errors:
        off_c = model.ports(with_errors(drive, error), values).temp_a_c - exact_c
        assert np.max(np.abs(off_c)) < 3.0 * np.max(stated_c)


def test_sums_of_lasting_errors_have_the_variance_of_independent_errors() -> None:
    # Two heatings of each spring, with noise: level and rise of four tops.
    rng = np.random.default_rng(3)
    rows_s = np.arange(0.0, 400.0, 0.25)
    heated_c = 23.0 + 40.0 * np.interp(rows_s % 200.0, [0.0, 40.0, 60.0, 100.0], [0.0, 1.0, 0.6, 0.0])
    a_c, b_c = heated_c, np.interp(rows_s - 100.0, rows_s, heated_c, left=23.0)
    noisy = [temp_c + 0.1 * rng.standard_normal(len(rows_s)) for temp_c in (a_c, b_c)]
    table = SyncedTable(rows_s, np.zeros(len(rows_s)), np.full(len(rows_s), 0.05 * DEG), noisy[0], noisy[1])
    drive = ActuatorModel(reference_spec()).prepare(table, where="record")
    each = np.array([error.error_c for error in lasting_errors(drive)])
    assert len(each) == 8
    sums = np.array([error.error_c for error in lasting_sums(drive)])
    assert np.mean(sums**2, axis=0) == pytest.approx(np.sum(each**2, axis=0), abs=1e-12)
    # Errors of different half-cycles are not correlated either.
    tops = [int(np.argmax(np.abs(one).max(axis=0))) for one in each[::2]]
    springs = [int(np.argmax(np.abs(one).max(axis=1))) for one in each[::2]]
    at_tops = sums[:, springs, tops]
    assert at_tops.T @ at_tops == pytest.approx(np.diag(np.sum(at_tops**2, axis=0)), abs=1e-12)
