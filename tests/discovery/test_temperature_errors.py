"""Errors of the temperatures, as they reach the model."""

from __future__ import annotations

import numpy as np
import pytest

from tests.actuator.test_conditioning import logged
from torsight.actuator import ActuatorModel, reference_spec
from torsight.actuator.record.conditioning import Readings
from torsight.core.records import SyncedTable
from torsight.core.units import DEG
from torsight.discovery.actuator.temperature_errors import draw_errors, with_errors


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
    drawn = [with_errors(drive, one.smooth_c) for seed in range(7) for one in draw_errors(drive, seed=seed)]
    spread_c = np.std([model.ports(one, values).temp_a_c - exact_c for one in drawn], axis=0)
    stated_c = Readings.of(time_s, read_c).behind(time_s, lag_s).sigma_c
    # The driven spring is A throughout. A standard deviation of 42 draws is known to 11 %; rows share it.
    assert np.median(spread_c / stated_c) == pytest.approx(1.0, abs=0.11)
    assert np.mean(stated_c) > np.mean(drive.temp_sigma_c)
