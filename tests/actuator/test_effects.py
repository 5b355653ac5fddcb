"""All effects: null equals the plain model; own parameters come back from a rig with another integrator."""

from __future__ import annotations

import importlib
import math
import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from actuator_programmes import programme

from torsight.actuator import fit_model
from torsight.actuator.effects import always_fitted, chosen_effects, load_effects
from torsight.actuator.model import ActuatorModel
from torsight.actuator.ports import REACH_RAD, History
from torsight.actuator.quantities import OF_THE_ACTUATOR, with_title
from torsight.actuator.simulation import RELEASE_SCATTER
from torsight.actuator.spec import ActuatorSpec, reference_spec
from torsight.core.errors import ConfigError
from torsight.core.records import TemperatureLog
from torsight.core.units import DEG
from torsight.synthetic.experiment import make_record

CONTRACT = (
    "sensor_lag", "sensor_gain", "clock_offset", "heat_crosstalk", "nonuniform_temperature", "coil_friction",
    "viscous_friction", "position_friction", "stiffening", "eccentricity", "fatigue", "marker_slip",
)  # fmt: skip
HALVES = [
    {"spring": "a", "peak_c": 84.0, "ramp_s": 420.0, "heat_s": 460.0},
    {"spring": "b", "peak_c": 84.0, "ramp_s": 240.0, "heat_s": 280.0},
    {"spring": "a", "peak_c": 64.0, "ramp_s": 200.0, "heat_s": 260.0},
    {"spring": "b", "peak_c": 84.0, "ramp_s": 560.0, "heat_s": 590.0},
    {"spring": "a", "peak_c": 84.0, "ramp_s": 220.0, "heat_s": 260.0},
]
RISE_RAD = math.radians(100.0)
DECLARED = load_effects()
# What the rig has, and the same in the words of the effect file: value and how near it must come (relative, absolute).
TRUTH = {
    "sensor_lag": ({"lag_s": 5.0}, {"lag_s": (5.0, 0.06, 0.0)}),
    "unlike_lags": (
        {"lag_a_s": 3.0, "lag_b_s": 6.0},
        {"lag_a_s": (3.0, 0.06, 0.0), "lag_b_s": (6.0, 0.06, 0.0)},
    ),
    "sensor_gain": ({"gain": 0.95}, {"contact_gain": (0.95, 0.006, 0.0)}),
    "clock_offset": ({"offset_s": 2.0}, {"clock_offset_s": (2.0, 0.08, 0.0)}),
    "heat_crosstalk": ({"conductance_w_per_k": 0.012}, {}),
    "nonuniform_temperature": (
        {"cooler_c": 8.0, "share": 0.25},
        {"cool_share": (0.25, 0.1, 0.0), "cool_drop_c": (8.0, 0.1, 0.0)},
    ),
    "coil_friction": (
        {"rise_mnm": 0.3, "onset_deg": 640.0},
        {"coil_friction_mnm_per_rad": (0.3 / RISE_RAD, 0.15, 0.0), "coil_onset_deg": (640.0, 0.0, 25.0)},
    ),
    "viscous_friction": ({"viscous_mnm_s_per_rad": 8.0}, {"viscous_mnm_s_per_rad": (8.0, 0.15, 0.0)}),
    "position_friction": (
        {"amplitude": 0.4, "phase_rad": 0.7},
        {"amplitude": (0.4, 0.1, 0.0), "phase_rad": (0.7, 0.0, 0.1)},
    ),
    "stiffening": (
        {"rise_mnm": 0.4, "onset_deg": 640.0},
        {},
    ),
    "eccentricity": (
        {"amplitude_deg": 1.5, "phase_rad": 0.5},
        {"amplitude_deg": (1.5, 0.1, 0.0), "phase_rad": (0.5, 0.0, 0.1)},
    ),
    "fatigue": ({"loss": 0.02}, {"fatigue_per_cycle": (0.02, 0.1, 0.0)}),
    "marker_slip": (
        {"time_s": 500.0, "step_deg": 4.0},
        {"slip_deg": (4.0, 0.03, 0.0), "slip_time_s": (500.0, 0.0, 1.0)},
    ),
    "backlash": ({"gap_deg": 4.0}, {"play_deg": (4.0, 0.03, 0.0)}),
    "creep": ({"relaxation": 0.03}, {}),
    "r_phase": ({"step_deg": 25.0}, {"r_phase_deg": (25.0, 0.1, 0.0), "r_phase_start_c": (26.0, 0.0, 1.0)}),
    "latent_heat": ({"latent_c_s": 60.0}, {"latent_c_s": (60.0, 0.06, 0.0)}),
    "minor_loops": ({"memory": 0.7}, {"loop_memory": (0.7, 0.05, 0.0)}),
    "stress_influence": (
        {"heating_scale": 0.85, "cooling_scale": 1.15},
        {"stress_ratio_heating": (0.85, 0.02, 0.0), "stress_ratio_cooling": (1.15, 0.02, 0.0)},
    ),
    "transformation_drift": (
        {"heating_c": -0.4, "cooling_c": -0.7},
        {"drift_heating_c": (-0.4, 0.0, 0.03), "drift_cooling_c": (-0.7, 0.0, 0.05)},
    ),
    "end_stop": (
        {"angle_deg": 205.0, "stiffness_mnm_per_rad": 10.0, "side": "negative"},
        {"stop_deg": (-205.0, 0.0, 0.5), "stop_mnm_per_rad": (10.0, 0.15, 0.0)},
    ),
    "static_friction": ({"excess": 0.6, "ageing_s": 60.0}, {"static_excess": (0.6, 0.1, 0.0)}),
}


BENT = {"kinetics_shape": {"bend": 0.03}}


@cache
def record(name: str):
    """Record a rig with one hidden effect, its own values as declared."""
    return made_with({name: TRUTH[name][0]}, seed=11)


def made_with(effects: dict, *, seed: int, **sections: dict):
    return make_record(
        {
            **sections,
            "seed": seed,
            "protocol": {"time_factor": 0.6, "half_cycle": HALVES},
            "rig": {"as_declared": True},
            "sensor": {"sample_s": 0.05, "noise_c": 0.02},
            "effects": effects,
        },
        rate_hz=1.0,
    )


def spec_of(made) -> ActuatorSpec:
    return ActuatorSpec({**made.played.scene.values.public, "zero_deg": 0.0})


@cache
def drive_of(made):
    return ActuatorModel(spec_of(made)).prepare(made.table)


def fitted(name: str, effects: tuple[str, ...]):
    return fitted_to(record(name), effects)


def fitted_to(made, effects: tuple[str, ...]):
    return fit_model(ActuatorModel(spec_of(made), effects), drive_of(made))


def test_the_twelve_of_the_contract_are_there():
    assert set(CONTRACT) <= set(load_effects())
    assert set(CONTRACT) <= set(TRUTH)


@pytest.mark.parametrize("name", sorted(DECLARED))
def test_declaration(name):
    effect = DECLARED[name]
    assert effect.id == name
    assert effect.title
    for parameter in effect.parameters:
        assert parameter.lower <= parameter.value <= parameter.upper
        assert all(
            parameter.lower <= start.get(parameter.name, parameter.value) <= parameter.upper for start in effect.starts
        )
    assert any(parameter.null is not None for parameter in effect.parameters)
    names = [p.name for other in DECLARED.values() for p in other.parameters]
    assert len(names) == len(set(names))


@pytest.mark.parametrize("name", sorted(DECLARED))
def test_null_is_the_plain_model(name):
    log, _ = programme([(0, [(75.0, 0.3)]), (1, [(62.0, 0.4)]), (0, [(80.0, 0.6)])])
    warm_a, warm_b = log.temp_a_c + 0.7 * (log.temp_b_c - 23.0), log.temp_b_c + 0.7 * (log.temp_a_c - 23.0)
    warm = TemperatureLog(log.time_s, warm_a, warm_b, log.heat_a, log.heat_b)
    plain = ActuatorModel(reference_spec())
    drive = plain.prepare_log(warm, start_angle_rad=2.9)
    model = ActuatorModel(reference_spec(), (name,))
    nulls = {p.name: p.null for p in DECLARED[name].parameters if p.null is not None}
    expected = plain.simulate(drive)
    found = model.simulate(drive, nulls)
    assert np.abs(found.angle_rad - expected.angle_rad).max() < 1e-9
    # What is always fitted starts where it changes nothing.
    started = model.simulate(drive).angle_rad
    assert np.abs(started - expected.angle_rad).max() > 1e-6 or DECLARED[name] in always_fitted()


# A fit of the whole record weighs the jump at every switch, which no half-cycle holds at its right instant.
@pytest.mark.parametrize("name", sorted(set(TRUTH) - {"creep"}))
def test_own_parameters_come_back_from_another_integrator(name):
    without, found = fitted(name, ()), fitted(name, (name,))
    # 0.06° of reading noise, and the rig's own dynamics (inertia, presliding).
    assert found.rmse_deg < 0.35 * without.rmse_deg
    for key, (true, relative, absolute) in TRUTH[name][1].items():
        assert found.estimates[key].value == pytest.approx(true, rel=relative or None, abs=absolute or None)
    if name == "stiffening":
        # Rise, onset and exponent can stand in for one another; the torque itself cannot.
        past_rad, made = np.radians([60.0, 100.0]), found.values
        past = np.maximum(0.0, math.radians(640.0 - made["stiffening_onset_deg"]) + past_rad) / REACH_RAD
        torque = made["stiffening_mnm_per_rad3"] * REACH_RAD**3 * past ** made["stiffening_exponent"]
        assert torque == pytest.approx(0.4 * (past_rad / RISE_RAD) ** 3, rel=0.25)
    tau = record(name).played.scene.values.public["tau_c_mnm"]
    assert found.values["tau_c_mnm"] == pytest.approx(tau, rel=0.05)


def test_a_bend_of_the_phase_law_comes_back_as_a_bend():
    bent, straight = (fitted_to(made_with(effects, seed=12), ()) for effects in (BENT, {}))
    # Inertia and presliding, which the model lacks, look like a small bend of a rig without one.
    for name in ("heating_bend", "cooling_bend"):
        found = bent.estimates[name].value - straight.estimates[name].value
        # The rig shifts the progress u by b sin(π u)/π, the effect by c u (1 − u): c is b at the ends, 4 b/π in the
        # middle of a window. A fit's standard deviation is 0.005.
        assert 0.03 - 0.005 < found < 4.0 * 0.03 / math.pi + 0.005


def test_a_disk_that_turns_before_it_slides_is_seen_to():
    made = made_with({}, seed=11, mechanics={"presliding_deg": 3.0})
    without, found = fitted_to(made, ()), fitted_to(made, ("presliding",))
    assert found.estimates["presliding_deg"].value == pytest.approx(3.0, rel=0.05)
    assert found.rmse_deg < 0.35 * without.rmse_deg


def test_friction_with_a_seat_holds_no_more_than_without():
    log, _ = programme([(0, [(75.0, 0.3)]), (1, [(80.0, 0.4)]), (0, [(62.0, 0.3)])])
    model = ActuatorModel(reference_spec(), ("presliding",))
    drive = model.prepare_log(log, start_angle_rad=2.9)
    hard, soft, softer = (model.simulate(drive, {"presliding_deg": turn}) for turn in (1e-6, 2.0, 4.0))
    tau_c = reference_spec().values["tau_c_mnm"] * 1e-3
    for found in (hard, soft, softer):
        assert np.abs(found.friction_nm).max() < tau_c * (1.0 + 1e-9)
    # A seat that hardly gives is none.
    assert np.abs(hard.angle_rad - model.simulate(drive, {"presliding_deg": 0.0}).angle_rad).max() < 1e-5
    first = np.abs(soft.angle_rad - hard.angle_rad).max()
    assert DEG < first < np.abs(softer.angle_rad - hard.angle_rad).max() < 2.2 * first


def test_a_disk_that_inertia_carries_past_its_balance_is_seen_to():
    # Steps of 2.5 ms follow the jump, where 50 ms have it end in its balance.
    made = made_with({"static_friction": TRUTH["static_friction"][0]}, seed=11, mechanics={"substeps": 20})
    found = fitted_to(made, ("static_friction",))
    without = found.model.simulate(drive_of(made), {**found.values, "static_swing": 0.0})
    left_deg = (made.table.angle_rad - without.angle_rad) / DEG
    assert found.estimates["static_swing"].value > 5.0 * found.estimates["static_swing"].sigma
    assert found.values["static_excess"] == pytest.approx(0.6, rel=0.1)
    assert found.rmse_deg < 0.5 * np.sqrt(np.mean(left_deg**2))


def test_a_jump_is_as_much_longer_as_it_swings_past_and_then_waits():
    log, _ = programme([(0, [(75.0, 0.3)]), (1, [(80.0, 0.4)])])
    model = ActuatorModel(reference_spec(), ("static_friction",))
    drive = model.prepare_log(log, start_angle_rad=2.9)
    short, far = (
        model.simulate(drive, {"static_excess": 0.6, "static_swing": swing}).angle_rad for swing in (0.0, 0.5)
    )
    jump = int(np.argmax(np.abs(np.diff(short)) > 5.0 * DEG))
    longer, slides = np.diff(far - short)[jump], abs(np.diff(short)[jump + 1])
    # In the sample of the jump it also slides, for less than a sample.
    assert 0.5 * (abs(np.diff(short)[jump]) - slides) <= abs(longer) <= 0.5 * abs(np.diff(short)[jump])
    assert np.all(np.diff(far)[jump + 1 : jump + 5] == 0.0)


def test_an_overshoot_of_hardly_any_length_hardly_changes_the_angle():
    log, _ = programme([(0, [(75.0, 0.3)]), (1, [(80.0, 0.4)])])
    model = ActuatorModel(reference_spec(), ("static_friction",))
    drive = model.prepare_log(log, start_angle_rad=2.9)
    none, little = (
        model.simulate(drive, {"static_excess": 0.6, "static_swing": swing}).angle_rad for swing in (0.0, 1e-4)
    )
    # The jump is one of 30°.
    assert np.max(np.abs(little - none)) < 0.05 * DEG


def let_go(step_s: float, excess: float = 0.6):
    """Return model, drive and values of a disk that lets go once, with so much time from row to row."""
    time_s = np.arange(0.0, 340.0, step_s)
    log = TemperatureLog(time_s, np.minimum(23.0 + 0.2 * time_s, 80.0), np.full(len(time_s), 23.0))
    model = ActuatorModel(reference_spec(), ("static_friction",))
    return model, model.prepare_log(log, start_angle_rad=2.9), {"static_excess": excess}


def jump_of(excess: float):
    """Return the height of the jump of a disk that lets go, rad, and its instant, s."""
    model, drive, values = let_go(0.005, excess)
    angle_rad = model.simulate(drive, values).angle_rad
    at = int(np.argmax(np.abs(np.diff(angle_rad)) > 5.0 * DEG))
    return np.diff(angle_rad)[at], drive.time_s[at]


def test_rows_show_a_jump_as_often_as_roundings_and_the_scatter_of_friction_let_them():
    jump_rad, jump_s = jump_of(0.6)
    _, later_s = jump_of(0.6 + 1.6 * RELEASE_SCATTER)
    assert later_s - jump_s > 0.1
    model, drive, values = let_go(0.5)
    plain = model.simulate(drive, values).angle_rad
    seen, sigma = model.seen_rad(drive, values)
    rng = np.random.default_rng(1)
    instant_s = jump_s + rng.uniform(-0.25, 0.25, (2, 200_000)).sum(axis=0)
    instant_s += (later_s - jump_s) * rng.standard_normal(200_000)
    beside = np.flatnonzero(np.abs(drive.time_s - jump_s) < 1.5)
    shown = (instant_s[None, :] <= drive.time_s[beside, None] + 1e-9).mean(axis=1)
    after = drive.time_s[beside] >= jump_s
    # What it slides in a row is 1° of 30°.
    assert (seen - plain)[beside] / jump_rad + after == pytest.approx(shown, abs=0.03)
    assert sigma[beside] / abs(jump_rad) == pytest.approx(np.sqrt(shown * (1.0 - shown)), abs=0.03)
    away = np.abs(drive.time_s - jump_s) > 1.0 + 6.0 * (later_s - jump_s)
    assert np.array_equal(seen[away], plain[away])
    assert not sigma[away].any()


def test_where_the_torque_hardly_grows_a_jump_may_show_in_many_rows():
    time_s = np.arange(0.0, 4000.0, 0.5)
    # From 50.7 °C on, where the disk is about to let go, the heating rises by 0.2 °C an hour.
    temp_c = np.minimum(23.0 + 0.2 * time_s, 50.7 + 0.2 * time_s / 3600.0)
    model = ActuatorModel(reference_spec(), ("static_friction",))
    drive = model.prepare_log(TemperatureLog(time_s, temp_c, np.full(len(time_s), 23.0)), start_angle_rad=2.9)
    jumps = 0
    for excess in np.linspace(0.38, 0.42, 41):
        values = {"static_excess": float(excess)}
        plain, (seen, sigma) = model.simulate(drive, values).angle_rad, model.seen_rad(drive, values)
        assert np.isfinite(seen).all()
        assert np.isfinite(sigma).all()
        at = int(np.argmax(np.abs(np.diff(plain)) > 5.0 * DEG))
        if 200.0 < time_s[at] < 3600.0:
            jumps += 1
            assert np.count_nonzero(sigma) > 100
    assert jumps


def test_where_a_disk_lets_go_moves_smoothly_with_the_friction_that_holds_it():
    model, drive, _ = let_go(0.5)
    many = [{"static_excess": float(excess)} for excess in np.linspace(0.6, 0.8, 401)]
    largest = [
        np.max(np.abs(np.diff([angle(values) for values in many], axis=0)))
        for angle in (lambda values: model.simulate(drive, values).angle_rad, lambda v: model.seen_rad(drive, v)[0])
    ]
    assert largest[0] > 20.0 * DEG
    assert largest[1] < 2.0 * DEG


def test_thermometers_that_read_too_high_by_the_same_everywhere_have_no_gain():
    made = record("sensor_lag")
    table = replace(made.table, temp_a_c=made.table.temp_a_c + 2.0, temp_b_c=made.table.temp_b_c + 2.0)
    model = ActuatorModel(spec_of(made), ("sensor_lag", "sensor_offset", "sensor_gain"))
    found = fit_model(model, model.prepare(table)).estimates
    assert found["thermometer_offset_c"].value == pytest.approx(2.0, abs=0.15)
    assert found["contact_gain"].value == pytest.approx(1.0, abs=0.004)


@pytest.mark.parametrize(("form", "lower", "upper"), [("saturating", 0.0, 0.35), ("plastic", 0.65, 1.0)])
def test_fatigue_that_takes_an_angle_is_told_from_one_that_takes_a_share(form, lower, upper):
    # The fourth half-cycle starts from an incomplete one: its spring has been wound less.
    made = made_with({"fatigue": {"loss": 0.1, "cycles": 1.5, "form": form}}, seed=13)
    found = fitted_to(made, ("fatigue",))
    assert found.rmse_deg < 0.35
    assert lower <= found.values["fatigue_plastic_share"] <= upper


def test_stops_at_both_ends_are_no_spring_that_stiffens():
    made = made_with({"end_stop": {"angle_deg": 200.0, "stiffness_mnm_per_rad": 60.0}}, seed=14)
    stops, spring = fitted_to(made, ("end_stops",)), fitted_to(made, ("stiffening",))
    assert stops.values["stops_high_deg"] == pytest.approx(200.0, abs=0.7)
    assert stops.values["stops_low_deg"] == pytest.approx(-200.0, abs=0.7)
    # Nothing that winds is stiffer than austenite.
    assert spring.rmse_deg > 3.0 * stops.rmse_deg


@pytest.mark.parametrize(("form", "lower", "upper"), [("third_slope", 0.0, 0.2), ("loading", 0.8, 1.0)])
def test_a_third_slope_of_the_loading_curve_is_told_from_a_torque_beside_it(form, lower, upper):
    made = made_with({"stiffening": {"rise_mnm": 0.2, "onset_deg": 660.0, "form": form}}, seed=15)
    without, found = fitted_to(made, ()), fitted_to(made, ("stiffening",))
    assert found.rmse_deg < 0.35 * without.rmse_deg
    assert lower <= found.values["stiffening_loading_share"] <= upper
    assert found.values["stiffening_onset_deg"] == pytest.approx(660.0, abs=5.0)


@pytest.mark.parametrize(("form", "lower", "upper"), [("bend", 0.6, 1.0), ("bend_alone", 0.0, 0.4)])
def test_the_fit_finds_whether_the_recoverable_angle_follows_the_loading_curve(form, lower, upper):
    made = made_with({"stiffening": {"rise_mnm": 0.2, "onset_deg": 620.0, "form": form}}, seed=16)
    without, found = fitted_to(made, ()), fitted_to(made, ("stiffening",))
    assert found.rmse_deg < 0.35 * without.rmse_deg
    assert lower <= found.values["stiffening_followed_share"] <= upper
    assert found.values["stiffening_loading_share"] > 0.8


def test_nothing_is_held_back_without_latent_heat_and_all_of_it_comes_in_the_end():
    log, _ = programme([(0, [(90.0, 0.5)]), (1, [(90.0, 0.5)])])
    model = ActuatorModel(reference_spec(), ("latent_heat",))
    drive = model.prepare_log(log, start_angle_rad=2.9)
    plain, late = (model.simulate(drive, {"latent_c_s": c_s}) for c_s in (0.0, 100.0))
    moving = np.abs(np.gradient(plain.phi_rad, drive.time_s)) > math.radians(0.2)
    assert np.abs(late.phi_rad - plain.phi_rad)[moving].max() > math.radians(5.0)
    ends = np.flatnonzero(np.diff(drive.cycles.half))
    assert late.phi_rad[ends] == pytest.approx(plain.phi_rad[ends], abs=math.radians(0.01))


def test_creep_with_the_rigs_own_values_takes_most_of_the_residual():
    model = ActuatorModel(spec_of(record("creep")), ("creep",))
    drive = model.prepare(record("creep").table)
    true = {"tau_c_mnm": record("creep").played.scene.values.public["tau_c_mnm"], "creep_onset_s": 10.0}

    def missed(per_decade: float) -> float:
        angle = model.simulate(drive, {**true, "creep_per_decade": per_decade}).angle_rad
        return float(np.sqrt(np.nanmean((drive.angle_rad - angle) ** 2)))

    assert missed(0.03) < 0.15 * missed(0.0)
    assert missed(0.03) < 0.5 * min(missed(0.02), missed(0.04))


def test_all_effects_together_at_their_nulls():
    log, _ = programme([(0, [(75.0, 0.3)]), (1, [(62.0, 0.4)])])
    everything = ActuatorModel(reference_spec(), tuple(load_effects()))
    drive = everything.prepare_log(log, start_angle_rad=2.9)
    nulls = {p.name: p.null for e in load_effects().values() for p in e.parameters if p.null is not None}
    plain = ActuatorModel(reference_spec()).simulate(drive)
    assert np.abs(everything.simulate(drive, nulls).angle_rad - plain.angle_rad).max() < 1e-9


def test_the_start_angle_is_the_angle_as_read():
    log, _ = programme([(0, [(75.0, 0.3)])])
    model = ActuatorModel(reference_spec(), ("eccentricity",))
    drive = model.prepare_log(log, start_angle_rad=2.9)
    angle = model.simulate(drive, {"eccentric_sine_deg": 8.0, "tilt_cosine_deg": 2.0}).angle_rad
    assert angle[0] == pytest.approx(2.9, abs=1e-12)


def test_history_goes_on():
    log, _ = programme([(0, [(85.0, 0.3)])])
    model = ActuatorModel(reference_spec(), ("clock_offset", "fatigue", "marker_slip"))
    drive = model.prepare_log(log, start_angle_rad=3.0)
    values = {"fatigue_per_cycle": 0.01, "slip_deg": 5.0, "slip_time_s": 200.0, "clock_offset_s": 7.0}
    later = History(cycles=(3, 2), after_record=True)
    found = model.simulate(drive, values, history=later)
    # A slipped marker stays slipped: the angle as read is φ and the step from the first row on.
    assert found.angle_rad - found.phi_rad == pytest.approx(math.radians(5.0), abs=1e-12)
    fatigued = ActuatorModel(reference_spec(), ("fatigue",))
    same = ActuatorModel(reference_spec()).prepare_log(log, start_angle_rad=3.0 - math.radians(5.0))
    expected = fatigued.simulate(same, {"fatigue_per_cycle": 1.0 - 0.99**3}, history=History(cycles=(1, 0)))
    assert found.phi_rad == pytest.approx(expected.phi_rad, abs=1e-9)


def test_order_and_unknown_ids():
    ids = [effect.id for effect in chosen_effects(("eccentricity", "clock_offset", "sensor_lag", "heat_crosstalk"))]
    assert ids == ["clock_offset", "sensor_lag", "heat_crosstalk", "eccentricity"]
    with pytest.raises(ConfigError, match="sensor_leg"):
        chosen_effects(("sensor_leg",))


def test_friction_that_is_flat_at_its_extremes_has_a_third_harmonic():
    made = made_with({"position_friction": {"amplitude": 0.4, "phase_rad": 0.7, "form": "flattened"}}, seed=12)
    fit = fitted_to(made, ("position_friction",))
    at = np.linspace(0.0, 2.0 * math.pi, 720, endpoint=False)
    wave = np.tanh(2.0 * np.sin(at)) / math.tanh(2.0)
    first, third = (2.0 * np.mean(wave * np.sin(k * at)) for k in (1, 3))
    assert fit.values["friction_third_harmonic"] == pytest.approx(third / first, abs=0.03)
    amplitude = math.hypot(fit.values["friction_sine"], fit.values["friction_cosine"])
    assert amplitude == pytest.approx(0.4 * first, rel=0.05)


def test_grease_that_thins_has_a_power_below_one():
    made = made_with({"viscous_friction": {"viscous_mnm_s_per_rad": 8.0, "form": "power"}}, seed=12)
    fit = fitted_to(made, ("viscous_friction",))
    assert fit.values["viscous_power"] == pytest.approx(0.7, abs=0.05)
    assert fit.values["viscous_mnm_s_per_rad"] == pytest.approx(8.0, rel=0.1)


@pytest.mark.parametrize("effect", DECLARED)
def test_every_value_of_an_effect_has_a_title_and_the_symbol_of_its_equation(effect: str) -> None:
    module = importlib.import_module(f"torsight.actuator.effects.{effect}")
    text = re.sub(r"[{}]", "", module.__doc__ or "")
    for one in (*DECLARED[effect].parameters, *DECLARED[effect].derived):
        assert one.title
        assert re.search(rf"(?<![^\W\d_]){re.escape(one.symbol)}(?!\w)", text), (one.name, one.symbol)
        assert with_title(one.name).endswith(f" {one.symbol}")


def test_a_symbol_of_what_is_always_fitted_means_nothing_else() -> None:
    always = {effect.id for effect in always_fitted()}
    own = [one.symbol for name in sorted(always) for one in DECLARED[name].parameters]
    found = [one.symbol for one in OF_THE_ACTUATOR.values()] + own
    assert len(set(found)) == len(found)
    others = (effect for name, effect in DECLARED.items() if name not in always)
    assert not {one.symbol for effect in others for one in (*effect.parameters, *effect.derived)} & set(found)
