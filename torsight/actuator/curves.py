"""Least squares of one curve, with priors and intervals that count a residual's correlation.

What the characterisation of a spring needs at every step: values carried over from an earlier step enter with their
uncertainty, so that it reaches what is fitted here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from torsight.actuator.weights import correlation_rows
from torsight.core.errors import NoResultError
from torsight.core.parameter import Estimate, Parameter

Array = NDArray[np.float64]
Model = Callable[[Mapping[str, float]], Array]

_ROUNDS = 4


@dataclass(frozen=True, slots=True, eq=False)
class CurveFit:
    """A fitted curve.

    Attributes
    ----------
    values : mapping of str to float
        Best values.
    estimates : mapping of str to Estimate
        With sigmas and 95 % intervals.
    names : tuple of str
        Order of ``covariance``.
    covariance : (p, p) float64
        Of the values.
    fitted, residual : (n,) float64
        Curve, and measured less curve.
    rmse, r2 : float
        In the unit of the measured values, and the share of their variance that is explained.
    """

    values: Mapping[str, float]
    estimates: Mapping[str, Estimate]
    names: tuple[str, ...]
    covariance: Array
    fitted: Array
    residual: Array
    rmse: float
    r2: float


def fit_curve(
    model: Model,
    parameters: Sequence[Parameter],
    measured: Array,
    *,
    parts: Sequence[slice] = (),
    what: str = "curve",
) -> CurveFit:
    """Fit parameters to a measured curve; a parameter's ``sigma`` makes its value a prior.

    Parameters
    ----------
    model : callable
        From values by name to the curve (n,).
    parameters : sequence of Parameter
        Start values, bounds and priors.
    measured : (n,) float64
        What was measured.
    parts : sequence of slice
        Stretches that were recorded in one go, for the residual's correlation; the whole by default.
    what : str
        Name of the curve in messages.

    Raises
    ------
    NoResultError
        When the fit does not come to an end.
    """
    from scipy.optimize import least_squares

    names = tuple(parameter.name for parameter in parameters)
    start = np.array([parameter.value for parameter in parameters])
    scale = np.array([parameter.sigma or max(abs(parameter.value), 1e-3) * 0.1 for parameter in parameters])
    prior = np.array(
        [
            0.0 if parameter.sigma is None else s / parameter.sigma
            for parameter, s in zip(parameters, scale, strict=True)
        ]
    )
    lower = np.array([(p.lower - p.value) / s for p, s in zip(parameters, scale, strict=True)])
    upper = np.array([(p.upper - p.value) / s for p, s in zip(parameters, scale, strict=True)])

    def curve(u: Array) -> Array:
        return model(dict(zip(names, (start + scale * u).tolist(), strict=True)))

    def misfit(u: Array, spread: float) -> Array:
        return np.concatenate([(curve(u) - measured) / spread, prior * u])

    u = np.zeros(len(names))
    spread = float(np.std(measured)) or 1.0
    status = 0
    for _ in range(_ROUNDS):
        found = least_squares(misfit, u, bounds=(lower, upper), args=(spread,), diff_step=np.array(1e-4), max_nfev=200)
        u, status = found.x, found.status
        residual = measured - curve(u)
        rows = max(correlation_rows(residual[part]) for part in (parts or (slice(None),)))
        freedom = max(1, len(measured) - len(names))
        spread = float(np.sqrt(np.sum(residual**2) / freedom * rows)) or 1e-12
    if status <= 0:
        raise NoResultError("the fit does not come to an end", where=what, do="check the test's log and its range")
    step = 1e-4
    jacobian = np.stack(
        [(misfit(u + step * e, spread) - misfit(u - step * e, spread)) / (2 * step) for e in np.eye(len(u))], axis=1
    )
    inverse = np.linalg.pinv(jacobian.T @ jacobian, hermitian=True)
    covariance = np.asarray(inverse * np.outer(scale, scale), np.float64)
    values = dict(zip(names, (start + scale * u).tolist(), strict=True))
    total = float(np.sum((measured - measured.mean()) ** 2))
    return CurveFit(
        values=values,
        estimates=estimates_of(parameters, values, covariance),
        names=names,
        covariance=covariance,
        fitted=measured - residual,
        residual=residual,
        rmse=float(np.sqrt(np.mean(residual**2))),
        r2=1.0 - float(np.sum(residual**2)) / total if total > 0.0 else float("nan"),
    )


def estimates_of(
    parameters: Sequence[Parameter], values: Mapping[str, float], covariance: Array
) -> dict[str, Estimate]:
    """Return values with sigmas and 95 % intervals."""
    made = {}
    for number, parameter in enumerate(parameters):
        value, sigma = values[parameter.name], float(np.sqrt(max(0.0, covariance[number, number])))
        made[parameter.name] = Estimate(value, sigma, (value - 1.96 * sigma, value + 1.96 * sigma), parameter.unit)
    return made


def share_explained(measured: Array, fitted: Array) -> float:
    """Return R², 1 less the residual's share of the variance."""
    total = float(np.sum((measured - measured.mean()) ** 2))
    return 1.0 - float(np.sum((measured - fitted) ** 2)) / total if total > 0.0 else float("nan")
