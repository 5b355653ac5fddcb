# mypy: disable-error-code="no-any-return"
# Elements of numpy arrays carry no type that mypy could check against float.
# ruff: noqa: FBT001
# Compiled functions call each other by position, flags too.
"""The two sides of the balance of torques in one sample, compiled: the active spring's load and its own torque.

``p`` holds the rig's scalars with the active spring's values, ``o`` those with the passive spring's values; ``c`` holds
the values of one sample, ``q`` the reference state, ``g`` the values that persist from sample to sample, at the indices
named here; ``w`` (7, m) holds per section of the wire: ξ, ξ0, the furthest place in the law's window, a trial's ξ and
place, the rate of ξ over the sample before, and ξ at its end.
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

# Indices in c, q and g.
TEMP, HEATING, X0, PER_S, WOUND, CROSS, SCALE, SIGN = 0, 1, 2, 3, 4, 5, 6, 7
TEMP_PASSIVE, TURN_NOW, FACTOR, OWN, OTHER, BEFORE, AHEAD, GUESS, KEEPS = 8, 9, 10, 11, 12, 13, 14, 15, 16
X_REF, TAU_REF, XI_REF, THETA_L, SLIDING, FLOOR, BEGUN, AT_REST = 0, 1, 2, 3, 4, 5, 6, 7
X_NOW, TAU_NOW, XI_NOW, RATE, REST_S, XI_P, XI_0_P, TURN_P, CHANGED, WHO, RATE_2 = 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10
SHORT, JUMP, LET_GO, RATE_3, SPAN, SPAN_2 = 11, 13, 14, 15, 16, 17
"""Indices in g: torque by which either direction fell short of sliding, N·m; jump of a disk that had been at rest, in
this sample, and the part of the sample after which it broke loose; divided differences of the last slides (with RATE
and RATE_2), and the durations of the last two samples, s."""
PACE, XI_BEFORE = 5, 6
"""Rows of w: rate of ξ over the sample before, 1/s, and ξ at its end."""


@inlined
def held_back(
    heating: bool, place: float, follows: float, j: int, c: Floats, w: Floats, p: Scalars
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
    delay = p["latent"] * c[PER_S] * (1.0 + c[AHEAD]) / width
    reached = held_place(heating, place + c[AHEAD] * p["latent"] * w[PACE, j] / width, w[2, j], part, delay, p)
    if reached >= place:
        return place, follows
    per_done = transforms_slope(part, share_done(heating, reached, p), p)
    return reached, follows / (1.0 + delay * per_done * done_slope(heating, reached, p))


@inlined
def section_temp(j: int, c: Floats, p: Scalars, sections: Floats) -> float:
    """Return the temperature of a section of the active spring's wire."""
    return c[TEMP] - sections[1, j] - sections[2, j] * (c[TEMP] - p["room_c"])


@inlined
def transformed(heating: bool, before: float, done: float, p: Scalars) -> float:
    """Return ξ during a transformation that began at ``before`` and whose law has completed the share ``done``."""
    return before - transforms(before, done, p) if heating else before + transforms(1.0 - before, done, p)


@inlined
def disk_angle(x: float, c: Floats, p: Scalars) -> float:
    """Return the disk's angle for an angle of the active spring: θ^A without the slip of A's end."""
    return (x if c[SIGN] > 0.0 else p["theta_p"] - x) + p["slipped_a"]


@inlined
def cold_and_slope(x: float, c: Floats, o: Scalars, tables: Floats) -> tuple[float, float]:
    """Return the torque of the passive spring's cold martensite at the active spring's angle ``x``, and dτ/dx."""
    other = o["theta_p"] - x
    slope = -loading_slope(other, o, tables) if other >= c[WOUND] else -o["k_m"]
    return cold_torque(other, c[WOUND], o, tables), slope


@inlined
def passive_and_slope(x: float, c: Floats, o: Scalars, tables: Floats) -> tuple[float, float]:
    """Return the passive spring's torque at the active spring's angle ``x``, and its derivative by ``x``."""
    torque, slope = cold_and_slope(x, c, o, tables)
    torque, slope = torque * c[FACTOR] + c[OTHER] + c[CROSS], slope * c[FACTOR]
    if o["side_row"] > 0.0:
        side, side_slope = table_and_slope(o["theta_p"] - x, int(o["side_row"]), o, tables)
        torque, slope = torque + side, slope - side_slope
    return torque, slope


@inlined
def bare_and_slope(x: float, c: Floats, p: Scalars, o: Scalars, tables: Floats) -> tuple[float, float]:
    """Return :func:`bare_load` and its derivative by ``x``."""
    load, slope = passive_and_slope(x, c, o, tables)
    if p["has_stray"] > 0.0:
        stray, stray_slope = table_and_slope(disk_angle(x, c, p), STRAY, p, tables)
        load, slope = load + c[SIGN] * stray, slope + stray_slope
    return load, slope


@inlined
def speed_friction(x: float, sense: float, c: Floats, p: Scalars, tables: Floats) -> tuple[float, float]:
    """Return the speed-dependent friction at a sample's end, and its derivative by ``x``.

    The speed comes from the mean speeds of this sample and the one before, by the second-order backward differentiation
    formula for steps of any length. The mean speed of a single sample is that at its middle, which causes errors of
    several tenths of a degree with few rows per stroke.
    """
    speed = (x - c[X0]) * c[PER_S]
    speed = sense * (speed + c[AHEAD] * (speed - c[BEFORE]))
    friction, per_speed = 0.0, 0.0
    if speed > 0.0:
        friction = p["viscous"] * (speed if p["viscous_power"] == 1.0 else speed ** p["viscous_power"])
        per_speed = p["viscous_power"] * friction / speed
    if p["speed_step"] > 0.0:
        torque, rise = held_table(max(speed, 0.0), SPEED, p["speed_step"], tables)
        friction, per_speed = friction + torque, per_speed + (rise if speed > 0.0 else 0.0)
    return friction, per_speed * sense * c[PER_S] * (1.0 + c[AHEAD])


@inlined
def load_and_slope(
    x: float, sense: float, scale: float, c: Floats, p: Scalars, o: Scalars, tables: Floats
) -> tuple[float, float]:
    """Return the torque that the active spring carries while it slides with ``sense`` (−1: x falls), and dτ/dx.

    −τ^A + τ^B + M − τ_f = 0 (19), M a stray torque along φ; mirrored for B.
    """
    friction, slope = friction_and_slope(disk_angle(x, c, p), sense * c[SIGN] > 0.0, p, tables)
    friction, slope = friction * scale, c[SIGN] * slope * scale
    if p["viscous"] > 0.0 or p["speed_step"] > 0.0:
        by_speed, speed_slope = speed_friction(x, sense, c, p, tables)
        friction, slope = friction + by_speed, slope + speed_slope
        if friction < 0.0:
            friction, slope = 0.0, 0.0
    load, load_slope = bare_and_slope(x, c, p, o, tables)
    return load - sense * friction, load_slope - sense * slope


@inlined
def load_torque(x: float, sense: float, scale: float, c: Floats, p: Scalars, o: Scalars, tables: Floats) -> float:
    """Return the torque that the active spring carries while it slides with ``sense``."""
    return load_and_slope(x, sense, scale, c, p, o, tables)[0]


@inlined
def bare_load(x: float, c: Floats, p: Scalars, o: Scalars, tables: Floats) -> float:
    """Return the torque that the active spring would carry without friction."""
    return bare_and_slope(x, c, p, o, tables)[0]


@inlined
def solid_friction(x: float, sense: float, c: Floats, p: Scalars, tables: Floats) -> float:
    """Return the friction at the active spring's angle in a sliding direction, without effects of speed and rest."""
    return friction_torque(disk_angle(x, c, p), sense * c[SIGN] > 0.0, p, tables)


@inlined
def seat_stiffness(element: int, p: Scalars) -> float:
    """Return the stiffness of one of the friction's elastic elements, N·m/rad; their yield angles are evenly spread."""
    place = (2.0 * element + 1.0) / SEATS - 1.0
    return p["tau_c"] / (SEATS * p["seat"] * (1.0 + p["seat_spread"] * place))


@inlined
def yields_at(sense: float, hold: float, state: State, p: Scalars, tables: Floats) -> float:
    """Return the angle at which all elastic elements of the friction have yielded; the present angle without them."""
    x = state.g[X_NOW]
    if p["seat"] == 0.0:
        return x
    most = solid_friction(x, sense, state.c, p, tables) * hold / SEATS
    furthest = 0.0
    for i in range(SEATS):
        furthest = max(furthest, (most - sense * state.held[i]) / seat_stiffness(i, p))
    return x + sense * furthest


@inlined
def seat_holds(element: int, turn: float, hold: float, state: State, p: Scalars, tables: Floats) -> float:
    """Return the torque that one elastic element holds after a further turn, N·m."""
    held = state.held[element] + seat_stiffness(element, p) * turn
    sense = 1.0 if held > 0.0 else -1.0
    return sense * min(sense * held, solid_friction(state.g[X_NOW], sense, state.c, p, tables) * hold / SEATS)


@inlined
def seated_load(x: float, hold: float, state: State, p: Scalars, o: Scalars, tables: Floats) -> float:
    """Return the active spring's load at an angle at which the friction's elastic elements hold the disk."""
    load = bare_load(x, state.c, p, o, tables)
    for i in range(SEATS):
        load -= seat_holds(i, x - state.g[X_NOW], hold, state, p, tables)
    return load


@inlined
def seated_excess(
    x: float, hold: float, state: State, p: Scalars, o: Scalars, tables: Floats, sections: Floats
) -> float:
    """Return load minus own torque at a trial angle at which the friction's elastic elements hold the disk."""
    load = seated_load(x, hold, state, p, o, tables)
    made = made_torque(
        x, fraction_and_slope(load, state.c, p, tables, sections, state.w)[0], state.c, state.q, p, tables
    )
    return load - made


@inlined
def beside(x: float, c: Floats, p: Scalars, tables: Floats) -> float:
    """Return the active spring's torque in addition to its phase's: that of the sample plus that over its angle."""
    return c[OWN] + side_torque(x, p, tables)


@inlined
def made_and_slopes(
    x: float, xi: float, c: Floats, q: Floats, p: Scalars, tables: Floats
) -> tuple[float, float, float]:
    """Return the active spring's own torque (12), (20), and its derivatives by the spring's angle and by ξ.

    On cooling the torque is never less than that of cold martensite: the loading curve or, if the spring lay below this
    curve when it began to cool, the elastic branch. The additional torque (:func:`beside`) is not part of the reference
    state.
    """
    spread, stretch = p["k_m"] - p["k_a"], x - q[X_REF] - q[THETA_L] * (xi - q[XI_REF])
    stiffness = p["k_a"] + xi * spread
    torque, by_x, by_xi = q[TAU_REF] + stiffness * stretch, stiffness, spread * stretch - stiffness * q[THETA_L]
    if not c[HEATING] > 0.0:
        least = cold_torque(x, q[FLOOR], p, tables) * c[KEEPS]
        if torque < least:
            slope = loading_slope(x, p, tables) if x >= q[FLOOR] else p["k_m"]
            torque, by_x, by_xi = least, slope * c[KEEPS], 0.0
    torque += c[OWN]
    if p["side_row"] > 0.0:
        side, side_slope = table_and_slope(x, int(p["side_row"]), p, tables)
        torque, by_x = torque + side, by_x + side_slope
    return torque, by_x, by_xi


@inlined
def made_torque(x: float, xi: float, c: Floats, q: Floats, p: Scalars, tables: Floats) -> float:
    """Return the active spring's own torque."""
    return made_and_slopes(x, xi, c, q, p, tables)[0]


@inlined
def excess(x: float, sense: float, state: State, p: Scalars, o: Scalars, tables: Floats, sections: Floats) -> float:
    """Return load minus own torque at a trial angle, signed so that it is positive while the spring must slide on."""
    c, q, w = state.c, state.q, state.w
    load = load_torque(x, sense, c[SCALE], c, p, o, tables)
    return sense * (load - made_torque(x, fraction_and_slope(load, c, p, tables, sections, w)[0], c, q, p, tables))


@inlined
def fraction_and_slope(
    torque: float, c: Floats, p: Scalars, tables: Floats, sections: Floats, w: Floats
) -> tuple[float, float, bool]:
    """Return the wire's ξ at this torque, its derivative by the torque, and whether any section advances.

    ξ is the weighted mean of the sections' ξ. A transformation only advances: a section's ξ and place stay unless the
    place exceeds the furthest so far. Each section's ξ and place are stored as the trial's.
    """
    heating = c[HEATING] > 0.0
    # Derivative of the place in the window by the torque.
    per_torque = -p["temp_per_torque_a"] / p["a_width"] if heating else p["temp_per_torque_m"] / p["m_width"]
    total, slope, advances = 0.0, 0.0, False
    for j in range(w.shape[1]):
        place, follows = window_place(heating, section_temp(j, c, p, sections), torque, p, tables)
        xi = w[0, j]
        if place > w[2, j]:
            advances = True
            if p["latent"] > 0.0:
                place, follows = held_back(heating, place, follows, j, c, w, p)
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
def advance(torque: float, c: Floats, p: Scalars, tables: Floats, sections: Floats, w: Floats) -> float:
    """Set every section's ξ and place to those at this torque and return the wire's ξ."""
    total, _, _ = fraction_and_slope(torque, c, p, tables, sections, w)
    keep_trial(w)
    return total
