"""Motion against temperature: strokes of one kind pass the same angle at the same wire temperature, however fast.

Let stroke k pass the way L at film time t. With the right clock and sensor lag the wire's temperature then,

    T_k(L) = T_log(t') + lag dT_log/dt,   t' = t (1 + drift) + offset,

is a property of the kind of stroke (which spring, heating or cooling) and of L, up to a slope in the angle at which the
stroke began (stress) and to a scatter from stroke to stroke, whose size is learnt. Strokes at different rates of
temperature pin the offset: an error of δ moves T_k by δ times the rate. Where all rates are alike nothing is pinned, and
the interval comes out as wide as the range that the coarse search left.

The unknown common curve, the slopes and the scatter are Gaussian with wide or learnt widths and are integrated out, which
leaves a likelihood of offset, drift and lag alone. A lag acts on ramps as an offset does; what tells them apart is
elsewhere (:mod:`sync.corners`). The crossing times are the data: the factor |dT/dt| turns densities of temperature into
densities of time and keeps the fit from hiding on a plateau of the temperature.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from sync.belief import DRIFT_SIGMA_PPM, Belief
from sync.flanks import Flank, LogPicture, Spring
from sync.motion import Stroke
from torsight.core.units import DEG, PPM

_SHARES: Final = (0.015, 0.04, 0.09, 0.17, 0.28, 0.42, 0.57, 0.72, 0.85, 0.94)
_CURVE_SIGMA_C: Final = 60.0
_STRESS_SIGMA_C_PER_DEG: Final = 0.04
_SHAPE_SIGMA_C_PER_DEG: Final = 0.04
_FAR_SCATTER_C_PER_DEG: Final = 0.003
_SCATTER_REACH: Final = 0.2
_SCATTER_SHAPE: Final = 0.7
_FARTHEST_DEG: Final = 40.0
"""Strokes that begin further from the others of their kind pass their levels under another stress: not comparable."""
SCATTERS_C: Final = tuple(float(value) for value in np.geomspace(0.004, 2.5, 12))
_TYPICAL_SCATTER_C: Final = 0.05
_FEWEST: Final = 6
_SLOPE_STEP_SHARE: Final = 0.03
_SLOPE_STEP_S: Final = (0.25, 4.0)
"""Rates are differences over this share of the flank, within these bounds: noise in a rate would look like an error of
the clock that differs from level to level, and hide the one that does not."""


@dataclass(frozen=True, slots=True, eq=False)
class Crossings:
    """Passings of levels, one row each, and the common design that does not depend on the clock.

    Attributes
    ----------
    time_s, time_sigma_s : (n,) float64
        Film time of each passing.
    spring_b : (n,) bool
        Which spring drives.
    reach_s : (n,) float64
        Half the time over which the rate of temperature is taken.
    stroke : (n,) int64
        Number of the stroke.
    shared : (n,) float64
        Number of strokes that pass the same level of the same kind.
    common_c2 : (n, n) float64
        Covariance, °C², of what is not known about a kind of stroke: its curve, its dependence on where it began.
    scatter : (n, n) float64
        Covariance of the scatter between strokes, for a scatter of 1 °C.
    middle_s : float
        Film time at which the offset is pinned.
    """

    time_s: NDArray[np.float64]
    time_sigma_s: NDArray[np.float64]
    spring_b: NDArray[np.bool_]
    reach_s: NDArray[np.float64]
    stroke: NDArray[np.int64]
    shared: NDArray[np.float64]
    common_c2: NDArray[np.float64]
    scatter: NDArray[np.float64]
    middle_s: float

    def __len__(self) -> int:
        return len(self.time_s)


def collect_crossings(strokes: Sequence[Stroke], flanks: Sequence[Flank | None]) -> Crossings | None:
    """Read the passings of common levels from strokes that have a flank; ``None`` where there are none."""
    kinds: dict[tuple[Spring, bool], list[int]] = {}
    reach: dict[int, float] = {}
    for index, flank in enumerate(flanks):
        if flank is not None:
            reach[index] = float(np.clip(_SLOPE_STEP_SHARE * (flank.end_s - flank.begin_s), *_SLOPE_STEP_S))
            kinds.setdefault((flank.spring, flank.heating), []).append(index)
    rows: list[tuple[float, float, bool, int, int, float, float, bool]] = []
    column = 0
    for (spring, heating), members in kinds.items():
        # Kinds of one level set: the longest stroke sets the levels, shorter ones pass the first of them.
        longest = max(strokes[index].length_rad for index in members)
        begins = np.array([strokes[index].sign * strokes[index].start_rad for index in members])
        usual = _crowded(begins)
        level = longest * np.array(_SHARES)
        for index in members:
            stroke = strokes[index]
            at_s, speed = stroke.crossing_s(level)
            usable = np.isfinite(at_s) & (level < 0.955 * stroke.length_rad) & (speed > 0)
            far_deg = (stroke.sign * stroke.start_rad - usual) / DEG
            if abs(far_deg) > _FARTHEST_DEG:
                continue
            for number in np.flatnonzero(usable).tolist():
                sigma_s = stroke.travel_sigma_rad / float(speed[number])
                share = float(_SHARES[number])
                rows.append(
                    (float(at_s[number]), sigma_s, spring == "b", index, column + number, far_deg, share, heating)
                )
        column += len(level)
    if not rows:
        return None
    time_s, sigma_s, spring_b, number, cell, far, share, heating_row = (
        np.array(item) for item in zip(*rows, strict=True)
    )
    same_cell = (cell[:, None] == cell[None, :]).astype(np.float64)
    far_both = far[:, None] * far[None, :]
    tilt = 2.0 * share - 1.0
    stress = (heating_row[:, None] == heating_row[None, :]) * (1.0 + tilt[:, None] * tilt[None, :])
    common = _CURVE_SIGMA_C**2 * same_cell + far_both * (
        _STRESS_SIGMA_C_PER_DEG**2 * stress + _SHAPE_SIGMA_C_PER_DEG**2 * same_cell
    )
    # A stroke misses the curve of its kind as a whole, and smoothly along its way.
    along = np.exp(-0.5 * ((share[:, None] - share[None, :]) / _SCATTER_REACH) ** 2)
    scatter = (number[:, None] == number[None, :]) * (1.0 + _SCATTER_SHAPE**2 * along)
    return Crossings(
        time_s=time_s,
        time_sigma_s=sigma_s,
        spring_b=spring_b.astype(np.bool_),
        reach_s=np.array([reach[int(index)] for index in number]),
        stroke=number.astype(np.int64),
        shared=same_cell.sum(axis=1),
        common_c2=common + _FAR_SCATTER_C_PER_DEG**2 * far_both * scatter,
        scatter=scatter,
        middle_s=float(0.5 * (time_s.min() + time_s.max())),
    )


def _crowded(value: NDArray[np.float64]) -> float:
    """Return the value with most others within 15 degrees."""
    near = np.abs(value[:, None] - value[None, :]) < 15.0 * DEG
    return float(value[int(np.argmax(near.sum(axis=1)))])


@dataclass(frozen=True, slots=True)
class _Wire:
    """Wire temperatures at the passings for one clock: value, rate and variance without scatter."""

    temp_c: NDArray[np.float64]
    rate_c_s: NDArray[np.float64]
    variance: NDArray[np.float64]
    known: NDArray[np.bool_]


def _wire(crossings: Crossings, picture: LogPicture, offset_s: float, drift: float, lag_s: float) -> _Wire:
    at_s = crossings.time_s + offset_s + drift * (crossings.time_s - crossings.middle_s)
    n = len(crossings)
    temp, rate, variance = np.zeros(n), np.zeros(n), np.ones(n)
    known = np.zeros(n, dtype=np.bool_)
    for name, pick in (("a", ~crossings.spring_b), ("b", crossings.spring_b)):
        signal = picture.springs.get("a" if name == "a" else "b")
        if signal is None or not pick.any():
            continue
        here, reach = at_s[pick], crossings.reach_s[pick]
        low, low_slope, low_known = signal.at(here - reach)
        mid, mid_slope, mid_known = signal.at(here)
        high, high_slope, high_known = signal.at(here + reach)
        temp[pick] = mid + lag_s * mid_slope
        rate[pick] = (high - low + lag_s * (high_slope - low_slope)) / (2.0 * reach)
        noise = signal.value_sigma**2 + (lag_s * signal.slope_sigma) ** 2
        variance[pick] = noise + (crossings.time_sigma_s[pick] * mid_slope) ** 2 + 1e-6
        known[pick] = low_known & mid_known & high_known
    return _Wire(temp, rate, variance, known)


def refine(crossings: Crossings, picture: LogPicture, *, start_s: float, prior: Belief, lag_s: float) -> Belief | None:
    """Return the belief about offset and drift for a given lag, from a start near the answer.

    ``None`` where fewer than a handful of passings fall on known temperatures.
    """
    point = np.array([start_s, prior.mean[1]])
    best: Belief | None = None
    for _ in range(10):
        wire = _wire(crossings, picture, float(point[0]), float(point[1]), lag_s)
        if np.count_nonzero(wire.known) < _FEWEST:
            return None
        best = _mixed(_linear(crossings, wire, point, prior))
        move = best.mean - point
        point = point + np.clip(move, [-5.0, -3e-4], [5.0, 3e-4])
        if abs(move[0]) < 2e-3 and abs(move[1]) < 1e-6:
            break
    return best


def scan(
    crossings: Crossings, picture: LogPicture, *, offset_s: NDArray[np.float64], lag_s: float
) -> NDArray[np.float64]:
    """Return the logarithm of the evidence at some offsets, each held fixed; minus infinity where nothing is known."""
    evidence = np.full(len(offset_s), -np.inf)
    for index, value in enumerate(offset_s):
        wire = _wire(crossings, picture, float(value), 0.0, lag_s)
        if np.count_nonzero(wire.known) < _FEWEST:
            continue
        point = np.array([float(value), 0.0])
        held = Belief(point, np.diag([1e-4, (DRIFT_SIGMA_PPM * PPM) ** 2]), 0.0)
        evidence[index] = _mixed(_linear(crossings, wire, point, held, every=2)).log_weight
    return evidence


def _linear(
    crossings: Crossings, wire: _Wire, point: NDArray[np.float64], prior: Belief, *, every: int = 1
) -> list[Belief]:
    """Solve with the temperatures taken as straight lines around a point, once for each scatter."""
    keep = wire.known
    rate = wire.rate_c_s[keep]
    jacobian = np.stack([rate, rate * (crossings.time_s[keep] - crossings.middle_s)], axis=1)
    # y + J (p - point) = curve + scatter, seen as data d = y - J point with design -J.
    data = wire.temp_c[keep] - jacobian @ point - 50.0
    precision = np.linalg.inv(prior.covariance)
    # One passing of each level goes into the unknown curve: it says nothing about the clock, whatever its rate.
    share = 1.0 - 1.0 / crossings.shared[keep]
    density = float((share * np.log(np.maximum(np.abs(rate), 1e-3))).sum())
    common = crossings.common_c2[np.ix_(keep, keep)] + np.diag(wire.variance[keep])
    scatter = crossings.scatter[np.ix_(keep, keep)]
    parts: list[Belief] = []
    for scatter_c in SCATTERS_C[::every]:
        factor = cho_factor(common + scatter_c**2 * scatter, lower=True)
        solved = cho_solve(factor, np.column_stack([jacobian, data]))
        information = jacobian.T @ solved[:, :2] + precision
        mean = np.linalg.solve(information, precision @ prior.mean - jacobian.T @ solved[:, 2])
        residual = data + jacobian @ mean
        deviation = mean - prior.mean
        fit = float(residual @ cho_solve(factor, residual) + deviation @ precision @ deviation)
        log_det = len(data) * float(np.log(2.0 * np.pi)) + 2.0 * float(np.log(np.diag(factor[0])).sum())
        log_det += float(np.linalg.slogdet(information)[1] - np.linalg.slogdet(precision)[1])
        belief_in_scatter = float(np.log(scatter_c) - np.log1p((scatter_c / _TYPICAL_SCATTER_C) ** 2))
        parts.append(Belief(mean, np.linalg.inv(information), density + belief_in_scatter - 0.5 * (fit + log_det)))
    return parts


def _mixed(parts: Sequence[Belief]) -> Belief:
    """Return one Gaussian with the mean and covariance of a weighted mixture."""
    evidence = np.array([part.log_weight for part in parts])
    weight = np.exp(evidence - evidence.max())
    total = float(weight.sum())
    weight /= total
    mean = sum((w * part.mean for w, part in zip(weight, parts, strict=True)), np.zeros(2))
    covariance = np.zeros((2, 2))
    for w, part in zip(weight, parts, strict=True):
        away = part.mean - mean
        covariance += w * (part.covariance + np.outer(away, away))
    return Belief(mean, covariance, float(evidence.max() + np.log(total)))
