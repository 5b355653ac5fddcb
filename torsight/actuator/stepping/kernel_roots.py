# mypy: disable-error-code="no-any-return"
# Elements of numpy arrays carry no type that mypy could check against float.
# ruff: noqa: FBT001
# Compiled functions call each other by position, flags too.
"""Solvers of the balance of torques, compiled: the angle or the fraction at which load and own torque are equal.

Load minus own torque is monotone in the active spring's angle x, so that a bracketed root solves the balance and no
fixed-point iteration is needed. Where the spring continues to slide, one or two Newton steps from an extrapolated guess
reach the same root. The arrays are those of :mod:`~torsight.actuator.stepping.kernel_balance`.
"""

from __future__ import annotations

from typing import Final

from torsight.actuator.stepping.kernel_balance import (
    advance,
    beside,
    cold_and_slope,
    excess,
    fraction_and_slope,
    keep_trial,
    load_and_slope,
    made_and_slopes,
    made_torque,
    seat_holds,
    seated_excess,
    seated_load,
    transformed,
)
from torsight.actuator.stepping.kernel_laws import (
    ROUNDED,
    SEATS,
    Scalars,
    State,
    cold_torque,
    left_by_winding,
    share_done,
    window_place,
)
from torsight.core.compiled import inlined, lending, shared
from torsight.core.units import Floats

# 1e-13 N·m is 1e-10 rad; the errors of the samples do not accumulate, because the laws are no increments.
TORQUE_TOLERANCE: Final = 1e-13
SLIP_TOLERANCE: Final = 4.0 * TORQUE_TOLERANCE


@inlined
def tightened(a: float, fa: float, b: float, fb: float, x: float, fx: float) -> tuple[float, float, float, float]:
    """Return a bracket narrowed by a point within it, the newest point last, after Anderson and Björck."""
    if (fx > 0.0) == (fb > 0.0):
        factor = 1.0 - fx / fb
        return a, fa * (factor if factor > 0.0 else 0.5), x, fx
    return b, fb, x, fx


@lending
def slide(
    sense: float, guess: float, first: float, state: State, p: Scalars, o: Scalars, tables: Floats, sections: Floats
) -> float:
    """Return the angle to which the active spring slides in this sample; ``first`` is the excess at the present angle.

    The first step has the length ``guess``; secant steps follow until the root is bracketed, then Anderson–Björck.
    """
    a, fa, b, fb = state.s[0]["x0"], first, state.s[0]["x0"], 0.0
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
def keep_slide(way: float, s: Scalars) -> None:
    """Store the length of a sample's slide in Newton's divided differences over the last slides."""
    if s["per_s"] > 0.0:
        span, before, bent = 1.0 / s["per_s"], s["rate"], s["rate_2"]
        s["rate"] = way * s["per_s"]
        s["rate_2"] = (s["rate"] - before) / (span + s["span"])
        s["rate_3"] = (s["rate_2"] - bent) / (span + s["span"] + s["span_2"])
        s["span"], s["span_2"] = span, s["span"]


@shared
def glide(s: Scalars, q: Scalars, w: Floats, p: Scalars, o: Scalars, tables: Floats, sections: Floats) -> bool:
    """Continue the slide of the sample before by Newton steps; return False, with no change, if that fails.

    Because the excess is monotone, a root in the direction of the slide is the solution.
    """
    sense, x = q["sliding"], s["x"]
    # Without a transformation a slide continues only if the load changes or viscous friction had slowed it.
    may_creep = p["steady"] == 0.0 or p["viscous_nms"] > 0.0 or p["speed_step"] > 0.0
    bare = not may_creep and p["has_friction"] + p["has_stray"] + p["side_row"] + o["side_row"] + p["dwell_step"] == 0.0
    least_excess = 0.0 if bare else SLIP_TOLERANCE
    x += sense * max(s["guess"], 0.0)
    # One or two steps are usual; where as many as this do not converge, the bracketed search is more reliable.
    for _ in range(8):
        if bare:
            load, load_slope = cold_and_slope(x, s, o, tables)
            load -= sense * p["tau_c"]
        else:
            load, load_slope = load_and_slope(x, sense, s["scale"], s, p, o, tables)
        xi, xi_slope, advances = fraction_and_slope(load, s, p, tables, sections, w)
        if not (advances or may_creep):
            return False
        made, by_x, by_xi = made_and_slopes(x, xi, s, q, p, tables)
        slope = by_x + by_xi * xi_slope * load_slope
        if abs(load - made) <= TORQUE_TOLERANCE:
            if sense * (x - s["x"]) * abs(load_slope - slope) < least_excess:
                return False
            keep_slide(abs(x - s["x"]), s)
            s["x"], s["tau"], s["xi"] = x, load, xi
            keep_trial(w)
            return True
        x -= (load - made) / (load_slope - slope)
    return False


@lending
def sticking_end(x: float, load: float, xi_from: float, xi_to: float, q: Scalars, p: Scalars) -> float:
    """Return ξ between ``xi_from`` and ``xi_to`` at which the own torque reaches the load at a constant angle.

    This is the end of sticking, (21) and (24).
    """
    a, b = xi_from, xi_to
    slope = p["k_m"] - p["k_a"]
    for _ in range(60):
        xi = 0.5 * (a + b)
        torque = q["tau"] + (p["k_a"] + xi * slope) * (x - q["x"] - q["theta_l"] * (xi - q["xi"]))
        # While ξ falls the torque grows towards the load, while ξ grows it falls towards it.
        if (torque - load) * (xi_to - xi_from) > 0.0:
            a = xi
        else:
            b = xi
    return 0.5 * (a + b)


@inlined
def _least_phase(x: float, xi_from: float, xi_to: float, q: Scalars, p: Scalars) -> float:
    """Return ξ between ``xi_from`` and ``xi_to`` at which the own torque (12), (20) is least at a constant angle.

    The torque is quadratic in ξ. It has no least value where K_A is less than K_M: ``xi_to`` is returned then.
    """
    slope = p["k_m"] - p["k_a"]
    if slope >= 0.0 or q["theta_l"] == 0.0:
        return xi_to
    lowest = 0.5 * ((x - q["x"]) / q["theta_l"] + q["xi"] - p["k_a"] / slope)
    return min(max(lowest, min(xi_from, xi_to)), max(xi_from, xi_to))


@inlined
def excess_at_rest(
    sense: float, at: float, limit: float, reached: float, s: Scalars, q: Scalars, p: Scalars, tables: Floats
) -> tuple[float, float]:
    """Return by how much the torque passes the limit while ξ advances at rest to the one that is reached, and ξ there.

    The torque of a spring that cools falls and may rise again: then the disk breaks loose between two samples.
    """
    over = sense * (limit - made_torque(at, reached, s, q, p, tables))
    if over <= SLIP_TOLERANCE:
        least = _least_phase(at, s["xi"], reached, q, p)
        most = sense * (limit - made_torque(at, least, s, q, p, tables))
        if most > SLIP_TOLERANCE:
            return most, least
    return over, reached


@lending
def transform_at_rest(state: State, p: Scalars, tables: Floats, sections: Floats) -> None:
    """Let the active spring's phase follow its temperature while friction holds the angle.

    ξ equals the phase law at the torque for this ξ, and ξ minus this law grows with ξ: Newton steps, bracketed by the
    last trials on either side.
    """
    s, q, w = state.s[0], state.q[0], state.w
    # The first bracket contains the range of ξ, 0 to 1, with a margin of the same width on either side.
    xi, low, high = s["xi"], -1.0, 2.0
    for _ in range(80):
        made, _, by_xi = made_and_slopes(s["x"], xi, s, q, p, tables)
        law, slope, _ = fraction_and_slope(made, s, p, tables, sections, w)
        off = xi - law
        if off > 0.0:
            high = xi
        else:
            low = xi
        # On its loading curve the spring's torque is the same for all ξ: there only the law itself is a solution.
        if (by_xi != 0.0 and abs(off * by_xi) <= TORQUE_TOLERANCE) or off == 0.0 or high - low < ROUNDED:
            break
        xi -= off / (1.0 - slope * by_xi)
        if not low < xi < high:
            xi = 0.5 * (low + high)
    q["at_rest"] += abs(law - s["xi"])
    s["xi"], s["tau"] = law, made
    keep_trial(w)


@lending
def give_way(
    low: float, high: float, hold: float, state: State, p: Scalars, o: Scalars, tables: Floats, sections: Floats
) -> None:
    """Let the phase follow its temperature while elastic elements hold the disk between the angles at which it slides.

    Load minus own torque falls as x grows, as for a slide.
    """
    s, w, x = state.s[0], state.w, state.s[0]["x"]
    before = s["xi"]
    a, fa = low, seated_excess(low, hold, state, p, o, tables, sections)
    b, fb = high, seated_excess(high, hold, state, p, o, tables, sections)
    at = low if fa <= 0.0 else high
    if fa > 0.0 > fb:
        for _ in range(80):
            at = b - fb * (b - a) / (fb - fa)
            a, fa, b, fb = tightened(a, fa, b, fb, at, seated_excess(at, hold, state, p, o, tables, sections))
            at = b
            if abs(fb) <= TORQUE_TOLERANCE or abs(b - a) < ROUNDED or fa == fb:
                break
    s["tau"] = seated_load(at, hold, state, p, o, tables)
    for i in range(SEATS):
        state.held[i] = seat_holds(i, at - x, hold, state, p, tables)
    s["x"] = at
    s["xi"] = advance(s["tau"], s, p, tables, sections, w)
    state.q[0]["at_rest"] += abs(s["xi"] - before)


@inlined
def renew(share: float, x: float, xi: float, q: Scalars, p: Scalars) -> None:
    """Move the reference state by a share towards the present state, whose torque stays the same."""
    stretch = x - q["x"] - q["theta_l"] * (xi - q["xi"])
    q["tau"] += share * (p["k_a"] + xi * (p["k_m"] - p["k_a"])) * stretch
    q["x"], q["xi"] = x - (1.0 - share) * stretch, xi


@lending
def slide_anew(sense: float, limit: float, reached: float, state: State, p: Scalars, tables: Floats) -> None:
    """Set the reference state to that at the end of sticking, between the present ξ and the ξ that the sample reaches.

    The spring may have slid in this direction before and transformed at rest since, because friction rose meanwhile.
    The paper's rule then renews the reference state. But neither a standstill of zero length nor a slide of zero length
    before a long standstill may change the angle. So the reference state is renewed by the share of the transformation
    since the first slide that happened at rest.
    """
    s, q, x, end = state.s[0], state.q[0], state.s[0]["x"], state.s[0]["xi"]
    own = beside(x, s, p, tables)
    held = made_torque(x, end, s, q, p, tables)
    # Where the torque exceeds the limit before any transformation, as at a start, it is not limited: the disk slips.
    if reached != end and sense * (limit - held) < 0.0:
        end, held = sticking_end(x, limit - own, end, reached, q, p), limit
    if q["sliding"] != sense:
        q["x"], q["tau"], q["xi"], q["sliding"], q["begun"] = x, held - own, end, sense, end
    else:
        rested = q["at_rest"] + abs(end - state.s[0]["xi"])
        share = min(1.0, rested / max(abs(end - q["begun"]), rested))
        renew(share, x, end, q, p)
        q["begun"] += share * (end - q["begun"])
    q["at_rest"] = 0.0


@inlined
def _passive_excess(
    xi: float, base: float, angle: float, heating: bool, s: Scalars, o: Scalars, tables: Floats
) -> float:
    """Return the passive spring's ξ by the phase law at the torque for a trial ξ, minus the trial."""
    torque = base + (o["k_a"] + xi * (o["k_m"] - o["k_a"])) * angle * (1.0 - xi)
    done = share_done(heating, window_place(heating, s["temp_passive"], torque, o, tables)[0], o)
    return transformed(heating, s["xi_0_p"], done, o) - xi


@shared
def crosstalk(theta: float, s: Scalars, o: Scalars, tables: Floats) -> float:
    """Let the passive spring transform at its own temperature and return the torque of its recovery."""
    wound = max(s["wound"], theta)
    base = cold_torque(theta, wound, o, tables)
    angle = left_by_winding(wound, o, tables) * o["passive_share"]
    if s["turn_now"] != s["turn_p"]:
        s["xi_0_p"], s["turn_p"] = s["xi_p"], s["turn_now"]
    heating, xi = s["turn_p"] > 0.0, s["xi_p"]
    # The law at the torque for a trial ξ, minus the trial, falls as the trial grows, in both directions of change.
    a, fa = xi, _passive_excess(xi, base, angle, heating, s, o, tables)
    fraction = xi
    if (fa < 0.0) if heating else (fa > 0.0):
        b = 0.0 if heating else 1.0
        fb = _passive_excess(b, base, angle, heating, s, o, tables)
        for _ in range(80):
            if abs(fb) <= ROUNDED or abs(b - a) < ROUNDED or fa == fb:
                break
            x = b - fb * (b - a) / (fb - fa)
            a, fa, b, fb = tightened(a, fa, b, fb, x, _passive_excess(x, base, angle, heating, s, o, tables))
        fraction = b
    if abs(fraction - xi) > ROUNDED:
        s["xi_p"] = fraction
    fraction = s["xi_p"]
    return (o["k_a"] + fraction * (o["k_m"] - o["k_a"])) * angle * (1.0 - fraction)
