"""Fitted sets of effects and laws, comparable by their evidence, and the uncertainty of their values.

The uncertainty of a value has two parts: the curvature of the posterior under the likelihood of the residual
(:mod:`.likelihood`), and the error of a model that is a little wrong in a different way in every block, which shows
when whole blocks are left out (the jackknife; Efron and Stein, Ann. Statist. 9 (1981) 586).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from torsight.core.law import LawForm
from torsight.core.parameter import Estimate
from torsight.core.progress import Progress, silent
from torsight.core.units import Floats
from torsight.discovery.inference.fitting import EffectSet, Fit, Fitter, space_of
from torsight.discovery.inference.laplace import ahead, residual_of
from torsight.discovery.inference.law.measure import FURTHER, Bar, Measured
from torsight.discovery.inference.likelihood import Likelihood
from torsight.discovery.inference.noise import Stretches
from torsight.discovery.inference.priors import prior_cost, prior_cost_of
from torsight.discovery.inference.validate import HeldOut, block_labels, held_out_by_refit
from torsight.discovery.interface import Problem
from torsight.discovery.weight import Weight

Places = frozenset[str]


@dataclass(frozen=True, eq=False)
class Explanation:
    """A fitted set; :attr:`held_out`, its prediction of blocks that were left out, is computed when first used.

    ``fitter`` is the problem with the set's laws among its candidates, and the weights at which it was fitted. The
    likelihood depends on the set, because the model propagates errors of the inputs; ``log_evidence`` is comparable
    among explanations of one field.
    """

    fitter: Fitter
    fit: Fit
    laws: tuple[Measured, ...]
    likelihood: Likelihood
    log_evidence: float
    progress: Progress = silent

    @cached_property
    def held_out(self) -> HeldOut:
        """Prediction of every block from the others."""
        return held_out_by_refit(self.fitter, self.fit, progress=self.progress)

    @cached_property
    def held_out_log(self) -> float:
        """Log score on blocks that were each predicted from the others.

        The uncertainty of the values in a fit without the block (those of a wandering clock, say) is part of the score.
        """
        return self.held_out_likelihood.log(np.nan_to_num(self.held_out.residual))

    @property
    def held_out_likelihood(self) -> Likelihood:
        """Likelihood of the held-out residual: the uncertainty of a fold's values is an error that its block shares."""
        return replace(self.likelihood, shared=np.hstack([self.likelihood.shared, self.held_out.unsure]))

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
    def residual(self) -> Floats:
        """Measured less model (n,), zero where a sample does not count."""
        return residual_of(self.fitter.problem, self.fit.solution.prediction)

    @property
    def log_posterior(self) -> float:
        """The posterior density's logarithm at the optimum."""
        return log_posterior(self.likelihood, self.fitter.problem, self.fit)

    @cached_property
    def pulled(self) -> float:
        """Excess of the base values' cost over its expected value, in log units.

        A value whose variance given the record is a share v of its prior variance costs 1 − v on average: one where
        the record determines it, nothing where the prior alone does. A law's values do not count: the size of their
        prior follows the record.
        """
        base = len(self.fitter.problem.parameters)
        space = space_of(self.fit.parameters[:base])
        held = np.isfinite(space.prior_sigma)
        known = 1.0 - np.diag(curvature_spread(self))[:base][held] / space.prior_sigma[held] ** 2
        cost = prior_cost_of(space.prior_residual(self.fit.solution.x[:base]), base)
        return 0.5 * max(0.0, cost - float(np.sum(known)))

    @property
    def promise(self) -> float:
        """Largest possible gain of a larger set: until the residual is noise and no value is pulled."""
        return self.likelihood.promise(self.residual) + self.pulled


@dataclass(frozen=True, slots=True, eq=False)
class Field:
    """All explanations of one record under one likelihood, by their members.

    Under the empty set is the plain model, which may have been fitted again from the optima of other sets: ``first`` is
    the one that was fitted alone, None where it is the same.
    """

    likelihood: Likelihood
    stretches: Stretches
    explanations: dict[EffectSet, Explanation]
    first: Explanation | None = None

    @property
    def plain(self) -> Explanation:
        """The plain model as it was fitted alone, whatever it was compared with later."""
        return self.first or self.base

    @property
    def base(self) -> Explanation:
        """The plain model."""
        return self.explanations[()]


def places_of(problem: Problem, members: Iterable[str]) -> Places:
    """Return the places at which a set acts: port, driver, unit and spring of a law, or of the law of an effect's form.

    Any two of the laws of spring A, of spring B and of both springs are equivalent to all three. A place at which
    several members act (a drift of the reading and a slipped marker) counts as often: a set with one of them there is a
    part of the set with both.
    """
    laws = {law.id: law for law in problem.laws}
    own = {candidate.id: candidate.laws for candidate in problem.candidates}
    springs: dict[str, Counter[str]] = {}
    for name in members:
        law = laws.get(name) or next((laws[other] for other in own.get(name, ()) if other in laws), None)
        place = name if law is None else f"{law.port} {law.driver} {law.unit}"
        springs.setdefault(place, Counter())["" if law is None else law.spring] += 1
    every = {"a", "b", "both"}
    return frozenset(
        f"{place} {spring} {count or ''}".strip()
        for place, of in springs.items()
        for spring in (of if len(of.keys() & every) < 2 else every)
        for count in range(max(of[spring], 1))
    )


def part_fitter(best: Explanation, members: EffectSet) -> tuple[Fitter, tuple[Measured, ...]]:
    """Return the fitter for a part of a set, and the part's laws, which keep their forms."""
    laws = tuple(one for one in best.laws if one.law.id in members)
    return Fitter(best.fitter.problem.with_laws([one.form for one in laws]), best.fitter.weight), laws


def weighted_fitter(likelihood: Likelihood, problem: Problem, prediction: Floats) -> Fitter:
    """Return a fitter with the weights that the residual of a prediction has under a likelihood."""
    return Fitter(problem, likelihood.weight(residual_of(problem, prediction)))


def family_evidence(laws: Sequence[Measured]) -> float:
    """Return the evidence of the laws' families less that of the forms that were fitted."""
    return sum(law.bank for law in laws)


def may_clear(beside: Explanation, bar: Bar) -> Callable[[Fit], bool]:
    """Return the test whether a fit may gain enough beside a set, or instead of it, under the set's likelihood."""

    def test(fit: Fit) -> bool:
        if bar.least == -np.inf:
            return True
        now, then = ahead(beside.fitter, fit, beside.likelihood)
        return bar.cleared_by(then - beside.log_posterior) if bar.known else now + FURTHER * (then - now) > bar.least

    return test


def log_posterior(likelihood: Likelihood, problem: Problem, fit: Fit) -> float:
    """Return the posterior density's logarithm at a fit."""
    return likelihood.log(residual_of(problem, fit.solution.prediction)) - 0.5 * prior_cost(problem, fit)


def on_nodes(one: Explanation, form: LawForm, spread: Floats) -> tuple[Floats, Floats]:
    """Return a law of an explanation on its nodes (k,), and the covariance (k, k) by that of the values, ``spread``."""
    names = [p.name for p in one.fit.parameters]
    places = [names.index(name) for name in form.names]
    return form.values(one.fit.values), form.basis @ spread[np.ix_(places, places)] @ form.basis.T


def loss_at(one: Explanation, base: Mapping[str, float]) -> float:
    """Return the log posterior that a set would lose with other base values, from its curvature."""
    places = [i for i, p in enumerate(one.fit.parameters) if p.name in base]
    off = one.fit.solution.x[places] - np.array([base[one.fit.parameters[i].name] for i in places])
    return 0.5 * float(off @ np.linalg.solve(curvature_spread(one)[np.ix_(places, places)], off))


def covariance(explanation: Explanation) -> Floats:
    """Return the parameters' covariance (m, m) with every value's own variance over the blocks added to it."""
    found = curvature_spread(explanation)
    plain = np.diag(found)
    widened = np.sqrt((plain + np.diag(_between_blocks(explanation))) / plain)
    return np.asarray(found * np.outer(widened, widened))


def estimates(explanation: Explanation) -> dict[str, Estimate]:
    """Return every value with its standard deviation and a 95 % interval within its bounds."""
    fit = explanation.fit
    spread = np.sqrt(np.maximum(np.diag(covariance(explanation)), 0.0))
    return {
        p.name: Estimate.normal(float(value), float(sigma), p.unit, lower=p.lower, upper=p.upper)
        for p, value, sigma in zip(fit.parameters, fit.solution.x, spread, strict=True)
    }


def predictive_covariance(explanation: Explanation) -> Floats:
    """Return the parameters' covariance (m, m) for predictions.

    It is that of :func:`joint_covariance`, at the discrepancy that the record shows and not the least one of a verdict.
    """
    shown = replace(explanation.likelihood, least=0.0)
    return _joint(explanation, shown.weight(explanation.residual))


def joint_covariance(explanation: Explanation) -> Floats:
    """Return the parameters' covariance (m, m) for curves that depend on several values.

    Along every direction it is the larger of the posterior's curvature and the jackknife's variance over the blocks.
    Blocks that are left out move several values together, along valleys in which the model predicts the same:
    :func:`covariance`, which widens each value's own interval, would ignore that correlation.
    """
    return _joint(explanation, explanation.fitter.weight)


def _joint(explanation: Explanation, weight: Weight) -> Floats:
    """Return the covariance (m, m) of :func:`joint_covariance` at given weights."""
    information = _information(explanation, weight)
    # In coordinates in which the curvature's covariance is one, the larger of one and the blocks' along every axis.
    size = 1.0 / np.sqrt(np.diag(information))
    root = np.linalg.cholesky(information * np.outer(size, size)).T / size
    moved, axes = np.linalg.eigh(root @ _between_blocks(explanation) @ root.T)
    reach = np.linalg.solve(root, axes * np.sqrt(np.maximum(moved, 1.0)))
    return np.asarray(reach @ reach.T)


def curvature_spread(explanation: Explanation) -> Floats:
    """Return the covariance (m, m) by the posterior's curvature alone."""
    return np.asarray(np.linalg.inv(_information(explanation, explanation.fitter.weight)))


def _information(explanation: Explanation, weight: Weight) -> Floats:
    """Return the posterior's information about the parameters (m, m)."""
    fit, space = explanation.fit, space_of(explanation.fit.parameters)
    derivative = fit.solution.jacobian
    information = weight.normal(derivative)
    information[np.diag_indices_from(information)] += space.prior_information + 1e-12 / space.scale**2
    return np.asarray(information)


def _between_blocks(explanation: Explanation) -> Floats:
    """Return the jackknife's covariance (m, m) of the values over the blocks; zeros where there is one block only."""
    names = [p.name for p in explanation.fit.parameters]
    if len(block_labels(explanation.fitter.problem)) < 2:
        return np.zeros((len(names), len(names)))
    values = np.array([[fold[name] for name in names] for _, fold in explanation.held_out.folds])
    off = values - values.mean(axis=0)
    return np.asarray((len(values) - 1) / len(values) * off.T @ off)
