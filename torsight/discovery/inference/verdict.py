"""From the evidence of all sets to an answer.

Every set of effects and laws has a posterior probability: its evidence times the prior that so much is missing, shared
by all effects and laws alike. Sets that name the same places of the model by different means (a usual form, or a free
law where that form acts) are one answer. What is said follows from these probabilities: nothing, where it is not
certain that something is missing; the answer that holds nearly all probability; or all answers that share it. The score
on half-cycles that a fit has not seen is the check: what a member adds must predict them better, events apart, which
no other half-cycle can tell.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import softmax

from torsight.discovery.inference.explanation import Explanation, Field, Places, places_of
from torsight.discovery.inference.fitting import EffectSet, less
from torsight.discovery.settings import Settings


@dataclass(frozen=True, slots=True, eq=False)
class Decision:
    """What is said and why.

    Attributes
    ----------
    chosen : Explanation
        The most probable set of the answer, or the plain model.
    named : mapping of str to (str, Explanation)
        Law of the chosen set to the effect whose name it carries and the set in which that effect was fitted in its
        place; effects of the chosen set to themselves.
    rivals : tuple of Explanation
        The best set of every other answer that shares the probability.
    shared : tuple of (Explanation, float)
        The sets that hold probability beside the chosen one, and which part of the whole each holds: the rivals, and
        what says the same by other means or with one member more or less. A prediction is unsure of all of them.
    probability : dict
        Of every set.
    missing : float
        Probability that anything is missing.
    over_floor : float
        What the chosen set leaves, in noise floors.
    over_floor_before : float
        The same of the plain model.
    """

    chosen: Explanation
    named: Mapping[str, tuple[str, Explanation]]
    rivals: tuple[Explanation, ...]
    shared: tuple[tuple[Explanation, float], ...]
    probability: dict[EffectSet, float]
    missing: float
    over_floor: float
    over_floor_before: float

    @property
    def unnamed(self) -> EffectSet:
        """Laws of the chosen set that carry no name."""
        return tuple(name for name in self.chosen.members if name not in self.named)


def decide(field: Field, *, settings: Settings, choices: int, can_hold_out: bool) -> Decision:
    """Read the answer off the posterior.

    Parameters
    ----------
    field : Field
        All that was fitted.
    settings : Settings
        Probabilities.
    choices : int
        How many effects and laws the prior is shared by.
    can_hold_out : bool
        Whether the record has more than one block.
    """
    judge = _Judge(field, settings, choices)
    probability = judge.probability
    missing = 1.0 - probability[()]
    chosen, rivals = field.base, []
    if missing >= settings.certain:
        answers = judge.answers()
        chosen = answers[0]
        if can_hold_out:
            chosen = judge.checked(chosen)
        if chosen.members:
            rivals = judge.rivals(chosen, answers)
    chosen = chosen if chosen.members else field.plain
    named = judge.names(chosen)
    rivals += judge.other_forms(chosen, named)
    return Decision(
        chosen=chosen,
        named=named,
        rivals=tuple(rivals),
        shared=judge.shared(chosen, rivals),
        probability=probability,
        missing=missing,
        over_floor=judge.over_floor(chosen),
        over_floor_before=judge.over_floor(field.base),
    )


class _Judge:
    def __init__(self, field: Field, settings: Settings, choices: int) -> None:
        self._field = field
        self._settings = settings
        sets = field.explanations
        price = settings.price(choices)
        log = np.array([one.log_evidence - price * len(members) for members, one in sets.items()])
        self.probability = dict(zip(sets, softmax(log).tolist(), strict=True))
        self._log = dict(zip(sets, log.tolist(), strict=True))

    def places(self, members: Iterable[str]) -> Places:
        """Return where a set acts."""
        return places_of(self._field.base.fitter.problem, members)

    def answers(self) -> list[Explanation]:
        """Return the best set of every answer of the smallest group that holds the credible share, best first.

        An answer holds what its extensions hold: they say the same, and that more may be missing. Where what all of
        the answers share is one of them, there is one answer: every place that the credible share of all sets holds.
        """
        groups: dict[Places, list[EffectSet]] = {}
        for members in self._field.explanations:
            groups.setdefault(self.places(members), []).append(members)
        weight = {places: sum(self.probability[m] for m in sets) for places, sets in groups.items()}
        told: list[Places] = []
        for places in sorted(weight, key=lambda key: (-weight[key], sorted(key))):
            told.append(places)
            held = (
                share for other, share in weight.items() if other in told or any(one and one <= other for one in told)
            )
            if sum(held) >= self._settings.credible:
                break
        shared = frozenset.intersection(*told)
        if shared in told and shared:
            held_by = {
                place: sum(share for held, share in weight.items() if place in held) for place in frozenset.union(*told)
            }
            certain = frozenset(place for place, share in held_by.items() if share >= self._settings.credible)
            told = [certain if certain in groups else shared]
        best = [max(groups[places], key=lambda m: (self.probability[m], m)) for places in told if places]
        return [self._field.explanations[members] for members in best]

    def rivals(self, chosen: Explanation, answers: Sequence[Explanation]) -> list[Explanation]:
        """Return the answers beside the chosen: no part of one that is more probable, and no extension of it.

        An extension says the same and that more may be missing, which its own gain would have to show.
        """
        told, found = [self.places(chosen.members)], []
        for one in answers:
            own = self.places(one.members)
            if not any(own <= other or other <= own for other in told):
                told.append(own)
                found.append(one)
        return found

    def shared(self, chosen: Explanation, rivals: Sequence[Explanation]) -> tuple[tuple[Explanation, float], ...]:
        """Return the sets beside the chosen and their parts of the probability, the rivals and what is as credible.

        None counts for more than the chosen, which held-out blocks may have preferred to a more probable one.
        """
        own = self._log[chosen.members]
        told = {one.members for one in rivals}
        least = own - 0.5 * self._settings.apart
        sets = [m for m, log in self._log.items() if m != chosen.members and (m in told or log >= least)]
        weight = np.exp([min(0.0, self._log[members] - own) for members in sets])
        parts = weight / (1.0 + np.sum(weight))
        return tuple((self._field.explanations[m], float(part)) for m, part in zip(sets, parts, strict=True))

    def checked(self, chosen: Explanation) -> Explanation:
        """Return the set, or the part of it that predicts held-out blocks better."""
        while chosen.members:
            parts = [less(chosen.members, name) for name in chosen.members if not self._once(chosen, name)]
            fitted = [self._field.explanations[part] for part in parts if part in self._field.explanations]
            if not fitted:
                return chosen
            best = max(fitted, key=self._score)
            if self._score(best) <= self._score(chosen):
                return chosen
            chosen = best
        return chosen

    def _once(self, one: Explanation, name: str) -> bool:
        """Return whether a member is an event: it happened once, so that no other block can predict it."""
        return one.fitter.candidates[name].propose is not None

    def _score(self, one: Explanation) -> float:
        """Return the log score on blocks that were each predicted from the others.

        How little the others tell of a block (of a clock that wanders, say) is a part of what was predicted.
        """
        return one.held_out_likelihood.log(np.nan_to_num(one.held_out.residual))

    def names(self, chosen: Explanation) -> dict[str, tuple[str, Explanation]]:
        """Return the names of a set's members: effects their own, laws the name of a usual form that does as much.

        What each does is told in squares of residuals, every sample with its information: where errors of the
        temperatures are large, squares tell nothing.
        """
        found = {name: (name, chosen) for name in chosen.effects}
        weight = chosen.likelihood.weight(chosen.residual)
        for item in chosen.laws:
            others = less(chosen.members, item.law.id)
            without, forms = self._log.get(others, -np.inf), []
            for candidate in self._field.base.fitter.problem.candidates:
                members = tuple(sorted((*others, candidate.id)))
                # A form that is no better than nothing explains nothing.
                if item.law.id in candidate.laws and self._log.get(members, -np.inf) > without:
                    forms.append((candidate.id, self._field.explanations[members]))
            if not forms:
                continue
            name, best = max(forms, key=lambda form: form[1].log_evidence)
            if self._field.base.fitter.candidates[name].any_form:
                found[item.law.id] = (name, best)
                continue
            part = self._field.explanations.get(others, self._field.base)
            missed, left, form_left = (weight.square(one.residual) for one in (part, chosen, best))
            if missed - form_left >= self._settings.form_share * (missed - left):
                found[item.law.id] = (name, best)
        return found

    def other_forms(self, chosen: Explanation, named: Mapping[str, tuple[str, Explanation]]) -> list[Explanation]:
        """Return sets in which another form of the same law stands for a named member, and that are as credible."""
        found, sets = [], self._field.explanations
        forms = {one.id: set(one.laws) for one in self._field.base.fitter.problem.candidates}
        for member, (name, where) in named.items():
            others = less(chosen.members, member)
            least = self._log[where.members] - 0.5 * self._settings.apart
            for other, laws in forms.items():
                members = tuple(sorted((*others, other)))
                shared = other not in (name, *others) and bool(laws & {*forms[name], member})
                if shared and members in sets and self._log[members] >= least:
                    found.append(sets[members])
        return found

    def _square(self, one: Explanation) -> float:
        return float(np.dot(self._field.likelihood.count, one.residual**2))

    def over_floor(self, one: Explanation) -> float:
        """Return the root mean square that a set leaves, in noise floors."""
        likelihood = self._field.likelihood
        return float(np.sqrt(self._square(one) / max(float(likelihood.count @ likelihood.noise**2), 1e-30)))
