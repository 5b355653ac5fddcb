"""Time integration of the moving rig, compiled: switches, control, heat, phase and motion in fixed steps."""

# mypy: disable-error-code="no-any-return"
# Records carry no types of their fields.

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from torsight.core.compiled import compiled, copy_to, lending
from torsight.core.units import Floats, Ints
from torsight.synthetic.effects.rig_laws import SLOTS
from torsight.synthetic.rig.mechanics import (
    BODY,
    BRISTLE,
    DRIVEN,
    PHI,
    REST,
    SPEED,
    Pair,
    Springs,
    friction_limit,
    step_angle,
)
from torsight.synthetic.rig.rig_values import Constants, law
from torsight.synthetic.rig.spring_state import (
    COLD,
    FACTOR,
    HEATING,
    MODE,
    XI,
    Spring,
    commit_spring,
    follow_passive,
    restart_heating,
    retake_reference,
    set_cold,
    start_cooling,
    start_heating,
)


@lending
def heat_rates(c: Constants, temps_c: Floats, current: Floats, rates: Floats) -> None:
    """Fill ``rates`` with dT/dt of wire A, wire B and the body, K/s.

    Each wire follows C dT/dt = R i² − G (T − T_room) − G_b (T − T_body) − G_w (T − T_other).
    """
    a, b, body = temps_c
    between = (c.between + c.between_more) * (a - b)
    to_a, to_b = c.to_body * (a - body), c.to_body * (b - body)
    rates[0] = (c.resistance * current[0] ** 2 - c.to_room * (a - c.room_c) - to_a - between) / c.capacity
    rates[1] = (c.resistance * current[1] ** 2 - c.to_room * (b - c.room_c) - to_b + between) / c.capacity
    rates[2] = (to_a + to_b - c.body_to_room * (body - c.room_c)) / c.body_capacity


@lending
def heat_step(c: Constants, temps_c: Floats, current: Floats, work: Floats, step_s: float) -> None:
    """Move the three temperatures one step on; ``work`` (3, 3) is scratch."""
    heat_rates(c, temps_c, current, work[0])
    for i in range(3):
        work[1, i] = temps_c[i] + step_s * work[0, i]
    heat_rates(c, work[1], current, work[2])
    for i in range(3):
        temps_c[i] += 0.5 * step_s * (work[0, i] + work[2, i])


@lending
def lag_step(c: Constants, temps_c: Floats, lagged_c: Floats, step_s: float) -> None:
    """Advance the lagged temperatures of the sensors (spring, stage) by one step."""
    for i in range(2):
        lag_s = c.lag_b_s if i == 1 else c.lag_s
        keep = math.exp(-step_s * c.lag_stages / lag_s) if lag_s > 0.0 else 0.0
        lagged_c[i, 0] = temps_c[i] + (lagged_c[i, 0] - temps_c[i]) * keep
        lagged_c[i, 1] = lagged_c[i, 0] + (lagged_c[i, 1] - lagged_c[i, 0]) * keep


@lending
def sense(c: Constants, lagged_c: float, noise_c: float) -> float:
    """Return the reading, °C, of a sensor whose own temperature is ``lagged_c``."""
    excess = lagged_c - c.room_c
    gain = c.sensor_gain
    if c.sensor_form == 1:
        gain = 1.0 - (1.0 - c.sensor_gain) * excess / 60.0
    reading = c.room_c + gain * excess
    if c.bulge_c != 0.0:
        reading += c.bulge_c * math.sin(math.pi * min(max((reading - 20.0) / 80.0, 0.0), 1.0))
    reading += noise_c
    if c.quantum_c > 0.0:
        reading = c.quantum_c * round(reading / c.quantum_c)
    return reading


@lending
def control(c: Constants, error_c: float, integral: float, sample_s: float) -> tuple[float, float]:
    """Return current, A, and the integral of the error, K·s, after one sample of the PI law.

    The error is that of the reading of the heated spring's sensor: i = Kp e + Ki ∫ e, held between 0 and the supply's
    limit; the integral waits while the current stands at a limit.
    """
    grown = integral + error_c * sample_s
    wanted = c.gain_p * error_c + c.gain_i * grown
    current = min(max(wanted, 0.0), c.current_max)
    held = current != wanted and (wanted > 0.0) == (error_c > 0.0)
    return current, integral if held else grown


_SLACK_C: Final = 0.1
"""Smallest reversal of a temperature that counts, °C: three sigmas of a reading's usual noise."""
_OVER_TEMPERATURE: Final = SLOTS["temperature", "temperature"]
_OVER_RATE: Final = SLOTS["temperature", "temp_rate"]


class Course(NamedTuple):
    """Inputs at every sample (n,): commands, references, the share of the recoverable angle that laws leave, and noise.

    Commands: 0 rest, 1 or 2 spring A or B switched on, −1 or −2 cooling after it. ``cycle`` is the number of the
    spring's earlier cycles, for fatigue; ``noise_c`` (n, 2) is that of the two readings.
    """

    command: Ints
    reference_c: Floats
    cycle: Floats
    share: Floats
    noise_c: Floats


@lending
def winding(c: Constants, spring: int, phi: float) -> float:
    """Return a spring's angle, rad."""
    return 0.5 * c.theta_p + phi if spring == 0 else 0.5 * c.theta_p - phi


@lending
def switch(
    pair: Pair, springs: Springs, phi: float, temps_c: Floats, active: int, command: int, cycle: float, share: float
) -> int:
    """Switch a spring on (``command`` 1, 2) or off (−1, −2); return which one is active now."""
    if command > 0:
        if active >= 0:
            c = pair[active]
            set_cold(c, springs[active], winding(c, active, phi), temps_c[active])
        active = command - 1
        springs[active].s[FACTOR] = 1.0
        c = pair[active]
        start_heating(c, springs[active], winding(c, active, phi), temps_c[active], cycle, share)
    elif active >= 0 and springs[active].s[MODE] == HEATING:
        c = pair[active]
        start_cooling(c, springs[active], winding(c, active, phi), temps_c[active])
    return active


@lending
def lead(c: Constants, spring: Spring, theta: float, wire_c: float, reference_c: float, furthest: Floats) -> None:
    """Turn the driven spring's transformation where its reference turns and the wire has followed.

    ``furthest`` holds the furthest reference and wire temperature on the present way up or down.
    """
    up = spring.s[MODE] == HEATING
    sign = 1.0 if up else -1.0
    furthest[0] = sign * max(sign * furthest[0], sign * reference_c)
    furthest[1] = sign * max(sign * furthest[1], sign * wire_c)
    if sign * (furthest[0] - reference_c) <= _SLACK_C or sign * (furthest[1] - wire_c) <= _SLACK_C:
        return
    if up:
        start_cooling(c, spring, theta, wire_c)
    else:
        restart_heating(c, spring, theta, wire_c)
    furthest[0], furthest[1] = reference_c, wire_c


@lending
def passive_step(c: Constants, spring: Spring, temp_c: float, since_s: float) -> None:
    """Apply creep and the other spring's own temperature to the spring that is not driven, where the rig has them."""
    if c.creep > 0.0:
        spring.s[FACTOR] = 1.0 - c.creep * math.log10(1.0 + since_s / c.creep_onset)
    if c.crosstalk == 1 and spring.s[MODE] == COLD:
        follow_passive(spring, temp_c, _SLACK_C)


@lending
def move(
    pair: Pair, springs: Springs, motion: Floats, temps_c: Floats, step_s: float, active: int, sliding: int
) -> int:
    """Advance the rig by one step; return 1 where it slides.

    Where sticking turns into sliding the active spring's reference is reset.
    """
    c = pair[0]
    w, deflection, slips = step_angle(pair, springs, motion, temps_c, step_s)
    for i in range(2):
        commit_spring(pair[i], springs[i], winding(c, i, w), temps_c[i])
    if slips and sliding == 0 and active >= 0:
        retake_reference(pair[active], springs[active].s, winding(c, active, w), temps_c[active])
    motion[REST] = 0.0 if slips else motion[REST] + step_s
    motion[SPEED] = (w - motion[PHI]) / step_s
    motion[PHI], motion[BRISTLE] = w, deflection
    # Friction must have fallen well below its limit, by a tenth, before the rig counts as stuck again: a choice.
    limit = friction_limit(c, w, temps_c, 1.0 if deflection >= 0.0 else -1.0, motion[SPEED], 0.0)
    return 1 if slips or (sliding == 1 and abs(c.bristle * deflection) > 0.9 * limit) else 0


@lending
def feel(pair: Pair, temps_c: Floats, rates_k_s: Floats, active: int, felt_c: Floats) -> None:
    """Fill ``felt_c`` with the temperatures that act on springs and friction: wires, body, driven spring."""
    for i in range(2):
        felt_c[i] = temps_c[i] + law(pair[i], _OVER_TEMPERATURE, temps_c[i]) + law(pair[i], _OVER_RATE, rates_k_s[i])
    felt_c[BODY] = temps_c[BODY]
    felt_c[DRIVEN] = temps_c[max(active, 0)]


@compiled
def integrate(
    pair: Pair, start: Floats, s: Floats, zones: tuple[Floats, Floats], course: Course, sample_s: float, substeps: int
) -> Floats:
    """Run the rig and return one row of signals per sample, those of a ``RigRecord`` in their order.

    The ``pair`` of records holds the rig's numbers with spring A's and B's values
    (:func:`torsight.synthetic.rig.rig_values.to_records`), ``start`` the angle and the temperatures of wire A, wire B
    and the body, ``s`` the states of both springs, which are changed in place, ``zones`` the weights of the wire's
    zones and how much cooler each is than the middle, ``course`` the inputs at every sample.
    """
    c = pair[0]
    command, reference_c, cycle, share, noise_c = course
    weight, cooler_c = zones
    out = np.empty((command.size, 12))
    step_s = sample_s / substeps
    zones_a, zones_b = np.ones((2, weight.size)), np.ones((2, weight.size))
    springs = (
        Spring(s[0], zones_a[0], zones_a[1], weight, cooler_c),
        Spring(s[1], zones_b[0], zones_b[1], weight, cooler_c),
    )
    motion = np.array([start[0], 0.0, 0.0, 0.0])
    temps_c, felt_c, rates_k_s, before_c = start[1:].copy(), np.zeros(4), np.zeros(2), start[1:].copy()
    feel(pair, temps_c, rates_k_s, -1, felt_c)
    lagged_c = np.empty((2, 2))
    lagged_c[0], lagged_c[1] = temps_c[0], temps_c[1]
    before_xi, pace = np.ones(2), np.zeros(2)
    current, reading, work, furthest = np.zeros(2), np.zeros(2), np.zeros((3, 3)), np.zeros(2)
    integral, since_s, active, sliding, before = 0.0, 0.0, -1, 0, 0
    for k in range(command.size):
        for i in range(2):
            reading[i] = sense(c, lagged_c[i, int(c.lag_stages) - 1] - c.latent * pace[i], noise_c[k, i])
        if command[k] != before:
            before, sliding = command[k], 0
            active = switch(pair, springs, motion[PHI], felt_c, active, before, cycle[k], share[k])
            if before > 0:
                integral, since_s = 0.0, 0.0
                furthest[0], furthest[1] = reference_c[k], temps_c[active]
        current[:] = 0.0
        if before > 0:
            theta = winding(pair[active], active, motion[PHI])
            lead(pair[active], springs[active], theta, temps_c[active], reference_c[k], furthest)
            current[active], integral = control(c, reference_c[k] - reading[active], integral, sample_s)
        out[k, 0], out[k, 1] = motion[PHI], motion[SPEED]
        copy_to(out[k, 2:5], temps_c)
        copy_to(out[k, 5:7], reading)
        copy_to(out[k, 7:9], current)
        out[k, 9], out[k, 10], out[k, 11] = s[0, XI], s[1, XI], c.bristle * motion[BRISTLE]
        for _ in range(substeps):
            copy_to(before_c, temps_c)
            heat_step(c, temps_c, current, work, step_s)
            # A rate-dependent difference between wire and sensor builds up within two seconds: a choice.
            for i in range(2):
                rates_k_s[i] += ((temps_c[i] - before_c[i]) / step_s - rates_k_s[i]) * min(step_s / 2.0, 1.0)
            feel(pair, temps_c, rates_k_s, active, felt_c)
            lag_step(c, temps_c, lagged_c, step_s)
            since_s += step_s
            if active >= 0:
                passive_step(c, springs[1 - active], felt_c[1 - active], since_s)
            copy_to(before_xi, s[:, XI])
            sliding = move(pair, springs, motion, felt_c, step_s, active, sliding)
            # The latent heat appears at the sensor after 0.2 s, a choice: without delay the control would oscillate.
            for i in range(2):
                pace[i] += ((s[i, XI] - before_xi[i]) / step_s - pace[i]) * min(step_s / 0.2, 1.0)
    return out
