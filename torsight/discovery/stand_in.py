"""A learned stand-in for a missing effect without a name, and what it depends on.

Residual and features are fitted together with the model's own derivatives, so that the closure takes only what the
parameters cannot imitate (the same as making both orthogonal to the Jacobian, with the priors counted in): where the
fit had pulled values far from their priors to imitate it, they may go back. Whatever is claimed is claimed on blocks
that were not in the fit. Drivers enter one after the other, the best on unseen blocks first, as long as each beats its
own features taken from other blocks (shifted by whole blocks, which keeps their form and breaks their bond to the
residual).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from torsight.discovery.contenders import Contender, Field
from torsight.discovery.features import Basis, bases_of
from torsight.discovery.fitting import space_of
from torsight.discovery.interface import Closure
from torsight.discovery.priors import prior_count
from torsight.discovery.solver import Array, linear_change
from torsight.discovery.validate import block_labels

LEAST_GAIN: Final = 0.25
"""Share of the residual on unseen blocks that a closure must remove."""
LEAST_SIZE: Final = 4.5
"""Resolutions (root mean square) by which it must move the model."""
LEAST_PULLED: Final = 20.0
"""Excess of the priors' cost from which the values are taken to imitate something."""
_LEAST_STEP: Final = 0.04
_MOST_DRIVERS: Final = 4


@dataclass(frozen=True, slots=True, eq=False)
class _Blocks:
    """Normal equations per block: (b, k, k), (b, k), (b,)."""

    matrix: Array
    vector: Array
    square: Array

    def held_out(self, prior: Array, centre: Array) -> float:
        """Return the information left on blocks that are each predicted from the others, and what the values cost."""
        total, side = self.matrix.sum(axis=0) + np.diag(prior), self.vector.sum(axis=0) + prior * centre
        left = 0.0
        for own, own_side, square in zip(self.matrix, self.vector, self.square, strict=True):
            c = np.linalg.solve(total - own, side - own_side)
            left += float(square - 2.0 * c @ own_side + c @ own @ c)
            left += float(prior @ (c - centre) ** 2) / len(self.square)
        return left


def learn_closure(field: Field, contender: Contender, *, seed: int, least_gain: float = LEAST_GAIN) -> Closure | None:
    """Learn a stand-in for what a fitted set leaves, or return None where nothing predictable is left.

    ``least_gain`` is the share of the residual on unseen blocks that it must remove.
    """
    found = _learn(field, contender, seed=seed)
    if found is None:
        return None
    problem = field.fitter.problem
    gain = 1.0 - found.left[-1] / found.alone
    if gain < least_gain or (least_gain > 0.0 and found.size * np.sqrt(gain) < LEAST_SIZE * problem.resolution):
        return None
    used = {name: found.groups[name] for name in found.chosen}
    coefficients = found.design.coefficients(used)
    own = len(fit_names := [p.name for p in contender.fit.parameters])
    return Closure(
        shift=dict(zip(fit_names, coefficients[:own].tolist(), strict=True)),
        bases=tuple(basis for name in found.chosen for basis in found.bases[name]),
        weights=tuple(coefficients[own:].tolist()),
        drivers=_shares(found.chosen, found.alone, found.left),
        held_out_gain=gain,
        ridge=found.design.ridge,
        residual=found.design.held_out_residual(used),
    )


def predictable(field: Field, contender: Contender, *, seed: int) -> float:
    """Return the information that a stand-in would still remove from a fitted set's residual, on unseen blocks."""
    found = _learn(field, contender, seed=seed)
    return 0.0 if found is None else found.alone - found.left[-1]


def likely_driver(field: Field, contender: Contender, *, seed: int) -> tuple[tuple[str, float], ...]:
    """Return the variable that tells most of what is left on unseen blocks, where none tells it reliably."""
    found = _learn(field, contender, seed=seed, least=1)
    return () if found is None else ((found.chosen[0], 1.0),)


def declared_drivers(field: Field, contender: Contender) -> tuple[tuple[str, float], ...]:
    """Return the drivers of a mechanism without a name, with the share of what it does that each alone tells."""
    problem, fit, weight = contender.fitter.problem, contender.fit, field.fitter.weight
    candidate = contender.fitter.candidates[contender.effects[0]]
    without = problem.predict({**fit.values, **candidate.null_point()}, fit.effects)
    done = fit.solution.prediction - without
    done = done - np.average(done, weights=weight)
    bases = bases_of(problem.drivers, weight)
    told = {}
    for name in candidate.drivers:
        columns = np.column_stack([basis.columns(problem.drivers) for basis in bases.get(name, ())] or [done * 0.0])
        columns = np.column_stack([columns, np.ones(len(done))]) * np.sqrt(weight)[:, None]
        fitted = columns @ np.linalg.lstsq(columns, done * np.sqrt(weight))[0]
        told[name] = float(np.sum(fitted**2)) + 1e-12
    total = sum(told.values())
    return tuple(sorted(((name, size / total) for name, size in told.items()), key=lambda item: -item[1]))


@dataclass(frozen=True, slots=True, eq=False)
class _Learned:
    """What the search for drivers came to: information left on unseen blocks without, and after each driver."""

    design: _Design
    bases: Mapping[str, tuple[Basis, ...]]
    groups: Mapping[str, Array]
    size: float
    alone: float
    chosen: tuple[str, ...]
    left: tuple[float, ...]


def _learn(field: Field, contender: Contender, *, seed: int, least: int = 0) -> _Learned | None:
    problem, fit, weight = field.fitter.problem, contender.fit, field.fitter.weight
    labels = block_labels(problem)
    if not problem.drivers or len(labels) < 2:
        return None
    residual = np.where(weight > 0.0, problem.observed - fit.solution.prediction, 0.0)
    size = float(np.sqrt(np.average(residual**2, weights=weight)))
    bases = bases_of(problem.drivers, weight)
    groups = {name: np.column_stack([b.columns(problem.drivers) for b in own]) for name, own in bases.items()}
    space = space_of(fit.parameters)
    held = space.prior_information > 0.0
    back = np.where(held, np.where(held, space.prior_mean, 0.0) - fit.solution.x, 0.0)
    known = _Group(fit.solution.jacobian, space.prior_information + 1e-4 / space.scale**2, back)
    # A hat function's height is expected to be of the residual's size, or of what pulled values had imitated.
    hidden = fit.solution.jacobian @ back if contender.prior - prior_count(problem) >= LEAST_PULLED else 0.0 * residual
    height = float(np.sqrt(np.average(residual**2 + hidden**2, weights=weight)))
    design = _Design(problem.block, labels, weight, residual, known, 1.0 / (2.0 * height) ** 2)
    alone = design.score({})
    chosen, left = _forward(design, groups, alone, seed=seed, least=least)
    return _Learned(design, bases, groups, size, alone, tuple(chosen), tuple(left)) if chosen else None


def _shares(chosen: Sequence[str], alone: float, left: Sequence[float]) -> tuple[tuple[str, float], ...]:
    steps = -np.diff([alone, *left])
    shares = steps / steps.sum()
    ranked = sorted(zip(chosen, shares.tolist(), strict=True), key=lambda item: -item[1])
    return tuple(ranked)


@dataclass(frozen=True, slots=True, eq=False)
class _Group:
    columns: Array
    prior: Array
    centre: Array


@dataclass(frozen=True, slots=True, eq=False)
class _Design:
    block: NDArray[np.int64]
    labels: NDArray[np.int64]
    weight: Array
    residual: Array
    known: _Group
    ridge: float

    def _stacked(self, groups: Mapping[str, Array]) -> tuple[Array, Array]:
        columns = np.column_stack([self.known.columns, *groups.values()])
        extra = columns.shape[1] - self.known.columns.shape[1]
        return columns, np.concatenate([self.known.prior, np.full(extra, self.ridge)])

    def score(self, groups: Mapping[str, Array]) -> float:
        """Return the information left on unseen blocks with these features."""
        columns, prior = self._stacked(groups)
        size = columns.shape[1]
        matrix, vector = np.empty((len(self.labels), size, size)), np.empty((len(self.labels), size))
        square = np.empty(len(self.labels))
        for i, label in enumerate(self.labels):
            rows = self.block == label
            weighted = columns[rows] * self.weight[rows, None]
            matrix[i] = weighted.T @ columns[rows]
            vector[i] = weighted.T @ self.residual[rows]
            square[i] = float(self.weight[rows] @ self.residual[rows] ** 2)
        return _Blocks(matrix, vector, square).held_out(prior, self._centre(size))

    def _centre(self, size: int) -> Array:
        """Return where the priors want the coefficients: the parameters back at their means, the features at zero."""
        return np.concatenate([self.known.centre, np.zeros(size - len(self.known.centre))])

    def coefficients(self, groups: Mapping[str, Array]) -> Array:
        """Return the features' coefficients from the whole record, the parameters' shares first."""
        columns, prior = self._stacked(groups)
        centre = self._centre(len(prior))
        return linear_change(columns, self.residual, weight=self.weight, information=prior, centre=centre)

    def held_out_residual(self, groups: Mapping[str, Array]) -> Array:
        """Return the residual of each block, predicted from the others."""
        columns, prior = self._stacked(groups)
        weighted = columns * self.weight[:, None]
        total = weighted.T @ columns + np.diag(prior)
        side = weighted.T @ self.residual + prior * self._centre(len(prior))
        left = np.empty_like(self.residual)
        for label in self.labels:
            rows = self.block == label
            own = weighted[rows].T
            c = np.linalg.solve(total - own @ columns[rows], side - own @ self.residual[rows])
            left[rows] = self.residual[rows] - columns[rows] @ c
        return left

    def shifted(self, columns: Array, shift: int) -> Array:
        """Return features whose blocks are taken from other blocks, stretched to their lengths."""
        out = np.empty_like(columns)
        count = len(self.labels)
        for i, label in enumerate(self.labels):
            to = np.flatnonzero(self.block == label)
            source = np.flatnonzero(self.block == self.labels[(i + shift) % count])
            picked = np.minimum((np.arange(len(to)) * len(source)) // len(to), len(source) - 1)
            out[to] = columns[source[picked]]
        return out


def _forward(
    design: _Design, groups: Mapping[str, Array], alone: float, *, seed: int, least: int
) -> tuple[list[str], list[float]]:
    """Return drivers in the order in which they help on unseen blocks (``least`` in any case), and what each leaves."""
    chosen: list[str] = []
    left: list[float] = []
    before = alone
    rng = np.random.default_rng(seed)
    shifts = rng.permutation(np.arange(1, len(design.labels)))[:6].tolist()
    while len(chosen) < _MOST_DRIVERS:
        kept = {name: groups[name] for name in chosen}
        scores = {name: design.score({**kept, name: groups[name]}) for name in groups if name not in chosen}
        if not scores:
            break
        best = min(scores, key=lambda name: (scores[name], name))
        chance = min((design.score({**kept, best: design.shifted(groups[best], s)}) for s in shifts), default=before)
        helps = scores[best] <= before - _LEAST_STEP * alone and scores[best] < min(chance, before)
        if not helps and len(chosen) >= least:
            break
        chosen.append(best)
        left.append(scores[best])
        before = scores[best]
    return chosen, left
