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


def test_a_rig_of_another_phase_law_shows_its_own_on_heating_and_on_cooling() -> None:
    def run(*peaks_c: float) -> Record:
        halves = [{"spring": s, "peak_c": c} for s, c in zip("aba", peaks_c, strict=False)]
        law = {"kinetics_shape": {"bend": 0.0, "tanaka": 1.0}}
        scene = {"seed": 4, "protocol": {"time_factor": 0.5, "half_cycle": halves}, "effects": law}
        return make_record(scene, rate_hz=0.5)

    record, later = run(86.0, 84.0, 60.0), run(62.0, 84.0)
    report = discover(record.table, SPEC, seed=0)
    assert report.verdict == "unknown"
    assert {(law.port, law.driver, law.way) for law in report.laws} == {
        ("phase", "temp_active_c", "heating"),
        ("phase", "temp_active_c", "cooling"),
    }
    for law in report.laws:
        # The exponential is ahead of the cosine early in its window, by most of the way to half of it.
        assert 2.0 < law.value.max() < 8.0
    log = TemperatureLog(later.table.time_s, later.table.temp_a_c, later.table.temp_b_c)
    predicted = predict_angle(report.model, log, start_angle_rad=float(later.angle_rad[0]))
    assert np.sqrt(np.mean((predicted - later.angle_rad) ** 2)) < 1.0 * DEG


def test_every_case_is_another_record_and_the_parts_share_none(cases: ModuleType) -> None:
    work, report, usual = (cases.suite(part) for part in ("work", "report", "usual"))
    assert len({case.seed for case in [*work, *report, *usual]}) == len(work) + len(report) + len(usual)
    count = {kind: sum(case.kind == kind for case in report) for kind in ("clean", "single", "double", "outside")}
    assert count == {"clean": 60, "single": 72, "double": 20, "outside": 32}
