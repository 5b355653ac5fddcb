"""Motion against temperature: strokes of one kind pass the same angle at the same wire temperature, however fast.

Let stroke k pass the travel L at film time t. With the right clock and sensor lag the wire's temperature at this time,

    T_k(L) = T_log(t') + lag dT_log/dt,   t' = t (1 + drift) + offset,

is a property of the kind of stroke (which spring, heating or cooling) and of L, up to a linear dependence on the
stroke's start angle (stress) and to a scatter from stroke to stroke, whose size is estimated. Strokes at different
rates of temperature determine the offset: an error of δ shifts T_k by δ times the rate. Where all rates are equal the
offset is not determined, and the interval is as wide as the range from the coarse search.

A motion may be late behind its temperature for other reasons than the sensor: friction that grows with the speed, heat
that reaches a part of the wire later. Such a delay shifts T_k by the delay times the rate, as an error of the offset
does. The two differ in one respect: the offset is the same everywhere, while a delay differs along a stroke, with the
rate of the temperature, and between heating and cooling. So the delay of heatings, and that of coolings, is an unknown
polynomial of L plus one of the rate's logarithm, with coefficients of one unknown size. Where thresholds show a delay
that differs, larger sizes become likely, and with them a delay that is common to all strokes: the interval of the
offset gets as wide as the delays are.

The unknown common curve, the slopes, the scatter and the delays are Gaussian with wide or estimated widths and are
integrated out, which leaves a likelihood of offset, drift and lag alone. A lag acts on ramps as an offset does; the
changepoints separate the two (:mod:`sync.signals.changepoints`). The crossing times are the data: the factor |dT/dt|
converts densities of temperature to densities of time, so that the fit does not prefer a plateau of the temperature.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.linalg.lapack import dposv
from scipy.special import logsumexp

from sync.clock.clock_priors import PRIORS
from sync.clock.gaussian_mixture import NEGLIGIBLE_LOG, Gaussian, UnknownGap, log_time, mixed, moments
from sync.clock.threshold_crossings import ThresholdCrossings
from sync.signals.even_signal import EvenSignal
from sync.signals.heating_segments import LATEST_S, LogSignals, Spring
from torsight.core.series import runs
from torsight.core.units import Flags, Floats, Ints

SCATTERS_C: Final = tuple(float(value) for value in np.geomspace(0.004, 2.5, 12))
_DELAYS_S: Final = tuple(float(value) for value in np.geomspace(0.01, LATEST_S, 7))
"""Sizes of the delay: from a row of a fast log to the longest delay, half a decade apart."""
_KINDS: Final[tuple[tuple[Spring, bool], ...]] = (("a", True), ("a", False), ("b", True), ("b", False))
"""Kinds of strokes: the spring, and whether it is heated."""
_FEWEST: Final = 2 + len(_KINDS)
"""Least number of crossings: for offset, drift, and the unknown curve of each kind of stroke."""
_HELD_S: Final = 0.01
"""Standard deviation with which an offset is held: nothing could be inverted with 0."""
_VALLEY: Final = 5.0
"""Depth of a valley between two maxima: one unit with the power of the crossings (``crossing_temper``)."""
_RESTING_C_S: Final = 1e-3
"""Least rate of temperature of which a logarithm is taken: one kelvin in a quarter of an hour, where nothing moves."""
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
    """Wire temperatures at crossings (m, n) for m clocks: value, rate, variance without scatter, timestamps' slopes.

    All clocks of a scan are computed at once: one by one, the overhead of numpy's calls took most of the time.
    """

    temp_c: Floats
    rate_c_s: Floats
    variance: Floats
    known: Flags
    columns: Floats


def _shrunk(crossings: ThresholdCrossings, rate: Floats, rate_sigma: Floats) -> Floats:
    """Return the rates (m, n), shrunk towards the mean of their kind as far as their differences are noise.

    Differences of rate within a kind determine the offset. Noise in these differences would bias it to the assumed
    value.
    """
    alike = crossings.cell[:, None] == crossings.cell
    usual: Floats = rate @ (alike / np.sum(alike, axis=0))
    away = rate - usual
    kept = np.zeros_like(rate)
    for kind in np.unique(crossings.kind):
        rows = np.flatnonzero(crossings.kind == kind)
        spread, noise = (np.mean(one[:, rows] ** 2, axis=1, keepdims=True) for one in (away, rate_sigma))
        share = 1.0 - PRIORS.rate_noise * noise / np.where(spread > 0.0, spread, np.inf)
        kept[:, rows] = np.maximum(share, 0.0) * away[:, rows]
    return usual + kept


def _smooth_rates(signal: EvenSignal, at_s: Floats, slope: Floats, stroke: Ints) -> tuple[Floats, Floats]:
    """Return the rate of a temperature at instants (m, n) of strokes, and its sigma, from one polynomial per stroke.

    Where too little of a stroke is known, the rate is the signal's own ``slope`` (m, n). ``stroke`` (n,) is in order.
    """
    at, powers, whole = _polynomials(_RATE_POWERS)
    _, begin, count_of = np.unique(stroke, return_index=True, return_counts=True)
    first, last = (of.reduceat(at_s, begin, axis=1).ravel() for of in (np.minimum, np.maximum))
    own = np.repeat(np.arange(len(first)).reshape(len(at_s), -1), count_of, axis=1).ravel()
    at_s, slope, shape = at_s.ravel(), slope.ravel(), at_s.shape
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
    return rate.reshape(shape), np.where(few, signal.slope_sigma, np.hypot(sigma, excess[own])).reshape(shape)


@dataclass(frozen=True, slots=True, eq=False)
class Thresholds:
    """The likelihood of the clock by crossings and temperatures, for a given lag of the sensor and gaps of the log.

    ``prior`` is that of offset, drift and gaps. A clock is a Gaussian per size of the motion's delay, s; there is none
    where too few crossings coincide with known temperatures.
    """

    crossings: ThresholdCrossings
    signals: LogSignals
    gaps: Sequence[UnknownGap]
    lag_s: float
    prior: Gaussian

    def _wire(self, points: Floats) -> _Wire:
        """Return the temperatures for clocks (m, 2 + k)."""
        at_s, columns, covered = log_time(self.crossings.time_s, points, self.gaps, middle_s=self.crossings.middle_s)
        temp, rate, rate_sigma, variance = (np.zeros(at_s.shape) for _ in range(4))
        known = np.zeros(at_s.shape, dtype=np.bool_)
        for name, heating in _KINDS:
            pick = np.flatnonzero((self.crossings.spring_b == (name == "b")) & (self.crossings.heating == heating))
            signal = (self.signals.heated if heating else self.signals.springs).get(name)
            if signal is None or not len(pick):
                continue
            own_s = at_s[:, pick]
            value, slope, known[:, pick] = signal.at(own_s)
            temp[:, pick] = value + self.lag_s * slope
            noise = signal.value_sigma**2 + (self.lag_s * signal.slope_sigma) ** 2
            variance[:, pick] = noise + (self.crossings.time_sigma_s[pick] * slope) ** 2 + 1e-6
            rate[:, pick], rate_sigma[:, pick] = _smooth_rates(signal, own_s, slope, self.crossings.stroke[pick])
        return _Wire(temp, _shrunk(self.crossings, rate, rate_sigma), variance, known & covered, columns)

    def refine(self, *, start_s: float, limit_s: float) -> dict[float, Gaussian]:
        """Return the clock from a start near the answer; a step of the offset is at most ``limit_s``."""
        point = self.prior.mean.copy()
        point[0] = start_s
        # Temperatures are linearised around a point: limit the steps to where they are nearly linear.
        limit = np.full(len(point), limit_s)
        limit[1] = 3e-4
        limit[2:] = np.maximum(5.0, np.sqrt(np.diag(self.prior.covariance)[2:]))
        best: dict[float, Gaussian] = {}
        for _ in range(12):
            (best,) = self._linear(point[None], self.prior)
            if not best:
                return {}
            move = mixed(best.values()).mean - point
            point = point + np.clip(move, -limit, limit)
            if np.all(np.abs(move) < 4e-4 * limit):
                break
        return best

    def scan(self, offset_s: Floats, *, every: int = 2) -> list[dict[float, Gaussian]]:
        """Return the clock at given offsets (m,), each held fixed, mixed over ``every`` nth scatter."""
        points = np.tile(self.prior.mean, (len(offset_s), 1))
        points[:, 0] = offset_s
        covariance = self.prior.covariance.copy()
        covariance[0, :] = covariance[:, 0] = 0.0
        covariance[0, 0] = _HELD_S**2
        return self._linear(points, Gaussian(points, covariance, 0.0), every=every)

    def _linear(self, points: Floats, prior: Gaussian, *, every: int = 1) -> list[dict[float, Gaussian]]:
        """Return the solutions with temperatures linearised around points (m, p), each per size of delay.

        They are mixed over all scatters. The prior has one mean for all points, or one for each.
        """
        wire = self._wire(points)
        means = np.broadcast_to(prior.mean, points.shape)
        found: list[dict[float, Gaussian]] = [{} for _ in points]
        # Points with the same known crossings have equations of the same size.
        masks, mask_of = np.unique(wire.known, axis=0, return_inverse=True)
        for number, mask in enumerate(masks):
            at, keep = np.flatnonzero(mask_of.ravel() == number), np.flatnonzero(mask)
            if len(keep) >= _FEWEST:
                density = _density(self.crossings, keep, wire.rate_c_s[np.ix_(at, keep)])
                halves = _halves(self.crossings, wire, points, at, keep, every=every)
                for one, clock in zip(at, _combined(halves, means[at], prior.covariance, density), strict=True):
                    found[one] = clock
        return found

    def around_maximum(self, low_s: float, high_s: float) -> dict[float, Gaussian]:
        """Return the clock around a maximum between two offsets.

        Where linearised temperatures do not lead to the maximum, the distribution is summed up over offsets on a grid,
        which is made finer around the maximum until 12 of its 33 points carry weight: two in a standard deviation, with
        which sums over a Gaussian are exact to a thousandth. Beyond a gap without weight another maximum begins.
        """
        while True:
            offset_s, step_s = np.linspace(low_s, high_s, 33, retstep=True)
            points = self.scan(offset_s, every=1)
            total = log_weights(points)
            if not np.isfinite(total).any():
                return {}
            top = int(np.argmax(total))
            first, stop = next(run for run in runs(total > total[top] - NEGLIGIBLE_LOG) if run[0] <= top < run[1])
            if stop - first >= 12 or step_s < _HELD_S:
                break
            low_s, high_s = offset_s[max(first - 1, 0)], offset_s[min(stop, len(offset_s) - 1)]
        away = (offset_s - self.prior.mean[0]) ** 2 / self.prior.covariance[0, 0]
        density = np.log(step_s) - 0.5 * (away + np.log(2.0 * np.pi * self.prior.covariance[0, 0]))
        sizes = {size for one in points for size in one}
        found = {
            size: mixed(
                [one[size].weighted(float(own)) for one, own in zip(points, density, strict=True) if size in one]
            )
            for size in sorted(sizes)
        }
        best = max(one.log_weight for one in found.values())
        return {size: one for size, one in found.items() if one.log_weight > best - NEGLIGIBLE_LOG}

    def scatter_c(self, clock: Gaussian) -> float:
        """Return the most probable scatter of the temperatures at which strokes pass an angle, for the mean of a clock.

        The scatters of heatings and of coolings are estimated separately, and the larger one is returned.
        """
        at = clock.mean
        best = 0
        wire = self._wire(at[None])
        for half in _halves(self.crossings, wire, at[None], np.zeros(1, np.int64), np.flatnonzero(wire.known[0])):
            fit = half.square - 2.0 * half.right @ at + np.einsum("i,...ij,j->...", at, half.information, at)
            best = max(best, int(np.argmax(np.max((half.log_weight - 0.5 * fit)[0], axis=0))))
        return SCATTERS_C[best]


def log_weights(points: Sequence[Mapping[float, Gaussian]]) -> Floats:
    """Return the logarithm of the likelihood (n,) at the points of a :func:`scan`, minus infinity at empty ones."""
    return np.array([logsumexp([part.log_weight for part in one.values()]) if one else -np.inf for one in points])


def maxima(log_likelihood: Floats) -> list[tuple[int, int]]:
    """Return the first and last place of the hill around each maximum of a likelihood on a grid (n,), highest first.

    Hills are parted by valleys that are at least :data:`_VALLEY` deep.
    """
    hill, peak = np.full(len(log_likelihood), -1), list[float]()
    for place in np.argsort(-log_likelihood, kind="stable").tolist():
        value = float(log_likelihood[place])
        if not np.isfinite(value):
            break
        beside = {int(hill[k]) for k in (place - 1, place + 1) if 0 <= k < len(hill) and hill[k] >= 0}
        if not beside:
            peak.append(value)
            hill[place] = len(peak) - 1
            continue
        higher = min(beside)
        hill[place] = higher
        for lower in beside - {higher}:
            if peak[lower] - value < _VALLEY:
                hill[hill == lower] = higher
    return [(int(rows[0]), int(rows[-1])) for k in range(len(peak)) if len(rows := np.flatnonzero(hill == k))]


def _halves(
    crossings: ThresholdCrossings, wire: _Wire, points: Floats, at: Ints, keep: Ints, *, every: int = 1
) -> list[_Half]:
    """Return the normal equations of heatings and of coolings at some points, linearised around each of them.

    Of the ``points`` (m, p) those with the numbers ``at`` (a,) are taken, of the crossings those with ``keep`` (k,).
    """
    rate = wire.rate_c_s[np.ix_(at, keep)]
    jacobian = rate[..., None] * wire.columns[np.ix_(at, keep)]
    # y + J (p - point) = curve + scatter, seen as data d = y - J point with design -J. The prior of the curve has its
    # mean at 50 °C, between a room and the end of a heating.
    data = wire.temp_c[np.ix_(at, keep)] - (jacobian @ points[at, :, None])[..., 0] - 50.0
    columns = np.concatenate([-jacobian, data[..., None], rate[..., None] * crossings.delay[keep]], axis=-1)
    log_rate = _log_rate(rate)
    heating, scatters_c = crossings.heating[keep], np.array(SCATTERS_C[::every])
    # Heatings and coolings share only the clock and the size of delays: each has its own scatter.
    halves = []
    for rows in (np.flatnonzero(heating), np.flatnonzero(~heating)):
        if len(rows):
            own = keep[rows]
            common, scatter = (one[np.ix_(own, own)] for one in (crossings.common_c2, crossings.scatter))
            spread = [common + c**2 * scatter for c in scatters_c]
            faster = log_rate[:, rows] - log_rate[:, rows].mean(axis=1, keepdims=True)
            of_rate = np.stack([faster, faster**2], axis=-1) * PRIORS.delay_of_rate
            with_rate = np.concatenate([columns[:, rows], rate[:, rows, None] * of_rate], axis=-1)
            solved = [
                [_solved(one, variance, design) for one in spread]
                for variance, design in zip(wire.variance[np.ix_(at, own)], with_rate, strict=True)
            ]
            halves.append(_half(solved, scatters_c, unknowns=points.shape[1]))
    return halves


@dataclass(frozen=True, slots=True)
class _Half:
    """The normal equations of the heatings, or of the coolings, without a prior.

    For m points, t sizes of delay, and c scatters: ``information`` (m, t, c, p, p), ``right`` side (m, t, c, p),
    ``square`` of the data (m, t, c), ``log_weight`` (m, t, c).
    """

    information: Floats
    right: Floats
    square: Floats
    log_weight: Floats


def _solved(shared: Floats, variance: Floats, columns: Floats) -> tuple[Floats, float]:
    """Return the Gram matrix of columns (n, k) under a covariance, and the logarithm of its determinant.

    The covariance is the sum of one (n, n) and of each crossing's own variance (n,).
    """
    covariance = shared.copy()
    covariance.flat[:: len(covariance) + 1] += variance
    # LAPACK directly: for such small matrices the overhead of SciPy's functions doubles the time.
    factor, solved, failed = dposv(covariance.T, columns, lower=1, overwrite_a=1)
    if failed:
        msg = "the covariance of crossings is not positive definite"
        raise np.linalg.LinAlgError(msg)
    log_det = len(columns) * float(np.log(2.0 * np.pi)) + 2.0 * float(np.log(np.diag(factor)).sum())
    return columns.T @ solved, log_det


def _half(solved: Sequence[Sequence[tuple[Floats, float]]], scatter_c: Floats, *, unknowns: int) -> _Half:
    """Return the normal equations with the delays integrated out, each coefficient of a delay with its size as sigma.

    The columns of the Gram matrices, one per point and scatter, are those of the unknowns, the data, and the shapes of
    the delay.
    """
    gram = np.array([[one for one, _ in at_point] for at_point in solved])[:, None]
    log_det = np.array([[value for _, value in at_point] for at_point in solved])[:, None]
    # A motion is late rather than early: its mean delay is the size.
    late = np.tile(np.eye(gram.shape[-1]), (len(_DELAYS_S), 1, 1, 1))
    late[:, 0, unknowns + 1, unknowns] = -np.array(_DELAYS_S)
    gram = np.swapaxes(late, -1, -2) @ gram @ late
    known, shapes = gram[..., : unknowns + 1, : unknowns + 1], gram[..., unknowns + 1 :, unknowns + 1 :]
    cross = gram[..., unknowns + 1 :, : unknowns + 1]
    size2 = np.square(_DELAYS_S)[:, None, None, None]
    inside = np.eye(shapes.shape[-1]) + size2 * shapes
    known = known - np.swapaxes(cross, -1, -2) @ np.linalg.solve(inside, size2 * cross)
    scatter_log_prior = np.log(scatter_c) - np.log1p((scatter_c / PRIORS.typical_scatter_c) ** 2)
    return _Half(
        information=known[..., :unknowns, :unknowns],
        right=known[..., :unknowns, unknowns],
        square=known[..., unknowns, unknowns],
        log_weight=scatter_log_prior - 0.5 * (log_det + np.linalg.slogdet(inside)[1]),
    )


def _combined(
    halves: Sequence[_Half], prior_mean: Floats, prior_covariance: Floats, log_weight: Floats
) -> list[dict[float, Gaussian]]:
    """Return at each of m points the Gaussian per likely size of delay, mixed over every pair of scatters.

    The prior has a mean (m, p) for each point and one covariance; ``log_weight`` (m,) is common to sizes and scatters.
    """
    precision = np.asarray(np.linalg.inv(prior_covariance), np.float64)
    pull = prior_mean @ precision
    size = np.array(_DELAYS_S)
    delay_log_prior = np.log(size) - np.log1p((size / PRIORS.typical_delay_s) ** 2)
    information = _summed(precision, [h.information for h in halves])
    right = _summed(pull[:, None, None], [h.right for h in halves])
    square = _summed(np.sum(prior_mean * pull, axis=1)[:, None, None], [h.square for h in halves])
    weight = _summed(delay_log_prior[:, None] + log_weight[:, None, None], [h.log_weight for h in halves])
    covariance = np.asarray(np.linalg.inv(information), np.float64)
    mean = (covariance @ right[..., None])[..., 0]
    fit = square - np.sum(mean * right, axis=-1)
    log_det = np.linalg.slogdet(information)[1] - float(np.linalg.slogdet(precision)[1])
    found = zip(*moments(mean, covariance, weight - 0.5 * (fit + log_det)), strict=True)
    return [
        {
            _DELAYS_S[t]: Gaussian(middle[t], spread[t], float(of_size[t]))
            for t in np.flatnonzero(of_size > of_size.max() - NEGLIGIBLE_LOG)
        }
        for middle, spread, of_size in found
    ]


def _summed(start: Floats, halves: Sequence[Floats]) -> Floats:
    """Return the sums (m, t, k, ...) of a start and one scatter's term (m, t, c, ...) of each half, for all pairs."""
    total = start + halves[0]
    for values in halves[1:]:
        both = total[:, :, :, np.newaxis] + values[:, :, np.newaxis]
        total = both.reshape(*values.shape[:2], -1, *values.shape[3:])
    return total


def _density(crossings: ThresholdCrossings, keep: Ints, rate_c_s: Floats) -> Floats:
    """Return the logarithm (m,) of the factor that converts densities of temperature to densities of time.

    ``rate_c_s`` (m, k) are the rates at the crossings ``keep`` (k,). The factor counts once per stroke, like the
    dominant scatter. One stroke of each kind determines the unknown curve and contains no information on the clock,
    whatever its rate.
    """
    stroke, kind, cell = crossings.stroke[keep], crossings.kind[keep], crossings.cell[keep]
    # The unknown curve has a flat prior: a point of it that only one stroke passes counts neither for nor against.
    free = len(np.unique(cell)) * float(np.log(np.sqrt(2.0 * np.pi) * PRIORS.curve_sigma_c))
    _, first, of = np.unique(stroke, return_index=True, return_inverse=True)
    strokes_of_kind = np.bincount(kind[first])[kind]
    return free + _log_rate(rate_c_s) @ ((1.0 - 1.0 / strokes_of_kind) / np.bincount(of)[of])


def _log_rate(rate_c_s: Floats) -> Floats:
    """Return the logarithm of rates; on a plateau the rate is near zero, and its logarithm would be unbounded."""
    return np.asarray(np.log(np.maximum(np.abs(rate_c_s), _RESTING_C_S)))
