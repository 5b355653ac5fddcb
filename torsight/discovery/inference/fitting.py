"""Joint fits of base parameters and the parameters of any set of effects, from several starts.

Base parameters absorb most of many effects, so a candidate is never judged on the residual of the base fit: every set
of effects is fitted together with all base parameters, and sets are compared at their own optima.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final

import numpy as np
from scipy.optimize import minimize

from torsight.core.parallel.threads import go_on
from torsight.core.parameter import Parameter
from torsight.core.units import Floats
from torsight.discovery.event_scan import EventScan
from torsight.discovery.inference.solver import (
    Solution,
    Space,
    jacobian,
    linear_change,
    looking_ahead,
    normal_equations,
    objective,
    sharpened,
    solve,
)
from torsight.discovery.interface import Candidate, Problem
from torsight.discovery.weight import Weight

EffectSet = tuple[str, ...]
"""Ids of the effects that are switched on, in the order of the problem's candidates."""

_Model = Callable[[Floats], Floats]
_SCOUT_ITERATIONS: Final = 2
WORTH: Final = 1.0
"""Decrease of the objective, one unit of information, below which an effect beside a fitted set is not followed."""
_TRIALS: Final = 150
"""Predictions of a search without derivatives: as many as derivatives by 25 values at six points take."""
_FINEST: Final = 1e-3
"""Relative accuracy of a parameter that is found without derivatives."""
_STAYS: Final = 1e-3
"""Prior standard deviation, in parameter scales, of a value that is held."""


def less(effects: EffectSet, name: str) -> EffectSet:
    """Return a set without one of its effects."""
    return tuple(other for other in effects if other != name)


def with_member(effects: EffectSet, name: str) -> EffectSet:
    """Return a set with one more member, in alphabetical order."""
    return tuple(sorted((*effects, name)))


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """The optimum of one set of effects.

    Attributes
    ----------
    effects : tuple of str
        Ids of the effects that are switched on.
    parameters : tuple of Parameter
        Base parameters, then the effects' own; the columns of the Jacobian.
    solution : Solution
        The optimum.
    """

    effects: EffectSet
    parameters: tuple[Parameter, ...]
    solution: Solution

    @property
    def values(self) -> dict[str, float]:
        """Parameter name to fitted value."""
        return {p.name: float(v) for p, v in zip(self.parameters, self.solution.x, strict=True)}

    @property
    def cost(self) -> float:
        """The objective: information in the residual plus the priors' share."""
        return self.solution.cost

    @property
    def ahead(self) -> float:
        """The objective that an undamped step from a scout is predicted to reach."""
        return self.solution.cost - self.solution.promised


class Fitter:
    """Fits sets of effects to one problem.

    Parameters
    ----------
    problem : Problem
        Record and model.
    weight : Weight
        Information in a residual.
    """

    def __init__(self, problem: Problem, weight: Weight) -> None:
        self.problem = problem
        self.weight = weight
        self.candidates: dict[str, Candidate] = {candidate.id: candidate for candidate in problem.candidates}

    def __reduce__(self) -> tuple[type[Fitter], tuple[Problem, Weight]]:
        """Return problem and weight for pickling: candidates may hold functions that cannot be pickled."""
        return Fitter, (self.problem, self.weight)

    def ordered(self, effects: Iterable[str]) -> EffectSet:
        """Return the ids in the order of the candidates."""
        chosen = set(effects)
        return tuple(name for name in self.candidates if name in chosen)

    def parameters(self, effects: EffectSet) -> tuple[Parameter, ...]:
        """Return the free parameters of a set of effects, base parameters first."""
        own = (parameter for name in effects for parameter in self.candidates[name].parameters)
        return (*self.problem.parameters, *own)

    def space(self, effects: EffectSet) -> Space:
        """Return bounds, scales and priors of the free parameters of a set of effects."""
        scales = {name: scale for effect in effects for name, scale in self.candidates[effect].scales.items()}
        return space_of(self.parameters(effects), scales=scales)

    def _model(self, effects: EffectSet) -> _Model:
        """Return the model's values as a function of the free parameters (m,)."""
        return AtPoint(self.problem, [p.name for p in self.parameters(effects)], effects)

    def fit(
        self,
        effects: EffectSet,
        starts: Sequence[Mapping[str, float]],
        *,
        max_iterations: int = 12,
        keep: int = 2,
        near: Fit | None = None,
        follow: Callable[[Fit], bool] | None = None,
    ) -> Fit:
        """Fit a set of effects from several starts; the best two of a short scouting run are followed to the end.

        Scouts that start at ``near``, a fitted smaller set, use its derivatives until these fail. ``follow`` decides
        whether a scout is followed.
        """
        parameters, space, model = self.parameters(effects), self.space(effects), self._model(effects)
        given: dict[str, Any] = {"observed": self.problem.observed, "weight": self.weight, "space": space}
        points = [np.array([start[p.name] for p in parameters]) for start in starts]
        guesses = [self._guess(start, parameters, near) for start in starts]
        scouts = [
            solve(model, point, max_iterations=_SCOUT_ITERATIONS, guess=guess, rough=True, **given)
            for point, guess in zip(points, guesses, strict=True)
        ]
        scouts.sort(key=lambda found: found.cost)
        kept = [looking_ahead(model, scout, **given) for scout in _distinct(scouts, space)[:keep]]
        solutions = [
            solve(model, scout, max_iterations=max_iterations, **given)
            if follow is None or follow(Fit(effects, parameters, scout))
            else scout
            for scout in kept
        ]
        return Fit(effects, parameters, min(solutions, key=lambda found: found.cost))

    def _guess(self, start: Mapping[str, float], parameters: Sequence[Parameter], near: Fit | None) -> Floats | None:
        """Return derivatives at a start, from a smaller fit whose values the start shares; None without such a fit."""
        for fit in (near, self.nominal):
            if fit is not None and all(start[name] == value for name, value in fit.values.items()):
                return _columns(fit, parameters)
        return None

    @cached_property
    def nominal(self) -> Fit:
        """The plain model at the priors' means, not fitted."""
        return self.at((), {p.name: p.value for p in self.problem.parameters})

    def at(self, effects: EffectSet, values: Mapping[str, float], *, near: Fit | None = None) -> Fit:
        """Return a set of effects at given values, not fitted, with its derivatives there, or those of a fit near."""
        parameters, space, model = self.parameters(effects), self.space(effects), self._model(effects)
        x = np.array([values[p.name] for p in parameters])
        at_x = model(x)
        guess = None if near is None else _columns(near, parameters)
        return self.known(effects, x, at_x, jacobian(model, x, at_x=at_x, space=space, guess=guess))

    def known(self, effects: EffectSet, x: Floats, prediction: Floats, derivative: Floats) -> Fit:
        """Return a set of effects at a point (m,) at which prediction (n,) and derivatives (n, m) are known."""
        cost = self._costs(effects)(x, prediction)
        solution = Solution(x, prediction, derivative, cost, converged=False)
        return Fit(effects, self.parameters(effects), solution)

    def _costs(self, effects: EffectSet) -> Callable[[Floats, Floats], float]:
        """Return the objective of a set of effects as a function of a point (m,) and the prediction there (n,)."""
        used, space = self.weight, self.space(effects)
        observed = np.where(used.each > 0.0, self.problem.observed, 0.0)
        return lambda x, prediction: objective(observed - prediction, x, weight=used, space=space)

    def weighed(self, fit: Fit) -> Fit:
        """Return a fit that was made under other weights with its objective under these."""
        cost = self._costs(fit.effects)(fit.solution.x, fit.solution.prediction)
        return replace(fit, solution=replace(fit.solution, cost=cost))

    def base(self) -> Fit:
        """Fit the plain model alone, from the priors' means."""
        return self.fit((), [{p.name: p.value for p in self.problem.parameters}])

    def residual(self, fit: Fit) -> Floats:
        """Return measured less model (n,), NaN where a sample does not count."""
        return np.where(self.problem.valid, self.problem.observed - fit.solution.prediction, np.nan)

    def extend(
        self, parent: Fit, name: str, *, from_means: bool = True, hopes: Callable[[Fit], bool] = lambda _: True
    ) -> Fit:
        """Add one effect to a fitted set: from the parent's optimum, and from the priors' means.

        The second start (``from_means``) matters where an effect has pulled the base parameters off along a valley in
        which the record is explained equally well: from the means the search leads to the minimum that agrees with the
        priors. A fit without ``hopes`` of mattering is not continued, and beside others not tried from the means.
        """
        effects = self.ordered((*parent.effects, name))
        points = self._points(parent, name)
        starts = [{**parent.values, **point} for point in points]

        def follow(scout: Fit) -> bool:
            return scout.ahead < parent.cost - WORTH and hopes(scout)

        found = self.fit(effects, starts, max_iterations=20, keep=1, near=parent, follow=follow)
        if from_means and (hopes(found) or not parent.effects):
            at_means = {**parent.values, **self.nominal.values}
            if self.candidates[name].event is not None:
                points = self._events(self.at(parent.effects, at_means) if parent.effects else self.nominal, name)
            starts = [{**at_means, **point} for point in points]
            other = self.fit(effects, starts, max_iterations=20, keep=1, follow=follow)
            found = min(found, other, key=lambda fit: fit.cost)
        if hopes(found):
            found = self._by_trials(found)
        # The parent with the effect switched off is a point of this set too: a fit that ends above it went astray.
        if found.cost <= parent.cost:
            return found
        return self.fit(effects, [self._switched_off(parent, name)], near=parent, follow=follow)

    def promise(self, parent: Fit, name: str) -> float:
        """Return the decrease of the objective that the linear models at one more effect's starts predict.

        So does that at its null: far from it, where the parent's values have made up for the effect, the linear models
        err by more than the effect gains.
        """
        effects = self.ordered((*parent.effects, name))
        parameters, space, model = self.parameters(effects), self.space(effects), self._model(effects)
        given: dict[str, Any] = {"observed": self.problem.observed, "weight": self.weight, "space": space}
        least = parent.cost
        for start in (*self._points(parent, name), self.candidates[name].null_point()):
            values = {**parent.values, **start}
            guess, point = _columns(parent, parameters), np.array([values[p.name] for p in parameters])
            found = solve(model, point, max_iterations=0, guess=guess, rough=True, **given)
            least = min(least, found.cost - looking_ahead(model, found, **given).promised)
        return parent.cost - least

    def _points(self, fit: Fit, name: str) -> Sequence[Mapping[str, float]]:
        """Return the parameters of one more effect from which it is fitted beside a fitted set."""
        candidate = self.candidates[name]
        return candidate.starting_points() if candidate.event is None else self._events(fit, name)

    def _events(self, fit: Fit, name: str) -> list[dict[str, float]]:
        """Return the likeliest times and sizes of an event beside a set (:mod:`torsight.discovery.event_scan`)."""
        candidate, values = self.candidates[name], fit.values
        time, size = sorted(candidate.parameters, key=lambda p: p.name != candidate.event)
        effects = self.ordered((*fit.effects, name))

        def predict(events: Sequence[tuple[float, float]]) -> Sequence[Floats]:
            go_on()
            return self.problem.predict_many([{**values, time.name: at, size.name: by} for at, by in events], effects)

        solution, space = fit.solution, self.space(fit.effects)
        residual = np.where(self.weight.each > 0.0, self.problem.observed - solution.prediction, 0.0)
        normal, gradient = normal_equations(solution.jacobian, residual, solution.x, weight=self.weight, space=space)
        normal[np.diag_indices_from(normal)] += space.least_information
        scan = EventScan(predict, solution.prediction, residual, solution.jacobian, normal, gradient, self.weight)
        found = scan.events(time.lower, time.upper, size=size.value, closest=candidate.scales[time.name])
        return [{time.name: one.at, size.name: one.size} for one in found] or [candidate.null_point()]

    def _by_trials(self, found: Fit) -> Fit:
        """Fit effects whose predictions jump without derivatives (Nelder and Mead), alternating with all other values.

        The search runs over the logarithms of their parameters, because relative changes decide where a jump comes, and
        begins with a simplex as wide as a factor of two: one inside a single step of the predictions sees no slope. All
        other values follow each trial by the linear model (variable projection; Golub and Pereyra, SIAM J. Numer. Anal.
        10 (1973) 413): where they have absorbed a part of the effect, no trial beside them as they are gains anything.
        """
        names = {p.name for e in found.effects if self.candidates[e].jumps for p in self.candidates[e].parameters}
        own = [i for i, p in enumerate(found.parameters) if p.name in names]
        if not own:
            return found
        space, model = self.space(found.effects), self._model(found.effects)
        costs = self._costs(found.effects)
        least = _FINEST * space.scale[own]
        rest = [i for i in range(len(found.parameters)) if i not in own]
        information = (space.prior_information + space.least_information)[rest]

        def at(logarithms: Floats) -> Floats:
            x = found.solution.x.copy()
            x[own] = np.exp(logarithms)
            return space.clip(x)

        def cost(logarithms: Floats) -> float:
            x = at(logarithms)
            prediction, columns = model(x), found.solution.jacobian[:, rest]
            residual = np.where(self.weight.each > 0.0, self.problem.observed - prediction, 0.0)
            back, followed = space.to_means(x)[rest], x.copy()
            followed[rest] += linear_change(columns, residual, weight=self.weight, information=information, centre=back)
            followed = space.clip(followed)
            return costs(followed, prediction + columns @ (followed - x)[rest])

        while True:
            start = np.log(np.maximum(found.solution.x[own], least))
            simplex = np.vstack([start, start + np.log(2.0) * np.eye(len(own))])
            best = minimize(
                cost,
                start,
                method="Nelder-Mead",
                options={"maxfev": _TRIALS, "xatol": _FINEST, "fatol": WORTH, "initial_simplex": simplex},
            )
            values = dict(zip(found.values, at(best.x).tolist(), strict=True))
            again = self.fit(found.effects, [values], max_iterations=20, keep=1)
            gained = found.cost - again.cost
            if gained > 0.0:
                found = again
            if gained < WORTH:
                return found

    def _switched_off(self, parent: Fit, name: str) -> dict[str, float]:
        return {**parent.values, **self.candidates[name].null_point()}

    def from_elsewhere(self, fit: Fit) -> Fit:
        """Return a fit, or a better one that starts from the problem's other base values (``elsewhere``).

        Only a start that is already better with all other values unchanged is followed.
        """
        model, costs = self._model(fit.effects), self._costs(fit.effects)

        def cost(values: Mapping[str, float]) -> float:
            x = np.array([values[p.name] for p in fit.parameters])
            return costs(x, model(x))

        places = [{**fit.values, **place} for place in self.problem.elsewhere]
        least, best = min(((cost(place), i) for i, place in enumerate(places)), default=(np.inf, 0))
        if least >= fit.cost:
            return fit
        return min(fit, self.fit(fit.effects, [places[best]], max_iterations=20), key=lambda item: item.cost)

    def sharpened(self, fit: Fit) -> Fit:
        """Return a fit with derivatives that are accurate along directions of least information, and its optimum."""
        model, space = self._model(fit.effects), self.space(fit.effects)
        for _ in range(2):
            solution = sharpened(model, fit.solution, weight=self.weight, space=space)
            fit = self.refit(replace(fit, solution=solution), max_iterations=4, rough=True)
        return replace(fit, solution=sharpened(model, fit.solution, weight=self.weight, space=space))

    def refit(
        self,
        fit: Fit,
        *,
        weight: Weight | None = None,
        max_iterations: int = 6,
        kept: Sequence[str] = (),
        rough: bool = False,
    ) -> Fit:
        """Fit the same set again from its optimum, after the weights have changed or samples were left out.

        Parameters in ``kept`` stay at their values. A ``rough`` fit leaves its derivatives as they are at the end.
        """
        space = self.space(fit.effects)
        places = [i for i, p in enumerate(fit.parameters) if p.name in kept]
        space.prior_mean[places] = fit.solution.x[places]
        space.prior_sigma[places] = _STAYS * space.scale[places]
        solution = solve(
            self._model(fit.effects),
            fit.solution,
            observed=self.problem.observed,
            weight=self.weight if weight is None else weight,
            space=space,
            max_iterations=max_iterations,
            rough=rough,
        )
        return Fit(fit.effects, fit.parameters, solution)


class AtPoint:
    """A problem's prediction as a function of its free parameters (m,)."""

    def __init__(self, problem: Problem, names: Sequence[str], effects: EffectSet) -> None:
        self._problem = problem
        self._names = names
        self._effects = effects

    def _values(self, x: Floats) -> dict[str, float]:
        return dict(zip(self._names, x.tolist(), strict=True))

    def __call__(self, x: Floats) -> Floats:
        """Return the prediction at a point."""
        go_on()
        return self._problem.predict(self._values(x), self._effects)

    def many(self, points: Sequence[Floats]) -> list[Floats]:
        """Return the predictions at several points, computed in parallel where the problem can do that."""
        go_on()
        return self._problem.predict_many([self._values(x) for x in points], self._effects)


def _columns(fit: Fit, parameters: Sequence[Parameter]) -> Floats:
    """Return a fit's derivatives for these parameters, NaN for those that it does not have."""
    place = {p.name: j for j, p in enumerate(fit.parameters)}
    derivative = fit.solution.jacobian
    missing = np.full(len(derivative), np.nan)
    return np.column_stack([derivative[:, place[p.name]] if p.name in place else missing for p in parameters])


def space_of(parameters: Sequence[Parameter], *, scales: Mapping[str, float] | None = None) -> Space:
    """Return bounds, scales (those given, else :func:`_scale`) and priors of parameters as arrays."""
    given = scales or {}
    sigma = np.array([np.inf if p.sigma is None else p.sigma for p in parameters])
    return Space(
        lower=np.array([p.lower for p in parameters]),
        upper=np.array([p.upper for p in parameters]),
        scale=np.array([given.get(p.name, _scale(p)) for p in parameters]),
        prior_mean=np.array([p.value for p in parameters]),
        prior_sigma=sigma,
    )


def _scale(parameter: Parameter) -> float:
    """Return a change of a parameter that matters: its prior, its distance from the null, or a share of its range."""
    if parameter.sigma is not None:
        return parameter.sigma
    span = parameter.upper - parameter.lower
    distance = abs(parameter.value - parameter.null) if parameter.null is not None else abs(parameter.value) / 4.0
    if distance > 0.0:
        return min(distance, span / 4.0)
    return span / 20.0 if np.isfinite(span) else 1.0


def _distinct(solutions: Sequence[Solution], space: Space) -> list[Solution]:
    """Return the solutions without those that have converged to the same point as a better one."""
    kept: list[Solution] = []
    for solution in solutions:
        near = (np.all(np.abs(solution.x - other.x) < 0.3 * space.scale) for other in kept)
        if not any(near):
            kept.append(solution)
    return kept
