"""The next experiment: separation against plain linear algebra, programmes against the equations, and a real choice."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tests.proposed import half_cycles
from torsight.actuator.drive import prepare_log
from torsight.actuator.model import ActuatorModel
from torsight.actuator.spec import ActuatorSpec, actuator_from
from torsight.core.parameter import Parameter
from torsight.core.records import SyncedTable, TemperatureLog
from torsight.discovery.actuator_problem import ActuatorProblem
from torsight.discovery.design.next_experiment import NextExperiment, next_experiment
from torsight.discovery.design.programme import HalfCyclePlan, Heat, Leg, Programme
from torsight.discovery.design.programme_menu import Habits, menu
from torsight.discovery.design.separation import Rival, least_gain, linear_gains, refitted_gains
from torsight.discovery.inference.explanation import Explanation, Field
from torsight.discovery.inference.fitting import Fitter
from torsight.discovery.inference.likelihood import Likelihood
from torsight.discovery.inference.noise import Scales, Stretches, information
from torsight.discovery.weight import Weight
from torsight.synthetic.experiment import make_record
from torsight.synthetic.rig.rig_values import declared_from

NAMES = ("a", "b", "c")
PRIOR = (1.0, 0.5, 2.0)


def rival(name: str, x: np.ndarray) -> Rival:
    parameters = tuple(
        Parameter(name=f"{name}_{key}", value=0.0, unit="", sigma=sigma)
        for key, sigma in zip(NAMES, PRIOR, strict=True)
    )
    return Rival((name,), (name,), parameters, x)


def test_a_gain_is_what_stacked_least_squares_leaves() -> None:
    rng = np.random.default_rng(4)
    design = {name: rng.standard_normal((40, 3)) for name in ("one", "two")}
    weight = rng.uniform(0.2, 3.0, 40)
    both = [rival(name, rng.standard_normal(3)) for name in design]

    def predict(values: dict[str, float], one: Rival) -> np.ndarray:
        (name,) = one.effects
        return design[name] @ np.array([values[f"{name}_{key}"] for key in NAMES])

    for gains in (linear_gains(predict, both, Weight.of(weight)), refitted_gains(predict, both, Weight.of(weight))):
        for i, j in ((0, 1), (1, 0)):
            shown = design[both[i].name[0]] @ both[i].x
            matrix = np.vstack([design[both[j].name[0]] * np.sqrt(weight)[:, None], np.diag(1.0 / np.array(PRIOR))])
            target = np.concatenate([shown * np.sqrt(weight), np.zeros(3)])
            left = float(np.linalg.lstsq(matrix, target, rcond=None)[1][0])
            own = float(np.sum((both[i].x / np.array(PRIOR)) ** 2))
            assert gains[i, j] == pytest.approx(left - own, rel=1e-4)
        assert np.isnan(np.diag(gains)).all()


def test_what_holds_the_true_explanation_can_only_be_told_from_the_other_side() -> None:
    small = rival("one", np.zeros(3))
    event = replace(small, name=("bump",), effects=())

    def predict(values: dict[str, float], one: Rival) -> np.ndarray:
        return np.full(5, len(one.effects) + 0.0 * sum(values.values()))

    gains = linear_gains(predict, [small, event], Weight.of(np.ones(5)))
    assert np.isnan(gains[1, 0])
    assert gains[0, 1] == pytest.approx(5.0)
    assert least_gain(np.full((2, 2), np.nan)) == 0.0


LOSS_PER_S, BETWEEN_PER_S, ROOM_C = 0.021, 0.0015, 22.0


def two_wires(*, lag_s: float = 0.0) -> TemperatureLog:
    """Return A led from 22 to 75 °C in 300 s, then free; B free throughout; read late by a first-order sensor."""
    rate = 53.0 / 300.0

    def slope(t: float, state: np.ndarray) -> list[float]:
        a, b, read_a, read_b = state
        free = -LOSS_PER_S * (a - ROOM_C) + BETWEEN_PER_S * (b - a)
        lagged = [(a - read_a) / lag_s, (b - read_b) / lag_s] if lag_s else [0.0, 0.0]
        return [rate if t < 300.0 else free, -LOSS_PER_S * (b - ROOM_C) + BETWEEN_PER_S * (a - b), *lagged]

    time_s = np.arange(0.0, 600.0, 0.5)
    found = solve_ivp(slope, (0.0, 600.0), [ROOM_C] * 4, t_eval=time_s, max_step=1.0, rtol=1e-8)
    first = 2 if lag_s else 0
    return TemperatureLog(time_s, found.y[first], found.y[first + 1], time_s < 300.0, time_s < 0.0)


def test_the_loss_of_heat_is_learned_from_a_record() -> None:
    heat = Heat.of(prepare_log(two_wires(), start_angle_rad=0.0))
    assert heat.to_room_per_s == pytest.approx(LOSS_PER_S, rel=0.06)
    assert heat.between_per_s == pytest.approx(BETWEEN_PER_S, rel=0.25)
    # The corner of a led wire is sharp; what is left is the conditioning's own window.
    assert heat.rounding_s < 2.0
    assert Heat.of(prepare_log(two_wires(lag_s=6.0), start_angle_rad=0.0)).rounding_s == pytest.approx(6.0, rel=0.35)


def test_a_programme_does_what_its_segments_say() -> None:
    heat = Heat(LOSS_PER_S, BETWEEN_PER_S, ROOM_C, 1.0)
    plan = HalfCyclePlan("", (Leg(60.0, 0.2, 90.0), Leg(40.0, 5.0)), 200.0)
    played = Programme((plan, plan)).play(heat)
    lasted_s = 20.0 + sum(segment["duration_s"] for segment in played.segments)
    assert played.time_s[-1] == pytest.approx(lasted_s, abs=1.0)
    assert [segment["action"] for segment in played.segments] == ["heat", "lead down", "cool"] * 2
    on = played.driven == 0
    rate = np.gradient(played.temp_a_c, played.time_s)
    assert np.median(rate[on & (played.time_s > 40.0) & (played.time_s < 200.0)]) == pytest.approx(0.2, rel=1e-6)
    # A heater only heats: the way down at 5 °C/s is as fast as the wire loses its heat, no faster.
    assert rate.min() > -(LOSS_PER_S + BETWEEN_PER_S) * (60.0 - ROOM_C)
    assert played.temp_b_c[on].max() < 30.0
    drive = played.drive(start_angle_rad=0.3)
    assert drive.cycles.springs == (0, 1)
    assert set(menu(Habits(0.1, 0.2, 75.0, 55.0, 60.0), heat)) >= {"usual", "slow", "fast", "partial", "stairs"}


def record(effects: dict[str, dict[str, float]], protocol: list[dict[str, object]]) -> SyncedTable:
    scene = {
        "motion": {"kind": "rig"},
        "protocol": {"half_cycle": protocol},
        "effects": effects,
    }
    return make_record(scene, seed=5, sigma_deg=0.15, rate_hz=1.0).table


def field_of(table: SyncedTable, spec: ActuatorSpec, names: tuple[str, ...]) -> tuple[ActuatorProblem, Field]:
    """Return the joint fits of these effects alone, weighed with a noise that is given."""
    problem = ActuatorProblem(ActuatorModel(spec).prepare(table), spec)
    stretches, scales = Stretches.of(problem), Scales(0.1, 0.1, 4.0)
    fitter = Fitter(problem, information(stretches, scales, problem.sigma))
    base = fitter.base()
    fits = [base, *(fitter.extend(base, name) for name in names)]
    likelihood = Likelihood.of(stretches, np.hypot(problem.sigma, 0.1), 4.0)
    found = {fit.effects: Explanation(fitter, fit, (), likelihood, -0.5 * fit.cost) for fit in fits}
    return problem, Field(likelihood, stretches, found)


def test_the_proposed_programme_tells_a_late_sensor_from_a_late_clock_whichever_is_true() -> None:
    spec = actuator_from(declared_from({}, where="test").to_toml(), where="test")
    names = ("clock_offset", "sensor_lag")
    usual = [{"spring": s, "peak_c": 75.0, "ramp_s": 350.0, "heat_s": 370.0, "cool_s": 250.0} for s in "ab"]
    problem, field = field_of(record({"sensor_lag": {"lag_s": 5.0}}, usual), spec, names)
    rivals = [field.explanations[(name,)] for name in names]
    found = next_experiment(problem, field, rivals, needed_gain=12.0)
    assert isinstance(found, NextExperiment)
    assert found.gain > 12.0 > found.repeat_gain
    assert {segment["spring"] for segment in found.segments} == {"a", "b"}
    assert found.duration_s == pytest.approx(found.columns["time_s"][-1])
    assert {"clock_offset_deg", "sensor_lag_deg", "heat_a"} <= set(found.columns)
    assert found.text in str(found.to_json())
    # What stands in next_experiment.csv is a temperature log like any other: conditioned, it leads to the same angles.
    columns = {name: np.asarray(values) for name, values in found.columns.items()}
    log = TemperatureLog(
        columns["time_s"], columns["temp_a_c"], columns["temp_b_c"], columns["heat_a"] > 0, columns["heat_b"] > 0
    )
    drive = prepare_log(log, start_angle_rad=problem.drive.start_angle_rad)
    plain = problem.model(("sensor_lag",)).simulate(drive, rivals[1].fit.values).angle_rad
    assert np.median(np.abs(plain * 180.0 / np.pi - columns["sensor_lag_deg"])) < 0.5
    again = next_experiment(problem, field, rivals, needed_gain=12.0)
    assert again.to_json() == found.to_json()
    protocol = half_cycles(found.segments)
    for truth in ({"sensor_lag": {"lag_s": 5.0}}, {"clock_offset": {"offset_s": 5.0}}):
        _, new = field_of(record(truth, protocol), spec, names)
        cost = {name: new.explanations[(name,)].cost for name in names}
        (true,) = truth
        (other,) = set(names) - {true}
        assert cost[other] > cost[true] + 12.0
