"""The rig against closed forms, linear heat theory, and its own limits."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from torsight.core.units import DEG
from torsight.synthetic.effects.hidden import HIDDEN
from torsight.synthetic.rig.moving_rig import (
    Mechanics,
    RigRecord,
    Sensor,
    Setup,
    Thermal,
    play,
    reading_angle,
    simulate_rig,
)
from torsight.synthetic.rig.protocol import read_protocol
from torsight.synthetic.rig.rig_values import RigValues, rig_values

EXACT = Sensor(noise_c=0.0, quantum_c=0.0)
PAPER = {"half_cycle": [{"spring": "a", "peak_c": 90.0}, {"spring": "b", "peak_c": 90.0}]}
SHORT = {"time_factor": 0.1, **PAPER}


def run(values: RigValues, protocol: dict, *, effects: dict | None = None, **settings) -> RigRecord:
    made = {name: HIDDEN[name](**keys) for name, keys in (effects or {}).items()}
    setup = Setup(sensor=EXACT, **settings)
    return simulate_rig(values, read_protocol(protocol, where="test"), effects=made, setup=setup)


def stable_cycle(values: RigValues) -> tuple[float, float, float]:
    """Return θ_1, θ_2, θ_3 of case (a) from (22, 23) and (28), iterated over half-cycles to the stable cycle.

    In case (a) ξ12 = 1: heating slides from the start, from τ^A = τ^B + τ_c down to ξ = 0 along (23).
    """
    k_a, k_m, k_s = values.rig.k_austenite, values.rig.k_martensite, values.rig.k_stress_induced
    theta_p, theta_cr, tau_c = values.rig.theta_p_rad, values.rig.theta_cr_rad, values.rig.tau_c_nm
    theta_1 = 0.65 * theta_p
    theta_2 = theta_3 = 0.0
    for _ in range(60):
        # A was unwound elastically from θ_max: its torque is that of B on its loading curve, plus τ_c.
        tau_12 = k_m * theta_cr + k_s * (theta_p - theta_1 - theta_cr) + tau_c
        excess = k_m * theta_cr + k_s * (theta_1 - theta_cr) - tau_12
        theta_max = theta_1 + excess / (k_m - k_s)
        theta_l = (theta_max - theta_cr) * (1.0 - k_s / k_m)
        theta_2 = theta_1 - k_a / (k_a + k_s) * theta_l
        theta_3 = (k_s * (theta_p - theta_2) + k_m * theta_2 - tau_c) / (k_s + k_m)
        theta_1 = theta_p - theta_3
    return theta_1, theta_2, theta_3


def test_slow_rig_without_mass_meets_the_closed_forms(reference_values: RigValues) -> None:
    # Left over: the friction's elastic deflection (0.002°) and one sample of ramp (0.0015 °C, 26 °/°C).
    record = run(
        reference_values, PAPER, mechanics=Mechanics(inertia_kg_m2=0.0, damping_n_m_s=0.0, presliding_deg=0.002)
    )
    theta_deg = (record.angle_rad + 0.5 * reference_values.rig.theta_p_rad) / DEG
    found = theta_deg[0], theta_deg[record.half_cycle == 0].min(), theta_deg[record.half_cycle == 0][-1]
    expected = [theta / DEG for theta in stable_cycle(reference_values)]
    assert np.allclose(found, expected, atol=0.04)
    # The figures of the model's own page, to the digits that it shows.
    assert np.allclose(found, [717.6, 307.1, 362.4], atol=0.05 + 0.04)


def test_range_and_temperatures_of_motion_are_the_reference_ones(reference_values: RigValues) -> None:
    record = run(reference_values, PAPER)
    assert np.ptp(record.angle_rad) / DEG == pytest.approx(465.8, abs=0.1)
    first = record.half_cycle == 0
    moves = np.abs(record.rate_rad_s) > 0.02 * DEG
    heating = record.wire_a_c[first & record.heat_a & moves]
    cooling = record.wire_a_c[first & ~record.heat_a & moves]
    # Motion starts and ends with zero slope, so a threshold of speed cuts a little off at both ends.
    assert [heating[0], heating[-1]] == pytest.approx([47.6, 70.0], abs=0.25)
    assert [cooling[0], cooling[-1]] == pytest.approx([51.5, 47.0], abs=0.25)


def test_large_friction_keeps_a_cooling_actuator_at_rest(reference_values: RigValues) -> None:
    # β_cr = θ_P/2 − τ_c/(2 K_S) (29): above it, θ_2 > β_cr, cooling moves nothing (case b).
    values = rig_values({**reference_values.public, "tau_c_mnm": 2.2})
    record = run(values, PAPER)
    beta_cr_rad = 0.5 * values.rig.theta_p_rad - values.rig.tau_c_nm / (2.0 * values.rig.k_stress_induced)
    hot = record.half_cycle == 0
    theta_rad = record.angle_rad + 0.5 * values.rig.theta_p_rad
    assert theta_rad[hot].min() > beta_cr_rad
    at_rest = theta_rad[hot & ~record.heat_a]
    # What is left is the bristle's own deflection, ±0.02° of it.
    assert np.ptp(at_rest) < 0.05 * DEG


def test_time_factor_puts_the_same_record_on_a_faster_clock(reference_values: RigValues) -> None:
    slow = run(reference_values, PAPER)
    fast = run(reference_values, SHORT, mechanics=Mechanics(substeps=10))
    angle_deg = np.interp(slow.time_s * 0.1, fast.time_s, fast.angle_rad) / DEG
    # The controller samples ten times more coarsely: 15 ms of the fast ramp are 0.017 °C, 26 °/°C of angle.
    heating = slow.heat_a | slow.heat_b
    assert np.max(np.abs(angle_deg - slow.angle_rad / DEG)[heating]) < 3 * 0.017 * 26


def test_steps_are_fine_enough(reference_values: RigValues) -> None:
    ends = [
        run(reference_values, SHORT, mechanics=Mechanics(substeps=substeps)).angle_rad / DEG for substeps in (2, 4, 16)
    ]
    # A third of the presliding deflection and of the noise of a good film.
    assert max(np.abs(found - ends[-1]).max() for found in ends) < 0.02


def test_heat_follows_the_linear_theory(reference_values: RigValues) -> None:
    # A spring switched on with its reference out of reach gets the full current: a linear system with constant input.
    thermal = Thermal()
    protocol = {"home": False, "rest_s": 0.0, "half_cycle": [{"spring": "a", "points": [[0.0, 290.0]], "heat_s": 40.0}]}
    record = run(reference_values, protocol, thermal=thermal)
    wire, body = thermal.wire_capacity_j_per_k, thermal.body_capacity_j_per_k
    room, link, direct = thermal.wire_to_room_w_per_k, thermal.wire_to_body_w_per_k, thermal.between_wires_w_per_k
    rates = np.array(
        [
            [-(room + link + direct) / wire, direct / wire, link / wire],
            [direct / wire, -(room + link + direct) / wire, link / wire],
            [link / body, link / body, -(thermal.body_to_room_w_per_k + 2 * link) / body],
        ]
    )
    push = np.array([thermal.resistance_ohm * thermal.current_max_a**2 / wire, 0.0, 0.0])
    index = 2000
    exact = np.linalg.solve(rates, (expm(rates * record.time_s[index]) - np.eye(3)) @ push) + thermal.room_c
    found = [record.wire_a_c[index], record.wire_b_c[index], record.body_c[index]]
    assert record.current_a_a[:index] == pytest.approx(thermal.current_max_a)
    # Heun's error per unit time is (λ h)² / 6 of the rise: 3e-8 of 200 K.
    assert found == pytest.approx(exact, abs=1e-4)


def test_controller_holds_the_reference(reference_values: RigValues) -> None:
    record = run(reference_values, SHORT)
    hold = record.heat_a & (record.time_s > record.time_s[record.heat_a][-1] - 5.0)
    assert record.temp_a_c[hold] == pytest.approx(90.0, abs=0.1)
    assert record.current_a_a.min() >= 0.0


@pytest.mark.parametrize("name", sorted(set(HIDDEN) - {"clock_offset"}))
def test_every_effect_shows_in_angle_or_reading(reference_values: RigValues, name: str) -> None:
    strong = {
        "marker_slip": {"time_s": 40.0},
        "reading_drift": {"rate_deg_h": 20.0},
        "room_drift": {"rate_c_h": 10.0},
    }
    keys = strong.get(name, {})
    # Minor loops are what follows an incomplete heating.
    peaks = {"half_cycle": [{"spring": "a", "peak_c": 60.0}]} if name == "minor_loops" else {}
    protocol = {**SHORT, **peaks, "repeat": 2}
    plain, other = run(reference_values, protocol), run(reference_values, protocol, effects={name: keys})
    effect = {name: HIDDEN[name](**keys)}
    angle = np.abs(reading_angle(other.angle_rad, other.time_s, effect) - plain.angle_rad).max() / DEG
    temperature = np.abs(other.temp_a_c - plain.temp_a_c).max()
    assert angle > 1.0 or temperature > 0.5


NULLS = {
    "sensor_lag": {"lag_s": 0.0},
    "sensor_gain": {"gain": 1.0},
    "nonuniform_temperature": {"cooler_c": 0.0},
    "coil_friction": {"rise_mnm": 0.0},
    "viscous_friction": {"viscous_mnm_s_per_rad": 0.0},
    "position_friction": {"amplitude": 0.0},
    "stiffening": {"rise_mnm": 0.0},
    "fatigue": {"loss": 0.0},
    "creep": {"relaxation": 0.0},
    "torque_bias": {"bias_mnm": 0.0},
    "gravity": {"amplitude_mnm": 0.0},
    "grease_temperature": {"per_k": 0.0},
    "static_friction": {"excess": 0.0},
    "direction_friction": {"asymmetry": 0.0},
    "r_phase": {"step_deg": 0.0},
    "thermistor_curve": {"bulge_c": 0.0},
    "end_stop": {"stiffness_mnm_per_rad": 0.0},
    "imbalance": {"excess": 0.0},
    "local_torque": {"height_mnm": 0.0},
    "room_drift": {"rate_c_h": 0.0},
    "latent_heat": {"latent_c_s": 0.0},
    "transformation_drift": {"heating_c": 0.0, "cooling_c": 0.0},
    "kinetics_shape": {"bend": 0.0},
}


def test_effects_of_size_zero_change_nothing(reference_values: RigValues) -> None:
    plain = run(reference_values, SHORT)
    for name, keys in NULLS.items():
        other = run(reference_values, SHORT, effects={name: keys})
        # Zones of equal temperature add up in another order; the solver stops at 1e-10 N·m.
        assert np.allclose(other.angle_rad, plain.angle_rad, atol=1e-5), name


def test_late_sensor_trails_a_ramp_by_its_rate(reference_values: RigValues) -> None:
    record = run(reference_values, {"rest_s": 0.0}, effects={"sensor_lag": {"lag_s": 6.0}})
    middle = (record.time_s > 300.0) & (record.time_s < 400.0)
    rate = np.polyfit(record.time_s[middle], record.wire_a_c[middle], 1)[0]
    trail = np.mean(record.wire_a_c[middle] - record.temp_a_c[middle])
    assert trail == pytest.approx(6.0 * rate, rel=0.02)


def test_warm_passive_spring_pulls_back_at_the_hot_end(reference_values: RigValues) -> None:
    plain = run(reference_values, SHORT)
    other = run(reference_values, SHORT, effects={"heat_crosstalk": {"conductance_w_per_k": 0.02}})
    first = other.half_cycle == 0
    assert 0.05 < other.xi_b[first].min() < 0.95
    # Below A_s, which stress only raises, a cold spring stays martensite.
    assert other.xi_b[first & (other.wire_b_c < reference_values.rig.a_start_c) & other.heat_a].min() == 1.0
    returned = [
        record.angle_rad[(record.half_cycle == 0) & record.heat_a][-1] - record.angle_rad[record.half_cycle == 0].min()
        for record in (plain, other)
    ]
    # The early return at the hot end: B pulls back while A is still held hot.
    assert returned[1] > returned[0] + 5.0 * DEG
    assert plain.xi_b[plain.half_cycle == 0].min() == 1.0


def test_fatigue_takes_from_each_cycle(reference_values: RigValues) -> None:
    protocol = {**SHORT, "repeat": 4}
    record = run(reference_values, protocol, effects={"fatigue": {"loss": 0.02}})
    turn_deg = [record.angle_rad[record.half_cycle == 2 * n].min() / DEG for n in range(4)]
    assert np.all(np.diff(turn_deg) > 1.0)


def test_stick_and_slip_jumps_after_a_rest(reference_values: RigValues) -> None:
    plain = run(reference_values, SHORT)
    other = run(reference_values, SHORT, effects={"static_friction": {"excess": 0.5, "ageing_s": 5.0}})
    assert np.abs(np.diff(other.angle_rad)).max() > 3.0 * np.abs(np.diff(plain.angle_rad)).max()


def test_reading_of_a_lever_off_the_axis_is_nearly_a_sine() -> None:
    angle_rad = np.linspace(-4.0, 4.0, 801)
    time_s = np.arange(801.0)
    both = [
        reading_angle(angle_rad, time_s, {"eccentricity": HIDDEN["eccentricity"](amplitude_deg=2.0, form=form)})
        for form in ("sine", "lever")
    ]
    # atan(e sin / (1 − e cos)) = e sin φ + (e²/2) sin 2φ + …
    assert np.abs(both[0] - both[1]).max() == pytest.approx(0.5 * (2.0 * DEG) ** 2, rel=0.1)


def test_play_follows_with_half_its_width() -> None:
    there = np.concatenate([np.linspace(0.0, 1.0, 50), np.linspace(1.0, 0.0, 50)])
    followed = play(there, 0.2)
    assert followed[49] == pytest.approx(0.9)
    assert followed[-1] == pytest.approx(0.1)


def test_angle_between_samples_is_smooth_and_does_not_overshoot(reference_values: RigValues) -> None:
    record = run(reference_values, SHORT)
    fine = record.angle_at(np.linspace(0.0, record.time_s[-1], 40001))
    assert record.angle_rad.min() - 1e-12 <= fine.min()
    assert fine.max() <= record.angle_rad.max() + 1e-12
    assert np.allclose(record.angle_at(record.time_s[5:-5]), record.angle_rad[5:-5], atol=1e-9)
