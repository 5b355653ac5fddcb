# mypy: disable-error-code="no-any-return"
# Elements of numpy arrays carry no type that mypy could check against float.
# ruff: noqa: FBT001
# Compiled functions call each other by position, flags too.
"""The compiled stepping rule: both springs and the friction, sample by sample, for any temperature history.

At every sample one scalar equation is solved. While the actuator slides, the unknown is the active spring's own angle
x: the passive spring, friction and stray torques determine the load, the torque that the active spring must carry,
``load(x)``; load and temperature determine ξ through the phase law; and (12) gives the spring's own torque from the
reference state. Load minus own torque is monotone in x, so that a bracketed root solves the equation and no fixed-point
iteration is needed. While the actuator sticks, x is constant and the unknown is ξ at this angle. The order within a
sample: new half-cycle, turn of the temperature, passive spring; then the actuator slides in the direction of the
transformation, else sticks, else slides back.

All angles are in the coordinates of the active spring: x falls while the spring recovers. The mirror image for spring B
is expressed by the sign s (φ = s (x − θ_P/2)).

Arrays that the functions share:
``p`` scalars of the rig; ``tables`` (11, m) its functions of one variable; ``sections`` (3, m) of the wire: weight, and
temperature below the sensor's, absolute and as a share of the excess over the room; ``c`` values of one sample; ``q``
the reference state; ``w`` (7, m) per section: ξ, ξ0, the furthest place in the law's window, a trial's ξ and place, the
rate of ξ over the sample before, and ξ at its end; ``g`` values that persist from sample to sample. :class:`State`
holds these arrays.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from torsight.actuator.stepping.kernel_balance import (
    AHEAD,
    AT_REST,
    BEFORE,
    BEGUN,
    CHANGED,
    CROSS,
    FACTOR,
    FLOOR,
    GUESS,
    HEATING,
    JUMP,
    KEEPS,
    LET_GO,
    OTHER,
    OWN,
    PACE,
    PER_S,
    RATE,
    RATE_2,
    RATE_3,
    REST_S,
    SCALE,
    SHORT,
    SIGN,
    SLIDING,
    SPAN,
    SPAN_2,
    TAU_NOW,
    TAU_REF,
    TEMP,
    TEMP_PASSIVE,
    THETA_L,
    TURN_NOW,
    TURN_P,
    WHO,
    WOUND,
    X0,
    X_NOW,
    X_REF,
    XI_0_P,
    XI_BEFORE,
    XI_NOW,
    XI_P,
    XI_REF,
    advance,
    bare_load,
    beside,
    excess,
    fraction_and_slope,
    load_torque,
    made_torque,
    passive_and_slope,
    section_temp,
    solid_friction,
    yields_at,
)
from torsight.actuator.stepping.kernel_laws import (
    DWELL,
    SEATS,
    STRAY,
    Scalars,
    State,
    cold_torque,
    friction_torque,
    from_table,
    held_table,
    left_by_winding,
    loading_torque,
    side_torque,
    window_place,
)
from torsight.actuator.stepping.kernel_roots import (
    SLIP_TOLERANCE,
    TORQUE_TOLERANCE,
    crosstalk,
    give_way,
    glide,
    keep_slide,
    slide,
    slide_anew,
    transform_at_rest,
)
from torsight.actuator.stepping.samples import Samples
from torsight.core.compiled import compiled, inlined, shared
from torsight.core.units import Floats

_LETS_STAND: Final = 0.1
"""Drop of friction, as a share of its sliding value, from which a disk counts as having come to a standstill; a choice.
Without it an overshoot of zero length would change the angle. On records of a rig with mass the evidence is the same
with half this value and 50 log units lower with twice."""


@shared
def _wound_for(x: float, limit: float, p: Scalars, tables: Floats) -> float:
    """Return θ_max of cold martensite at ``x``, if necessary unwound until its torque is ``limit``."""
    if loading_torque(x, p, tables) <= limit:
        return x
    # Beyond the critical angle the torque at x falls as θ_max grows: linearly for a curve with two slopes.
    start = max(x, p["theta_cr"])
    over = max(0.0, cold_torque(x, start, p, tables) - limit)
    wound = start + over / (p["k_m"] - p["k_s"])
    if p["loading_row"] > 0.0:
        # The curve is less steep than K_M everywhere, so that these steps converge.
        for _ in range(40):
            off = cold_torque(x, wound, p, tables) - limit
            wound = min(max(start, wound + off / (p["k_m"] - p["k_s"])), 2.0 * p["theta_p"])
            if abs(off) < TORQUE_TOLERANCE:
                break
    return wound


@shared
def _wind_home(
    wound: Floats, theta_start: float, first: int, scale: float, keeps: float, springs: NDArray[np.void], tables: Floats
) -> None:
    """Set θ_max of both springs at the start: wound to their angles, or unwound to the torque that is held.

    The other spring and friction hold a spring.
    The spring that is driven first may have carried only a share of its torque (``first_share``). Where the unwinding
    of the springs is known, it is used instead. ``keeps`` is the factor on the torque of cold martensite.
    """
    p = springs[0]
    if p["unwound_a"] >= 0.0:
        wound[0], wound[1] = theta_start + p["unwound_a"], p["theta_p"] - theta_start + p["unwound_b"]
        return
    for i in range(2):
        own = theta_start if i == 0 else p["theta_p"] - theta_start
        disk = theta_start + p["slipped_a"]
        hold = scale * friction_torque(disk, i == 1, p, tables)
        if p["has_stray"] > 0.0:
            hold += (1.0 if i == 0 else -1.0) * from_table(disk, STRAY, p, tables)
        other = loading_torque(p["theta_p"] - own, springs[1 - i], tables) * keeps
        other += side_torque(p["theta_p"] - own, springs[1 - i], tables)
        limit = (other + hold) / p["first_share"] if i == first else other * p["first_share"] + hold
        wound[i] = _wound_for(own, (limit - side_torque(own, springs[i], tables)) / keeps, springs[i], tables)


@inlined
def _recoverable(wound: float, left: Floats, p: Scalars, tables: Floats) -> float:
    """Return the recoverable angle after winding to an angle; ``left`` holds the factor on it, and the loss of it."""
    whole = p["fixed_theta_l"]
    if not whole > 0.0:
        whole = left_by_winding(wound, p, tables)
    return max(0.0, whole * left[0] - left[1])


@shared
def _start_half_cycle(
    who: int, theta_a: float, scale: float, left: Floats, own: float, state: State, springs: NDArray[np.void],
    tables: Floats
) -> None:  # fmt: skip
    """Begin a half-cycle with both springs as full martensite, at their present angles and torques.

    ``own`` is the torque of the spring that was driven before, in addition to its phase's torque. A record starts at
    rest: the torque of the spring that is driven first is that of the other spring plus a share of the friction,
    between −1 and 1 (``home_hold``).
    """
    g, q, w, wound, keeps = state.g, state.q, state.w, state.wound, state.c[KEEPS]
    before, p, o = int(g[WHO]), springs[who], springs[1 - who]
    if before >= 0:
        wound[before] = _wound_for(g[X_NOW], (g[TAU_NOW] - own) / keeps, springs[before], tables)
    x = theta_a if who == 0 else p["theta_p"] - theta_a
    g[WHO], g[X_NOW], g[XI_NOW] = who, x, 1.0
    g[TAU_NOW] = cold_torque(x, wound[who], p, tables) * keeps
    if before < 0:
        disk = theta_a + p["slipped_a"]
        passive = p["theta_p"] - x
        other = cold_torque(passive, wound[1 - who], o, tables) * keeps + side_torque(passive, o, tables)
        if p["has_stray"] > 0.0:
            other += (1.0 if who == 0 else -1.0) * from_table(disk, STRAY, p, tables)
        most = other + scale * friction_torque(disk, who == 1, p, tables)
        most = min(g[TAU_NOW], most / p["first_share"] - side_torque(x, p, tables))
        least = other - scale * friction_torque(disk, who == 0, p, tables)
        least = min(most, least / p["first_share"] - side_torque(x, p, tables))
        g[TAU_NOW] = least + 0.5 * (1.0 + p["home_hold"]) * (most - least)
    g[XI_P], g[XI_0_P], g[TURN_P], g[CHANGED] = 1.0, 1.0, 1.0, 1.0
    q[X_REF], q[TAU_REF], q[XI_REF], q[SLIDING], q[AT_REST] = x, g[TAU_NOW], 1.0, 0.0, 0.0
    q[THETA_L] = _recoverable(wound[who], left, p, tables)
    for j in range(w.shape[1]):
        w[0, j], w[1, j], w[2, j] = 1.0, 1.0, 0.0


@inlined
def _copy(state: State) -> None:
    """Save the reference state before a turn."""
    for i in range(state.q.size):
        state.saved_q[i] = state.q[i]
    for j in range(state.w.shape[1]):
        for i in range(state.w.shape[0]):
            state.saved_w[i, j] = state.w[i, j]


@shared
def _turn(heating: bool, left: Floats, own: float, state: State, p: Scalars, tables: Floats) -> None:
    """Set a new reference state when heating turns into cooling or cooling into heating.

    If nothing has changed since the turn before, both turns are ignored: the earlier transformation continues.
    """
    g, q, w, saved_q, saved_w = state.g, state.q, state.w, state.saved_q, state.saved_w
    if g[CHANGED] > 0.0:
        _copy(state)
        q[X_REF], q[TAU_REF], q[XI_REF], q[SLIDING] = g[X_NOW], g[TAU_NOW] - own, g[XI_NOW], 0.0
        q[AT_REST] = 0.0
        q[FLOOR] = _wound_for(g[X_NOW], (g[TAU_NOW] - own) / state.c[KEEPS], p, tables)
        for j in range(w.shape[1]):
            w[1, j], w[2, j] = w[0, j], 0.0
        if heating:
            # The recoverable angle is at most that of the winding to this angle. A spring that was cooled to less than
            # full martensite, and not wound that far since, recovers the angle that it recovered before.
            most = _recoverable(q[FLOOR], left, p, tables)
            if g[XI_NOW] > 1.0 - 1e-9:
                state.wound[int(g[WHO])] = q[FLOOR]
                q[THETA_L] = most
            else:
                q[THETA_L] = min(q[THETA_L], most / max(g[XI_NOW], 1e-9))
    else:
        for i in range(q.size):
            q[i], saved_q[i] = saved_q[i], q[i]
        for j in range(w.shape[1]):
            for i in (1, 2):
                w[i, j], saved_w[i, j] = saved_w[i, j], w[i, j]
    g[CHANGED] = 0.0


@inlined
def _slid(sense: float, first: float, state: State, p: Scalars, o: Scalars, tables: Floats, sections: Floats) -> float:
    """Return the angle at which a slide ends."""
    return slide(sense, state.c[GUESS], first, state, p, o, tables, sections) if first > 0.0 else state.g[X_NOW]


@shared
def _settle(state: State, p: Scalars, o: Scalars, tables: Floats, sections: Floats) -> bool:
    """Find the active spring's equilibrium in this sample and return whether the spring slid.

    A slide in the direction of the transformation is tried first, then (after sticking) one in the other direction.
    """
    c, q, g, w = state.c, state.q, state.g, state.w
    x, scale = g[X_NOW], c[SCALE]
    hold = scale
    if p["dwell_step"] > 0.0:
        hold *= max(1.0, held_table(np.log10(1.0 + g[REST_S]), DWELL, p["dwell_step"], tables)[0])
    for attempt in range(2):
        sense = -1.0 if (c[HEATING] > 0.0) == (attempt == 0) else 1.0
        at = yields_at(sense, hold, state, p, tables)
        limit = load_torque(at, sense, hold, c, p, o, tables)
        reached = fraction_and_slope(limit, c, p, tables, sections, w)[0] if attempt == 0 else g[XI_NOW]
        over = sense * (limit - made_torque(at, reached, c, q, p, tables))
        if over > SLIP_TOLERANCE:
            g[X_NOW] = at
            begins = q[SLIDING] != sense
            if begins or q[AT_REST] > 0.0:
                slide_anew(sense, limit, reached if attempt == 0 else g[XI_NOW], state, p, tables)
            held = x
            if hold > scale:
                # The end of the slide without the drop of friction: the distance beyond it is the jump.
                c[SCALE] = hold
                held = _slid(sense, excess(x, sense, state, p, o, tables, sections), state, p, o, tables, sections)
                c[SCALE] = scale
            anew = begins or hold > scale or at != x
            first = excess(x, sense, state, p, o, tables, sections) if anew else over
            g[X_NOW] = _slid(sense, first, state, p, o, tables, sections)
            g[TAU_NOW] = load_torque(g[X_NOW], sense, scale, c, p, o, tables)
            g[XI_NOW] = advance(g[TAU_NOW], c, p, tables, sections, w)
            if hold > scale and p["swing"] > 0.0:
                # Inertia carries the disk past its balance, where friction holds it until the torque has risen again.
                g[X_NOW] += p["swing"] * (g[X_NOW] - held)
                transform_at_rest(state, p, tables, sections)
                # The reference state is renewed in proportion to the drop of friction, up to a complete standstill.
                stands = min(1.0, p["swing"] * (hold / scale - 1.0) / _LETS_STAND)
                q[BEGUN], q[AT_REST] = q[BEGUN] + stands * (g[XI_NOW] - q[BEGUN]), 0.0
            keep_slide(abs(g[X_NOW] - x), c, g)
            if hold > scale:
                g[JUMP], g[LET_GO] = g[X_NOW] - held, g[SHORT + attempt] / (g[SHORT + attempt] + over)
            g[SHORT], g[SHORT + 1] = 0.0, 0.0
            return True
        g[SHORT + attempt] = max(0.0, -over)
        if attempt == 0 and p["seat"] > 0.0:
            other = yields_at(-sense, hold, state, p, tables)
            give_way(min(at, other), max(at, other), hold, state, p, o, tables, sections)
        elif attempt == 0:
            transform_at_rest(state, p, tables, sections)
    return False


@inlined
def _nothing_to_do(c: Floats, g: Floats, w: Floats, p: Scalars, tables: Floats, sections: Floats) -> bool:
    """Return whether the angle stays and no section's transformation advances at the present torque.

    Where friction depends on the speed or on the time at rest, the disk must have been at rest in the sample before.
    """
    if p["steady"] == 0.0 or (g[REST_S] == 0.0 and p["viscous"] + p["speed_step"] + p["dwell_step"] > 0.0):
        return False
    heating = c[HEATING] > 0.0
    for j in range(w.shape[1]):
        own = section_temp(j, c, p, sections)
        complete = w[2, j] >= 1.0 and p["tanaka"] < 0.5
        if not complete and window_place(heating, own, g[TAU_NOW], p, tables)[0] > w[2, j]:
            return False
    return True


@inlined
def _pass_over(per_s: float, c: Floats, g: Floats) -> None:
    """Advance the time by a sample at rest."""
    c[X0], c[PER_S] = g[X_NOW], per_s
    if g[REST_S] > 0.0:
        g[REST_S] += 1.0 / per_s


@inlined
def _keep_rates(per_s: float, starts: bool, turns: bool, c: Floats, g: Floats, w: Floats) -> None:
    """Set the mean rates of angle and phase over the sample before, and this sample's share of the time of both.

    Also set the extrapolated length of a continued slide: by the third-degree polynomial through its last four angles.
    """
    for j in range(w.shape[1]):
        w[PACE, j] = 0.0 if starts or turns else abs(w[0, j] - w[XI_BEFORE, j]) * c[PER_S]
        w[XI_BEFORE, j] = w[0, j]
    g[JUMP] = 0.0
    known = not starts and c[PER_S] > 0.0
    c[BEFORE] = (g[X_NOW] - c[X0]) * c[PER_S] if known else 0.0
    c[AHEAD] = c[PER_S] / (c[PER_S] + per_s) if known else 0.0
    if per_s > 0.0:
        span = 1.0 / per_s
        c[GUESS] = span * (g[RATE] + (span + g[SPAN]) * (g[RATE_2] + (span + g[SPAN] + g[SPAN_2]) * g[RATE_3]))


@inlined
def _load(k: int, samples: Samples, wound: float, c: Floats, g: Floats, p: Scalars, o: Scalars, tables: Floats) -> None:
    """Set the values of a sample that determine the active spring's load; ``wound`` is the passive spring's θ_max."""
    c[X0], c[PER_S], c[WOUND], c[SCALE] = g[X_NOW], samples.per_s[k], wound, samples.friction_scale[k]
    c[SIGN] = 1.0 if g[WHO] == 0.0 else -1.0
    c[TEMP_PASSIVE], c[CROSS] = samples.temps[1, k], 0.0
    c[TURN_NOW] = samples.directions[1, k]
    if p["passive_share"] > 0.0:
        c[CROSS] = crosstalk(p["theta_p"] - g[X_NOW], c, g, o, tables)
    change = samples.load_change
    if change.shape[1] > 0:
        c[FACTOR], c[OWN], c[OTHER] = change[0, k] * c[KEEPS], change[1, k], change[2, k]


@inlined
def _seat(slid: bool, state: State, p: Scalars, o: Scalars, tables: Floats) -> None:
    """Set the torques that the friction's elastic elements hold after a slide."""
    c, q, g = state.c, state.q, state.g
    if slid and p["seat"] > 0.0:
        most = c[SCALE] * solid_friction(g[X_NOW], q[SLIDING], c, p, tables)
        hold = min(max(bare_load(g[X_NOW], c, p, o, tables) - g[TAU_NOW], -most), most)
        for i in range(SEATS):
            state.held[i] = hold / SEATS


@inlined
def _mirror_hold(first: bool, state: State, p: Scalars, o: Scalars, tables: Floats) -> None:
    """Convert the torques of the elastic elements to the other spring's coordinates; at the start, set them."""
    left = bare_load(state.g[X_NOW], state.c, p, o, tables) - state.g[TAU_NOW] if first else 0.0
    for i in range(SEATS):
        state.held[i] = left / SEATS if first else -state.held[i]


@inlined
def _give(k: int, samples: Samples, c: Floats, g: Floats, springs: NDArray[np.void]) -> float:
    """Set the cold springs' relaxation and the fixed ends' slip to those of a sample; return the unwinding of A.

    The disk is at rest meanwhile. A spring whose end slips unwinds elastically at its present phase.
    """
    if samples.load_change.shape[1] > 0:
        c[KEEPS] = samples.load_change[3, k]
    if samples.slipped.shape[1] == 0:
        return 0.0
    slipped_a, slipped_b = samples.slipped[0, k], samples.slipped[1, k]
    by_a, by_b = slipped_a - springs[0]["slipped_a"], slipped_b - springs[0]["slipped_b"]
    if by_a == 0.0 and by_b == 0.0:
        return 0.0
    for i in range(2):
        springs[i]["theta_p"] -= by_a + by_b
        springs[i]["slipped_a"], springs[i]["slipped_b"] = slipped_a, slipped_b
    if g[WHO] >= 0.0:
        by, p = (by_a, springs[0]) if g[WHO] == 0.0 else (by_b, springs[1])
        g[X_NOW], c[X0] = g[X_NOW] - by, c[X0] - by
        g[TAU_NOW] -= (p["k_a"] + g[XI_NOW] * (p["k_m"] - p["k_a"])) * by
    return by_a


@compiled
def _new_state(sections: int) -> State:
    """Return the state before the first sample, with the given number of wire sections and θ_max not yet set."""
    c, q, g, w = np.zeros(17), np.zeros(8), np.zeros(18), np.ones((7, sections))
    c[FACTOR], c[KEEPS], c[GUESS] = 1.0, 1.0, 1e-3
    g[WHO] = -1.0
    return State(c, q, g, w, q.copy(), w.copy(), np.empty(2), np.zeros(SEATS))


@shared
def step_through(
    out: Floats, state: State, samples: Samples, cycling: Floats, springs: NDArray[np.void], tables: Floats,
    sections: Floats, theta_start: float
) -> None:  # fmt: skip
    """Fill ``out`` as :func:`run` returns it; at the end ``state.wound`` holds the unwinding of both springs, rad."""
    per_s, temps, active, half = samples.per_s, samples.temps, samples.active, samples.half
    directions, friction_scale = samples.directions, samples.friction_scale
    c, q, g, w, wound = state.c, state.q, state.g, state.w, state.wound
    theta_a, p, o = theta_start - _give(0, samples, c, g, springs), springs[0], springs[1]
    _wind_home(wound, theta_a, active[0], friction_scale[0], c[KEEPS], springs, tables)
    for k in range(active.size):
        theta_a -= _give(k, samples, c, g, springs)
        starts = k == 0 or half[k] != half[k - 1]
        turns = not starts and directions[0, k] != directions[0, k - 1]
        if starts or turns:
            own, left = beside(g[X_NOW], c, p, tables), cycling[half[k]]
            if starts:
                _start_half_cycle(active[k], theta_a, friction_scale[k], left, own, state, springs, tables)
                p, o = springs[active[k]], springs[1 - active[k]]
            else:
                _turn(directions[0, k] > 0, left, own, state, p, tables)
        fresh = starts or turns
        who = int(g[WHO])
        c[TEMP], c[HEATING] = temps[0, k] - cycling[half[k], 2 if directions[0, k] > 0 else 3], directions[0, k]
        if not fresh and _nothing_to_do(c, g, w, p, tables, sections):
            for i in range(5):
                out[i, k] = out[i, k - 1]
            _pass_over(per_s[k], c, g)
            continue
        _keep_rates(per_s[k], starts, turns, c, g, w)
        _load(k, samples, wound[1 - who], c, g, p, o, tables)
        if starts:
            _mirror_hold(k == 0, state, p, o, tables)
        total = g[XI_NOW]
        # Newton's steps only after a sample in which the disk slid.
        easy = not fresh and g[REST_S] == 0.0 and q[SLIDING] * c[HEATING] < 0.0
        slid = (easy and glide(c, q, g, w, p, o, tables, sections)) or _settle(state, p, o, tables, sections)
        if starts and slid and g[XI_NOW] == 1.0:
            # A spring that cooled above its loading curve yields when it is released: the heating starts after that.
            q[X_REF], q[TAU_REF], q[SLIDING] = g[X_NOW], g[TAU_NOW] - beside(g[X_NOW], c, p, tables), 0.0
        _seat(slid, state, p, o, tables)
        # The time at rest before the record is unknown: it is taken as longer than any law over the rest reaches.
        g[REST_S] = 0.0 if slid else g[REST_S] + (np.inf if k == 0 else 1.0 / per_s[k])
        if g[XI_NOW] != total or g[X_NOW] != c[X0]:
            g[CHANGED] = 1.0
        wound[1 - who] = max(wound[1 - who], p["theta_p"] - g[X_NOW])
        theta_a = g[X_NOW] if who == 0 else p["theta_p"] - g[X_NOW]
        out[0, k], out[5, k], out[6, k] = theta_a + p["slipped_a"], c[SIGN] * g[JUMP], g[LET_GO]
        out[1 + who, k] = g[XI_NOW]
        out[2 - who, k] = g[XI_P]
        out[3 + who, k] = g[TAU_NOW]
        out[4 - who, k] = passive_and_slope(g[X_NOW], c, o, tables)[0]
    # The unwinding of both springs, as the next half-cycle will use it.
    wound[0], wound[1] = max(wound[0] - theta_a, 0.0), max(wound[1] - p["theta_p"] + theta_a, 0.0)
    who = int(g[WHO])
    own = beside(g[X_NOW], c, p, tables)
    wound[who] = max(_wound_for(g[X_NOW], (g[TAU_NOW] - own) / c[KEEPS], p, tables) - g[X_NOW], 0.0)


@compiled
def run(
    samples: Samples,
    cycling: Floats,
    springs: NDArray[np.void],
    tables: Floats,
    sections: Floats,
    theta_start: float,
) -> tuple[Floats, Floats]:
    """Step through all samples.

    Parameters
    ----------
    samples : Samples
        Temperatures, and the values that change with time.
    cycling : (halves, 4) float64
        Changes from cycle to cycle, per half-cycle: factor on the recoverable angle, loss of this angle independent of
        the winding (rad), and shift of the driven spring's transformation temperatures on heating and on cooling (°C).
    springs : (2,) :data:`~torsight.actuator.stepping.kernel_laws.SCALARS`
        Scalars in SI units, with the values of spring A and with those of spring B. They are changed in
        place: where ends slip, θ_P is reduced by the slip.
    tables : (11, m) float64
        See :mod:`torsight.actuator.stepping.kernel_laws`.
    sections : (3, m) float64
        Wire sections: weight, and temperature below the sensor's (absolute, and as a share of the excess over room).
    theta_start : float
        θ^A at the start, rad.

    Returns
    -------
    (7, n) float64
        θ^A without the slip of A's end (rad), ξ of A and B, torque of A and B (N·m); jump of θ^A where the disk breaks
        loose after a rest (rad, else 0), and the part of the sample that has passed at the jump.
    (2,) float64
        θ_max minus the winding at the end, of A and B (rad).
    """
    out, state = np.zeros((7, samples.active.size)), _new_state(sections.shape[1])
    step_through(out, state, samples, cycling, springs, tables, sections, theta_start)
    return out, state.wound
