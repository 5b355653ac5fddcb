"""The best local fit at every sample of a temperature log, and the wire's temperature behind a slow sensor.

Every sample gets the value of a local parabola over a window before it, after it or around it. Each kind of window
grows until the intervals of its estimates no longer meet (Goldenshluger and Nemirovski 1997; Katkovnik 1999): it stops
at a corner by itself; the kind that ends with the smallest variance is used. A sample's value is the mean of what the
parabolas of the samples beside it say, each within its own window: so it does not jump where the window changes, which
would move the angle at once.

The wire behind a slow sensor, τ dT_m/dt = T − T_m, comes out of the same fits: where the wire is locally a parabola,
the sensor reads the parabola less its own lag and a rest that decays with τ, and that is what is fitted. The noise is
not differentiated anywhere, and the wire's corners come out sharp.
"""

from __future__ import annotations

import math
import sys
from typing import Final

import numpy as np

from torsight.core.compiled import compiled, inlined
from torsight.core.units import Floats, Ints

_AS_WELL: Final = 1.0 - 1e-9
"""Windows of one length on either side know as much: sums in another order must not choose between them."""
_GONE: Final = 25.0
"""Time constants after which nothing is left of an earlier corner: e⁻²⁵ of 60 °C are 1e-9 °C."""
_MOST: Final = math.exp(_GONE)
# Exponents of what decays stay within a number's range, and all ratios up to _MOST are exact around a sample.
_FARTHEST: Final = math.log(sys.float_info.max) - _GONE
_NEAR_ENOUGH: Final = _FARTHEST - _GONE


@compiled
def _add(m: Floats, t: Floats, y: Floats, t_here: float, y_here: float) -> None:
    """Add samples to the normal equations of a parabola around one: (4, 4) of 1, t, t², and the side's column."""
    t1 = t2 = t3 = t4 = y0 = y1 = y2 = 0.0
    for i in range(t.size):
        away, above = t[i] - t_here, y[i] - y_here
        square = away * away
        t1 += away
        t2 += square
        t3 += away * square
        t4 += square * square
        y0 += above
        y1 += away * above
        y2 += square * above
    m[0, 0] += t.size
    m[0, 1] += t1
    m[0, 2] += t2
    m[1, 2] += t3
    m[2, 2] += t4
    m[0, 4] += y0
    m[1, 4] += y1
    m[2, 4] += y2


@compiled
def _add_rest(m: Floats, t: Floats, y: Floats, decay: Floats, t_here: float, y_here: float, scale: float) -> None:
    """Add the same samples' products with the rest that decays, ``decay`` times ``scale``."""
    r0 = r1 = r2 = rr = ry = 0.0
    for i in range(t.size):
        away, rest = t[i] - t_here, min(decay[i] * scale, _MOST)
        r0 += rest
        r1 += rest * away
        r2 += rest * away * away
        rr += rest * rest
        ry += rest * (y[i] - y_here)
    m[0, 3] += r0
    m[1, 3] += r1
    m[2, 3] += r2
    m[3, 3] += rr
    m[3, 4] += ry


@compiled
def _decays(decay: Floats, time: Floats, k: int, reach: int, lag: float) -> None:
    """Set what decays from 1 at sample k, for the samples up to ``reach`` before it and 2 ``reach`` after it.

    One exponential per sample serves the windows of ``reach`` samples: they need its ratios only.
    """
    for i in range(max(0, k - reach), min(time.size, k + 2 * reach)):
        decay[i] = np.exp(min(max((time[k] - time[i]) / lag, -_FARTHEST), _FARTHEST))


@compiled
def _renewed(decay: Floats, time: Floats, k: int, made_for: int, reach: int, lag: float) -> int:
    """Make the decays anew where those at hand do not serve sample k; return the sample for which they were made."""
    if lag > 0.0 and (made_for < 0 or k - made_for >= reach or time[k] - time[made_for] > _NEAR_ENOUGH * lag):
        _decays(decay, time, k, reach, lag)
        return k
    return made_for


@inlined
def _fit(m: Floats, lag: float) -> tuple[float, float, float, float, float]:
    """Return value, slope, half the curvature of the wire at the origin, and the first two's unit variances.

    The wire is the parabola c0 + c1 t + c2 t² with lag · (its slope) added: value c0 + lag c1, slope c1 + 2 lag c2.
    Written out, as it is asked for a few million times: the matrix becomes L D Lᵀ, and the side (y) and the two sums
    of coefficients that are wanted (v, w) are eliminated along, which gives aᵀ N⁻¹ b without solving back.
    """
    least = 1e-12 * m[0, 0]
    i0 = 1.0 / (m[0, 0] + least)
    f1, f2 = m[0, 1] * i0, m[0, 2] * i0
    m12 = m[1, 2] - f1 * m[0, 2]
    i1 = 1.0 / (m[0, 2] - f1 * m[0, 1] + least)
    g2 = m12 * i1
    i2 = 1.0 / (m[2, 2] - f2 * m[0, 2] - g2 * m12 + least)
    y0, y1 = m[0, 4], m[1, 4] - f1 * m[0, 4]
    y2 = m[2, 4] - f2 * y0 - g2 * y1
    v1 = lag - f1
    v2 = -f2 - g2 * v1
    w2 = 2.0 * lag - g2
    value = y0 * i0 + v1 * y1 * i1 + v2 * y2 * i2
    slope = y1 * i1 + w2 * y2 * i2
    variance_value = i0 + v1 * v1 * i1 + v2 * v2 * i2
    variance_slope = i1 + w2 * w2 * i2
    bend = y2 * i2
    if lag > 0.0:
        f3 = m[0, 3] * i0
        m13 = m[1, 3] - f1 * m[0, 3]
        g3 = m13 * i1
        m23 = m[2, 3] - f2 * m[0, 3] - g2 * m13
        h3 = m23 * i2
        i3 = 1.0 / (m[3, 3] - f3 * m[0, 3] - g3 * m13 - h3 * m23 + least)
        y3 = m[3, 4] - f3 * y0 - g3 * y1 - h3 * y2
        v3 = -f3 - g3 * v1 - h3 * v2
        w3 = -g3 - h3 * w2
        value += v3 * y3 * i3
        slope += w3 * y3 * i3
        variance_value += v3 * v3 * i3
        variance_slope += w3 * w3 * i3
        bend -= h3 * y3 * i3
    return value, slope, bend, variance_value, variance_slope


@compiled
def _grow(m: Floats, time: Floats, temp_c: Floats, decay: Floats, k: int, first: int, last: int, lag: float) -> None:
    """Add the samples ``first`` to ``last`` − 1 steps before (row 0) and after (row 1) sample k to the sums."""
    for row in range(2):
        low, high = (max(k - last + 1, 0), k - first + 1) if row == 0 else (k + first, min(k + last, time.size))
        if low >= high:
            continue
        _add(m[row], time[low:high], temp_c[low:high], time[k], temp_c[k])
        if lag > 0.0:
            _add_rest(m[row], time[low:high], temp_c[low:high], decay[low:high], time[k], temp_c[k], 1.0 / decay[k])
    # Sample k itself is in both; around it, it counts once.
    for a in range(4):
        for b in range(a, 5):
            m[2, a, b] = m[0, a, b] + m[1, a, b]
    m[2, 0, 0] -= 1.0
    if lag > 0.0:
        m[2, 0, 3] -= 1.0
        m[2, 3, 3] -= 1.0


@compiled
def _judge(state: Floats, estimate: float, reach: float) -> bool:
    """Keep an estimate while its interval still meets all of this window's smaller ones; tell whether it is kept.

    ``state`` holds alive, lower and upper end of what the intervals have in common.
    """
    state[1], state[2] = max(state[1], estimate - reach), min(state[2], estimate + reach)
    if state[1] > state[2]:
        state[0] = 0.0
    return bool(state[0] > 0.0)


@compiled
def local_fits(
    time: Floats, temp_c: Floats, sigma: float, sizes: Ints, lag: float, threshold: float
) -> tuple[Floats, Floats, Floats, Floats]:
    """Return value, slope and sigma of the best local fit at every sample, and both sides' slopes.

    The last array holds, for the window before and the one after each sample: slope, its variance, and its length.
    """
    n = temp_c.size
    value, slope, bend, left_over = temp_c.copy(), np.zeros(n), np.zeros(n), np.full(n, sigma)
    window = np.column_stack((np.arange(n), np.arange(n)))
    sides = np.zeros((3, 3, n))
    sides[:, 1] = np.inf
    sums, state = np.zeros((3, 4, 5)), np.empty((3, 3))
    # Of the type that the loop gives them: a literal compiles what takes it a second time.
    decay, made_for, zero = np.ones(n), int(np.int64(-1)), int(np.int64(0))
    for k in range(n):
        sums[:] = 0.0
        made_for = _renewed(decay, time, k, made_for, sizes[-1], lag)
        state[:, 0], state[:, 1], state[:, 2] = 1.0, -np.inf, np.inf
        best, done = np.inf, zero
        for size in sizes:
            _grow(sums, time, temp_c, decay, k, done, size, lag)
            done = size
            for kind in range(3):
                # Before k (with it), after k (with it), and around it.
                if (kind != 1 and k - size + 1 < 0) or (kind != 0 and k + size - 1 >= n):
                    state[kind, 0] = 0.0
                if state[kind, 0] == 0.0:
                    continue
                y, rate, half, variance, variance_rate = _fit(sums[kind], lag)
                if not _judge(state[kind], y, threshold * sigma * np.sqrt(variance)):
                    continue
                sides[kind, 0, k], sides[kind, 1, k], sides[kind, 2, k] = rate, sigma**2 * variance_rate, size
                if variance < _AS_WELL * best:
                    best, value[k], slope[k], bend[k] = variance, temp_c[k] + y, rate, half
                    window[k, 0] = k if kind == 1 else k - size + 1
                    window[k, 1] = k if kind == 0 else k + size - 1
            if not state[:, 0].any():
                break
        if best < np.inf:
            left_over[k] = sigma * np.sqrt(best)
    together = _together(time, value, slope, bend, left_over, window, sizes[0])
    return together, slope, left_over, sides[:2]


@compiled
def _together(
    time: Floats, value: Floats, slope: Floats, bend: Floats, sigma: Floats, window: Ints, reach: int
) -> Floats:
    """Return values as the mean of what the neighbours' parabolas say, each as far as its window goes.

    Windows change from one sample to the next; the mean of the parabolas does not jump where one does. The shortest
    windows may reach over a corner: slopes stay as they are, or it would be rounded.
    """
    n = value.size
    found = np.empty(n)
    for k in range(n):
        total = at = 0.0
        for j in range(max(0, k - reach), min(n, k + reach + 1)):
            if window[j, 0] <= k <= window[j, 1]:
                away, weight = time[k] - time[j], 1.0 / sigma[j] ** 2
                total += weight
                at += weight * (value[j] + away * (slope[j] + away * bend[j]))
        found[k] = at / total
    return found
