"""Noise and resolution of a temperature log, measured from the log itself."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from scipy.special import rel_entr

from torsight.core.series import (
    BY_CHANCE,
    NORMAL_MEDIAN,
    constant_runs,
    difference_gain,
    differences,
    rms,
    rounding_variance,
    usual_step,
)
from torsight.core.units import Floats, Ints

_MAX_STRIDE_S: Final = 2.0
"""Correlation time beyond which noise differs from the wire's temperature by its size only; half and twice this value
change nothing (benchmarks/actuator/log_constants.py). In the demo, ten times as fast as a usual programme, twice this
value doubles the held-out error: bends of the temperature then count as noise."""
NEGLIGIBLE_C: Final = 0.005
"""Errors of a temperature below this value change the angle by a tenth of a degree at most."""
FINEST_C: Final = 1e-4
"""A tick: readings that differ by less count as equal; no thermometer has a finer last digit."""
PEAKLESS_C: Final = NEGLIGIBLE_C / BY_CHANCE
"""Noise of which not even the highest peaks matter."""
_AROUND: Final = PEAKLESS_C / FINEST_C
"""Ticks around a multiple within which the changes of a log without a last digit are evenly spread: noise that does not
matter spreads them that far."""
_FREQUENT: Final = 256
"""Number of most frequent changes among which the last digit is searched: enough for noise of up to fifty digits."""
_SURE: Final = math.log(1000.0 * _FREQUENT)
"""Least evidence, in log units, of a last digit: a thousand to one, times the number of steps that are tried."""
_FEW_ROWS: Final = 4
"""Most rows from one reading's repeated value to the next one's: lines of more rows show where readings lie
(:func:`torsight.actuator.record.slow_log.own_readings`)."""
_UNDONE: Final = 0.01
"""Share of the changes that the next one undoes: three in a thousand at most where rounding is all the noise, four in a
hundred and more with noise of a tenth of the last digit."""
_NOISE: Final = np.linspace(0.0, 1.0, 101)
_ORDERS: Final = np.arange(1, 201)[:, None]
_IN_MEAN: Final = np.sum(np.exp(-((2.0 * np.pi * _ORDERS * _NOISE) ** 2)) / (2.0 * (np.pi * _ORDERS) ** 2), axis=0)
_SCATTER: Final = _NOISE**2 + rounding_variance() - _IN_MEAN
"""``_IN_MEAN``: variance of the mean of readings due to rounding; ``_SCATTER``: variance of readings about their mean;
both over their noise up to a whole digit, in digits (:func:`hidden_by_rounding`). Higher orders add less than 0.3 % of
1/12."""
SHORTEST: Final = 16
"""Number of rows below which a log is not smoothed: a smoother starts with three values, each of some five rows."""


def measure_noise(time_s: Floats, temp_c: Floats) -> tuple[float, float]:
    """Return the noise's standard deviation in °C and its correlation length in samples.

    Third differences vanish for lines and parabolas (divided differences do so for slow readings at any times); their
    robust scale is insensitive to corners. Differences with a stride of s samples contain noise that is correlated over
    up to s samples. The correlation length is estimated from the quieter parts of the log: a temperature that bends
    over a few strides would otherwise count as noise with a long correlation.
    """
    if len(time_s) < 2:
        return 0.0, 1.0
    longest = max(1, int(_MAX_STRIDE_S / usual_step(time_s)))
    strides = np.unique([max(1, round(longest ** (i / 8))) for i in range(9)])
    strides = strides[len(temp_c) >= 3 * strides + 8]
    if not len(strides):
        return 0.0, 1.0
    found = _noise_at(time_s, temp_c, strides)
    digit = last_digit(temp_c)
    if found[0] > digit or not _is_stepped(temp_c, digit):
        return found
    # Most of the time the log is constant to its last digit, which hides its noise.
    moving = _without_rests(temp_c, 4 * longest)
    rounding = math.sqrt(rounding_variance(digit))
    if found[0] <= NEGLIGIBLE_C < rounding:
        noise, alike = _noise_at(time_s, moving, strides)
        found = max(noise, rounding), alike
    return max(found[0], _over_digits(moving, digit)), found[1]


def _over_digits(temp_c: Floats, digit_c: float) -> float:
    """Return the standard deviation of readings (n,) of which noise changes a last digit now and then, and rounding.

    A robust scale takes sparse changes for outliers. Readings within a digit of the temperature have third differences
    of eight digits at most: the root mean square of these is no more than noise and rounding explain. Zero where
    readings change as those of a steady course do, which hardly ever undo a change.
    """
    changes = np.diff(temp_c)
    changes = changes[np.abs(changes) > FINEST_C]
    if np.mean(changes[1:] * changes[:-1] < 0.0) <= _UNDONE:
        return 0.0
    third = np.abs(differences(temp_c[None], 1))
    return rms(third[third <= 8.0 * digit_c + FINEST_C]) / difference_gain()


def _noise_at(time_s: Floats, temp_c: Floats, strides: Ints) -> tuple[float, float]:
    """Return the noise's standard deviation and its correlation length, from differences with several strides (k,)."""
    if strides[-1] == 1:
        return float(np.nan_to_num(_scale(_divided(time_s, temp_c)[None])[0])), 1.0
    whole = _whole(temp_c, strides)
    # Parts with as many of the longest strides as a log must have rows.
    count = max(1, len(temp_c) // (SHORTEST * int(strides[-1])))
    parts = _parts(temp_c, count)
    of_parts = np.array([np.concatenate([_scatter(part, stride) for part in parts]) for stride in strides])
    known = np.isfinite(of_parts).all(axis=0)
    quiet = np.quantile(of_parts[:, known], 0.25, axis=1) if known.any() else np.zeros(len(strides))
    seen = quiet if quiet.min() > 0.0 else whole
    enough = strides[np.argmax(seen >= 0.8 * seen.max())]
    return float(whole[strides <= 2 * enough].max()), float(enough)


def hidden_by_rounding(readings_c: Floats, digit_c: float) -> float:
    """Return the standard deviation, °C, of the error of the mean of readings (n,) of a level due to rounding.

    With noise that spreads the readings over several digits, the mean has no rounding error; without noise all readings
    have the same error. Averaged over values between two digits, noise of σ leaves the part
    Σ_k q²/(2π²k²) exp(−4π²k²σ²/q²) of the rounding's variance q²/12 in the mean, and the rest in the scatter, from
    which σ follows (Widrow and Kollár, Quantization Noise (2008), ch. 5).
    """
    if digit_c <= 0.0:
        return 0.0
    scatter = float(np.var(readings_c)) / digit_c**2
    return digit_c * math.sqrt(float(np.interp(scatter, _SCATTER, _IN_MEAN, right=0.0)))


def last_digit(temp_c: Floats) -> float:
    """Return the last digit of a log (n,), °C: the step of which many of its changes are multiples; 0: there is none.

    Not all changes need be multiples: some readings may be interpolated, or several instruments combined. By chance a
    share c = 3/q of n changes lies within one tick of a multiple of a step of q ticks. If s is the share that does, the
    evidence of the step is n (s log(s/c) + (1 − s) log((1 − s)/(1 − c))); the last digit is the step with the most. The
    changes of a ramp are alike without a last digit, too, to their noise: it must also be evident among the changes
    near a multiple alone. In a table of rows between the readings, as a film's, no change need be a
    multiple, but values that repeat are readings.
    """
    changes = _between_repeated(temp_c)
    return (_step_of(changes) if len(changes) >= SHORTEST else 0.0) or _step_of(np.abs(np.diff(temp_c)))


def _between_repeated(temp_c: Floats) -> Floats:
    """Return the changes (k,) from one repeated value to another that follows after a few rows."""
    same = np.flatnonzero(np.abs(np.diff(temp_c)) <= FINEST_C)
    changes = np.abs(np.diff(temp_c[same]))
    return changes[(np.diff(same) <= _FEW_ROWS) & (changes > FINEST_C)]


def _step_of(changes_c: Floats) -> float:
    """Return the step, °C, of which many changes (n,) are multiples, 0 where there is none."""
    ticks = np.rint(changes_c / FINEST_C)
    sizes, times = np.unique(ticks[ticks > 0.0], return_counts=True)
    steps = np.sort(sizes[np.argsort(-times, kind="stable")[:_FREQUENT]])
    steps = steps[steps > _ticks_within(1.0)]
    if not len(steps):
        return 0.0
    off = np.abs(sizes - steps[:, None] * np.rint(sizes / steps[:, None]))
    chance, count = _ticks_within(1.0) / steps, times.astype(np.float64)
    best = int(np.argmax(_evidence((off <= 1.0) @ count, count.sum(), chance)))
    on, near = (float((off[best] <= reach) @ count) for reach in (1.0, _AROUND))
    sure = _evidence(on, near, max(chance[best], _ticks_within(1.0) / _ticks_within(_AROUND))) > _SURE
    return float(steps[best]) * FINEST_C if sure else 0.0


def _ticks_within(reach: float) -> float:
    """Return the number of ticks that are no further than ``reach`` ticks from a multiple."""
    return 2.0 * math.floor(reach) + 1.0


def _evidence(count: Floats | float, whole: float, chance: Floats | float) -> Floats:
    """Return the evidence, log units, that a count out of a whole is more than the share that it is by chance."""
    share = np.maximum(count / whole, chance)
    return np.asarray(whole * (rel_entr(share, chance) + rel_entr(1.0 - share, 1.0 - chance)))


def _is_stepped(temp_c: Floats, digit_c: float) -> bool:
    """Return whether every reading of a log (n,) is rounded: nine in ten changes are no less than the digit.

    Of a table of rows between the readings these are the changes from one repeated value to another.
    """
    changes = _between_repeated(temp_c)
    if len(changes) < SHORTEST:
        changes = np.abs(np.diff(temp_c))
        changes = changes[changes > FINEST_C]
    return digit_c > 0.0 and len(changes) > 0 and bool(np.quantile(changes, 0.1) > 0.5 * digit_c)


def _whole(temp_c: Floats, strides: Ints) -> Floats:
    """Return the standard deviation of a reading by stride (k,), from the whole log; 0 where it is not measurable."""
    return np.array([np.nan_to_num(_scatter(temp_c[None], int(stride))[0]) for stride in strides])


def _without_rests(temp_c: Floats, longest: int) -> Floats:
    """Return readings (n,) with NaN where more than ``longest`` in a row are equal: rounding hides their noise.

    Third differences take in four readings: of more equal ones they vanish, on a slow ramp of a coarse log they do not.
    """
    changes = np.cumsum(np.abs(np.diff(temp_c, prepend=temp_c[0])) > FINEST_C)
    out = temp_c.copy()
    for begin, end in constant_runs(changes):
        if end - begin > longest:
            out[begin:end] = np.nan
    return out


def _divided(time_s: Floats, temp_c: Floats) -> Floats:
    """Return the third divided differences (n − 3,) of readings, scaled as the differences of evenly spaced ones."""
    at = np.stack([time_s[i : len(time_s) - 3 + i] for i in range(4)])
    weight = np.stack([1.0 / np.prod([at[i] - at[j] for j in range(4) if j != i], axis=0) for i in range(4)])
    weight *= difference_gain() / np.sqrt(np.sum(weight**2, axis=0))
    return np.asarray(sum(weight[i] * temp_c[i : len(temp_c) - 3 + i] for i in range(4)))


def _scatter(rows: Floats, stride: int) -> Floats:
    """Return the standard deviation of a reading in each of many pieces (m, n) of a log (m,); NaN: not measurable."""
    return _scale(differences(rows, stride))


def _scale(rows: Floats) -> Floats:
    """Return the standard deviation of a reading from each of many rows (m, n) of differences; NaN: not measurable.

    The median of rounded readings' differences is a multiple of the last digit. The M-estimate of scale with Tukey's
    biweight is a smooth function of the differences, so that it averages over their steps, and is as robust against
    outliers: constant from 1.547645 scales on, its breakdown point is one half, as that of a median (Rousseeuw and
    Yohai, in Robust and Nonlinear Time Series Analysis (1984) 256).
    """
    size = np.abs(rows)
    known = np.isfinite(size)
    scale, count = np.full(len(rows), np.nan), np.count_nonzero(known, axis=1)
    left = np.flatnonzero(count)
    # Where all differences are finite the plain median is the same, in a seventh of the time for short rows.
    scale[left] = (np.median if known.all() else np.nanmedian)(size[left], axis=1) / NORMAL_MEDIAN
    seen = 2 * np.count_nonzero(size > 0.0, axis=1) > count
    scale[left[~seen[left]]] = 0.0
    left = left[seen[left]]
    for _ in range(50):
        inside = 1.0 - np.minimum(size[left] / (1.547645 * scale[left, None]), 1.0) ** 2
        over = 0.5 - np.sum(inside**3, axis=1, where=known[left]) / count[left]
        slope = np.sum(6.0 * (1.0 - inside) * inside**2, axis=1, where=known[left]) / count[left]
        step = np.clip(over / slope, -0.5, 0.5)
        scale[left] *= np.exp(step)
        # A scale is known to about the root of the number of differences: a tenth of that is reached.
        left = left[np.abs(step) > 0.1 / np.sqrt(count[left])]
        if not len(left):
            break
    return np.asarray(scale / difference_gain())


def _parts(values: Floats, count: int) -> list[Floats]:
    """Split values (n,) into ``count`` parts; return those of either length (they differ by one) as arrays (k, m)."""
    length, longer = divmod(len(values), count)
    first = longer * (length + 1)
    return [values[:first].reshape(longer, length + 1), values[first:].reshape(count - longer, length)]
