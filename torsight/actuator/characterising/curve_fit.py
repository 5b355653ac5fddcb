"""Least squares of one curve, with priors, and intervals that account for the residual's correlation.

Every step of the characterisation of a spring uses it. Estimates of an earlier step enter as priors, so that their
uncertainty propagates to the parameters that are fitted here.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from torsight.core.errors import NoResultError
from torsight.core.frozen import Frozen
from torsight.core.parameter import REACH, Estimate, Parameter
from torsight.core.series import correlation_time, rms, share_explained
from torsight.core.units import Floats

Model = Callable[[Mapping[str, float]], Floats]


@dataclass(frozen=True, slots=True, eq=False)
class CurveFit(Frozen):
    """A fitted curve: best values, estimates with 95 % intervals, and the covariance (p, p) in the order of ``names``.

    ``fitted`` is the curve (n,), ``rmse`` in the unit of the measured values, ``r2`` the explained share of their
    variance.
    """

    values: Mapping[str, float]
    estimates: Mapping[str, Estimate]
    names: tuple[str, ...]
    covariance: Floats
    fitted: Floats
    rmse: float
    r2: float


def fit_curve(
    model: Model,
    parameters: Sequence[Parameter],
    measured: Floats,
    *,
    parts: Sequence[slice] = (),
    profiled: Sequence[str] = (),
    what: str = "curve",
) -> CurveFit:
    """Fit parameters to a measured curve (n,); a parameter's ``sigma`` makes its value a prior.

    Each of the ``parts`` is one recording, with its own scatter and correlation. The intervals of ``profiled``
    parameters, in which the curve is strongly nonlinear, are 95 % profile-likelihood intervals; those of the other
    parameters follow from the curvature. ``what`` is the curve's name in messages.
    """
    from scipy.optimize import least_squares

    scale = np.array([parameter.sigma or max(abs(parameter.value), 1e-3) * 0.1 for parameter in parameters])
    names, begin = tuple(p.name for p in parameters), np.array([p.value for p in parameters])
    lower, upper = (np.array([(p.lower, p.upper) for p in parameters]).T - begin) / scale
    prior = scale / np.array([math.inf if p.sigma is None else p.sigma for p in parameters])

    def values_at(u: Floats) -> dict[str, float]:
        return dict(zip(names, (begin + scale * u).tolist(), strict=True))

    u = np.zeros(len(names))
    spread = np.full(len(measured), float(np.std(measured)) or 1.0)

    def curve(u: Floats) -> Floats:
        return model(values_at(u))

    def misfit(u: Floats) -> Floats:
        return np.concatenate([(curve(u) - measured) / spread, prior * u])

    status = 0
    # Each fit has the residual scatter and correlation of the fit before. On the paper's logs (``torsight paper``) the
    # values after half as many are within 0.01 standard deviations of these, after twice as many within 2e-5.
    for _ in range(4):
        found = least_squares(misfit, u, jac="3-point", bounds=(lower, upper), max_nfev=200)
        u, status = found.x, found.status
        residual = measured - curve(u)
        # The degrees of freedom that the parameters take up are shared by all parts in proportion to their rows.
        taken = len(measured) / max(1, len(measured) - len(names))
        for part in parts or (slice(None),):
            rows = correlation_time([residual[part]])
            spread[part] = float(np.sqrt(np.mean(residual[part] ** 2) * taken * rows)) or 1e-12
    if status <= 0:
        raise NoResultError("the fit does not converge", where=what, do="check the test's log and its range")
    # A single evaluation: the slopes at the best values, in units of the last scatter.
    jacobian = np.asarray(least_squares(misfit, u, jac="3-point", bounds=(lower, upper), max_nfev=1).jac)
    inverse = np.linalg.pinv(jacobian.T @ jacobian, hermitian=True)
    covariance = np.asarray(inverse * np.outer(scale, scale), np.float64)
    values = values_at(u)
    sigmas = np.sqrt(np.maximum(np.diag(covariance), 0.0)).tolist()
    estimates = {p.name: Estimate.normal(values[p.name], s, p.unit) for p, s in zip(parameters, sigmas, strict=True)}
    for name in profiled:
        number = names.index(name)
        centre, size = parameters[number].value, float(scale[number])
        low, high = (
            centre + size * _profile_end(misfit, u, number, way * sigmas[number] / size, (lower, upper))
            for way in (-1.0, 1.0)
        )
        estimates[name] = Estimate(values[name], (high - low) / (2.0 * REACH), (low, high), parameters[number].unit)
    return CurveFit(
        values=values,
        estimates=estimates,
        names=names,
        covariance=covariance,
        fitted=measured - residual,
        rmse=rms(residual),
        r2=share_explained(measured, measured - residual),
    )


def _profile_end(
    misfit: Callable[[Floats], Floats], best: Floats, number: int, step: float, bounds: tuple[Floats, Floats]
) -> float:
    """Return the end of a parameter's profile-likelihood interval: cost 1.96² above the least, or the bound."""
    from scipy.optimize import brentq, least_squares

    lower, upper = bounds
    others = np.arange(len(best)) != number
    least = float(np.sum(misfit(best) ** 2))
    found_at = [(float(best[number]), best[others])]

    def excess(place: float) -> float:
        def part(free: Floats) -> Floats:
            whole = best.copy()
            whole[others], whole[number] = free, place
            return misfit(whole)

        # Start from the optimum of the others at the nearest value tried so far.
        guess = min(found_at, key=lambda item: abs(item[0] - place))[1]
        inside = np.clip(guess, lower[others] + 1e-9, upper[others] - 1e-9)
        found = least_squares(part, inside, jac="3-point", bounds=(lower[others], upper[others]), max_nfev=30)
        found_at.append((place, found.x))
        return 2.0 * float(found.cost) - least - REACH**2

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
    else:
        return far
    return float(brentq(excess, near, far, xtol=1e-3 * abs(step)))
