"""How much the readings of a series scatter, and how much of it a model explains."""

from __future__ import annotations

import math
from statistics import NormalDist
from typing import Final

import numpy as np

from torsight.core.units import Floats

BY_CHANCE: Final = NormalDist().inv_cdf(1.0 - 1e-9)
"""Standard deviations that chance reaches once in 10⁹ samples, which are a year of film: beyond is another cause."""
APART: Final = math.sqrt(2.0) * BY_CHANCE
"""The same of one sample's, for the difference of two."""
_NORMAL_MEDIAN: Final = NormalDist().inv_cdf(0.75)
"""Median of the absolute value of a standard normal variable."""


def rms(values: Floats) -> float:
    """Return the root of the mean square of values (n,)."""
    return float(np.sqrt(np.mean(values**2)))


def robust_sigma(deviation: Floats) -> float:
    """Return the standard deviation of normal deviations (n,) from their median size: outliers hardly move it."""
    return float(np.median(np.abs(deviation))) / _NORMAL_MEDIAN


def scatter(*pieces: Floats, stride: int = 1, order: int = 3) -> float:
    """Return the standard deviation of one reading of evenly sampled pieces, one of them longer than three strides.

    Differences of that order, of samples that are ``stride`` apart, leave almost nothing of a slow trend, and their
    median is blind to the odd outlier. Those of white noise have the variance of one sample times the sum of the
    squared binomial coefficients, which is C(2 order, order): 6 for the second difference, 20 for the third.
    """
    differences = np.concatenate([_difference(piece, stride, order) for piece in pieces])
    return robust_sigma(differences) / float(np.sqrt(float(math.comb(2 * order, order))))


def share_explained(measured: Floats, fitted: Floats) -> float:
    """Return R², 1 less the residual's share of the variance; NaN where what was measured does not vary."""
    total = float(np.sum((measured - measured.mean()) ** 2))
    return 1.0 - float(np.sum((measured - fitted) ** 2)) / total if total > 0.0 else float("nan")


def _difference(piece: Floats, stride: int, order: int) -> Floats:
    count = max(0, len(piece) - order * stride)
    total = np.zeros(count)
    for step in range(order, -1, -1):
        total = total + (-1) ** (order - step) * math.comb(order, step) * piece[step * stride : step * stride + count]
    return total
