"""Predictions say how far to trust them: what is left, what the values are uncertain by, what else it could be."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from statistics import NormalDist

import numpy as np
import pytest
from actuator_programmes import programme

from tests.command_line import leave
from torsight.actuator.doubt import Alternative, Doubt
from torsight.actuator.fitted import FittedModel, read_model, write_model
from torsight.actuator.model import ActuatorModel
from torsight.actuator.spec import reference_spec
from torsight.core.errors import InputError
from torsight.core.law import LawForm
from torsight.core.parameter import REACH
from torsight.core.units import DEG
from torsight.discovery.prediction import predict_with_sigma

START_RAD = 3.0


@pytest.fixture(scope="module")
def log():
    return programme([(0, [(78.0, 0.2)]), (1, [(66.0, 0.4)])])[0]


def model_with(doubt: Doubt | None) -> FittedModel:
    plain = ActuatorModel(reference_spec())
    return FittedModel(plain, plain.nominal(), doubt=doubt)


def angle_at(model: FittedModel, log, **values: float) -> np.ndarray:
    moved = replace(model, values={**model.values, **values})
    return moved.predict(log, start_angle_rad=START_RAD).angle_rad


def test_sigma_holds_the_residual_and_what_each_axis_of_the_values_does(log) -> None:
    # Perfectly correlated: together one axis, one standard deviation each.
    size = np.array([0.05, 0.8])
    doubt = Doubt(("tau_c_mnm", "A_s_c"), np.outer(size, size), residual_deg=0.3)
    model = model_with(doubt)
    found = predict_with_sigma(model, log, start_angle_rad=START_RAD)
    own = angle_at(model, log)
    sides = [
        angle_at(model, log, tau_c_mnm=model.values["tau_c_mnm"] + s * 0.05, A_s_c=model.values["A_s_c"] + s * 0.8)
        for s in (1.0, -1.0)
    ]
    square = (0.3 * DEG) ** 2 + 0.5 * sum((side - own) ** 2 for side in sides)
    assert found.angle_rad == pytest.approx(own, abs=1e-12)
    assert found.sigma_rad == pytest.approx(np.sqrt(square), rel=1e-9)
    assert found.sigma_rad.max() > 3.0 * DEG
    assert found.sigma_rad.min() == pytest.approx(0.3 * DEG)


def test_at_rest_the_residual_is_that_of_rests(log) -> None:
    found = predict_with_sigma(model_with(Doubt((), np.zeros((0, 0)), 0.3, (), 0.1)), log, start_angle_rad=START_RAD)
    speed_deg_s = np.abs(np.gradient(found.angle_rad / DEG, log.time_s))
    resting = np.convolve(speed_deg_s > 0.002, np.ones(81), "same") == 0.0
    assert resting.sum() > 100
    assert found.sigma_rad[resting] == pytest.approx(0.1 * DEG)
    assert found.sigma_rad[speed_deg_s > 0.1] == pytest.approx(0.3 * DEG)


def test_the_start_is_as_uncertain_as_a_reading_until_a_motion_has_forgotten_it(log) -> None:
    """Both neighbours come to the angle at which the hot spring's torque alone says where the disk is."""
    found, sure = (
        predict_with_sigma(model_with(Doubt((), np.zeros((0, 0)), 0.0, reading_deg=reading)), log, start_angle_rad=2.0)
        for reading in (0.08, 0.0)
    )
    moved = np.abs(found.angle_rad - 2.0) > 1e-9
    assert int(np.argmax(moved)) > 50
    before = np.arange(len(log)) < int(np.argmax(moved))
    assert found.sigma_rad[before] == pytest.approx(0.08 * DEG, rel=1e-6)
    assert sure.sigma_rad[before].max() < 1e-12
    assert found.sigma_rad[int(np.argmin(found.angle_rad))] < 0.05 * DEG


@pytest.mark.parametrize(("share", "counts"), [(0.5, np.sqrt(0.5)), (0.1, 1.0 / REACH)])
def test_explanations_that_predict_something_else_widen_it_there(log, share: float, counts: float) -> None:
    """By their share, and as far as the interval of 95 % must reach to hold what one predicts that is credible."""
    nominal = model_with(None).values
    late = Alternative(("sensor_lag",), {**nominal, "lag_s": 8.0, "lag_delay_share": 0.0}, share=share)
    model = model_with(Doubt((), np.zeros((0, 0)), 0.1, (late,)))
    found = predict_with_sigma(model, log, start_angle_rad=START_RAD)
    ((other, its_share),) = model.alternatives()
    assert its_share == share
    apart = other.predict(log, start_angle_rad=START_RAD).angle_rad - found.angle_rad
    assert np.abs(apart).max() > 5.0 * DEG
    assert np.all(found.sigma_rad >= np.hypot(0.1 * DEG, counts * apart) * (1.0 - 1e-9))
    half, own = REACH * found.sigma_rad, 0.1 * DEG
    around = [NormalDist(middle, own) for middle in apart]
    there = np.array([one.cdf(h) - one.cdf(-h) for one, h in zip(around, half, strict=True)])
    here = np.array([2.0 * NormalDist(0.0, own).cdf(h) - 1.0 for h in half])
    assert np.min(share * there + (1.0 - share) * here) == pytest.approx(0.95, abs=1e-4)


def test_noise_of_the_temperatures_counts_where_an_incomplete_heating_ends(log) -> None:
    rng = np.random.default_rng(4)
    noisy = replace(log, temp_a_c=log.temp_a_c + 0.15 * rng.standard_normal(len(log)))
    model = model_with(Doubt((), np.zeros((0, 0)), 0.1))
    sigma_deg = predict_with_sigma(model, noisy, start_angle_rad=START_RAD).sigma_rad / DEG
    assert np.median(sigma_deg) < 0.3
    assert sigma_deg.max() > 0.5
    again = predict_with_sigma(model, noisy, start_angle_rad=START_RAD).sigma_rad / DEG
    assert np.array_equal(sigma_deg, again)


def test_rows_beside_a_jump_do_not_know_when_between_them_the_disk_let_go(log) -> None:
    spec = ActuatorModel(reference_spec(), ("static_friction",))
    values = {**spec.nominal(), "static_excess": 0.6}
    model = FittedModel(spec, values, doubt=Doubt((), np.zeros((0, 0)), residual_deg=0.1, rest_residual_deg=0.1))
    found = predict_with_sigma(model, log, start_angle_rad=START_RAD)
    # The first jump's rows; nothing else of this log makes the prediction wrong by more.
    at = int(np.argmax(np.abs(np.diff(found.angle_rad)) > 10.0 * DEG))
    jump_rad = abs(found.angle_rad[at + 1] - found.angle_rad[at])
    beside, before = found.sigma_rad[at : at + 2], found.sigma_rad[at - 6]
    assert before < 0.2 * DEG
    # Of the triangle of two roundings at least an eighth lies on one row's wrong side, at most half on the other's.
    assert (7.0 / 64.0) ** 0.5 * jump_rad < beside.max() < 0.55 * jump_rad


def test_a_value_stays_within_its_bounds_and_a_model_without_doubt_says_nothing(log) -> None:
    wide = model_with(Doubt(("tau_c_mnm",), np.array([[1e4]]), 0.1))
    found = predict_with_sigma(wide, log, start_angle_rad=START_RAD)
    assert np.isfinite(found.sigma_rad).all()
    silent = predict_with_sigma(model_with(None), log, start_angle_rad=START_RAD)
    assert np.isnan(silent.sigma_rad).all()
    assert "give fitted_model doubt=fit.doubt" in silent.summary()
    assert silent.angle_rad == pytest.approx(found.angle_rad)


def test_the_file_keeps_it(tmp_path: Path, log) -> None:
    nominal = model_with(None).values
    late = Alternative(("sensor_lag",), {**nominal, "lag_s": 8.0, "lag_delay_share": 0.0})
    model = model_with(Doubt(("tau_c_mnm", "A_s_c"), np.array([[4e-4, 1e-3], [1e-3, 0.09]]), 0.2, (late,), 0.1, 0.3))
    write_model(tmp_path / "model.json", model)
    back = read_model(tmp_path / "model.json")
    one, other = (predict_with_sigma(each, log, start_angle_rad=START_RAD).sigma_rad for each in (model, back))
    assert other == pytest.approx(one, rel=1e-9)


@pytest.mark.parametrize("key", ["residual_deg", "rest_residual_deg", "reading_deg"])
def test_a_file_that_lacks_a_part_of_the_uncertainty_is_refused(tmp_path: Path, key: str) -> None:
    write_model(tmp_path / "model.json", model_with(Doubt((), np.zeros((0, 0)), 0.1, reading_deg=0.3)))
    content = json.loads((tmp_path / "model.json").read_text())
    del content["doubt"][key]
    (tmp_path / "model.json").write_text(json.dumps(content))
    with pytest.raises(InputError, match=f"is damaged.*has no key '{key}'"):
        read_model(tmp_path / "model.json")


def test_the_command_writes_it_beside_the_angle_and_says_what_else_it_could_be(tmp_path: Path, log, capsys) -> None:
    import pandas as pd

    from torsight.core.files.storage import write_table

    nominal = ActuatorModel(reference_spec()).nominal()
    slow = Alternative(("sensor_lag",), {**nominal, "lag_s": 8.0, "lag_delay_share": 0.0})
    late = ActuatorModel(reference_spec(), ("clock_offset",))
    same = LawForm("clock_time_s", np.array([0.0, 1e4]), np.ones((2, 1)), "s", 1.0, prior=True)
    wandering = Alternative((), {**nominal, same.names[0]: 1.0}, (same,), 0.3)
    model = FittedModel(late, late.nominal(), doubt=Doubt(("tau_c_mnm",), np.array([[4e-4]]), 0.2, (slow, wandering)))
    write_model(tmp_path / "model.json", model)
    columns = {"time_s": log.time_s, "temp_a_c": log.temp_a_c, "temp_b_c": log.temp_b_c}
    write_table(tmp_path / "temps.csv", columns)
    words = ("predict", tmp_path / "model.json", tmp_path / "temps.csv", "--out", tmp_path / "later.csv")
    assert leave(*words, "--start-angle", START_RAD / DEG) == 0
    written = pd.read_csv(tmp_path / "later.csv")
    assert list(written.columns[:3]) == ["time_s", "angle_deg", "angle_sigma_deg"]
    found = predict_with_sigma(model, log, start_angle_rad=START_RAD)
    assert written["angle_sigma_deg"].to_numpy() == pytest.approx(found.sigma_rad / DEG, abs=1e-3)
    # A law of the clock's course is no other explanation than its offset.
    assert "may be another one than clock_offset: sensor_lag (50 %); angle_sigma_deg" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"names": ["tau_c_mnm", "tau_c_mnm"]}, "free values"),
        ({"names": ["tau_c"]}, "free values"),
        ({"covariance": [[1.0, 2.0]]}, "no square"),
        ({"covariance": [[1.0, 2.0], [2.0, 1.0]]}, "no covariance matrix"),
        ({"covariance": [[float("nan"), 0.0], [0.0, 1.0]]}, "no covariance matrix"),
        ({"residual_deg": -1.0}, "'residual_deg'"),
        ({"rest_residual_deg": -1.0}, "'rest_residual_deg'"),
        ({"reading_deg": -1.0}, "'reading_deg'"),
        ({"alternatives": [{"effects": ["sensor_leg"], "values": {}, "laws": [], "share": 0.5}]}, "sensor_leg"),
        ({"alternatives": [{"effects": ["sensor_lag"], "values": {}, "laws": [], "share": 0.5}]}, "lag_s"),
        ({"alternatives": [3]}, "alternatives"),
    ],
)
def test_a_damaged_one_is_named(tmp_path: Path, change: dict[str, object], told: str) -> None:
    path = tmp_path / "model.json"
    write_model(path, model_with(Doubt(("tau_c_mnm", "A_s_c"), np.diag([4e-4, 0.09]), 0.2)))
    content = json.loads(path.read_text())
    path.write_text(json.dumps({**content, "doubt": {**content["doubt"], **change}}))
    with pytest.raises(InputError, match=told):
        read_model(path)
