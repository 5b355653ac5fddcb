"""A film cannot tell 185° from −175°; the model must not care."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from torsight.actuator.fitted import FittedModel, fitted_model, read_model, write_model
from torsight.actuator.model import ActuatorModel
from torsight.actuator.spec import actuator_from
from torsight.core.errors import ConfigError, InputError
from torsight.core.files.storage import read_toml
from torsight.core.records import SyncedTable, TemperatureLog
from torsight.core.units import DEG


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> ActuatorModel:
    from torsight.cli.init import init

    folder = tmp_path_factory.mktemp("init")
    init(folder)
    return ActuatorModel(actuator_from(read_toml(folder / "actuator.toml"), where="actuator.toml"))


@pytest.fixture(scope="module")
def record(model: ActuatorModel) -> SyncedTable:
    """One full cycle that starts at 185°, simulated."""
    time_s = np.arange(0.0, 1200.0, 0.5)
    heat = np.interp(time_s, [0, 30, 280, 320, 600], [23, 23, 80, 80, 23])
    rest = np.interp(time_s, [600, 630, 880, 920, 1200], [23, 23, 80, 80, 23])
    log = TemperatureLog(time_s, heat, rest)
    start_rad = 185.0 * DEG
    drive = model.prepare_log(log, start_angle_rad=start_rad)
    values = {parameter.name: parameter.value for parameter in model.parameters}
    angle_rad = model.simulate(drive, values).angle_rad
    return SyncedTable(time_s, angle_rad, np.full_like(time_s, 1e-3), heat, rest)


@pytest.mark.parametrize("turns", [-1, 0, 1, 2])
def test_a_reading_whole_turns_off_gives_the_same_drive(model: ActuatorModel, record: SyncedTable, turns: int) -> None:
    off = replace(record, angle_rad=record.angle_rad + 2.0 * np.pi * turns)
    drive = model.prepare(off)
    assert drive.turns == turns
    np.testing.assert_allclose(drive.angle_rad, record.angle_rad, atol=1e-12)


def test_a_prediction_goes_on_in_the_turn_of_the_record(model: ActuatorModel, record: SyncedTable, tmp_path) -> None:
    values = {parameter.name: parameter.value for parameter in model.parameters}
    off = replace(record, angle_rad=record.angle_rad - 2.0 * np.pi)
    fitted = fitted_model(model, values, model.prepare(off))
    write_model(tmp_path / "model.json", fitted)
    again: FittedModel = read_model(tmp_path / "model.json")
    log = TemperatureLog(record.time_s, record.temp_a_c, record.temp_b_c)
    predicted = again.predict(log, start_angle_rad=float(off.angle_rad[0])).angle_rad
    np.testing.assert_allclose(predicted, off.angle_rad, atol=1e-9)
    # a record that starts where only the other turn can be meant is taken so
    plain = again.predict(log, start_angle_rad=float(record.angle_rad[0])).angle_rad
    np.testing.assert_allclose(plain, record.angle_rad, atol=1e-9)


@pytest.mark.parametrize(("turns", "refused", "taken"), [(0, 600.0, 240.0), (0, -545.0, -185.0), (1, 910.0, 550.0)])
def test_a_start_that_is_further_than_the_springs_are_wound_is_no_whole_turn(
    model: ActuatorModel, record: SyncedTable, turns: int, refused: float, taken: float
) -> None:
    values = {parameter.name: parameter.value for parameter in model.parameters}
    ahead = replace(record, angle_rad=record.angle_rad + 2.0 * np.pi * turns)
    fitted = fitted_model(model, values, model.prepare(ahead))
    log = TemperatureLog(record.time_s, record.temp_a_c, record.temp_b_c)
    with pytest.raises(ConfigError, match="further than the springs are wound"):
        fitted.predict(log, start_angle_rad=refused * DEG)
    own = model.simulate(model.prepare_log(log, start_angle_rad=(taken - 360.0 * turns) * DEG), values)
    predicted = fitted.predict(log, start_angle_rad=taken * DEG)
    np.testing.assert_allclose(predicted.simulation.angle_rad, own.angle_rad, atol=1e-9)
    assert predicted.angle_rad[0] == pytest.approx(taken * DEG)


@pytest.mark.parametrize("start", ["3.1", None, np.nan, [1.0], np.zeros(2)])
def test_a_start_angle_is_a_number(model: ActuatorModel, record: SyncedTable, start: Any) -> None:
    log = TemperatureLog(record.time_s, record.temp_a_c, record.temp_b_c)
    for predict in (FittedModel(model, model.nominal()).predict, model.prepare_log):
        with pytest.raises(ConfigError, match=r"first row: the start angle is no number; found .*; allowed a number"):
            predict(log, start_angle_rad=start)


def test_what_wound_the_springs_at_home_holds_for_logs_that_start_there(
    model: ActuatorModel, record: SyncedTable
) -> None:
    wound = ActuatorModel(model.spec, ("home_torque",))
    values = {parameter.name: parameter.value for parameter in wound.parameters}
    log = TemperatureLog(record.time_s, record.temp_a_c, record.temp_b_c)
    home_rad, elsewhere_rad = float(record.angle_rad[0]), 60.0 * DEG

    def predicted(home_hold: float, start_angle_rad: float):
        fitted = fitted_model(wound, {**values, "home_hold": home_hold}, wound.prepare(record))
        return fitted.predict(log, start_angle_rad=start_angle_rad).angle_rad

    assert np.max(np.abs(predicted(0.3, home_rad) - predicted(1.0, home_rad))) > 1.0 * DEG
    np.testing.assert_array_equal(predicted(0.3, elsewhere_rad), predicted(1.0, elsewhere_rad))


@pytest.mark.parametrize("degrees", [135.0, -135.0, 1e6])
def test_degrees_are_not_taken_for_radians(model: ActuatorModel, record: SyncedTable, degrees: float) -> None:
    values = {parameter.name: parameter.value for parameter in model.parameters}
    fitted = fitted_model(model, values, model.prepare(record))
    log = TemperatureLog(record.time_s, record.temp_a_c, record.temp_b_c)
    with pytest.raises(ConfigError, match="were these degrees"):
        fitted.predict(log, start_angle_rad=degrees)
    with pytest.raises(InputError, match=r"turns further than the springs are wound.*give radians"):
        model.prepare(replace(record, angle_rad=record.angle_rad / DEG))
    with pytest.raises(InputError, match="not in milliseconds"):
        model.prepare_log(replace(log, time_s=1e3 * log.time_s), start_angle_rad=1.0)
    with pytest.raises(InputError, match="not in °F or kelvin"):
        model.prepare_log(replace(log, temp_a_c=1.8 * log.temp_a_c + 32.0), start_angle_rad=1.0)


def test_values_in_another_unit_are_refused_where_the_spec_is_made(model: ActuatorModel) -> None:
    with pytest.raises(ConfigError, match=r"'E_A_gpa' is out of range.*give it in GPa, not Pa or MPa"):
        replace(model.spec, values={**model.spec.values, "E_A_gpa": 60e9})
    with pytest.raises(ConfigError, match="has no key 'A_s_c'"):
        replace(model.spec, values={k: v for k, v in model.spec.values.items() if k != "A_s_c"}, uncertainty={})


def test_what_the_springs_do_tells_the_turn_of_a_record_that_moves_to_one_side_only(model: ActuatorModel) -> None:
    # The middle of readings from 226° to 265° would be a turn lower.
    time_s = np.arange(0.0, 1200.0, 0.5)
    cold = np.full_like(time_s, 23.0)
    heat = np.interp(time_s, [0, 30, 280, 320, 600, 630, 880, 920, 1200], [23, 23, 74, 74, 23, 23, 90, 90, 23])
    drive = model.prepare_log(TemperatureLog(time_s, cold, heat), start_angle_rad=226.0 * DEG)
    angle_rad = model.simulate(drive).angle_rad
    for turns in (-1, 0, 1):
        read_rad = angle_rad + 2.0 * np.pi * turns
        prepared = model.prepare(SyncedTable(time_s, read_rad, np.full_like(time_s, 1e-3), cold, heat))
        assert prepared.turns == turns
        np.testing.assert_allclose(prepared.angle_rad, angle_rad, atol=1e-9)


def test_angles_that_were_read_while_no_temperature_was_known_tell_no_turn(
    model: ActuatorModel, record: SyncedTable
) -> None:
    angle_rad, temp_a_c = np.full_like(record.angle_rad, np.nan), record.temp_a_c.copy()
    angle_rad[:30], temp_a_c[:200] = record.angle_rad[:30], np.nan
    prepared = model.prepare(replace(record, angle_rad=angle_rad, temp_a_c=temp_a_c))
    assert not prepared.measured.any()
    assert prepared.turns == round(record.angle_rad[0] / (2.0 * np.pi))
