"""The blind suite of random laws: its cases, what its records hold, and how its report judges answers."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks" / "discovery"))

import blind
import report as judge
from blind_hidden import FORMS, PLACES, factor_for

from torsight.actuator.model import ActuatorModel
from torsight.core.units import DEG


def test_the_parts_have_320_cases_each_and_share_none() -> None:
    work, report = blind.suite("work"), blind.suite("report")
    for part in (work, report):
        count = {kind: sum(case.kind == kind for case in part) for kind in ("clean", "law", "form", "pair")}
        assert count == {"clean": 100, "law": 120, "form": 50, "pair": 50}
        assert {case.law for case in part if case.law} == set(PLACES)
        assert {name for case in part if case.kind == "form" for name in case.effects} == set(FORMS)
    assert len({case.seed for case in [*work, *report]}) == 640


def test_a_clean_record_is_the_model_with_the_true_values_turned_by_the_zero() -> None:
    record = blind.make_record(blind.Case("clean", 6), turned=True)
    assert 3.0 <= abs(record.truth["zero_deg"]) <= 25.0
    model = ActuatorModel(record.spec)
    drive = model.prepare(record.table)
    known = {p.name for p in model.parameters}
    # A model without a zero of its own starts at the angle that it is given: that of the springs, not of the sticks.
    straight = {name: value for name, value in record.truth.items() if name in known}
    if "zero_deg" not in known:
        table = record.table
        turned = table.angle_rad - record.truth["zero_deg"] * DEG
        drive = model.prepare(type(table)(table.time_s, turned, table.angle_sigma_rad, table.temp_a_c, table.temp_b_c))
    miss_deg = np.abs(model.simulate(drive, straight).angle_rad - drive.angle_rad) / DEG
    # Incomplete heatings end where the noisy sensor says: 0.1 °C of noise, conditioned, and 26 °/°C.
    assert np.nanmedian(miss_deg) < 0.2


def test_a_hidden_law_changes_the_angle_by_the_size_that_is_noted() -> None:
    case = blind.Case("law", 7, law=("torque", "angle"))
    record, plain = blind.make_record(case, turned=False), blind.make_record(blind.Case("clean", 7), turned=False)
    assert record.law is not None
    (size,), (shown,) = record.sizes_deg.values(), record.shown_deg.values()
    change_deg = (record.table.angle_rad - plain.table.angle_rad) / DEG
    # The same noise lies on both readings.
    assert np.sqrt(np.mean(change_deg**2)) == pytest.approx(size, rel=1e-6)
    assert 0.2 < size < 11.0
    assert shown < size


def answer(**given: Any) -> dict[str, Any]:
    return {
        "truth": [], "own_names": ["position_friction"], "ports": ["friction"], "drivers_right": ["angle_deg"],
        "verdict": "unknown", "effects": [], "alternatives": [], "drivers": [], "laws": [], **given,
    }  # fmt: skip


def test_answers_are_judged_by_place_and_variable() -> None:
    here, elsewhere = [None, "friction", "angle_deg", "both", 1.0], [None, "torque", "angle_deg", "both", 1.0]
    assert judge.is_placed(answer(laws=[here, elsewhere]))
    assert not judge.is_placed(answer(laws=[elsewhere, here]))
    rivals = [["torque_angle_deg"], ["friction_angle_deg"]]
    assert judge.is_placed(answer(verdict="ambiguous", laws=[elsewhere], alternatives=rivals))
    assert judge.is_placed(answer(verdict="identified", effects=["position_friction"]))
    assert not judge.has_wrong_name(answer(effects=["position_friction"]))
    assert judge.has_wrong_name(answer(effects=["position_friction", "fatigue"]))
    assert judge.is_placed(answer(drivers=[["angle_deg", 1.0]]))
    assert not judge.is_placed(answer(laws=[elsewhere], drivers=[["angle_deg", 1.0]]))


def test_stated_probabilities_are_counted_bin_by_bin() -> None:
    bins = judge.reliability([0.97, 0.96, 1.0, 0.6], [True, False, True, False])
    assert [(count, right) for _, count, right in bins] == [(1, 0), (2, 1), (1, 1)]
    assert bins[1][0] == pytest.approx(0.965)


def test_a_strength_is_found_or_the_largest_one_is_used() -> None:
    assert 0.9 < factor_for(2.0, lambda f: f**1.5, first=0.01, most=1e3, within=0.1) ** 1.5 / 2.0 < 1.1
    assert factor_for(2.0, lambda f: 0.1 * f, first=1.0, most=5.0, within=0.1) == 5.0
