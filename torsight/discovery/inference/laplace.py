"""The evidence of a fitted set by Laplace's method, and what the linear model at a fit predicts for its optimum."""

from __future__ import annotations

from typing import Final

import numpy as np

from torsight.core.units import Floats
from torsight.discovery.inference.fitting import Fit, Fitter
from torsight.discovery.inference.likelihood import Likelihood
from torsight.discovery.inference.priors import outlier_precision, prior_cost_of
from torsight.discovery.inference.solver import Space, full_step
from torsight.discovery.interface import Problem

_LITTLE: Final = 1e-6
"""Information about a free value, in one over its scale squared."""


def log_evidence(fitter: Fitter, fit: Fit, likelihood: Likelihood) -> float:
    """Return the Laplace evidence of a fitted set of effects, comparable with a law's.

    An effect's parameter without a prior of its own has a Cauchy distribution about the null, with the parameter's
    usual size as its width: it is known up to its order of magnitude. An event may happen at any time of the record.
    """
    space, x = fitter.space(fit.effects), fit.solution.x
    residual = residual_of(fitter.problem, fit.solution.prediction)
    derivative, weight = fit.solution.jacobian, likelihood.weight(residual)
    base = len(fitter.problem.parameters)
    information = prior_information(space, x, base)
    matrix = weight.normal(derivative) + np.diag(information)
    total = likelihood.log_at(weight, residual) - 0.5 * prior_cost_of(space.prior_residual(x), base)
    total -= 0.5 * float(np.linalg.slogdet(matrix)[1])
    total += fitter.problem.also_seen(fit.values, fit.effects)
    times = {fitter.candidates[name].event for name in fit.effects}
    for i in range(base, len(x)):
        parameter, scale = fit.parameters[i], float(space.scale[i])
        if parameter.sigma is not None:
            total -= float(np.log(parameter.sigma))
        elif parameter.name in times:
            total += 0.5 * float(np.log(2.0 * np.pi)) - float(np.log(parameter.upper - parameter.lower))
        else:
            off = (x[i] - (parameter.null if parameter.null is not None else parameter.value)) / scale
            total += 0.5 * float(np.log(2.0 / np.pi)) - float(np.log(scale * (1.0 + off**2)))
    return total


def ahead(fitter: Fitter, fit: Fit, likelihood: Likelihood) -> tuple[float, float]:
    """Return the log posterior density at a fit, and what its linear model predicts for the optimum."""
    space, x, base = fitter.space(fit.effects), fit.solution.x, len(fitter.problem.parameters)
    residual = residual_of(fitter.problem, fit.solution.prediction)
    step = full_step(fit.solution, residual, weight=likelihood.weight(residual), space=space)

    def value(share: float) -> float:
        there = residual - share * (fit.solution.jacobian @ step)
        return likelihood.log(there) - 0.5 * prior_cost_of(space.prior_residual(x + share * step), base)

    now = value(0.0)
    return now, max(now, value(1.0))


def prior_information(space: Space, x: Floats, base: int) -> Floats:
    """Return one over the variances (m,) of the priors at a point.

    A base value without a prior is free; an effect's is known to its order of magnitude (:func:`log_evidence`).
    Of the first ``base`` values any may simply be wrong (:mod:`torsight.discovery.inference.priors`).
    """
    weak = np.where(np.arange(len(x)) < base, _LITTLE, 1.0)
    information = np.where(np.isfinite(space.prior_sigma), space.prior_information, weak / space.scale**2)
    information[:base] *= outlier_precision(space.prior_residual(x)[:base])
    return information


def residual_of(problem: Problem, prediction: Floats) -> Floats:
    """Return measured less predicted (n,), zero where a sample does not count."""
    return np.where(problem.valid, problem.observed - prediction, 0.0)
