"""The moving rig in time, compiled: heat, control, phase and mechanics in fixed steps.

Heat (Heun's rule on two wires and the body)::

    C dT/dt = R i² − G (T − T_room) − G_b (T − T_body) − G_w (T − T_other)

Control, on the reading of the heated spring's sensor, every sample: i = Kp e + Ki ∫ e, held between 0 and the supply's
limit; the integral waits while the current stands at a limit.

Mechanics (backward Euler; the torques at the end of the step, phase included)::

    J φ'' + b φ' = τ^B(θ_P/2 − φ) − τ^A(θ_P/2 + φ) − τ_f + stray torques

Friction is a bristle: τ_f = κ z with z following φ until |κ z| reaches the limit, then sliding at the limit. It tends
to Coulomb's law as κ grows, and the whole to the quasi-static model as the motion gets slow.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from torsight.synthetic.constants import ONSET_SCALE_RAD, Constants
from torsight.synthetic.springs import (
    COLD,
    FACTOR,
    commit_spring,
    follow_passive,
    past_onset,
    retake_reference,
    set_cold,
    solve_spring,
    start_cooling,
    start_heating,
)

# Columns of the recorded signals.
SIGNALS: Final = (
    "angle_rad",
    "rate_rad_s",
    "wire_a_c",
    "wire_b_c",
    "body_c",
    "temp_a_c",
    "temp_b_c",
    "current_a_a",
    "current_b_a",
    "xi_a",
    "xi_b",
    "friction_nm",
)

_RESIDUAL_NM: Final = 1e-10
_SLACK_C: Final = 0.1
_RELEASED: Final = 0.9


@njit(cache=True)
def friction_limit(c: Constants, phi: float, body_c: float, side: float, rest_s: float) -> float:
    """Return the torque at which friction lets go (``rest_s`` > 0) or slides, N·m."""
    limit = c.tau_c * (1.0 + c.asymmetry * side)
    if c.position != 0.0:
        wave = math.sin(phi + c.position_phase)
        if c.position_form == 1:
            wave = math.tanh(2.0 * wave) / math.tanh(2.0)
        limit *= 1.0 + c.position * wave
    if c.coil != 0.0:
        for theta in (0.5 * c.theta_p + phi, 0.5 * c.theta_p - phi):
            if c.coil_form == 2:
                x = max(theta - c.coil_onset, 0.0) / ONSET_SCALE_RAD
                limit += c.coil * math.expm1(x) / math.expm1(1.0)
            else:
                limit += past_onset(theta, c.coil_onset, c.coil, 1.0 + c.coil_form)
    if c.grease != 0.0:
        limit *= math.exp(-c.grease * (body_c - c.room_c))
    if rest_s > 0.0:
        limit *= 1.0 + c.static_excess * -math.expm1(-rest_s / c.static_ageing)
    return max(limit, 0.0)


@njit(cache=True)
def stray_torque(c: Constants, phi: float) -> float:
    """Return torques that are neither spring nor friction, N·m, positive towards positive angles."""
    tau = c.bias
    if c.gravity != 0.0:
        tau -= c.gravity * math.sin(phi + c.gravity_phase)
    if abs(phi) > c.stop_angle:
        tau -= c.stop_stiffness * (phi - math.copysign(c.stop_angle, phi))
    return tau


@njit(cache=True)
def residual(
    c: Constants,
    springs: tuple,
    w: float,
    old: tuple,
    kind: int,
    step_s: float,
    temps_c: tuple,
) -> float:
    """Return the unbalanced torque if the step ended at angle ``w``; it rises with ``w``.

    ``old`` is (angle, speed, bristle deflection, body temperature); ``kind`` 0 sticks, ±1 slides that way.
    """
    s, xi0, xi, weight, cooler_c = springs
    phi, speed, z, body_c = old
    half = 0.5 * c.theta_p
    new_speed = (w - phi) / step_s
    tau_a = solve_spring(c, s[0], xi0[0], xi[0], weight, cooler_c, half + w, temps_c[0])
    tau_b = solve_spring(c, s[1], xi0[1], xi[1], weight, cooler_c, half - w, temps_c[1])
    tau = tau_a - tau_b * (1.0 + c.imbalance) - stray_torque(c, w)
    tau += c.inertia * (new_speed - speed) / step_s + c.damping * new_speed
    if c.viscous != 0.0:
        power = 0.7 if c.viscous_form == 1 else 1.0
        tau += math.copysign(c.viscous * abs(new_speed) ** power, new_speed)
    if kind == 0:
        return tau + c.bristle * (z + w - phi)
    return tau + kind * friction_limit(c, w, body_c, kind, 0.0)


@njit(cache=True)
def find_angle(
    c: Constants,
    springs: tuple,
    lo: float,
    r_lo: float,
    hi: float,
    r_hi: float,
    old: tuple,
    kind: int,
    step_s: float,
    temps_c: tuple,
) -> float:
    """Return the angle at which the torques balance, between ``lo`` (residual below 0) and ``hi`` (above)."""
    a, ra, b, rb = lo, r_lo, hi, r_hi
    for _ in range(100):
        if abs(b - a) < 1e-13 or rb == ra:
            break
        new = b - rb * (b - a) / (rb - ra)
        r = residual(c, springs, new, old, kind, step_s, temps_c)
        if (r > 0.0) == (rb > 0.0):
            ra *= 0.5
        else:
            a, ra = b, rb
        b, rb = new, r
        if abs(r) < _RESIDUAL_NM:
            break
    return b


@njit(cache=True)
def slide(c: Constants, springs: tuple, start: float, old: tuple, side: int, step_s: float, temps_c: tuple) -> float:
    """Return the angle at the end of a step that slides to one side from ``start``."""
    r_start = residual(c, springs, start, old, side, step_s, temps_c)
    if r_start * side >= 0.0:
        return start
    stiffness = 0.3 * c.k_s + c.inertia / step_s**2
    reach = abs(r_start) / stiffness
    end = start + side * reach
    r_end = residual(c, springs, end, old, side, step_s, temps_c)
    while r_end * side < 0.0 and reach < 1e3:
        reach *= 2.0
        end = start + side * reach
        r_end = residual(c, springs, end, old, side, step_s, temps_c)
    if side > 0:
        return find_angle(c, springs, start, r_start, end, r_end, old, side, step_s, temps_c)
    return find_angle(c, springs, end, r_end, start, r_start, old, side, step_s, temps_c)


@njit(cache=True)
def step_angle(c: Constants, springs: tuple, old: tuple, rest_s: float, step_s: float, temps_c: tuple) -> tuple:
    """Return (angle, bristle deflection) at the end of one step."""
    phi, _, z, body_c = old
    up = friction_limit(c, phi, body_c, 1.0, rest_s) / c.bristle
    down = friction_limit(c, phi, body_c, -1.0, rest_s) / c.bristle
    # The limit may have fallen below the deflection since the last step.
    z = min(max(z, -down), up)
    old = (phi, old[1], z, body_c)
    hi, lo = phi + up - z, phi - (down + z)
    r_hi = residual(c, springs, hi, old, 0, step_s, temps_c)
    if r_hi < 0.0:
        w = slide(c, springs, hi, old, 1, step_s, temps_c)
        return w, friction_limit(c, w, body_c, 1.0, 0.0) / c.bristle, True
    r_lo = residual(c, springs, lo, old, 0, step_s, temps_c)
    if r_lo > 0.0:
        w = slide(c, springs, lo, old, -1, step_s, temps_c)
        return w, -friction_limit(c, w, body_c, -1.0, 0.0) / c.bristle, True
    w = find_angle(c, springs, lo, r_lo, hi, r_hi, old, 0, step_s, temps_c)
    return w, z + w - phi, False


@njit(cache=True)
def heat_rates(c: Constants, a: float, b: float, body: float, room: float, ia: float, ib: float) -> tuple:
    """Return dT/dt of wire A, wire B and the body, K/s."""
    between = c.between * (a - b)
    to_a, to_b = c.to_body * (a - body), c.to_body * (b - body)
    rate_a = (c.resistance * ia**2 - c.to_room * (a - room) - to_a - between) / c.capacity
    rate_b = (c.resistance * ib**2 - c.to_room * (b - room) - to_b + between) / c.capacity
    return rate_a, rate_b, (to_a + to_b - c.body_to_room * (body - room)) / c.body_capacity


@njit(cache=True)
def sense(c: Constants, lagged_c: float) -> float:
    """Return what the sensor reads when its own temperature has settled at ``lagged_c``, °C."""
    excess = lagged_c - c.room_c
    gain = c.sensor_gain
    if c.sensor_form == 1:
        gain = 1.0 - (1.0 - c.sensor_gain) * excess / 60.0
    reading = c.room_c + gain * excess
    if c.bulge_c != 0.0:
        reading += c.bulge_c * math.sin(math.pi * min(max((reading - 20.0) / 80.0, 0.0), 1.0))
    return reading


@njit(cache=True)
def integrate(
    constants: NDArray[np.void],
    start: NDArray[np.float64],
    s: NDArray[np.float64],
    weight: NDArray[np.float64],
    cooler_c: NDArray[np.float64],
    command: NDArray[np.int64],
    reference_c: NDArray[np.float64],
    cycle: NDArray[np.float64],
    noise_c: NDArray[np.float64],
    sample_s: float,
    substeps: int,
) -> NDArray[np.float64]:
    """Run the rig and return one row of :data:`SIGNALS` per sample.

    Parameters
    ----------
    constants : (1,) record
        The rig's numbers (:func:`torsight.synthetic.constants.to_record`).
    start : (4,) float64
        Angle, and temperatures of wire A, wire B and the body.
    s : (2, columns) float64
        States of both springs; changed in place.
    command : (n,) int64
        Per sample: 0 rest, 1 + spring when it is switched on (1, 2), −1 − spring while it cools.
    reference_c, cycle : (n,) float64
        Temperature reference; number of the spring's earlier cycles, for fatigue.
    noise_c : (n, 2) float64
        Noise of the two readings.
    """
    c = constants[0]
    n = command.size
    out = np.empty((n, 12))
    h = sample_s / substeps
    xi, xi0 = np.ones((2, weight.size)), np.ones((2, weight.size))
    springs = (s, xi0, xi, weight, cooler_c)
    half = 0.5 * c.theta_p
    phi, a_c, b_c, body_c = start
    speed, z, integral, rest_s, since_s = 0.0, 0.0, 0.0, 0.0, 0.0
    lag = np.array([[a_c, a_c], [b_c, b_c]])
    keep = math.exp(-h * c.lag_stages / c.lag_s) if c.lag_s > 0.0 else 0.0
    current = np.zeros(2)
    reading = np.zeros(2)
    active, sliding, before = -1, False, 0
    for k in range(n):
        for i in range(2):
            reading[i] = sense(c, lag[i, c.lag_stages - 1]) + noise_c[k, i]
            if c.quantum_c > 0.0:
                reading[i] = c.quantum_c * round(reading[i] / c.quantum_c)
        now = command[k]
        if now != before:
            temps_c = (a_c, b_c)
            if now > 0:
                if active >= 0:
                    theta = half + phi if active == 0 else half - phi
                    set_cold(c, s[active], xi[active], theta, temps_c[active])
                active, integral, since_s = now - 1, 0.0, 0.0
                theta = half + phi if active == 0 else half - phi
                s[active, FACTOR] = 1.0
                start_heating(c, s[active], xi0[active], xi[active], theta, temps_c[active], cycle[k])
                sliding = False
            elif now < 0 and before > 0:
                theta = half + phi if active == 0 else half - phi
                start_cooling(c, s[active], xi0[active], xi[active], theta, temps_c[active])
                sliding = False
            before = now
        current[:] = 0.0
        if now > 0:
            error = reference_c[k] - reading[active]
            wanted = c.gain_p * error + c.gain_i * (integral + error * sample_s)
            current[active] = min(max(wanted, 0.0), c.current_max)
            if current[active] == wanted or (wanted > 0.0) != (error > 0.0):
                integral += error * sample_s
        friction = c.bristle * z
        row = (phi, speed, a_c, b_c, body_c, reading[0], reading[1], current[0], current[1], s[0, 9], s[1, 9], friction)
        for i in range(12):
            out[k, i] = row[i]
        for _ in range(substeps):
            r1 = heat_rates(c, a_c, b_c, body_c, c.room_c, current[0], current[1])
            r2 = heat_rates(c, a_c + h * r1[0], b_c + h * r1[1], body_c + h * r1[2], c.room_c, current[0], current[1])
            a_c += 0.5 * h * (r1[0] + r2[0])
            b_c += 0.5 * h * (r1[1] + r2[1])
            body_c += 0.5 * h * (r1[2] + r2[2])
            temps_c = (a_c, b_c)
            for i in range(2):
                lag[i, 0] = temps_c[i] + (lag[i, 0] - temps_c[i]) * keep
                lag[i, 1] = lag[i, 0] + (lag[i, 1] - lag[i, 0]) * keep
            since_s += h
            if active >= 0:
                passive = 1 - active
                if c.creep > 0.0:
                    s[passive, FACTOR] = 1.0 - c.creep * math.log10(1.0 + since_s / c.creep_onset)
                if c.crosstalk == 1 and s[passive, 1] == COLD:
                    follow_passive(s[passive], xi0[passive], xi[passive], temps_c[passive], _SLACK_C)
            old = (phi, speed, z, body_c)
            w, new_z, slips = step_angle(c, springs, old, rest_s, h, temps_c)
            commit_spring(c, s[0], xi0[0], xi[0], weight, cooler_c, half + w, a_c)
            commit_spring(c, s[1], xi0[1], xi[1], weight, cooler_c, half - w, b_c)
            if slips and not sliding and active >= 0:
                theta = half + w if active == 0 else half - w
                retake_reference(c, s[active], theta, temps_c[active])
            side = 1.0 if new_z >= 0.0 else -1.0
            limit = friction_limit(c, w, body_c, side, 0.0)
            sliding = slips or (sliding and abs(c.bristle * new_z) > _RELEASED * limit)
            rest_s = 0.0 if slips else rest_s + h
            speed = (w - phi) / h
            phi, z = w, new_z
    return out
