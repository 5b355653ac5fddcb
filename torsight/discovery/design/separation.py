"""Separation, by a planned record, of explanations that a given record cannot distinguish.

Each explanation in turn is taken as true and predicts the planned record. Every other explanation is then refitted to
that prediction: all its free parameters, within their priors, absorb a part of the difference, and the residual is
weighted by the noise of the given record and its correlation. The gain is the difference of the two costs in the
engine's own units, to be compared with the gain at which rivals cease to be rivals; its root is the distance in
standard deviations.

The refit is linear in the parameters for a search over many plans (:func:`linear_gains`), or complete for the last few
(:func:`refitted_gains`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from torsight.core.law import LawForm
from torsight.core.parameter import Parameter
from torsight.core.units import Floats
from torsight.discovery.inference.fitting import EffectSet, space_of
from torsight.discovery.inference.solver import jacobian, solve
from torsight.discovery.weight import Weight


@dataclass(frozen=True, slots=True, eq=False)
class Rival:
    """One fitted set of effects, as it applies to a planned record.

    ``name`` holds the effects of the set in the answer, ``effects`` those that a later record shows too: an event of
    the given record (a bump) does not come back. ``parameters`` are free, with bounds and priors, ``x`` (m,) are their
    fitted values, ``forms`` the forms of the laws among the effects.
    """

    name: EffectSet
    effects: EffectSet
    parameters: tuple[Parameter, ...]
    x: Floats
    forms: tuple[LawForm, ...] = ()

    def values(self, x: Floats) -> dict[str, float]:
        """Return values (m,) of the parameters by their names."""
        return dict(zip([p.name for p in self.parameters], x.tolist(), strict=True))

    def model(self, predict: Predict) -> Callable[[Floats], Floats]:
        """Return the planned record's values as a function of the parameters."""
        return lambda x: predict(self.values(x), self)

    @property
    def prior_cost(self) -> float:
        """Cost of the fitted values under their priors."""
        return float(np.sum(space_of(self.parameters).prior_residual(self.x) ** 2))


Predict = Callable[[Mapping[str, float], Rival], Floats]
"""From parameter values of a rival to a planned record's values (n,)."""


def linear_gains(predict: Predict, explanations: Sequence[Rival], weight: Weight) -> Floats:
    """Return the excess cost (k, k) of each explanation (column) over each one that is taken as true (row).

    NaN on the diagonal, and where the other explanation contains the true one: it would fit equally well, and the two
    are distinguished in that its additional effect is not found.
    """
    models = [one.model(predict) for one in explanations]
    values = [model(one.x) for model, one in zip(models, explanations, strict=True)]
    gains = np.full((len(explanations), len(explanations)), np.nan)
    for j, rivals in _rivals(explanations):
        other, space = explanations[j], space_of(explanations[j].parameters)
        slopes = jacobian(models[j], other.x, at_x=values[j], space=space)
        weighted = weight.times(slopes)
        normal = slopes.T @ weighted
        normal[np.diag_indices_from(normal)] += space.prior_information + 1e-9 / space.scale**2
        pull = space.prior_information * (other.x - space.prior_mean)
        for i in rivals:
            apart = values[i] - values[j]
            gradient = weighted.T @ apart - pull
            taken_up = float(gradient @ np.linalg.solve(normal, gradient))
            gains[i, j] = weight.square(apart) + other.prior_cost - taken_up - explanations[i].prior_cost
    return gains


def refitted_gains(predict: Predict, explanations: Sequence[Rival], weight: Weight) -> Floats:
    """Return the gains of :func:`linear_gains`, with a complete refit of every other explanation."""
    models = [one.model(predict) for one in explanations]
    shown = [model(one.x) for model, one in zip(models, explanations, strict=True)]
    gains = np.full((len(explanations), len(explanations)), np.nan)
    for j, rivals in _rivals(explanations):
        other, space = explanations[j], space_of(explanations[j].parameters)
        for i in rivals:
            found = solve(models[j], other.x, observed=shown[i], weight=weight, space=space, max_iterations=8)
            gains[i, j] = found.cost - explanations[i].prior_cost
    return gains


def least_gain(gains: Floats) -> float:
    """Return the smallest gain of all pairs, not below zero; 0 where there is no pair to distinguish."""
    known = gains[np.isfinite(gains)]
    return max(0.0, float(known.min())) if len(known) else 0.0


def _rivals(explanations: Sequence[Rival]) -> Iterator[tuple[int, list[int]]]:
    """Yield each explanation with those from which it is distinguishable where these are true, by their indices."""
    for j, other in enumerate(explanations):
        found = [i for i, true in enumerate(explanations) if i != j and not set(true.effects) <= set(other.effects)]
        if found:
            yield j, found
