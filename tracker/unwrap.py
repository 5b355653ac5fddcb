"""From angles within one turn to the whole angle, across gaps by the motion on both sides."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

_SIDE: Final = 8
"""Frames on each side of a gap from which the speed is taken."""


def unwrap(
    time_s: NDArray[np.float64], angle_rad: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return the unwrapped angle (NaN stays NaN) and where its whole turn is certain.

    The first known angle is taken within (−π, π]. From frame to frame the step is the one closest to what the speed
    so far makes likely; over a gap it is the one closest to what the speeds before and after it make likely, and the turn
    is certain only where the next likely one is beyond what the acceleration seen around the gap allows.
    """
    whole = np.full_like(angle_rad, np.nan)
    certain = np.ones(len(angle_rad), bool)
    known = np.flatnonzero(np.isfinite(angle_rad))
    if len(known) == 0:
        return whole, certain
    runs = np.split(known, np.flatnonzero(np.diff(known) > 1) + 1)
    typical_s = float(np.median(np.diff(time_s))) if len(time_s) > 1 else 1.0
    before: NDArray[np.int64] | None = None
    sure = True
    for run in runs:
        local = _within_run(time_s[run], angle_rad[run], typical_s)
        if before is None:
            local += np.remainder(local[0] + np.pi, 2.0 * np.pi) - np.pi - local[0]
            if local[0] <= -np.pi:
                local += 2.0 * np.pi
        else:
            turns, clear = _across(time_s, whole, before, run, local)
            local += 2.0 * np.pi * turns
            sure = sure and clear
        whole[run] = local
        first = run[0] if before is None else before[-1] + 1
        certain[first : run[-1] + 1] = sure
        before = run
    certain[known[-1] + 1 :] = sure
    return whole, certain


def _within_run(time_s: NDArray[np.float64], angle_rad: NDArray[np.float64], typical_s: float) -> NDArray[np.float64]:
    """Unwrap frames that follow each other, expecting the speed to go on where some were dropped."""
    whole = np.unwrap(angle_rad)
    if len(whole) < 3 or np.max(np.diff(time_s)) < 1.5 * typical_s:
        return whole
    whole = angle_rad.copy()
    speed = 0.0
    for i in range(1, len(whole)):
        step_s = time_s[i] - time_s[i - 1]
        expected = whole[i - 1] + (speed * step_s if step_s > 1.5 * typical_s else 0.0)
        whole[i] += 2.0 * np.pi * np.round((expected - whole[i]) / (2.0 * np.pi))
        speed = (whole[i] - whole[i - 1]) / step_s
    return whole


def _across(
    time_s: NDArray[np.float64],
    whole: NDArray[np.float64],
    before: NDArray[np.int64],
    after: NDArray[np.int64],
    local: NDArray[np.float64],
) -> tuple[float, bool]:
    """Return how many turns to add after a gap, and whether that is certain."""
    left, right = before[-_SIDE:], after[:_SIDE]
    speeds = [_speed(time_s[left], whole[left]), _speed(time_s[right], local[: len(right)])]
    gap_s = float(time_s[after[0]] - time_s[before[-1]])
    known = [speed for speed in speeds if np.isfinite(speed)]
    mean = float(np.mean(known)) if known else 0.0
    expected = whole[before[-1]] + mean * gap_s
    off = float(expected - local[0])
    turns = float(np.round(off / (2.0 * np.pi)))
    missed = abs(off - 2.0 * np.pi * turns)
    # Between two known speeds the mean speed over the gap can lie anywhere; half the difference bounds it for
    # motion that changes once, and a stop and go of the same size is allowed for on top.
    spread = 0.5 * abs(speeds[0] - speeds[1]) if len(known) == 2 else abs(mean)
    allowed = (spread + 0.5 * max(abs(s) for s in known)) * gap_s if known else np.inf
    return turns, bool(2.0 * np.pi - missed > allowed + missed) or gap_s <= 0.0


def _speed(time_s: NDArray[np.float64], angle_rad: NDArray[np.float64]) -> float:
    if len(time_s) < 2:
        return float("nan")
    return float((angle_rad[-1] - angle_rad[0]) / (time_s[-1] - time_s[0]))
