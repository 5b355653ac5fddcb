"""The search for sets of effects and laws that explain a record: first single ones, then extensions of the best.

Every effect is fitted and every law measured together with the plain model. Each of the best sets is fitted again from
the base values of the others, because a set whose optimum was missed would be underrated. The best few sets are
extended by every other effect and law as long as the residual is more than noise. All are compared by their evidence
under one likelihood, whose floor and correlation come from the best of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property, partial
from typing import Final

import numpy as np
from scipy.special import ndtri

from torsight.core.progress import Progress
from torsight.core.units import Floats
from torsight.discovery.inference.explanation import (
    Explanation,
    Field,
    Places,
    loss_at,
    may_clear,
    part_fitter,
    places_of,
)
from torsight.discovery.inference.fitting import EffectSet, less, with_member
from torsight.discovery.inference.law.measure import (
    SETTLED,
    Bar,
    Measurement,
    measure_law,
)
from torsight.discovery.inference.set_fits import FIRST_CORRELATION, SetFits, columns_of
from torsight.discovery.interface import Problem
from torsight.discovery.settings import Settings

_TURN: Final = 4
"""Number of extensions that are fitted before the bar is set anew, at first; then as many as before: a choice."""


class Search:
    """Fits the sets that have to be compared; see :meth:`run`."""

    def __init__(self, problem: Problem, *, settings: Settings, progress: Progress) -> None:
        self._problem = problem
        self._settings = settings
        self._progress = progress
        self.fits = SetFits(problem, progress=progress)
        self._explanations: dict[EffectSet, Explanation] = {}
        self._grown: set[tuple[EffectSet, str]] = set()
        self._exchanged: set[tuple[EffectSet, str, str]] = set()
        self._at_once = partial(problem.at_once, progress=progress)
        self._laws = {law.id: law for law in problem.laws}
        self._open: EffectSet | None = None

    def run(self) -> Field:
        """Return the plain model and the sets that grew out of the best ones."""
        first = self.fits.plain()
        self._keep([first])
        self._problem.get_ready()
        for size in range(1, self._settings.most + 1):
            if size > 1:
                # Floor and correlation have changed since these sets were fitted.
                self._keep(self._at_once(self._parents(size - 1), self.fits.again, step="the best again"))
            parents = [parent for parent in self._parents(size - 1) if self._may_lead(parent)]
            if not parents:
                break
            # Decided before the first extension is better than the set itself.
            self._open = self._best_open()
            self._extend(parents, size)
            if size > 1:
                self._take_better_forms(size)
            self._grow_otherwise(size)
            self._look_again(size)
            self._fit_parts(self._best())
            # What a set that lacks something leaves is correlated by that, and says nothing of the noise yet.
            self._follow_best(longest=FIRST_CORRELATION)
            smaller = max(one.log_evidence for one in self._explanations.values() if len(one.members) < size)
            if self._best().log_evidence < smaller + self.needed:
                break
        self._follow_best(longest=np.inf)
        found = self._at_once(self._in_reach(), self.fits.sharpened, step="how well it is known")
        self._explanations.update((one.members, one) for one in found)
        return Field(self._best().likelihood, self.fits.stretches, self._explanations, first)

    def _in_reach(self) -> list[Explanation]:
        """Return the sets that could be reported, were they a little more probable."""
        sets = self._explanations.values()
        return [one for one in sets if one.log_evidence > self._reach(len(one.members)) - 0.5 * self._settings.apart]

    @property
    def needed(self) -> float:
        """Gain in log units that pays for one more member of a set."""
        return self._settings.price(self.choices)

    @property
    def choices(self) -> int:
        """Number of effects and laws from which sets are chosen."""
        return len(self._problem.candidates) + len(self._problem.laws)

    def _parents(self, size: int) -> list[Explanation]:
        """Return the sets of ``size`` members that are extended: the best one of each combination of places.

        Sets with a law of time, which only says when something differs, are extended in addition to the others.
        """
        found: dict[Places, Explanation] = {}
        for one in self._ranked(size):
            found.setdefault(places_of(self._problem, one.members), one)
        ranked, beam = list(found.values()), self._settings.beam
        why = [one for one in ranked if not self._says_when(one)][:beam]
        return [*why, *(one for one in ranked[:beam] if one not in why)]

    def _says_when(self, one: Explanation) -> bool:
        """Return whether a set has a law of time that is no clock's."""
        return any(item.law.says_when for item in one.laws)

    def _may_lead(self, parent: Explanation) -> bool:
        """Return whether one more member could make a set that is reported beside the best one, or instead of it.

        A best set of one member is extended in any case: with wrong values, a single member may absorb the effects of
        two (a late sensor and a clock that wanders), down to a residual that looks like noise.
        """
        best = self._best()
        return (parent is best and len(best.members) == 1) or self._within_reach(parent, more=1)

    def _within_reach(self, one: Explanation, *, more: int = 0, gain: float = 0.0) -> bool:
        """Return whether a set with ``more`` further members could at best be reported beside the best set.

        ``gain`` is a further gain of the set, in log units.
        """
        return one.log_evidence + one.promise + gain > self._reach(len(one.members) + more)

    def _reach(self, size: int) -> float:
        """Return the evidence from which a set of ``size`` members could be reported beside the best one."""
        best = self._best()
        return best.log_evidence + self.needed * (size - len(best.members)) - 0.5 * self._settings.apart

    def _promising(self, size: int) -> list[Explanation]:
        """Return the best sets of ``size`` members, as far as another fit of them could matter."""
        return [one for one in self._ranked(size)[: 2 * self._settings.beam] if self._within_reach(one)]

    def _take_better_forms(self, size: int) -> None:
        """Change the laws of the best sets to their most probable forms, one law after the other.

        Otherwise a law keeps the form in which it was measured. It may then have made up for effects that are now
        beside it, and the set pays for freedom of which it makes no use.
        """
        ranked = self._ranked(size)
        gain = {one.members: self.fits.better_form(one)[0] for one in ranked}
        best = sorted(ranked, key=lambda one: -one.log_evidence - gain[one.members])[: 2 * self._settings.beam]
        work = [one for one in best if self._within_reach(one, gain=gain[one.members])]
        self._keep(self._at_once(work, self.fits.in_better_form, step="better forms"))

    def _extend(self, parents: list[Explanation], size: int) -> None:
        """Fit every effect and measure every law beside each of the parents, and keep them."""
        work: list[tuple[EffectSet, str]] = []
        planned: set[EffectSet] = set()
        for parent in parents:
            for name in self._choices(size, beside=parent):
                members = with_member(parent.members, name)
                if name not in parent.members and members not in planned:
                    planned.add(members)
                    work.append((parent.members, name))
        self._grow(work, step="effects and laws" if size == 1 else f"sets of {size}")

    def _choices(self, size: int, *, beside: Explanation | None = None) -> list[str]:
        """Return the possible members of a set of ``size``: laws, which take longest, first.

        A law of time says when something differs and not why: beside an explanation it would absorb the explanation's
        error. Beside another law of time, as of two sensors that drift, there is no explanation that it could spoil.
        """
        when = size == 1 or (beside is not None and self._says_when(beside))
        laws = [law.id for law in self._problem.laws if when or not law.says_when]
        return [*laws, *(candidate.id for candidate in self._problem.candidates)]

    def _grow_otherwise(self, size: int) -> None:
        """Fit the best sets from each of their parts, and with members exchanged.

        The optimum of a pair may be near the fit of one part and not near that of the other. Another form of a law is
        tried with the set's values of the other members, and not with those that they have alone. In the best set the
        candidates at the places that explain most alone are tried, too: two that are equivalent alone (a late sensor
        and a late clock) may be distinguishable beside the other members.
        """
        best = [one.members for one in self._promising(size)]
        self._grow([(less(members, one), one) for members in best for one in members], step="from other parts")
        while work := self._exchanges(size):
            self._exchanged.update(work)
            self._keep(self._at_once(work, self._exchange, step="other forms"))

    def _exchanges(self, size: int) -> list[tuple[EffectSet, str, str]]:
        """Return the exchanges to try: a set, the member that is taken out, and the one that is put in."""
        best = [one.members for one in self._promising(size)]
        place = {name: places_of(self._problem, [name]) for name in self._choices(size)}
        single = (place[one.members[0]] for one in self._ranked(1) if not self._says_when(one))
        alone = list(dict.fromkeys(single))[: 2 * self._settings.beam] if size > 1 else []
        return [
            (members, one, name)
            for k, members in enumerate(best)
            for one in members
            for name in place
            if place[name] == place.get(one) or (k == 0 and place[name] in alone)
            if name not in members and (members, one, name) not in self._exchanged
        ]

    def _exchange(self, item: tuple[EffectSet, str, str]) -> Explanation:
        """Return a set with one member exchanged, fitted from the set's values.

        A law that replaces a usual form starts from the curve of that form, where it is known: the law can represent
        the form, and a fit from zero might have to pass jumps that derivatives do not show.
        """
        best, members = self._explanations[item[0]], less(item[0], item[1])
        fitter, laws = part_fitter(best, members)
        fit = fitter.at(fitter.ordered(members), best.fit.values, near=best.fit)
        without = Explanation(fitter, fit, laws, best.likelihood, -np.inf, self._progress)
        law, bar = self._laws.get(item[2]), self._bar_beside(members, best)
        if law is None:
            return self.fits.with_effect(without, item[2], bar=Bar(bar.least))
        curve = best.fitter.problem.curve_of(item[1], law, best.fit.values)
        return self.fits.with_law(without, law, curve=curve, bar=bar)

    def _bar_beside(self, members: EffectSet, one: Explanation) -> Bar:
        """Return what a member has to gain beside a part of a set, under the likelihood of the set."""
        reach, part = self._reach(len(one.members)), self._explanations.get(members)
        least = one.log_posterior + reach - one.log_evidence
        return Bar(least) if part is None else Bar(least, reach - part.log_evidence)

    def _grow(self, work: list[tuple[EffectSet, str]], *, step: str) -> None:
        """Extend fitted sets, each by one member, unless that was done before, and keep the results.

        Members of which the linear model promises most come first, in turns: what they gain raises the bar for the
        others, and a fit that cannot clear it ends early.
        """
        work = [item for item in work if item[0] in self._explanations and item not in self._grown]
        self._grown.update(work)
        looks = dict(zip(work, self._at_once(work, self._promised, step=f"{step}, a first look"), strict=True))
        candidates = {one.id: one for one in self._problem.candidates}

        def promise(item: tuple[EffectSet, str]) -> float:
            # A law can represent its usual forms, whose own linear model means little where their starts are far.
            laws = candidates[item[1]].laws if item[1] in candidates else ()
            return max(looks[item][0], *(looks[item[0], law][0] for law in laws if (item[0], law) in looks), 0.0)

        def hopeless(item: tuple[EffectSet, str]) -> bool:
            # What each explains alone is reported. Derivatives do not show jumps; and what an effect promises says
            # little where its starts are far, unless a law can represent it or they are read off the residual. Beside
            # two and more, such an effect promises what it gained beside some of them.
            parent, effect, hope = item[0], candidates.get(item[1]), promise(item)
            if parent == self._open and item[1] in self._laws:
                return False
            if effect is not None and (effect.jumps or not (effect.laws or effect.event)):
                hope = max(hope, self._gained(*item)) if len(parent) > 1 else np.inf
            return bool(parent) and not self._bar(self._explanations[parent], len(parent) + 1).cleared_by(hope)

        work.sort(key=lambda item: (-self._explanations[item[0]].log_evidence - promise(item), item))
        done = 0
        while done < len(work):
            turn = work[done : done + max(_TURN, done)]
            tried = [(item, looks[item][1]) for item in turn if not hopeless(item)]
            progress = partial(_counted, self._progress, done, len(work))
            self._keep(self._problem.at_once(tried, self._extended, step=step, progress=progress))
            done += len(turn)

    def _best_open(self) -> EffectSet | None:
        """Return the best set if it has members and leaves the record unexplained: derivatives say little of laws then.

        With its values such a set absorbs what it lacks: at its optimum the law that is missing may promise nothing.
        Without priors there is nothing to draw other values from.
        """
        best = self._best()
        left = best.likelihood.over_floor(best.residual)
        return best.members if best.members and left > self._problem.over_floor and self._drawn else None

    def _gained(self, members: EffectSet, name: str) -> float:
        """Return the most that a member gained alone, or beside a part of a set."""
        parts = [part for part in self._explanations if set(part) < set(members)]
        pairs = [(part, with_member(part, name)) for part in parts]
        gains = (
            self._explanations[whole].log_evidence - self._explanations[part].log_evidence
            for part, whole in pairs
            if whole in self._explanations
        )
        return max(gains, default=np.inf)

    def _promised(self, item: tuple[EffectSet, str]) -> tuple[float, dict[str, Floats]]:
        """Return what the linear model at a set promises of one more member, and the derivatives by a law's values."""
        parent, name = self._explanations[item[0]], item[1]
        if name not in self._laws:
            return 0.5 * parent.fitter.promise(parent.fit, name), {}
        measurement = Measurement(parent.fitter.problem, self._laws[name], parent.members, parent.likelihood)
        return measurement.promise(parent.fit.values, columns_of(parent.fit))

    def _extended(self, item: tuple[tuple[EffectSet, str], Mapping[str, Floats]]) -> Explanation:
        (members, name), columns = item
        parent = self._explanations[members]
        bar = self._bar(parent, len(members) + 1)
        if name in self._laws:
            law = self._laws[name]
            if members == self._open:
                return self.fits.with_law(parent, law, columns=columns, drawn=self._drawn, agree=self.needed)
            return self.fits.with_law(parent, law, bar=bar, columns=columns)
        return self.fits.with_effect(parent, name, bar=bar)

    def _bar(self, parent: Explanation, size: int) -> Bar:
        """Return what one more member has to gain beside a set, so that the new set is reported or extended."""
        least = self._reach(size)
        if size == 1:
            sets = self._parents(1)
            enough = len(sets) >= self._settings.beam
            least = min(least, *(one.log_evidence for one in sets)) if enough else -np.inf
        gain = least - parent.log_evidence
        return Bar(parent.log_posterior + gain, gain)

    def _look_again(self, size: int) -> None:
        """Fit the best sets, and the best smaller one, again from the base values of other sets.

        The best sets are also fitted from each effect's own starts, with all other values of the set: another start may
        now lead to a better optimum.
        """
        best = self._promising(size)
        if not best:
            return
        names = [p.name for p in self._problem.parameters]
        led = [{name: one.fit.values[name] for name in names} for one in best[: self._settings.beam]]
        work = [(one, base) for one in (*best, *self._ranked(size - 1)[:1]) for base in led]
        for one in best:
            effects = [one.fitter.candidates[name] for name in one.members if name not in self._laws]
            work += [(one, point) for effect in effects for point in effect.starting_points()]
        found: list[Explanation] = self._at_once(work, self._from_elsewhere, step="other starts")
        self._keep(found)

    @cached_property
    def _drawn(self) -> list[dict[str, float]]:
        """Base values with a prior, drawn from it: points of a Sobol sequence, the same for all sets and searches."""
        # Imported here: scipy.stats takes longer to import than most commands run.
        from scipy.stats.qmc import Sobol

        held = [p for p in self._problem.parameters if p.sigma is not None]
        if not held:
            return []
        starts = self._settings.starts
        # The sequence begins with a corner and the middle, from which the fits began.
        shares = Sobol(len(held), scramble=False).random_base2((starts + 1).bit_length())[2 : 2 + starts]
        return [
            {p.name: float(np.clip(p.value + p.sigma * z, p.lower, p.upper)) for p, z in zip(held, row, strict=True)}
            for row in ndtri(shares)
        ]

    def _fit_parts(self, best: Explanation) -> None:
        """Fit the parts of a set from the set's values: a part may have been passed over, or have missed its optimum.

        Alone, one of two effects may explain less than a third one that resembles both.
        """
        work = [(best, less(best.members, name)) for name in best.members]
        self._keep(self._at_once(work, self.fits.part, step="parts of the best"))

    def _from_elsewhere(self, item: tuple[Explanation, Mapping[str, float]]) -> Explanation:
        one, base = item
        if loss_at(one, base) < SETTLED:
            return one
        values = {**one.fit.values, **base}
        if one.laws and one.laws[-1].law.id in one.members:
            last = one.laws[-1]
            members = less(one.members, last.law.id)
            fitter, laws = part_fitter(one, members)
            start = {name: value for name, value in values.items() if name not in last.form.names}
            bar = self._bar_beside(members, one)
            again = measure_law(fitter.problem, last.law, start, effects=members, likelihood=one.likelihood, bar=bar)
            if not again.hopes:
                return one
            without = Explanation(fitter, one.fit, laws, one.likelihood, -np.inf, self._progress)
            return self.fits.explained(without, again)
        hopes = may_clear(one, Bar(one.log_posterior + self._reach(len(one.members)) - one.log_evidence))
        fit = one.fitter.fit(one.fit.effects, [values], max_iterations=16, keep=1, follow=hopes)
        return self.fits.settled(one.fitter.problem, fit, one.laws) if hopes(fit) else one

    def _follow_best(self, *, longest: float) -> None:
        """Estimate floor and correlation from the best set's residual, and compute every set's evidence under these.

        ``longest`` is the largest correlation time, in samples, that is assumed. Where the plain model's residual is no
        larger than the noise of the inputs, it is noise and gives the correlation: a law would smooth it.
        """
        best = plain = self._explanations[()]
        if self.fits.is_noise(plain.likelihood, plain.residual):
            longest = np.inf
        else:
            best = self._best()
        self._explanations = self.fits.followed(best, self._explanations, longest=longest)

    def _keep(self, found: list[Explanation]) -> None:
        """Keep sets that are new, or more probable than the same set was before."""
        for one in found:
            key = tuple(sorted(one.members))
            if key not in self._explanations or self._explanations[key].log_evidence < one.log_evidence:
                self._explanations[key] = one

    def _ranked(self, size: int) -> list[Explanation]:
        found = [one for one in self._explanations.values() if len(one.members) == size]
        return sorted(found, key=lambda one: (-one.log_evidence, one.members))

    def _best(self) -> Explanation:
        """Return the most probable set."""
        return max(
            self._explanations.values(),
            key=lambda one: (one.log_evidence - self.needed * len(one.members), one.members),
        )


def _counted(progress: Progress, before: int, whole: int, step: str, done: int, _: int | None) -> None:
    """Report the progress of a part of the work."""
    progress(step, before + done, whole)
