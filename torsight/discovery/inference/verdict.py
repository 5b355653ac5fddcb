"""From the evidence of all sets to an answer.

Every set of effects and laws has a posterior probability: its evidence times the prior for its number of members, which
all effects and laws share equally. Sets that act at the same places of the model by different means (a usual form, or a
free law where that form acts) are one answer. The verdict follows from these probabilities: nothing is named where it
is not certain that something is missing; otherwise the answer that holds nearly all probability, or all answers that
share it. The check is the score on held-out half-cycles: each member must improve their prediction, except events,
which other half-cycles cannot show.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import combinations

import numpy as np
from scipy.special import softmax

from torsight.discovery.inference.explanation import Explanation, Field, Places, places_of
from torsight.discovery.inference.fitting import EffectSet, less
from torsight.discovery.settings import Settings


@dataclass(frozen=True, slots=True, eq=False)
class Decision:
    """The chosen explanation, the names of its members, its rivals, and the probabilities.

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
        The credible sets beside the chosen one, each with its part of the probability: the rivals, and sets that act at
        the same places by other means or have a member more or less. They widen the interval of a prediction.
    probability : dict
        Probability of every set.
    missing : float
        Probability that anything is missing.
    over_floor : float
        Residual of the chosen set, in noise floors.
    over_floor_before : float
        Residual of the plain model, in noise floors.
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
    """Derive the answer from the posterior.

    ``choices`` is the number of effects and laws that share the prior; ``can_hold_out`` says whether the record has
    more than one block.
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


def _evidence(field: Field) -> dict[EffectSet, float]:
    """Return the evidence of every set, without what it gains by differences that do not matter.

    Where a set and a part of it predict every stretch of the record alike to within the resolution, the set's residual
    is as good as the part's: no model is more exact than that, and a record without noise shows by how much. What the
    set gains because it pulls fewer values remains.
    """
    sets, excess = field.explanations, dict[EffectSet, float]()

    @cache
    def log(members: EffectSet) -> float:
        return sets[members].likelihood.log(sets[members].residual)

    for members in sorted(sets, key=len):
        parts = (part for size in range(len(members)) for part in combinations(members, size) if part in sets)
        alike = [part for part in parts if _are_alike(field, sets[members], sets[part])]
        excess[members] = max([0.0, *(log(members) - log(part) + excess[part] for part in alike)])
    return {members: one.log_evidence - excess[members] for members, one in sets.items()}


def _are_alike(field: Field, one: Explanation, other: Explanation) -> bool:
    """Return whether two predictions differ by the resolution at most in every stretch, root mean square."""
    square = np.cumsum(np.append(0.0, (one.residual - other.residual) ** 2))
    start, stop = field.stretches.start, field.stretches.stop
    least = field.base.fitter.problem.resolution
    return bool(np.all(square[stop] - square[start] <= (stop - start) * least**2))


class _Judge:
    def __init__(self, field: Field, settings: Settings, choices: int) -> None:
        self._field = field
        self._settings = settings
        sets = field.explanations
        price = settings.price(choices)
        log = np.array([evidence - price * len(members) for members, evidence in _evidence(field).items()])
        self.probability = dict(zip(sets, softmax(log).tolist(), strict=True))
        self._log = dict(zip(sets, log.tolist(), strict=True))

    def places(self, members: Iterable[str]) -> Places:
        """Return the places at which a set acts."""
        return places_of(self._field.base.fitter.problem, members)

    def answers(self) -> list[Explanation]:
        """Return the best set of every answer of the smallest group that holds the credible share, best first.

        The probability of an answer includes that of its extensions: they contain the answer. Where one answer is
        contained in all others, there is a single answer, which consists of all places that occur in sets with the
        credible share of the probability.
        """
        groups: dict[Places, list[EffectSet]] = {}
        for members in self._field.explanations:
            groups.setdefault(self.places(members), []).append(members)
        weight = {places: sum(self.probability[m] for m in sets) for places, sets in groups.items()}
        answers: list[Places] = []
        for places in sorted(weight, key=lambda key: (-weight[key], sorted(key))):
            answers.append(places)
            held = (
                share
                for other, share in weight.items()
                if other in answers or any(one and one <= other for one in answers)
            )
            if sum(held) >= self._settings.credible:
                break
        shared = frozenset.intersection(*answers)
        if shared in answers and shared:
            held_by = {
                place: sum(share for held, share in weight.items() if place in held)
                for place in frozenset.union(*answers)
            }
            certain = frozenset(place for place, share in held_by.items() if share >= self._settings.credible)
            answers = [certain if certain in groups else shared]
        best = [max(groups[places], key=lambda m: (self.probability[m], m)) for places in answers if places]
        return [self._field.explanations[members] for members in best]

    def rivals(self, chosen: Explanation, answers: Sequence[Explanation]) -> list[Explanation]:
        """Return the answers beside the chosen one that are neither a part nor an extension of a more probable answer.

        An extension is no rival: it contains the answer, and its further members would need a gain of their own.
        """
        answered, found = [self.places(chosen.members)], []
        for one in answers:
            own = self.places(one.members)
            if not any(own <= other or other <= own for other in answered):
                answered.append(own)
                found.append(one)
        return found

    def shared(self, chosen: Explanation, rivals: Sequence[Explanation]) -> tuple[tuple[Explanation, float], ...]:
        """Return the rivals, and all sets that are as credible as a rival must be, with their parts of the probability.

        No set counts for more than the chosen one, which held-out blocks may have preferred to a more probable set.
        """
        own = self._log[chosen.members]
        rival_sets = {one.members for one in rivals}
        least = own - 0.5 * self._settings.apart
        sets = [m for m, log in self._log.items() if m != chosen.members and (m in rival_sets or log >= least)]
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
            best = max(fitted, key=lambda one: one.held_out_log)
            if best.held_out_log <= chosen.held_out_log:
                return chosen
            chosen = best
        return chosen

    def _once(self, one: Explanation, name: str) -> bool:
        """Return whether a member is an event: it happened once, so that no other block can predict it."""
        return one.fitter.candidates[name].event is not None

    def names(self, chosen: Explanation) -> dict[str, tuple[str, Explanation]]:
        """Return the names of a set's members: effects their own, laws that of a usual form that explains as much.

        The explained part is measured in squared residuals, each sample weighted by its information: where errors of
        the temperatures are large, plain squares mean nothing.
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
        """Return equally credible sets in which another form of the same law replaces a named member."""
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

    def over_floor(self, one: Explanation) -> float:
        """Return the root mean square residual of a set, in noise floors."""
        return self._field.likelihood.over_floor(one.residual)
