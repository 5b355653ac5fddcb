"""The engine: from a record and a model to what the model lacks.

The order of work: fit the base model; measure the noise floor and what a residual is worth (:mod:`.noise`); fit every
candidate together with the base, then sets of the best (:mod:`.search`); believe what beats chance and predicts blocks
that the fit has not seen, name what is adequate, tell rivals (:mod:`.decide`); and where something real is left without
a name, learn a stand-in and say what it depends on (:mod:`.stand_in`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from torsight.core.errors import InputError
from torsight.core.progress import Progress, silent
from torsight.discovery.common import mean_square
from torsight.discovery.contenders import Field
from torsight.discovery.decide import Decision, decide
from torsight.discovery.interface import Closure, Problem
from torsight.discovery.search import Search
from torsight.discovery.settings import Settings
from torsight.discovery.solver import Array
from torsight.discovery.stand_in import LEAST_GAIN, declared_drivers, learn_closure, likely_driver
from torsight.discovery.validate import HeldOut, block_labels

Verdict = Literal["none", "identified", "ambiguous", "unknown"]


@dataclass(frozen=True, slots=True, eq=False)
class Findings:
    """What the engine found.

    Attributes
    ----------
    verdict : str
        ``none``, ``identified``, ``ambiguous`` or ``unknown``.
    field : Field
        Everything that was fitted, at the last weights.
    decision : Decision
        What is named and why.
    before, after : HeldOut or None
        Prediction of unseen blocks by the base model and by the named set; None where there is one block only.
    closure : Closure or None
        The learned stand-in, for ``unknown``; None where a mechanism without a name stands in.
    drivers : tuple of (str, float)
        What is missing depends on this, for ``unknown``: variable and share, strongest first.
    """

    verdict: Verdict
    field: Field
    decision: Decision
    before: HeldOut | None
    after: HeldOut | None
    closure: Closure | None
    drivers: tuple[tuple[str, float], ...] = ()


def find_missing(
    problem: Problem, *, settings: Settings | None = None, seed: int = 0, progress: Progress = silent
) -> Findings:
    """Find what a model lacks.

    Parameters
    ----------
    problem : Problem
        Record and model.
    settings : Settings, optional
        How to decide.
    seed : int
        Of the draws for the threshold; the same seed gives the same answer.
    progress : Progress
        Told how far the work is.

    Raises
    ------
    InputError
        When no sample counts.
    """
    chosen_settings = settings or Settings()
    if not np.any(problem.valid):
        raise InputError("no sample counts", where="record", do="record it again")
    can_hold_out = len(block_labels(problem)) > 1
    field = Search(problem, settings=chosen_settings, progress=progress).run()
    decision = decide(field, settings=chosen_settings, seed=seed, can_hold_out=can_hold_out, progress=progress)
    before = after = closure = None
    if can_hold_out:
        before, after = field.base.held_out, decision.chosen.held_out
        if not decision.chosen.effects:
            much, nearest = decision.much_left, decision.nearest
            closure = learn_closure(field, field.base, seed=seed, least_gain=0.0 if much else LEAST_GAIN)
            if much and closure is not None and _nearer(problem, before.residual, closure.residual):
                closure = None
            if nearest is not None and (
                closure is None or _nearer(problem, nearest.held_out.residual, closure.residual)
            ):
                decision, after, closure = replace(decision, chosen=nearest), nearest.held_out, None
    unnamed = closure is not None or decision.much_left
    drivers: tuple[tuple[str, float], ...] = ()
    if not decision.chosen.named:
        drivers = declared_drivers(field, decision.chosen)
    elif closure is not None:
        drivers = closure.drivers
    elif unnamed and can_hold_out and not decision.chosen.effects:
        drivers = likely_driver(field, field.base, seed=seed)
    return Findings(_verdict(decision, unnamed=unnamed), field, decision, before, after, closure, drivers)


def _nearer(problem: Problem, residual: Array, other: Array) -> bool:
    """Return whether the first of two residuals of unseen blocks is less, over time."""
    return mean_square(problem, residual) < mean_square(problem, other)


def _verdict(decision: Decision, *, unnamed: bool) -> Verdict:
    if not decision.chosen.named:
        return "unknown"
    if decision.chosen.effects:
        return "ambiguous" if decision.rivals else "identified"
    return "unknown" if unnamed else "none"
