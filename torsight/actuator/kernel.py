"""The compiled stepping rule: both springs and the friction, sample by sample, for any temperature history.

At every sample one scalar equation is solved. While the actuator slides, the unknown is the active spring's own
angle x: the passive spring, friction and stray torques give the torque that it must carry, ``load(x)``; that torque
and the temperature give ξ through the phase law; and (12) from the reference state gives the torque that it makes.
Load less made torque is monotone in x, so a bracketed root is the answer and no fixed-point iteration is needed. While
it sticks, x is kept and the unknown is ξ at that angle. The order within a sample: new half-cycle, turn of the
temperature, passive spring, then try to slide the way the transformation drives, else stick, else be driven back.

Everything is in the coordinates of the active spring: x falls while it recovers. The mirror image for spring B is the
sign ``s`` (φ = s (x − θ_P/2)).
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numba import njit

# Places in the vector of scalars.
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
N_SCALARS: Final = 21

# Places in the state of the active spring.
_X_REF, _TAU_REF, _XI_REF, _THETA_L, _SLIDING = 0, 1, 2, 3, 4
_LN100: Final = 4.605170185988092
_TORQUE_TOLERANCE: Final = 1e-15


@njit(cache=True, nogil=True)
def turning_points(temperature, half, threshold):
    """Return +1 where the active spring heats and −1 where it cools; a turn counts beyond ``threshold`` °C.

    The turn is placed at the extremum itself, not where the threshold was crossed. Each half-cycle starts heating.
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
            sense = -sense
            for i in range(where + 1, k):
                direction[i] = sense
            extreme, where = value, k
        direction[k] = sense
    return direction


@njit(cache=True, nogil=True)
def _completed(heating, temperature, torque, p):
    """Return the law's share: of ξ0 that is left while heating, of 1 − ξ0 that has become while cooling."""
    if heating:
        u = (temperature - p[A_START] - p[TEMP_PER_TORQUE_A] * torque) / p[A_WIDTH]
        if u <= 0.0:
            return 1.0
        if p[TANAKA] > 0.5:
            return np.exp(-_LN100 * u)
        return 0.0 if u >= 1.0 else 0.5 * (np.cos(np.pi * u) + 1.0)
    u = (temperature - p[M_FINISH] - p[TEMP_PER_TORQUE_M] * torque) / p[M_WIDTH]
    if u >= 1.0:
        return 0.0
    if p[TANAKA] > 0.5:
        return 1.0 - np.exp(-_LN100 * (1.0 - u))
    return 1.0 if u <= 0.0 else 0.5 * (np.cos(np.pi * u) + 1.0)


@njit(cache=True, nogil=True)
def _fraction(heating, temperature, torque, p, weight, drop_c, drop_share, xi, xi_0):
    """Return the wire's ξ at this torque: each section's law, advanced only."""
    total = 0.0
    for j in range(weight.size):
        own = temperature - drop_c[j] - drop_share[j] * (temperature - p[ROOM_C])
        done = _completed(heating, own, torque, p)
        if heating:
            total += weight[j] * min(xi[j], xi_0[j] * done)
        else:
            total += weight[j] * max(xi[j], xi_0[j] + (1.0 - xi_0[j]) * done)
    return total


@njit(cache=True, nogil=True)
def _advance(heating, temperature, torque, p, weight, drop_c, drop_share, xi, xi_0):
    """Set every section to its ξ at this torque and return the wire's."""
    total = 0.0
    for j in range(weight.size):
        own = temperature - drop_c[j] - drop_share[j] * (temperature - p[ROOM_C])
        done = _completed(heating, own, torque, p)
        if heating:
            xi[j] = min(xi[j], xi_0[j] * done)
        else:
            xi[j] = max(xi[j], xi_0[j] + (1.0 - xi_0[j]) * done)
        total += weight[j] * xi[j]
    return total


@njit(cache=True, nogil=True)
def _interpolate(x, table, p):
    """Return the table's value at x, held beyond its ends; 0 without a table."""
    if table.size == 0:
        return 0.0
    place = (x - p[GRID_START]) / p[GRID_STEP]
    if place <= 0.0:
        return table[0]
    if place >= table.size - 1:
        return table[-1]
    i = int(place)
    return table[i] + (place - i) * (table[i + 1] - table[i])


@njit(cache=True, nogil=True)
def _loading(theta, p, stiffening):
    """Return the martensite's loading curve with what stiffens it."""
    extra = _interpolate(theta, stiffening, p)
    if theta <= p[THETA_CR]:
        return p[K_M] * theta + extra
    return p[K_M] * p[THETA_CR] + p[K_S] * (theta - p[THETA_CR]) + extra


@njit(cache=True, nogil=True)
def _passive(theta, theta_max, p, stiffening):
    """Return the torque of cold martensite: on its loading curve, or unwound elastically from ``theta_max``."""
    if theta >= theta_max:
        return _loading(theta, p, stiffening)
    return _loading(theta_max, p, stiffening) - p[K_M] * (theta_max - theta)


@njit(cache=True, nogil=True)
def _friction(phi, upwards, scale, p, friction_down, friction_up):
    """Return the friction magnitude at φ for a motion up (φ grows) or down."""
    if friction_up.size == 0:
        return p[TAU_C] * scale
    table = friction_up if upwards else friction_down
    return max(0.0, _interpolate(phi + 0.5 * p[THETA_P], table, p)) * scale


@njit(cache=True, nogil=True)
def _load(x, sense, x_before, per_s, theta_max, cross, scale, s, p, stiffening, friction_down, friction_up, stray):
    """Return the torque that the active spring carries while it slides with ``sense`` (−1: x falls).

    −τ^A + τ^B + M − τ_f = 0 (19), M a stray torque along φ, mirrored for spring B.
    """
    phi = s * (x - 0.5 * p[THETA_P])
    friction = _friction(phi, sense * s > 0.0, scale, p, friction_down, friction_up)
    friction += p[VISCOUS] * abs(x - x_before) * per_s
    torque = _passive(p[THETA_P] - x, theta_max, p, stiffening) + cross
    if stray.size > 0:
        torque += s * _interpolate(phi + 0.5 * p[THETA_P], stray, p)
    return torque - sense * friction


@njit(cache=True, nogil=True)
def _made(x, xi, heating, state, p, stiffening):
    """Return the torque that the active spring makes (12), (20); cooling, never less than its loading curve."""
    stiffness = p[K_A] + xi * (p[K_M] - p[K_A])
    torque = state[_TAU_REF] + stiffness * (x - state[_X_REF] - state[_THETA_L] * (xi - state[_XI_REF]))
    if heating:
        return torque
    return max(torque, _loading(x, p, stiffening))


@njit(cache=True, nogil=True)
def _root_step(a, fa, b, fb, c, fc):
    """Return the bracket [a, b] after a trial c between them (Anderson–Björck): b is the newest point."""
    if (fc > 0.0) == (fb > 0.0):
        factor = 1.0 - fc / fb
        fa = fa * (factor if factor > 0.0 else 0.5)
    else:
        a, fa = b, fb
    return a, fa, c, fc


@njit(cache=True, nogil=True)
def _slide(x, sense, guess, heating, temperature, per_s, theta_max, cross, scale, s, p, stiffening, friction_down,
           friction_up, stray, weight, drop_c, drop_share, xi, xi_0, state):  # fmt: skip
    """Return the angle to which the active spring slides from ``x`` in this sample."""
    a, b = x, x
    fa = fb = 0.0
    step = max(guess, 1e-7)
    first = True
    for _ in range(64):
        load = _load(b, sense, x, per_s, theta_max, cross, scale, s, p, stiffening, friction_down, friction_up, stray)
        fraction = _fraction(heating, temperature, load, p, weight, drop_c, drop_share, xi, xi_0)
        fb = sense * (load - _made(b, fraction, heating, state, p, stiffening))
        if fb <= 0.0 and not first:
            break
        first = False
        a, fa = b, max(fb, _TORQUE_TOLERANCE)
        b = b + sense * step
        step *= 2.0
    for _ in range(80):
        if abs(fb) <= _TORQUE_TOLERANCE or abs(b - a) < 1e-13 or fa == fb:
            break
        c = b - fb * (b - a) / (fb - fa)
        load = _load(c, sense, x, per_s, theta_max, cross, scale, s, p, stiffening, friction_down, friction_up, stray)
        fraction = _fraction(heating, temperature, load, p, weight, drop_c, drop_share, xi, xi_0)
        fc = sense * (load - _made(c, fraction, heating, state, p, stiffening))
        a, fa, b, fb = _root_step(a, fa, b, fb, c, fc)
    return b


@njit(cache=True, nogil=True)
def _stick(x, total, heating, temperature, p, stiffening, weight, drop_c, drop_share, xi, xi_0, state):
    """Return ξ at the kept angle: the law at the torque that this very ξ makes."""
    a = total
    torque = _made(x, a, heating, state, p, stiffening)
    b = _fraction(heating, temperature, torque, p, weight, drop_c, drop_share, xi, xi_0)
    if b == a:
        return a
    fa = a - b
    torque = _made(x, b, heating, state, p, stiffening)
    fb = b - _fraction(heating, temperature, torque, p, weight, drop_c, drop_share, xi, xi_0)
    for _ in range(80):
        if abs(fb) <= 1e-14 or abs(b - a) < 1e-15 or fa == fb:
            break
        c = b - fb * (b - a) / (fb - fa)
        torque = _made(x, c, heating, state, p, stiffening)
        fc = c - _fraction(heating, temperature, torque, p, weight, drop_c, drop_share, xi, xi_0)
        a, fa, b, fb = _root_step(a, fa, b, fb, c, fc)
    return b


@njit(cache=True, nogil=True)
def _crosstalk(theta, theta_max, xi, xi_0, heating, temperature, p, stiffening):
    """Return the passive spring's ξ and the torque that its own recovery adds at this angle."""
    base = _passive(theta, theta_max, p, stiffening)
    angle = max(0.0, theta_max - p[THETA_CR]) * (1.0 - p[K_S] / p[K_M]) * p[PASSIVE_SHARE]
    low, high = 0.0, 1.0
    if heating:
        high = xi
    else:
        low = xi
    # The law at the torque of a trial ξ, less the trial: falls as the trial grows, in both directions of change.
    for _ in range(60):
        trial = 0.5 * (low + high)
        torque = base + (p[K_A] + trial * (p[K_M] - p[K_A])) * angle * (1.0 - trial)
        done = _completed(heating, temperature, torque, p)
        target = min(xi, xi_0 * done) if heating else max(xi, xi_0 + (1.0 - xi_0) * done)
        if target > trial:
            low = trial
        else:
            high = trial
        if high - low < 1e-13:
            break
    fraction = 0.5 * (low + high)
    if heating and fraction > xi - 1e-12:
        fraction = xi
    return fraction, (p[K_A] + fraction * (p[K_M] - p[K_A])) * angle * (1.0 - fraction)


@njit(cache=True, nogil=True)
def _sticking_end(x, load, xi_from, xi_to, state, p):
    """Return ξ between the two at which the made torque reaches the load at a kept angle (21), (24)."""
    a, b = xi_from, xi_to
    slope = p[K_M] - p[K_A]
    for _ in range(100):
        c = 0.5 * (a + b)
        torque = state[_TAU_REF] + (p[K_A] + c * slope) * (x - state[_X_REF] - state[_THETA_L] * (c - state[_XI_REF]))
        # While ξ falls the torque grows towards the load, while ξ grows it falls towards it.
        if (torque - load) * (xi_to - xi_from) > 0.0:
            a = c
        else:
            b = c
        if abs(b - a) < 1e-15:
            break
    return 0.5 * (a + b)


@njit(cache=True, nogil=True)
def _home(x, theta_max, p, stiffening, limit):
    """Return θ_max and torque of a spring at ``x`` unwound, if need be, so that its torque is at most ``limit``."""
    torque = _passive(x, theta_max, p, stiffening)
    if torque <= limit:
        return theta_max, torque
    low, high = max(x, p[THETA_CR]), max(x, p[THETA_CR]) + 1.0
    for _ in range(60):
        if _passive(x, high, p, stiffening) <= limit or p[K_M] <= p[K_S]:
            break
        high = x + 2.0 * (high - x)
    for _ in range(100):
        middle = 0.5 * (low + high)
        if _passive(x, middle, p, stiffening) > limit:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high), limit


@njit(cache=True, nogil=True)
def run(per_s, temp_active, temp_passive, active, half, direction, passive_direction, theta_l_scale, friction_scale,
        p, stiffening, friction_down, friction_up, stray, weight, drop_c, drop_share, theta_start):  # fmt: skip
    """Step through all samples.

    Parameters
    ----------
    per_s : (n,) float64
        One over the time since the sample before, 1/s (0 for the first).
    temp_active, temp_passive : (n,) float64
        Wire temperature of the spring that is driven in this half-cycle, and of the other, °C.
    active : (n,) int8
        0 while A is driven, 1 while B is.
    half : (n,) int64
        Number of the half-cycle, from 0.
    direction, passive_direction : (n,) int8
        From :func:`turning_points`.
    theta_l_scale : (halves,) float64
        Factor on the recoverable angle in each half-cycle.
    friction_scale : (n,) float64
        Factor on the friction at each sample.
    p : (N_SCALARS,) float64
        Scalars, in SI units.
    stiffening, friction_down, friction_up, stray : (m,) float64
        Tables over an angle (own winding θ for the first, φ + θ_P/2 for the others), or empty.
    weight, drop_c, drop_share : (sections,) float64
        Wire sections: share, and how much cooler than the sensor (absolute, and of the excess over the room).
    theta_start : float
        θ^A at the start, rad.

    Returns
    -------
    theta_a, xi_a, xi_b, tau_a, tau_b : (n,) float64
        Angle of spring A (rad), fractions, torques (N·m).
    """
    n = temp_active.size
    sections = weight.size
    out = np.empty((5, n))
    theta_p = p[THETA_P]
    # Both springs' largest winding since they were last austenite, torque and fraction.
    wound = np.array([theta_start, theta_p - theta_start])
    for i in range(2):
        own = theta_start if i == 0 else theta_p - theta_start
        other = theta_p - own
        friction = _friction(theta_start - 0.5 * theta_p, i == 1, friction_scale[0], p, friction_down, friction_up)
        wound[i], _ = _home(own, own, p, stiffening, _loading(other, p, stiffening) + friction)
    xi, xi_0, saved_xi_0 = np.ones(sections), np.ones(sections), np.ones(sections)
    state, saved = np.zeros(5), np.zeros(5)
    x = theta_a = theta_start
    tau, total, move, rest_s = 0.0, 1.0, 1e-3, 0.0
    xi_passive = xi_0_passive = 1.0
    cross, passive_turned = 0.0, 1
    changed, who = True, -1
    for k in range(n):
        if k == 0 or half[k] != half[k - 1]:
            if who >= 0:
                wound[who] = x
            who = active[k]
            x = theta_a if who == 0 else theta_p - theta_a
            sign = 1.0 if who == 0 else -1.0
            hold = _friction(sign * (x - 0.5 * theta_p), sign < 0.0, friction_scale[k], p, friction_down, friction_up)
            other = _passive(theta_p - x, wound[1 - who], p, stiffening)
            if stray.size > 0:
                other += sign * _interpolate(sign * (x - 0.5 * theta_p) + 0.5 * theta_p, stray, p)
            tau = min(_passive(x, wound[who], p, stiffening), other + hold)
            excess = max(0.0, wound[who] - p[THETA_CR])
            state[_THETA_L] = excess * (1.0 - p[K_S] / p[K_M])
            if p[FIXED_THETA_L] > 0.0:
                state[_THETA_L] = p[FIXED_THETA_L]
            state[_THETA_L] *= theta_l_scale[half[k]]
            state[_X_REF], state[_TAU_REF], state[_XI_REF], state[_SLIDING] = x, tau, 1.0, 0.0
            xi[:], xi_0[:] = 1.0, 1.0
            total, xi_passive, xi_0_passive, cross, passive_turned = 1.0, 1.0, 1.0, 0.0, 1
            changed = True
        elif direction[k] != direction[k - 1]:
            # A turn after which nothing had changed was no turn: the transformation before it goes on.
            if changed:
                saved[:], saved_xi_0[:] = state, xi_0
                state[_X_REF], state[_TAU_REF], state[_XI_REF], state[_SLIDING] = x, tau, total, 0.0
                xi_0[:] = xi
                if direction[k] > 0 and total > 1.0 - 1e-9 and p[FIXED_THETA_L] <= 0.0:
                    wound[who] = x
                    state[_THETA_L] = max(0.0, x - p[THETA_CR]) * (1.0 - p[K_S] / p[K_M]) * theta_l_scale[half[k]]
            else:
                for i in range(5):
                    state[i], saved[i] = saved[i], state[i]
                for j in range(sections):
                    xi_0[j], saved_xi_0[j] = saved_xi_0[j], xi_0[j]
            changed = False
        heating = direction[k] > 0
        temperature, scale = temp_active[k], friction_scale[k]
        s = 1.0 if who == 0 else -1.0
        x_before, total_before = x, total
        theta_max = wound[1 - who]
        if p[PASSIVE_SHARE] > 0.0:
            if passive_direction[k] != passive_turned:
                xi_0_passive, passive_turned = xi_passive, passive_direction[k]
            xi_passive, cross = _crosstalk(
                theta_p - x, theta_max, xi_passive, xi_0_passive, passive_turned > 0, temp_passive[k], p, stiffening
            )
        threshold = scale
        if p[STATIC_EXCESS] > 0.0 and state[_SLIDING] == 0.0:
            threshold *= 1.0 + p[STATIC_EXCESS] * (1.0 - np.exp(-rest_s / p[STATIC_TIME]))
        slid = False
        # First the way in which the transformation drives, then (after sticking) the other way.
        for attempt in range(2):
            sense = -1.0 if heating == (attempt == 0) else 1.0
            limit = _load(x, sense, x, 0.0, theta_max, cross, threshold, s, p, stiffening, friction_down, friction_up,
                          stray)  # fmt: skip
            if attempt == 0:
                reached = _fraction(heating, temperature, limit, p, weight, drop_c, drop_share, xi, xi_0)
            else:
                reached = total
            made = _made(x, reached, heating, state, p, stiffening)
            if sense * (limit - made) > 1e-13:
                if state[_SLIDING] != sense:
                    end = reached
                    if attempt == 0:
                        before = _made(x, total, heating, state, p, stiffening)
                        end = total
                        if sense * (limit - before) < 0.0:
                            end = _sticking_end(x, limit, total, reached, state, p)
                    kinetic = _load(x, sense, x, 0.0, theta_max, cross, scale, s, p, stiffening, friction_down,
                                    friction_up, stray)  # fmt: skip
                    state[_X_REF], state[_TAU_REF], state[_XI_REF] = x, kinetic, end
                    if threshold > scale:
                        state[_TAU_REF] = limit
                    state[_SLIDING] = sense
                x = _slide(x, sense, 1.3 * move, heating, temperature, per_s[k], theta_max, cross, scale, s, p,
                           stiffening, friction_down, friction_up, stray, weight, drop_c, drop_share, xi, xi_0,
                           state)  # fmt: skip
                tau = _load(x, sense, x_before, per_s[k], theta_max, cross, scale, s, p, stiffening, friction_down,
                            friction_up, stray)  # fmt: skip
                total = _advance(heating, temperature, tau, p, weight, drop_c, drop_share, xi, xi_0)
                move = abs(x - x_before)
                slid = True
                break
            if attempt == 0:
                total = _stick(x, total, heating, temperature, p, stiffening, weight, drop_c, drop_share, xi, xi_0,
                               state)  # fmt: skip
                tau = _made(x, total, heating, state, p, stiffening)
                _advance(heating, temperature, tau, p, weight, drop_c, drop_share, xi, xi_0)
        if slid:
            rest_s = 0.0
        elif k > 0:
            rest_s += 1.0 / per_s[k]
        if total != total_before or x != x_before:
            changed = True
        wound[1 - who] = max(theta_max, theta_p - x)
        theta_a = x if who == 0 else theta_p - x
        other = _passive(theta_p - x, wound[1 - who], p, stiffening) + cross
        out[0, k] = theta_a
        out[1 + who, k] = total
        out[2 - who, k] = xi_passive
        out[3 + who, k] = tau
        out[4 - who, k] = other
    return out
