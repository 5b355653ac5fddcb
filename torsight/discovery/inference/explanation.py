"""Fitted sets of effects and laws, comparable by their evidence."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from torsight.core.progress import Progress, silent
from torsight.discovery.inference.fitting import EffectSet, Fit, Fitter
from torsight.discovery.inference.likelihood import Likelihood
from torsight.discovery.inference.measure import Measured
from torsight.discovery.inference.noise import Stretches
from torsight.discovery.inference.priors import prior_cost
from torsight.discovery.inference.solver import Array
from torsight.discovery.inference.validate import HeldOut, held_out_by_refit


@dataclass(frozen=True, eq=False)
class Explanation:
    """A fitted set; :attr:`held_out` says how it predicts blocks that it has not seen (worked out when asked).

    Attributes
    ----------
    fitter : Fitter
        The problem with the set's laws among its candidates, and the weights at which it was fitted.
    fit : Fit
        The optimum.
    laws : tuple of Measured
        The laws of the set.
    log_evidence : float
        Comparable among explanations of one field.
    """

    fitter: Fitter
    fit: Fit
    laws: tuple[Measured, ...]
    log_evidence: float
    progress: Progress = silent

    @cached_property
    def held_out(self) -> HeldOut:
        """Prediction of every block from the others."""
        return held_out_by_refit(self.fitter, self.fit, progress=self.progress)

    @cached_property
    def prior(self) -> float:
        """What the distance of its values from their priors costs."""
        return prior_cost(self.fitter.problem, self.fit)

    @property
    def members(self) -> EffectSet:
        """Ids of effects and laws, in alphabetical order."""
        return tuple(sorted(self.fit.effects))

    @property
    def effects(self) -> EffectSet:
        """Ids of the effects that have a name."""
        laws = {item.law.id for item in self.laws}
        return tuple(name for name in self.members if name not in laws)

    @property
    def cost(self) -> float:
        """The objective at the set's own weights."""
        return self.fit.solution.cost

    @property
    def residual(self) -> Array:
        """Measured less model (n,), zero where a sample does not count."""
        return np.nan_to_num(self.fitter.residual(self.fit))


@dataclass(frozen=True, slots=True, eq=False)
class Field:
    """All explanations of one record under one likelihood.

    Attributes
    ----------
    likelihood : Likelihood
        Of the record.
    stretches : Stretches
        Motion and rests of the record.
    explanations : dict
        Members to explanation; the base model under the empty set, where the others' optima may have led it further.
    first : Explanation or None
        The base model as it was fitted by itself; None: as it is there.
    """

    likelihood: Likelihood
    stretches: Stretches
    explanations: dict[EffectSet, Explanation]
    first: Explanation | None = None

    @property
    def plain(self) -> Explanation:
        """The base model as it was fitted by itself, whatever it was compared with later."""
        return self.first or self.base

    @property
    def base(self) -> Explanation:
        """The base model."""
        return self.explanations[()]
