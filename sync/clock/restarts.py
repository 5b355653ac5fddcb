"""Joint estimation of the clock and the gaps at restarts of the log, for gaps that the log does not show.

For a restart during a rest two hypotheses are compared: the clock alone restarted (one usual step passed), or the
logger was off for an unknown time. This time is first searched for, such that strokes after the restart coincide with
their heatings.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from sync.clock.clock_priors import PRIORS
from sync.clock.gaussian_mixture import MOST_HYPOTHESES, Gaussian, UnknownGap
from sync.clock.motion_likelihood import MotionLikelihood, motion_likelihood
from sync.clock.offset_search import best_share
from sync.log.repairs import LogReading
from sync.log.restart_gaps import LONGEST_GAP_S
from sync.log.timestamps import longest_gap_s
from sync.signals.heating_segments import HeatingSegment, log_signals
from sync.signals.strokes import find_strokes
from torsight.core.series import usual_step
from torsight.core.tracks import StickAngles

SURE_GAP_S: Final = PRIORS.stop_sigma_s / 5
"""Standard deviation below which a gap is no unknown of the clock: a fifth of a stop's."""
_AWAY_CELLS_S: Final = (
    (0.0, 10.0, 0.12),
    (10.0, 30.0, 0.08),
    (30.0, 80.0, 0.05),
    (80.0, 240.0, 0.03),
    (240.0, LONGEST_GAP_S, 0.02),
)
"""Ranges of the logger's time off, with their prior probabilities; short enough for the middle to be a start value."""
_STEP_S: Final = _AWAY_CELLS_S[0][1]
"""Step of the search: the shortest range."""
_CLOCK_ONLY: Final = 1.0 - sum(share for _, _, share in _AWAY_CELLS_S)
"""Prior probability that the clock alone restarted: the remainder."""


@dataclass(frozen=True, slots=True, eq=False)
class WeighedRestarts:
    """The likelihood of the motion, and the log with its restarts shifted by the gaps from the motion.

    The likelihood is None where nothing moves or nothing fits.
    """

    likelihood: MotionLikelihood | None
    reading: LogReading


def weigh_restarts(angles: StickAngles, reading: LogReading, *, prior: Gaussian | None) -> WeighedRestarts:
    """Return the likelihood of the motion, with the gaps of the log's restarts as unknowns."""
    hypotheses = [(reading, 0.0)]
    for number, restart in enumerate(reading.restarts):
        if np.isfinite(restart.gap_sigma_s):
            continue
        options = [(0.0, usual_step(reading.log.time_s), _CLOCK_ONLY), *_time_away(angles, reading, number)]
        hypotheses = [
            (with_gap(hypothesis, number, middle_s, half_s), weight + float(np.log(share)))
            for hypothesis, weight in hypotheses
            for middle_s, half_s, share in options
        ]
        hypotheses = sorted(hypotheses, key=lambda hypothesis: -hypothesis[1])[:MOST_HYPOTHESES]
    found: list[tuple[MotionLikelihood, LogReading, float]] = []
    for hypothesis, weight in hypotheses:
        likelihood = motion_likelihood(angles, hypothesis.log, prior=prior, gaps=unknown_gaps(hypothesis))
        if likelihood is not None:
            found.append((likelihood, hypothesis, weight))
    if not found:
        return WeighedRestarts(None, reading)
    likelihood, chosen, _ = max(found, key=lambda item: item[2] + item[0].weight)
    mixture = [
        gaussian.weighted(weight).moved(likelihood.middle_s - other.middle_s)
        for other, _, weight in found
        for gaussian in other.mixture
    ]
    return WeighedRestarts(replace(likelihood, mixture=tuple(mixture)), moved_to(chosen, likelihood.mixture))


def unknown_gaps(reading: LogReading) -> tuple[UnknownGap, ...]:
    """Return the uncertain gaps of the restarts as unknowns."""
    time_s = reading.log.time_s
    return tuple(
        UnknownGap(float(time_s[restart.index - 1]), float(time_s[restart.index]), restart.gap_sigma_s)
        for restart in reading.restarts
        if SURE_GAP_S < restart.gap_sigma_s < np.inf
    )


def with_gap(reading: LogReading, number: int, longer_s: float, sigma_s: float) -> LogReading:
    """Return the log with all rows after a restart shifted later, with the standard deviation of the new gap."""
    restart = reading.restarts[number]
    time_s = reading.log.time_s.copy()
    time_s[restart.index :] += longer_s
    changed = replace(restart, shift_s=restart.shift_s + longer_s, gap_s=restart.gap_s + longer_s, gap_sigma_s=sigma_s)
    later = [replace(item, shift_s=item.shift_s + longer_s) for item in reading.restarts[number + 1 :]]
    return replace(
        reading, log=replace(reading.log, time_s=time_s), restarts=(*reading.restarts[:number], changed, *later)
    )


def moved_to(reading: LogReading, mixture: Sequence[Gaussian]) -> LogReading:
    """Return the log with its restarts shifted by the missing times of the most likely Gaussian."""
    best = max(mixture, key=lambda gaussian: gaussian.log_weight)
    unsure = [n for n, restart in enumerate(reading.restarts) if SURE_GAP_S < restart.gap_sigma_s < np.inf]
    for place, number in enumerate(unsure):
        # A gap cannot be negative.
        longer_s = max(float(best.mean[2 + place]), -0.9 * reading.restarts[number].gap_s)
        reading = with_gap(reading, number, longer_s, float(np.sqrt(best.covariance[2 + place, 2 + place])))
    return reading


def _time_away(angles: StickAngles, reading: LogReading, number: int) -> list[tuple[float, float, float]]:
    """Return ranges (middle, half width, weight) of the logger's time off in which strokes coincide with heatings."""
    strokes = find_strokes(angles)
    segments = log_signals(reading.log, max_gap_s=longest_gap_s(reading.log.time_s)).segments
    if not strokes or not segments:
        return []
    joint_s = float(reading.log.time_s[reading.restarts[number].index])
    away_s = np.arange(0.0, LONGEST_GAP_S, _STEP_S)

    def placed(away: float) -> list[HeatingSegment]:
        """Return the segments with those after the restart so much later."""
        return [
            replace(f, begin_s=f.begin_s + away, end_s=f.end_s + away, until_s=f.until_s + away)
            if f.begin_s >= joint_s - 1.0
            else f
            for f in segments
        ]

    share = np.array([best_share(strokes, placed(away), step_s=_STEP_S) for away in away_s])
    good = away_s[share >= share.max() - 0.05]
    found = []
    for low, high, weight in _AWAY_CELLS_S:
        # The good range extends up to one coarse step beyond its points on both sides.
        inside = good[(good > low - _STEP_S) & (good < high + _STEP_S)]
        if len(inside):
            begin, end = max(low, inside[0] - _STEP_S), min(high, inside[-1] + _STEP_S)
            found.append((float(0.5 * (begin + end)), float(0.5 * (end - begin)), weight))
    return found
