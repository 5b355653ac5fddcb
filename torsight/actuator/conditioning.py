"""A noisy temperature made fit to drive a one-way transformation, with its corners kept.

A transformation only advances, so the upward peaks of noise push it on and bias the angle. A low-pass filter would cure
that and round the corners of the temperature, where an incomplete transformation ends. Here the noise is measured
first, by differences of third order at several strides (so that noise that was interpolated onto a faster clock is
found as well); a log without noise passes unchanged, to the last bit. Otherwise every sample gets the value and slope
of a local quadratic over a window on its left, on its right or around it. Each kind of window grows until the
intervals of its estimates no longer meet (Goldenshluger and Nemirovski 1997; Katkovnik 1999): it stops at a corner by
itself; the kind that ends with the smallest variance is used. Around a corner :mod:`torsight.actuator.corners` then
fits both sides at once.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from torsight.actuator.compiled import compiled
from torsight.actuator.corners import mend_corners

Array = NDArray[np.float64]

NEGLIGIBLE_C: Final = 0.005
"""Noise below this moves the angle by a tenth of a degree at most: such a log passes unchanged."""
_THRESHOLD: Final = 2.2
_SHORTEST: Final = 16
_MAX_STRIDE_S: Final = 2.0
_BLOCK_S: Final = 0.1
_MAX_WINDOW_S: Final = 60.0
_MAX_WINDOW: Final = 1500
# Choosing the window by the data costs: errors are this much larger than those of a window chosen beforehand.
_SELECTION: Final = 1.8


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
        Noise of the input (standard deviation).
    """

    temp_c: Array
    rate_c_s: Array
    sigma_c: Array
    noise_c: float


def condition(time_s: Array, temp_c: Array) -> Conditioned:
    """Remove the noise of a temperature log and keep its corners.

    Parameters
    ----------
    time_s, temp_c : (n,) float64
        Finite; times increasing, not necessarily at one rate.
    """
    n = len(temp_c)
    if n < _SHORTEST:
        slope = np.gradient(temp_c, time_s) if n > 1 else np.zeros(n)
        return Conditioned(temp_c, np.asarray(slope, np.float64), np.zeros(n), 0.0)
    noise, correlation = measure_noise(time_s, temp_c)
    if noise <= NEGLIGIBLE_C:
        # Rounding to a last digit is noise to a slope even where it is none to the value.
        spread = max(noise, resolution(temp_c) / math.sqrt(12.0), 1e-6)
        _, rate, _ = _smooth(*_blocks(time_s, temp_c), spread, time_s)
        return Conditioned(temp_c, rate, np.full(n, noise), noise)
    value, rate, sigma = _smooth(*_blocks(time_s, temp_c), noise, time_s)
    return Conditioned(value, rate, sigma, noise)


def _blocks(time_s: Array, temp_c: Array) -> tuple[Array, Array]:
    """Return means over about a tenth of a second of a log that is faster than that."""
    every = int(_BLOCK_S / float(np.median(np.diff(time_s))))
    if every < 2:
        return time_s, temp_c
    starts = np.arange(0, len(time_s), every)
    count = np.diff(np.append(starts, len(time_s)))
    return np.add.reduceat(time_s, starts) / count, np.add.reduceat(temp_c, starts) / count


def resolution(temp_c: Array) -> float:
    """Return the step to which the log's numbers are rounded, °C (the smallest change that is not zero)."""
    steps = np.abs(np.diff(temp_c))
    steps = steps[steps > 1e-9]
    return float(np.quantile(steps, 0.01)) if len(steps) else 0.0


def measure_noise(time_s: Array, temp_c: Array) -> tuple[float, float]:
    """Return the noise's standard deviation in °C and over how many samples it is correlated.

    Third differences do not see lines and parabolas; their median does not see corners. A stride of s samples sees
    noise whose neighbours within s samples are alike.
    """
    interval = float(np.median(np.diff(time_s))) if len(time_s) > 1 else 1.0
    longest = max(1, int(_MAX_STRIDE_S / interval))
    strides = sorted({max(1, round(longest ** (i / 8))) for i in range(9)})
    noises = []
    for stride in strides:
        if len(temp_c) < 3 * stride + 8:
            break
        third = (
            temp_c[3 * stride :]
            - 3.0 * temp_c[2 * stride : -stride]
            + 3.0 * temp_c[stride : -2 * stride]
            - temp_c[: -3 * stride]
        )
        noises.append(float(np.median(np.abs(third))) / 0.6745 / math.sqrt(20.0))
    if not noises:
        return 0.0, 1.0
    largest = max(noises)
    enough = next(s for s, noise in zip(strides, noises, strict=False) if noise >= 0.8 * largest)
    return largest, float(enough)


def _smooth(time_s: Array, temp_c: Array, least: float, wanted_s: Array) -> tuple[Array, Array, Array]:
    """Return value, slope and sigma at the wanted times."""
    noise, correlation = measure_noise(time_s, temp_c)
    sigma = max(noise, 0.2 * least) * math.sqrt(correlation)
    interval = float(np.median(np.diff(time_s)))
    longest = int(min(max(_MAX_WINDOW_S / interval, 16), _MAX_WINDOW))
    smallest = max(4, int(3 * correlation))
    sizes = [smallest]
    while sizes[-1] < longest:
        sizes.append(max(sizes[-1] + 1, int(1.4 * sizes[-1])))
    time = time_s / interval
    value, rate, left_over, sides = _local_fits(time, temp_c, sigma, np.array(sizes))
    left_over *= _SELECTION
    mend_corners(
        time, temp_c, sides, sigma_c=sigma, smallest=smallest, value=value, rate=rate, left_over=left_over
    )
    rate /= interval
    if len(time_s) == len(wanted_s):
        return value, rate, left_over
    return tuple(np.interp(wanted_s, time_s, item) for item in (value, rate, left_over))  # type: ignore[return-value]


@compiled
def _fit(m: Array) -> tuple[float, float, float, float]:
    """Return value, slope and their unit variances at the origin of the quadratic with these moments.

    ``m`` holds Σ1, Σt, Σt², Σt³, Σt⁴, Σy, Σty, Σt²y.
    """
    a, b, c, d, e = m[0], m[1], m[2], m[3], m[4]
    # Cofactors of [[a b c] [b c d] [c d e]].
    c00, c01, c02 = c * e - d * d, c * d - b * e, b * d - c * c
    c11, c12 = a * e - c * c, b * c - a * d
    det = a * c00 + b * c01 + c * c02
    value = (c00 * m[5] + c01 * m[6] + c02 * m[7]) / det
    slope = (c01 * m[5] + c11 * m[6] + c12 * m[7]) / det
    return value, slope, c00 / det, c11 / det


@compiled
def _add(m: Array, t: float, y: float) -> None:
    t2 = t * t
    m[0] += 1.0
    m[1] += t
    m[2] += t2
    m[3] += t2 * t
    m[4] += t2 * t2
    m[5] += y
    m[6] += t * y
    m[7] += t2 * y


@compiled
def _local_fits(
    time: Array, temp_c: Array, sigma: float, sizes: NDArray[np.int64]
) -> tuple[Array, Array, Array, Array]:
    """Return value, slope and sigma of the best local quadratic at every sample, and both sides' slopes.

    Value and slope choose their windows apart: a slope needs longer ones and feels a bend sooner. The last array
    holds, for the window before and the one after each sample: slope, its variance, and the window's length.
    """
    n = temp_c.size
    out = np.zeros((2, n))
    left_over = np.full(n, sigma)
    sides = np.zeros((2, 3, n))
    sides[:, 1] = np.inf
    moments, both = np.zeros((2, 8)), np.zeros(8)
    low, high = np.empty((3, 2)), np.empty((3, 2))
    alive, best = np.empty((3, 2), np.bool_), np.empty(2)
    for k in range(n):
        moments[:] = 0.0
        low[:], high[:], alive[:], best[:] = -np.inf, np.inf, True, np.inf
        done = 0
        for size in sizes:
            for i in range(done, size):
                if k - i >= 0:
                    _add(moments[0], time[k - i] - time[k], temp_c[k - i] - temp_c[k])
                if k + i < n and i > 0:
                    _add(moments[1], time[k + i] - time[k], temp_c[k + i] - temp_c[k])
            done = size
            for kind in range(3):
                # Before k (with it), after k (with it), and around it.
                if (kind != 1 and k - size + 1 < 0) or (kind != 0 and k + size - 1 >= n):
                    alive[kind, :] = False
                if not (alive[kind, 0] or alive[kind, 1]):
                    continue
                if kind == 0:
                    both[:] = moments[0]
                elif kind == 1:
                    both[:] = moments[1]
                    both[0] += 1.0
                else:
                    both[:] = moments[0] + moments[1]
                y, rate, variance_y, variance_rate = _fit(both)
                for what in range(2):
                    if not alive[kind, what]:
                        continue
                    estimate = y if what == 0 else rate
                    variance = variance_y if what == 0 else variance_rate
                    reach = _THRESHOLD * sigma * np.sqrt(variance)
                    low[kind, what] = max(low[kind, what], estimate - reach)
                    high[kind, what] = min(high[kind, what], estimate + reach)
                    if low[kind, what] > high[kind, what]:
                        alive[kind, what] = False
                    else:
                        if what == 0 and kind < 2:
                            sides[kind, 0, k] = rate
                            sides[kind, 1, k] = sigma * sigma * variance_rate
                            sides[kind, 2, k] = size
                        if variance < best[what]:
                            best[what] = variance
                            out[what, k] = estimate
            if not alive.any():
                break
        if best[0] < np.inf:
            left_over[k] = sigma * np.sqrt(best[0])
    return temp_c + out[0], out[1], left_over, sides
