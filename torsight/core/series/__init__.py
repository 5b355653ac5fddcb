"""Statistics of series of samples of any kind.

Input: arrays (n,) of samples or flags. Output: runs as pairs of indices (begin, end exclusive), the noise of one sample
in the samples' unit, the correlation time in samples, indices of extremes, the usual step of times.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from statistics import NormalDist
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from torsight.core.units import Flags, Floats, Ints

BY_CHANCE: Final = NormalDist().inv_cdf(1.0 - 1e-9)
"""Standard deviations that normal noise exceeds once in 10⁹ samples, a year of film: more has another cause."""
APART: Final = math.sqrt(2.0) * BY_CHANCE
"""The same limit for the difference of two samples, in standard deviations of one sample."""
NORMAL_MEDIAN: Final = NormalDist().inv_cdf(0.75)
"""Median of the absolute value of a standard normal variable."""
FEWEST: Final = 8
"""Fewest samples from which the size of noise, or at least a bound of it, is estimated: to a quarter, 1 / √(2 · 8)."""
ORDER: Final = 3
"""Order of the differences that separate noise from a trend: third differences of lines and parabolas are zero."""


def rounding_variance(step: float = 1.0) -> float:
    """Return the variance of the error by rounding to multiples of a step, or of light over a pixel: step² / 12."""
    return step**2 / 12.0


def runs(flag: Flags) -> list[tuple[int, int]]:
    """Return begin and end (exclusive) of every run of true flags."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flag, [False]]).astype(np.int8)))
    return [(begin, end) for begin, end in edges.reshape(-1, 2).tolist()]


def constant_runs(value: NDArray[Any]) -> list[tuple[int, int]]:
    """Return begin and end (exclusive) of every run of equal values; together the runs cover the series."""
    return list(pairwise([0, *changes(value).tolist(), len(value)])) if len(value) else []


def changes(value: NDArray[Any]) -> Ints:
    """Return the indices at which a series differs from its sample before."""
    return np.flatnonzero(value[1:] != value[:-1]) + 1


def usual_step(times: Floats) -> float:
    """Return the median of the positive steps between neighbours (n,); 0 where there is none."""
    step = np.diff(times)
    step = step[step > 0.0]
    return float(np.median(step)) if len(step) else 0.0


def known_median(values: NDArray[Any]) -> float:
    """Return the median of the finite values; NaN where there are none."""
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) else math.nan


def bridged(values: Floats) -> Floats:
    """Return a series (n,) with its gaps (NaN) bridged by lines over the rows, the ends held; all unknown as it is."""
    known = np.flatnonzero(np.isfinite(values))
    return np.interp(np.arange(len(values)), known, values[known]) if len(known) else values


def means_beside(values: Floats, half: int) -> tuple[Floats, Floats, Ints]:
    """Return the means (n,) of a finite series over ``half`` rows before each row and after it, both with the row.

    Near the ends there are fewer rows; the third result is the number of rows (n,) from first to last.
    """
    total = np.concatenate([[0.0], np.cumsum(values)])
    index = np.arange(len(values))
    low, high = np.maximum(index - half, 0), np.minimum(index + half, len(values) - 1)
    before = (total[index + 1] - total[low]) / (index + 1 - low)
    after = (total[high + 1] - total[index]) / (high + 1 - index)
    return before, after, high - low


def extent(values: Floats) -> tuple[float, float]:
    """Return the range of the central 99 % of the known values, which one wrong value in 200 does not widen.

    Half and twice the excluded share move the ends by as much as the slowest motion covers in so many samples.
    """
    low, high = np.nanquantile(values, [0.005, 0.995])
    return float(low), float(high)


def block_means(values: Floats, every: int) -> Floats:
    """Return the means (n // every, …) of successive blocks of ``every`` samples; the rest is dropped."""
    if every < 2:
        return values
    whole = len(values) // every * every
    return np.asarray(values[:whole].reshape(-1, every, *values.shape[1:]).mean(axis=1))


def pair_means(time_s: Floats, values: Floats, sigma: Floats, rows: Ints, half: Ints) -> tuple[Floats, Floats]:
    """Return the means (m,) over ``half`` (m,) neighbours on either side of the given rows, and their sigmas (m,).

    Neighbours count in pairs, because neighbours on one side alone would give the mean at another instant, beside a gap
    at one seconds away. The middle of a pair lies within half a step of the row, or within a tenth of the pair's
    distance. NaN in values (n,) counts as missing, in their standard deviations as zero; the result is NaN where
    neither the row nor a pair is known.
    """
    step = np.arange(-int(half.max(initial=0)), int(half.max(initial=0)) + 1)
    at = rows[:, None] + step
    within = np.clip(at, 0, len(time_s) - 1)
    away_s = time_s[within] - time_s[rows][:, None]
    good = np.isfinite(values[within]) & (at == within) & (np.abs(step) <= half[:, None])
    good &= good[:, ::-1] & (np.abs(away_s + away_s[:, ::-1]) <= 0.5 * usual_step(time_s) + 0.1 * np.abs(away_s))
    count = good.sum(axis=1)
    known, number = count > 0, np.maximum(count, 1)
    mean = np.where(good, values[within], 0.0).sum(axis=1) / number
    variance = np.where(good, np.nan_to_num(sigma[within]) ** 2, 0.0).sum(axis=1) / number**2
    return np.where(known, mean, np.nan), np.where(known, np.sqrt(variance), np.nan)


def extremes(value: Floats, threshold: float, *, stride: int = 1) -> list[int]:
    """Return the indices of extremes of a finite series (n,) that differ from the next by at least the threshold (> 0).

    Minima and maxima alternate. The first index is 0; the last is the extreme after the last turn. Only every
    ``stride``-th sample is used.
    """
    looked_at = value[::stride]
    # Extremes are turns of the series, and a smooth series has few of them.
    places = np.flatnonzero(np.diff(looked_at, prepend=np.nan))
    rises = np.diff(looked_at[places]) > 0.0
    corner = np.ones(len(places), bool)
    corner[1:-1] = rises[1:] != rises[:-1]
    places = places[corner]
    turns = [0]
    low = high = 0
    lowest = highest = float(value[0])
    direction = 0
    for index, sample in zip((places * stride).tolist(), looked_at[places].tolist(), strict=True):
        if sample > highest:
            high, highest = index, sample
        if sample < lowest:
            low, lowest = index, sample
        if direction <= 0 and sample - lowest >= threshold:
            turns.append(low)
            direction, high, highest = 1, index, sample
        elif direction >= 0 and highest - sample >= threshold:
            turns.append(high)
            direction, low, lowest = -1, index, sample
    turns.append(high if direction > 0 else low)
    return turns


def rms(values: ArrayLike) -> float:
    """Return the root mean square of values (n,)."""
    return float(np.sqrt(np.mean(np.square(values))))


def robust_sigma(deviation: Floats) -> float:
    """Return the standard deviation of normal deviations (n,) from their median absolute value, robust to outliers."""
    return float(np.median(np.abs(deviation))) / NORMAL_MEDIAN


def scatter(*pieces: Floats, stride: int = 1, order: int = ORDER) -> float:
    """Return the standard deviation of one reading of evenly sampled pieces, one of them longer than three strides.

    Differences of the given order, of samples that are ``stride`` apart, remove a slow trend almost completely, and
    their median is robust to single outliers. The variance of the differences of white noise is that of one sample
    times the sum of the squared binomial coefficients, C(2 order, order): 6 for the second difference, 20 for the
    third.
    """
    found = np.concatenate([differences(piece, stride, order) for piece in pieces])
    return robust_sigma(found) / difference_gain(order)


def difference_gain(order: int = ORDER) -> float:
    """Return the standard deviation of a difference of white noise, in standard deviations of a sample."""
    return math.sqrt(float(math.comb(2 * order, order)))


def share_explained(measured: Floats, fitted: Floats) -> float:
    """Return R², 1 minus the residual's share of the variance; NaN where the measured values are constant."""
    total = float(np.sum((measured - measured.mean()) ** 2))
    return 1.0 - float(np.sum((measured - fitted) ** 2)) / total if total > 0.0 else float("nan")


def differences(piece: Floats, stride: int, order: int = ORDER) -> Floats:
    """Return the differences of the given order of a piece (n,), or of each of several pieces (m, n)."""
    count = max(0, piece.shape[-1] - order * stride)
    total = np.zeros((*piece.shape[:-1], count))
    for step in range(order, -1, -1):
        there = piece[..., step * stride : step * stride + count]
        total = total + (-1) ** (order - step) * math.comb(order, step) * there
    return total


def correlation_time(pieces: Sequence[Floats]) -> float:
    """Return the integrated correlation time τ = 1 + 2 Σ ρ_k of a residual, in samples (at least 1: independent).

    The autocorrelation is pooled over the pieces (each a continuous recording) and taken about zero, so that the mean
    of a model's error counts as error; the sum is cut at the first window that is five times its own result (Sokal's
    rule, in Functional Integration, NATO ASI B 361 (1997) 131). Pieces of fewer than four samples do not count.
    """
    used = [piece for piece in pieces if len(piece) >= 4]
    if not used:
        return 1.0
    longest = max(len(piece) for piece in used)
    size = 1 << (2 * longest - 1).bit_length()
    power = np.zeros(size // 2 + 1)
    pairs = np.zeros(longest)
    for piece in used:
        power += np.abs(np.fft.rfft(piece, size)) ** 2
        pairs[: len(piece)] += np.arange(len(piece), 0, -1)
    product = np.fft.irfft(power, size)[:longest]
    if product[0] <= 0.0:
        return 1.0
    rho = (product / pairs) / (product[0] / pairs[0])
    tau = 1.0 + 2.0 * np.cumsum(rho[1:])
    window = np.flatnonzero(np.arange(1, longest) >= 5.0 * tau)
    return float(max(1.0, tau[window[0]] if len(window) else tau.max(initial=1.0)))
