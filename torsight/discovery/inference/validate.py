"""Prediction of held-out blocks.

A block (half-cycle, cycle, run) is left out whole: the model still runs through it, because it is the history of later
blocks, but its samples do not count in the fit, and only its samples count in the score.

Values of an event (a bump), or of the state before the record, cannot be predicted from blocks that do not show them.
Such values stay as fitted to the whole record; the score then tests whether all other values, fitted without the block,
agree with them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.linalg import solve_triangular

from torsight.core.progress import Progress, silent
from torsight.core.series import rms
from torsight.core.units import Floats, Ints
from torsight.discovery.inference.fitting import Fit, Fitter, space_of
from torsight.discovery.inference.laplace import prior_information
from torsight.discovery.interface import Problem
from torsight.discovery.weight import Weight

_NOTHING: Final = 0.01
"""Share of a record's information about a value below which the other blocks say nothing about it."""


@dataclass(frozen=True, slots=True, eq=False)
class HeldOut:
    """Residuals of blocks that were each predicted from the others.

    ``residual`` (n,) is measured less predicted, NaN where a sample does not count, and ``rms`` its root mean square.
    ``folds`` holds each block's label and the parameters fitted without it; ``unsure`` (n, k) is the change of each
    block by one standard deviation of these values, one column each.
    """

    residual: Floats
    rms: float
    folds: tuple[tuple[int, dict[str, float]], ...]
    unsure: Floats


def block_labels(problem: Problem) -> Ints:
    """Return the labels of the blocks that hold valid samples."""
    return np.unique(problem.block[problem.valid])


def held_out_by_refit(fitter: Fitter, fit: Fit, *, block: Ints | None = None, progress: Progress = silent) -> HeldOut:
    """Predict every block from the others, with a full refit per block; ``progress`` is called after each.

    ``block`` (n,) takes the place of the problem's own blocks, for larger ones such as whole records.
    """
    problem = fitter.problem
    block = problem.block if block is None else block
    labels = np.unique(block[problem.valid])

    def without(label: int) -> tuple[Fit, Floats]:
        weight = fitter.weight.only(block != label)
        kept = _unpredicted(fitter, fit, weight)
        spread = _spread(fit, weight, kept, base=len(problem.parameters))
        return fitter.refit(fit, weight=weight, kept=kept, rough=True), spread

    fits: list[tuple[Fit, Floats]] = problem.at_once(
        labels.tolist(), without, step="held-out blocks", progress=progress
    )
    left, unsure = np.zeros(len(problem.observed)), []
    for label, (fold, spread) in zip(labels, fits, strict=True):
        rows = (block == label) & problem.valid
        left[rows] = problem.observed[rows] - fold.solution.prediction[rows]
        unsure.append(np.where(rows[:, None], spread, 0.0))
    folds = tuple((int(label), fold.values) for label, (fold, _) in zip(labels, fits, strict=True))
    return HeldOut(np.where(problem.valid, left, np.nan), rms(left[problem.valid]), folds, np.hstack(unsure))


def _spread(fit: Fit, weight: Weight, kept: list[str], *, base: int) -> Floats:
    """Return the change (n, m) of the prediction by one standard deviation along each principal axis of the values.

    Their covariance is that from the samples that count in ``weight``; the first ``base`` values are the plain model's.
    """
    free = [i for i, p in enumerate(fit.parameters) if p.name not in kept]
    derivative = fit.solution.jacobian[:, free]
    prior = prior_information(space_of(fit.parameters), fit.solution.x, base)[free]
    return np.asarray(solve_triangular(weight.factor(derivative, prior), derivative.T, trans="T").T)


def _unpredicted(fitter: Fitter, fit: Fit, weight: Weight) -> list[str]:
    """Return the values of events and initial states about which the remaining samples hold no information."""
    events = [fitter.candidates[name] for name in fit.effects if fitter.candidates[name].event is not None]
    once = {p.name for event in events for p in event.parameters} | set(fitter.problem.once)
    squares = fit.solution.jacobian**2
    nothing = weight.each @ squares <= _NOTHING * (fitter.weight.each @ squares)
    return [p.name for p, untold in zip(fit.parameters, nothing, strict=True) if untold and p.name in once]
