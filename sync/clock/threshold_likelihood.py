"""Motion against temperature: strokes of one kind pass the same angle at the same wire temperature, however fast.

Let stroke k pass the travel L at film time t. With the right clock and sensor lag the wire's temperature at this time,

    T_k(L) = T_log(t') + lag dT_log/dt,   t' = t (1 + drift) + offset,

is a property of the kind of stroke (which spring, heating or cooling) and of L, up to a linear dependence on the
stroke's start angle (stress) and to a scatter from stroke to stroke, whose size is estimated. Strokes at different
rates of temperature determine the offset: an error of δ shifts T_k by δ times the rate. Where all rates are equal the
offset is not determined, and the interval is as wide as the range from the coarse search.

The unknown common curve, the slopes and the scatter are Gaussian with wide or estimated widths and are integrated out,
which leaves a likelihood of offset, drift and lag alone. A lag acts on ramps as an offset does; the
changepoints separate the two (:mod:`sync.signals.changepoints`). The crossing times are the data: the factor |dT/dt|
converts densities of temperature to densities of time, so that the fit does not prefer a plateau of the temperature.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, TypeAlias

import numpy as np
from scipy.linalg.lapack import dposv
from scipy.special import logsumexp, softmax

from sync.clock.clock_priors import PRIORS
from sync.clock.gaussian_mixture import NEGLIGIBLE_LOG, Gaussian, UnknownGap, log_time
from sync.clock.threshold_crossings import ThresholdCrossings
from sync.signals.even_signal import EvenSignal
from sync.signals.heating_segments import LogSignals, Spring
from torsight.core.series import rms
from torsight.core.units import Flags, Floats, Ints

SCATTERS_C: Final = tuple(float(value) for value in np.geomspace(0.004, 2.5, 12))
_KINDS: Final[tuple[tuple[Spring, bool], ...]] = (("a", True), ("a", False), ("b", True), ("b", False))
"""Kinds of strokes: the spring, and whether it is heated."""
_FEWEST: Final = 2 + len(_KINDS)
"""Least number of crossings: for offset, drift, and the unknown curve of each kind of stroke."""
_RATE_POWERS: Final = 3
"""Degree of the polynomial per stroke that gives its rate, through ten points per coefficient. Degrees two and six move
the clock by 0.01 of its standard deviations (benchmarks/sync/constants.py)."""


@functools.cache
def _polynomials(degree: int) -> tuple[Floats, Floats, Floats]:
    """Return the points (n,) on a stroke, their powers (n, p), and the matrix (p, n) from values to coefficients.

    The matrix is valid for strokes with all points known, as they nearly always are.
    """
    at = np.linspace(-1.0, 1.0, 10 * (degree + 1))
    powers = np.vander(at, degree + 1, increasing=True)
    return at, powers, np.asarray(np.linalg.pinv(powers), dtype=np.float64)


@dataclass(frozen=True, slots=True)
class _Wire:
    """Wire temperatures at the crossings for one clock: value, rate, variance without scatter, timestamps' slopes."""

    temp_c: Floats
    rate_c_s: Floats
    variance: Floats
    known: Flags
    columns: Floats


def _wire(
    crossings: ThresholdCrossings, signals: LogSignals, point: Floats, gaps: Sequence[UnknownGap], lag_s: float
) -> _Wire:
    at_s, columns, covered = log_time(crossings.time_s, point, gaps, middle_s=crossings.middle_s)
    n = len(crossings)
    temp, rate, rate_sigma, variance = np.zeros(n), np.zeros(n), np.zeros(n), np.ones(n)
    known = np.zeros(n, dtype=np.bool_)
    for name, heating in _KINDS:
        pick = (crossings.spring_b == (name == "b")) & (crossings.heating == heating)
        signal = (signals.heated if heating else signals.springs).get(name)
        if signal is None or not pick.any():
            continue
        value, slope, there = signal.at(at_s[pick])
        temp[pick] = value + lag_s * slope
        noise = signal.value_sigma**2 + (lag_s * signal.slope_sigma) ** 2
        variance[pick] = noise + (crossings.time_sigma_s[pick] * slope) ** 2 + 1e-6
        known[pick] = there
        rate[pick], rate_sigma[pick] = _smooth_rates(signal, at_s[pick], slope, crossings.stroke[pick])
    return _Wire(temp, _shrunk(crossings, rate, rate_sigma), variance, known & covered, columns)


def _shrunk(crossings: ThresholdCrossings, rate: Floats, rate_sigma: Floats) -> Floats:
    """Return the rates, shrunk towards the mean of their kind as far as their differences are noise.

    Differences of rate within a kind determine the offset. Noise in these differences would bias it to the assumed
    value.
    """
    total = np.bincount(crossings.cell, weights=rate)
    usual = (total / np.maximum(np.bincount(crossings.cell), 1))[crossings.cell]
    away = rate - usual
    kept = np.zeros_like(rate)
    for kind in np.unique(crossings.kind):
        rows = crossings.kind == kind
        spread, noise = float(np.mean(away[rows] ** 2)), float(np.mean(rate_sigma[rows] ** 2))
        kept[rows] = max(0.0, 1.0 - PRIORS.rate_noise * noise / spread) * away[rows] if spread > 0 else 0.0
    return usual + kept


def _smooth_rates(signal: EvenSignal, at_s: Floats, slope: Floats, stroke: Ints) -> tuple[Floats, Floats]:
    """Return the rate of a temperature at instants (n,) of strokes, and its sigma, from one polynomial per stroke.

    Where too little of a stroke is known, the rate is the signal's own ``slope`` (n,).
    """
    at, powers, whole = _polynomials(_RATE_POWERS)
    _, own = np.unique(stroke, return_inverse=True)
    first, last = np.full(own.max() + 1, np.inf), np.full(own.max() + 1, -np.inf)
    np.minimum.at(first, own, at_s)
    np.maximum.at(last, own, at_s)
    middle, half = 0.5 * (first + last), 0.5 * (last - first) * 1.3 + 2.0 * signal.step_s
    value, _, known = signal.at(middle[:, None] + half[:, None] * at)
    value, count = np.where(known, value, 0.0), np.sum(known, axis=1)
    fit = np.repeat(whole[None], len(value), axis=0)
    partly = count < len(at)
    if partly.any():
        fit[partly] = np.linalg.pinv(powers * known[partly, :, None])
    coefficient = (fit @ value[..., None])[..., 0]
    x = (at_s - middle[own]) / half[own]
    design = np.stack([k * x ** max(k - 1, 0) for k in range(_RATE_POWERS + 1)], axis=1) / half[own, None]
    # Of the points as many as the signal has steps are independent, each with the noise of a raw point.
    independent = np.maximum(2.0 * half / signal.step_s, 2.0 * _RATE_POWERS)
    spread = fit @ np.swapaxes(fit, -1, -2) * (count / independent * signal.point_sigma**2)[:, None, None]
    # No polynomial follows a corner: such rates contain no information.
    missed = np.sum(np.where(known, value - coefficient @ powers.T, 0.0) ** 2, axis=1) / np.maximum(count, 1)
    excess = np.sqrt(np.maximum(missed - (2.0 * signal.value_sigma) ** 2, 0.0)) * _RATE_POWERS / half
    sigma = np.sqrt(np.sum((spread[own] @ design[..., None])[..., 0] * design, axis=1))
    few = (count < 2 * _RATE_POWERS)[own]
    rate = np.where(few, slope, np.sum(design * coefficient[own], axis=1))
    return rate, np.where(few, signal.slope_sigma, np.hypot(sigma, excess[own]))


def refine(
    crossings: ThresholdCrossings,
    signals: LogSignals,
    *,
    start_s: float,
    prior: Gaussian,
    lag_s: float,
    gaps: Sequence[UnknownGap],
) -> Gaussian | None:
    """Return the Gaussian of the clock for a given lag, from a start near the answer.

    None where too few crossings coincide with known temperatures.
    """
    point = prior.mean.copy()
    point[0] = start_s
    # Temperatures are linearised around a point: limit the steps to where they are nearly linear.
    limit = np.full(len(point), 5.0)
    limit[1] = 3e-4
    limit[2:] = np.maximum(5.0, np.sqrt(np.diag(prior.covariance)[2:]))
    best: Gaussian | None = None
    for _ in range(12):
        wire = _wire(crossings, signals, point, gaps, lag_s)
        if np.count_nonzero(wire.known) < _FEWEST:
            return None
        best = _mixed(_linear(crossings, wire, point, prior))
        move = best.mean - point
        point = point + np.clip(move, -limit, limit)
        if np.all(np.abs(move) < 4e-4 * limit):
            break
    return best


def scan(
    crossings: ThresholdCrossings,
    signals: LogSignals,
    *,
    offset_s: Floats,
    prior: Gaussian,
    lag_s: float,
    gaps: Sequence[UnknownGap],
) -> Floats:
    """Return the log-likelihood at given offsets, each held fixed; minus infinity where temperatures are unknown."""
    log_likelihood = np.full(len(offset_s), -np.inf)
    covariance = prior.covariance.copy()
    covariance[0, :] = covariance[:, 0] = 0.0
    covariance[0, 0] = 1e-4  # held to 0.01 s: nothing could be inverted with 0
    for index, value in enumerate(offset_s):
        point = prior.mean.copy()
        point[0] = float(value)
        wire = _wire(crossings, signals, point, gaps, lag_s)
        if np.count_nonzero(wire.known) >= _FEWEST:
            held = Gaussian(point, covariance, 0.0)
            log_likelihood[index] = _mixed(_linear(crossings, wire, point, held, every=2)).log_weight
    return log_likelihood


def scatter_c(
    crossings: ThresholdCrossings, signals: LogSignals, *, clock: Gaussian, lag_s: float, gaps: Sequence[UnknownGap]
) -> float:
    """Return the most probable scatter of the temperature at which strokes pass an angle, with the clock at its mean.

    The scatters of heatings and of coolings are estimated separately, and the larger one is returned.
    """
    at = clock.mean
    halves = _halves(crossings, _wire(crossings, signals, at, gaps, lag_s), at)
    best = [
        int(
            np.argmax(
                [weight - 0.5 * (square - 2.0 * right @ at + at @ known @ at) for known, right, square, weight in half]
            )
        )
        for half in halves
    ]
    return SCATTERS_C[max(best, default=0)]


def _linear(
    crossings: ThresholdCrossings, wire: _Wire, point: Floats, prior: Gaussian, *, every: int = 1
) -> list[Gaussian]:
    """Return the solutions with temperatures linearised around a point, for each pair of scatters."""
    keep = wire.known
    density = _density(crossings.stroke[keep], crossings.kind[keep], wire.rate_c_s[keep])
    return _combined(_halves(crossings, wire, point, every=every), prior, log_weight=density)


def _halves(crossings: ThresholdCrossings, wire: _Wire, point: Floats, *, every: int = 1) -> list[list[_Half]]:
    """Return the normal equations of heatings and of coolings for each scatter, linearised around a point."""
    keep = wire.known
    rate = wire.rate_c_s[keep]
    jacobian = rate[:, None] * wire.columns[keep]
    # y + J (p - point) = curve + scatter, seen as data d = y - J point with design -J. The prior of the curve has its
    # mean at 50 °C, between a room and the end of a heating.
    data = wire.temp_c[keep] - jacobian @ point - 50.0
    common = crossings.common_c2[np.ix_(keep, keep)] + np.diag(wire.variance[keep])
    heating = crossings.heating[keep]
    scatter = crossings.scatter[np.ix_(keep, keep)]
    with_rate = _with_rate(crossings.kind[keep], rate, heating)
    # Heatings and coolings share only the clock: each has its own scatter.
    halves = []
    for rows in (np.flatnonzero(heating), np.flatnonzero(~heating)):
        if len(rows):
            own, alike, going = (one[np.ix_(rows, rows)] for one in (common, scatter, with_rate))
            totals = ((c, own + c**2 * (alike + _cause(c) ** 2 * going)) for c in SCATTERS_C[::every])
            halves.append([_half(total, jacobian[rows], data[rows], c) for c, total in totals])
    return halves


def _with_rate(kind: Ints, rate: Floats, heating: Flags) -> Floats:
    """Return the covariance of a scatter that is proportional to the rate of heating, common to both springs."""
    total = np.bincount(kind, weights=rate) / np.maximum(np.bincount(kind), 1)
    away = np.where(heating, rate - total[kind], 0.0)
    spread = rms(away[heating]) if heating.any() else 0.0
    return np.outer(away, away) / max(spread, 1e-12) ** 2


def _cause(scatter_c: float) -> float:
    """Return the largest scatter that is proportional to the rate, as a multiple of the rest."""
    beyond = (scatter_c / PRIORS.ordinary_scatter_c) ** 4
    return PRIORS.with_rate * beyond / (1.0 + beyond)


_Half: TypeAlias = tuple[Floats, Floats, float, float]
"""The normal equations of the heatings, or of the coolings, for one scatter, without a prior: information, right side,
square of the data, logarithm of the weight."""


def _half(covariance: Floats, design: Floats, data: Floats, scatter_c: float) -> _Half:
    # LAPACK directly: for such small matrices the overhead of SciPy's functions doubles the time.
    factor, solved, failed = dposv(covariance, np.column_stack([design, data]), lower=1)
    if failed:
        msg = "the covariance of crossings is not positive definite"
        raise np.linalg.LinAlgError(msg)
    log_det = len(data) * float(np.log(2.0 * np.pi)) + 2.0 * float(np.log(np.diag(factor)).sum())
    scatter_log_prior = float(np.log(scatter_c) - np.log1p((scatter_c / PRIORS.typical_scatter_c) ** 2))
    square = float(data @ solved[:, -1])
    return design.T @ solved[:, :-1], -(design.T @ solved[:, -1]), square, scatter_log_prior - 0.5 * log_det


def _combined(halves: Sequence[Sequence[_Half]], prior: Gaussian, *, log_weight: float) -> list[Gaussian]:
    """Return the Gaussians for every pair of scatters."""
    precision = np.linalg.inv(prior.covariance)
    pull = precision @ prior.mean
    starts = (precision, pull, prior.mean @ pull, log_weight)
    terms = zip(*(zip(*half, strict=True) for half in halves), strict=True)
    information, right, square, weight = (_summed(*one) for one in zip(starts, terms, strict=True))
    covariance = np.linalg.inv(information)
    mean = np.einsum("kij,kj->ki", covariance, right)
    fit = square - np.einsum("ki,ki->k", mean, right)
    log_det = np.linalg.slogdet(information)[1] - float(np.linalg.slogdet(precision)[1])
    total = weight - 0.5 * (fit + log_det)
    likely = np.flatnonzero(total > total.max() - NEGLIGIBLE_LOG)
    return [Gaussian(mean[k], covariance[k], float(total[k])) for k in likely]


def _summed(start: Any, halves: Sequence[Any]) -> Floats:
    """Return the sums of a value and one term of each half, for all combinations."""
    total = np.asarray(start)[np.newaxis]
    for half in halves:
        values = np.asarray(half)
        total = (total[:, np.newaxis] + values).reshape(-1, *values.shape[1:])
    return total


def _density(stroke: Ints, kind: Ints, rate: Floats) -> float:
    """Return the logarithm of the factor that converts densities of temperature to densities of time.

    The factor counts once per stroke, like the dominant scatter. One stroke of each kind determines the unknown curve
    and contains no information on the clock, whatever its rate.
    """
    total = 0.0
    for number in np.unique(kind):
        # On a plateau the rate is near zero, and its logarithm is unbounded.
        strokes = np.unique(stroke[kind == number])
        logs = [float(np.log(np.maximum(np.abs(rate[stroke == k]), 1e-3)).mean()) for k in strokes]
        total += (1.0 - 1.0 / len(logs)) * float(np.sum(logs))
    return total


def _mixed(parts: Sequence[Gaussian]) -> Gaussian:
    """Return the Gaussian with the mean and covariance of a weighted mixture."""
    log_weight = np.array([part.log_weight for part in parts])
    weight, means = softmax(log_weight), np.stack([part.mean for part in parts])
    mean = weight @ means
    away = means - mean
    within = np.einsum("k,kij->ij", weight, np.stack([part.covariance for part in parts]))
    return Gaussian(mean, within + (weight * away.T) @ away, float(logsumexp(log_weight)))
