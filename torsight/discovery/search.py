"""Which sets of effects are worth comparing: a beam over joint refits, all at the same weights in the end.

Every single candidate is fitted together with the base. The best few are each extended by every other candidate (pairs
among the best), and so on up to :attr:`Settings.most_effects`. Weights follow the best residual so far, because what a
sample is worth depends on the error that remains; whatever is compared is refitted at the last weights. Where much is
left in the end, singles and pairs are tried once more at weights as if most of it were explained.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Final

import numpy as np

from torsight.core.progress import Progress
from torsight.discovery.contenders import Contender, Field
from torsight.discovery.fitting import EffectSet, Fit, Fitter, in_parallel, less
from torsight.discovery.interface import Problem
from torsight.discovery.noise import (
    Scales,
    Stretches,
    first_scales,
    information,
    pieces,
    pieces_in_motion,
    reading_noise,
    residual_scales,
)
from torsight.discovery.null import LinearPicture
from torsight.discovery.settings import Settings
from torsight.discovery.solver import Array

_Exchange = tuple[Fit, LinearPicture, str, tuple[dict[str, float], ...]]
"""A set without one of its effects, its linear picture, what may come in its place, and from where."""

LEAST_PROMISE: Final = 10.0
"""Half of the least gain that is ever believed."""
_LEAST_LINEAR: Final = 2.0
"""Extensions that promise less in the linear picture are not fitted; low, as weights from a poor fit see little."""
_SAME_COST: Final = 2e-3
"""Share of its cost by which a set may stand above a part of itself: its effect is switched off, no valley is near."""
_SHARPENINGS: Final = 6
_SHARPER: Final = 0.25
"""Share of the residual's size as which it counts in a second search, where the first one has left much ..."""
_WELL_EXPLAINED: Final = 0.1
"""... and more than this share of what the base model leaves: a form's error, which no other set would take ..."""
_FEW: Final = 100.0
"""... or where so long-lived an error is left that the record holds fewer pieces of information ..."""
_SHORT: Final = 16.0
"""... and samples over which it is correlated there at most."""
_LOOKS: Final = 2
_MUCH_LEFT: Final = 1.3
"""Larger sets are tried while the residual's information is this many times the floor's ..."""
_SHOWS: Final = 2.0
"""... or while its size is this many times the floor, or the resolution."""


class Search:
    """Fits what has to be compared; see :meth:`run`."""

    def __init__(self, problem: Problem, *, settings: Settings, progress: Progress) -> None:
        self._problem = problem
        self._settings = settings
        self._progress = progress
        self._stretches = Stretches.of(problem)
        self._floor = problem.sigma.copy()
        self._scales = first_scales(problem, self._stretches)
        self._fits: dict[EffectSet, Fit] = {}
        self._fitter = Fitter(problem, self._weights())

    def run(self) -> Field:
        """Return the base model, every single candidate and the sets that grew out of the best ones."""
        self._fit_base()
        self._grow_all()
        if self._fitter.candidates and self._shows() and self._poor() and self._settings.most_effects > 1:
            self._grow_sharper()
        contenders = {effects: Contender(fit, self._fitter, self._progress) for effects, fit in self._fits.items()}
        return Field(self._fitter, self._stretches, self._scales, self._floor, contenders)

    def _grow_all(self, *, at_once: int = 1) -> None:
        """Fit sets of every size; compare, at weights from the best, once those of ``at_once`` effects are fitted."""
        for size in range(1, self._settings.most_effects + 1):
            self._grow(size)
            if size < at_once:
                continue
            self._reweight()
            if size > 1:
                self._look_again(size)
            if not self._worth(size):
                break

    def _grow_sharper(self) -> None:
        """Search once more at weights as if most of the residual were explained; keep what explains more in the end.

        At weights from a poor fit its priors hold every value, nothing gains, and the weights stay as they are. Singles
        and pairs are fitted before weights are taken anew.
        """
        before, best = (self._fits, self._fitter, self._scales, self._floor), self._best()
        size = _SHARPER * self._left(before[0][()])
        tau = min(self._scales.correlation_samples, _SHORT)
        self._scales = Scales(size, size, tau)
        self._fitter = Fitter(self._problem, self._weights())
        self._fits = {(): self._refit(before[0][()])}
        self._grow_all(at_once=2)
        if self._score(self._best()) >= self._score(best):
            self._fits, self._fitter, self._scales, self._floor = before

    def _fit_base(self) -> None:
        fit = self._fitter.base()
        for _ in range(2):
            self._follow(fit)
            fit = self._refit(fit)
        self._fits = {(): fit}

    def _grow(self, size: int) -> None:
        work = self._extensions(size)
        if size > 1:
            work = self._promising(work)
        step = f"sets of {size}"
        found: list[Fit] = in_parallel(list(work.values()), self._extend, step=step, progress=self._progress)
        self._keep(found)

    def _extensions(self, size: int) -> dict[EffectSet, tuple[Fit, str]]:
        """Return the sets of this size that grow out of the best smaller ones: parent and what is added."""
        # A mechanism without a name stands alone: in company it would take over the error of the others' forms.
        parents = [fit for fit in self._ranked(size - 1) if self._named(fit.effects)][: self._settings.beam]
        work: dict[EffectSet, tuple[Fit, str]] = {}
        for parent in parents:
            for name, candidate in self._fitter.candidates.items():
                if size > 1 and not candidate.named:
                    continue
                effects = self._fitter.ordered((*parent.effects, name))
                if len(effects) == size and effects not in work:
                    work[effects] = (parent, name)
        return work

    def _promising(self, work: Mapping[EffectSet, tuple[Fit, str]]) -> dict[EffectSet, tuple[Fit, str]]:
        """Leave out extensions that promise nothing in the linear picture; those that promise the best fits stay in.

        What counts is where a set would end up: a poor parent promises much and leads nowhere. The few best stay in
        whatever they promise.
        """
        expected = self._expected(work)
        ranked = sorted(expected, key=lambda effects: (expected[effects], effects))[: self._settings.most_extensions]
        promised = {effects: work[effects][0].cost - expected[effects] for effects in ranked}
        kept = [e for i, e in enumerate(ranked) if i < self._settings.beam or promised[e] > _LEAST_LINEAR]
        return {effects: work[effects] for effects in kept}

    def _expected(self, work: Mapping[EffectSet, tuple[Fit, str]]) -> dict[EffectSet, float]:
        """Return the cost at which each extension would end up in the linear picture."""
        parents = {parent.effects: parent for parent, _ in work.values()}
        pictures = {effects: LinearPicture(self._fitter, parent) for effects, parent in parents.items()}

        def cost(item: tuple[Fit, str]) -> float:
            parent, name = item
            candidate = self._fitter.candidates[name]
            starts = [candidate.own(self._fits[(name,)].values), *candidate.starting_points()[:2]]
            return parent.cost - pictures[parent.effects].gain(name, starts)

        costs: list[float] = in_parallel(list(work.values()), cost)
        return dict(zip(work, costs, strict=True))

    def _look_again(self, size: int) -> None:
        """Fit what promised too little at weights from a poorer fit, and what has ended above a part of itself.

        A sample is worth many times more once most of the residual is explained: then that counts which promises at
        least half of what the best set of this size gains. And a set holds its parts, with an effect switched off.
        """
        for _ in range(_LOOKS):
            before = self._best()
            self._improve(size)
            smaller, found = self._ranked(size - 1)[0], self._ranked(size)[:1]
            gained = max(0.0, smaller.cost - found[0].cost) if found else 0.0
            work = {e: item for e, item in self._extensions(size).items() if self._astray(e, item[0])}
            expected = self._expected(work)
            least = smaller.cost - max(LEAST_PROMISE, 0.5 * gained)
            near = sorted((e for e in work if expected[e] < least), key=lambda effects: (expected[effects], effects))
            added = [work[effects] for effects in near[: 2 * self._settings.beam]]
            fits: list[Fit] = in_parallel(added, self._extend, step=f"sets of {size}", progress=self._progress)
            self._keep(fits)
            if not self._moved(before):
                break
            self._reweight()

    def _improve(self, size: int) -> None:
        """Try to better the best set of a size: events looked for anew, and each effect exchanged for every other.

        A single that explains little may be one of the two that explain all; its pairs were never proposed then. The
        set's own parts are fitted, too: what an effect gains is what the set without it lacks.
        """
        ranked = self._ranked(size)
        if not ranked:
            return
        best = ranked[0]
        events = [name for name in best.effects if self._fitter.candidates[name].propose is not None]
        work: list[Callable[[], Fit]] = [partial(self._fitter.propose_again, best, name) for name in events]
        work += self._exchanges(best)
        parts = [less(best.effects, name) for name in best.effects]
        work += [partial(self._fitter.fit, part, [best.values]) for part in parts if part not in self._fits]
        found: list[Fit] = in_parallel(work, lambda job: job(), step=f"sets of {size}", progress=self._progress)
        self._keep(found)

    def _exchanges(self, best: Fit) -> list[Callable[[], Fit]]:
        """Return the fits of what may best take the place of one of a set's effects.

        The linear picture at the set's own values, where that one is switched off, says which may.
        """
        others = [c for c in self._fitter.candidates.values() if c.named and c.id not in best.effects]
        work: list[_Exchange] = []
        for name in best.effects:
            rest = self._fitter.at(less(best.effects, name), best.values)
            picture, residual = LinearPicture(self._fitter, rest), self._fitter.residual(rest)
            work += [(rest, picture, c.id, c.starting_points(self._problem.time_s, residual)) for c in others]

        def expected(item: _Exchange) -> float:
            rest, picture, name, points = item
            return rest.cost - picture.gain(name, points)

        def exchanged(rest: Fit, name: str, points: Iterable[Mapping[str, float]]) -> Fit:
            effects, starts = self._fitter.ordered((*rest.effects, name)), [{**best.values, **p} for p in points]
            return self._fitter.fit(effects, starts, max_iterations=16, near=rest)

        costs: list[float] = in_parallel(work, expected)
        ranked = sorted(range(len(work)), key=lambda i: (costs[i], i))[: self._settings.beam]
        return [partial(exchanged, rest, name, points) for rest, _, name, points in (work[i] for i in ranked)]

    def _keep(self, fits: Iterable[Fit]) -> None:
        """Keep the fits of new sets, and those that are better than the set's own."""
        for fit in fits:
            if self._astray(fit.effects, fit):
                self._fits[fit.effects] = fit

    def _astray(self, effects: EffectSet, other: Fit) -> bool:
        """Return whether a set has not been fitted, or has ended above another fit."""
        return effects not in self._fits or self._fits[effects].cost > other.cost

    def _moved(self, before: Fit) -> bool:
        """Return whether another set explains most now, or the same one clearly better."""
        best = self._best()
        return best.effects != before.effects or best.cost < before.cost - LEAST_PROMISE

    def _extend(self, item: tuple[Fit, str]) -> Fit:
        parent, name = item
        single = self._fits.get((name,))
        if single is None:
            return self._fitter.extend(parent, name)
        candidate = self._fitter.candidates[name]
        own = candidate.own(single.values)
        base = {p.name: single.values[p.name] for p in self._problem.parameters}
        points = candidate.starting_points(self._problem.time_s, self._fitter.residual(parent))
        starts = [{**parent.values, **own}, {**parent.values, **base, **own}]
        starts += [{**parent.values, **point} for point in points[:4]]
        effects = self._fitter.ordered((*parent.effects, name))
        return self._fitter.fit(effects, starts, max_iterations=16, near=parent)

    def _named(self, effects: EffectSet) -> bool:
        return all(self._fitter.candidates[name].named for name in effects)

    def _ranked(self, size: int) -> list[Fit]:
        return sorted((f for f in self._fits.values() if len(f.effects) == size), key=lambda f: (f.cost, f.effects))

    def _best(self) -> Fit:
        """Return the fit that explains most, with its residual's size as free as its parameters (profile likelihood).

        At weights that come from a poor fit all sums of squares are small; what counts then is by which factor the
        residual shrinks, in motion and at rest apart.
        """
        return min(self._fits.values(), key=self._score)

    def _score(self, fit: Fit) -> tuple[float, EffectSet]:
        levels, motion = self._stretches.split()
        moving = pieces_in_motion(motion, self._scales)

        def size(residual: Array, ranges: list[tuple[int, int]], *, each: bool) -> float:
            squares = [residual[a:b] ** 2 + self._floor[a:b] ** 2 for a, b in ranges]
            means = [float(np.mean(square)) for square in squares]
            weights = None if each else [b - a for a, b in ranges]
            return float(np.log(np.average(means, weights=weights))) if means else 0.0

        residual = np.nan_to_num(self._fitter.residual(fit))
        data = len(levels) * size(residual, levels, each=True) + moving * size(residual, motion, each=False)
        return data + fit.cost - fit.solution.data_cost + 8.0 * len(fit.effects), fit.effects

    def _worth(self, size: int) -> bool:
        """Return whether larger sets may matter: something is left, and this size has gained something."""
        found = self._ranked(size)
        if not found:
            return False
        # Values that are pulled off their priors say as much as a residual that is left.
        expected = float(self._fitter.weight @ self._floor**2)
        held = sum(parameter.sigma is not None for parameter in found[0].parameters)
        left = found[0].cost - held > _MUCH_LEFT * expected or self._shows()
        gained = found[0].cost + LEAST_PROMISE < self._ranked(size - 1)[0].cost
        return left if size == 1 else left and gained

    def _shows(self) -> bool:
        """Return whether the best fit leaves more than the floor and the resolution, however alike its errors are.

        An error that hardly changes over a stretch of motion is one piece of information and may still be degrees.
        """
        valid = self._problem.valid
        least = max(self._problem.resolution, float(np.sqrt(np.mean(self._floor[valid] ** 2))))
        return max(self._scales.motion, self._scales.rest) > _SHOWS * least

    def _poor(self) -> bool:
        """Return whether the best fit leaves more than a small part of what the base model leaves, or too few pieces.

        An error that lives for long makes a record small: two sets are hardly told apart then, whichever leaves less.
        """
        large = self._left(self._best()) > _WELL_EXPLAINED * self._left(self._fits[()])
        return large or pieces(self._stretches, self._scales) < _FEW

    def _left(self, fit: Fit) -> float:
        """Return the root mean square of what a fit leaves."""
        return float(np.sqrt(np.mean(self._fitter.residual(fit)[self._problem.valid] ** 2)))

    def _reweight(self) -> None:
        """Take the weights from the best residual and refit, at them, what may still matter, until the best stays."""
        for _ in range(3):
            best = self._sharpened(self._best())
            kept = [*self._ranked(0), *self._ranked(1)]
            for size in range(2, self._settings.most_effects + 1):
                kept += self._ranked(size)[: 3 * self._settings.beam]
            refitted: list[Fit] = in_parallel(kept, self._refit, step="refits", progress=self._progress)
            self._fits = {fit.effects: fit for fit in [*refitted, best]}
            self._start_again()
            if not self._moved(best):
                break

    def _refit(self, fit: Fit, *, max_iterations: int = 6) -> Fit:
        return self._fitter.from_elsewhere(self._fitter.refit(fit, max_iterations=max_iterations))

    def _sharpened(self, fit: Fit) -> Fit:
        """Follow one fit and its own residual in turn until the residual stops shrinking."""
        for _ in range(_SHARPENINGS):
            before = self._scales
            self._follow(fit)
            fit = self._refit(fit, max_iterations=12)
            if self._scales.motion > 0.9 * before.motion and self._scales.rest > 0.9 * before.rest:
                break
        return fit

    def _start_again(self) -> None:
        """Fit once more, at weights that see more: sets from where larger sets have led, best singles from the start.

        A larger set may get out of a valley in which a smaller one sits; what it gains by that is not its effect's. A
        set that stands above a part of itself sits in a valley that the part has left.
        """
        led: list[Fit] = in_parallel(self._leading(), self._from_larger)
        self._keep(led)
        work: list[Callable[[], Fit]] = [partial(self._from_part, *item) for item in self._above_a_part()]
        if max(len(effects) for effects in self._fits) == 1:
            names = [fit.effects[0] for fit in self._ranked(1)[: self._settings.beam + 1]]
            work += [partial(self._fitter.extend, self._fits[()], name) for name in names]
        again: list[Fit] = in_parallel(work, lambda job: job())
        self._keep(again)

    def _above_a_part(self) -> list[tuple[Fit, Fit, str]]:
        """Return the sets that cost more than the best of their parts: set, part, and what the part lacks."""
        found = []
        for effects, fit in self._fits.items():
            parts = [(self._fits.get(less(effects, name)), name) for name in effects]
            fitted = [(part, name) for part, name in parts if part is not None]
            if not fitted:
                continue
            part, name = min(fitted, key=lambda item: (item[0].cost, item[1]))
            # What switches its effect off ends at the part's cost, to within the last steps.
            if part.cost < fit.cost - max(1.0, _SAME_COST * fit.cost):
                found.append((fit, part, name))
        return found

    def _from_part(self, fit: Fit, part: Fit, name: str) -> Fit:
        """Fit a set once more from where a part of it is: with the effect as it was, and as it may begin."""
        candidate = self._fitter.candidates[name]
        points = candidate.starting_points(self._problem.time_s, self._fitter.residual(part))[:2]
        starts = [{**part.values, **point} for point in (candidate.own(fit.values), *points)]
        return self._fitter.fit(fit.effects, starts, keep=1, near=part)

    def _leading(self) -> list[EffectSet]:
        """Return the sets on which a decision may turn: the best of every size, and all parts of the best of all."""
        best = set(self._best().effects)
        leading = [fit.effects for fit in self._fits.values() if set(fit.effects) <= best]
        for size in range(1, self._settings.most_effects + 1):
            leading += [fit.effects for fit in self._ranked(size)[:2]]
        return sorted(set(leading))

    def _from_larger(self, effects: EffectSet) -> Fit:
        """Return the set's fit, or a better one that starts where the best larger sets have led."""
        own = self._fits[effects]
        larger = [fit for fit in self._fits.values() if len(fit.effects) == len(effects) + 1]
        larger = sorted((fit for fit in larger if set(effects) < set(fit.effects)), key=lambda f: (f.cost, f.effects))
        names = [p.name for p in own.parameters]
        starts = [{name: fit.values[name] for name in names} for fit in larger[: self._settings.beam]]
        if not starts or larger[0].cost > own.cost - LEAST_PROMISE:
            return own
        return min(own, self._fitter.fit(effects, starts, keep=1), key=lambda fit: fit.cost)

    def _follow(self, fit: Fit) -> None:
        """Take floor, scales and weights from a fit's residual."""
        problem = self._problem
        residual = np.where(problem.valid, problem.observed - fit.solution.prediction, 0.0)
        if not problem.sigma[problem.valid].any():
            self._floor = np.full(len(residual), reading_noise(problem, self._stretches, residual))
        else:
            self._floor = problem.sigma
        self._floor = np.hypot(self._floor, problem.input_noise(fit.values, fit.effects))
        self._scales = residual_scales(residual, self._stretches, self._floor)
        self._fitter = Fitter(problem, self._weights())

    def _weights(self) -> Array:
        return information(self._stretches, self._scales, self._floor)
