# mypy: disable-error-code="no-any-return"
# Elements of numpy arrays carry no type that mypy could check against float.
# ruff: noqa: FBT001
# Compiled functions call each other by position, flags too.
"""The laws of the stepping rule, compiled: phase law, torque of cold martensite, friction.

``p`` holds the rig's scalars (:data:`SCALARS`), including those of one spring. ``tables`` (11, m) holds torques over
θ^A (friction down and up, stray torque) and over either spring's own angle (additional torque of the spring, and of its
loading curve; the spring's scalars hold the rows' indices, 0 where there is no table), friction torque over the speed,
the factor on friction over log10(1 + rest in s), and the lead of a transformation over the phase law over the place in
its window, for heating and cooling.
"""

from __future__ import annotations

import sys
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from torsight.actuator.record.turns import REVERSAL_C, turning_points
from torsight.actuator.stepping.phase import LN_100, PLACES
from torsight.core.compiled import compiled, copy_to, inlined, lending, numbers
from torsight.core.units import Floats, Ints

_FIRST_PLACE: Final = float(PLACES[0])
ROUNDED: Final = 50.0 * sys.float_info.epsilon
"""Change below which a fraction, or an angle in radians, counts as unchanged: fifty times the rounding error of 1."""

SEATS: Final = 5
"""Number of elastic elements among which friction is shared: the curve up to sliding then consists of five straight
lines, within 1 % of τ_c of the parabola 1 − (1 − u)² (its sagitta over a fifth, 2 / (8 · 25))."""

Scalars = np.void
"""One element of an array of :data:`SCALARS`, :data:`STEP` or :data:`REFERENCE`."""


SCALARS: Final = numbers(
    # Of one spring (SI units, °C).
    "k_a k_m k_s a_start a_width m_finish m_width temp_per_torque_a temp_per_torque_m theta_cr side_row loading_row "
    "follows "
    # Of the rig.
    "theta_p tau_c viscous_nms viscous_power speed_step dwell_step passive_share tanaka room_c grid_start grid_step "
    "fixed_theta_l has_friction has_stray steady home_hold first_share heating_bend cooling_bend unwound_a unwound_b "
    "latent_c_s swing place_step loop_memory renewal change_held seat_rad seat_spread slipped_a slipped_b"
)
"""The rig's scalars with the values of one spring."""
STEP: Final = numbers(
    # Of one sample: temperatures, scale of the friction, what acts on the springs, and the sample before.
    "temp temp_passive heating turn_now scale wound cross factor own other keeps sign x0 per_s before ahead guess "
    # From sample to sample: the driven spring, and the phase of the other one.
    "who x tau xi rest_s changed xi_p xi_0_p turn_p "
    # Divided differences of the last slides, and the durations of the last two samples, s.
    "rate rate_2 rate_3 span span_2 "
    # Jump of a disk that had been at rest, and the part of the sample after which it broke loose.
    "jump let_go growth"
)
"""Values of one sample, and those that persist from sample to sample (SI units, °C)."""
REFERENCE: Final = numbers("x tau xi theta_l sliding floor begun at_rest stood_s")
"""The driven spring's reference state."""

# Rows of the tables.
FRICTION_DOWN, FRICTION_UP, STRAY, SIDE_A, SIDE_B, LOADING_A, LOADING_B, SPEED, DWELL = 0, 1, 2, 3, 4, 5, 6, 7, 8
LEAD_HEATING, LEAD_COOLING = 9, 10


class State(NamedTuple):
    """State of one run."""

    s: NDArray[np.void]
    """(2,) of :data:`STEP`: Values of the sample, and those that persist; room to keep them while it is balanced."""
    q: NDArray[np.void]
    """(4,) of :data:`REFERENCE`: The reference state, that before the last turn, and room for two more."""
    w: Floats
    saved_w: Floats
    before_w: Floats
    """(7, m): Per section of the wire: ξ, ξ0, the furthest place in the law's window, a trial's ξ and place, the rate
    of ξ over the sample before, and ξ at its end; the same before the last turn; and before the sample is balanced."""
    wound: Floats
    """(2,): Largest winding so far of both springs, rad."""
    held: Floats
    """(SEATS,): Torque that each elastic element of the friction holds, N·m, positive against a growing x."""
    short: Floats
    """(2,): Torque by which either direction fell short of sliding, N·m."""


@inlined
def bend(heating: bool, p: Scalars) -> float:
    """Return the bend of the phase law on heating or on cooling."""
    return p["heating_bend"] if heating else p["cooling_bend"]


@inlined
def bent(place: float, ahead: float) -> float:
    """Return the argument of the phase law at a place within the window: the place plus the bend's lead."""
    return place + ahead * place * (1.0 - place)


@inlined
def share_done(heating: bool, place: float, p: Scalars) -> float:
    """Return the completed share of a whole transformation at a place in the window."""
    if place <= 0.0:
        return 0.0
    if p["tanaka"] > 0.5:
        return 1.0 - np.exp(-LN_100 * place)
    if place >= 1.0:
        return 1.0
    return 0.5 - 0.5 * np.cos(np.pi * bent(place, bend(heating, p)))


@inlined
def done_slope(heating: bool, place: float, p: Scalars) -> float:
    """Return the derivative of :func:`share_done` by the place."""
    if place <= 0.0:
        return 0.0
    if p["tanaka"] > 0.5:
        return LN_100 * np.exp(-LN_100 * place)
    if place >= 1.0:
        return 0.0
    ahead = bend(heating, p)
    return 0.5 * np.pi * (1.0 + ahead * (1.0 - 2.0 * place)) * np.sin(np.pi * bent(place, ahead))


@inlined
def transforms(part: float, done: float, p: Scalars) -> float:
    """Return the transformed share of a wire of which ``part`` remained, where the law has completed ``done``.

    Liang and Rogers scale the law to the remaining part. With the weight of the memory, the transformation waits until
    as much of the complete law remains.
    """
    scaled = part * done
    return scaled if p["loop_memory"] == 0.0 else scaled + p["loop_memory"] * (max(0.0, part - 1.0 + done) - scaled)


@inlined
def transforms_slope(part: float, done: float, p: Scalars) -> float:
    """Return the derivative of :func:`transforms` by ``done``."""
    return (
        part
        if p["loop_memory"] == 0.0
        else part + p["loop_memory"] * ((1.0 if part - 1.0 + done > 0.0 else 0.0) - part)
    )


@lending
def held_place(heating: bool, place: float, furthest: float, part: float, delay: float, p: Scalars) -> float:
    """Return the root s of s + λ (ξ(s) − ξ(s_0)) = s_T: s_0 the furthest place so far, s_T ``place``, λ the delay.

    ξ is the transformed share of a wire of which ``part`` remained.
    """
    low, high = furthest, place
    before = transforms(part, share_done(heating, furthest, p), p)
    reached = high
    for _ in range(60):
        done = share_done(heating, reached, p)
        over = reached + delay * (transforms(part, done, p) - before) - place
        if over > 0.0:
            high = reached
        else:
            low = reached
        following = reached - over / (1.0 + delay * transforms_slope(part, done, p) * done_slope(heating, reached, p))
        if abs(following - reached) < ROUNDED:
            break
        reached = following if low < following < high else 0.5 * (low + high)
        if high - low < ROUNDED:
            break
    return reached


@inlined
def _between(place: float, row: int, step: float, tables: Floats) -> tuple[float, float]:
    """Return a table's value and slope at a place in steps from its start; constant beyond its ends."""
    last = tables.shape[1] - 1
    if place <= 0.0:
        return tables[row, 0], 0.0
    if place >= last:
        return tables[row, last], 0.0
    i = int(place)
    rise = tables[row, i + 1] - tables[row, i]
    return tables[row, i] + (place - i) * rise, rise / step


@inlined
def window_place(heating: bool, temperature: float, torque: float, p: Scalars, tables: Floats) -> tuple[float, float]:
    """Return the wire's place in the law's window (0 at its start, 1 at its end, in the direction of change).

    Also return its derivative by the place without a lead over the law: one, where there is no lead.
    """
    if heating:
        place = (temperature - p["a_start"] - p["temp_per_torque_a"] * torque) / p["a_width"]
    else:
        place = 1.0 - (temperature - p["m_finish"] - p["temp_per_torque_m"] * torque) / p["m_width"]
    if p["place_step"] == 0.0:
        return place, 1.0
    row, step = LEAD_HEATING if heating else LEAD_COOLING, p["place_step"]
    lead, slope = _between((place - _FIRST_PLACE) / step, row, step, tables)
    return place + lead, 1.0 + slope


@inlined
def table_and_slope(x: float, row: int, p: Scalars, tables: Floats) -> tuple[float, float]:
    """Return :func:`from_table` and its derivative by ``x``."""
    return _between((x - p["grid_start"]) / p["grid_step"], row, p["grid_step"], tables)


@inlined
def from_table(x: float, row: int, p: Scalars, tables: Floats) -> float:
    """Return a table's value at x; beyond its ends the last value."""
    return table_and_slope(x, row, p, tables)[0]


@inlined
def side_torque(x: float, p: Scalars, tables: Floats) -> float:
    """Return a spring's torque in addition to that of its phase, at its own angle."""
    if p["side_row"] > 0.0:
        return from_table(x, int(p["side_row"]), p, tables)
    return 0.0


@inlined
def held_table(x: float, row: int, step: float, tables: Floats) -> tuple[float, float]:
    """Return value and slope of a table that begins at x = 0; beyond its end the last value."""
    return _between(x / step, row, step, tables)


@inlined
def loading_torque(theta: float, p: Scalars, tables: Floats) -> float:
    """Return the torque of martensite's loading curve: two slopes plus the additional torque of a law."""
    torque = p["k_m"] * theta
    if theta > p["theta_cr"]:
        torque = p["k_m"] * p["theta_cr"] + p["k_s"] * (theta - p["theta_cr"])
    if p["loading_row"] > 0.0:
        torque += from_table(theta, int(p["loading_row"]), p, tables)
    return torque


@inlined
def loading_slope(theta: float, p: Scalars, tables: Floats) -> float:
    """Return the slope of the loading curve."""
    slope = p["k_m"] if theta <= p["theta_cr"] else p["k_s"]
    if p["loading_row"] > 0.0:
        slope += table_and_slope(theta, int(p["loading_row"]), p, tables)[1]
    return slope


@inlined
def left_by_winding(theta_max: float, p: Scalars, tables: Floats) -> float:
    """Return the torque-free angle that remains of a winding: the angle that heating can recover.

    The angle is θ_max minus its torque over K_M; of the loading curve's additional torque the share counts that θ_L
    follows.
    """
    left = 0.0
    if theta_max > p["theta_cr"]:
        left = (theta_max - p["theta_cr"]) * (1.0 - p["k_s"] / p["k_m"])
    if p["loading_row"] > 0.0:
        left = max(0.0, left - p["follows"] * from_table(theta_max, int(p["loading_row"]), p, tables) / p["k_m"])
    return left


@inlined
def cold_torque(theta: float, theta_max: float, p: Scalars, tables: Floats) -> float:
    """Return the torque of cold martensite: on its loading curve, or unwound elastically from ``theta_max``."""
    if theta >= theta_max:
        return loading_torque(theta, p, tables)
    return loading_torque(theta_max, p, tables) - p["k_m"] * (theta_max - theta)


@inlined
def friction_and_slope(theta_a: float, up: bool, p: Scalars, tables: Floats) -> tuple[float, float]:
    """Return :func:`friction_torque` and its derivative by the angle."""
    if p["has_friction"] == 0.0:
        return p["tau_c"], 0.0
    friction, slope = table_and_slope(theta_a, FRICTION_UP if up else FRICTION_DOWN, p, tables)
    return (friction, slope) if friction > 0.0 else (0.0, 0.0)


@inlined
def friction_torque(theta_a: float, up: bool, p: Scalars, tables: Floats) -> float:
    """Return the magnitude of the friction torque at θ^A = φ + θ_P/2 for a motion up (φ grows) or down."""
    return friction_and_slope(theta_a, up, p, tables)[0]


class Samples(NamedTuple):
    """The inputs of the stepping rule, sample by sample."""

    per_s: Floats
    """(n,): One over the time since the sample before, 1/s (0 for the first)."""
    temps: Floats
    """(2, n): Wire temperature of the driven spring of this half-cycle, and of the other spring, °C."""
    active: NDArray[np.int8]
    """(n,): 0 while A is driven, 1 while B is."""
    half: Ints
    """(n,): Number of the half-cycle, from 0."""
    directions: NDArray[np.int8]
    """(2, n): From :func:`torsight.actuator.record.turns.turning_points`, for either row of ``temps``."""
    friction_scale: Floats
    """(n,): Factor on the friction at each sample."""
    load_change: Floats
    """(4, n): Factor on the passive spring's torque; additional torques of the active and the passive spring (N·m);
    factor on the torque of cold martensite in either spring, which multiplies the first. No columns where nothing
    changes."""
    slipped: Floats
    """(2, n): Slip of the fixed ends of A and of B, by which their windings are reduced, rad. No columns where none
    slips."""


@compiled
def sampled(
    time_s: Floats, temp_a_c: Floats, temp_b_c: Floats, active: NDArray[np.int8], half: Ints, passive: bool
) -> tuple[Floats, Floats, NDArray[np.int8]]:
    """Return ``per_s``, ``temps`` and ``directions`` of :class:`Samples`.

    The turns of the spring that is not driven are found only with ``passive``, where this spring transforms, too.
    """
    n = time_s.size
    per_s, temps, directions = np.zeros(n), np.empty((2, n)), np.ones((2, n), np.int8)
    for k in range(n):
        if k > 0:
            per_s[k] = 1.0 / (time_s[k] - time_s[k - 1])
        who = int(active[k])
        temps[who, k], temps[1 - who, k] = temp_a_c[k], temp_b_c[k]
    for row in range(2 if passive else 1):
        copy_to(directions[row], turning_points(time_s, temps[row], half, REVERSAL_C))
    return per_s, temps, directions
