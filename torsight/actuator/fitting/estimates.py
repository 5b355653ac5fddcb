"""What a fit says of every parameter: its value, sigma and interval, and whether the record says anything of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from torsight.actuator.fitting.fit_problem import Problem
from torsight.actuator.model import ActuatorModel
from torsight.core.parameter import Estimate, Parameter

if TYPE_CHECKING:
    from torsight.actuator.effects import Derived

Array = NDArray[np.float64]

_SILENT: Final = 0.9
"""Share of a prior's standard deviation that is left where the record has said nothing of a value: less than a fifth of
all information about it is the record's."""


def covariance_of(problem: Problem, u: Array, weight: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Return the covariance (p, p) of the free parameters, and which of them record or prior say anything about."""
    jacobian = problem.jacobian(u, weight)
    information = jacobian.T @ jacobian
    known = np.diag(information) > 1e-9
    inverse = np.zeros_like(information)
    if known.any():
        inverse[np.ix_(known, known)] = np.linalg.pinv(information[np.ix_(known, known)], hermitian=True)
    return inverse * np.outer(problem.scale, problem.scale), known


def quiet(parameters: Sequence[Parameter], sigma: Array) -> tuple[str, ...]:
    """Return the names of the parameters about which the record says nothing that was not known.

    ``sigma`` (p,) holds their standard deviations, NaN where neither record nor prior says anything.
    """
    return tuple(
        parameter.name
        for parameter, own in zip(parameters, sigma.tolist(), strict=True)
        if np.isnan(own) or (parameter.sigma is not None and own > _SILENT * parameter.sigma)
    )


def estimates_of(
    model: ActuatorModel, values: Mapping[str, float], problem: Problem, covariance: Array, known: NDArray[np.bool_]
) -> dict[str, Estimate]:
    """Return every parameter's estimate by name, the exact ones too, and what effects derive from theirs."""
    place = {name: number for number, name in enumerate(problem.names)}
    made = {}
    for parameter in model.all_parameters:
        value = values[parameter.name]
        number = place.get(parameter.name)
        if number is None:
            made[parameter.name] = Estimate(value, 0.0, (value, value), parameter.unit, fixed=True)
            continue
        lower, upper, unit = parameter.lower, parameter.upper, parameter.unit
        if not known[number]:
            made[parameter.name] = Estimate(value, float("nan"), (lower, upper), unit)
            continue
        sigma = float(np.sqrt(covariance[number, number]))
        made[parameter.name] = Estimate.normal(value, sigma, unit, lower=lower, upper=upper)
    for effect in model.chosen:
        for derived in effect.derived:
            made[derived.name] = _derived(derived, values, problem, covariance)
    return made


def _derived(derived: Derived, values: Mapping[str, float], problem: Problem, covariance: Array) -> Estimate:
    """Return a value for people with the sigma that the fitted ones give it (first order)."""
    value = derived.value(values)
    slopes = []
    for name, scale in zip(problem.names, problem.scale, strict=True):
        step = 1e-4 * float(scale)
        change = derived.value({**values, name: values[name] + step}) - value
        if derived.period is not None:
            change = (change + 0.5 * derived.period) % derived.period - 0.5 * derived.period
        slopes.append(change / step)
    gradient = np.array(slopes)
    sigma = float(np.sqrt(max(0.0, gradient @ covariance @ gradient)))
    if derived.period is not None:
        sigma = min(sigma, 0.5 * derived.period)
    return Estimate.normal(value, sigma, derived.unit)


def share_explained(measured: Array, fitted: Array) -> float:
    """Return R², 1 less the residual's share of the variance."""
    total = float(np.sum((measured - measured.mean()) ** 2))
    return 1.0 - float(np.sum((measured - fitted) ** 2)) / total if total > 0.0 else float("nan")
