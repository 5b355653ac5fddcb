"""Fits of a single set of effects and laws: the plain model, one more member beside a set, a part, another form.

A set is fitted under its own likelihood, because the model propagates errors of the inputs. Floor and correlation time
of the likelihood are those of the residual of the best set so far (:meth:`SetFits.followed`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Final

import numpy as np

from torsight.core.law import Law
from torsight.core.progress import Progress
from torsight.core.series import rms
from torsight.core.units import Floats
from torsight.discovery.inference.explanation import (
    Explanation,
    family_evidence,
    log_posterior,
    may_clear,
    part_fitter,
    weighted_fitter,
)
from torsight.discovery.inference.fitting import WORTH, EffectSet, Fit, Fitter
from torsight.discovery.inference.laplace import log_evidence, residual_of
from torsight.discovery.inference.law.measure import NO_BAR, SETTLED, Bar, Measured, better_form, measure_law
from torsight.discovery.inference.likelihood import Likelihood
from torsight.discovery.inference.noise import (
    Stretches,
    correlation_samples,
    first_scales,
    information,
    reading_noise,
    residual_scales,
)
from torsight.discovery.interface import Problem

_ROUNDS: Final = 6
"""Largest number of rounds of weights."""
FIRST_CORRELATION: Final = 4.0
"""Largest correlation time, in samples, that is assumed before a set explains a record that shows more than noise: the
residual due to a missing effect is correlated over a whole stroke, which says nothing about the noise."""


class SetFits:
    """Fits one set after the other; floor and correlation of the likelihood are those of the best one so far."""

    def __init__(self, problem: Problem, *, progress: Progress) -> None:
        self._problem = problem
        self._progress = progress
        self.stretches = Stretches.of(problem)
        self._reading = problem.sigma
        self._inputs: tuple[Problem, tuple[Mapping[str, float], EffectSet], tuple[Floats, Floats]] | None = None
        self._correlate(1.0)

    def plain(self) -> Explanation:
        """Fit the plain model from the priors' means and from the problem's other starts (``elsewhere``)."""
        problem, stretches = self._problem, self.stretches
        fitter = Fitter(problem, information(stretches, first_scales(problem, stretches), problem.sigma))
        fit = fitter.base()
        for _ in range(2):
            self._reading = self._reading_noise(problem, fit)
            inputs = self._likelihood_of(problem, fit)
            scales = residual_scales(residual_of(problem, fit.solution.prediction), stretches, inputs.noise)
            fitter = Fitter(problem, information(stretches, scales, inputs.noise))
            fit = fitter.from_elsewhere(fitter.refit(fit))
        noise = self.is_noise(inputs, residual_of(problem, fit.solution.prediction))
        self._correlate(min(scales.correlation_samples, np.inf if noise else FIRST_CORRELATION))
        first = self.settled(problem, fit, ())
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
        return self.settled(self._problem, fit, ())

    def has_settled(self, found: Explanation) -> bool:
        """Return whether a further fit of a set of effects from its optimum gains nothing that matters."""
        again = self.fit_from(found.fit.values, found.fit.effects)
        return again.log_posterior <= found.log_posterior + SETTLED

    def with_effect(self, parent: Explanation, name: str, *, bar: Bar = NO_BAR) -> Explanation:
        """Fit one more effect beside a fitted set, as long as it may clear a bar."""
        hopes = may_clear(parent, bar)
        fit = parent.fitter.extend(parent.fit, name, from_means=parent.pulled > SETTLED, hopes=hopes)
        if fit.cost > parent.cost - WORTH or not hopes(fit):
            # Where nothing is gained the residual is the parent's, and worth the same.
            evidence = log_evidence(parent.fitter, fit, parent.likelihood) + family_evidence(parent.laws)
            return replace(parent, fit=fit, log_evidence=evidence)
        return self._beside(parent, parent.fitter.problem, fit, parent.laws)

    def with_law(
        self,
        parent: Explanation,
        law: Law,
        *,
        curve: Floats | None = None,
        bar: Bar = NO_BAR,
        columns: Mapping[str, Floats] | None = None,
        drawn: Sequence[Mapping[str, float]] = (),
        agree: float = 0.0,
    ) -> Explanation:
        """Measure a law beside a set: from the set's optimum and, where base values are pulled, the priors' means.

        Where a missing effect has pulled the base values off, the second start leads to the minimum that agrees with
        the priors; beside other members it is tried unless the first ends as hopeless. Where no value has a prior, the
        problem's other starts (``elsewhere``) are used, too. From a given ``curve`` the law is measured from the set's
        optimum alone. ``columns`` are derivatives by the law's values at the optimum, where they are known.

        With ``drawn`` base values both starts are used, and as long as no two have led to the best evidence, to within
        ``agree``, the drawn ones are starts, too: there are several optima then.
        """
        problem, fit = parent.fitter.problem, parent.fit
        measure = partial(measure_law, problem, law, effects=parent.members, likelihood=parent.likelihood, bar=bar)
        found = [measure(fit.values, known=columns_of(fit) | dict(columns or {}), curve=curve)]
        if drawn or (curve is None and parent.pulled > SETTLED and (found[0].hopes or not parent.members)):
            nominal = parent.fitter.nominal
            known = {} if parent.members else columns_of(nominal)
            found.append(measure({**fit.values, **nominal.values}, known=known))
        elif curve is None and all(parameter.sigma is None for parameter in problem.parameters):
            found += [measure({**fit.values, **place}) for place in problem.elsewhere]
        for base in drawn:
            first, second = sorted((one.log_evidence for one in found), reverse=True)[:2]
            if first - second <= agree:
                break
            found.append(measure({**fit.values, **base}))
        best = max(found, key=lambda measured: measured.log_evidence)
        return self.explained(parent, best)

    def explained(self, parent: Explanation, measured: Measured) -> Explanation:
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

    def part(self, item: tuple[Explanation, EffectSet]) -> Explanation:
        """Return a part of a set, fitted from the set's values; its laws keep their forms.

        The noise of the inputs is the same whatever is in the set. Where few draws show the noise at the set's values
        and not at the part's (a disk jumps in another row), the part is judged by the noise of the set.
        """
        best, members = item
        fitter, laws = part_fitter(best, members)
        effects = fitter.ordered(members)
        start = {p.name: best.fit.values[p.name] for p in fitter.parameters(effects)}
        return self.settled(fitter.problem, fitter.fit(effects, [start], keep=1), laws, best.likelihood)

    def settled(
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

    def again(self, one: Explanation) -> Explanation:
        """Return a set fitted again from its own optimum."""
        return self.settled(one.fitter.problem, one.fit, one.laws, one.likelihood)

    def _beside(
        self, parent: Explanation, problem: Problem, fit: Fit, laws: tuple[Measured, ...], own: Likelihood | None = None
    ) -> Explanation:
        """Return an extended set, settled under its own likelihood, or else under that of the set that it extends.

        It contains that set, so a posterior density below that set's shows a missed optimum: a disk that jumps in
        another row than the one where the noise at the start expected it.
        """
        found = self.settled(problem, fit, laws, own)
        if found.log_posterior >= parent.log_posterior:
            return found
        return max(found, self.settled(problem, fit, laws, parent.likelihood), key=lambda one: one.log_evidence)

    def sharpened(self, one: Explanation) -> Explanation:
        """Return a set with derivatives that are accurate along directions of least information, and its evidence."""
        fit = one.fitter.sharpened(one.fit)
        evidence = log_evidence(one.fitter, fit, one.likelihood) + family_evidence(one.laws)
        return replace(one, fit=fit, log_evidence=evidence)

    def better_form(self, one: Explanation) -> tuple[float, Measured | None]:
        """Return the gain in log units and the law, in its better form, that gains most in another form."""
        found = [better_form(law, one.fitter, one.fit, one.likelihood) for law in one.laws]
        return max(found, key=lambda item: item[0], default=(0.0, None))

    def in_better_form(self, one: Explanation) -> Explanation:
        """Return a set with its laws in better forms, as long as each change increases the evidence."""
        while True:
            gain, law = self.better_form(one)
            if law is None or gain <= SETTLED:
                return one
            members, before = one.fit.effects, one.fitter.problem
            forms = [law.form if form.id == law.law.id else form for form in before.forms]
            problem = before.with_laws(forms)
            law = replace(law, prediction=problem.predict(law.values, members))
            fit = law.as_fit(Fitter(problem, one.fitter.weight), members)
            laws = tuple(law if item.law.id == law.law.id else item for item in one.laws)
            found = self.settled(problem, fit, laws, one.likelihood)
            if found.log_evidence <= one.log_evidence + SETTLED:
                return one
            one = found

    def is_noise(self, likelihood: Likelihood, residual: Floats) -> bool:
        """Return whether a residual is no larger than the noise of the inputs, where the reading noise is known."""
        return _knows_reading(self._problem) and likelihood.accounts_for(residual)

    def _reading_noise(self, problem: Problem, fit: Fit) -> Floats:
        """Return the reading noise (n,), estimated from a fit's residual where it is not given."""
        if _knows_reading(problem):
            return problem.sigma
        left = residual_of(problem, fit.solution.prediction)
        return np.full(len(left), reading_noise(problem, self.stretches, left))

    def _likelihood_of(self, problem: Problem, fit: Fit) -> Likelihood:
        return self._likelihood_at(problem, fit.values, fit.effects)

    def _likelihood_at(self, problem: Problem, values: Mapping[str, float], effects: EffectSet) -> Likelihood:
        """Return the likelihood with the inputs' noise at given values, and with the current correlation time."""
        noise, shared = self._inputs_at(problem, values, effects)
        lasting, levels = self.stretches.lasting(noise, problem.block), None
        if lasting.size:
            # The inputs' errors last, and so does the model's discrepancy, whose size is that of what is left at rest.
            left = residual_of(problem, problem.predict(values, effects))
            levels = rms(left[problem.rest & problem.valid]) * lasting.astype(np.float64)
            shared, noise = np.hstack([shared, noise[:, None] * lasting]), np.where(lasting.any(axis=1), 0.0, noise)
        floor, tau, least = np.hypot(self._reading, noise), self._correlation_samples, self._problem.resolution
        return Likelihood.of(self.stretches, floor, tau, count=self._count, least=least, shared=shared, levels=levels)

    def _inputs_at(self, problem: Problem, values: Mapping[str, float], effects: EffectSet) -> tuple[Floats, Floats]:
        """Return the inputs' noise and their shared errors: dozens of simulations.

        Those of the last values are kept, because a set is often judged again where its fit has ended.
        """
        last = self._inputs
        if last is not None and last[0] is problem and last[1] == (values, effects):
            return last[2]
        found = problem.input_noise(values, effects), problem.shared_errors(values, effects)
        self._inputs = problem, (dict(values), effects), found
        return found

    def _correlate(self, correlation_samples: float, inputs: Floats | None = None) -> None:
        """Set the correlation time and the pieces of information per sample, which are the same for all sets.

        ``inputs`` (n,) is the part of every sample's variance that noise of the inputs causes; none by default.
        """
        self._correlation_samples, self._count = correlation_samples, self.stretches.counts(correlation_samples)
        if inputs is not None:
            time_s, alike_s = self._problem.time_s, self._problem.input_alike_s
            self._count = self.stretches.counts_with(self._count, inputs, time_s, alike_s)

    def followed(
        self, best: Explanation, sets: Mapping[EffectSet, Explanation], *, longest: float
    ) -> dict[EffectSet, Explanation]:
        """Return sets under the floor and the correlation that the residual of the best one shows.

        ``longest`` is the largest correlation time, in samples, that is assumed.
        """
        before, self._reading = self._reading, self._reading_noise(best.fitter.problem, best.fit)
        scaled = best.likelihood.in_scales(best.residual)
        inputs = np.maximum(best.likelihood.floor**2 - before**2, 0.0) / best.likelihood.own_variance(best.residual)
        self._correlate(min(correlation_samples(scaled, self.stretches), longest), np.minimum(inputs, 1.0))
        return {members: self._at_present(one, before) for members, one in sets.items()}

    def _at_present(self, one: Explanation, before: Floats) -> Explanation:
        """Return a set under the present floor and correlation; ``before`` (n,) is the earlier reading noise."""
        floor = np.sqrt(np.maximum(one.likelihood.floor**2 - before**2, 0.0) + self._reading**2)
        own, tau = one.likelihood, self._correlation_samples
        likelihood = replace(own, floor=floor, count=self._count, correlation_samples=tau)
        # The plain model keeps its own weights: its values and errors do not depend on what it is compared with.
        weighted = weighted_fitter(likelihood, one.fitter.problem, one.fit.solution.prediction)
        return replace(
            one,
            fitter=weighted if one.members else one.fitter,
            fit=weighted.weighed(one.fit) if one.members else one.fit,
            likelihood=likelihood,
            log_evidence=log_evidence(weighted, one.fit, likelihood) + family_evidence(one.laws),
        )


def columns_of(fit: Fit) -> dict[str, Floats]:
    """Return a fit's derivatives (n,) by each of its values."""
    return dict(zip(fit.values, fit.solution.jacobian.T, strict=True))


def _knows_reading(problem: Problem) -> bool:
    """Return whether a problem's reading noise is given."""
    return bool(problem.sigma[problem.valid].any())
