"""Fitted sets of effects that are compared with each other, all at the same weights."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from torsight.core.progress import Progress, silent
from torsight.discovery.fitting import EffectSet, Fit, Fitter
from torsight.discovery.noise import Scales, Stretches, information, residual_scales
from torsight.discovery.priors import prior_cost
from torsight.discovery.solver import Array
from torsight.discovery.validate import HeldOut, held_out_by_refit


@dataclass(frozen=True, eq=False)
class Contender:
    """A fitted set of effects; :attr:`held_out` says how it predicts blocks it has not seen (worked out when asked)."""

    fit: Fit
    fitter: Fitter
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
    def effects(self) -> EffectSet:
        """Ids of the effects."""
        return self.fit.effects

    @property
    def named(self) -> bool:
        """Whether every effect has a name to be told."""
        return all(self.fitter.candidates[name].named for name in self.effects)

    @property
    def cost(self) -> float:
        """The objective at the search's weights, with priors that allow for a wrong value."""
        return self.fit.solution.data_cost + self.prior


@dataclass(frozen=True, slots=True, eq=False)
class Field:
    """All contenders at the same weights.

    Attributes
    ----------
    fitter : Fitter
        With the weights.
    stretches : Stretches
        Motion and rests of the record.
    scales : Scales
        Sizes of the residual that the weights come from.
    floor : (n,) float64
        Standard deviation per sample that no model can undercut.
    contenders : dict
        Effects to contender; the base model under the empty set.
    """

    fitter: Fitter
    stretches: Stretches
    scales: Scales
    floor: Array
    contenders: dict[EffectSet, Contender]
    _relaxed: dict[Contender, float] = field(default_factory=dict, init=False, repr=False)

    @property
    def base(self) -> Contender:
        """The base model."""
        return self.contenders[()]

    def of_size(self, size: int) -> list[Contender]:
        """Return the contenders with so many effects, best first."""
        found = [c for effects, c in self.contenders.items() if len(effects) == size]
        return sorted(found, key=lambda c: (c.cost, c.effects))

    def relaxed_prior(self, contender: Contender) -> float:
        """Return what values cost, by their priors, where samples are worth what the set itself leaves.

        That is no less than the resolution: values that go far to gain less imitate the error of a form.
        """
        if contender not in self._relaxed:
            problem, fit = self.fitter.problem, contender.fit
            residual = np.where(problem.valid, problem.observed - fit.solution.prediction, 0.0)
            scales = residual_scales(residual, self.stretches, self.floor)
            motion, rest = max(scales.motion, problem.resolution), max(scales.rest, problem.resolution)
            weight = information(self.stretches, replace(scales, motion=motion, rest=rest), self.floor)
            self._relaxed[contender] = prior_cost(problem, self.fitter.refit(fit, weight=weight))
        return self._relaxed[contender]
