"""From fitted sets of effects to a verdict.

A set is believed where every member earns its place twice: by a gain above what the luckiest candidate takes from
noise, and by predicting blocks that the fit has not seen (:mod:`.judge`). It is named only where it is also adequate
(it explains most of what was to explain, or leaves little more than the floor); otherwise something real is missing
that has no name here. Sets that explain the record within a small cost of the best are rivals and are all told.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from torsight.core.progress import Progress, silent
from torsight.discovery.common import mean_square, relaxed
from torsight.discovery.contenders import Contender, Field
from torsight.discovery.fitting import EffectSet
from torsight.discovery.judge import Judge
from torsight.discovery.null import gain_threshold
from torsight.discovery.priors import prior_count
from torsight.discovery.settings import Settings
from torsight.discovery.stand_in import LEAST_PULLED


@dataclass(frozen=True, slots=True, eq=False)
class Decision:
    """What is named and why.

    Attributes
    ----------
    chosen : Contender
        The set that is named, or the base model.
    best : Contender
        The best set that earned its place, whether or not it is adequate.
    much_left : bool
        Whether the base model leaves, or has moved, more than anything but a missing effect could.
    nearest : Contender or None
        The mechanism without a name that comes nearest, where much is left and nothing explains it.
    rivals : tuple of Contender
        Other sets that explain the record as well as ``chosen``.
    probability : dict
        Posterior weight of each set among the chosen and its rivals.
    threshold : float
        The gain that the luckiest candidate takes from noise.
    share_explained : float
        Share that ``best`` explains of what can be explained.
    excess : float
        Root mean square of the base model's residual over the floor, both in information.
    left : float
        The same of ``best``.
    """

    chosen: Contender
    best: Contender
    much_left: bool
    nearest: Contender | None
    rivals: tuple[Contender, ...]
    probability: dict[EffectSet, float]
    threshold: float
    share_explained: float
    excess: float
    left: float


def decide(
    field: Field, *, settings: Settings, seed: int, can_hold_out: bool = True, progress: Progress = silent
) -> Decision:
    """Choose among the contenders of a search."""
    threshold = gain_threshold(
        field.fitter, field.base.fit, stretches=field.stretches, scales=field.scales, seed=seed, progress=progress
    )
    judge = Judge(field, settings, threshold, seed=seed, can_hold_out=can_hold_out)
    best = field.base
    for size in range(1, settings.most_effects + 1):
        contenders = field.of_size(size)
        for contender in contenders:
            if contender.named and contender.cost < best.cost and judge.earned(contender):
                # What does not show is believed only of a set that also explains the record best.
                if judge.shows(contender) or judge.is_best(contender, contenders):
                    best = contender
                break
    chosen = best if judge.adequate(best) else field.base
    chosen = judge.nameless(chosen) or chosen
    much = much_left(field, field.base, settings=settings)
    if chosen.effects and not (judge.worth_telling(chosen) or much):
        chosen = field.base
    rivals = judge.rivals(chosen) if chosen.effects and chosen.named else []
    first = judge.first_of(chosen, rivals)
    rivals, chosen = [c for c in (chosen, *rivals) if c is not first], first
    return Decision(
        chosen=chosen,
        best=best,
        much_left=much,
        nearest=judge.nearest() if much and not chosen.effects else None,
        rivals=tuple(rivals),
        probability=_weights([chosen, *rivals]),
        threshold=threshold,
        share_explained=judge.share(best),
        excess=judge.over_floor(field.base),
        left=judge.over_floor(best),
    )


def much_left(field: Field, contender: Contender, *, settings: Settings) -> bool:
    """Return whether a fit leaves, or has moved, more than anything but a missing effect could."""
    problem = field.fitter.problem
    left = float(np.sqrt(mean_square(problem, problem.observed - contender.fit.solution.prediction)))
    floor = float(np.sqrt(mean_square(problem, field.floor)))
    times_floor = settings.over_floor_unknown if field.stretches.rest.any() else getattr(problem, "over_floor", None)
    if times_floor is not None and left > max(settings.least_unknown * problem.resolution, times_floor * floor):
        return True
    # Several characterised values at odds with the record at once are no accident: they imitate something.
    return relaxed(field, contender).prior - prior_count(problem) >= LEAST_PULLED


def _weights(contenders: list[Contender]) -> dict[EffectSet, float]:
    cost = np.array([c.cost for c in contenders])
    weight = np.exp(-0.5 * (cost - cost.min()))
    return {c.effects: float(w) for c, w in zip(contenders, weight / weight.sum(), strict=True)}
