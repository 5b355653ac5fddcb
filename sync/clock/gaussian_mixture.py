"""Beliefs about a clock as mixtures of Gaussians, and the value and 95 % interval that they come to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import ndtr

from torsight.core.units import PPM

DRIFT_SIGMA_PPM: Final = 100.0
"""Quartz clocks of computers: 95 % within ±200 ppm of each other."""


@dataclass(frozen=True, slots=True, eq=False)
class Belief:
    """One Gaussian of a mixture.

    Attributes
    ----------
    mean : (2 + k,) float64
        Offset in s at some film time, drift as a plain ratio, and the missing time of each of k jumps of the log, s.
    covariance : (2 + k, 2 + k) float64
        Their covariance.
    log_weight : float
        Logarithm of its weight, up to a constant that all share.
    """

    mean: NDArray[np.float64]
    covariance: NDArray[np.float64]
    log_weight: float

    def updated(self, design: NDArray[np.float64], value: float, variance: float) -> Belief:
        """Return the belief after a measurement ``design @ mean = value`` with some variance."""
        gain = self.covariance @ design
        total = float(design @ gain) + variance
        away = value - float(design @ self.mean)
        return Belief(
            mean=self.mean + gain * (away / total),
            covariance=self.covariance - np.outer(gain, gain) / total,
            log_weight=self.log_weight - 0.5 * (away**2 / total + float(np.log(2.0 * np.pi * total))),
        )

    def moved(self, by_s: float) -> Belief:
        """Return the same belief with its offset told ``by_s`` later on the film."""
        change = np.eye(len(self.mean))
        change[0, 1] = by_s
        return Belief(change @ self.mean, change @ self.covariance @ change.T, self.log_weight)


@dataclass(frozen=True, slots=True)
class ClockEstimate:
    """Offset at film time 0 and drift, each with a 95 % interval."""

    offset_s: float
    offset_ci95_s: tuple[float, float]
    drift_ppm: float
    drift_ci95_ppm: tuple[float, float]


def conclude(beliefs: Sequence[Belief], *, middle_s: float) -> ClockEstimate:
    """Return values (of the likeliest part) and central 95 % intervals (of the whole mixture)."""
    log_weight = np.array([belief.log_weight for belief in beliefs])
    weight = np.exp(log_weight - log_weight.max())
    weight /= weight.sum()
    # The offset at film time 0 is the one at the middle less what the drift adds up to there.
    row = np.zeros(len(beliefs[0].mean))
    row[:2] = 1.0, -middle_s
    offset = np.array([float(row @ belief.mean) for belief in beliefs])
    offset_sigma = np.array([float(np.sqrt(row @ belief.covariance @ row)) for belief in beliefs])
    drift = np.array([belief.mean[1] / PPM for belief in beliefs])
    drift_sigma = np.array([float(np.sqrt(belief.covariance[1, 1])) / PPM for belief in beliefs])
    # Neighbours on a fine grid of lags share their weight: the peak of the density, not the heaviest part.
    height = weight / np.array([float(np.sqrt(belief.covariance[0, 0])) for belief in beliefs])
    middle = np.array([float(belief.mean[0]) for belief in beliefs])
    spread = np.array([float(np.sqrt(belief.covariance[0, 0])) for belief in beliefs])
    density = [float(np.sum(height * np.exp(-0.5 * ((at - middle) / spread) ** 2))) for at in middle]
    best = int(np.argmax(density))
    near = weight * np.exp(-0.5 * np.minimum(((middle - middle[best]) / spread[best]) ** 2, 700.0))
    near /= near.sum()
    return ClockEstimate(
        offset_s=float(near @ offset),
        offset_ci95_s=(_quantile(offset, offset_sigma, weight, 0.025), _quantile(offset, offset_sigma, weight, 0.975)),
        drift_ppm=float(near @ drift),
        drift_ci95_ppm=(_quantile(drift, drift_sigma, weight, 0.025), _quantile(drift, drift_sigma, weight, 0.975)),
    )


def _quantile(
    mean: NDArray[np.float64], sigma: NDArray[np.float64], weight: NDArray[np.float64], share: float
) -> float:
    matters = weight > 1e-9
    mean, sigma, weight = mean[matters], np.maximum(sigma[matters], 1e-12), weight[matters] / weight[matters].sum()
    low, high = float((mean - 9.0 * sigma).min()), float((mean + 9.0 * sigma).max())
    return float(brentq(lambda x: float(weight @ ndtr((x - mean) / sigma)) - share, low, high, xtol=1e-9))
