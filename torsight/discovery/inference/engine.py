"""The engine: from a record and a model to what the model lacks.

Fit the plain model; fit every effect and measure every law beside it, then sets of the best (:mod:`.search` chooses
them, :mod:`.set_fits` fits one); derive the answer from the posterior of these sets (:mod:`.verdict`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from torsight.core.errors import InputError
from torsight.core.progress import Progress, silent
from torsight.discovery.inference.explanation import Explanation, Field
from torsight.discovery.inference.fitting import less
from torsight.discovery.inference.search import Search
from torsight.discovery.inference.validate import HeldOut, block_labels
from torsight.discovery.inference.verdict import Decision, decide
from torsight.discovery.interface import Problem
from torsight.discovery.settings import Settings

Verdict = Literal["none", "identified", "ambiguous", "unknown"]


@dataclass(frozen=True, slots=True, eq=False)
class Findings:
    """Answer of the engine.

    Attributes
    ----------
    verdict : str
        ``none``, ``identified``, ``ambiguous`` or ``unknown``.
    field : Field
        All explanations that were fitted.
    decision : Decision
        The chosen set, its names, its rivals, and all probabilities.
    before, after : HeldOut or None
        Prediction of held-out blocks by the plain model and by the chosen set; None where there is one block only.
    drivers : tuple of (str, float)
        Drivers of the measured laws, each with its share of what the laws explain, strongest first.
    """

    verdict: Verdict
    field: Field
    decision: Decision
    before: HeldOut | None
    after: HeldOut | None
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
        Probabilities and budgets of the decision.
    seed : int
        Not used: the search draws no random numbers.
    progress : Progress
        Called with the name of each step and how much of the step is done.

    Raises
    ------
    InputError
        When no sample counts.
    """
    del seed
    chosen_settings = settings or Settings()
    if not np.any(problem.valid):
        raise InputError("no sample counts", where="record", do="record it again")
    can_hold_out = len(block_labels(problem)) > 1
    search = Search(problem, settings=chosen_settings, progress=progress)
    field = search.run()
    decision = decide(field, settings=chosen_settings, choices=search.choices, can_hold_out=can_hold_out)
    before = field.plain.held_out if can_hold_out else None
    after = decision.chosen.held_out if can_hold_out else None
    verdict = _verdict(decision, problem.over_floor)
    return Findings(verdict, field, decision, before, after, _drivers(field, decision.chosen))


def _verdict(decision: Decision, most: float) -> Verdict:
    """Return the verdict; ``most`` is the largest residual, in noise floors, of a model that lacks nothing."""
    if not decision.chosen.members:
        return "none" if decision.over_floor <= most else "unknown"
    if decision.rivals:
        return "ambiguous"
    return "unknown" if decision.unnamed else "identified"


def law_shares(field: Field, chosen: Explanation) -> dict[str, float]:
    """Return the share of each law of a set in the evidence that would be lost without its laws.

    Without a law the record has the evidence of the best part of the set that was fitted and lacks the law: the part
    with all other members need not have been fitted.
    """
    lost = {}
    for item in chosen.laws:
        others = set(less(chosen.members, item.law.id))
        without = max(one.log_evidence for members, one in field.explanations.items() if others.issuperset(members))
        lost[item.law.id] = max(chosen.log_evidence - without, 1e-9)
    total = sum(lost.values())
    return {name: size / total for name, size in lost.items()}


def _drivers(field: Field, chosen: Explanation) -> tuple[tuple[str, float], ...]:
    """Return the drivers of a set's laws, with their shares."""
    shares, found = law_shares(field, chosen), dict[str, float]()
    for item in chosen.laws:
        found[item.law.driver] = found.get(item.law.driver, 0.0) + shares[item.law.id]
    return tuple(sorted(found.items(), key=lambda pair: -pair[1]))
