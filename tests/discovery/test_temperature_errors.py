"""Errors of the temperatures, as they reach the model."""

from __future__ import annotations

import numpy as np
import pytest

from tests.actuator.test_conditioning import logged
from torsight.actuator import ActuatorModel, reference_spec
from torsight.actuator.record.conditioning import Readings
from torsight.core.records import SyncedTable
from torsight.core.units import DEG
from torsight.discovery.actuator.temperature_errors import draw_errors, lasting_errors, with_errors


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
    drawn = [with_errors(drive, one.smooth) for seed in range(7) for one in draw_errors(drive, seed=seed)]
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
