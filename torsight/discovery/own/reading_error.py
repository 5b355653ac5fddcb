"""Drivers that contain the reading error of an output: they would explain the noise, and with it any missing effect.

Two tests distinguish such a driver from a cause. First, it follows the *measured* output: one function of that output
fits the driver better than a function of the prediction alone or of the residual alone, and as well as functions of all
three (a cause of the missing effect follows the residual, an input of the model follows the prediction). Second, the
changes of the driver from row to row are correlated with those of the residual; where these are noise, no other
variable's are (Haugh, JASA 71, 1976).

A filter of the measured output lags behind it, as does a state on which the output acts. Filters are therefore sought
separately, over a window of previous rows, with the same two tests.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from statistics import NormalDist
from typing import Final, Literal, NamedTuple

import numpy as np
from scipy.interpolate import BSpline
from scipy.ndimage import gaussian_filter1d, uniform_filter1d
from scipy.optimize import minimize_scalar

from torsight.core.series import ORDER, correlation_time
from torsight.core.units import Flags, Floats
from torsight.discovery.inference.fitting import Fit
from torsight.discovery.own.model.evaluate import call
from torsight.discovery.own.model.problem import ModelProblem
from torsight.discovery.own.model.signals import left_beside
from torsight.discovery.own.own_records import Record
from torsight.discovery.settings import Settings

Pieces = Sequence[Floats]

_PARTS: Final = 8
"""Cubic pieces of the spline that is a function of the output: a law's free forms bend less often."""
_SURE: Final = NormalDist().inv_cdf(1.0 - 1e-3)
"""Threshold for a slope in its standard deviations: that of unrelated signals exceeds it once in a thousand times."""
_WINDOW: Final = 8
"""Number of previous rows in which a filter is sought, among the readings and in the driver's own past, which shows
what the filter retains for longer. With 6 rows and more no further filters are detected and no cause is mistaken for
one; each further row needs a longer record (benchmarks/discovery/readings.py)."""
_SURE_OF_ANY: Final = NormalDist().inv_cdf(1.0 - 0.5e-3 / (_WINDOW + 1))
"""Threshold, in standard deviations, that the largest of ``_WINDOW`` + 1 correlations exceeds by chance once in a
thousand times."""
_FORM_SHARE: Final = Settings().form_share
"""Share that readings must explain of what prediction and residual, as separate columns, explain beyond the prediction:
a filter that is longer than the window leaves a part unexplained."""


@dataclass(frozen=True, slots=True)
class _Smoothing:
    """A smoothing by which a column may have been computed from another one: a moving average or a Gaussian filter.

    ``width`` is in rows: the half-width of the average, or the standard deviation of the Gaussian; 0 leaves a column
    unchanged. Both are symmetric. A filter that lags, as instruments do, looks the same as a state on which the output
    acts, and such a state may well be a cause of the missing effect.
    """

    kind: Literal["mean", "bell"] = "mean"
    width: float = 0.0

    @property
    def reach(self) -> int:
        """Number of rows at each end of a record whose smoothing depends on rows outside of the record."""
        # SciPy truncates a Gaussian filter at four standard deviations.
        return math.ceil(self.width if self.kind == "mean" else 4 * self.width)

    def __call__(self, values: Floats) -> Floats:
        if not self.width:
            return values
        if self.kind == "mean":
            return np.asarray(uniform_filter1d(values, 2 * round(self.width) + 1, mode="nearest"))
        return np.asarray(gaussian_filter1d(values, self.width, mode="nearest"))

    def inner(self, rows: int) -> Flags:
        """Return which rows (rows,) are computed from rows of the record alone."""
        own = np.arange(rows)
        return (own >= self.reach) & (own < rows - self.reach)


def holds_reading_error(driver: Pieces, predicted: Pieces, residual: Pieces) -> bool:
    """Return whether a driver is computed from the measured output, reading noise included.

    Each argument holds an array (rows,) per record: the driver, the prediction of the output, and the residual, NaN
    where nothing was measured.
    """
    known = [np.isfinite(one) for one in residual]
    left = [np.where(has, one, 0.0) for has, one in zip(known, residual, strict=True)]
    read = [a + b for a, b in zip(predicted, left, strict=True)]
    values, ends = np.concatenate(list(driver)), np.cumsum([len(one) for one in driver])[:-1]
    smallest = np.finfo(float).eps * float(np.var(values))
    if sum(map(np.sum, known)) < 8 * _PARTS or smallest <= 0.0:
        return False

    def left_beside_functions(smoothing: _Smoothing, *signals: Pieces) -> tuple[float, Floats]:
        """Return the mean square that functions of smoothed signals leave of the driver, and the rest (n,) itself."""
        rows = np.concatenate([has & smoothing.inner(len(has)) for has in known])
        if not rows.any():
            return math.inf, np.full(len(values), np.nan)
        smooth = (np.concatenate([smoothing(one) for one in signal]) for signal in signals)
        columns = np.hstack([_functions(one, rows) for one in smooth])[rows]
        remains = np.full(len(values), np.nan)
        remains[rows] = values[rows] - columns @ np.linalg.lstsq(columns, values[rows])[0]
        return float(np.mean(remains[rows] ** 2)), remains

    @cache
    def left_by(smoothing: _Smoothing) -> float:
        return left_beside_functions(smoothing, read)[0]

    nearest = _nearest(left_by, max(map(len, driver)))
    by_read, remains = left_beside_functions(nearest, read)
    alone = [left_beside_functions(nearest, *signals)[0] for signals in ((predicted,), (left,), (predicted, left))]
    by_read, by_one, by_both = by_read + smallest, min(alone[:2]) + smallest, alone[2] + smallest
    used = np.isfinite(remains)
    count = used.sum() / correlation_time([one[np.isfinite(one)] for one in np.split(remains, ends)])
    # Of as many coefficients, in twice the log likelihood.
    price = _PARTS * math.log(max(count, math.e))
    if count * math.log(by_one / by_read) < price or count * math.log(by_read / by_both) > price:
        return False
    return _go_together(driver, [a - b for a, b in zip(driver, np.split(remains, ends), strict=True)])


def follows_readings(driver: Pieces, predicted: Pieces, residual: Pieces) -> bool:
    """Return whether a driver is computed from readings of the same row and of previous rows, noise included.

    Such a driver is a filter, a mean over previous rows, or a previous row. It follows the output, as does a state on
    which the output acts, but such a state does not contain the reading noise. Three conditions have to hold. Beside
    the driver's own past, readings explain it better than the prediction does, and hardly less than prediction and
    residual as separate columns. The driver explains part of the residual. The driver's innovations are correlated with
    the residual's innovations in one of these rows. Arguments as in :func:`holds_reading_error`.
    """
    size = float(np.std(np.concatenate(list(driver))))
    three = zip(driver, predicted, residual, strict=True)
    pieces = [_Window.of(d / size, m, r) for d, m, r in three if size > 0.0 and len(d) > 4 * _WINDOW]
    if not pieces:
        return False
    at = _Window(*(np.concatenate(some) for some in zip(*pieces, strict=True)))
    count, price = len(at.driver), (_WINDOW + 1) * math.log(max(len(at.driver), 2))
    if count <= 3 * (_WINDOW + 1):  # as many coefficients could fit anything
        return False
    new, *others = (
        left_beside(np.hstack([at.past, *columns]), at.driver)
        for columns in ([at.predicted], [at.predicted + at.residual], [at.predicted, at.residual])
    )
    by_model, by_read, by_both = (float(np.mean(one**2)) + np.finfo(float).eps for one in (new, *others))
    if count * math.log(by_model / by_read) < price or by_model - by_read < _FORM_SHARE * (by_model - by_both):
        return False
    now, left = at.predicted[:, :1], at.residual[:, 0]
    alone, beside = (left_beside(columns, left) for columns in (now, np.column_stack([now, at.driver])))
    independent = count / correlation_time([left])
    if independent * math.log(np.mean(alone**2) / np.mean(beside**2)) < math.log(independent):
        return False
    # By ranks: a jump of the record is no noise, and its few rows would dominate the correlation.
    one, other = _ranks(new), _ranks(at.new)
    together = one @ other / np.sqrt((one @ one) * np.sum(other**2, axis=0))
    return bool(np.max(np.abs(together)) * math.sqrt(count) > _SURE_OF_ANY)


class _Window(NamedTuple):
    """Rows with previous ones: a driver (n,); its past, prediction, residual, and the residual's innovations (n, k)."""

    driver: Floats
    past: Floats
    predicted: Floats
    residual: Floats
    new: Floats

    @staticmethod
    def of(driver: Floats, predicted: Floats, residual: Floats) -> _Window:
        """Return the rows whose previous rows are all known."""
        before, past = np.arange(_WINDOW + 1), np.arange(1, _WINDOW + 1)
        own = np.arange(_WINDOW, len(driver))[:, None]
        columns, new = residual[own - past], np.full(len(driver), np.nan)
        known = np.isfinite(columns).all(axis=1) & np.isfinite(residual[own[:, 0]])
        if np.sum(known) > 2 * _WINDOW:
            new[own[known, 0]] = left_beside(columns[known], residual[own[known, 0]])
        rows = np.arange(2 * _WINDOW, len(driver))[:, None]
        rows = rows[np.isfinite(new[rows - before]).all(axis=1)]
        return _Window(
            driver[rows[:, 0]], driver[rows - past], *(one[rows - before] for one in (predicted, residual, new))
        )


def _ranks(values: Floats) -> Floats:
    """Return the ranks along the first axis, about their mean."""
    ranks = np.argsort(np.argsort(values, axis=0), axis=0)
    return np.asarray(ranks - 0.5 * (len(values) - 1), np.float64)


def _nearest(left_by: Callable[[_Smoothing], float], rows: int) -> _Smoothing:
    """Return the smoothing with the smallest residual, out of the best width of each kind and none."""
    widths = [2.0 ** (k / 2) for k in range(int(2 * math.log2(max(rows / 16, 1))) + 1)]
    mean, bell = (min((_Smoothing(kind, width) for width in widths), key=left_by) for kind in ("mean", "bell"))
    means = [_Smoothing("mean", k) for k in range(max(round(mean.width / 2**0.5), 1), round(mean.width * 2**0.5) + 1)]
    fine = minimize_scalar(
        lambda width: left_by(_Smoothing("bell", width)),
        bounds=(bell.width / 2**0.5, bell.width * 2**0.5),
        method="bounded",
    )
    return min([_Smoothing(), *means, _Smoothing("bell", float(fine.x))], key=left_by)


def _go_together(driver: Pieces, function: Pieces) -> bool:
    """Return whether a driver's changes from row to row are those of the function: the fast part of a record is noise.

    Subtracting the function must reduce these changes (a slope above one half), and significantly so.
    """
    pairs = [(np.diff(a, ORDER), np.diff(b, ORDER)) for a, b in zip(driver, function, strict=True)]
    one, other = (np.concatenate(some) for some in zip(*pairs, strict=True))
    rows = np.isfinite(other)
    one, other = one[rows], other[rows]
    square = float(other @ other)
    if square <= 0.0:
        return False
    slope = float(one @ other) / square
    # Each difference shares rows with its neighbours, as many as its order.
    spread = math.sqrt(float(np.mean((one - slope * other) ** 2)) * (ORDER + 1) / square)
    return slope > 0.5 and slope > _SURE * spread


def without_readings(problem: ModelProblem, base: Fit) -> tuple[ModelProblem, list[str]]:
    """Return a problem without the drivers that contain an output's reading error, and notes on such columns.

    ``base`` is the fit of the plain model. A declared law over such a column is not removed, only reported.
    """
    predicted = problem.layout.native(base.solution.prediction)
    records = problem.model.records
    declared = {port.driver for port in problem.ports} - {*problem.drivers, *problem.model.outputs}
    notes, kept = [], dict(problem.drivers)
    for name in (*problem.drivers, *sorted(declared)):
        if not all(name in record and np.isfinite(record[name]).all() for record in records):
            continue
        output = _source_of([record[name] for record in records], problem, predicted)
        if output is None:
            continue
        left_out = kept.pop(name, None) is not None
        laws = laws_called_with(problem, base.values, name)
        if not (left_out or laws):
            continue
        out = "it was left out of the drivers, because it" if left_out else "it"
        beside = "".join(f"; the law '{law}' over it explains noise, too" for law in laws)
        notes.append(
            f"'{name}' is computed from '{output}' as it was read, noise included: {out} would explain the residual on "
            f"its own{beside}; give what the model computes, or the variable from another sensor"
        )
    return replace(problem, drivers=kept), notes


def _source_of(column: Pieces, problem: ModelProblem, predicted: Pieces) -> str | None:
    """Return the output from whose readings a column is computed, None where there is none."""
    for k, name in enumerate(problem.model.outputs):
        modelled = [one[:, k] for one in predicted]
        left = [one[:, k] - own for one, own in zip(problem.measured(), modelled, strict=True)]
        if holds_reading_error(column, modelled, left) or follows_readings(column, modelled, left):
            return name
    return None


def laws_called_with(problem: ModelProblem, values: Mapping[str, float], column: str) -> list[str]:
    """Return the laws that the model calls with a column's value of the same row, or of a later one.

    A law may depend on previous rows, and on how a record begins: so only the last row's value is changed.
    """
    found = []
    for k, own in enumerate(problem.given(values, ()) if problem.ports else ()):
        record = problem.model.records[k]
        asked = call(problem.model, k, own, {}).asked
        # Beyond all other rows.
        for side in (-10.0, 10.0):
            moved = record[column].copy()
            moved[-1] = np.nanmean(moved) + side * np.ptp(moved[np.isfinite(moved)])
            model = replace(problem.model, records=(Record({**record, column: moved}, record.label_),))
            now = call(model, 0, own, {}).asked
            found += [name for name in asked if now[name] != asked[name]]
    return list(dict.fromkeys(found))


def _functions(values: Floats, rows: Flags) -> Floats:
    """Return smooth functions (n, k) of a signal (n,): cubic splines whose pieces hold equally many of the rows."""
    known = np.sort(values[rows])
    # Quantiles, each once; NumPy's own functions for both take as long as all the rest.
    inner = np.interp(np.linspace(0.0, len(known) - 1.0, _PARTS + 1), np.arange(len(known)), known)
    inner = inner[np.diff(inner, prepend=-np.inf) > 0.0]
    if len(inner) < 2:
        return np.ones((len(values), 1))
    places = np.concatenate([[inner[0]] * 3, inner, [inner[-1]] * 3])
    at = np.clip(values, inner[0], inner[-1])
    return np.asarray(BSpline.construct_fast(places, np.eye(len(places) - 4), 3)(at))
