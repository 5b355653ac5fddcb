"""Offset, drift and gaps of a clock as a mixture of Gaussians, with values and 95 % intervals.

The gap of a restart of the log is a further unknown of the clock beside offset and drift.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.special import logsumexp, ndtr, softmax

from torsight.core.records import ClockMap
from torsight.core.units import PPM, Flags, Floats, Ints

MOST_HYPOTHESES: Final = 12
"""Largest number of alternative hypotheses that are kept, most likely first: ranges of the offset, maxima within a
range, causes of stops, gaps of a log. Half and twice as many give the same clock (benchmarks/sync/constants.py)."""
NEGLIGIBLE_LOG: Final = 20.0
"""Difference of log-likelihood from which an alternative is dropped: e⁻²⁰ = 2·10⁻⁹, the precision of the quantiles."""


_LIGHT: Final = 0.01
"""Share of the weight of a mixture's lightest components; any share gives the same answer, this one quickly."""


@dataclass(frozen=True, slots=True, eq=False)
class Gaussian:
    """One Gaussian of a mixture, with the logarithm of its weight, up to a common constant.

    The mean (2 + k,) holds the offset in s at some film time, the drift as a plain ratio, and the missing time of each
    of k gaps of the log, s.
    """

    mean: Floats
    covariance: Floats
    log_weight: float

    def updated(self, design: Floats, value: float, variance: float) -> Gaussian:
        """Return the Gaussian conditioned on a measurement ``design @ mean = value`` with a variance."""
        mean, covariance, log_likelihood = conditioned(
            self.mean, self.covariance, design=design, value=value, variance=variance
        )
        return Gaussian(mean, covariance, self.log_weight + float(log_likelihood))

    def weighted(self, log_weight: float) -> Gaussian:
        """Return the same Gaussian with another weight among others."""
        return Gaussian(self.mean, self.covariance, self.log_weight + log_weight)

    def without_drift(self) -> Gaussian:
        """Return the Gaussian conditioned on zero drift."""
        row = np.zeros(len(self.mean))
        row[1] = 1.0
        return self.updated(row, 0.0, 0.0)

    def moved(self, by_s: float) -> Gaussian:
        """Return the same Gaussian with its offset at an instant ``by_s`` later on the film."""
        if by_s == 0.0:
            return self
        change = np.eye(len(self.mean))
        change[0, 1] = by_s
        return Gaussian(change @ self.mean, change @ self.covariance @ change.T, self.log_weight)


def conditioned(
    mean: Floats, covariance: Floats, *, design: Floats, value: float, variance: Floats | float
) -> tuple[Floats, Floats, Floats]:
    """Return means (…, p), covariances (…, p, p) and log-likelihoods (…) after ``design @ mean = value`` was measured.

    ``variance`` (…) is that of the measurement.
    """
    gain = covariance @ design
    total = gain @ design + variance
    away = value - mean @ design
    return (
        mean + gain * (away / total)[..., None],
        covariance - gain[..., :, None] * gain[..., None, :] / total[..., None, None],
        -0.5 * (away**2 / total + np.log(2.0 * np.pi * total)),
    )


def moments(mean: Floats, covariance: Floats, log_weight: Floats) -> tuple[Floats, Floats, Floats]:
    """Return mean (…, p), covariance (…, p, p) and log weight (…) of mixtures of k Gaussians each."""
    total = logsumexp(log_weight, axis=-1)
    weight = np.exp(log_weight - total[..., None])
    middle = np.einsum("...k,...ki->...i", weight, mean)
    away = mean - middle[..., None, :]
    spread = np.einsum("...k,...kij->...ij", weight, covariance + away[..., :, None] * away[..., None, :])
    return middle, spread, total


def mixed(parts: Collection[Gaussian]) -> Gaussian:
    """Return the Gaussian with the mean and covariance of a weighted mixture."""
    mean, covariance = np.stack([part.mean for part in parts]), np.stack([part.covariance for part in parts])
    middle, spread, total = moments(mean, covariance, np.array([part.log_weight for part in parts]))
    return Gaussian(middle, spread, float(total))


@dataclass(frozen=True, slots=True)
class UnknownGap:
    """A joint of the log after which rows may be later than assumed, by an unknown time with standard deviation sigma.

    ``after_s`` and ``begin_s`` are the timestamps of the last row before the joint and of the first after it, as
    joined.
    """

    after_s: float
    begin_s: float
    sigma_s: float


def log_time(
    film_s: Floats, point: Floats, gaps: Sequence[UnknownGap], *, middle_s: float
) -> tuple[Floats, Floats, Flags]:
    """Return the joined log's timestamps at film times (n,), their slopes by the unknowns, and the mask of known ones.

    ``point`` (…, 2 + k) holds the offset at ``middle_s``, the drift, and the missing time of every gap.
    """
    away = film_s - middle_s
    timestamp = film_s + point[..., :1] + point[..., 1:2] * away
    columns = [np.ones_like(timestamp), away + np.zeros_like(timestamp)]
    covered = np.ones(timestamp.shape, dtype=np.bool_)
    for number, gap in enumerate(gaps, start=2):
        after_gap = timestamp > gap.after_s
        timestamp = np.where(after_gap, timestamp - point[..., number : number + 1], timestamp)
        covered &= ~after_gap | (timestamp >= gap.begin_s)
        columns.append(np.where(after_gap, -1.0, 0.0))
    return timestamp, np.stack(columns, axis=-1), covered


def clock_of(mixture: Sequence[Gaussian], *, middle_s: float, film_begin_s: float = 0.0, method: str = "") -> ClockMap:
    """Return the clock: values where most of the mixture's weight agrees, with the mixture's central 95 % intervals.

    The offset's is that at film time 0, and that at the film's first frame.
    """
    largest = max(gaussian.log_weight for gaussian in mixture)
    likely = [gaussian for gaussian in mixture if gaussian.log_weight > largest - NEGLIGIBLE_LOG]
    weight = softmax([gaussian.log_weight for gaussian in likely])
    mean = np.stack([gaussian.mean for gaussian in likely])
    covariance = np.stack([gaussian.covariance for gaussian in likely])

    def offset_at(film_s: float) -> tuple[Floats, Floats]:
        # That at the middle minus the drift accumulated until there.
        row = np.zeros(mean.shape[1])
        row[:2] = 1.0, film_s - middle_s
        return mean @ row, np.sqrt(row @ covariance @ row)

    def interval(value: Floats, sigma: Floats) -> tuple[float, float]:
        return _quantile(value, sigma, weight, 0.025), _quantile(value, sigma, weight, 0.975)

    drift, drift_sigma = mean[:, 1] / PPM, np.sqrt(covariance[:, 1, 1]) / PPM
    # Neighbours on a fine grid of lags share their weight. So take the point with most weight around it, neither the
    # component with the largest weight nor the peak of the density, which may be that of a narrow, light component.
    middle, spread = mean[:, 0], np.sqrt(covariance[:, 0, 0])
    best = _with_most_around(middle, spread, weight)
    near = weight * np.exp(-0.5 * np.minimum(((middle - middle[best]) / spread[best]) ** 2, 700.0))
    near /= near.sum()
    at_zero = offset_at(0.0)
    return ClockMap(
        offset_s=float(near @ at_zero[0]),
        offset_ci95_s=interval(*at_zero),
        drift_ppm=float(near @ drift),
        drift_ci95_ppm=interval(drift, drift_sigma),
        method=method,
        film_offset_ci95_s=interval(*offset_at(film_begin_s)),
    )


def _with_most_around(middle: Floats, spread: Floats, weight: Floats) -> int:
    """Return the place of the component with the most weight of all (n,) around its middle.

    The heaviest components decide: only where they leave less than the weight of the others open are all of them
    looked at. A mixture has thousands, and all pairs took a tenth of the time of a clock.
    """

    def around(rows: Ints, others: Ints) -> Floats:
        at, sigma, own = middle[others], spread[others], weight[others]
        return np.array([np.exp(-0.5 * ((middle[row] - at) / sigma) ** 2) @ own for row in rows])

    order = np.argsort(-weight, kind="stable")
    heavy = order[: 1 + int(np.searchsorted(np.cumsum(weight[order]), 1.0 - _LIGHT))]
    share = around(np.arange(len(middle)), heavy)
    left = np.flatnonzero(share >= share.max() - _LIGHT)
    return int(left[np.argmax(around(left, order))])


def _quantile(mean: Floats, sigma: Floats, weight: Floats, share: float) -> float:
    # Nearly every command imports this module, few estimate a clock: scipy.optimize takes a fifth of the start-up time.
    from scipy.optimize import brentq

    sigma = np.maximum(sigma, 1e-12)
    # Beyond nine standard deviations a normal distribution has no weight in floating point.
    low, high = float((mean - 9.0 * sigma).min()), float((mean + 9.0 * sigma).max())
    return float(brentq(lambda x: float(weight @ ndtr((x - mean) / sigma)) - share, low, high, xtol=1e-9))
