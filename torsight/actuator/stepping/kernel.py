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
is expressed by a sign (φ = ± (x − θ_P/2)).

What the functions share:
``p`` scalars of the rig; ``tables`` (11, m) its functions of one variable; ``sections`` (3, m) of the wire: weight, and
temperature below the sensor's, absolute and as a share of the excess over the room; ``s``, ``q`` and ``w`` of
:class:`~torsight.actuator.stepping.kernel_laws.State`.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from torsight.actuator.stepping.kernel_balance import (
    PACE,
    XI_BEFORE,
    advance,
    bare_load,
    beside,
    excess,
    fraction_and_slope,
    load_torque,
    passive_and_slope,
    section_temp,
    solid_friction,
    yields_at,
)
from torsight.actuator.stepping.kernel_laws import (
    DWELL,
    REFERENCE,
    SEATS,
    STEP,
    Samples,
    Scalars,
    State,
    held_table,
    window_place,
)
from torsight.actuator.stepping.kernel_roots import (
    SLIP_TOLERANCE,
    TORQUE_TOLERANCE,
    crosstalk,
    excess_at_rest,
    give_way,
    glide,
    keep_slide,
    renew,
    slide,
    slide_anew,
    transform_at_rest,
)
from torsight.actuator.stepping.kernel_starts import mirror_hold, start_half_cycle, turn, wind_home, wound_for
from torsight.core.compiled import compiled, copy_to, inlined, lending, shared
from torsight.core.units import DEG, Floats

_AGREED_NM: Final = 100.0 * TORQUE_TOLERANCE
"""Difference of torque that ends the balances of both springs: each rests on roots with their own tolerance. It moves
the disk by 1e-8 rad."""
_FIRMER: Final = 1.01
"""Factor on the friction for the derivative of what it exceeds: its difference of 1 % is far above rounding, and small
beside the growth over a rest."""
_BALANCES: Final = 8
"""Largest number of balances of one sample; three or four secants suffice."""
_STANDS_RAD_S: Final = 0.05 * DEG
"""Speed below which the disk counts as standing: a hundredth of that in mid-stroke at usual rates of heating, and about
what the remaining noise of a held temperature (0.01 °C in 10 s) moves it by."""
STANDS_S: Final = 0.5
"""Time constant with which a standstill counts, a choice: a dip of 0.5 °C on the way up stops the disk for two to five
seconds, and within two rows of a usual log the model stays a smooth function of its values."""


@inlined
def _slid(sense: float, first: float, state: State, p: Scalars, o: Scalars, tables: Floats, sections: Floats) -> float:
    """Return the angle at which a slide ends."""
    return slide(sense, state.s[0]["guess"], first, state, p, o, tables, sections) if first > 0.0 else state.s[0]["x"]


@lending
def _excess_held(
    sense: float, at: float, hold: float, state: State, p: Scalars, o: Scalars, tables: Floats, sections: Floats
) -> tuple[float, float, float]:
    """Return by how much the torque passes the friction that holds the disk, the torque that it passes, and ξ there."""
    s, q = state.s[0], state.q[0]
    limit = load_torque(at, sense, hold, s, p, o, tables)
    onwards = (sense < 0.0) == (s["heating"] > 0.0)
    reached = fraction_and_slope(limit, s, p, tables, sections, state.w)[0] if onwards else s["xi"]
    over, reached = excess_at_rest(sense, at, limit, reached, s, q, p, tables)
    return over, limit, reached


@lending
def _swing_past(held: float, drop: float, state: State, p: Scalars, tables: Floats, sections: Floats) -> None:
    """Let inertia carry the disk past its balance, where friction holds it until the torque has risen again.

    Without a ``drop`` of the friction, relative to sliding friction, the slide would have ended at ``held``.
    """
    if p["swing"] == 0.0:
        return
    s, q = state.s[0], state.q[0]
    s["x"] += p["swing"] * (s["x"] - held)
    transform_at_rest(state, p, tables, sections)
    # The reference state is renewed in proportion to the drop of friction, up to a complete standstill at a tenth of
    # its sliding value, a choice: otherwise an overshoot of zero length would change the angle. On records of a rig
    # with mass the evidence is the same with half of it, 50 log units lower with twice.
    stands = min(1.0, p["swing"] * drop / 0.1)
    q["begun"], q["at_rest"] = q["begun"] + stands * (s["xi"] - q["begun"]), 0.0


@shared
def _settle(state: State, p: Scalars, o: Scalars, tables: Floats, sections: Floats) -> bool:
    """Find the active spring's equilibrium in this sample and return whether the spring slid.

    A slide in the direction of the transformation is tried first, then (after sticking) one in the other direction.
    """
    s, q, w, short = state.s[0], state.q[0], state.w, state.short
    x, scale = s["x"], s["scale"]
    hold = scale
    if p["dwell_step"] > 0.0:
        hold *= max(1.0, held_table(np.log10(1.0 + s["rest_s"]), DWELL, p["dwell_step"], tables)[0])
    for attempt in range(2):
        sense = -1.0 if (s["heating"] > 0.0) == (attempt == 0) else 1.0
        at = yields_at(sense, hold, state, p, tables)
        over, limit, reached = _excess_held(sense, at, hold, state, p, o, tables, sections)
        if over > SLIP_TOLERANCE:
            if hold > scale:
                grown = short[attempt] + over
                firmer = _excess_held(sense, at, _FIRMER * hold, state, p, o, tables, sections)[0]
                s["let_go"] = short[attempt] / grown
                s["growth"] = (_FIRMER - 1.0) * grown / max(over - firmer, SLIP_TOLERANCE)
                # Once more: the places of trials in the law's window are to be those of this friction.
                over, limit, reached = _excess_held(sense, at, hold, state, p, o, tables, sections)
            s["x"] = at
            anew = q["sliding"] != sense or q["at_rest"] > 0.0
            if anew:
                slide_anew(sense, limit, reached, state, p, tables)
            held = x
            if hold > scale:
                # The end of the slide without the drop of friction: the distance beyond it is the jump.
                s["scale"] = hold
                held = _slid(sense, excess(x, sense, state, p, o, tables, sections), state, p, o, tables, sections)
                s["scale"] = scale
            changed = anew or hold > scale or at != x
            first = excess(x, sense, state, p, o, tables, sections) if changed else over
            s["x"] = _slid(sense, first, state, p, o, tables, sections)
            s["tau"] = load_torque(s["x"], sense, scale, s, p, o, tables)
            s["xi"] = advance(s["tau"], s, p, tables, sections, w)
            if hold > scale:
                _swing_past(held, hold / scale - 1.0, state, p, tables, sections)
                s["jump"] = s["x"] - held
            keep_slide(abs(s["x"] - x), s)
            short[0], short[1] = 0.0, 0.0
            return True
        short[attempt] = max(0.0, -over)
        if attempt == 0 and p["seat_rad"] > 0.0:
            other = yields_at(-sense, hold, state, p, tables)
            give_way(min(at, other), max(at, other), hold, state, p, o, tables, sections)
        elif attempt == 0:
            transform_at_rest(state, p, tables, sections)
    return False


@inlined
def _nothing_to_do(s: Scalars, w: Floats, p: Scalars, tables: Floats, sections: Floats) -> bool:
    """Return whether the angle stays and no section's transformation advances at the present torque.

    Where friction depends on the speed or on the time at rest, the disk must have been at rest in the sample before.
    """
    if p["steady"] == 0.0 or (s["rest_s"] == 0.0 and p["viscous_nms"] + p["speed_step"] + p["dwell_step"] > 0.0):
        return False
    heating = s["heating"] > 0.0
    for j in range(w.shape[1]):
        own = section_temp(j, s, p, sections)
        complete = w[2, j] >= 1.0 and p["tanaka"] < 0.5
        if not complete and window_place(heating, own, s["tau"], p, tables)[0] > w[2, j]:
            return False
    return True


@inlined
def _stand(per_s: float, total: float, s: Scalars, q: Scalars, p: Scalars) -> None:
    """Renew the reference state in proportion while disk and transformation stand; the present torque stays.

    ``total`` is ξ in the sample before. Of a disk that sticks while its spring transforms the slide afterwards renews
    the reference state (:func:`~torsight.actuator.stepping.kernel_roots.slide_anew`).
    """
    if p["renewal"] == 0.0 or q["sliding"] == 0.0 or per_s == 0.0:
        return
    if max(abs(s["x"] - s["x0"]), q["theta_l"] * abs(s["xi"] - total)) * per_s > _STANDS_RAD_S:
        q["stood_s"] = 0.0
        return
    before = p["renewal"] * (1.0 - np.exp(-q["stood_s"] / STANDS_S))
    q["stood_s"] += 1.0 / per_s
    after = p["renewal"] * (1.0 - np.exp(-q["stood_s"] / STANDS_S))
    if before < 1.0:
        renew((after - before) / (1.0 - before), s["x"], s["xi"], q, p)


@inlined
def _pass_over(per_s: float, s: Scalars, q: Scalars, p: Scalars) -> None:
    """Advance the time by a sample at rest."""
    s["x0"], s["per_s"] = s["x"], per_s
    _stand(per_s, s["xi"], s, q, p)
    if s["rest_s"] > 0.0:
        s["rest_s"] += 1.0 / per_s


@inlined
def _keep_rates(per_s: float, starts: bool, turns: bool, s: Scalars, w: Floats) -> None:
    """Set the mean rates of angle and phase over the sample before, and this sample's share of the time of both.

    Also set the extrapolated length of a continued slide: by the third-degree polynomial through its last four angles.
    """
    for j in range(w.shape[1]):
        w[PACE, j] = 0.0 if starts or turns else abs(w[0, j] - w[XI_BEFORE, j]) * s["per_s"]
        w[XI_BEFORE, j] = w[0, j]
    s["jump"] = 0.0
    known = not starts and s["per_s"] > 0.0
    s["before"] = (s["x"] - s["x0"]) * s["per_s"] if known else 0.0
    s["ahead"] = s["per_s"] / (s["per_s"] + per_s) if known else 0.0
    if per_s > 0.0:
        span = 1.0 / per_s
        bends = s["rate_2"] + (span + s["span"] + s["span_2"]) * s["rate_3"]
        s["guess"] = span * (s["rate"] + (span + s["span"]) * bends)


@inlined
def _load(k: int, samples: Samples, wound: float, s: Scalars, p: Scalars, o: Scalars, tables: Floats) -> None:
    """Set the values of a sample that determine the active spring's load; ``wound`` is the passive spring's θ_max."""
    s["x0"], s["per_s"], s["wound"], s["scale"] = s["x"], samples.per_s[k], wound, samples.friction_scale[k]
    s["sign"] = 1.0 if s["who"] == 0.0 else -1.0
    s["temp_passive"], s["cross"] = samples.temps[1, k], 0.0
    s["turn_now"] = samples.directions[1, k]
    if p["passive_share"] > 0.0:
        xi_p = s["xi_p"]
        s["cross"] = crosstalk(p["theta_p"] - s["x"], s, o, tables)
        s["xi_p"] = xi_p
    change = samples.load_change
    if change.shape[1] > 0:
        s["factor"], s["own"], s["other"] = change[0, k] * s["keeps"], change[1, k], change[2, k]


@shared
def _balanced_with_crosstalk(
    easy: bool, state: State, p: Scalars, o: Scalars, tables: Floats, sections: Floats
) -> bool:
    """Bring disk and both springs to this sample's balance and return whether the disk slid.

    The recovery of a passive spring that transforms depends on the angle at which the disk stops. The balance is sought
    again, by secants, until both agree: otherwise long steps would lag behind.
    """
    s, q, w = state.s[0], state.q[0], state.w
    state.s[1], state.q[3] = s, q
    for i in range(len(w)):
        copy_to(state.before_w[i], w[i])
    slid, cross_0, off_0 = False, 0.0, 0.0
    for attempt in range(_BALANCES):
        if attempt > 0:
            cross = s["cross"]
            state.s[0], state.q[0] = state.s[1], state.q[3]
            for i in range(len(w)):
                copy_to(w[i], state.before_w[i])
            s["cross"] = cross
        slid = (easy and glide(s, q, w, p, o, tables, sections)) or _settle(state, p, o, tables, sections)
        cross = s["cross"]
        off = crosstalk(p["theta_p"] - s["x"], s, o, tables) - cross
        if abs(off) <= _AGREED_NM or attempt == _BALANCES - 1:
            break
        by_secant = attempt > 0 and off != off_0
        s["cross"] = max(0.0, cross - off * (cross - cross_0) / (off - off_0) if by_secant else cross + off)
        cross_0, off_0 = cross, off
    return slid


@inlined
def _seat(slid: bool, state: State, p: Scalars, o: Scalars, tables: Floats) -> None:
    """Set the torques that the friction's elastic elements hold after a slide."""
    s, q = state.s[0], state.q[0]
    if slid and p["seat_rad"] > 0.0:
        most = s["scale"] * solid_friction(s["x"], q["sliding"], s, p, tables)
        hold = min(max(bare_load(s["x"], s, p, o, tables) - s["tau"], -most), most)
        for i in range(SEATS):
            state.held[i] = hold / SEATS


@inlined
def _give(k: int, samples: Samples, s: Scalars, springs: NDArray[np.void]) -> float:
    """Set the cold springs' relaxation and the fixed ends' slip to those of a sample; return the unwinding of A.

    The disk is at rest meanwhile. A spring whose end slips unwinds elastically at its present phase.
    """
    if samples.load_change.shape[1] > 0:
        s["keeps"] = samples.load_change[3, k]
    if samples.slipped.shape[1] == 0:
        return 0.0
    slipped_a, slipped_b = samples.slipped[0, k], samples.slipped[1, k]
    by_a, by_b = slipped_a - springs[0]["slipped_a"], slipped_b - springs[0]["slipped_b"]
    if by_a == 0.0 and by_b == 0.0:
        return 0.0
    for i in range(2):
        springs[i]["theta_p"] -= by_a + by_b
        springs[i]["slipped_a"], springs[i]["slipped_b"] = slipped_a, slipped_b
    if s["who"] >= 0.0:
        by, p = (by_a, springs[0]) if s["who"] == 0.0 else (by_b, springs[1])
        s["x"], s["x0"] = s["x"] - by, s["x0"] - by
        s["tau"] -= (p["k_a"] + s["xi"] * (p["k_m"] - p["k_a"])) * by
    return by_a


@compiled
def _new_state(sections: int) -> State:
    """Return the state before the first sample, with the given number of wire sections and θ_max not yet set."""
    s, q, w = np.zeros(2, STEP), np.zeros(4, REFERENCE), np.ones((7, sections))
    s[0]["factor"], s[0]["keeps"], s[0]["guess"], s[0]["who"] = 1.0, 1.0, 1e-3, -1.0
    return State(s, q, w, w.copy(), w.copy(), np.empty(2), np.zeros(SEATS), np.zeros(2))


@shared
def step_through(
    out: Floats, state: State, samples: Samples, cycling: Floats, springs: NDArray[np.void], tables: Floats,
    sections: Floats, theta_start: float
) -> None:  # fmt: skip
    """Fill ``out`` as :func:`run` returns it; at the end ``state.wound`` holds the unwinding of both springs, rad."""
    per_s, temps, active, half = samples.per_s, samples.temps, samples.active, samples.half
    directions, friction_scale = samples.directions, samples.friction_scale
    s, q, w, wound = state.s[0], state.q[0], state.w, state.wound
    theta_a, p, o = theta_start - _give(0, samples, s, springs), springs[0], springs[1]
    wind_home(wound, theta_a, active[0], friction_scale[0], s["keeps"], springs, tables)
    for k in range(active.size):
        theta_a -= _give(k, samples, s, springs)
        starts = k == 0 or half[k] != half[k - 1]
        turns = not starts and directions[0, k] != directions[0, k - 1]
        if starts or turns:
            own, left = beside(s["x"], s, p, tables), cycling[half[k]]
            if starts:
                start_half_cycle(active[k], theta_a, friction_scale[k], left, own, state, springs, tables)
                p, o = springs[active[k]], springs[1 - active[k]]
            else:
                turn(directions[0, k] > 0, left, own, state, p, tables)
        fresh = starts or turns
        who = int(s["who"])
        s["temp"], s["heating"] = temps[0, k] - cycling[half[k], 2 if directions[0, k] > 0 else 3], directions[0, k]
        if not fresh and _nothing_to_do(s, w, p, tables, sections):
            for i in range(5):
                out[i, k] = out[i, k - 1]
            _pass_over(per_s[k], s, q, p)
            continue
        _keep_rates(per_s[k], starts, turns, s, w)
        _load(k, samples, wound[1 - who], s, p, o, tables)
        if starts:
            mirror_hold(k == 0, state, p, o, tables)
        total = s["xi"]
        # Newton's steps only after a sample in which the disk slid.
        easy = not fresh and s["rest_s"] == 0.0 and q["sliding"] * s["heating"] < 0.0
        slid = (
            _balanced_with_crosstalk(easy, state, p, o, tables, sections)
            if p["passive_share"] > 0.0
            else (easy and glide(s, q, w, p, o, tables, sections)) or _settle(state, p, o, tables, sections)
        )
        if starts and slid and s["xi"] == 1.0:
            # A spring that cooled above its loading curve yields when it is released: the heating starts after that.
            q["x"], q["tau"], q["sliding"] = s["x"], s["tau"] - beside(s["x"], s, p, tables), 0.0
        _seat(slid, state, p, o, tables)
        _stand(per_s[k], total, s, q, p)
        # The time at rest before the record is unknown: it is taken as longer than any law over the rest reaches.
        s["rest_s"] = 0.0 if slid else s["rest_s"] + (np.inf if k == 0 else 1.0 / per_s[k])
        if s["xi"] != total or s["x"] != s["x0"]:
            s["changed"] = 1.0
        wound[1 - who] = max(wound[1 - who], p["theta_p"] - s["x"])
        theta_a = s["x"] if who == 0 else p["theta_p"] - s["x"]
        out[0, k], out[5, k] = theta_a + p["slipped_a"], s["sign"] * s["jump"]
        out[6, k], out[7, k] = s["let_go"], s["growth"]
        out[1 + who, k] = s["xi"]
        out[2 - who, k] = s["xi_p"]
        out[3 + who, k] = s["tau"]
        out[4 - who, k] = passive_and_slope(s["x"], s, o, tables)[0]
    # The unwinding of both springs, as the next half-cycle will use it.
    wound[0], wound[1] = max(wound[0] - theta_a, 0.0), max(wound[1] - p["theta_p"] + theta_a, 0.0)
    who = int(s["who"])
    own = beside(s["x"], s, p, tables)
    wound[who] = max(wound_for(s["x"], (s["tau"] - own) / s["keeps"], p, tables) - s["x"], 0.0)


@compiled
def run(
    samples: Samples, cycling: Floats, springs: NDArray[np.void], tables: Floats, sections: Floats, theta_start: float
) -> tuple[Floats, Floats]:
    """Step through all samples from θ^A at the start, rad.

    ``cycling`` (halves, 4) are changes from cycle to cycle, per half-cycle: factor on the recoverable angle, loss of
    this angle independent of the winding (rad), and shift of the driven spring's transformation temperatures on heating
    and on cooling (°C). ``springs`` (2,) of :data:`~torsight.actuator.stepping.kernel_laws.SCALARS` hold the values of
    A and of B; they are changed in place: where ends slip, θ_P is reduced by the slip.

    Returns (8, n): θ^A without the slip of A's end (rad), ξ of A and B, torque of A and B (N·m), jump of θ^A where the
    disk breaks loose after a rest (rad, else 0), the part of the sample that has passed at the jump, and the growth
    of the torque in this sample relative to the friction that holds the disk; and (2,): θ_max minus the winding at the
    end, of A and B (rad).
    """
    out, state = np.zeros((8, samples.active.size)), _new_state(sections.shape[1])
    step_through(out, state, samples, cycling, springs, tables, sections, theta_start)
    return out, state.wound
