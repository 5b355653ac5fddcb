"""How far each hidden effect of a record shows at all, whatever discovery makes of it.

An effect may move the angle by degrees and still leave nothing: the other effects and the characterised values, within
what is known of them, take it up. So the set of what is hidden is fitted, and the set without one of them, from
several starts each; what the smaller set misses more on half-cycles that it has not seen is what that one shows. Both
are given all that the library has; nothing is searched for.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import permutations

import numpy as np

from torsight.discovery.fitting import Fit, Fitter
from torsight.discovery.interface import Problem
from torsight.discovery.noise import Scales, Stretches, first_scales, information, residual_scales
from torsight.discovery.validate import held_out_by_refit

_ROUNDS = 2


def shown(problem: Problem, names: Sequence[str]) -> dict[str, float]:
    """Return by how much the held-out error (root mean square over time) grows without each effect.

    The root of the difference of the mean squares, in units of what is measured; 0 where the smaller set does as well.
    """
    stretches = Stretches.of(problem)
    fitter = _fitter(problem, stretches, first_scales(problem, stretches), problem.sigma)
    whole = _grown(fitter, names)
    for _ in range(_ROUNDS):
        # What a sample is worth follows from what the whole set leaves.
        residual = np.where(problem.valid, problem.observed - whole.solution.prediction, 0.0)
        floor = np.hypot(problem.sigma, problem.input_noise(whole.values, whole.effects))
        fitter = _fitter(problem, stretches, residual_scales(residual, stretches, floor), floor)
        whole = min(fitter.refit(whole, max_iterations=12), _grown(fitter, names), key=lambda fit: fit.cost)
    least = _missed(fitter, whole)
    found = {}
    for name in names:
        others = [other for other in names if other != name]
        part = fitter.ordered(others)
        near = {p.name: whole.values[p.name] for p in fitter.parameters(part)}
        without = min(_grown(fitter, others), fitter.fit(part, [near]), key=lambda fit: fit.cost)
        found[name] = float(np.sqrt(max(0.0, _missed(fitter, without) - least)))
    return found


def _fitter(problem: Problem, stretches: Stretches, scales: Scales, floor: np.ndarray) -> Fitter:
    return Fitter(problem, information(stretches, scales, floor))


def _grown(fitter: Fitter, names: Sequence[str]) -> Fit:
    """Return the best fit of a set that is put together one by one, in every order."""
    found = []
    base = fitter.base()
    for order in permutations(names):
        fit = base
        for name in order:
            fit = fitter.extend(fit, name)
        found.append(fit)
    return min(found, key=lambda fit: fit.cost)


def _missed(fitter: Fitter, fit: Fit) -> float:
    """Return the mean square over time by which half-cycles are missed that were each predicted from the others."""
    problem = fitter.problem
    left = held_out_by_refit(fitter, fit).residual[problem.valid]
    return float(np.average(left**2, weights=np.gradient(problem.time_s)[problem.valid]))
