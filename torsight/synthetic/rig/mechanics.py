# mypy: disable-error-code="no-any-return"
# Records carry no types of their fields.
"""Motion of the rig, compiled: springs against each other, friction, mass.

Backward Euler; the torques are those at the end of the step, phase included::

    J φ'' + b φ' = τ^B(θ_P/2 − φ) − τ^A(θ_P/2 + φ) − τ_f + stray torques

Friction is a bristle: τ_f = κ z with z following φ until |κ z| reaches the limit, then sliding at the limit. It tends
to Coulomb's law as κ grows, and the rig to the quasi-static model as the motion gets slow.
"""

from __future__ import annotations

import math
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from torsight.core.compiled import lending
from torsight.core.units import Floats
from torsight.synthetic.effects.rig_laws import SLOTS
from torsight.synthetic.rig.rig_values import ONSET_SCALE_RAD, Constants, law
from torsight.synthetic.rig.spring_state import TORQUE_TOLERANCE_NM, Spring, past_onset, solve_spring, tightened

Pair: TypeAlias = NDArray[np.void]
"""The rig's constants twice, with spring A's values and with spring B's."""
Springs: TypeAlias = tuple[Spring, Spring]
"""Spring A and spring B."""

# Entries of the motion's state.
PHI, SPEED, BRISTLE, REST = range(4)

# Entries of the temperatures after both wires': the body's, and the spring that was switched on last.
BODY, DRIVEN = 2, 3

_RESIDUAL_NM: Final = 100.0 * TORQUE_TOLERANCE_NM
"""The springs' own torques are known far better than their balance is solved to."""
_TORQUE: Final = SLOTS["torque", "angle"]
_OVER_ANGLE: Final = SLOTS["friction", "angle"]
_OVER_TEMPERATURE: Final = SLOTS["friction", "temperature"]
_OVER_RATE: Final = SLOTS["friction", "rate"]
_OVER_DWELL: Final = SLOTS["friction", "dwell"]


@lending
def friction_limit(c: Constants, phi: float, temps_c: Floats, side: float, speed: float, rest_s: float) -> float:
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
        limit *= math.exp(-c.grease * (temps_c[BODY] - c.room_c))
    limit *= (1.0 + law(c, _OVER_ANGLE, phi)) * (1.0 + law(c, _OVER_TEMPERATURE, temps_c[DRIVEN]))
    limit *= 1.0 + law(c, _OVER_RATE, abs(speed))
    if rest_s > 0.0:
        limit *= 1.0 - c.static_excess * math.expm1(-rest_s / c.static_ageing)
        limit *= 1.0 + law(c, _OVER_DWELL, rest_s)
    return max(limit, 0.0)


@lending
def stray_torque(c: Constants, phi: float) -> float:
    """Return torques that are neither spring nor friction, N·m, positive towards positive angles."""
    tau = c.bias + law(c, _TORQUE, phi)
    if c.gravity != 0.0:
        tau -= c.gravity * math.sin(phi + c.gravity_phase)
    if c.local != 0.0:
        x = ((phi - c.local_angle + math.pi) % (2.0 * math.pi) - math.pi) / c.local_width
        # A dipole's pull is largest at x = 1/√3.
        tau -= c.local * (x / (1.0 + x * x) ** 2 * 16.0 / math.sqrt(27.0) if c.local_form == 1 else -1.0 / (1.0 + x**4))
    if phi > c.stop_high:
        tau -= c.stop_stiffness * (phi - c.stop_high)
    elif phi < c.stop_low:
        tau -= c.stop_stiffness * (phi - c.stop_low)
    return tau


@lending
def residual(
    pair: Pair, springs: Springs, motion: Floats, temps_c: Floats, step_s: float, w: float, kind: int
) -> float:
    """Return the unbalanced torque if the step ended at angle ``w``; it rises with ``w``.

    ``kind`` 0 sticks, ±1 slides that way.
    """
    c = pair[0]
    half = 0.5 * c.theta_p
    speed = (w - motion[PHI]) / step_s
    tau_a = solve_spring(c, springs[0], half + w, temps_c[0])
    tau_b = solve_spring(pair[1], springs[1], half - w, temps_c[1])
    tau: float = tau_a - tau_b * (1.0 + c.imbalance) - stray_torque(c, w)
    tau += c.inertia * (speed - motion[SPEED]) / step_s + c.damping * speed
    if c.viscous != 0.0:
        power = 0.7 if c.viscous_form == 1 else 1.0
        tau += math.copysign(c.viscous * math.pow(abs(speed), power), speed)
    if kind == 0:
        tau += c.bristle * (motion[BRISTLE] + w - motion[PHI])
    else:
        tau += kind * friction_limit(c, w, temps_c, kind, speed, motion[REST])
    return tau


@lending
def find_angle(
    pair: Pair,
    springs: Springs,
    motion: Floats,
    temps_c: Floats,
    step_s: float,
    low: tuple[float, float],
    high: tuple[float, float],
    kind: int,
) -> float:
    """Return the angle of balance between ``low`` (angle, residual < 0) and ``high`` (residual > 0)."""
    a, ra = low
    b, rb = high
    for _ in range(100):
        # Between angles of some radians that are nearer to each other a double has rounding only.
        if abs(b - a) < 1e-13 or rb == ra:
            break
        new = b - rb * (b - a) / (rb - ra)
        r = residual(pair, springs, motion, temps_c, step_s, new, kind)
        a, ra, b, rb = tightened(a, ra, b, rb, new, r)
        if abs(r) < _RESIDUAL_NM:
            break
    return b


@lending
def slide(
    pair: Pair, springs: Springs, motion: Floats, temps_c: Floats, step_s: float, start: float, side: int
) -> float:
    """Return the angle at the end of a step that slides to one side from ``start``."""
    c = pair[0]
    first = residual(pair, springs, motion, temps_c, step_s, start, side)
    if first * side >= 0.0:
        return start
    reach = abs(first) / (0.3 * c.k_s + c.inertia / step_s**2)
    for _ in range(40):
        end = start + side * reach
        last = residual(pair, springs, motion, temps_c, step_s, end, side)
        if last * side >= 0.0:
            break
        reach *= 2.0
    if side > 0:
        return find_angle(pair, springs, motion, temps_c, step_s, (start, first), (end, last), side)
    return find_angle(pair, springs, motion, temps_c, step_s, (end, last), (start, first), side)


@lending
def step_angle(
    pair: Pair, springs: Springs, motion: Floats, temps_c: Floats, step_s: float
) -> tuple[float, float, bool]:
    """Return angle and bristle deflection at the end of one step, and whether it slid.

    Friction that has grown at rest holds until the disk has moved: the step in which the disk begins to slide ends just
    past this limit, where the reference is reset, and the disk jumps in the next step.
    """
    c = pair[0]
    phi, rest_s = motion[PHI], motion[REST]
    up = friction_limit(c, phi, temps_c, 1.0, 0.0, rest_s) / c.bristle
    down = friction_limit(c, phi, temps_c, -1.0, 0.0, rest_s) / c.bristle
    # The limit may have fallen below the deflection since the last step.
    motion[BRISTLE] = min(max(motion[BRISTLE], -down), up)
    high, low = phi + up - motion[BRISTLE], phi - (down + motion[BRISTLE])
    r_high = residual(pair, springs, motion, temps_c, step_s, high, 0)
    if r_high < 0.0:
        w = slide(pair, springs, motion, temps_c, step_s, high, 1)
        return w, friction_limit(c, w, temps_c, 1.0, (w - phi) / step_s, rest_s) / c.bristle, True
    r_low = residual(pair, springs, motion, temps_c, step_s, low, 0)
    if r_low > 0.0:
        w = slide(pair, springs, motion, temps_c, step_s, low, -1)
        return w, -friction_limit(c, w, temps_c, -1.0, (w - phi) / step_s, rest_s) / c.bristle, True
    w = find_angle(pair, springs, motion, temps_c, step_s, (low, r_low), (high, r_high), 0)
    return w, motion[BRISTLE] + w - phi, False
