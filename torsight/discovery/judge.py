"""What is asked of a fitted set of effects before it is believed, named, or told as a rival."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from torsight.discovery.common import Relaxed, mean_square, relaxed
from torsight.discovery.contenders import Contender, Field
from torsight.discovery.fitting import less
from torsight.discovery.intervals import curvature_spread
from torsight.discovery.priors import prior_count
from torsight.discovery.settings import Settings
from torsight.discovery.solver import Array
from torsight.discovery.stand_in import predictable

_LEAST_BY_PRIORS: Final = 11.0
"""Gain that is believed where the priors give it: the best of twelve candidates takes that once in a hundred ..."""
_LEAST_BY_PRIORS_BESIDE: Final = 15.0
"""... and beside other effects, the error of whose form pulls values, too."""
_CLEAR: Final = 2.25
"""How many times what is worth a name a second effect removes that is small beside the first one."""
_NEARLY_NOTHING: Final = 0.1
"""Share of the squared error that may be left where a second effect explains what the first one leaves: an error of a
form has a shape of its own, which no other effect takes off to such a part."""
_NEAR: Final = 0.01
"""Share of what the chosen set gains by which a rival may cost more that predicts unseen blocks as well."""
_FAR_BETTER: Final = 0.5
"""Share of the chosen set's score on unseen blocks below which a rival is gone on with in its place."""
_HALF: Final = 0.5
"""Share of the squared error on unseen blocks that may be left by what explains the record, whatever it is in
information, and by a mechanism that stands in where nothing explains it."""
_DOUBT: Final = 2.0
"""Standard deviations of what the inputs' noise does within which a residual is no sign of anything."""
_MOST_PLAIN: Final = 2
"""Effects at most in a set of which one may be in plain sight."""
_TIED: Final = 0.9
"""Correlation from which two effects' values hang together."""


class Judge:
    """Judges the contenders of a search.

    Parameters
    ----------
    field : Field
        All that was fitted.
    settings : Settings
        How to decide.
    threshold : float
        The gain that the luckiest candidate takes from noise.
    seed : int
        Of the stand-in that tells what is left from noise where the floor is a guess.
    can_hold_out : bool
        Whether the record has more than one block.
    """

    def __init__(self, field: Field, settings: Settings, threshold: float, *, seed: int, can_hold_out: bool) -> None:
        self._seed = seed
        self._shares: dict[Contender, float] = {}
        self._relaxed_costs: dict[Contender, Relaxed] = {}
        self._field = field
        self._settings = settings
        self._threshold = threshold
        self._can_hold_out = can_hold_out
        rows = field.fitter.weight > 0.0
        self._floor = float(np.dot(field.fitter.weight[rows], field.floor[rows] ** 2))
        self._expected = self._floor + prior_count(field.fitter.problem)
        problem = field.fitter.problem
        reading = np.maximum(problem.sigma, np.min(field.floor[problem.valid]))
        self._input_floor = np.sqrt(np.maximum(0.0, field.floor**2 - reading**2))

    def earned(self, contender: Contender) -> bool:
        """Return whether each member gains more than chance and predicts unseen blocks (backward elimination).

        Members may each help the others and all of them together predict worse than none.
        """
        if not all(part is not None and self._better(contender, part) for part in self._parts(contender)):
            return False
        return not self._can_hold_out or self._foretells_as_well(contender, self._field.base)

    def shows(self, contender: Contender) -> bool:
        """Return whether the residual shrinks by what is worth a name with each effect of a set."""
        return all(part is not None and self._large(contender, part) for part in self._parts(contender))

    def _parts(self, contender: Contender) -> Iterator[Contender | None]:
        """Give a set without each of its effects in turn, None where that was not fitted."""
        return (self._field.contenders.get(less(contender.effects, name)) for name in contender.effects)

    def _large(self, contender: Contender, without: Contender) -> bool:
        """Return whether a set removes what is worth a name of what is left without one effect."""
        return self._removed(contender, without) >= self._least_size() or self.plain(contender, without)

    def plain(self, contender: Contender, without: Contender) -> bool:
        """Return whether the effect that one set has and the other lacks is in plain sight, however small.

        Nothing but a missing effect leaves a residual that far above the floor which one mechanism takes off almost
        whole, on unseen blocks too. What takes off the error of another one's form either leaves some of it, or the
        two hang together; what takes off the error of two forms need not.
        """
        if not self._can_hold_out or not self._takes_all(contender, without):
            return False
        return contender.held_out.score <= self._settings.plain_held_out * without.held_out.score

    def _takes_all(self, contender: Contender, without: Contender) -> bool:
        """Return whether one effect of at most two takes off almost whole what is left well above the floor."""
        settings = self._settings
        if len(contender.effects) > _MOST_PLAIN or self.over_floor(without) < settings.plain_over_floor:
            return False
        gained, left = without.cost - contender.cost, max(0.0, contender.cost - self._expected)
        if gained < settings.plain_share * (gained + left):
            return False
        return len(contender.effects) == 1 or not tied(self._field, contender)

    def is_best(self, contender: Contender, others: list[Contender]) -> bool:
        """Return whether a set costs least, or hardly more, where the model may err as all blocks share it."""
        least = min(self._relaxed(other).cost for other in others)
        return self._relaxed(contender).cost <= least + self._settings.rival_gain

    def _better(self, contender: Contender, without: Contender) -> bool:
        # What takes several values back to where they were measured need not show in the residual they had imitated;
        # and the priors are what they say they are, which cannot be said of a residual's noise.
        least = _LEAST_BY_PRIORS_BESIDE if without.effects else _LEAST_BY_PRIORS
        by_priors = self._returns(contender, without) >= least
        if by_priors:
            gains = self._relaxed(without).cost - self._relaxed(contender).cost >= least
        else:
            gains = without.cost - contender.cost >= self._threshold
            gains = gains and self._large(contender, without)
        return gains and (not self._can_hold_out or self._predicts_better(contender, without, by_priors=by_priors))

    def _returns(self, contender: Contender, without: Contender) -> float:
        """Return by how much less a set's values cost than those of the set without one effect.

        What they do for an error that all blocks may share does not count.
        """
        returned = without.prior - contender.prior
        if returned < _LEAST_BY_PRIORS:
            return returned
        return min(returned, self._relaxed(without).prior - self._relaxed(contender).prior)

    def _relaxed(self, contender: Contender) -> Relaxed:
        if contender not in self._relaxed_costs:
            self._relaxed_costs[contender] = relaxed(self._field, contender)
        return self._relaxed_costs[contender]

    def _removed(self, contender: Contender, without: Contender) -> float:
        """Return the mean square that a set removes, of what the inputs' noise could not do.

        A temperature that is known badly where an incomplete heating ends stays in the angle for the whole rest after
        it: there only what exceeds twice the inputs' share of the floor counts.
        What the base values imitate on the record they need not imitate on blocks that the fit has not seen. That is
        enough to doubt the model, not to give a name.
        """
        removed = self._beyond(self._residual(without)) - self._beyond(self._residual(contender))
        if contender.named or removed >= self._least_size() or not self._can_hold_out:
            return removed
        return self._beyond(without.held_out.residual) - self._beyond(contender.held_out.residual)

    def _predicts_better(self, contender: Contender, without: Contender, *, by_priors: bool) -> bool:
        if self.plain(contender, without):
            return True
        keep = 1.0 - self._settings.least_held_out_gain
        before = self._over_time(without.held_out.residual)
        after = self._over_time(contender.held_out.residual)
        returned = without.held_out.prior - contender.held_out.prior
        moved = without.held_out.prior - prior_count(self._field.fitter.problem)
        # Where values had imitated the effect without a trace, it need not predict better, but as well.
        as_well = self._foretells_as_well(contender, without)
        if by_priors and as_well and returned >= self._settings.share_of_rest * moved:
            return True
        if contender.held_out.score >= keep * without.held_out.score:
            # In information one block may outweigh all others: what explains the record and halves the error is better.
            clearly = not without.effects and after <= _HALF * before
            if not (clearly and self._explains(contender)):
                return False
        rest = before - self._over_time(self._field.floor)
        if after >= before * keep:
            return False
        if not without.effects:
            return True
        # What a second effect removes may be the error of the first one's form, unless hardly anything is left then,
        # or nearly nothing of what was left before, and the two do not hang together. What a third one removes may be
        # the error of two forms.
        whole = self._over_time(self._field.base.held_out.residual)
        little = after <= max(self._least_size(), _NEARLY_NOTHING * before)
        alone = little and len(without.effects) == 1 and before - after >= _CLEAR * self._least_size()
        alone = alone and not tied(self._field, contender)
        least = 0.0 if alone else self._settings.share_of_all * whole
        return before - after >= max(self._settings.share_of_rest * rest, least)

    def _least_size(self) -> float:
        """Return the mean square below which an effect is not worth a name."""
        return (self._settings.least_size * self._field.fitter.problem.resolution) ** 2

    def _residual(self, contender: Contender) -> Array:
        return self._field.fitter.problem.observed - contender.fit.solution.prediction

    def _over_time(self, values: Array) -> float:
        return mean_square(self._field.fitter.problem, values)

    def _beyond(self, values: Array) -> float:
        """Return the mean square over time, each sample less twice what the inputs' noise does to it."""
        return self._over_time(np.maximum(0.0, np.abs(values) - _DOUBT * self._input_floor))

    def share(self, contender: Contender) -> float:
        """Return the share that a set explains of what can be explained.

        What it leaves beyond the floor counts. A floor that was not measured at rests is only a guess: then what is
        left counts as far as a learned stand-in could predict it on blocks that it has not seen.
        """
        if contender not in self._shares:
            explained = self._field.base.cost - contender.cost
            left = max(0.0, contender.cost - self._expected)
            if self._can_hold_out and left > 0.0 and not self._field.stretches.rest.any():
                left = min(left, predictable(self._field, contender, seed=self._seed))
            self._shares[contender] = explained / (explained + left) if explained > 0.0 else 0.0
        return self._shares[contender]

    def over_floor(self, contender: Contender) -> float:
        """Return how many times the floor a set leaves."""
        return float(np.sqrt(contender.fit.solution.data_cost / self._floor))

    def adequate(self, contender: Contender, *, unseen: bool = True) -> bool:
        """Return whether a set explains enough to be called by its name; of unseen blocks, too, where they count."""
        if not contender.effects:
            return True
        pulled = self._relaxed(contender).prior - prior_count(self._field.fitter.problem) >= self._threshold
        # What is left may be many times a low floor and still less than anybody would miss.
        little = self._over_time(self._residual(contender)) <= self._least_size()
        near = (little or self.over_floor(contender) <= self._settings.near_floor) and not pulled
        if near or not self._explains(contender):
            return near
        return not (unseen and contender.named) or self._explains_unseen(contender)

    def _explains(self, contender: Contender) -> bool:
        return self.share(contender) >= self._settings.share_explained

    def _explains_unseen(self, contender: Contender) -> bool:
        """Return whether a set takes most of what the base model misses of unseen blocks, or leaves little of it."""
        if not self._can_hold_out:
            return True
        floor = self._over_time(self._field.floor)
        before, after = (self._over_time(c.held_out.residual) for c in (self._field.base, contender))
        little = self._settings.over_floor_unknown**2 * floor
        return after <= max(little, floor + self._settings.unseen_left * (before - floor))

    def _stands(self, contender: Contender) -> bool:
        return self.earned(contender) and self.adequate(contender)

    def nameless(self, chosen: Contender, *, rivals_too: bool = False) -> Contender | None:
        """Return a mechanism without a name that explains the record clearly better, one for one, than what is chosen.

        Each effect of a set costs what a rival may be worse by, so that two names are not given where one mechanism
        does it; and a name is preferred as long as it is a rival, unless rivals are asked for. Of mechanisms that
        explain the record as well the one with the fewest values goes first.
        """
        limit = chosen.cost + self._settings.rival_gain * (len(chosen.effects) - (0 if rivals_too else 2))
        nameless = [c for c in self._field.of_size(1) if not c.named and c.cost < limit]
        best = next((c for c in nameless if self._stands(c)), None)
        if best is None:
            return None
        as_good = [c for c in nameless if best.cost <= c.cost <= best.cost + self._settings.rival_gain]
        simplest_first = sorted(as_good, key=lambda c: len(c.fit.parameters))
        return next(c for c in simplest_first if c is best or self._stands(c))

    def nearest(self) -> Contender | None:
        """Return the mechanism without a name that takes most of what the base model misses of unseen blocks, if any.

        It need not explain the record: it may stand in for what nothing explains.
        """
        if not self._can_hold_out:
            return None
        least = _HALF * self._over_time(self._field.base.held_out.residual)
        earned = (c for c in self._field.of_size(1) if not c.named and self.earned(c))
        return next((c for c in earned if self._over_time(c.held_out.residual) < least), None)

    def worth_telling(self, contender: Contender) -> bool:
        """Return whether what is chosen removes so much that something must be missing, or is the only one that does.

        A form that errs a little looks like what depends on temperature or angle, too: then mechanisms without a name
        explain it as well as those with one.
        """
        least = (self._settings.least_unknown * self._field.fitter.problem.resolution) ** 2
        if self._removed(contender, self._field.base) >= least:
            return True
        if all(part is not None and self.plain(contender, part) for part in self._parts(contender)):
            return True
        return contender.named and self.nameless(contender, rivals_too=True) is None

    def rivals(self, chosen: Contender) -> list[Contender]:
        """Return the other sets that explain the record as well.

        What the chosen set leaves beyond the floor is the error of its form, if the name is right. A rival that is
        worse by no more than a share of that is not refuted: its own form may be the one that errs less. Nor is one
        whose residual is larger by less than the resolution: no model is known to be right that closely. Nor one that
        predicts unseen blocks at least as well, if the record itself hardly tells them apart. Nor is the one that
        explains the record best of all, and clearly better, where only its prediction of unseen blocks fails: few
        blocks may be too few to learn its values from; that goes for one more effect, too.
        """
        beyond = max(0.0, chosen.fit.solution.data_cost - self._floor)
        limit = chosen.cost + self._settings.rival_gain + self._settings.rival_share * beyond
        others = [c for c in self._field.of_size(len(chosen.effects)) if c is not chosen and c.named]
        found = [
            c
            for c in others
            if c.cost <= limit or self._as_close(c, chosen) or self._predicts_as_well(c, chosen)
            if self._stands(c)
        ]
        best = others[0] if others else chosen
        unproven = best not in found and best.cost < chosen.cost - self._settings.rival_gain
        if unproven and self._gains(best) and self.adequate(best, unseen=False):
            found.insert(0, best)
        larger = next((c for c in self._field.of_size(len(chosen.effects) + 1) if c.named), None)
        if larger is not None and self._adds_unproven(larger, chosen):
            found.append(larger)
        return found

    def _adds_unproven(self, larger: Contender, chosen: Contender) -> bool:
        """Return whether one more effect is in plain sight but for its prediction of unseen blocks.

        What changes from cycle to cycle cannot be learned from two cycles of which one is left out.
        """
        if not set(chosen.effects) < set(larger.effects) or not self._can_hold_out:
            return False
        return self._takes_all(larger, chosen) and self._gains(larger) and self.adequate(larger, unseen=False)

    def _gains(self, contender: Contender) -> bool:
        """Return whether each member gains more than chance, whatever it predicts."""
        parts = self._parts(contender)
        return all(part is not None and part.cost - contender.cost >= self._threshold for part in parts)

    def _as_close(self, contender: Contender, chosen: Contender) -> bool:
        """Return whether a set leaves no more than the chosen one but for the resolution, at no higher price.

        That goes for unseen blocks, too.
        """
        near = self._field.fitter.problem.resolution**2
        if contender.prior - chosen.prior > self._settings.rival_gain:
            return False
        if self._over_time(self._residual(contender)) > self._over_time(self._residual(chosen)) + near:
            return False
        return not self._can_hold_out or self._foretells_as_well(contender, chosen)

    def _foretells_as_well(self, contender: Contender, other: Contender) -> bool:
        """Return whether a set misses no more of unseen blocks than another one, but for the resolution."""
        near = self._field.fitter.problem.resolution**2
        return self._over_time(contender.held_out.residual) <= self._over_time(other.held_out.residual) + near

    def first_of(self, chosen: Contender, rivals: list[Contender]) -> Contender:
        """Return the one to go on with: the chosen set, or a rival that predicts unseen blocks far better.

        A larger one need only not predict them worse: in information, a single block may outweigh all others.
        """
        if not self._can_hold_out or not rivals:
            return chosen
        best = min(rivals, key=lambda c: c.held_out.score)
        if best.held_out.score < _FAR_BETTER * chosen.held_out.score:
            return best
        missed = self._over_time(chosen.held_out.residual)
        larger = (c for c in rivals if len(c.effects) > len(chosen.effects))
        return next((c for c in larger if self._over_time(c.held_out.residual) <= missed), chosen)

    def _predicts_as_well(self, contender: Contender, chosen: Contender) -> bool:
        """Return whether a set predicts unseen blocks at least as well as the chosen one, and costs hardly more."""
        near = contender.cost <= chosen.cost + _NEAR * (self._field.base.cost - chosen.cost)
        return near and self._can_hold_out and contender.held_out.score <= chosen.held_out.score


def tied(field: Field, contender: Contender) -> bool:
    """Return whether values of two effects of a set can only be known together: what one lacks the other makes up."""
    fit = contender.fit
    spread = curvature_spread(field, contender)
    size = np.sqrt(np.diag(spread))
    places = {p.name: i for i, p in enumerate(fit.parameters)}
    own = [[places[p.name] for p in field.fitter.candidates[name].parameters] for name in fit.effects]
    return any(
        float(np.max(np.abs(spread[np.ix_(one, other)] / np.outer(size[one], size[other])))) > _TIED
        for k, one in enumerate(own)
        for other in own[:k]
    )
