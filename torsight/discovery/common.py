"""An error of the model that all blocks share: it shows in no held-out block, and values may go far for it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from torsight.discovery.contenders import Contender, Field
from torsight.discovery.fitting import space_of
from torsight.discovery.interface import Problem
from torsight.discovery.priors import prior_cost_at
from torsight.discovery.solver import Array, linear_change
from torsight.discovery.validate import block_labels

_COMMON_SHARE: Final = 3.0
"""Size of the error that all blocks share, in resolutions of the problem."""
_COMMON_PLACES: Final = 6
"""Places over the measured range at which that error has values of its own."""


def mean_square(problem: Problem, values: Array) -> float:
    """Return the mean square of values (n,) over the time that counts."""
    valid = problem.valid
    return float(np.average(values[valid] ** 2, weights=np.gradient(problem.time_s)[valid]))


def common_errors(problem: Problem) -> Array:
    """Return errors of a model that all blocks share (n, k), one standard deviation each.

    Hat functions of the measured value, apart for blocks that end above where they began and for those that end below.
    """
    observed = np.nan_to_num(problem.observed)
    low, high = np.min(observed[problem.valid]), np.max(observed[problem.valid])
    place = (observed - low) / max(high - low, 1e-12) * (_COMMON_PLACES - 1)
    hats = np.maximum(0.0, 1.0 - np.abs(place[:, None] - np.arange(_COMMON_PLACES)))
    rises = np.zeros(len(observed), bool)
    for label in block_labels(problem):
        own = np.flatnonzero((problem.block == label) & problem.valid)
        rises[own] = observed[own[-1]] > observed[own[0]]
    apart = np.hstack([hats * rises[:, None], hats * ~rises[:, None]])
    return np.asarray(_COMMON_SHARE * problem.resolution * apart)


@dataclass(frozen=True, slots=True)
class Relaxed:
    """What a set costs where the model may err as all blocks share it: by its values' priors, and in all."""

    prior: float
    cost: float


@dataclass(frozen=True, slots=True, eq=False)
class Freed:
    """A fitted set in whose linear picture the model may err as all blocks share it.

    Attributes
    ----------
    columns : (n, m + k) float64
        The set's derivatives, then the common errors.
    information : (m + k,) float64
        One over the variances of their coefficients' priors.
    moved : (m + k,) float64
        How far the values move, within their bounds, and the common errors' coefficients.
    left : (n,) float64
        What is left of the residual.
    """

    columns: Array
    information: Array
    moved: Array
    left: Array


def freed(field: Field, contender: Contender) -> Freed:
    """Return the linear picture of a set, from where its values are, in which the model may err."""
    problem, fit, weight = field.fitter.problem, contender.fit, field.fitter.weight
    space, x = space_of(fit.parameters), fit.solution.x
    residual = np.where(weight > 0.0, problem.observed - fit.solution.prediction, 0.0)
    columns = np.hstack([fit.solution.jacobian, common_errors(problem)])
    information, centre = np.ones(columns.shape[1]), np.zeros(columns.shape[1])
    information[: len(x)] = space.prior_information + 1e-9 / space.scale**2
    centre[: len(x)] = np.where(np.isfinite(space.prior_sigma), space.prior_mean - x, 0.0)
    moved = linear_change(columns, residual, weight=weight, information=information, centre=centre)
    left = residual - columns @ moved
    moved[: len(x)] = space.clip(x + moved[: len(x)]) - x
    return Freed(columns, information, moved, left)


def relaxed(field: Field, contender: Contender) -> Relaxed:
    """Return what a set costs where the model may err as all blocks share it.

    Values that are pulled far for less than such an error imitate the error of a form and no effect.
    """
    picture, fit = freed(field, contender), contender.fit
    own = len(fit.solution.x)
    prior = prior_cost_at(field.fitter.problem, fit, fit.solution.x + picture.moved[:own])
    errors = float(np.sum(picture.moved[own:] ** 2))
    return Relaxed(prior, float(field.fitter.weight @ picture.left**2) + prior + errors)
