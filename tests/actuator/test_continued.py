"""A later log that starts where the record ended goes on from how the record left the springs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from actuator_programmes import programme

from torsight.actuator.doubt import Doubt
from torsight.actuator.fitted import FittedModel, fitted_model, read_model, write_model
from torsight.actuator.model import ActuatorModel
from torsight.actuator.spec import reference_spec
from torsight.core.records import TemperatureLog
from torsight.core.units import DEG
from torsight.discovery.prediction import predict_with_sigma

FIRST = [(0, [(80.0, 0.2)]), (1, [(80.0, 0.2)]), (0, [(60.0, 0.2)])]
LATER = [(1, [(58.0, 0.3)]), (0, [(76.0, 0.2)]), (1, [(80.0, 0.3)])]
START_DEG = 176.0


def part_of(log: TemperatureLog, rows: slice) -> TemperatureLog:
    return TemperatureLog(
        log.time_s[rows] - log.time_s[rows][0],
        log.temp_a_c[rows],
        log.temp_b_c[rows],
        heat_a=log.heat_a[rows],
        heat_b=log.heat_b[rows],
    )


def warmed(log: TemperatureLog) -> TemperatureLog:
    """Return a log in which the other spring gets nearly as warm."""
    a, b = log.temp_a_c - 23.0, log.temp_b_c - 23.0
    return replace(log, temp_a_c=23.0 + a + 0.8 * b, temp_b_c=23.0 + b + 0.8 * a)


def whole_and_continued(
    effects: tuple[str, ...], values: dict[str, float], *, warm: bool, first=FIRST, later=LATER, start_deg=START_DEG
):
    """Return the later part of one long simulation, the model of its first part, and the later log."""
    model = ActuatorModel(reference_spec(), effects)
    log, temps = programme([*first, *later])
    log = warmed(log) if warm else log
    split = sum(len(own) for own in temps[: len(first)])
    whole = model.simulate(model.prepare_log(log, start_angle_rad=start_deg * DEG), values)
    first = model.prepare_log(part_of(log, slice(split)), start_angle_rad=start_deg * DEG)
    first = replace(first, angle_rad=whole.angle_rad[:split])
    fitted = fitted_model(model, {**model.nominal(), **values}, first)
    return whole.angle_rad[split - 1 :], fitted, part_of(log, slice(split - 1, None))


@pytest.mark.parametrize(
    ("effects", "values", "warm"),
    [
        ((), {}, False),
        (("fatigue",), {"fatigue_per_cycle": 0.02}, False),
        (("heat_crosstalk",), {"passive_share": 1.0, "heat_leak": 0.1}, True),
        (("stiffening",), {}, False),
    ],
)
def test_a_log_from_the_records_end_goes_on_as_one_long_record(effects, values, warm, tmp_path):
    whole, fitted, later = whole_and_continued(effects, values, warm=warm)
    found = fitted.predict(later, start_angle_rad=whole[0])
    np.testing.assert_allclose(found.angle_rad, whole, atol=1e-6)
    # The rule for homes knows nothing of a passive spring that had got warm.
    by_rule = replace(fitted, end=None).predict(later, start_angle_rad=whole[0])
    assert (np.abs(by_rule.angle_rad - whole).max() > 0.5 * DEG) == warm
    write_model(tmp_path / "model.json", fitted)
    again = read_model(tmp_path / "model.json").predict(later, start_angle_rad=whole[0])
    assert again.angle_rad.tolist() == pytest.approx(found.angle_rad.tolist(), abs=1e-12)


def test_the_state_before_the_record_is_over_at_its_end():
    """The record ends within 2° of where it began, in the state of its own last cycle."""
    values = {"home_hold": 0.3, "start_loss_a_deg": 8.0, "start_loss_b_deg": -5.0}
    effects = ("home_torque", "start_winding")
    whole, fitted, later = whole_and_continued(
        effects, values, warm=False, first=FIRST[:2], later=LATER[1:], start_deg=177.0
    )
    assert abs(whole[0] - 177.0 * DEG) < 2.0 * DEG
    np.testing.assert_allclose(fitted.predict(later, start_angle_rad=whole[0]).angle_rad, whole, atol=1e-6)


def test_a_log_from_the_records_home_or_from_elsewhere_does_not_go_on():
    whole, fitted, later = whole_and_continued((), {}, warm=False)
    by_rule = replace(fitted, end=None)
    for start_rad in (START_DEG * DEG, whole[0] + 3.0 * DEG):
        found, expected = (m.predict(later, start_angle_rad=start_rad).angle_rad for m in (fitted, by_rule))
        assert found.tolist() == expected.tolist()


def test_a_record_that_ends_hot_leaves_nothing():
    model = ActuatorModel(reference_spec())
    log, temps = programme(FIRST[:1])
    hot = int(np.argmax(temps[0]))
    drive = model.prepare_log(part_of(log, slice(hot)), start_angle_rad=START_DEG * DEG)
    drive = replace(drive, angle_rad=model.simulate(drive).angle_rad)
    fitted = fitted_model(model, model.nominal(), drive)
    assert isinstance(fitted, FittedModel)
    assert fitted.end is None


def test_a_film_that_ends_before_the_log_leaves_the_state_of_the_logs_end():
    whole, fitted, later = whole_and_continued((), {}, warm=False)
    model = ActuatorModel(reference_spec())
    log, temps = programme([*FIRST, *LATER])
    drive = model.prepare_log(part_of(log, slice(sum(len(own) for own in temps[:3]))), start_angle_rad=START_DEG * DEG)
    read_rad = model.simulate(drive).angle_rad.copy()
    # While the last spring still cools, and turns the disk.
    read_rad[np.flatnonzero(np.abs(np.diff(read_rad)) > 1e-4)[-1] :] = np.nan
    shorter = fitted_model(model, model.nominal(), replace(drive, angle_rad=read_rad))
    assert shorter.end is not None
    assert fitted.end is not None
    assert shorter.end.angle_rad == pytest.approx(fitted.end.angle_rad, abs=1e-9)
    np.testing.assert_allclose(shorter.predict(later, start_angle_rad=whole[0]).angle_rad, whole, atol=1e-6)


def test_sigma_holds_the_unknown_state_of_a_log_that_starts_elsewhere():
    effects = ("home_torque", "start_winding")
    whole, fitted, later = whole_and_continued(effects, {}, warm=False)
    fitted = replace(fitted, doubt=Doubt((), np.zeros((0, 0)), residual_deg=0.1))
    known = predict_with_sigma(fitted, later, start_angle_rad=whole[0])
    assert known.sigma_rad == pytest.approx(np.full(len(whole), 0.1 * DEG), rel=1e-6)
    start_rad = whole[0] - 10.0 * DEG
    found = predict_with_sigma(fitted, later, start_angle_rad=start_rad)
    # A record of its own with the other winding: one standard deviation of the prior, 10°.
    other = replace(fitted, values={**fitted.values, "start_loss_b_deg": 10.0}, start_angle_rad=None, end=None)
    off_rad = np.abs(other.predict(later, start_angle_rad=start_rad).angle_rad - found.angle_rad)
    assert off_rad.max() > 1.0 * DEG
    assert np.all(found.sigma_rad >= 0.7 * off_rad)
