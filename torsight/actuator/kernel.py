# mypy: disable-error-code="no-any-return"
# Elements of numpy arrays carry no type that mypy could check against float.
# ruff: noqa: FBT001
# Compiled functions call each other by position, flags too.
"""The compiled stepping rule: both springs and the friction, sample by sample, for any temperature history.

At every sample one scalar equation is solved. While the actuator slides, the unknown is the active spring's own
angle x: the passive spring, friction and stray torques give the torque that it must carry, ``load(x)``; that torque
and the temperature give ξ through the phase law; and (12) from the reference state gives the torque that it makes.
Load less made torque is monotone in x, so a bracketed root is the answer and no fixed-point iteration is needed. While
it sticks, x is kept and the unknown is ξ at that angle. The order within a sample: new half-cycle, turn of the
temperature, passive spring, then try to slide the way the transformation drives, else stick, else be driven back.

Everything is in the coordinates of the active spring: x falls while it recovers. The mirror image for spring B is the
sign s (φ = s (x − θ_P/2)).

Arrays that go from function to function:
``p`` scalars of the rig; ``tables`` (3, m) torques over θ^A; ``sections`` (3, m) of the wire: weight, how much
cooler than the sensor, and that as a share of the excess over the room; ``c`` what holds during one sample; ``q`` the
reference state; ``w`` (3, m) per section: ξ, ξ0, and the furthest place in the law's window; ``g`` what goes on from
sample to sample.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from torsight.actuator.compiled import compiled, inlined

Array = NDArray[np.float64]
Flags = NDArray[np.int8]
Counts = NDArray[np.int64]

# Places in p, the scalars of the rig (SI units, °C).
K_A: Final = 0
K_M: Final = 1
K_S: Final = 2
A_START: Final = 3
A_WIDTH: Final = 4
M_FINISH: Final = 5
M_WIDTH: Final = 6
TEMP_PER_TORQUE_A: Final = 7
TEMP_PER_TORQUE_M: Final = 8
THETA_CR: Final = 9
THETA_P: Final = 10
TAU_C: Final = 11
VISCOUS: Final = 12
STATIC_EXCESS: Final = 13
STATIC_TIME: Final = 14
PASSIVE_SHARE: Final = 15
TANAKA: Final = 16
ROOM_C: Final = 17
GRID_START: Final = 18
GRID_STEP: Final = 19
FIXED_THETA_L: Final = 20
HAS_FRICTION: Final = 21
HAS_STRAY: Final = 22
SIMPLE: Final = 23
HOME_HOLD: Final = 24
N_SCALARS: Final = 25

# Rows of the tables.
FRICTION_DOWN: Final = 0
FRICTION_UP: Final = 1
STRAY: Final = 2

# Places in c, q and g.
_TEMP, _HEATING, _X0, _PER_S, _WOUND, _CROSS, _SCALE, _SIGN = 0, 1, 2, 3, 4, 5, 6, 7
_TEMP_PASSIVE, _TURN_NOW = 8, 9
_X_REF, _TAU_REF, _XI_REF, _THETA_L, _SLIDING, _FLOOR = 0, 1, 2, 3, 4, 5
_X, _TAU, _XI, _MOVE, _REST_S, _XI_P, _XI_0_P, _TURN_P, _CHANGED, _WHO, _MOVE_2 = 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10
_LN100: Final = 4.605170185988092
# 1e-13 N·m is 1e-10 rad; a step's error does not add up, because the laws hold absolutely at every sample.
_TORQUE_TOLERANCE: Final = 1e-13
_SLIP_TOLERANCE: Final = 4e-13


@compiled
def turning_points(temperature: Array, half: Counts, threshold: float) -> Flags:
    """Return +1 where the active spring heats and −1 where it cools; a turn counts beyond ``threshold`` °C.

    The turn is placed where the temperature leaves its extremum for good, not where the threshold was crossed: a hold
    belongs to what came before it. Each half-cycle starts heating.
    """
    n = temperature.size
    direction = np.ones(n, np.int8)
    sense, extreme, where = 1, 0.0, 0
    for k in range(n):
        value = temperature[k]
        if k == 0 or half[k] != half[k - 1]:
            sense, extreme, where = 1, value, k
        elif sense * (value - extreme) > 0.0:
            extreme, where = value, k
        elif sense * (extreme - value) >= threshold:
            # The knee: furthest from the straight way between the extremum and here.
            first, furthest = where, 0.0
            for i in range(first + 1, k):
                away = sense * (temperature[i] - extreme - (value - extreme) * (i - first) / (k - first))
                if away > furthest:
                    where, furthest = i, away
            sense = -sense
            for i in range(where + 1, k):
                direction[i] = sense
            extreme, where = value, k
        direction[k] = sense
    return direction


@inlined
def _place(heating: bool, temperature: float, torque: float, p: Array) -> float:
    """Return where in the law's window the wire is: 0 at its start, 1 at its end, in the direction of change."""
    if heating:
        return (temperature - p[A_START] - p[TEMP_PER_TORQUE_A] * torque) / p[A_WIDTH]
    return 1.0 - (temperature - p[M_FINISH] - p[TEMP_PER_TORQUE_M] * torque) / p[M_WIDTH]


@inlined
def _done(place: float, p: Array) -> float:
    """Return the share of the transformation that is done at a place in the window."""
    if place <= 0.0:
        return 0.0
    if p[TANAKA] > 0.5:
        return 1.0 - np.exp(-_LN100 * place)
    return 1.0 if place >= 1.0 else 0.5 - 0.5 * np.cos(np.pi * place)


@inlined
def _fraction(torque: float, c: Array, p: Array, sections: Array, w: Array) -> float:
    """Return the wire's ξ at this torque: each section's law, advanced only."""
    total = 0.0
    heating = c[_HEATING] > 0.0
    for j in range(w.shape[1]):
        own = c[_TEMP] - sections[1, j] - sections[2, j] * (c[_TEMP] - p[ROOM_C])
        place = _place(heating, own, torque, p)
        xi = w[0, j]
        if place > w[2, j]:
            done = _done(place, p)
            xi = w[1, j] * (1.0 - done) if heating else w[1, j] + (1.0 - w[1, j]) * done
        total += sections[0, j] * xi
    return total


@compiled
def _advance(torque: float, c: Array, p: Array, sections: Array, w: Array) -> float:
    """Set every section to its ξ at this torque and return the wire's."""
    total = 0.0
    heating = c[_HEATING] > 0.0
    for j in range(w.shape[1]):
        own = c[_TEMP] - sections[1, j] - sections[2, j] * (c[_TEMP] - p[ROOM_C])
        place = _place(heating, own, torque, p)
        if place > w[2, j]:
            done = _done(place, p)
            w[0, j] = w[1, j] * (1.0 - done) if heating else w[1, j] + (1.0 - w[1, j]) * done
            w[2, j] = place
        total += sections[0, j] * w[0, j]
    return total


@inlined
def _interpolate(x: float, row: int, p: Array, tables: Array) -> float:
    """Return a table's value at x, held beyond its ends."""
    place = (x - p[GRID_START]) / p[GRID_STEP]
    last = tables.shape[1] - 1
    if place <= 0.0:
        return tables[row, 0]
    if place >= last:
        return tables[row, last]
    i = int(place)
    return tables[row, i] + (place - i) * (tables[row, i + 1] - tables[row, i])


@inlined
def _loading(theta: float, p: Array) -> float:
    """Return the martensite's loading curve."""
    if theta <= p[THETA_CR]:
        return p[K_M] * theta
    return p[K_M] * p[THETA_CR] + p[K_S] * (theta - p[THETA_CR])


@inlined
def _cold(theta: float, theta_max: float, p: Array) -> float:
    """Return the torque of cold martensite: on its loading curve, or unwound elastically from ``theta_max``."""
    if theta >= theta_max:
        return _loading(theta, p)
    return _loading(theta_max, p) - p[K_M] * (theta_max - theta)


@inlined
def _friction(theta_a: float, up: bool, p: Array, tables: Array) -> float:
    """Return the friction magnitude at θ^A = φ + θ_P/2 for a motion up (φ grows) or down."""
    if p[HAS_FRICTION] > 0.0:
        return max(0.0, _interpolate(theta_a, FRICTION_UP if up else FRICTION_DOWN, p, tables))
    return p[TAU_C]


@inlined
def _load(x: float, sense: float, scale: float, c: Array, p: Array, tables: Array) -> float:
    """Return the torque that the active spring carries while it slides with ``sense`` (−1: x falls).

    −τ^A + τ^B + M − τ_f = 0 (19), M a stray torque along φ, mirrored for spring B.
    """
    theta_a = x if c[_SIGN] > 0.0 else p[THETA_P] - x
    friction = _friction(theta_a, sense * c[_SIGN] > 0.0, p, tables) * scale
    friction += p[VISCOUS] * abs(x - c[_X0]) * c[_PER_S]
    torque = _cold(p[THETA_P] - x, c[_WOUND], p) + c[_CROSS] - sense * friction
    if p[HAS_STRAY] > 0.0:
        torque += c[_SIGN] * _interpolate(theta_a, STRAY, p, tables)
    return torque


@inlined
def _made(x: float, xi: float, c: Array, q: Array, p: Array) -> float:
    """Return the torque that the active spring makes (12), (20); cooling, never less than cold martensite's.

    That is the loading curve, unless the spring lay below it when it began to cool: then the curve's elastic branch.
    """
    stiffness = p[K_A] + xi * (p[K_M] - p[K_A])
    torque = q[_TAU_REF] + stiffness * (x - q[_X_REF] - q[_THETA_L] * (xi - q[_XI_REF]))
    if c[_HEATING] > 0.0:
        return torque
    return max(torque, _cold(x, q[_FLOOR], p))


@inlined
def _excess(x: float, sense: float, c: Array, q: Array, w: Array, p: Array, tables: Array, sections: Array) -> float:
    """Return load less made torque at a trial angle, positive as long as it must slide on."""
    load = _load(x, sense, c[_SCALE], c, p, tables)
    return sense * (load - _made(x, _fraction(load, c, p, sections, w), c, q, p))


@compiled
def _slide(
    sense: float, guess: float, first: float, c: Array, q: Array, w: Array, p: Array, tables: Array, sections: Array
) -> float:
    """Return the angle to which the active spring slides in this sample; ``first`` is the excess where it stands.

    A step as long as the last one, then the secant's own steps until the root is passed; then Anderson–Björck.
    """
    a, fa, b, fb = c[_X0], first, c[_X0], 0.0
    bracketed = False
    step = max(guess, 1e-7)
    x = a + sense * step
    for _ in range(120):
        fx = _excess(x, sense, c, q, w, p, tables, sections)
        if not bracketed:
            b, fb = x, fx
            if fx <= _TORQUE_TOLERANCE:
                bracketed = True
            else:
                drop = (fa - fx) / step
                ahead = 1.05 * fx / drop if drop > 0.0 else 2.0 * step
                a, fa = x, fx
                step = min(max(ahead, 1e-9), 8.0 * step)
        else:
            if (fx > 0.0) == (fb > 0.0):
                factor = 1.0 - fx / fb
                fa *= factor if factor > 0.0 else 0.5
            else:
                a, fa = b, fb
            b, fb = x, fx
        if not bracketed:
            x = a + sense * step
            continue
        if abs(fb) <= _TORQUE_TOLERANCE or abs(b - a) < 1e-13 or fa == fb:
            break
        x = b - fb * (b - a) / (fb - fa)
    return b


@compiled
def _stick(x: float, total: float, c: Array, q: Array, w: Array, p: Array, sections: Array) -> float:
    """Return ξ at the kept angle: the law at the torque that this very ξ makes (Anderson–Björck)."""
    a, fa, b, fb = total, 0.0, total, 0.0
    xi = total
    for trial in range(80):
        law = _fraction(_made(x, xi, c, q, p), c, p, sections, w)
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
            if (fx > 0.0) == (fb > 0.0):
                factor = 1.0 - fx / fb
                fa *= factor if factor > 0.0 else 0.5
            else:
                a, fa = b, fb
            b, fb = xi, fx
        if abs(fb) <= 1e-14 or abs(b - a) < 1e-15 or fa == fb:
            break
        xi = b - fb * (b - a) / (fb - fa)
    return b


@compiled
def _sticking_end(x: float, load: float, xi_from: float, xi_to: float, q: Array, p: Array) -> float:
    """Return ξ between the two at which the made torque reaches the load at a kept angle (21), (24)."""
    a, b = xi_from, xi_to
    slope = p[K_M] - p[K_A]
    for _ in range(60):
        xi = 0.5 * (a + b)
        torque = q[_TAU_REF] + (p[K_A] + xi * slope) * (x - q[_X_REF] - q[_THETA_L] * (xi - q[_XI_REF]))
        # While ξ falls the torque grows towards the load, while ξ grows it falls towards it.
        if (torque - load) * (xi_to - xi_from) > 0.0:
            a = xi
        else:
            b = xi
    return 0.5 * (a + b)


@compiled
def _crosstalk(theta: float, c: Array, g: Array, p: Array) -> float:
    """Let the passive spring transform at its own temperature and return the torque that its recovery adds."""
    base = _cold(theta, c[_WOUND], p)
    angle = max(0.0, c[_WOUND] - p[THETA_CR]) * (1.0 - p[K_S] / p[K_M]) * p[PASSIVE_SHARE]
    if c[_TURN_NOW] != g[_TURN_P]:
        g[_XI_0_P], g[_TURN_P] = g[_XI_P], c[_TURN_NOW]
    heating, xi = g[_TURN_P] > 0.0, g[_XI_P]
    low, high = (0.0, xi) if heating else (xi, 1.0)
    # The law at the torque of a trial ξ, less the trial: falls as the trial grows, in both directions of change.
    for _ in range(46):
        trial = 0.5 * (low + high)
        torque = base + (p[K_A] + trial * (p[K_M] - p[K_A])) * angle * (1.0 - trial)
        done = _done(_place(heating, c[_TEMP_PASSIVE], torque, p), p)
        own = g[_XI_0_P] * (1.0 - done) if heating else g[_XI_0_P] + (1.0 - g[_XI_0_P]) * done
        target = min(xi, own) if heating else max(xi, own)
        if target > trial:
            low = trial
        else:
            high = trial
    fraction = 0.5 * (low + high)
    if abs(fraction - xi) > 1e-12:
        g[_XI_P] = fraction
    fraction = g[_XI_P]
    return (p[K_A] + fraction * (p[K_M] - p[K_A])) * angle * (1.0 - fraction)


@compiled
def _wound_for(x: float, limit: float, p: Array) -> float:
    """Return θ_max of cold martensite at ``x`` that was unwound, if need be, until its torque was ``limit``."""
    if _loading(x, p) <= limit:
        return x
    # Where the loading curve has its second slope, unwinding from further off leaves less torque: linear in θ_max.
    start = max(x, p[THETA_CR])
    return start + max(0.0, _cold(x, start, p) - limit) / (p[K_M] - p[K_S])


@compiled
def _home(theta_start: float, scale: float, p: Array, tables: Array) -> Array:
    """Return θ_max of both springs at the start: as they stand, or unwound to what the other and friction hold."""
    wound = np.empty(2)
    for i in range(2):
        own = theta_start if i == 0 else p[THETA_P] - theta_start
        hold = p[HOME_HOLD] * scale * _friction(theta_start, i == 1, p, tables)
        if p[HAS_STRAY] > 0.0:
            hold += (1.0 if i == 0 else -1.0) * _interpolate(theta_start, STRAY, p, tables)
        wound[i] = _wound_for(own, _loading(p[THETA_P] - own, p) + hold, p)
    return wound


@inlined
def _recoverable(wound: float, scale: float, p: Array) -> float:
    if p[FIXED_THETA_L] > 0.0:
        return p[FIXED_THETA_L] * scale
    return max(0.0, wound - p[THETA_CR]) * (1.0 - p[K_S] / p[K_M]) * scale


@compiled
def _start_half_cycle(who: int, theta_a: float, scale: float, theta_l_scale: float, g: Array, q: Array, w: Array,
                      wound: Array, p: Array, tables: Array) -> None:  # fmt: skip
    """Take both springs as full martensite: the one that was driven on its loading curve, the other as it was left."""
    before = int(g[_WHO])
    if before >= 0:
        wound[before] = _wound_for(g[_X], g[_TAU], p)
    x = theta_a if who == 0 else p[THETA_P] - theta_a
    sign = 1.0 if who == 0 else -1.0
    limit = _cold(p[THETA_P] - x, wound[1 - who], p) + scale * _friction(theta_a, who == 1, p, tables)
    if p[HAS_STRAY] > 0.0:
        limit += sign * _interpolate(theta_a, STRAY, p, tables)
    g[_WHO], g[_X], g[_XI] = who, x, 1.0
    g[_TAU] = min(_cold(x, wound[who], p), limit)
    g[_XI_P], g[_XI_0_P], g[_TURN_P], g[_CHANGED] = 1.0, 1.0, 1.0, 1.0
    q[_X_REF], q[_TAU_REF], q[_XI_REF], q[_SLIDING] = x, g[_TAU], 1.0, 0.0
    q[_THETA_L] = _recoverable(wound[who], theta_l_scale, p)
    w[0], w[1], w[2] = 1.0, 1.0, 0.0


@compiled
def _turn(heating: bool, theta_l_scale: float, g: Array, q: Array, w: Array, saved_q: Array, saved_w: Array,
          wound: Array, p: Array) -> None:  # fmt: skip
    """Take a new reference state when heating turns into cooling or back.

    A turn after which nothing changes until the next is no turn: the transformation before it goes on.
    """
    if g[_CHANGED] > 0.0:
        saved_q[:], saved_w[:] = q, w
        q[_X_REF], q[_TAU_REF], q[_XI_REF], q[_SLIDING] = g[_X], g[_TAU], g[_XI], 0.0
        q[_FLOOR] = _wound_for(g[_X], g[_TAU], p)
        w[1], w[2] = w[0], 0.0
        if heating and g[_XI] > 1.0 - 1e-9:
            who = int(g[_WHO])
            wound[who] = q[_FLOOR]
            q[_THETA_L] = _recoverable(q[_FLOOR], theta_l_scale, p)
    else:
        for i in range(q.size):
            q[i], saved_q[i] = saved_q[i], q[i]
        for j in range(w.shape[1]):
            for i in (1, 2):
                w[i, j], saved_w[i, j] = saved_w[i, j], w[i, j]
    g[_CHANGED] = 0.0


@compiled
def _settle(g: Array, c: Array, q: Array, w: Array, p: Array, tables: Array, sections: Array) -> bool:
    """Bring the active spring to rest in this sample; return whether it slid.

    First the way in which the transformation drives, then (after sticking) the other way.
    """
    x, scale = g[_X], c[_SCALE]
    hold = scale
    if p[STATIC_EXCESS] > 0.0 and q[_SLIDING] == 0.0:
        hold *= 1.0 + p[STATIC_EXCESS] * (1.0 - np.exp(-g[_REST_S] / p[STATIC_TIME]))
    for attempt in range(2):
        sense = -1.0 if (c[_HEATING] > 0.0) == (attempt == 0) else 1.0
        limit = _load(x, sense, hold, c, p, tables)
        reached = _fraction(limit, c, p, sections, w) if attempt == 0 else g[_XI]
        if sense * (limit - _made(x, reached, c, q, p)) > _SLIP_TOLERANCE:
            if q[_SLIDING] != sense:
                end = reached
                if attempt == 0:
                    end = g[_XI]
                    if sense * (limit - _made(x, end, c, q, p)) < 0.0:
                        end = _sticking_end(x, limit, end, reached, q, p)
                q[_X_REF], q[_TAU_REF], q[_XI_REF], q[_SLIDING] = x, limit, end, sense
                first = _excess(x, sense, c, q, w, p, tables, sections)
            else:
                first = sense * (limit - _made(x, reached, c, q, p))
            if first > 0.0:
                # As far as in the sample before, and the change between the two before.
                g[_X] = _slide(sense, 2.0 * g[_MOVE] - g[_MOVE_2], first, c, q, w, p, tables, sections)
            g[_TAU] = _load(g[_X], sense, scale, c, p, tables)
            g[_XI] = _advance(g[_TAU], c, p, sections, w)
            g[_MOVE_2], g[_MOVE] = g[_MOVE], abs(g[_X] - x)
            return True
        if attempt == 0:
            g[_XI] = _stick(x, g[_XI], c, q, w, p, sections)
            g[_TAU] = _made(x, g[_XI], c, q, p)
            _advance(g[_TAU], c, p, sections, w)
    return False


@inlined
def _nothing_to_do(c: Array, g: Array, w: Array, p: Array, sections: Array) -> bool:
    """Return whether no section's transformation advances at the torque as it is."""
    heating = c[_HEATING] > 0.0
    for j in range(w.shape[1]):
        own = c[_TEMP] - sections[1, j] - sections[2, j] * (c[_TEMP] - p[ROOM_C])
        complete = w[2, j] >= 1.0 and p[TANAKA] < 0.5
        if not complete and _place(heating, own, g[_TAU], p) > w[2, j]:
            return False
    return True


@compiled
def run(
    per_s: Array,
    temps: Array,
    active: Flags,
    half: Counts,
    directions: NDArray[np.int8],
    theta_l_scale: Array,
    friction_scale: Array,
    p: Array,
    tables: Array,
    sections: Array,
    theta_start: float,
) -> Array:
    """Step through all samples.

    Parameters
    ----------
    per_s : (n,) float64
        One over the time since the sample before, 1/s (0 for the first).
    temps : (2, n) float64
        Wire temperature of the spring that is driven in this half-cycle, and of the other, °C.
    active : (n,) int8
        0 while A is driven, 1 while B is.
    half : (n,) int64
        Number of the half-cycle, from 0.
    directions : (2, n) int8
        From :func:`turning_points`, for either row of ``temps``.
    theta_l_scale : (halves,) float64
        Factor on the recoverable angle in each half-cycle.
    friction_scale : (n,) float64
        Factor on the friction at each sample.
    p : (N_SCALARS,) float64
        Scalars, in SI units.
    tables : (3, m) float64
        Torques over θ^A = φ + θ_P/2: friction down and up, stray torque.
    sections : (3, m) float64
        Wire sections: share, and how much cooler than the sensor (absolute, and of the excess over the room).
    theta_start : float
        θ^A at the start, rad.

    Returns
    -------
    (5, n) float64
        θ^A (rad), ξ of A and B, torque of A and B (N·m).
    """
    n = active.size
    out = np.empty((5, n))
    c, q, saved_q, g = np.zeros(10), np.zeros(6), np.zeros(6), np.zeros(11)
    w, saved_w = np.ones((3, sections.shape[1])), np.ones((3, sections.shape[1]))
    g[_WHO], g[_MOVE], g[_MOVE_2] = -1.0, 1e-3, 1e-3
    theta_a, theta_p = theta_start, p[THETA_P]
    wound = _home(theta_start, friction_scale[0], p, tables)
    for k in range(n):
        fresh = True
        if k == 0 or half[k] != half[k - 1]:
            scale = theta_l_scale[half[k]]
            _start_half_cycle(active[k], theta_a, friction_scale[k], scale, g, q, w, wound, p, tables)
        elif directions[0, k] != directions[0, k - 1]:
            _turn(directions[0, k] > 0, theta_l_scale[half[k]], g, q, w, saved_q, saved_w, wound, p)
        else:
            fresh = p[SIMPLE] == 0.0
        who = int(g[_WHO])
        c[_TEMP], c[_HEATING] = temps[0, k], directions[0, k]
        if not fresh and _nothing_to_do(c, g, w, p, sections):
            for i in range(5):
                out[i, k] = out[i, k - 1]
            continue
        c[_X0], c[_PER_S], c[_WOUND], c[_SCALE] = g[_X], per_s[k], wound[1 - who], friction_scale[k]
        c[_SIGN] = 1.0 if who == 0 else -1.0
        c[_TEMP_PASSIVE], c[_CROSS] = temps[1, k], 0.0
        c[_TURN_NOW] = directions[1, k]
        if p[PASSIVE_SHARE] > 0.0:
            c[_CROSS] = _crosstalk(theta_p - g[_X], c, g, p)
        total = g[_XI]
        slid = _settle(g, c, q, w, p, tables, sections)
        g[_REST_S] = 0.0 if slid or k == 0 else g[_REST_S] + 1.0 / per_s[k]
        if g[_XI] != total or g[_X] != c[_X0]:
            g[_CHANGED] = 1.0
        wound[1 - who] = max(wound[1 - who], theta_p - g[_X])
        theta_a = g[_X] if who == 0 else theta_p - g[_X]
        out[0, k] = theta_a
        out[1 + who, k] = g[_XI]
        out[2 - who, k] = g[_XI_P]
        out[3 + who, k] = g[_TAU]
        out[4 - who, k] = _cold(theta_p - g[_X], wound[1 - who], p) + c[_CROSS]
    return out
