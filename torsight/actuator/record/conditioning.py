"""A noisy temperature made fit to drive a one-way transformation, with its corners kept.

A transformation only advances, so the upward peaks of noise push it on and bias the angle. A low-pass filter would cure
that and round the corners of the temperature, where an incomplete transformation ends. Here the noise is measured
first, by differences of third order at several strides (so that noise that was interpolated onto a faster clock is
found as well); a log without noise passes unchanged, to the last bit. Otherwise every sample gets the value of a local
parabola over a window before it, after it or around it. Each kind of window grows until the intervals of its estimates
no longer meet (Goldenshluger and Nemirovski 1997; Katkovnik 1999): it stops at a corner by itself; the kind that ends
with the smallest variance is used. A sample's value is the mean of what the parabolas of the samples beside it say,
each within its own window: so it does not jump where the window changes, which would move the angle at once. Around a
corner :mod:`torsight.actuator.record.corners` then fits both sides at once, and :mod:`torsight.actuator.record.holds`
takes the mean of a top that is level.

The wire behind a slow sensor, τ dT_m/dt = T − T_m, comes out of the same fits: where the wire is locally a parabola,
the sensor reads the parabola less its own lag and a rest that decays with τ, and that is what is fitted. The noise is
not differentiated anywhere, and the wire's corners come out sharp.

Of a log that is slower than its table (:mod:`torsight.actuator.record.slow_log`) the readings themselves are taken.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from torsight.actuator.record.corners import Log, mend_corners
from torsight.actuator.record.holds import level_holds
from torsight.actuator.record.log_noise import SHORTEST, measure_noise, resolution
from torsight.actuator.record.slow_log import between, corner_gaps, own_readings
from torsight.core.compiled import compiled, inlined
from torsight.core.series import usual_step

Array = NDArray[np.float64]

NEGLIGIBLE_C: Final = 0.005
"""Noise below this moves the angle by a tenth of a degree at most: such a log passes unchanged."""
# By how many of its sigmas a longer window may be off what shorter ones say: what it is off by stays in the value.
# Behind a slow sensor short windows know too little of the rest that decays. Measured by
# benchmarks/actuator/log_constants.py: with half of it slopes err 1.6 times (3 times behind the sensor) as much, with
# twice of it temperatures 1.7 times (behind the sensor 1.2 times their sigma). Blocks of twice the length: 1.1 times.
_THRESHOLD: Final = 1.6
_THRESHOLD_LAGGED: Final = 2.2
# What comes out from behind a slow sensor knows its corners less well: longer blocks lose nothing there.
_BLOCK_S: Final = 0.1
_BLOCK_LAGGED_S: Final = 0.2
_SMOOTHED_S: Final = 3.5
"""The smallest window of readings that are further apart is longer than a wire bends evenly: at 5 s temperatures err by
0.08 °C smoothed and by 0.05 °C as they are (benchmarks/actuator/slow_logs.py)."""
_MAX_WINDOW_S: Final = 60.0
"""Longest window; half and twice of it change errors by 7 % (as above)."""
# Choosing the window by the data costs: errors are this much larger than those of a window chosen beforehand (as
# above: with it they are 0.98 of their sigmas).
_SELECTION: Final = 1.8
_AS_WELL: Final = 1.0 - 1e-9
# Beyond 25 time constants what is left of an earlier corner is nothing.
_MOST: Final = math.exp(25.0)
# Exponents beyond which a ratio is nothing or too much in any case, and up to which ratios are exact.
_FARTHEST: Final = 500.0
_NEAR_ENOUGH: Final = 100.0


@dataclass(frozen=True, slots=True, eq=False)
class Conditioned:
    """A temperature that may drive the model.

    Attributes
    ----------
    temp_c : (n,) float64
        Temperature without noise; the very input where its noise is negligible.
    rate_c_s : (n,) float64
        Its slope, °C/s.
    sigma_c : (n,) float64
        One standard deviation of what noise is left.
    noise_c : float
        Noise of a reading (standard deviation).
    reading_s : float
        Seconds between readings whose noise is independent.
    """

    temp_c: Array
    rate_c_s: Array
    sigma_c: Array
    noise_c: float
    reading_s: float


def condition(time_s: Array, temp_c: Array, *, lag_s: float = 0.0) -> Conditioned:
    """Remove the noise of a temperature log and keep its corners.

    Parameters
    ----------
    time_s, temp_c : (n,) float64
        Finite; times increasing, not necessarily at one rate.
    lag_s : float
        Time constant of the sensor: the wire's temperature is returned.
    """
    own = own_readings(time_s, temp_c) if lag_s == 0.0 else None
    if own is not None:
        return _apart(Readings.of(*own, lagged=False), time_s, temp_c)
    readings = Readings.of(time_s, temp_c, lagged=lag_s > 0.0)
    noise, interval_s = readings.noise_c, readings.interval_s
    value, rate, sigma = readings.smooth(time_s, lag_s)
    if noise <= NEGLIGIBLE_C and lag_s == 0.0:
        return Conditioned(temp_c, rate, np.full(len(temp_c), noise), noise, interval_s)
    if lag_s == 0.0:
        # Noise that is alike over several rows counts as more of it.
        level_holds(time_s, temp_c, noise * math.sqrt(readings.alike), value=value, rate=rate, left_over=sigma)
    return Conditioned(value, rate, sigma, noise, interval_s)


def _apart(readings: Readings, wanted_s: Array, lines_c: Array) -> Conditioned:
    """Return readings that lie apart at other times: without noise from corner to corner, lines between them.

    A local fit over seconds would take a corner of the wire for a bend. ``lines_c`` are the lines between the readings.
    """
    time_s, temp_c = readings.time_s, readings.temp_c
    corners = corner_gaps(time_s, temp_c, readings.noise_c)
    smoothed, left_over = temp_c.copy(), np.full(len(temp_c), readings.sigma_c)
    for rows in np.split(np.arange(len(temp_c)), np.flatnonzero(corners) + 1):
        if len(rows) >= SHORTEST and readings.interval_s <= _SMOOTHED_S and readings.noise_c > NEGLIGIBLE_C:
            piece = replace(readings, time_s=time_s[rows], temp_c=temp_c[rows])
            smoothed[rows], _, left_over[rows] = piece.smooth(time_s[rows], 0.0)
    value, sigma = between(time_s, smoothed, corners, wanted_s), np.interp(wanted_s, time_s, left_over)
    rate = np.asarray(np.gradient(value, wanted_s))
    if readings.noise_c > NEGLIGIBLE_C:
        alike = readings.interval_s / usual_step(wanted_s)
        level_holds(wanted_s, lines_c, readings.noise_c * math.sqrt(alike), value=value, rate=rate, left_over=sigma)
    return Conditioned(value, rate, sigma, readings.noise_c, readings.interval_s)


@dataclass(frozen=True, slots=True, eq=False)
class Readings:
    """A log's readings with what is known of their noise, for any time constant of the sensor.

    Attributes
    ----------
    time_s, temp_c : (m,) float64
        Means over short blocks of the log.
    noise_c : float
        Noise of one reading of the log.
    alike : float
        Over how many rows of the log it is correlated.
    interval_s : float
        Seconds between rows whose noise is independent.
    sigma_c : float
        What a block's noise counts as, correlation included.
    correlation : float
        Over how many blocks their noise is correlated.
    """

    time_s: Array
    temp_c: Array
    noise_c: float
    alike: float
    interval_s: float
    sigma_c: float
    correlation: float

    @classmethod
    def of(cls, time_s: Array, temp_c: Array, *, lagged: bool) -> Readings:
        """Return the readings of a log (n,), in blocks for a sensor that is late or for one that is not."""
        interval_s = usual_step(time_s)
        if len(temp_c) < SHORTEST:
            return cls(time_s, temp_c, 0.0, 1.0, interval_s, 0.0, 1.0)
        noise, alike = measure_noise(time_s, temp_c)
        # Rounding to a last digit is noise to a slope even where it is none to the value.
        least = max(noise, resolution(temp_c) / math.sqrt(12.0), 1e-6)
        # Frozen and strided arrays are types of their own: of one type, one compilation serves every record.
        times, means = (
            np.array(values, np.float64) for values in _blocks(time_s, temp_c, _BLOCK_LAGGED_S if lagged else _BLOCK_S)
        )
        of_block, correlation = measure_noise(times, means)
        sigma = max(of_block, 0.2 * least) * math.sqrt(correlation)
        return cls(times, means, noise, alike, alike * interval_s, sigma, correlation)

    def smooth(self, wanted_s: Array, lag_s: float) -> tuple[Array, Array, Array]:
        """Return value, slope and sigma of the wire's temperature at the wanted times."""
        n = len(self.time_s)
        if n < SHORTEST:
            slope = np.asarray(np.gradient(self.temp_c, self.time_s)) if n > 1 else np.zeros(n)
            return self._at(wanted_s, self.temp_c + lag_s * slope, slope, np.zeros(n))
        interval = usual_step(self.time_s)
        longest = int(max(_MAX_WINDOW_S / interval, SHORTEST))
        smallest = max(4 if lag_s == 0.0 else 6, int(3 * self.correlation))
        sizes = [smallest]
        while sizes[-1] < longest:
            sizes.append(max(sizes[-1] + 1, int(1.4 * sizes[-1])))
        threshold = _THRESHOLD_LAGGED if lag_s > 0.0 else _THRESHOLD
        value, rate, left_over, sides = _local_fits(
            self.time_s / interval, self.temp_c, self.sigma_c, np.array(sizes), lag_s / interval, threshold
        )
        rate /= interval
        sides[:, 0] /= interval
        sides[:, 1] /= interval**2
        left_over *= _SELECTION
        mend_corners(Log(self.time_s, self.temp_c, lag_s, self.sigma_c, smallest), sides, (value, rate, left_over))
        return self._at(wanted_s, value, rate, left_over)

    def _at(self, wanted_s: Array, value: Array, rate: Array, sigma: Array) -> tuple[Array, Array, Array]:
        """Return what is known at the readings by lines at other times."""
        value, rate, sigma = (np.interp(wanted_s, self.time_s, each) for each in (value, rate, sigma))
        return value, rate, sigma


def _blocks(time_s: Array, temp_c: Array, block_s: float) -> tuple[Array, Array]:
    """Return means over about so many seconds of a log that is faster than that."""
    every = int(block_s / usual_step(time_s))
    if every < 2:
        return time_s, temp_c
    starts = np.arange(0, len(time_s), every)
    count = np.diff(np.append(starts, len(time_s)))
    return np.add.reduceat(time_s, starts) / count, np.add.reduceat(temp_c, starts) / count


@compiled
def _add(m: Array, t: Array, y: Array, t_here: float, y_here: float) -> None:
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
def _add_rest(m: Array, t: Array, y: Array, decay: Array, t_here: float, y_here: float, scale: float) -> None:
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
def _decays(decay: Array, time: Array, k: int, reach: int, lag: float) -> None:
    """Set what decays from 1 at sample k, for the samples up to ``reach`` before it and 2 ``reach`` after it.

    One exponential per sample serves the windows of ``reach`` samples: they need its ratios only.
    """
    for i in range(max(0, k - reach), min(time.size, k + 2 * reach)):
        decay[i] = np.exp(min(max((time[k] - time[i]) / lag, -_FARTHEST), _FARTHEST))


@compiled
def _renewed(decay: Array, time: Array, k: int, made_for: int, reach: int, lag: float) -> int:
    """Make the decays anew where those at hand do not serve sample k; return the sample for which they were made."""
    if lag > 0.0 and (made_for < 0 or k - made_for >= reach or time[k] - time[made_for] > _NEAR_ENOUGH * lag):
        _decays(decay, time, k, reach, lag)
        return k
    return made_for


@inlined
def _fit(m: Array, lag: float) -> tuple[float, float, float, float, float]:
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
def _grow(m: Array, time: Array, temp_c: Array, decay: Array, k: int, first: int, last: int, lag: float) -> None:
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
def _judge(state: Array, estimate: float, reach: float) -> bool:
    """Keep an estimate while its interval still meets all of this window's smaller ones; tell whether it is kept.

    ``state`` holds alive, lower and upper end of what the intervals have in common.
    """
    state[1], state[2] = max(state[1], estimate - reach), min(state[2], estimate + reach)
    if state[1] > state[2]:
        state[0] = 0.0
    return bool(state[0] > 0.0)


@compiled
def _local_fits(
    time: Array, temp_c: Array, sigma: float, sizes: NDArray[np.int64], lag: float, threshold: float
) -> tuple[Array, Array, Array, Array]:
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
                # Windows of one length on either side know as much; sums in another order must not choose.
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
    time: Array, value: Array, slope: Array, bend: Array, sigma: Array, window: NDArray[np.int64], reach: int
) -> Array:
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
