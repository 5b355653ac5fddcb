r"""A law measured by marginal likelihood, together with the model's parameters and their priors.

At a point of the parameters x and of the law's values f on its nodes the model is linear,
:math:`y ≈ m + J_x δx + J_f δf`. Then the posterior of both under every kernel and size of the law's bank is known in
closed form, and so is its evidence: the likelihood of the residual, the cost of the values under their priors, and the
Occam factor :math:`-\tfrac12 \log \det H` of the posterior's curvature H (Laplace; MacKay, Neural Computation 4 (1992)
415). The next point is on the way to the posterior mean of the best member of the bank, as far as the likelihood itself
grows. Far from the point the linear model may be wrong: another member than that of the point is taken only if the
model itself confirms its evidence there, and otherwise the point's own member is followed. The evidence of the family
is the mean over its bank (:mod:`.bank`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from torsight.core.law import KEPT, Law, LawForm
from torsight.core.units import Floats
from torsight.discovery.inference.fitting import AtPoint, EffectSet, Fit, Fitter, space_of
from torsight.discovery.inference.laplace import prior_information, residual_of
from torsight.discovery.inference.law.bank import Bank, Member, Picture
from torsight.discovery.inference.likelihood import Likelihood
from torsight.discovery.inference.priors import prior_cost_of
from torsight.discovery.inference.solver import TRUSTED, Slopes, Space, linear_change
from torsight.discovery.interface import Problem

_STEP: Final = 0.1
"""Difference step of a law's value, in the law's scale."""
ITERATIONS: Final = 14
"""Largest number of steps of a measurement; most end after five."""
_HALVINGS: Final = 5
FURTHER: Final = 5.0
"""Largest total gain of a search as a multiple of the gain that its linear model predicts beyond that of the parameters
alone; a search that would need more is given up as hopeless. Of 250 laws and effects, alone and beside others, on an
ordinary record and on one that no set explains, those that gained five log units and more gained 0.3 to 2.1 times it
(3.2 times in one case of 8 log units)."""
SETTLED: Final = 0.3
"""Gain in log units below which a further step, or round of weights, no longer matters."""


@dataclass(frozen=True, slots=True)
class Bar:
    """What a member has to gain beside a set in order to matter.

    Attributes
    ----------
    least : float
        Logarithm of the posterior density below which the extended set does not matter.
    gain : float
        Least gain in log units over the set without the member; NaN where that set is not known.
    """

    least: float = -np.inf
    gain: float = np.nan

    @property
    def known(self) -> bool:
        """Whether the set without the member is known."""
        return not np.isnan(self.gain)

    def cleared_by(self, promised: float) -> bool:
        """Return whether a member may gain enough of which the linear model promises so much more than without it."""
        return FURTHER * max(promised, SETTLED) > self.gain


NO_BAR: Final = Bar()


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """A law as measured from a record.

    Attributes
    ----------
    law : Law
        The law that was measured.
    form : LawForm
        The law in its most probable kernel and size.
    values : mapping of str to float
        Values of the model's parameters and of the form's.
    prediction : (n,) float64
        Prediction of the model at these values.
    derivative : (n, m) float64
        Derivatives of the prediction by the values, in their order.
    log_evidence : float
        Evidence of the family, comparable among fits of one record under one likelihood.
    place : (int, int)
        Indices of the form's kernel in the law's kernels and of its size in :data:`SIZES`.
    bank : float
        Evidence of the family less that of its most probable form alone.
    hopes : bool
        False where the measurement was given up because it would not reach the posterior density that matters.
    """

    law: Law
    form: LawForm
    values: Mapping[str, float]
    prediction: Floats
    derivative: Floats
    log_evidence: float
    place: Member
    bank: float
    hopes: bool = True

    def as_fit(self, fitter: Fitter, members: EffectSet) -> Fit:
        """Return the set in which the law was measured as a fit; ``fitter`` has the law's form among its candidates."""
        effects, names = fitter.ordered(members), list(self.values)
        place = [names.index(parameter.name) for parameter in fitter.parameters(effects)]
        x = np.array(list(self.values.values()))[place]
        return fitter.known(effects, x, self.prediction, self.derivative[:, place])


def measure_law(
    problem: Problem,
    law: Law,
    start: Mapping[str, float],
    *,
    effects: EffectSet = (),
    likelihood: Likelihood,
    known: Mapping[str, Floats] | None = None,
    curve: Floats | None = None,
    bar: Bar = NO_BAR,
) -> Measured:
    """Measure one of the problem's laws beside the plain model and effects (and laws that are known already).

    ``start`` holds values of the model's parameters and of those of the effects, ``known`` derivatives (n,) there by
    some of them, where a fit without the law has them, and ``curve`` (k,) the law on its nodes, zero by default. The
    ``bar`` is what the law has to gain in order to matter.
    """
    return Measurement(problem, law, effects, likelihood).run(start, known or {}, curve, bar)


class Measurement:
    """One of a problem's laws beside the plain model and effects; arguments as in :func:`measure_law`."""

    def __init__(self, problem: Problem, law: Law, effects: EffectSet, likelihood: Likelihood) -> None:
        self._law, self._likelihood = law, likelihood
        free = law.free()
        self._problem = problem.with_laws((*problem.forms, free))
        known = {candidate.id: candidate for candidate in problem.candidates}
        own = [p for name in effects for p in known[name].parameters]
        scales = {name: scale for effect in effects for name, scale in known[effect].scales.items()}
        self._parameters = (*problem.parameters, *own)
        self._names = [p.name for p in self._parameters]
        self._own = list(free.names)
        self._base = len(problem.parameters)
        space = space_of(self._parameters, scales=scales)
        k = len(law.nodes)
        self._space = Space(
            lower=np.concatenate([space.lower, np.full(k, -np.inf)]),
            upper=np.concatenate([space.upper, np.full(k, np.inf)]),
            scale=np.concatenate([space.scale, np.full(k, _STEP / 0.02 * law.scale)]),
            prior_mean=np.concatenate([space.prior_mean, np.zeros(k)]),
            prior_sigma=np.concatenate([space.prior_sigma, np.full(k, np.inf)]),
        )
        self._model = AtPoint(self._problem, (*self._names, *self._own), (*effects, law.id))
        self._bank = Bank.of(law)

    def _residual(self, at_u: Floats) -> Floats:
        return residual_of(self._problem, at_u)

    def _prior(self, u: Floats, place: Member) -> float:
        """Return the logarithm of the priors at a point: of the parameters, and of the law under one member."""
        m = len(self._names)
        of_parameters = prior_cost_of(self._space.prior_residual(u)[:m], self._base)
        return -0.5 * (of_parameters + self._bank.cost(place, u[m:]))

    def _projected(self, u: Floats, place: Member) -> Floats:
        """Return a point with the law's curve replaced by the nearest one that a member can represent."""
        m = len(self._names)
        return np.concatenate([u[:m], self._bank.nearest(place, u[m:])])

    def run(self, start: Mapping[str, float], known: Mapping[str, Floats], curve: Floats | None, bar: Bar) -> Measured:
        """Step from a start until a step gains nothing that matters, or the law cannot clear the bar."""
        slopes = self._slopes(start, known, curve)
        place: Member | None = None
        hopes = True
        for step in range(ITERATIONS):
            slopes.renew()
            picture = self._picture(slopes)
            members = dict.fromkeys((picture.place, place or picture.place))
            aims = [self._aim(slopes, picture, one, place) for one in members]
            promised = max(aim.promised for aim in aims)
            most = max(aim.now + FURTHER * aim.promised for aim in aims)
            if step == 0 and curve is None and bar.known:
                hopes = bar.cleared_by(promised - self._without(slopes))
            else:
                hopes = most > bar.least
            if not hopes or promised <= SETTLED:
                break
            tried = (self._towards(slopes.x, aim) for aim in aims if aim.promised > SETTLED)
            found = next((one for one in tried if one is not None), None)
            if found is None:
                if slopes.refresh():
                    continue
                # What derivatives promise where no step gets it is no hope.
                hopes = aims[-1].now + FURTHER * SETTLED > bar.least
                break
            aim, gained, u, at_u = found
            slopes.move(u, at_u, trusted=gained > TRUSTED * aim.promised)
            place = aim.place
        slopes.renew()
        return replace(self._measured(slopes, place), hopes=hopes)

    def promise(self, start: Mapping[str, float], known: Mapping[str, Floats]) -> tuple[float, dict[str, Floats]]:
        """Return the gain that the linear model at a start promises of the law, and the derivatives by its values."""
        slopes = self._slopes(start, known, None)
        picture = self._picture(slopes)
        promised = self._aim(slopes, picture, picture.place, None).promised - self._without(slopes)
        return promised, dict(zip(self._own, slopes.jacobian.T[len(self._names) :], strict=True))

    def _slopes(self, start: Mapping[str, float], known: Mapping[str, Floats], curve: Floats | None) -> Slopes:
        u = np.zeros(len(self._names) + len(self._own))
        u[: len(self._names)] = [start[name] for name in self._names]
        if curve is not None:
            u[len(self._names) :] = curve
        return Slopes(self._model, self._space, u, guess=self._guess(known))

    def _without(self, slopes: Slopes) -> float:
        """Return the gain that the linear model at a point promises of the parameters alone, without the law."""
        m = len(self._names)
        u, columns = slopes.x[:m], slopes.jacobian[:, :m]
        residual, space = self._residual(slopes.at_x), self._space.at(range(m))
        weight = self._likelihood.weight(residual)
        information = prior_information(self._space, slopes.x, self._base)[:m]
        step = linear_change(columns, residual, weight=weight, information=information, centre=space.to_means(u))
        there = space.clip(u + step)

        def value(x: Floats) -> float:
            left = np.where(self._problem.valid, residual - columns @ (x - u), 0.0)
            return self._likelihood.log(left) - 0.5 * prior_cost_of(space.prior_residual(x), self._base)

        return value(there) - value(u)

    def _guess(self, known: Mapping[str, Floats]) -> Floats | None:
        """Return the known derivatives as columns, NaN for the others; None where none is known."""
        if not known:
            return None
        missing = np.full(len(self._problem.observed), np.nan)
        return np.column_stack([known.get(name, missing) for name in (*self._names, *self._own)])

    def _value(self, at_u: Floats, u: Floats, place: Member) -> float:
        """Return the posterior density's logarithm at a point under one member."""
        return self._likelihood.log(self._residual(at_u)) + self._prior(u, place)

    def _aim(self, slopes: Slopes, picture: Picture, place: Member, at: Member | None) -> _Aim:
        """Return the posterior mean of a member of the bank as the aim of a step; ``at`` is the member of the point."""
        target = self._space.clip(picture.mean_of(place))
        own = self._projected(slopes.x, place)
        outside = at is not None and np.sum((own - slopes.x) ** 2) > KEPT * np.sum(slopes.x[len(self._names) :] ** 2)
        if at is None:
            now = self._value(slopes.at_x, own, place)
        else:
            now = self._value(slopes.at_x, slopes.x, at) + picture.constant(at) - picture.constant(place)
        there = self._value(slopes.at_x + slopes.jacobian @ (target - slopes.x), target, place)
        return _Aim(place, target, now, there - now, whole=bool(outside))

    def _towards(self, u: Floats, aim: _Aim) -> tuple[_Aim, float, Floats, Floats] | None:
        """Return the aim, the gain, the point and the prediction there of the first step to an aim that gains."""
        step = 1.0
        for _ in range(1 if aim.whole else _HALVINGS):
            trial = u + step * (aim.target - u)
            at_trial = self._model(trial)
            there = self._value(at_trial, trial, aim.place)
            if there > aim.now:
                return aim, there - aim.now, trial, at_trial
            step *= 0.4
        return None

    def _picture(self, slopes: Slopes, at_u: Floats | None = None, u: Floats | None = None) -> Picture:
        """Return the linear model at the slopes' point, or at one so near that its derivatives are the same."""
        u = slopes.x if u is None else u
        residual = self._residual(slopes.at_x if at_u is None else at_u)
        weight = self._likelihood.weight(residual)
        names = len(self._names)
        information = prior_information(self._space, u, self._base)[:names]
        return Picture.of(slopes.jacobian, residual, weight, u=u, space=self._space, information=information,
                           bank=self._bank)  # fmt: skip

    def _measured(self, slopes: Slopes, last: Member | None) -> Measured:
        """Return the law in the most probable member or in that of the last step, whichever has more evidence.

        The values at the end are those of the last step's member. They may be far from what another member can
        represent; its own posterior mean is as good as the linear model.
        """
        picture = self._picture(slopes)
        options = [(picture.place, slopes.x), (picture.place, self._space.clip(picture.mean_of(picture.place)))]
        if last is not None and last != picture.place:
            options.append((last, slopes.x))
        return max((self._measured_as(slopes, *one) for one in options), key=lambda measured: measured.log_evidence)

    def _measured_as(self, slopes: Slopes, place: Member, u: Floats) -> Measured:
        """Return the law in one member of the bank, with the values nearest to a point."""
        m, form = len(self._names), self._bank.form(place)
        u = self._projected(u, place)
        at_u = self._model(u)
        picture = self._picture(slopes, at_u, u)
        z = self._bank.coefficients(place, u[m:])
        values = dict(zip(self._names, u[:m].tolist(), strict=True))
        values |= dict(zip(form.names, z.tolist(), strict=True))
        derivative = np.hstack([slopes.jacobian[:, :m], slopes.jacobian[:, m:] @ form.basis])
        # At the point itself the likelihood speaks, not the picture; the bank's other members are as far off as there.
        here = self._value(at_u, u, place) + float(picture.occam[place])
        bank = self._bank.beside(picture.evidence, place)
        return Measured(self._law, form, values, at_u, derivative, here + bank, place, bank)


@dataclass(frozen=True, slots=True, eq=False)
class _Aim:
    """The posterior mean of one member of the bank, as the linear model predicts it.

    ``now`` is the posterior density's logarithm under the member at which a step has to gain: where the point is
    another member's, that one's, with the difference of their Occam factors and priors. ``promised`` is the gain that
    the linear model predicts. A step is ``whole`` where the curve at the point is none that the member can represent:
    on the way to the aim the member's prior would not charge for it.
    """

    place: Member
    target: Floats
    now: float
    promised: float
    whole: bool


def better_form(measured: Measured, fitter: Fitter, fit: Fit, likelihood: Likelihood) -> tuple[float, Measured]:
    """Return the gain in log evidence of a law's most probable form at a fit over its own form, and the law in it.

    A law that made up for a missing effect is larger and less smooth than necessary once that effect is in the set. The
    linear model at the fit gives the evidence of every size, and of every kernel in the form's span, without a run of
    the model; ``prediction`` is not updated.
    """
    old, names = measured.form, [p.name for p in fit.parameters]
    own = [names.index(name) for name in old.names]
    order = [i for i in range(len(names)) if i not in own] + own
    n = len(names) - len(own)
    space, x = fitter.space(fit.effects), fit.solution.x
    information = prior_information(space, x, len(fitter.problem.parameters))[order[:n]]
    residual = residual_of(fitter.problem, fit.solution.prediction)
    derivative, bank = fit.solution.jacobian[:, order], Bank.of(measured.law)
    picture = Picture.of(derivative, residual, likelihood.weight(residual), u=x[order], space=space.at(order),
                          information=information, bank=bank.within(old))  # fmt: skip
    form, mean = bank.form(picture.place), space.at(order).clip(picture.mean_of(picture.place))
    z = bank.coefficients(picture.place, old.basis @ mean[n:])
    values = {names[i]: float(value) for i, value in zip(order[:n], mean, strict=False)}
    values |= dict(zip(form.names, z.tolist(), strict=True))
    columns = np.hstack([derivative[:, :n], derivative[:, n:] @ (np.linalg.pinv(old.basis) @ form.basis)])
    gain = float(picture.evidence[picture.place] - picture.evidence[measured.place])
    return gain, replace(measured, form=form, values=values, derivative=columns, place=picture.place,
                         bank=bank.beside(picture.evidence, picture.place))  # fmt: skip
