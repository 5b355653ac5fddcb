"""The fit: values back from another integrator, priors, intervals, refusals, model file, prediction."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from actuator_programmes import programme

from tests.docs.documented import documented_names
from torsight.actuator import fit_model
from torsight.actuator.drive import wrong_frames
from torsight.actuator.fit_result import notes_of_drive, require_motion
from torsight.actuator.fitted import FittedModel, fitted_model, read_model, write_model
from torsight.actuator.model import ActuatorModel
from torsight.actuator.spec import ActuatorSpec, read_actuator, reference_spec
from torsight.cli.fit import fit_to_folder
from torsight.core.errors import InputError, NoResultError
from torsight.core.files.tables import read_merged
from torsight.core.records import SyncedTable, TemperatureLog
from torsight.core.units import DEG
from torsight.core.words.wording import CONTRADICTED_SIGMAS, EXPLAINED, RESOLUTION_DEG
from torsight.discovery.prediction import predict_with_sigma
from torsight.synthetic.experiment import make_record

HALVES = [
    {"spring": "a", "peak_c": 84.0, "ramp_s": 420.0, "heat_s": 460.0},
    {"spring": "b", "peak_c": 84.0, "ramp_s": 240.0, "heat_s": 280.0},
    {"spring": "a", "peak_c": 64.0, "ramp_s": 200.0, "heat_s": 260.0},
    {"spring": "b", "peak_c": 84.0, "ramp_s": 300.0, "heat_s": 330.0},
]


@cache
def rig_record(seed: int = 3):
    return make_record(
        {
            "seed": seed,
            "protocol": {"time_factor": 0.6, "half_cycle": HALVES},
            "sensor": {"sample_s": 0.05, "noise_c": 0.02},
        }
    )


def declared(made) -> ActuatorSpec:
    scene = made.played.scene
    return ActuatorSpec(scene.declared.flat(), dict(scene.declared.uncertainty))


@cache
def rig_fit():
    made = rig_record()
    model = ActuatorModel(declared(made))
    drive = model.prepare(made.table)
    return made, model, drive, fit_model(model, drive)


def test_values_of_another_integrator_come_back():
    made, _, _, result = rig_fit()
    true = {**made.played.scene.values.public, "zero_deg": 0.0}
    assert result.converged
    assert result.rmse_deg < 0.2
    assert result.r2 > 0.9999
    assert result.values["tau_c_mnm"] == pytest.approx(true["tau_c_mnm"], rel=0.03)
    for name in declared(rig_record()).uncertainty:
        estimate = result.estimates[name]
        assert abs(estimate.value - true[name]) < 4.5 * estimate.sigma


def test_a_record_without_noise_is_explained():
    # Two integrators differ by a hundredth of a degree, which is any number of times a noise of nothing.
    made = make_record(
        {"protocol": {"time_factor": 0.6, "half_cycle": HALVES[:2]}, "sensor": {"sample_s": 0.25, "noise_c": 0.0}},
        sigma_deg=0.0,
    )
    model = ActuatorModel(declared(made))
    found = fit_model(model, model.prepare(made.table))
    assert found.rmse_deg < RESOLUTION_DEG
    assert found.variance_ratio > EXPLAINED**2
    assert not found.attention


def test_what_is_left_is_held_against_the_noise_of_the_inputs():
    made, _, drive, good = rig_fit()
    assert good.variance_ratio < 4.0
    assert not good.attention
    spec = declared(made)
    # Read 6 °C too low, as exact: there are values with which the model moves, and none with which it fits.
    wrong = {name: spec.values[name] - 6.0 for name in ("A_s_c", "A_f_c")}
    model = ActuatorModel(ActuatorSpec({**spec.values, **wrong}))
    bad = fit_model(model, drive)
    noise_deg = good.rmse_deg / np.sqrt(good.variance_ratio)
    assert bad.variance_ratio > 0.1 * (bad.rmse_deg / noise_deg) ** 2 > 4.0
    (words,) = bad.attention
    assert bad.notes[0] == words
    assert words.startswith("This record is not explained: the residual is ")
    assert "'torsight discover' names" in words
    assert not bad.explains_nothing
    assert bad.to_json()["residual"]["variance_ratio"] == bad.variance_ratio


def test_a_characterised_value_that_the_fit_pulls_far_off_is_named():
    made, _, drive, good = rig_fit()
    spec = declared(made)
    wrong = ActuatorSpec({**spec.values, "theta_p_deg": 900.0}, spec.uncertainty)
    model = ActuatorModel(wrong)
    bad = fit_model(model, drive)
    off = {name: (bad.values[name] - wrong.values[name]) / sigma for name, sigma in spec.uncertainty.items()}
    far = [name for name, sigmas in off.items() if abs(sigmas) > CONTRADICTED_SIGMAS]
    assert far
    (words,) = (note for note in bad.attention if note.startswith("The record contradicts characterised values: "))
    assert [name for name in spec.uncertainty if f"{name} " in words] == far
    assert not any(abs(off[name]) > 1.0 for name in bad.silent_about if name in off)
    assert not any("contradicts" in note for note in good.notes)


def test_json_has_the_keys_of_the_contract():
    content = rig_fit()[3].to_json()
    assert set(documented_names("fit.json")) <= set(content)
    for key in (
        "parameters",
        "rmse_deg",
        "r2",
        "case",
        "theta_1_deg",
        "theta_2_deg",
        "theta_3_deg",
        "beta_cr_deg",
        "converged",
    ):
        assert key in content
    assert set(content["parameters"]["tau_c_mnm"]) == {"value", "sigma", "ci95", "unit", "fixed"}
    assert content["parameters"]["theta_p_deg"]["fixed"]
    assert content["case"] == "a"
    assert content["theta_2_deg"] < content["beta_cr_deg"]


def test_what_the_record_says_nothing_about_is_named():
    log, _ = programme([(0, [(80.0, 0.3)])])
    spec = ActuatorSpec(reference_spec().values, {"M_f_c": 0.5, "E_A_gpa": 2.0})
    model = ActuatorModel(spec)
    heating = log.time_s < log.time_s[int(np.argmax(log.temp_a_c))]
    angle = model.simulate(model.prepare_log(log, start_angle_rad=3.1)).angle_rad
    angle = np.where(heating, angle + 1e-3 * np.random.default_rng(0).standard_normal(len(log)), np.nan)
    table = SyncedTable(log.time_s, angle, np.full(len(log), 1e-3), log.temp_a_c, log.temp_b_c, log.heat_a, log.heat_b)
    result = fit_model(model, model.prepare(table))
    # Without a cooling nothing is known about the return, its end and the form of its law: the priors come back.
    assert {"M_f_c", "cooling_bend"} <= set(result.silent_about)
    assert not {"E_A_gpa", "tau_c_mnm"} & set(result.silent_about)
    assert result.estimates["M_f_c"].sigma == pytest.approx(0.5, rel=1e-3)


def test_wrong_frames_do_not_count_at_rest_or_in_motion():
    log, _ = programme([(0, [(80.0, 0.3)]), (1, [(80.0, 0.4)])])
    model = ActuatorModel(ActuatorSpec(reference_spec().values))
    rng = np.random.default_rng(2)
    angle = model.simulate(model.prepare_log(log, start_angle_rad=3.1)).angle_rad
    angle = angle + 1e-3 * rng.standard_normal(len(log))
    sigma = np.full(len(log), 1e-3)
    right = SyncedTable(log.time_s, angle.copy(), sigma, log.temp_a_c, log.temp_b_c, log.heat_a, log.heat_b)
    fast = np.flatnonzero(np.abs(np.gradient(angle)) > 0.02)
    wrong = rng.choice(np.arange(10, len(log) - 10, 10), 24, replace=False)
    wrong = np.union1d(wrong, rng.choice(fast[::10], 12, replace=False))
    angle[wrong] += rng.choice([-1.0, 1.0], len(wrong)) * rng.uniform(0.05, 1.0, len(wrong))
    table = replace(right, angle_rad=angle)
    found = np.flatnonzero(wrong_frames(log.time_s, angle, sigma))
    # Beside a start of motion the smallest of them, 3°, may pass.
    assert set(found) <= set(wrong)
    assert len(found) >= len(wrong) - 1
    drive = model.prepare(table)
    assert np.isnan(drive.angle_rad[found]).all()
    assert f"{len(found)} measured angles" in notes_of_drive(drive)[0]
    assert notes_of_drive(model.prepare(right)) == []
    result = fit_model(model, drive)
    assert result.values["tau_c_mnm"] == pytest.approx(0.79, abs=4 * result.estimates["tau_c_mnm"].sigma + 1e-4)


def test_a_lone_reading_that_no_wire_can_have_had_does_not_drive_the_model():
    table = rig_record().table
    rows = np.random.default_rng(4).choice(len(table) - 40, 12, replace=False) + 20
    model = ActuatorModel(reference_spec())
    clean, glitched = (
        model.prepare(replace(table, temp_a_c=temp_a_c))
        for temp_a_c in (table.temp_a_c, table.temp_a_c + np.where(np.isin(np.arange(len(table)), rows), 15.0, 0.0))
    )
    assert np.abs(glitched.temp_a_c - clean.temp_a_c).max() < 6.0 * clean.noise_c
    assert glitched.known.all()
    assert notes_of_drive(glitched) == ["Left out as wrong: 12 temperatures, which jump and jump back as no wire does"]


def test_a_sensor_without_contact_is_a_gap_of_the_log_and_not_a_cold_wire():
    table = rig_record().table
    lost = (table.time_s > 100.0) & (table.time_s < 115.0)
    assert table.temp_a_c[lost].min() > 30.0
    model = ActuatorModel(reference_spec())
    drive = model.prepare(replace(table, temp_a_c=np.where(lost, 23.0, table.temp_a_c)))
    assert drive.wrong_readings == np.count_nonzero(lost)
    np.testing.assert_array_equal(drive.known, ~lost[drive.sensors.rows])


def test_the_top_of_a_heating_between_far_readings_is_no_spike():
    time_s = np.arange(12) * 400.0
    heated = np.where(np.arange(12) % 4 == 1, 75.0, 23.0)
    log = TemperatureLog(time_s, heated, np.roll(heated, 2))
    assert ActuatorModel(reference_spec()).prepare_log(log, start_angle_rad=3.0).temp_a_c.max() == 75.0


def test_no_motion_is_refused_with_what_is_missing():
    log, _ = programme([(0, [(40.0, 0.2)])])
    angle = 3.0 + 1e-3 * np.random.default_rng(1).standard_normal(len(log))
    table = SyncedTable(log.time_s, angle, np.full(len(log), 1e-3), log.temp_a_c, log.temp_b_c)
    model = ActuatorModel(reference_spec())
    with pytest.raises(NoResultError, match=r"does not move.*40\.0 °C"):
        fit_model(model, model.prepare(table), where="r.csv")


def test_uncertain_whole_turns_are_no_lack_of_motion():
    log, _ = programme([(0, [(80.0, 0.3)])])
    model = ActuatorModel(reference_spec())
    angle = model.simulate(model.prepare_log(log, start_angle_rad=3.0)).angle_rad
    sigma = np.where(np.arange(len(log)) < 0.7 * len(log), 2.0 * np.pi, 1e-3)
    table = SyncedTable(log.time_s, angle, sigma, log.temp_a_c, log.temp_b_c)
    require_motion(model, model.prepare(table), where="r.csv")


@pytest.mark.parametrize(
    ("factor", "said"),
    [(-1.0, "turns against the spring that is heated.*exchange the columns"), (DEG, "seems to be in radians")],
)
def test_an_angle_of_the_other_sign_or_unit_is_refused(factor, said):
    log, _ = programme([(0, [(80.0, 0.3)]), (1, [(80.0, 0.3)])])
    model = ActuatorModel(reference_spec())
    angle = factor * model.simulate(model.prepare_log(log, start_angle_rad=3.0)).angle_rad
    table = SyncedTable(log.time_s, angle, np.full(len(log), 1e-4), log.temp_a_c, log.temp_b_c)
    with pytest.raises(InputError, match=said):
        fit_model(model, model.prepare(table), where="r.csv")


def test_an_angle_that_is_folded_into_one_turn_is_refused():
    log, _ = programme([(0, [(80.0, 0.3)]), (1, [(80.0, 0.3)])])
    model = ActuatorModel(reference_spec())
    angle = model.simulate(model.prepare_log(log, start_angle_rad=3.0)).angle_rad
    folded = np.angle(np.exp(1j * angle))
    assert np.ptp(angle) > 2.0 * np.pi
    table = SyncedTable(log.time_s, folded, np.full(len(log), 1e-3), log.temp_a_c, log.temp_b_c)
    with pytest.raises(InputError, match=r"folded into one turn.*a step of 3[56]\d°.*numpy\.unwrap"):
        require_motion(model, model.prepare(table), where="r.csv")
    again = SyncedTable(log.time_s, np.unwrap(folded), table.angle_sigma_rad, log.temp_a_c, log.temp_b_c)
    require_motion(model, model.prepare(again), where="r.csv")


def test_model_file_round_trip_and_prediction(tmp_path):
    _, model, drive, result = rig_fit()
    path = tmp_path / "model.json"
    write_model(path, fitted_model(model, result.values, drive, account={"rmse_deg": result.rmse_deg}))
    # The fit has values beside the model's own; as a model without them it is written without them.
    own = {name: value for name, value in result.values.items() if name in model.nominal()}
    back = read_model(path)
    assert back.cycles == (2, 2)
    log, _ = programme([(0, [(78.0, 0.2)]), (1, [(66.0, 0.4)])])
    predicted = back.predict(log, start_angle_rad=3.0)
    expected = model.simulate(model.prepare_log(log, start_angle_rad=3.0), own)
    assert predicted.angle_rad == pytest.approx(expected.angle_rad, abs=1e-12)
    assert isinstance(back, FittedModel)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"kind": "x"}, "no fitted model"),
        ({"values": {}}, "tau_c_mnm"),
        ({"effects": ["sensor_leg"]}, "sensor_leg"),
        ({"cycles": 3}, "damaged"),
    ],
)
def test_damaged_model_files(tmp_path, change, told):
    _, _, drive, result = rig_fit()
    path = tmp_path / "model.json"
    write_model(path, fitted_model(result.model, result.values, drive))
    path.write_text(json.dumps({**json.loads(path.read_text()), **change}))
    with pytest.raises(InputError, match=told):
        read_model(path)


def test_a_fitted_model_says_how_sure_its_predictions_are():
    made, _, drive, result = rig_fit()
    fitted = fitted_model(result.model, result.values, drive, doubt=result.doubt)
    log = TemperatureLog(made.table.time_s, made.table.temp_a_c, made.table.temp_b_c)
    found = predict_with_sigma(fitted, log, start_angle_rad=drive.start_angle_rad)
    assert np.nanmin(found.sigma_rad) >= 0.999 * result.rmse_deg * DEG
    assert result.doubt.names == result.free
    # A row of the drive is a mean of readings; the angle at which a prediction starts is one of them.
    given_deg = np.sqrt(np.nanmean(made.table.angle_sigma_rad**2)) / DEG
    assert result.doubt.reading_deg == pytest.approx(given_deg, rel=0.02)
    assert found.sigma_rad[0] > 0.98 * given_deg * DEG


@pytest.mark.shared_data
def test_record_of_a_rig_that_is_not_ours(shared_data, tmp_path):
    """Nothing is missing there: the plain model explains it, and its later record."""
    folder = shared_data / "records" / "plain"
    result = fit_to_folder(folder / "merged.csv", folder / "actuator.toml", out=tmp_path)
    assert (tmp_path / "fit.json").exists()
    # 0.06° of reading noise; 0.2 to 0.35° is what a fit is said to leave.
    assert result.rmse_deg < 0.2
    assert result.values["tau_c_mnm"] == pytest.approx(0.9518, rel=0.03)
    from torsight.actuator.record.logs import read_log
    from torsight.core.files.storage import read_table

    truth = read_table(folder / "test_truth.csv", required=("angle_deg",))["angle_deg"].to_numpy()
    predicted = predict_with_sigma(
        read_model(tmp_path / "model.json"), read_log(folder / "test_temps.csv"), start_angle_rad=truth[0] * DEG
    )
    off_deg = np.abs(predicted.angle_rad / DEG - truth)
    assert np.sqrt(np.mean(off_deg**2)) < 1.0
    assert np.mean(off_deg <= 1.96 * predicted.sigma_rad / DEG) > 0.9
    assert np.median(predicted.sigma_rad) < 0.5 * DEG


@pytest.mark.shared_data
@pytest.mark.parametrize(
    ("name", "effect", "truth"),
    [
        ("late_sensor", "sensor_lag", {"lag_s": (6.0, 0.2), "tau_c_mnm": (0.5601, 0.03)}),
        (
            "uneven_friction",
            "position_friction",
            {"amplitude": (0.4, 0.03), "phase_rad": (0.9, 0.05), "tau_c_mnm": (0.754, 0.03)},
        ),
    ],
)
def test_effects_on_records_of_a_rig_that_is_not_ours(shared_data, name, effect, truth):
    folder = shared_data / "records" / name
    model = ActuatorModel(read_actuator(folder / "actuator.toml"), (effect,))
    result = fit_model(model, model.prepare(read_merged(folder / "merged.csv")))
    assert result.rmse_deg < 0.2
    for key, (value, tolerance) in truth.items():
        assert result.estimates[key].value == pytest.approx(value, abs=tolerance)
