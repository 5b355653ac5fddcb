"""Least squares of one curve, with priors and intervals that count a residual's correlation.

What the characterisation of a spring needs at every step: values carried over from an earlier step enter with their
uncertainty, so that it reaches what is fitted here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from torsight.actuator.record.weights import correlation_rows
from torsight.core.errors import NoResultError
from torsight.core.frozen import Frozen
from torsight.core.parameter import Estimate, Parameter

Array = NDArray[np.float64]
Model = Callable[[Mapping[str, float]], Array]

_ROUNDS: Final = 4
_REACH: Final = 1.96


@dataclass(frozen=True, slots=True, eq=False)
class CurveFit(Frozen):
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
    profiled: Sequence[str] = (),
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
        Stretches that were recorded in one go, each with a scatter and a correlation of its own; the whole by default.
    profiled : sequence of str
        Parameters whose interval is taken where the best of all others costs 95 %'s worth more, not from the curvature:
        for those in which the curve is far from linear.
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

    def misfit(u: Array, spread: Array) -> Array:
        return np.concatenate([(curve(u) - measured) / spread, prior * u])

    u = np.zeros(len(names))
    spread = np.full(len(measured), float(np.std(measured)) or 1.0)
    status = 0
    for _ in range(_ROUNDS):
        found = least_squares(misfit, u, bounds=(lower, upper), args=(spread,), diff_step=np.array(1e-4), max_nfev=200)
        u, status = found.x, found.status
        residual = measured - curve(u)
        # Parameters take their share of freedom from every part alike.
        taken = len(measured) / max(1, len(measured) - len(names))
        for part in parts or (slice(None),):
            rows = correlation_rows(residual[part])
            spread[part] = float(np.sqrt(np.mean(residual[part] ** 2) * taken * rows)) or 1e-12
    if status <= 0:
        raise NoResultError("the fit does not come to an end", where=what, do="check the test's log and its range")
    step = 1e-4
    jacobian = np.stack(
        [(misfit(u + step * e, spread) - misfit(u - step * e, spread)) / (2 * step) for e in np.eye(len(u))], axis=1
    )
    inverse = np.linalg.pinv(jacobian.T @ jacobian, hermitian=True)
    covariance = np.asarray(inverse * np.outer(scale, scale), np.float64)
    values = dict(zip(names, (start + scale * u).tolist(), strict=True))
    estimates = estimates_of(parameters, values, covariance)
    for name in profiled:
        number = names.index(name)
        sigma_u = float(np.sqrt(covariance[number, number])) / float(scale[number])
        ends = [
            float(
                start[number]
                + scale[number] * _profile_end(lambda v: misfit(v, spread), u, number, way * sigma_u, (lower, upper))
            )
            for way in (-1.0, 1.0)
        ]
        estimates[name] = Estimate(
            values[name], (ends[1] - ends[0]) / (2.0 * _REACH), (ends[0], ends[1]), estimates[name].unit
        )
    total = float(np.sum((measured - measured.mean()) ** 2))
    return CurveFit(
        values=values,
        estimates=estimates,
        names=names,
        covariance=covariance,
        fitted=measured - residual,
        residual=residual,
        rmse=float(np.sqrt(np.mean(residual**2))),
        r2=1.0 - float(np.sum(residual**2)) / total if total > 0.0 else float("nan"),
    )


def _profile_end(
    misfit: Callable[[Array], Array], best: Array, number: int, step: float, bounds: tuple[Array, Array]
) -> float:
    """Return where one parameter, all others at their best for it, costs 1.96² more than the best (or its bound)."""
    from scipy.optimize import least_squares

    lower, upper = bounds
    others = np.arange(len(best)) != number
    least = float(np.sum(misfit(best) ** 2))
    found_at = [(float(best[number]), best[others])]

    def excess(place: float) -> float:
        def part(free: Array) -> Array:
            whole = best.copy()
            whole[others], whole[number] = free, place
            return misfit(whole)

        # From the best for the nearest place that was tried.
        guess = min(found_at, key=lambda item: abs(item[0] - place))[1]
        inside = np.clip(guess, lower[others] + 1e-9, upper[others] - 1e-9)
        found = least_squares(
            part, inside, bounds=(lower[others], upper[others]), diff_step=np.array(1e-4), max_nfev=30
        )
        found_at.append((place, found.x))
        return 2.0 * float(found.cost) - least - _REACH**2

    near, far = float(best[number]), float(best[number]) + step
    limit = float(upper[number] if step > 0.0 else lower[number])
    for _ in range(8):
        if (far - limit) * step >= 0.0:
            far = limit
        if excess(far) >= 0.0:
            break
        if far == limit:
            return limit
        near, far = far, far + 1.5 * (far - near)
    for _ in range(8):
        middle = 0.5 * (near + far)
        near, far = (middle, far) if excess(middle) < 0.0 else (near, middle)
    return 0.5 * (near + far)


def estimates_of(
    parameters: Sequence[Parameter], values: Mapping[str, float], covariance: Array
) -> dict[str, Estimate]:
    """Return values with sigmas and 95 % intervals."""
    made = {}
    for number, parameter in enumerate(parameters):
        value, sigma = values[parameter.name], float(np.sqrt(max(0.0, covariance[number, number])))
        made[parameter.name] = Estimate(value, sigma, (value - _REACH * sigma, value + _REACH * sigma), parameter.unit)
    return made


def share_explained(measured: Array, fitted: Array) -> float:
    """Return R², 1 less the residual's share of the variance."""
    total = float(np.sum((measured - measured.mean()) ** 2))
    return 1.0 - float(np.sum((measured - fitted) ** 2)) / total if total > 0.0 else float("nan")
