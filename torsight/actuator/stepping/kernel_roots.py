# mypy: disable-error-code="no-any-return"
# Elements of numpy arrays carry no type that mypy could check against float.
# ruff: noqa: FBT001
# Compiled functions call each other by position, flags too.
"""One sample of the stepping rule, compiled: what the active spring carries and makes, and where the two meet.

Load less made torque is monotone in the active spring's angle x, so a bracketed root is the answer and no fixed-point
iteration is needed. Where it slides on as before, Newton's steps from an extrapolated guess come to the same root in
two or three.

``p`` holds the rig's scalars with the active spring's values, ``o`` the same with the passive spring's;
``c`` holds what stands during one sample, ``q`` the reference state, ``g`` what goes on from sample to sample, at the
places named here; ``w`` (7, m) per section of the wire: ξ, ξ0, the furthest place in the law's window, a trial's ξ and
place, and at what rate ξ changed before.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from torsight.actuator.stepping.kernel_laws import (
    FRICTION_DOWN,
    FRICTION_UP,
    ROUNDED,
    SPEED,
    STRAY,
    Scalars,
    State,
    bend,
    bent,
    cold_torque,
    done_slope,
    friction_torque,
    from_table,
    held_place,
    held_table,
    left_by_winding,
    loading_slope,
    share_done,
    side_torque,
    table_and_slope,
    window_place,
)
from torsight.core.compiled import inlined, lending
from torsight.core.units import Floats

# Places in c, q and g.
TEMP, HEATING, X0, PER_S, WOUND, CROSS, SCALE, SIGN = 0, 1, 2, 3, 4, 5, 6, 7
TEMP_PASSIVE, TURN_NOW, FACTOR, OWN, OTHER, BEFORE, AHEAD = 8, 9, 10, 11, 12, 13, 14
X_REF, TAU_REF, XI_REF, THETA_L, SLIDING, FLOOR = 0, 1, 2, 3, 4, 5
X_NOW, TAU_NOW, XI_NOW, MOVE, REST_S, XI_P, XI_0_P, TURN_P, CHANGED, WHO, MOVE_2 = 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10
PACE, XI_BEFORE = 5, 6
"""Rows of w: by how much ξ changed per second over the sample before, and ξ at its end."""
# 1e-13 N·m is 1e-10 rad; a step's error does not add up, because the laws hold absolutely at every sample.
TORQUE_TOLERANCE: Final = 1e-13
SLIP_TOLERANCE: Final = 4.0 * TORQUE_TOLERANCE
_NEWTON_STEPS: Final = 8
"""Two or three are usual; where so many do not get there the bracketed search is surer."""


@inlined
def held_back(heating: bool, place: float, j: int, c: Floats, w: Floats, p: Scalars) -> tuple[float, float]:
    """Return the place in the window that latent heat lets a section reach, and how far that follows the sensor's.

    s + ℓ ξ'/w = s_T: s_T the place by the sensor, ℓ what is held back per rate, w the window's width. ξ' at the
    sample's end comes from the mean rates over it and the one before, as the speed does (:func:`speed_friction`); where
    that is none, nothing holds it back any more.
    """
    part, width = (w[1, j], p["a_width"]) if heating else (1.0 - w[1, j], p["m_width"])
    delay = p["latent"] * part * c[PER_S] * (1.0 + c[AHEAD]) / width
    reached = held_place(heating, place + c[AHEAD] * p["latent"] * w[PACE, j] / width, w[2, j], delay, p)
    if reached >= place:
        return place, 1.0
    return reached, 1.0 / (1.0 + delay * done_slope(heating, reached, p))


@inlined
def section_temp(j: int, c: Floats, p: Scalars, sections: Floats) -> float:
    """Return the temperature of a section of the active spring's wire."""
    return c[TEMP] - sections[1, j] - sections[2, j] * (c[TEMP] - p["room_c"])


@inlined
def transformed(heating: bool, before: float, done: float) -> float:
    """Return ξ where it was ``before`` when a transformation began that is ``done`` by so much."""
    return before * (1.0 - done) if heating else before + (1.0 - before) * done


@inlined
def section_at(torque: float, j: int, c: Floats, p: Scalars, sections: Floats, w: Floats) -> tuple[float, float]:
    """Return a section's ξ at a torque, advanced only, and how far in the window its transformation has come."""
    heating = c[HEATING] > 0.0
    place = window_place(heating, section_temp(j, c, p, sections), torque, p)
    if not place > w[2, j]:
        return w[0, j], w[2, j]
    if p["latent"] > 0.0:
        place, _ = held_back(heating, place, j, c, w, p)
    return transformed(heating, w[1, j], share_done(heating, place, p)), place


@inlined
def wire_fraction(torque: float, c: Floats, p: Scalars, sections: Floats, w: Floats) -> float:
    """Return the wire's ξ at this torque: each section's law, advanced only."""
    total = 0.0
    for j in range(w.shape[1]):
        total += sections[0, j] * section_at(torque, j, c, p, sections, w)[0]
    return total


@lending
def advance(torque: float, c: Floats, p: Scalars, sections: Floats, w: Floats) -> float:
    """Set every section to its ξ at this torque and return the wire's."""
    total = 0.0
    for j in range(w.shape[1]):
        w[0, j], w[2, j] = section_at(torque, j, c, p, sections, w)
        total += sections[0, j] * w[0, j]
    return total


@inlined
def passive_torque(x: float, c: Floats, o: Scalars, tables: Floats) -> float:
    """Return the passive spring's torque where the active one's angle is ``x``."""
    other = o["theta_p"] - x
    return cold_torque(other, c[WOUND], o, tables) * c[FACTOR] + c[OTHER] + c[CROSS] + side_torque(other, o, tables)


@inlined
def speed_friction(x: float, sense: float, c: Floats, p: Scalars, tables: Floats) -> float:
    """Return the friction that depends on speed at a sample's end, from the mean speeds over it and the one before.

    The backward differentiation formula of second order for steps of any length: the mean speed of one sample is that
    of its middle, which few rows a stroke would make several tenths of a degree of.
    """
    speed = (x - c[X0]) * c[PER_S]
    speed = max(0.0, sense * (speed + c[AHEAD] * (speed - c[BEFORE])))
    friction = p["viscous"] * (speed if p["viscous_power"] == 1.0 else speed ** p["viscous_power"])
    if p["speed_step"] > 0.0:
        friction += held_table(speed, SPEED, p["speed_step"], tables)[0]
    return friction


@inlined
def load_torque(x: float, sense: float, scale: float, c: Floats, p: Scalars, o: Scalars, tables: Floats) -> float:
    """Return the torque that the active spring carries while it slides with ``sense`` (−1: x falls).

    −τ^A + τ^B + M − τ_f = 0 (19), M a stray torque along φ; mirrored for B.
    """
    theta_a = x if c[SIGN] > 0.0 else p["theta_p"] - x
    friction = friction_torque(theta_a, sense * c[SIGN] > 0.0, p, tables) * scale
    if p["viscous"] > 0.0 or p["speed_step"] > 0.0:
        friction = max(0.0, friction + speed_friction(x, sense, c, p, tables))
    torque = passive_torque(x, c, o, tables) - sense * friction
    if p["has_stray"] > 0.0:
        torque += c[SIGN] * from_table(theta_a, STRAY, p, tables)
    return torque


@inlined
def beside(x: float, c: Floats, p: Scalars, tables: Floats) -> float:
    """Return what the active spring makes beside its phase's torque: by the sample, and by its angle."""
    return c[OWN] + side_torque(x, p, tables)


@inlined
def made_torque(x: float, xi: float, c: Floats, q: Floats, p: Scalars, tables: Floats) -> float:
    """Return the torque that the active spring makes (12), (20); cooling, never less than cold martensite's.

    That is the loading curve, unless the spring lay below it when it began to cool: then the curve's elastic branch.
    What it makes beside that (:func:`beside`) is not in the reference state.
    """
    stiffness = p["k_a"] + xi * (p["k_m"] - p["k_a"])
    torque = q[TAU_REF] + stiffness * (x - q[X_REF] - q[THETA_L] * (xi - q[XI_REF]))
    if c[HEATING] > 0.0:
        return torque + beside(x, c, p, tables)
    return max(torque, cold_torque(x, q[FLOOR], p, tables)) + beside(x, c, p, tables)


@inlined
def excess(x: float, sense: float, state: State, p: Scalars, o: Scalars, tables: Floats, sections: Floats) -> float:
    """Return load less made torque at a trial angle, positive as long as it must slide on."""
    c, q, w = state.c, state.q, state.w
    load = load_torque(x, sense, c[SCALE], c, p, o, tables)
    return sense * (load - made_torque(x, wire_fraction(load, c, p, sections, w), c, q, p, tables))


@inlined
def tightened(a: float, fa: float, b: float, fb: float, x: float, fx: float) -> tuple[float, float, float, float]:
    """Return a bracket, the newest point last, with a point between: the other end's value as Anderson and Björck."""
    if (fx > 0.0) == (fb > 0.0):
        factor = 1.0 - fx / fb
        return a, fa * (factor if factor > 0.0 else 0.5), x, fx
    return b, fb, x, fx


@lending
def slide(
    sense: float, guess: float, first: float, state: State, p: Scalars, o: Scalars, tables: Floats, sections: Floats
) -> float:
    """Return the angle to which the active spring slides in this sample; ``first`` is the excess where it stands.

    A step as long as the last one, then the secant's own steps until the root is passed; then Anderson–Björck.
    """
    a, fa, b, fb = state.c[X0], first, state.c[X0], 0.0
    bracketed = False
    step = max(guess, 1e-7)
    x = a + sense * step
    for _ in range(120):
        fx = excess(x, sense, state, p, o, tables, sections)
        if not bracketed:
            b, fb = x, fx
            if fx <= TORQUE_TOLERANCE:
                bracketed = True
            else:
                drop = (fa - fx) / step
                ahead = 1.05 * fx / drop if drop > 0.0 else 2.0 * step
                a, fa = x, fx
                step = min(max(ahead, 1e-9), 8.0 * step)
        else:
            a, fa, b, fb = tightened(a, fa, b, fb, x, fx)
        if not bracketed:
            x = a + sense * step
            continue
        if abs(fb) <= TORQUE_TOLERANCE or abs(b - a) < ROUNDED or fa == fb:
            break
        x = b - fb * (b - a) / (fb - fa)
    return b


@inlined
def _cold_and_slope(x: float, c: Floats, o: Scalars, tables: Floats) -> tuple[float, float]:
    """Return the torque of the passive spring's cold martensite where the active one's angle is ``x``, and dτ/dx."""
    other = o["theta_p"] - x
    slope = -loading_slope(other, o, tables) if other >= c[WOUND] else -o["k_m"]
    return cold_torque(other, c[WOUND], o, tables), slope


@inlined
def _load_and_slope(x: float, sense: float, c: Floats, p: Scalars, o: Scalars, tables: Floats) -> tuple[float, float]:
    """Return :func:`load_torque` with its derivative."""
    other = p["theta_p"] - x
    load, slope = _cold_and_slope(x, c, o, tables)
    load, slope = load * c[FACTOR] + c[OTHER] + c[CROSS], slope * c[FACTOR]
    if o["side_row"] > 0.0:
        side, side_slope = table_and_slope(other, int(o["side_row"]), o, tables)
        load, slope = load + side, slope - side_slope
    theta_a = x if c[SIGN] > 0.0 else other
    friction, friction_slope = p["tau_c"], 0.0
    if p["has_friction"] > 0.0:
        friction, friction_slope = table_and_slope(
            theta_a, FRICTION_UP if sense * c[SIGN] > 0.0 else FRICTION_DOWN, p, tables
        )
        if friction < 0.0:
            friction, friction_slope = 0.0, 0.0
    friction, friction_slope = friction * c[SCALE], c[SIGN] * friction_slope * c[SCALE]
    if p["viscous"] > 0.0 or p["speed_step"] > 0.0:
        per_angle = sense * c[PER_S] * (1.0 + c[AHEAD])
        speed = sense * ((x - c[X0]) * c[PER_S] * (1.0 + c[AHEAD]) - c[AHEAD] * c[BEFORE])
        if speed > 0.0:
            torque = p["viscous"] * (speed if p["viscous_power"] == 1.0 else speed ** p["viscous_power"])
            friction, friction_slope = (
                friction + torque,
                friction_slope + p["viscous_power"] * torque / speed * per_angle,
            )
        if p["speed_step"] > 0.0:
            torque, per_speed = held_table(max(speed, 0.0), SPEED, p["speed_step"], tables)
            friction += torque
            if speed > 0.0:
                friction_slope += per_speed * per_angle
        if friction < 0.0:
            friction, friction_slope = 0.0, 0.0
    load, slope = load - sense * friction, slope - sense * friction_slope
    if p["has_stray"] > 0.0:
        stray, stray_slope = table_and_slope(theta_a, STRAY, p, tables)
        load, slope = load + c[SIGN] * stray, slope + stray_slope
    return load, slope


@inlined
def _fraction_and_slope(torque: float, c: Floats, p: Scalars, sections: Floats, w: Floats) -> tuple[float, float, bool]:
    """Return :func:`wire_fraction` by Liang and Rogers, its derivative, and whether any section advances.

    Each section's ξ and place are kept as the trial's.
    """
    heating = c[HEATING] > 0.0
    # By how much the window's place moves per torque.
    per_torque = -p["temp_per_torque_a"] / p["a_width"] if heating else p["temp_per_torque_m"] / p["m_width"]
    ahead = bend(heating, p)
    total, slope, advances = 0.0, 0.0, False
    for j in range(w.shape[1]):
        place = window_place(heating, section_temp(j, c, p, sections), torque, p)
        xi, follows = w[0, j], 1.0
        if place > w[2, j]:
            advances = True
            if p["latent"] > 0.0:
                place, follows = held_back(heating, place, j, c, w, p)
            xi = 0.0 if heating else 1.0
            if place < 1.0:
                cosine = np.cos(np.pi * bent(place, ahead))
                half = 0.5 * (w[1, j] if heating else w[1, j] - 1.0)
                xi += half * (1.0 + cosine)
                steepness = np.pi * (1.0 + ahead * (1.0 - 2.0 * place)) * per_torque
                slope -= sections[0, j] * follows * steepness * half * np.sqrt(max(0.0, 1.0 - cosine * cosine))
        w[3, j], w[4, j] = xi, max(place, w[2, j])
        total += sections[0, j] * xi
    return total, slope, advances


@lending
def glide(c: Floats, q: Floats, g: Floats, w: Floats, p: Scalars, o: Scalars, tables: Floats, sections: Floats) -> bool:
    """Slide on as in the sample before, by Newton's steps; False, and nothing changed, where that is not the answer.

    For Liang–Rogers. Monotone excess: where its root lies on the way that the spring slides, it slides there.
    """
    heating, sense, x = c[HEATING] > 0.0, q[SLIDING], g[X_NOW]
    spread = p["k_m"] - p["k_a"]
    # Where nothing transforms it slides on only if the load changes, or if grease had held it back.
    may_creep = p["steady"] == 0.0 or p["viscous"] > 0.0 or p["speed_step"] > 0.0
    bare = not may_creep and p["has_friction"] + p["has_stray"] + p["side_row"] + o["side_row"] + p["dwell_step"] == 0.0
    least_excess = 0.0 if bare else SLIP_TOLERANCE
    x += sense * max(2.0 * g[MOVE] - g[MOVE_2], 0.0)
    for _ in range(_NEWTON_STEPS):
        if bare:
            load, load_slope = _cold_and_slope(x, c, o, tables)
            load -= sense * p["tau_c"]
        else:
            load, load_slope = _load_and_slope(x, sense, c, p, o, tables)
        xi, xi_slope, advances = _fraction_and_slope(load, c, p, sections, w)
        if not (advances or may_creep):
            return False
        stiffness, stretch = p["k_a"] + xi * spread, x - q[X_REF] - q[THETA_L] * (xi - q[XI_REF])
        made = q[TAU_REF] + stiffness * stretch
        slope = stiffness + (spread * stretch - stiffness * q[THETA_L]) * xi_slope * load_slope
        if not heating:
            least = cold_torque(x, q[FLOOR], p, tables)
            if made < least:
                made, slope = least, loading_slope(x, p, tables) if x >= q[FLOOR] else p["k_m"]
        made += c[OWN]
        if p["side_row"] > 0.0:
            side, side_slope = table_and_slope(x, int(p["side_row"]), p, tables)
            made, slope = made + side, slope + side_slope
        if abs(load - made) <= TORQUE_TOLERANCE:
            if sense * (x - g[X_NOW]) * abs(load_slope - slope) < least_excess:
                return False
            g[MOVE_2], g[MOVE] = g[MOVE], abs(x - g[X_NOW])
            g[X_NOW], g[TAU_NOW], g[XI_NOW] = x, load, xi
            for j in range(w.shape[1]):
                w[0, j], w[2, j] = w[3, j], w[4, j]
            return True
        x -= (load - made) / (load_slope - slope)
    return False


@lending
def stick(
    x: float, total: float, c: Floats, q: Floats, w: Floats, p: Scalars, tables: Floats, sections: Floats
) -> float:
    """Return ξ at the kept angle: the law at the torque that this very ξ makes (Anderson–Björck)."""
    a, fa, b, fb = total, 0.0, total, 0.0
    xi = total
    for trial in range(80):
        law = wire_fraction(made_torque(x, xi, c, q, p, tables), c, p, sections, w)
        fx = xi - law
        if trial == 0:
            if fx == 0.0:
                return xi
            fa = fx
            xi = law
            continue
        if trial == 1:
            b, fb = xi, fx
        else:
            a, fa, b, fb = tightened(a, fa, b, fb, xi, fx)
        if abs(fb) <= ROUNDED or abs(b - a) < ROUNDED or fa == fb:
            break
        xi = b - fb * (b - a) / (fb - fa)
    return b


@lending
def sticking_end(x: float, load: float, xi_from: float, xi_to: float, q: Floats, p: Scalars) -> float:
    """Return ξ between the two at which the made torque reaches the load at a kept angle (21), (24)."""
    a, b = xi_from, xi_to
    slope = p["k_m"] - p["k_a"]
    for _ in range(60):
        xi = 0.5 * (a + b)
        torque = q[TAU_REF] + (p["k_a"] + xi * slope) * (x - q[X_REF] - q[THETA_L] * (xi - q[XI_REF]))
        # While ξ falls the torque grows towards the load, while ξ grows it falls towards it.
        if (torque - load) * (xi_to - xi_from) > 0.0:
            a = xi
        else:
            b = xi
    return 0.5 * (a + b)


@inlined
def _passive_excess(xi: float, base: float, angle: float, heating: bool, c: Floats, g: Floats, o: Scalars) -> float:
    """Return the passive spring's ξ by the law at the torque that a trial ξ makes, less the trial."""
    torque = base + (o["k_a"] + xi * (o["k_m"] - o["k_a"])) * angle * (1.0 - xi)
    done = share_done(heating, window_place(heating, c[TEMP_PASSIVE], torque, o), o)
    return transformed(heating, g[XI_0_P], done) - xi


@lending
def crosstalk(theta: float, c: Floats, g: Floats, o: Scalars, tables: Floats) -> float:
    """Let the passive spring transform at its own temperature and return the torque that its recovery adds."""
    base = cold_torque(theta, c[WOUND], o, tables)
    angle = left_by_winding(c[WOUND], o, tables) * o["passive_share"]
    if c[TURN_NOW] != g[TURN_P]:
        g[XI_0_P], g[TURN_P] = g[XI_P], c[TURN_NOW]
    heating, xi = g[TURN_P] > 0.0, g[XI_P]
    # What the law at the torque of a trial ξ is above the trial falls as the trial grows, in both directions of change.
    a, fa = xi, _passive_excess(xi, base, angle, heating, c, g, o)
    fraction = xi
    if (fa < 0.0) if heating else (fa > 0.0):
        b = 0.0 if heating else 1.0
        fb = _passive_excess(b, base, angle, heating, c, g, o)
        for _ in range(80):
            if abs(fb) <= ROUNDED or abs(b - a) < ROUNDED or fa == fb:
                break
            x = b - fb * (b - a) / (fb - fa)
            a, fa, b, fb = tightened(a, fa, b, fb, x, _passive_excess(x, base, angle, heating, c, g, o))
        fraction = b
    if abs(fraction - xi) > ROUNDED:
        g[XI_P] = fraction
    fraction = g[XI_P]
    return (o["k_a"] + fraction * (o["k_m"] - o["k_a"])) * angle * (1.0 - fraction)
