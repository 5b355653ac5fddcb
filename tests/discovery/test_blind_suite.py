"""A few records of the blind suite, which another integrator made with other forms of the effects."""

from __future__ import annotations

from dataclasses import replace
from types import ModuleType

import numpy as np
import pytest

from tests.scripts import script
from torsight.actuator import ActuatorModel, fit_model, fitted_model, reference_spec
from torsight.core import TemperatureLog
from torsight.core.units import DEG
from torsight.discovery.discover import discover
from torsight.discovery.prediction import predict_angle
from torsight.synthetic import Record, make_record

SPEC = reference_spec()


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
    """In short: at half the paper's pace the rig is still quasi-static, and little is left to search for."""

    def half_cycles(*peaks_c: float) -> Record:
        protocol = {
            "time_factor": 0.5,
            "half_cycle": [{"spring": s, "peak_c": c} for s, c in zip("ab", peaks_c, strict=True)],
        }
        return make_record(
            {"seed": 3, "protocol": protocol, "effects": {"gravity": {"amplitude_mnm": 0.2}}}, rate_hz=0.5
        )

    record, later = half_cycles(82.0, 80.0), half_cycles(68.0, 74.0)
    report = discover(record.table, SPEC, seed=0)
    assert report.verdict == "unknown"
    assert report.effects == ()
    assert report.drivers[0][0] in cases.OUTSIDE["gravity"][1]
    log, plain = TemperatureLog(later.table.time_s, later.table.temp_a_c, later.table.temp_b_c), ActuatorModel(SPEC)
    drive = plain.prepare(record.table)
    models = report.model, fitted_model(plain, fit_model(plain, drive).values, drive)
    predicted = (predict_angle(model, log, start_angle_rad=float(later.angle_rad[0])) for model in models)
    with_law, without = (float(np.sqrt(np.mean((angle - later.angle_rad) ** 2))) for angle in predicted)
    # Held-out half-cycles say less here: of two, each would be predicted from the other spring's alone.
    assert with_law < min(1.0 * DEG, 0.25 * without)


def heated_in_turn(law: dict[str, float], *peaks_c: float) -> Record:
    halves = [{"spring": s, "peak_c": c} for s, c in zip("ab", peaks_c, strict=True)]
    scene = {"seed": 4, "protocol": {"time_factor": 0.5, "half_cycle": halves}, "effects": {"kinetics_shape": law}}
    return make_record(scene, rate_hz=0.5)


@pytest.mark.parametrize(("law", "named"), [({"bend": 0.0, "tanaka": 1.0}, True), ({"bend": -0.5}, False)])
def test_a_rig_of_another_phase_law_is_predicted_by_it(law: dict[str, float], *, named: bool) -> None:
    """Tanaka's has a name; what lags behind as a sine does has none, and is shown on heating and on cooling."""
    record, later = heated_in_turn(law, 86.0, 84.0), heated_in_turn(law, 62.0, 84.0)
    report = discover(record.table, SPEC, seed=0)
    if named:
        assert report.verdict == "identified"
        assert [effect.id for effect in report.effects] == ["exponential_law"]
        assert report.effects[0].parameters["exponential_share"].value == pytest.approx(1.0, abs=0.03)
    else:
        assert report.verdict == "unknown"
        assert {(one.port, one.driver, one.way, one.unit) for one in report.laws} == {
            ("phase", "temp_active_c", "heating", "°C"),
            ("phase", "temp_active_c", "cooling", "°C"),
        }
        for one in report.laws:
            # A sine of 0.5 / π windows, on heating of 18 °C and on cooling of 14.
            width_c = 18.0 if one.way == "heating" else 14.0
            assert one.value.min() == pytest.approx(-0.5 / np.pi * width_c, rel=0.2)
            assert (np.diff(one.driver_values) > 0.0).all()
    log = TemperatureLog(later.table.time_s, later.table.temp_a_c, later.table.temp_b_c)
    predicted = predict_angle(report.model, log, start_angle_rad=float(later.angle_rad[0]))
    assert np.sqrt(np.mean((predicted - later.angle_rad) ** 2)) < 0.7 * DEG


def test_every_case_is_another_record_and_the_parts_share_none(cases: ModuleType) -> None:
    work, report, usual = (cases.suite(part) for part in ("work", "report", "usual"))
    assert len({case.seed for case in [*work, *report, *usual]}) == len(work) + len(report) + len(usual)
    count = {kind: sum(case.kind == kind for case in report) for kind in ("clean", "single", "double", "outside")}
    assert count == {"clean": 60, "single": 72, "double": 20, "outside": 32}
