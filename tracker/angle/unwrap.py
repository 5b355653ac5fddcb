"""From angles within one turn to the unwrapped angle; gaps are bridged from the motion on both sides.

Between two instants with known speeds v0 and v1, T apart, a motion covers about (v0 + v1)/2 · T. The largest deviation
from this prediction is taken from the film itself, over all stretches of length T in which the angle is known: it is
large for a motion that jumps, and small for a smooth one. Where exactly one whole number of turns lies within twice the
largest deviation, the turn is certain. For a gap that is longer than any known stretch, the largest deviation is
extrapolated with the square of the time, as for a constant acceleration.

Where a part of the film is missing nothing is known of the time in it. The turn is certain then, too, if the motion has
the same range on both sides of the gap, to within what two arbitrary positions of the stick would show by chance.
"""

from __future__ import annotations

import itertools
import math
from typing import Final

import numpy as np

from torsight.core.units import Flags, Floats, Ints
from tracker.innovation import SURE

_SIDE_S: Final = 0.3
"""Time on each side of a gap over which the speed is estimated: over a shorter one noise would be taken for motion."""
_SAFETY: Final = 2.0
"""Allowed deviation from the predicted motion, over the largest one that the film shows: a choice."""
_SLACK_RAD: Final = 0.3
"""Added to the allowed deviation, for a gap that follows a rest before any motion was seen: a twentieth of a turn."""


def unwrap(time_s: Floats, angle_rad: Floats) -> tuple[Floats, Flags]:
    """Return the unwrapped angle (n,), NaN where ``angle_rad`` is NaN, and where its number of turns is certain (n,).

    The first known angle is taken within (−π, π]. Once a turn is uncertain, so are all later angles.
    """
    whole = np.full_like(angle_rad, np.nan)
    certain = np.ones(len(angle_rad), bool)
    known = np.flatnonzero(np.isfinite(angle_rad))
    if len(known) == 0:
        return whole, certain
    typical_s = float(np.median(np.diff(time_s))) if len(time_s) > 1 else 1.0
    breaks = np.flatnonzero((np.diff(known) > 1) | (np.diff(time_s[known]) > 1.5 * typical_s)) + 1
    runs = np.split(known, breaks)
    locals_ = [np.unwrap(angle_rad[run]) for run in runs]
    gaps_s = [float(time_s[run[0]] - time_s[before[-1]]) for before, run in itertools.pairwise(runs)]
    gaps = [max(1, round(gap_s / typical_s)) for gap_s in gaps_s]
    side = max(1, round(_SIDE_S / typical_s))
    most_rad = {gap: _most_off(time_s, runs, locals_, gap, side=side) for gap in set(gaps)}
    sure = True
    for number, run in enumerate(runs):
        local = locals_[number]
        if number == 0:
            # The first angle is wrapped to (−π, π].
            local = local + math.pi - (math.pi - local[0]) % math.tau - local[0]
        else:
            before = runs[number - 1][-1]
            ahead = _speed_ahead(time_s, runs, locals_, number)
            seen = known[: int(np.searchsorted(known, before)) + 1]
            behind = _speed_at(time_s[seen], whole[seen], -1)
            turns, clear = _turns(
                gap_s=gaps_s[number - 1],
                step_rad=float(local[0] - whole[before]),
                behind=behind,
                ahead=ahead,
                most_rad=most_rad[gaps[number - 1]],
            )
            if not clear:
                turns, clear = _same_range(whole[seen], local, turns)
            local = local + 2.0 * np.pi * turns
            sure = sure and clear
            certain[before + 1 : run[0]] = sure
        whole[run] = local
        certain[run] = sure
    certain[known[-1] + 1 :] = sure
    return whole, certain


def _turns(
    *, gap_s: float, step_rad: float, behind: float | None, ahead: float | None, most_rad: float
) -> tuple[float, bool]:
    """Return the number of turns to add after a gap, and whether no other number is possible."""
    speeds = [speed for speed in (behind, ahead) if speed is not None]
    expected = gap_s * sum(speeds) / len(speeds) if speeds else 0.0
    turns = float(np.round((expected - step_rad) / (2.0 * np.pi)))
    if not speeds:
        return turns, False
    # Under an acceleration the prediction from one speed is off by twice as much as that from the mean of both.
    spread = _SAFETY * most_rad * (2.0 if len(speeds) == 1 else 1.0) + _SLACK_RAD
    miss = abs(step_rad + 2.0 * np.pi * turns - expected)
    return turns, miss <= spread < 2.0 * np.pi - miss


def _same_range(before: Floats, after: Floats, turns: float) -> tuple[float, bool]:
    """Return the turns to add to angles (k,) after a gap, by the motion ``turns``, and whether they are certain.

    Had the stick turned arbitrarily in the gap, the ranges of both parts would lie in a common range U with the
    probability (U − r₁ + U − r₂) / 2π, for parts with the ranges r₁ and r₂.
    """
    own, other = ((float(part.min()), float(part.max())) for part in (before, after))
    fit = round((sum(own) - sum(other)) / (2.0 * math.tau))
    low, high = min(own[0], other[0] + math.tau * fit), max(own[1], other[1] + math.tau * fit)
    chance = (2.0 * (high - low) - (own[1] - own[0]) - (other[1] - other[0])) / math.tau
    same = high - low < math.tau and chance < 1.0 - SURE
    return (float(fit), True) if same else (turns, False)


def _most_off(time_s: Floats, runs: list[Ints], angles: list[Floats], frames: int, *, side: int) -> float:
    """Return the largest deviation, rad, of the motion over ``frames`` frames from that predicted by the speeds.

    The speeds are those over ``side`` frames before and after; infinite where too little is known.
    """
    # Half of the longest known run: the speeds at both ends come from the rest of it.
    told = min(frames, max(map(len, runs)) // 2)
    if told < 1:
        return math.inf
    off = [np.abs(_off(time_s[run], angle, told, side)) for run, angle in zip(runs, angles, strict=True)]
    most = max((float(part.max()) for part in off if len(part)), default=math.inf)
    return most * (frames / told) ** 2


def _off(time_s: Floats, angle_rad: Floats, frames: int, side: int) -> Floats:
    """Return the deviations of a motion (n,) over ``frames`` frames from that predicted by the speeds at both ends."""
    # Two frames with the same timestamp give no speed.
    told = np.diff(time_s, prepend=-np.inf) > 0.0
    time_s, angle_rad = time_s[told], angle_rad[told]
    index = np.arange(1, len(time_s) - frames - 1)
    first, last = np.maximum(index - side, 0), np.minimum(index + frames + side, len(time_s) - 1)

    def speed(one: Ints, other: Ints) -> Floats:
        return np.asarray((angle_rad[other] - angle_rad[one]) / (time_s[other] - time_s[one]))

    after = index + frames
    mean = 0.5 * (speed(first, index) + speed(after, last))
    return np.asarray(angle_rad[after] - angle_rad[index] - mean * (time_s[after] - time_s[index]))


def _speed_ahead(time_s: Floats, runs: list[Ints], angles: list[Floats], number: int) -> float | None:
    """Return the speed after a gap; runs that follow each other closely are joined."""
    times, values = time_s[runs[number]], angles[number]
    step_s = float(np.median(np.diff(time_s)))
    for run, angle in zip(runs[number + 1 :], angles[number + 1 :], strict=True):
        if times[-1] - times[0] > _SIDE_S or time_s[run[0]] - times[-1] > 4.0 * step_s:
            break
        speed = 0.0 if len(values) < 2 else (values[-1] - values[-2]) / (times[-1] - times[-2])
        expected = values[-1] + speed * (time_s[run[0]] - times[-1])
        shift = math.tau * np.round((expected - angle[0]) / math.tau)
        times, values = np.append(times, time_s[run]), np.append(values, angle + shift)
    return _speed_at(times, values, 0)


def _speed_at(time_s: Floats, angle_rad: Floats, end: int) -> float | None:
    """Return the speed at the first (``end`` 0) or last (−1) of some frames; None where there is but one."""
    near = np.abs(time_s - time_s[end]) <= _SIDE_S
    # Two frames at least, however rare the frames are.
    near[[0, min(1, len(near) - 1)] if end == 0 else slice(-2, None)] = True
    return _slope(time_s[near], angle_rad[near])


def _slope(time_s: Floats, angle_rad: Floats) -> float | None:
    if len(time_s) < 2:
        return None
    t = time_s - time_s.mean()
    return float(t @ (angle_rad - angle_rad.mean()) / (t @ t))
