"""Laws measured by their marginal likelihood: where the linear model leads, and what the model itself confirms."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from linear_cases import machine, signals

from torsight.actuator.model import ActuatorModel
from torsight.actuator.spec import actuator_from
from torsight.core.progress import silent
from torsight.discovery.actuator_problem import ActuatorProblem
from torsight.discovery.inference.law.measure import measure_law
from torsight.discovery.inference.search import Search
from torsight.discovery.inference.set_fits import SetFits
from torsight.discovery.settings import Settings
from torsight.synthetic.experiment import make_record
from torsight.synthetic.rig.rig_values import declared_from


def rig(effects: dict[str, Any], *peaks_c: float, seed: int, as_declared: bool = True) -> ActuatorProblem:
    """Return a rig with effects, whose springs are heated in turn to these temperatures at several rates."""
    ramps_s = (150.0, 220.0, 300.0, 180.0, 200.0, 150.0)
    half_cycles = [
        {"spring": spring, "peak_c": peak_c, "ramp_s": ramp_s, "heat_s": ramp_s + 20.0, "cool_s": 250.0}
        for spring, ramp_s, peak_c in zip("ababab", ramps_s, peaks_c, strict=False)
    ]
    scene = {
        "motion": {"kind": "rig"},
        "rig": {"as_declared": as_declared},
        "protocol": {"half_cycle": half_cycles},
        "effects": effects,
    }
    spec = actuator_from(declared_from({}, where="test").to_toml(), where="test")
    return ActuatorProblem(ActuatorModel(spec).prepare(make_record(scene, seed=seed).table), spec)


def sticking_rig() -> tuple[ActuatorProblem, dict[str, float]]:
    """Return a rig whose friction grows at rest, and the values of a model that has that."""
    problem = rig({"static_friction": {"excess": 0.5, "ageing_s": 60.0}}, 75.0, 75.0, 75.0, 75.0, seed=5)
    own = {"static_excess": 0.5, "static_time_s": 60.0, "static_power": 1.0, "static_swing": 0.0}
    return problem, {p.name: p.value for p in problem.parameters} | own


def test_a_law_beside_a_late_clock_is_followed_where_the_linear_model_fails() -> None:
    effects = {
        "position_friction": {"amplitude": 0.6, "phase_rad": 1.5, "form": "flattened"},
        "clock_offset": {"offset_s": -2.5},
    }
    problem = rig(effects, 75.0, 75.0, 75.0, 75.0, 58.0, 60.0, seed=6, as_declared=False)
    fits, law = SetFits(problem, progress=silent), next(one for one in problem.laws if one.id == "friction_angle_deg")
    plain = fits.plain()
    # The law can do what its usual form does, and more. Where a step may end between two members of the bank, at a
    # curve that is charged to neither of them, it gained 16 units more than the form, else 24 to 46.
    form = fits.with_effect(plain, "position_friction")
    assert fits.with_law(plain, law).log_evidence > form.log_evidence + 20.0


def test_what_a_set_is_worth_does_not_depend_on_which_of_its_laws_was_measured_first() -> None:
    s = signals()
    made = machine(0.3 * s["position"] + 0.4 * np.sin(s["warm"] - 20.0), seed=5, candidates={}, sigma=0.05)
    search, laws = Search(made, settings=Settings(), progress=silent), {law.id: law for law in made.laws}
    plain = search.fits.plain()
    found = {}
    for first, second in (("position", "warm"), ("warm", "position")):
        found[first] = search.fits.with_law(search.fits.with_law(plain, laws[first]), laws[second])
    # Alone the one of them made up for the other, as a function that is less smooth.
    assert found["position"].log_evidence < found["warm"].log_evidence - 10.0
    better = search.fits.in_better_form(found["position"])
    assert better.log_evidence == pytest.approx(found["warm"].log_evidence, abs=1.0)
    assert better.laws[0].place == found["warm"].laws[1].place


def test_a_law_begins_as_its_usual_form_and_does_then_what_that_does() -> None:
    problem, values = sticking_rig()
    law = next(one for one in problem.laws if one.id == "friction_dwell_s")
    curve = problem.curve_of("static_friction", law, values)
    assert curve == pytest.approx(0.5 * (1.0 - np.exp(-(10.0**law.nodes - 1.0) / 60.0)), abs=1e-3)
    assert problem.curve_of("creep", law, values) is None
    assert problem.curve_of("friction_dwell_s", law, values) is None
    likelihood = SetFits(problem, progress=silent).plain().likelihood
    start = {p.name: p.value for p in problem.parameters}
    nothing, form = (measure_law(problem, law, start, likelihood=likelihood, curve=given) for given in (None, curve))
    # Without the jumps of 20° and more that derivatives at nothing do not see.
    assert form.log_evidence > nothing.log_evidence + 100.0
