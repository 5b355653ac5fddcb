# mypy: disable-error-code="no-any-return"
# Records carry no types of their fields.
"""Phase fraction and torque of one spring in the moving rig, compiled.

A spring is cold martensite (being wound or unwound), heating, or cooling. Phase and torque hold each other: stress
shifts the transformation, the transformation makes stress. Both laws are monotone, so the pair has one solution; it
is found by a bracketed secant on the torque.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from torsight.core.compiled import lending, shared
from torsight.core.units import Floats
from torsight.synthetic.effects.hidden import STIFFENING_FORMS
from torsight.synthetic.effects.rig_laws import SLOTS
from torsight.synthetic.rig.rig_values import ONSET_SCALE_RAD, Constants, has_law, law

# Columns of a spring's state, and how many there are.
THETA_MAX, MODE, THETA_R, TAU_R, XI_R, THETA_L, TURN_C, WARMING, TAU, XI, FACTOR, CYCLE, COLUMNS = range(13)

COLD, HEATING, COOLING = 0.0, 1.0, 2.0
"""Modes of a spring."""


class Spring(NamedTuple):
    """One spring: its state (columns as above); per zone the fraction at the last turn and now, weight and coolness."""

    s: Floats
    xi0: Floats
    xi: Floats
    weight: Floats
    cooler_c: Floats


LOADING, BEND, BEND_ALONE = (STIFFENING_FORMS.index(form) for form in ("loading", "bend", "bend_alone"))
"""Stiffening that belongs to the loading curve: a third slope, or a cubic."""

_WINDING: Final = SLOTS["winding", "winding"]
_LOADING: Final = SLOTS["loading", "winding"]
_PHASE: Final = SLOTS["phase", "temperature"]

TORQUE_TOLERANCE_NM: Final = 1e-12
"""A spring that is wound beyond θ_cr turns by 1e-12 N·m / K_S = 4e-9 rad for it: no camera sees that."""


@shared
def loading(c: Constants, theta: float) -> float:
    """Return the martensite loading curve, N·m: two slopes, and where the rig has one a third, a bend or a law."""
    if theta <= c.theta_cr:
        return c.k_m * theta
    tau: float = c.k_m * c.theta_cr + c.k_s * (theta - c.theta_cr) + third_slope(c) * max(theta - c.stiff_onset, 0.0)
    return tau + bend(c, theta) + law(c, _LOADING, theta)


@lending
def bend(c: Constants, theta: float) -> float:
    """Return the excess torque, N·m, of a loading curve with cubic stiffening over that of two slopes.

    It steepens the second slope by 0.8 of its difference from the first at most: no real spring is steeper.
    """
    if c.stiff_form < BEND or theta <= c.stiff_onset or c.stiff == 0.0:
        return 0.0
    steepest = 0.8 * (c.k_m - c.k_s)
    limit = ONSET_SCALE_RAD * math.sqrt(steepest * ONSET_SCALE_RAD / (3.0 * c.stiff))
    past = theta - c.stiff_onset
    return c.stiff * (min(past, limit) / ONSET_SCALE_RAD) ** 3 + steepest * max(past - limit, 0.0)


@lending
def third_slope(c: Constants) -> float:
    """Return the difference between the loading curve's third and second slope, N·m/rad."""
    return c.stiff / ONSET_SCALE_RAD if c.stiff_form == LOADING else 0.0


@shared
def unwound_from(c: Constants, theta: float, tau: float) -> float:
    """Return the angle from which cold martensite was unwound that carries ``tau``; ``theta`` on its loading curve."""
    if tau >= loading(c, theta):
        return theta
    start = max(theta, c.theta_cr)
    if c.stiff_form >= BEND or has_law(c, _LOADING):
        return unwound_along(c, theta, tau, start)
    over = max(loading(c, start) - c.k_m * (start - theta) - tau, 0.0)
    second = max(c.stiff_onset - start, 0.0) if c.stiff_form == LOADING else np.inf
    if over <= second * (c.k_m - c.k_s):
        return start + over / (c.k_m - c.k_s)
    return start + second + (over - second * (c.k_m - c.k_s)) / (c.k_m - c.k_s - third_slope(c))


@lending
def unwound_along(c: Constants, theta: float, tau: float, start: float) -> float:
    """Return the angle of :func:`unwound_from` for a loading curve of any shape with slopes below K_M, by bisection."""
    low, reach = start, 0.1
    while loading(c, start + reach) - c.k_m * (start + reach - theta) > tau and reach < 1e3:
        low, reach = start + reach, 2.0 * reach
    high = start + reach
    # Sixty halvings of 1000 rad at most leave 1e-15 rad: rounding.
    for _ in range(60):
        middle = 0.5 * (low + high)
        if loading(c, middle) - c.k_m * (middle - theta) > tau:
            low = middle
        else:
            high = middle
    return low


@lending
def past_onset(theta: float, onset: float, rise: float, power: float) -> float:
    """Return a torque that starts at an onset and reaches ``rise`` 100° past it."""
    if rise == 0.0 or theta <= onset:
        return 0.0
    return rise * math.pow((theta - onset) / ONSET_SCALE_RAD, power)


@lending
def recoverable(c: Constants, theta_max: float) -> float:
    """Return the angle that heating recovers after winding to ``theta_max``."""
    excess = bend(c, theta_max) if c.stiff_form == BEND_ALONE else 0.0
    return max(theta_max - (loading(c, theta_max) - excess) / c.k_m, 0.0)


@lending
def side_torque(c: Constants, theta: float, temp_c: float) -> float:
    """Return the torque in addition to the phase law: stiffening, a law of the winding, the R-phase's early step."""
    power = 3.0 if c.stiff_form == 0 else (1.0 if c.stiff_form == 1 else 2.0)
    tau = law(c, _WINDING, theta)
    if c.stiff_form < LOADING:
        tau += past_onset(theta, c.stiff_onset, c.stiff, power)
    if c.r_step != 0.0:
        x = min(max((temp_c - c.r_start) / c.r_width, 0.0), 1.0)
        tau += c.k_m * c.r_step * 0.5 * (1.0 - math.cos(math.pi * x))
    return tau


@lending
def progress(c: Constants, share: float) -> float:
    """Return the progress of the transformation (0 to 1) at a share of its window."""
    x = min(max(share, 0.0), 1.0)
    if c.bend != 0.0:
        x += c.bend * math.sin(math.pi * x) / math.pi
    usual = 0.5 * (1.0 - math.cos(math.pi * x))
    if c.tanaka == 0.0:
        return usual
    return (1.0 - c.tanaka) * usual + c.tanaka * (1.0 - math.pow(0.01, max(share, 0.0)))


@lending
def zone_fraction(c: Constants, s: Floats, temp_c: float, tau: float, xi0: float, xi: float) -> float:
    """Return the martensite fraction of one zone of a spring in state ``s``; it only advances."""
    warming = s[WARMING] == 1.0
    temp_c -= s[CYCLE] * (c.drift_heating if warming else c.drift_cooling)
    stress = c.stress_per_nm * tau
    free_c = temp_c - stress / (c.c_a * c.c_a_scale if warming else c.c_m * c.c_m_scale)
    free_c += law(c, _PHASE, free_c)
    if warming:
        done = progress(c, (free_c - c.a_s) / c.a_width)
        scaled, whole = xi0 * (1.0 - done), min(xi0, 1.0 - done)
        return min(xi, scaled + c.loop_memory * (whole - scaled))
    done = progress(c, (c.m_s - free_c) / c.m_width)
    scaled, whole = xi0 + (1.0 - xi0) * done, max(xi0, done)
    return max(xi, scaled + c.loop_memory * (whole - scaled))


@lending
def zone_temperature(c: Constants, temp_c: float, cooler_c: float) -> float:
    """Return the temperature of a zone that is cooler than the middle."""
    if cooler_c == 0.0:
        return temp_c
    excess = max(temp_c - c.room_c, 0.0) / c.zone_scale
    return temp_c - cooler_c * (excess if c.zone_form == 1 else min(excess, 1.0))


@lending
def fraction(c: Constants, spring: Spring, temp_c: float, tau: float) -> float:
    """Return the martensite fraction of the whole wire."""
    total = 0.0
    for i in range(spring.weight.size):
        zone_c = zone_temperature(c, temp_c, spring.cooler_c[i])
        done = zone_fraction(c, spring.s, zone_c, tau, spring.xi0[i], spring.xi[i])
        total += spring.weight[i] * done
    return total


@lending
def torque(c: Constants, s: Floats, theta: float, xi: float, temp_c: float) -> float:
    """Return a spring's torque at an angle and a martensite fraction, N·m."""
    stiffness = c.k_a + xi * (c.k_m - c.k_a)
    tau: float
    if s[MODE] == COLD:
        wound = max(theta, s[THETA_MAX])
        tau = (loading(c, wound) - c.k_m * (wound - theta)) * s[FACTOR]
        if xi < 1.0:
            tau += c.crosstalk_share * stiffness * recoverable(c, wound) * (1.0 - xi)
    else:
        tau = s[TAU_R] + stiffness * ((theta - s[THETA_R]) - s[THETA_L] * (xi - s[XI_R]))
        if s[MODE] == COOLING:
            wound = max(theta, s[THETA_MAX])
            tau = max(tau, loading(c, wound) - c.k_m * (wound - theta))
    return tau + side_torque(c, theta, temp_c)


@lending
def transforms(c: Constants, s: Floats) -> bool:
    """Return whether the spring's phase can change now."""
    return s[MODE] != COLD or c.crosstalk == 1


@lending
def tightened(a: float, ra: float, b: float, rb: float, new: float, r: float) -> tuple[float, float, float, float]:
    """Return a bracket of a root and both residuals, with a new point as its second end."""
    # Illinois: halve the stale end's weight, so that the bracket closes from both sides.
    return (a, 0.5 * ra, new, r) if (r > 0.0) == (rb > 0.0) else (b, rb, new, r)


@lending
def solve_spring(c: Constants, spring: Spring, theta: float, temp_c: float) -> float:
    """Return the torque at which phase and stress agree, N·m; the state is not changed."""
    s = spring.s
    if not transforms(c, s):
        return torque(c, s, theta, s[XI], temp_c)
    a = s[TAU]
    b = torque(c, s, theta, fraction(c, spring, temp_c, a), temp_c)
    # More torque leaves more martensite, more martensite makes less torque: the answer lies between a and b.
    ga = a - b
    if abs(ga) < TORQUE_TOLERANCE_NM:
        return b
    gb = b - torque(c, s, theta, fraction(c, spring, temp_c, b), temp_c)
    for _ in range(100):
        if abs(gb) < TORQUE_TOLERANCE_NM or abs(b - a) < TORQUE_TOLERANCE_NM:
            break
        new = b - gb * (b - a) / (gb - ga)
        g = new - torque(c, s, theta, fraction(c, spring, temp_c, new), temp_c)
        a, ga, b, gb = tightened(a, ga, b, gb, new, g)
    return b


@lending
def commit_spring(c: Constants, spring: Spring, theta: float, temp_c: float) -> None:
    """Move the spring's state to an angle and a temperature."""
    s, xi0, xi, weight, cooler_c = spring
    tau = solve_spring(c, spring, theta, temp_c)
    if transforms(c, s):
        total = 0.0
        for i in range(weight.size):
            zone_c = zone_temperature(c, temp_c, cooler_c[i])
            xi[i] = zone_fraction(c, s, zone_c, tau, xi0[i], xi[i])
            total += weight[i] * xi[i]
        s[XI] = total
    s[TAU] = tau
    if s[MODE] == COLD:
        s[THETA_MAX] = max(s[THETA_MAX], theta)


@lending
def turn(spring: Spring, warming: int) -> None:
    """Begin a transformation in the other direction from the present fractions."""
    spring.s[WARMING] = warming
    for i in range(spring.xi.size):
        spring.xi0[i] = spring.xi[i]


@lending
def follow_passive(spring: Spring, temp_c: float, slack_c: float) -> None:
    """Let a spring that is not driven reverse its transformation with its own temperature."""
    s = spring.s
    if s[WARMING] > 0.5:
        if temp_c > s[TURN_C]:
            s[TURN_C] = temp_c
        elif temp_c < s[TURN_C] - slack_c:
            turn(spring, 0)
            s[TURN_C] = temp_c
    elif temp_c < s[TURN_C]:
        s[TURN_C] = temp_c
    elif temp_c > s[TURN_C] + slack_c:
        turn(spring, 1)
        s[TURN_C] = temp_c


@lending
def retake_reference(c: Constants, s: Floats, theta: float, temp_c: float) -> None:
    """Take the present state as the reference of the active spring's torque."""
    s[THETA_R] = theta
    s[TAU_R] = s[TAU] - side_torque(c, theta, temp_c)
    s[XI_R] = s[XI]


@lending
def set_cold(c: Constants, spring: Spring, theta: float, temp_c: float) -> None:
    """Make an active spring cold martensite on its loading curve; a spring below that curve stays below."""
    s = spring.s
    s[MODE] = COLD
    s[THETA_MAX] = unwound_from(c, theta, s[TAU] - side_torque(c, theta, temp_c))
    s[FACTOR] = 1.0
    set_martensite(c, spring, theta, temp_c)


@lending
def set_martensite(c: Constants, spring: Spring, theta: float, temp_c: float) -> None:
    """Make all of a cold spring martensite and keep its winding; its next transformation is on warming."""
    s = spring.s
    for i in range(spring.xi.size):
        spring.xi[i] = 1.0
    s[XI] = 1.0
    turn(spring, 1)
    s[TURN_C] = temp_c
    s[TAU] = torque(c, s, theta, 1.0, temp_c)


@lending
def start_heating(c: Constants, spring: Spring, theta: float, temp_c: float, cycle: float, share: float) -> None:
    """Switch a cold spring on: it recovers a share of the angle of its last winding, less the loss by fatigue."""
    s = spring.s
    s[CYCLE] = cycle
    set_martensite(c, spring, theta, temp_c)
    left = (1.0 - c.fatigue) ** cycle
    if c.fatigue_form != 0:
        left = 1.0 - c.fatigue * (1.0 - math.exp(-cycle / c.fatigue_cycles))
    whole = share * recoverable(c, s[THETA_MAX])
    if c.fatigue_form == 2:
        s[THETA_L] = max(0.0, whole - (1.0 - left) * recoverable(c, 0.66 * c.theta_p))
    else:
        s[THETA_L] = whole * left
    retake_reference(c, s, theta, temp_c)
    s[MODE] = HEATING


@lending
def restart_heating(c: Constants, spring: Spring, theta: float, temp_c: float) -> None:
    """Heat a spring again before it is cold: it recovers the same angle again, limited by its winding."""
    s = spring.s
    wound = unwound_from(c, theta, s[TAU] - side_torque(c, theta, temp_c))
    s[THETA_L] = min(s[THETA_L], recoverable(c, wound) / max(s[XI], 1e-9))
    turn(spring, 1)
    retake_reference(c, s, theta, temp_c)
    s[MODE] = HEATING


@lending
def start_cooling(c: Constants, spring: Spring, theta: float, temp_c: float) -> None:
    """Switch a heated spring off: a spring below its loading curve counts as unwound from a larger angle."""
    s = spring.s
    turn(spring, 0)
    retake_reference(c, s, theta, temp_c)
    s[MODE] = COOLING
    s[THETA_MAX] = unwound_from(c, theta, s[TAU_R])
