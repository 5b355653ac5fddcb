"""The kernel against the closed forms (21) to (29), the figures of model.md, and a second implementation."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from actuator_oracle import Oracle, Values
from actuator_programmes import programme
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from torsight.actuator.model import ActuatorModel
from torsight.actuator.spec import REFERENCE_VALUES, ActuatorSpec, reference_spec
from torsight.actuator.springs import Rig
from torsight.actuator.stepping.cycle import half_cycle, heated_angle, stable_cycle
from torsight.core.errors import ConfigError
from torsight.core.records import TemperatureLog
from torsight.core.units import DEG

FULL = [(80.0, 0.1)]


def simulated(log, start_deg: float, **changes: float):
    model = ActuatorModel(reference_spec())
    drive = model.prepare_log(log, start_angle_rad=start_deg * DEG)
    return model.simulate(drive, changes)


def by_oracle(halves, temps, start_deg: float, values: Values, *, holds: bool = False) -> np.ndarray:
    oracle = Oracle(values, start_deg * DEG + 0.5 * values.theta_p, holds)
    parts = [oracle.run(spring, own.tolist()) for (spring, _), own in zip(halves, temps, strict=True)]
    return np.concatenate(parts)


def test_reference_rig_gives_the_figures_of_the_model_page():
    halves = [(k % 2, FULL) for k in range(8)]
    log, temps = programme(halves)
    phi = simulated(log, 177.6).phi_rad / DEG
    last = slice(len(log) - len(temps[-1]) - len(temps[-2]), len(log) - len(temps[-1]))
    cycle, temp = phi[last], temps[-2]
    angles = [cycle[0], cycle.min(), cycle[-1]]
    assert np.round(angles, 1).tolist() == [177.6, -232.9, -177.6]
    assert round(phi.max() - phi.min(), 0) == 466.0
    moving = np.flatnonzero(np.abs(np.diff(cycle)) > 1e-9)
    top = int(np.argmax(temp))
    heating, cooling = moving[moving < top], moving[moving >= top]
    # A sample is 0.05 °C of heating and up to 0.6 °C of cooling.
    assert temp[heating[0]] == pytest.approx(47.6, abs=0.06)
    assert temp[heating[-1] + 1] == pytest.approx(70.0, abs=0.06)
    assert temp[cooling[0]] == pytest.approx(51.5, abs=0.4)
    assert temp[cooling[-1] + 1] == pytest.approx(47.0, abs=0.4)


def test_closed_forms_of_the_reference_rig():
    cycle = stable_cycle(Rig.from_values(REFERENCE_VALUES))
    angles = np.array([cycle.theta_1_rad, cycle.theta_2_rad, cycle.theta_3_rad]) / DEG
    assert np.round(angles, 1).tolist() == [717.6, 307.1, 362.4]
    assert cycle.case == "a"
    assert cycle.xi_12 == 1.0


@pytest.mark.parametrize(
    ("tau_c_mnm", "start_deg", "case"), [(0.3, 150.0, "a"), (0.79, 177.6, "a"), (1.4, 215.0, "a"), (2.6, 60.0, "b")]
)
def test_kernel_agrees_with_the_closed_forms(tau_c_mnm, start_deg, case):
    rig = Rig.from_values({**REFERENCE_VALUES, "tau_c_mnm": tau_c_mnm})
    expected = half_cycle(rig, start_deg * DEG + 0.5 * rig.theta_p_rad)
    log, _ = programme([(0, [(95.0, 0.2)])])
    phi = simulated(log, start_deg, tau_c_mnm=tau_c_mnm).phi_rad
    assert expected.case == case
    assert phi.min() + 0.5 * rig.theta_p_rad == pytest.approx(expected.theta_2_rad, abs=1e-9)
    assert phi[-1] + 0.5 * rig.theta_p_rad == pytest.approx(expected.theta_3_rad, abs=1e-9)


@pytest.mark.parametrize(("tau_c_mnm", "start_deg"), [(0.3, 150.0), (0.79, 177.6), (1.4, 215.0)])
def test_the_way_of_a_slide_is_that_of_equations_23_and_26(tau_c_mnm, start_deg):
    rig = Rig.from_values({**REFERENCE_VALUES, "tau_c_mnm": tau_c_mnm})
    form = half_cycle(rig, start_deg * DEG + 0.5 * rig.theta_p_rad)
    log, _ = programme([(0, [(95.0, 0.2)])])
    simulation = simulated(log, start_deg, tau_c_mnm=tau_c_mnm)
    theta, xi, top = simulation.phi_rad + 0.5 * rig.theta_p_rad, simulation.xi_a, int(np.argmax(log.temp_a_c))
    moving = np.flatnonzero(np.abs(np.diff(theta, prepend=theta[0])) > 1e-9)
    up, down = moving[moving <= top], moving[moving > top]
    # Before the stop angle: there the spring is on its loading curve.
    down = down[theta[down] < form.theta_3_rad - 1e-6]
    assert len(up) > 50
    assert len(down) > 0
    for k in up:
        angle = heated_angle(
            rig, theta_1_rad=form.theta_1_rad, theta_l_rad=form.theta_l_rad, xi_12=form.xi_12, xi=xi[k]
        )
        assert theta[k] == pytest.approx(angle, abs=1e-9)
    for k in down:
        # Equation (26).
        stiffness = rig.stiffness(xi[k])
        angle = form.theta_2_rad + stiffness / (stiffness + rig.k_martensite) * (xi[k] - form.xi_23) * form.theta_l_rad
        assert theta[k] == pytest.approx(angle, abs=1e-9)


def test_case_b_sticks_until_the_fraction_of_equation_21():
    rig = Rig.from_values({**REFERENCE_VALUES, "tau_c_mnm": 2.6})
    start = 60.0
    expected = half_cycle(rig, start * DEG + 0.5 * rig.theta_p_rad)
    log, _ = programme([(0, [(95.0, 0.01)])])
    simulation = simulated(log, start, tau_c_mnm=2.6)
    first = int(np.flatnonzero(np.abs(np.diff(simulation.phi_rad)) > 1e-12)[0])
    assert 0.0 < expected.xi_12 < 1.0
    assert simulation.xi_a[first + 1] <= expected.xi_12 <= simulation.xi_a[first]


def test_friction_that_is_too_large_keeps_everything_still():
    rig = Rig.from_values({**REFERENCE_VALUES, "tau_c_mnm": 60.0})
    assert math.isnan(half_cycle(rig, 0.5 * rig.theta_p_rad).xi_12)
    log, _ = programme([(0, FULL), (1, FULL)])
    assert np.ptp(simulated(log, 0.0, tau_c_mnm=60.0).phi_rad) == 0.0


@pytest.mark.parametrize(("tau_c_mnm", "room_c"), [(0.2, 23.0), (0.79, 16.0), (0.79, 30.0), (1.8, 23.0)])
def test_kernel_agrees_with_the_second_implementation(tau_c_mnm, room_c):
    halves = [(0, [(74.0, 0.8)]), (1, [(60.0, 0.9)]), (0, [(57.5, 0.7)]), (1, [(82.0, 1.0)])]
    log, temps = programme(halves, room_c=room_c)
    expected = by_oracle(halves, temps, 170.0, Values(tau_c=tau_c_mnm * 1e-3))
    phi = simulated(log, 170.0, tau_c_mnm=tau_c_mnm).phi_rad
    assert np.abs(phi - expected).max() < 1e-6


@pytest.mark.parametrize("holds", [False, True])
@pytest.mark.parametrize("springs", [(0, 0, 1), (0, 1, 1, 0)])
def test_a_spring_heated_twice_gives_way_before_the_next_heating_or_is_held(springs, holds):
    """Its second cooling ends above its loading curve; as cold martensite it lies on it, and friction cannot hold."""
    halves = [(spring, [(80.0 - 2.0 * k, 3.0)]) for k, spring in enumerate(springs)]
    log, temps = programme(halves)
    expected = by_oracle(halves, temps, 170.0, Values(tau_c=0.5e-3), holds=holds)
    model = ActuatorModel(reference_spec(), ("change_of_springs",))
    drive = model.prepare_log(log, start_angle_rad=170.0 * DEG)
    phi = model.simulate(drive, {"tau_c_mnm": 0.5, "change_held": float(holds)}).phi_rad
    assert np.abs(phi - expected).max() < 1e-6
    starts = np.cumsum([len(own) for own in temps])[:-1]
    moves = np.abs(phi[starts] - phi[starts - 1]).max()
    assert moves < 1e-9 if holds else moves > 5.0 * DEG


def test_a_reheat_after_nearly_all_has_cooled_is_one_after_all_has():
    """Cooled to 99.99 % of martensite or to all of it: the second stroke may not jump between the two."""
    strokes = []
    for low in np.linspace(31.0, 35.0, 21):
        log, _ = programme([(0, [(80.0, 1.0), (float(low), 1.0), (80.0, 1.0)])])
        simulation = simulated(log, 177.6)
        strokes.append(float(simulation.phi_rad.min()) / DEG)
    assert np.abs(np.diff(strokes)).max() < 3.0
    assert min(strokes) > -300.0


@given(
    peaks=st.lists(st.floats(50.0, 85.0), min_size=2, max_size=3),
    reheat=st.tuples(st.floats(52.0, 66.0), st.floats(30.0, 48.0), st.floats(60.0, 80.0)),
    tau_c_mnm=st.floats(0.1, 2.0),
    start_deg=st.floats(-60.0, 200.0),
)
@settings(max_examples=5, deadline=None, derandomize=True, phases=[Phase.generate])
def test_any_history_agrees_with_the_second_implementation(peaks, reheat, tau_c_mnm, start_deg):
    halves = [(k % 2, [(peak, 0.7)]) for k, peak in enumerate(peaks)]
    # Heated, let cool in part, and heated again: two turns within one half-cycle.
    halves.append((len(peaks) % 2, [(reheat[0], 0.7), (reheat[1], 1.0), (reheat[2], 0.7)]))
    log, temps = programme(halves)
    expected = by_oracle(halves, temps, start_deg, Values(tau_c=tau_c_mnm * 1e-3))
    assert np.abs(simulated(log, start_deg, tau_c_mnm=tau_c_mnm).phi_rad - expected).max() < 1e-6


@pytest.mark.parametrize("top_c", [76.0, 82.0, 84.0])
def test_a_spring_under_so_much_stress_that_it_transforms_back_as_soon_as_it_cools(top_c):
    """Its torque falls towards the loading curve, under which it would not transform yet."""
    # Values with which a single step leads from far above the loading curve to far below it.
    rig = {"E_A_gpa": 55.6, "E_M_gpa": 25.2, "E_S_gpa": 7.27, "M_f_c": 31.7, "C_M_mpa_per_k": 16.4}
    rig |= {"theta_cr_deg": 200.0, "theta_p_deg": 1450.0, "tau_c_mnm": 1.1}
    model = ActuatorModel(replace(reference_spec(), values={**REFERENCE_VALUES, **rig}))
    halves = [(0, [(top_c, 0.3)]), (1, [(top_c, 0.3)])]
    log, temps = programme(halves)
    moduli = {"e_a": 55.6e9, "e_m": 25.2e9, "e_s": 7.27e9, "m_f": 31.7, "c_m": 16.4e6}
    values = Values(**moduli, theta_cr=200.0 * DEG, theta_p=1450.0 * DEG, tau_c=1.1e-3)
    found = model.simulate(model.prepare_log(log, start_angle_rad=200.0 * DEG)).phi_rad
    assert np.abs(found - by_oracle(halves, temps, 200.0, values)).max() < 1e-6


def test_mirror_image():
    log, _ = programme([(0, [(66.0, 0.3)]), (1, FULL)])
    swapped = type(log)(log.time_s, log.temp_b_c, log.temp_a_c, heat_a=log.heat_b, heat_b=log.heat_a)
    assert simulated(swapped, -150.0).phi_rad == pytest.approx(-simulated(log, 150.0).phi_rad, abs=1e-10)


def test_scaling_moduli_friction_and_stress_influence_together_changes_no_angle():
    log, _ = programme([(0, [(64.0, 0.3)]), (1, FULL)])
    names = ("E_A_gpa", "E_M_gpa", "E_S_gpa", "C_A_mpa_per_k", "C_M_mpa_per_k", "tau_c_mnm")
    halved = ActuatorSpec({**REFERENCE_VALUES, **{name: 0.5 * REFERENCE_VALUES[name] for name in names}})
    model = ActuatorModel(halved)
    phi = model.simulate(model.prepare_log(log, start_angle_rad=2.9)).phi_rad
    assert phi == pytest.approx(simulated(log, 2.9 / DEG).phi_rad, abs=1e-9)


def test_finer_sampling_changes_nothing_at_common_instants():
    log, _ = programme([(0, [(63.0, 0.4)]), (1, [(75.0, 0.4)])])
    fine_time = np.arange(4 * (len(log) - 1) + 1) * (log.time_s[1] / 4)
    fine = type(log)(
        fine_time,
        np.interp(fine_time, log.time_s, log.temp_a_c),
        np.interp(fine_time, log.time_s, log.temp_b_c),
        heat_a=np.repeat(log.heat_a, 4)[3:],
        heat_b=np.repeat(log.heat_b, 4)[3:],
    )
    assert simulated(fine, 160.0).phi_rad[::4] == pytest.approx(simulated(log, 160.0).phi_rad, abs=1e-8)


@pytest.mark.parametrize("low_c", [49.4, 47.5])
def test_dips_of_the_temperature_do_not_undo_a_transformation(low_c):
    # A controller that overshoots: at 50 °C a spring that is led down would transform back at once.
    log, (temps,) = programme([(0, [(50.0, 0.2), (low_c, 0.2), (70.0, 0.2)])])
    highest = int(np.argmax(temps)) + 1
    held = np.concatenate([np.maximum.accumulate(log.temp_a_c[:highest]), log.temp_a_c[highest:]])
    straight = replace(log, temp_a_c=held)
    assert simulated(log, 170.0).phi_rad == pytest.approx(simulated(straight, 170.0).phi_rad, abs=1e-9)


def test_a_spring_that_is_led_down_far_transforms_back():
    log, _ = programme([(0, [(50.0, 0.2), (40.0, 0.2), (70.0, 0.2)])])
    xi = simulated(log, 170.0).xi_a
    first = int(np.argmax(log.temp_a_c >= 50.0))
    assert xi[first] < 0.98
    assert xi[first + int(np.argmin(log.temp_a_c[first : first + 150]))] > xi[first] + 0.01


def test_tanaka_reaches_one_percent_where_liang_rogers_is_complete():
    log, _ = programme([(0, FULL)])
    model = ActuatorModel(reference_spec(), phase_law="tanaka")
    xi = model.simulate(model.prepare_log(log, start_angle_rad=3.0)).xi_a
    assert 0.0 < xi.min() < 0.01


@pytest.mark.parametrize(("name", "near"), [("tau_c", "tau_c_mnm"), ("E_A_mpa", "E_A_gpa")])
def test_a_value_that_is_none_of_the_models_is_refused_with_the_nearest_name(name, near):
    log, _ = programme([(0, FULL)])
    with pytest.raises(ConfigError, match=f"unknown key '{name}'.*did you mean '{near}'"):
        simulated(log, 170.0, **{name: 1.0})


def test_a_value_of_an_effect_that_the_model_lacks_is_refused_with_the_effects_name():
    log, _ = programme([(0, FULL)])
    with pytest.raises(ConfigError, match="'latent_c_s' is a value of the effect 'latent_heat'"):
        simulated(log, 170.0, latent_c_s=3.0)


def test_constant_recoverable_angle_is_an_option():
    log, _ = programme([(0, [(95.0, 0.2)])])
    model = ActuatorModel(reference_spec(), theta_l_deg=300.0)
    rig = Rig.from_values(REFERENCE_VALUES)
    phi = model.simulate(model.prepare_log(log, start_angle_rad=177.5666423514391 * DEG)).phi_rad / DEG
    # Equation (23) with ξ from 1 to 0.
    stroke = rig.k_austenite / (rig.k_austenite + rig.k_stress_induced) * 300.0
    assert phi[0] - phi.min() == pytest.approx(stroke, abs=1e-6)


@pytest.mark.parametrize(("renewal", "begins"), [(0.0, 100.0), (1.0, 900.0)])
@pytest.mark.parametrize("dip_c", [0.0, 1.0])
def test_a_stroke_goes_on_or_begins_anew_after_a_hold_or_a_dip(renewal: float, begins: float, dip_c: float):
    """Equation (23) gives the recoverable angle from the reference state: the beginning of the stroke, or the rest."""
    time_s = np.arange(0.0, 1600.0)
    begin_s, end_s = (400.0, 1400.0) if dip_c == 0.0 else (880.0, 900.0)
    corners_s = [0.0, begin_s, 0.5 * (begin_s + end_s), end_s, 1600.0]
    temp_c = np.interp(time_s, corners_s, [23.0, 56.0, 56.0 - dip_c, 56.0, 75.0])
    log = TemperatureLog(time_s, temp_c, np.full(1600, 23.0), heat_a=np.ones(1600, bool), heat_b=np.zeros(1600, bool))
    model = ActuatorModel(reference_spec(), ("reference_state",))
    found = model.simulate(model.prepare_log(log, start_angle_rad=177.6 * DEG), {"renewal": renewal})
    rig = Rig.from_values(REFERENCE_VALUES)
    stiffness = rig.k_austenite + found.xi_a * (rig.k_martensite - rig.k_austenite)
    share = stiffness / (stiffness + rig.k_stress_induced)
    start, after = int(begins), slice(1430, 1500)
    way_rad = found.phi_rad[after] - found.phi_rad[start]
    recovered_rad = way_rad / (share[after] * (found.xi_a[after] - found.xi_a[start]))
    # In case (a) the spring was unwound from where it balanced the other one and the friction.
    theta_1 = 177.6 * DEG + 0.5 * rig.theta_p_rad
    unwound_nm = rig.k_stress_induced * (2.0 * theta_1 - rig.theta_p_rad) - rig.tau_c_nm
    wound = theta_1 + unwound_nm / (rig.k_martensite - rig.k_stress_induced)
    left_rad = (wound - rig.theta_cr_rad) * (1.0 - rig.k_stress_induced / rig.k_martensite)
    # Within the seconds of a dip not quite all is renewed.
    assert recovered_rad == pytest.approx(left_rad, rel=1e-6 if dip_c == 0.0 else 1e-3)
