# mypy: disable-error-code="no-any-return"
# Elements of numpy arrays carry no type that mypy could check against float.
# ruff: noqa: FBT001
# Compiled functions call each other by position, flags too.
"""The two sides of the balance of torques in one sample, compiled: the active spring's load and its own torque.

``p`` holds the rig's scalars with the active spring's values, ``o`` those with the passive spring's values; ``s``,
``q`` and ``w`` are those of :class:`~torsight.actuator.stepping.kernel_laws.State`.
"""

from __future__ import annotations

from torsight.actuator.stepping.kernel_laws import (
    SEATS,
    SPEED,
    STRAY,
    Scalars,
    State,
    cold_torque,
    done_slope,
    friction_and_slope,
    friction_torque,
    held_place,
    held_table,
    loading_slope,
    share_done,
    side_torque,
    table_and_slope,
    transforms,
    transforms_slope,
    window_place,
)
from torsight.core.compiled import inlined, lending
from torsight.core.units import Floats

PACE, XI_BEFORE = 5, 6
"""Rows of w: rate of ξ over the sample before, 1/s, and ξ at its end."""


@inlined
def held_back(
    heating: bool, place: float, follows: float, j: int, s: Scalars, w: Floats, p: Scalars
) -> tuple[float, float]:
    """Return the place in the window that a section reaches with latent heat, and the place's derivative.

    The derivative is by the law's own place, which is linear in the temperature; ``follows`` is the same without latent
    heat.

    s + ℓ ξ'/w = s_T: s_T the place by the sensor's temperature, ℓ temperature per rate of ξ, w the window's width. ξ'
    at the sample's end follows from the mean rates over this sample and the one before, as the speed does
    (:func:`speed_friction`). Where ξ' is zero, latent heat has no effect.
    """
    part, width = (w[1, j], p["a_width"]) if heating else (1.0 - w[1, j], p["m_width"])
    width /= follows
    delay = p["latent_c_s"] * s["per_s"] * (1.0 + s["ahead"]) / width
    reached = held_place(heating, place + s["ahead"] * p["latent_c_s"] * w[PACE, j] / width, w[2, j], part, delay, p)
    if reached >= place:
        return place, follows
    per_done = transforms_slope(part, share_done(heating, reached, p), p)
    return reached, follows / (1.0 + delay * per_done * done_slope(heating, reached, p))


@inlined
def section_temp(j: int, s: Scalars, p: Scalars, sections: Floats) -> float:
    """Return the temperature of a section of the active spring's wire."""
    return s["temp"] - sections[1, j] - sections[2, j] * (s["temp"] - p["room_c"])


@inlined
def transformed(heating: bool, before: float, done: float, p: Scalars) -> float:
    """Return ξ during a transformation that began at ``before`` and whose law has completed the share ``done``."""
    return before - transforms(before, done, p) if heating else before + transforms(1.0 - before, done, p)


@inlined
def disk_angle(x: float, s: Scalars, p: Scalars) -> float:
    """Return the disk's angle for an angle of the active spring: θ^A without the slip of A's end."""
    return (x if s["sign"] > 0.0 else p["theta_p"] - x) + p["slipped_a"]


@inlined
def cold_and_slope(x: float, s: Scalars, o: Scalars, tables: Floats) -> tuple[float, float]:
    """Return the torque of the passive spring's cold martensite at the active spring's angle ``x``, and dτ/dx."""
    other = o["theta_p"] - x
    slope = -loading_slope(other, o, tables) if other >= s["wound"] else -o["k_m"]
    return cold_torque(other, s["wound"], o, tables), slope


@inlined
def passive_and_slope(x: float, s: Scalars, o: Scalars, tables: Floats) -> tuple[float, float]:
    """Return the passive spring's torque at the active spring's angle ``x``, and its derivative by ``x``."""
    torque, slope = cold_and_slope(x, s, o, tables)
    torque, slope = torque * s["factor"] + s["other"] + s["cross"], slope * s["factor"]
    if o["side_row"] > 0.0:
        side, side_slope = table_and_slope(o["theta_p"] - x, int(o["side_row"]), o, tables)
        torque, slope = torque + side, slope - side_slope
    return torque, slope


@inlined
def bare_and_slope(x: float, s: Scalars, p: Scalars, o: Scalars, tables: Floats) -> tuple[float, float]:
    """Return :func:`bare_load` and its derivative by ``x``."""
    load, slope = passive_and_slope(x, s, o, tables)
    if p["has_stray"] > 0.0:
        stray, stray_slope = table_and_slope(disk_angle(x, s, p), STRAY, p, tables)
        load, slope = load + s["sign"] * stray, slope + stray_slope
    return load, slope


@inlined
def speed_friction(x: float, sense: float, s: Scalars, p: Scalars, tables: Floats) -> tuple[float, float]:
    """Return the speed-dependent friction at a sample's end, and its derivative by ``x``.

    The speed comes from the mean speeds of this sample and the one before, by the second-order backward differentiation
    formula for steps of any length. The mean speed of a single sample is that at its middle, which causes errors of
    several tenths of a degree with few rows per stroke.
    """
    speed = (x - s["x0"]) * s["per_s"]
    speed = sense * (speed + s["ahead"] * (speed - s["before"]))
    friction, per_speed = 0.0, 0.0
    if speed > 0.0:
        friction = p["viscous_nms"] * (speed if p["viscous_power"] == 1.0 else speed ** p["viscous_power"])
        per_speed = p["viscous_power"] * friction / speed
    if p["speed_step"] > 0.0:
        torque, rise = held_table(max(speed, 0.0), SPEED, p["speed_step"], tables)
        friction, per_speed = friction + torque, per_speed + (rise if speed > 0.0 else 0.0)
    return friction, per_speed * sense * s["per_s"] * (1.0 + s["ahead"])


@inlined
def load_and_slope(
    x: float, sense: float, scale: float, s: Scalars, p: Scalars, o: Scalars, tables: Floats
) -> tuple[float, float]:
    """Return the torque that the active spring carries while it slides with ``sense`` (−1: x falls), and dτ/dx.

    −τ^A + τ^B + M − τ_f = 0 (19), M a stray torque along φ; mirrored for B.
    """
    friction, slope = friction_and_slope(disk_angle(x, s, p), sense * s["sign"] > 0.0, p, tables)
    friction, slope = friction * scale, s["sign"] * slope * scale
    if p["viscous_nms"] > 0.0 or p["speed_step"] > 0.0:
        by_speed, speed_slope = speed_friction(x, sense, s, p, tables)
        friction, slope = friction + by_speed, slope + speed_slope
        if friction < 0.0:
            friction, slope = 0.0, 0.0
    load, load_slope = bare_and_slope(x, s, p, o, tables)
    return load - sense * friction, load_slope - sense * slope


@inlined
def load_torque(x: float, sense: float, scale: float, s: Scalars, p: Scalars, o: Scalars, tables: Floats) -> float:
    """Return the torque that the active spring carries while it slides with ``sense``."""
    return load_and_slope(x, sense, scale, s, p, o, tables)[0]


@inlined
def bare_load(x: float, s: Scalars, p: Scalars, o: Scalars, tables: Floats) -> float:
    """Return the torque that the active spring would carry without friction."""
    return bare_and_slope(x, s, p, o, tables)[0]


@inlined
def solid_friction(x: float, sense: float, s: Scalars, p: Scalars, tables: Floats) -> float:
    """Return the friction at the active spring's angle in a sliding direction, without effects of speed and rest."""
    return friction_torque(disk_angle(x, s, p), sense * s["sign"] > 0.0, p, tables)


@inlined
def seat_stiffness(element: int, p: Scalars) -> float:
    """Return the stiffness of one of the friction's elastic elements, N·m/rad; their yield angles are evenly spread."""
    place = (2.0 * element + 1.0) / SEATS - 1.0
    return p["tau_c"] / (SEATS * p["seat_rad"] * (1.0 + p["seat_spread"] * place))


@inlined
def yields_at(sense: float, hold: float, state: State, p: Scalars, tables: Floats) -> float:
    """Return the angle at which all elastic elements of the friction have yielded; the present angle without them."""
    x = state.s[0]["x"]
    if p["seat_rad"] == 0.0:
        return x
    most = solid_friction(x, sense, state.s[0], p, tables) * hold / SEATS
    furthest = 0.0
    for i in range(SEATS):
        furthest = max(furthest, (most - sense * state.held[i]) / seat_stiffness(i, p))
    return x + sense * furthest


@inlined
def seat_holds(element: int, turn: float, hold: float, state: State, p: Scalars, tables: Floats) -> float:
    """Return the torque that one elastic element holds after a further turn, N·m."""
    held = state.held[element] + seat_stiffness(element, p) * turn
    sense = 1.0 if held > 0.0 else -1.0
    return sense * min(sense * held, solid_friction(state.s[0]["x"], sense, state.s[0], p, tables) * hold / SEATS)


@inlined
def seated_load(x: float, hold: float, state: State, p: Scalars, o: Scalars, tables: Floats) -> float:
    """Return the active spring's load at an angle at which the friction's elastic elements hold the disk."""
    load = bare_load(x, state.s[0], p, o, tables)
    for i in range(SEATS):
        load -= seat_holds(i, x - state.s[0]["x"], hold, state, p, tables)
    return load


@inlined
def seated_excess(
    x: float, hold: float, state: State, p: Scalars, o: Scalars, tables: Floats, sections: Floats
) -> float:
    """Return load minus own torque at a trial angle at which the friction's elastic elements hold the disk."""
    load = seated_load(x, hold, state, p, o, tables)
    s, q, w = state.s[0], state.q[0], state.w
    return load - made_torque(x, fraction_and_slope(load, s, p, tables, sections, w)[0], s, q, p, tables)


@inlined
def beside(x: float, s: Scalars, p: Scalars, tables: Floats) -> float:
    """Return the active spring's torque in addition to its phase's: that of the sample plus that over its angle."""
    return s["own"] + side_torque(x, p, tables)


@inlined
def made_and_slopes(
    x: float, xi: float, s: Scalars, q: Scalars, p: Scalars, tables: Floats
) -> tuple[float, float, float]:
    """Return the active spring's own torque (12), (20), and its derivatives by the spring's angle and by ξ.

    On cooling the torque is never less than that of cold martensite: the loading curve or, if the spring lay below this
    curve when it began to cool, the elastic branch. The additional torque (:func:`beside`) is not part of the reference
    state.
    """
    spread, stretch = p["k_m"] - p["k_a"], x - q["x"] - q["theta_l"] * (xi - q["xi"])
    stiffness = p["k_a"] + xi * spread
    torque, by_x, by_xi = q["tau"] + stiffness * stretch, stiffness, spread * stretch - stiffness * q["theta_l"]
    if not s["heating"] > 0.0:
        least = cold_torque(x, q["floor"], p, tables) * s["keeps"]
        if torque < least:
            slope = loading_slope(x, p, tables) if x >= q["floor"] else p["k_m"]
            torque, by_x, by_xi = least, slope * s["keeps"], 0.0
    torque += s["own"]
    if p["side_row"] > 0.0:
        side, side_slope = table_and_slope(x, int(p["side_row"]), p, tables)
        torque, by_x = torque + side, by_x + side_slope
    return torque, by_x, by_xi


@inlined
def made_torque(x: float, xi: float, s: Scalars, q: Scalars, p: Scalars, tables: Floats) -> float:
    """Return the active spring's own torque."""
    return made_and_slopes(x, xi, s, q, p, tables)[0]


@inlined
def excess(x: float, sense: float, state: State, p: Scalars, o: Scalars, tables: Floats, sections: Floats) -> float:
    """Return load minus own torque at a trial angle, signed so that it is positive while the spring must slide on."""
    s, q, w = state.s[0], state.q[0], state.w
    load = load_torque(x, sense, s["scale"], s, p, o, tables)
    return sense * (load - made_torque(x, fraction_and_slope(load, s, p, tables, sections, w)[0], s, q, p, tables))


@inlined
def fraction_and_slope(
    torque: float, s: Scalars, p: Scalars, tables: Floats, sections: Floats, w: Floats
) -> tuple[float, float, bool]:
    """Return the wire's ξ at this torque, its derivative by the torque, and whether any section advances.

    ξ is the weighted mean of the sections' ξ. A transformation only advances: a section's ξ and place stay unless the
    place exceeds the furthest so far. Each section's ξ and place are stored as the trial's.
    """
    heating = s["heating"] > 0.0
    # Derivative of the place in the window by the torque.
    per_torque = -p["temp_per_torque_a"] / p["a_width"] if heating else p["temp_per_torque_m"] / p["m_width"]
    total, slope, advances = 0.0, 0.0, False
    for j in range(w.shape[1]):
        place, follows = window_place(heating, section_temp(j, s, p, sections), torque, p, tables)
        xi = w[0, j]
        if place > w[2, j]:
            advances = True
            if p["latent_c_s"] > 0.0:
                place, follows = held_back(heating, place, follows, j, s, w, p)
            part, sense = (w[1, j], -1.0) if heating else (1.0 - w[1, j], 1.0)
            done = share_done(heating, place, p)
            xi = transformed(heating, w[1, j], done, p)
            per_place = sense * transforms_slope(part, done, p) * done_slope(heating, place, p)
            slope += sections[0, j] * follows * per_torque * per_place
        w[3, j], w[4, j] = xi, max(place, w[2, j])
        total += sections[0, j] * xi
    return total, slope, advances


@inlined
def keep_trial(w: Floats) -> None:
    """Set every section's ξ and place to those of the last trial."""
    for j in range(w.shape[1]):
        w[0, j], w[2, j] = w[3, j], w[4, j]


@lending
def advance(torque: float, s: Scalars, p: Scalars, tables: Floats, sections: Floats, w: Floats) -> float:
    """Set every section's ξ and place to those at this torque and return the wire's ξ."""
    total, _, _ = fraction_and_slope(torque, s, p, tables, sections, w)
    keep_trial(w)
    return total
