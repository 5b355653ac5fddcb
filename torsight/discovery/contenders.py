"""Fitted sets of effects that are compared with each other, all at the same weights."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from torsight.core.progress import Progress, silent
from torsight.discovery.fitting import EffectSet, Fit, Fitter
from torsight.discovery.noise import Scales, Stretches
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

    @property
    def base(self) -> Contender:
        """The base model."""
        return self.contenders[()]

    def of_size(self, size: int) -> list[Contender]:
        """Return the contenders with so many effects, best first."""
        found = [c for effects, c in self.contenders.items() if len(effects) == size]
        return sorted(found, key=lambda c: (c.cost, c.effects))
