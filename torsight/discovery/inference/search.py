"""The search for sets of effects and laws that explain a record: first single ones, then extensions of the best.

Every effect is fitted and every law measured together with the plain model. Each of the best sets is fitted again from
the base values of the others, because a set whose optimum was missed would be underrated. The best few sets are
extended by every other effect and law as long as the residual is more than noise. All are compared by their evidence
under one likelihood, whose floor and correlation come from the best of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Final

import numpy as np

from torsight.core.law import Law
from torsight.core.progress import Progress
from torsight.core.units import Floats
from torsight.discovery.inference.explanation import (
    Explanation,
    Field,
    Places,
    family_evidence,
    log_posterior,
    loss_at,
    may_clear,
    part_fitter,
    places_of,
    residual_of,
    weighted_fitter,
)
from torsight.discovery.inference.fitting import WORTH, EffectSet, Fit, Fitter, less, with_member
from torsight.discovery.inference.likelihood import Likelihood
from torsight.discovery.inference.measure import (
    NO_BAR,
    SETTLED,
    Bar,
    Measured,
    better_form,
    log_evidence,
    measure_law,
    promise_of,
)
from torsight.discovery.inference.noise import (
    Stretches,
    correlation_samples,
    first_scales,
    information,
    reading_noise,
    residual_scales,
)
from torsight.discovery.interface import Problem
from torsight.discovery.settings import Settings

_ROUNDS: Final = 6
"""Largest number of rounds of weights."""
_TURN: Final = 4
"""Number of extensions that are fitted before the bar is set anew, at first; then as many as before: a choice."""
_FIRST_CORRELATION: Final = 4.0
"""Largest correlation time, in samples, that is assumed before a set explains a record that shows more than noise: the
residual due to a missing effect is correlated over a whole stroke, which says nothing about the noise."""


class Search:
    """Fits the sets that have to be compared; see :meth:`run`."""

    def __init__(self, problem: Problem, *, settings: Settings, progress: Progress) -> None:
        self._problem = problem
        self._settings = settings
        self._progress = progress
        self._stretches = Stretches.of(problem)
        self._explanations: dict[EffectSet, Explanation] = {}
        self._grown: set[tuple[EffectSet, str]] = set()
        self._exchanged: set[tuple[EffectSet, str, str]] = set()
        self._at_once = partial(problem.at_once, progress=progress)
        self._laws = {law.id: law for law in problem.laws}
        self._reading = problem.sigma
        self._correlation_samples = 1.0

    def run(self) -> Field:
        """Return the plain model and the sets that grew out of the best ones."""
        first = self.plain()
        self._keep([first])
        for size in range(1, self._settings.most + 1):
            if size > 1:
                # Floor and correlation have changed since these sets were fitted.
                self._keep(self._at_once(self._parents(size - 1), self._again))
            parents = [parent for parent in self._parents(size - 1) if self._may_lead(parent)]
            if not parents:
                break
            self._extend(parents, size)
            if size > 1:
                self._take_better_forms(size)
            self._grow_otherwise(size)
            self._look_again(size)
            self._fit_parts(self._best())
            # What a set that lacks something leaves is correlated by that, and says nothing of the noise yet.
            self._follow_best(longest=_FIRST_CORRELATION)
            smaller = max(one.log_evidence for one in self._explanations.values() if len(one.members) < size)
            if self._best().log_evidence < smaller + self.needed:
                break
        self._follow_best(longest=np.inf)
        found = self._at_once(self._in_reach(), self._sharpened, step="how well it is known")
        self._explanations.update((one.members, one) for one in found)
        return Field(self._best().likelihood, self._stretches, self._explanations, first)

    def _in_reach(self) -> list[Explanation]:
        """Return the sets that could be reported, were they a little more probable."""
        sets = self._explanations.values()
        return [one for one in sets if one.log_evidence > self._reach(len(one.members)) - 0.5 * self._settings.apart]

    def _sharpened(self, one: Explanation) -> Explanation:
        """Return a set with derivatives that are accurate along directions of least information, and its evidence."""
        fit = one.fitter.sharpened(one.fit)
        evidence = log_evidence(one.fitter, fit, one.likelihood) + family_evidence(one.laws)
        return replace(one, fit=fit, log_evidence=evidence)

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

    def plain(self) -> Explanation:
        """Fit the plain model from the priors' means and from the problem's other starts (``elsewhere``)."""
        problem, stretches = self._problem, self._stretches
        fitter = Fitter(problem, information(stretches, first_scales(problem, stretches), problem.sigma))
        fit = fitter.base()
        for _ in range(2):
            self._reading = self._reading_noise(problem, fit)
            inputs = self._likelihood_of(problem, fit)
            scales = residual_scales(residual_of(problem, fit.solution.prediction), stretches, inputs.noise)
            fitter = Fitter(problem, information(stretches, scales, inputs.noise))
            fit = fitter.from_elsewhere(fitter.refit(fit))
        noise = self._is_noise(inputs, residual_of(problem, fit.solution.prediction))
        self._correlation_samples = min(scales.correlation_samples, np.inf if noise else _FIRST_CORRELATION)
        first = self._settled(problem, fit, ())
        # Once more from where it ended, with derivatives taken anew, and from the priors' means under this likelihood.
        again = (self.fit_from(start) for start in (first.fit.values, fitter.nominal.values))
        return max(first, *again, key=lambda one: one.log_posterior)

    def fit_from(self, start: Mapping[str, float], effects: EffectSet = ()) -> Explanation:
        """Fit a set of effects from given values: under the likelihood there, then twice under that at the optimum."""
        for _ in range(3):
            prediction = self._problem.predict(start, effects)
            likelihood = self._likelihood_at(self._problem, start, effects)
            fitter = weighted_fitter(likelihood, self._problem, prediction)
            fit = fitter.from_elsewhere(fitter.fit(effects, [start], max_iterations=40))
            start = fit.values
        return self._settled(self._problem, fit, ())

    def has_settled(self, found: Explanation) -> bool:
        """Return whether a further fit of a set of effects from its optimum gains nothing that matters."""
        again = self.fit_from(found.fit.values, found.fit.effects)
        return again.log_posterior <= found.log_posterior + SETTLED

    def _is_noise(self, likelihood: Likelihood, residual: Floats) -> bool:
        """Return whether a residual is no larger than the noise of the inputs, where the reading noise is known."""
        return _knows_reading(self._problem) and likelihood.accounts_for(residual)

    def _reading_noise(self, problem: Problem, fit: Fit) -> Floats:
        """Return the reading noise (n,), estimated from a fit's residual where it is not given."""
        if _knows_reading(problem):
            return problem.sigma
        left = residual_of(problem, fit.solution.prediction)
        return np.full(len(left), reading_noise(problem, self._stretches, left))

    def _likelihood_of(self, problem: Problem, fit: Fit) -> Likelihood:
        return self._likelihood_at(problem, fit.values, fit.effects)

    def _likelihood_at(self, problem: Problem, values: Mapping[str, float], effects: EffectSet) -> Likelihood:
        """Return the likelihood with the inputs' noise at given values, and with the current correlation time."""
        floor = np.hypot(self._reading, problem.input_noise(values, effects))
        shared, tau = problem.shared_errors(values, effects), self._correlation_samples
        return Likelihood.of(self._stretches, floor, tau, least=self._problem.resolution, shared=shared)

    def _settled(
        self, problem: Problem, fit: Fit, laws: tuple[Measured, ...], likelihood: Likelihood | None = None
    ) -> Explanation:
        """Return a fit at the weights of its own residual, with its evidence.

        ``likelihood`` is that at the fit's values, where it is known already. The noise of the inputs changes with the
        values, most where a disk jumps in another row: it is computed anew as long as the set gains by that.
        """
        likelihood = likelihood or self._likelihood_of(problem, fit)
        best, best_value = fit, log_posterior(likelihood, problem, fit)
        for _ in range(_ROUNDS):
            found = weighted_fitter(likelihood, problem, best.solution.prediction).refit(best, max_iterations=8)
            gained = log_posterior(likelihood, problem, found) - best_value
            if gained >= 0.0:
                best, best_value = found, best_value + gained
            if gained > SETTLED:
                continue
            own = self._likelihood_of(problem, best)
            gained = log_posterior(own, problem, best) - best_value
            if gained <= SETTLED:
                break
            likelihood, best_value = own, best_value + gained
        fitter = weighted_fitter(likelihood, problem, best.solution.prediction)
        evidence = log_evidence(fitter, best, likelihood) + family_evidence(laws)
        return Explanation(fitter, fitter.weighed(best), laws, likelihood, evidence, self._progress)

    def _again(self, one: Explanation) -> Explanation:
        """Return a set fitted again from its own optimum."""
        return self._settled(one.fitter.problem, one.fit, one.laws, one.likelihood)

    def _beside(
        self, parent: Explanation, problem: Problem, fit: Fit, laws: tuple[Measured, ...], own: Likelihood | None = None
    ) -> Explanation:
        """Return an extended set, settled under its own likelihood, or else under that of the set that it extends.

        It contains that set, so a posterior density below that set's shows a missed optimum: a disk that jumps in
        another row than the one where the noise at the start expected it.
        """
        found = self._settled(problem, fit, laws, own)
        if found.log_posterior >= parent.log_posterior:
            return found
        return max(found, self._settled(problem, fit, laws, parent.likelihood), key=lambda one: one.log_evidence)

    def _take_better_forms(self, size: int) -> None:
        """Change the laws of the best sets to their most probable forms, one law after the other.

        Otherwise a law keeps the form in which it was measured. It may then have made up for effects that are now
        beside it, and the set pays for freedom of which it makes no use.
        """
        ranked = self._ranked(size)
        gain = {one.members: self._better_form(one)[0] for one in ranked}
        best = sorted(ranked, key=lambda one: -one.log_evidence - gain[one.members])[: 2 * self._settings.beam]
        work = [one for one in best if self._within_reach(one, gain=gain[one.members])]
        self._keep(self._at_once(work, self._in_better_form, step="better forms"))

    def _better_form(self, one: Explanation) -> tuple[float, Measured | None]:
        """Return the gain in log units and the law, in its better form, that gains most in another form."""
        found = [better_form(law, one.fitter, one.fit, one.likelihood) for law in one.laws]
        return max(found, key=lambda item: item[0], default=(0.0, None))

    def _in_better_form(self, one: Explanation) -> Explanation:
        """Return a set with its laws in better forms, as long as each change increases the evidence."""
        while True:
            gain, law = self._better_form(one)
            if law is None or gain <= SETTLED:
                return one
            members, before = one.fit.effects, one.fitter.problem
            forms = [law.form if form.id == law.law.id else form for form in before.forms]
            problem = before.with_laws(forms)
            law = replace(law, prediction=problem.predict(law.values, members))
            fit = law.as_fit(Fitter(problem, one.fitter.weight), members)
            laws = tuple(law if item.law.id == law.law.id else item for item in one.laws)
            found = self._settled(problem, fit, laws, one.likelihood)
            if found.log_evidence <= one.log_evidence + SETTLED:
                return one
            one = found

    def _extend(self, parents: list[Explanation], size: int) -> None:
        """Fit every effect and measure every law beside each of the parents, and keep them."""
        work: list[tuple[EffectSet, str]] = []
        planned: set[EffectSet] = set()
        for parent in parents:
            for name in self._choices(size):
                members = with_member(parent.members, name)
                if name not in parent.members and members not in planned:
                    planned.add(members)
                    work.append((parent.members, name))
        self._grow(work, step="effects and laws" if size == 1 else f"sets of {size}")

    def _choices(self, size: int) -> list[str]:
        """Return the possible members of a set of ``size``: laws, which take longest, first.

        A law of time says when something differs and not why: beside an explanation it would absorb the explanation's
        error.
        """
        laws = [law.id for law in self._problem.laws if size == 1 or not law.says_when]
        return [*laws, *(candidate.id for candidate in self._problem.candidates)]

    def _grow_otherwise(self, size: int) -> None:
        """Fit the best sets from each of their parts, and with members exchanged.

        The optimum of a pair may be near the fit of one part and not near that of the other. Another form of a law is
        tried with the set's values of the other members, and not with those that they have alone. In the best set the
        candidates that explain most alone are tried, too: two that are equivalent alone (a late sensor and a late
        clock) may be distinguishable beside the other members.
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
        single = [one.members[0] for one in self._ranked(1) if not self._says_when(one)]
        alone = set(single[: 2 * self._settings.beam]) if size > 1 else set()
        return [
            (members, one, name)
            for k, members in enumerate(best)
            for one in members
            for name in place
            if place[name] == place.get(one) or (k == 0 and name in alone)
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
            return self.with_effect(without, item[2], bar=Bar(bar.least))
        curve = best.fitter.problem.curve_of(item[1], law, best.fit.values)
        return self._with_law(without, law, curve=curve, bar=bar)

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
            if effect is not None and (effect.jumps or not (effect.laws or effect.propose)):
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
        return promise_of(parent.fitter.problem, self._laws[name], parent.fit.values, effects=parent.members,
                          likelihood=parent.likelihood, known=_columns_of(parent.fit))  # fmt: skip

    def _extended(self, item: tuple[tuple[EffectSet, str], Mapping[str, Floats]]) -> Explanation:
        (members, name), columns = item
        parent = self._explanations[members]
        bar = self._bar(parent, len(members) + 1)
        if name in self._laws:
            return self._with_law(parent, self._laws[name], bar=bar, columns=columns)
        return self.with_effect(parent, name, bar=bar)

    def _bar(self, parent: Explanation, size: int) -> Bar:
        """Return what one more member has to gain beside a set, so that the new set is reported or extended."""
        least = self._reach(size)
        if size == 1:
            sets = self._parents(1)
            enough = len(sets) >= self._settings.beam
            least = min(least, *(one.log_evidence for one in sets)) if enough else -np.inf
        gain = least - parent.log_evidence
        return Bar(parent.log_posterior + gain, gain)

    def with_effect(self, parent: Explanation, name: str, *, bar: Bar = NO_BAR) -> Explanation:
        """Fit one more effect beside a fitted set, as long as it may clear a bar."""
        hopes = may_clear(parent, bar)
        fit = parent.fitter.extend(parent.fit, name, from_means=parent.pulled > SETTLED, hopes=hopes)
        if fit.cost > parent.cost - WORTH or not hopes(fit):
            # Where nothing is gained the residual is the parent's, and worth the same.
            evidence = log_evidence(parent.fitter, fit, parent.likelihood) + family_evidence(parent.laws)
            return replace(parent, fit=fit, log_evidence=evidence)
        return self._beside(parent, parent.fitter.problem, fit, parent.laws)

    def _with_law(
        self,
        parent: Explanation,
        law: Law,
        *,
        curve: Floats | None = None,
        bar: Bar = NO_BAR,
        columns: Mapping[str, Floats] | None = None,
    ) -> Explanation:
        """Measure a law beside a set: from the set's optimum and, where base values are pulled, the priors' means.

        Where a missing effect has pulled the base values off, the second start leads to the minimum that agrees with
        the priors; beside other members it is tried unless the first ends as hopeless. Where no value has a prior, the
        problem's other starts (``elsewhere``) are used, too. From a given ``curve`` the law is measured from the set's
        optimum alone. ``columns`` are derivatives by the law's values at the optimum, where they are known.
        """
        problem, fit = parent.fitter.problem, parent.fit
        measure = partial(measure_law, problem, law, effects=parent.members, likelihood=parent.likelihood, bar=bar)
        found = [measure(fit.values, known=_columns_of(fit) | dict(columns or {}), curve=curve)]
        if curve is None and parent.pulled > SETTLED and (found[0].hopes or not parent.members):
            nominal = parent.fitter.nominal
            known = {} if parent.members else _columns_of(nominal)
            found.append(measure({**fit.values, **nominal.values}, known=known))
        elif curve is None and all(parameter.sigma is None for parameter in problem.parameters):
            found += [measure({**fit.values, **place}) for place in problem.elsewhere]
        best = max(found, key=lambda measured: measured.log_evidence)
        return self._explained(parent, best)

    def _explained(self, parent: Explanation, measured: Measured) -> Explanation:
        """Return a law that was measured beside a set as an explanation: its form is one more candidate.

        A law is measured under the likelihood of the set beside it, and then fitted under its own. A law that was given
        up as hopeless is not fitted.
        """
        before, members = parent.fitter.problem, (*parent.members, measured.law.id)
        extended, laws = before.with_laws((*before.forms, measured.form)), (*parent.laws, measured)
        under = parent.likelihood
        if measured.hopes:
            under = self._likelihood_at(extended, measured.values, members)
        fitter = weighted_fitter(under, extended, measured.prediction)
        fit = measured.as_fit(fitter, members)
        if measured.hopes:
            return self._beside(parent, extended, fit, laws, under)
        evidence = log_evidence(fitter, fit, under) + family_evidence(laws)
        return Explanation(fitter, fit, laws, under, evidence, self._progress)

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

    def _fit_parts(self, best: Explanation) -> None:
        """Fit the parts of a set from the set's values: a part may have been passed over, or have missed its optimum.

        Alone, one of two effects may explain less than a third one that resembles both.
        """
        parts = [part for part in (less(best.members, name) for name in best.members) if part]
        found: list[Explanation] = self._at_once([(best, part) for part in parts], self._part)
        self._keep(found)

    def _part(self, item: tuple[Explanation, EffectSet]) -> Explanation:
        """Return a part of a set, fitted from the set's values; its laws keep their forms."""
        best, members = item
        fitter, laws = part_fitter(best, members)
        effects = fitter.ordered(members)
        start = {p.name: best.fit.values[p.name] for p in fitter.parameters(effects)}
        return self._settled(fitter.problem, fitter.fit(effects, [start], keep=1), laws)

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
            return self._explained(without, again)
        hopes = may_clear(one, Bar(one.log_posterior + self._reach(len(one.members)) - one.log_evidence))
        fit = one.fitter.fit(one.fit.effects, [values], max_iterations=16, keep=1, follow=hopes)
        return self._settled(one.fitter.problem, fit, one.laws) if hopes(fit) else one

    def _follow_best(self, *, longest: float) -> None:
        """Estimate floor and correlation from the best set's residual, and compute every set's evidence under these.

        ``longest`` is the largest correlation time, in samples, that is assumed. Where the plain model's residual is no
        larger than the noise of the inputs, it is noise and gives the correlation: a law would smooth it.
        """
        best = plain = self._explanations[()]
        if self._is_noise(plain.likelihood, plain.residual):
            longest = np.inf
        else:
            best = self._best()
        before, self._reading = self._reading, self._reading_noise(best.fitter.problem, best.fit)
        scaled = best.likelihood.in_scales(best.residual)
        self._correlation_samples = min(correlation_samples(scaled, self._stretches), longest)
        for members, one in list(self._explanations.items()):
            floor = np.sqrt(np.maximum(one.likelihood.floor**2 - before**2, 0.0) + self._reading**2)
            likelihood = replace(one.likelihood, floor=floor).correlated(self._stretches, self._correlation_samples)
            # The plain model keeps its own weights: its values and errors do not depend on what it is compared with.
            weighted = weighted_fitter(likelihood, one.fitter.problem, one.fit.solution.prediction)
            self._explanations[members] = replace(
                one,
                fitter=weighted if members else one.fitter,
                fit=weighted.weighed(one.fit) if members else one.fit,
                likelihood=likelihood,
                log_evidence=log_evidence(weighted, one.fit, likelihood) + family_evidence(one.laws),
            )

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


def _columns_of(fit: Fit) -> dict[str, Floats]:
    """Return a fit's derivatives (n,) by each of its values."""
    return dict(zip(fit.values, fit.solution.jacobian.T, strict=True))


def _knows_reading(problem: Problem) -> bool:
    """Return whether a problem's reading noise is given."""
    return bool(problem.sigma[problem.valid].any())
