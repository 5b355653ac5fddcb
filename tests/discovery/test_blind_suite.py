"""A few records of the blind suite, which another integrator made with other forms of the effects."""

from __future__ import annotations

from dataclasses import replace
from types import ModuleType

import numpy as np
import pytest

from tests.scripts import script
from torsight.actuator.spec import actuator_from
from torsight.core.units import DEG
from torsight.discovery.discover import discover
from torsight.discovery.prediction import predict_angle
from torsight.synthetic.experiment import make_record
from torsight.synthetic.values import declared_from


@pytest.fixture(scope="module")
def cases() -> ModuleType:
    return script("benchmarks/discovery/cases.py")


def test_nothing_is_named_on_a_rig_whose_phase_law_is_a_little_bent(cases: ModuleType) -> None:
    record = cases.make_record(cases.Case("clean", 1, model_error=True))
    # as a camera may read it: a turn ahead
    table = replace(record.table, angle_rad=record.table.angle_rad + 2.0 * np.pi)
    report = discover(table, record.spec, seed=0)
    assert report.verdict == "none"
    assert report.effects == ()
    assert 0.05 < report.noise_floor_deg <= report.after.rmse_train_deg  # the angle's noise is 0.06 degrees
    start_rad = float(record.later_angle_rad[0]) + 2.0 * np.pi
    later = predict_angle(report.model, record.later, start_angle_rad=start_rad) - 2.0 * np.pi
    assert np.sqrt(np.mean((later - record.later_angle_rad) ** 2)) < 1.0 * DEG


def test_an_unbalanced_disk_gets_no_wrong_name_and_the_later_record_is_predicted(cases: ModuleType) -> None:
    record = cases.make_record(cases.Case("outside", 3002, ("gravity",)))
    report = discover(record.table, record.spec, seed=0)
    assert report.verdict == "unknown"
    assert report.effects == ()
    assert report.drivers[0][0] in cases.OUTSIDE["gravity"][1]
    assert report.after.rmse_held_out_deg < 0.25 * report.before.rmse_held_out_deg
    later = predict_angle(report.model, record.later, start_angle_rad=float(record.later_angle_rad[0]))
    assert np.sqrt(np.mean((later - record.later_angle_rad) ** 2)) < 1.0 * DEG


def test_both_of_two_are_named_though_alone_others_explain_more(cases: ModuleType) -> None:
    record = cases.make_record(cases.Case("double", 2206, ("sensor_lag", "viscous_friction")))
    report = discover(record.table, record.spec, seed=0)
    named = {effect.id for effect in report.effects}
    assert {"sensor_lag", "viscous_friction"} in [named, *(set(names) for names in report.alternatives)]
    assert report.after.rmse_held_out_deg < min(0.2, 0.3 * report.before.rmse_held_out_deg)
    later = predict_angle(report.model, record.later, start_angle_rad=float(record.later_angle_rad[0]))
    assert np.sqrt(np.mean((later - record.later_angle_rad) ** 2)) < 0.4 * DEG


def test_what_a_bent_phase_law_does_gets_no_second_name_and_moves_no_value(cases: ModuleType) -> None:
    record = cases.make_record(cases.Case("single", 7101009, ("eccentricity",), model_error=True))
    report = discover(record.table, record.spec, seed=0)
    assert [effect.id for effect in report.effects] == ["eccentricity"]
    assert all(abs(pull.sigmas) < 3.0 for pull in report.pulls)
    assert report.after.rmse_held_out_deg < 0.2


def test_a_second_name_is_not_given_for_a_form_that_is_known(cases: ModuleType) -> None:
    record = cases.make_record(cases.Case("single", 1508, ("stiffening",)))
    report = discover(record.table, record.spec, seed=0)
    assert [effect.id for effect in report.effects] == ["stiffening"]
    onset = report.effects[0].parameters["stiffening_onset_deg"].value
    assert abs(onset - float(record.details["stiffening"]["onset_deg"])) < 10.0


def test_a_marker_that_slips_in_the_last_half_cycle_is_named() -> None:
    """No other half-cycle shows it, so none can foretell it; the slip must not be taken for what bends the whole."""
    heated = [{"spring": s, "peak_c": 74.0, "ramp_s": 337.3, "heat_s": 357.3, "cool_s": 280.0} for s in "ab"]
    slip = {"time_s": 900.0, "step_deg": 3.0}
    made = make_record({"protocol": {"half_cycle": heated}, "effects": {"marker_slip": slip}}, seed=2, sigma_deg=0.6)
    spec = actuator_from(declared_from({}, where="test").to_toml(), where="test")
    report = discover(made.table, spec, seed=0)
    assert report.verdict == "identified"
    (found,) = report.effects
    assert found.id == "marker_slip"
    assert found.parameters["slip_deg"].value == pytest.approx(3.0, abs=0.3)
    assert found.parameters["slip_time_s"].value == pytest.approx(900.0, abs=2.0)


def test_a_mark_off_its_axis_that_leaves_little_is_named_and_the_later_record_predicted(cases: ModuleType) -> None:
    """It leaves 0.3°, three times the floor, and what values had taken up of it would be 0.6° off later."""
    record = cases.make_record(cases.Case("single", 8601011, ("eccentricity",), model_error=True))
    report = discover(record.table, record.spec, seed=0)
    assert [effect.id for effect in report.effects] == ["eccentricity"]
    later = predict_angle(report.model, record.later, start_angle_rad=float(record.later_angle_rad[0]))
    assert np.sqrt(np.mean((later - record.later_angle_rad) ** 2)) < 0.3 * DEG


@pytest.mark.parametrize(
    ("effects", "driver"),
    [
        ({"end_stop": {"angle_deg": 198.0, "stiffness_mnm_per_rad": 60.0}}, "angle_deg"),
        ({"room_drift": {"rate_c_h": 1.0, "swing_c": 0.8, "period_h": 0.5}}, "time_s"),
    ],
    ids=["stops", "room"],
)
def test_neither_a_stop_nor_a_room_that_swings_gets_a_name(effects: dict[str, dict[str, float]], driver: str) -> None:
    """The one had been called a spring that stiffens, the other a mark off its axis."""
    full, less = {"peak_c": 74.0, "ramp_s": 300.0, "heat_s": 320.0, "cool_s": 280.0}, {"peak_c": 61.0}
    heated = [{"spring": s, **full, **(less if k == 2 else {})} for k, s in enumerate("ababab")]
    made = make_record({"protocol": {"half_cycle": heated}, "effects": effects}, seed=5, sigma_deg=0.1)
    spec = actuator_from(declared_from({}, where="test").to_toml(), where="test")
    report = discover(made.table, spec, seed=0)
    assert report.verdict == "unknown"
    assert report.effects == ()
    assert report.drivers[0][0] == driver


def test_every_case_is_another_record_and_the_parts_share_none(cases: ModuleType) -> None:
    work, report, usual = (cases.suite(part) for part in ("work", "report", "usual"))
    assert len({case.seed for case in [*work, *report, *usual]}) == len(work) + len(report) + len(usual)
    count = {kind: sum(case.kind == kind for case in report) for kind in ("clean", "single", "double", "outside")}
    assert count == {"clean": 60, "single": 72, "double": 20, "outside": 32}
