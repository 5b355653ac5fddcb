"""Joining of the sections of a log between restarts of its clock.

The timestamps do not show how long the clock was stopped. Where a temperature changes steadily on both sides, its jump
across the restart gives the gap: jump / rate. Otherwise one usual step is assumed and the gap is marked as not known;
the motion on the film may determine it later (:mod:`sync.clock.restarts`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from sync.log.outliers import noise_c
from sync.log.repairs import Restart
from torsight.core.series import rms, robust_sigma, usual_step
from torsight.core.units import Floats, Ints

_WINDOW_S: Final = 10.0
"""Time over which a parabola is fitted on either side: short against a heating, and forty rows at 4 Hz. Half and twice
this value move the clock by 0.04 of its standard deviations at most (benchmarks/sync/constants.py)."""
SHORTEST_STRETCH_S: Final = 2.0 * _WINDOW_S
"""Shortest section between restarts: a shorter one gives a rate at neither end, so that its start is no restart."""
LONGEST_GAP_S: Final = 900.0
"""Longest gap within one record, a choice: half and twice this value move no clock (benchmarks/sync/constants.py)."""


def join_blocks(time_s: Floats, block: Ints, temperatures_c: Sequence[Floats]) -> tuple[Floats, tuple[Restart, ...]]:
    """Return times (n,) on one clock, with every block of rows shifted to follow the one before, and the restarts.

    Timestamps (n,) increase within a block; ``block`` (n,) holds the blocks' numbers, in increasing order. The gaps
    follow from the continuity of the readings (n,).
    """
    joined = time_s.copy()
    restarts: list[Restart] = []
    step_s = usual_step(time_s)
    shift_s = 0.0
    for index in (np.flatnonzero(np.diff(block)) + 1).tolist():
        before = slice(int(np.searchsorted(block, block[index - 1])), index)
        after = slice(index, int(np.searchsorted(block, block[index], side="right")))
        gap_s, sigma_s = _gap(time_s, before, after, temperatures_c, step_s)
        shift_s = joined[index - 1] + gap_s - time_s[index]
        joined[after] = time_s[after] + shift_s
        restarts.append(Restart(index=index, shift_s=shift_s, gap_s=gap_s, gap_sigma_s=sigma_s))
    return joined, tuple(restarts)


def _gap(
    time_s: Floats, before: slice, after: slice, temperatures_c: Sequence[Floats], step_s: float
) -> tuple[float, float]:
    """Return the time between the last row before a restart and the first after, and its sigma (infinite: unknown)."""
    weight = total = 0.0
    for temperature in temperatures_c:
        noise = max(noise_c(temperature), 1e-3)
        left = _at(float(time_s[before][-1]), time_s[before], temperature[before], noise)
        right = _at(float(time_s[after][0]), time_s[after], temperature[after], noise)
        if left is None or right is None:
            continue
        # The gap is the jump divided by the rate: a rate that is known to an eighth gives the gap to an eighth.
        rate = 0.5 * (left[1] + right[1])
        rate_sigma = math.hypot(left[3], right[3]) / 2.0
        bend = abs(left[1] - right[1])
        # Unequal rates indicate a corner of the temperature within the gap: then the jump does not determine the gap.
        if abs(rate) < 8.0 * rate_sigma or bend > 0.3 * abs(rate) + 3.0 * rate_sigma:
            continue
        gap = (right[0] - left[0]) / rate
        sigma = math.hypot(math.hypot(left[2], right[2]) / abs(rate), abs(gap) * (0.5 * bend + rate_sigma) / abs(rate))
        if -3.0 * sigma - step_s < gap < LONGEST_GAP_S:
            weight += 1.0 / sigma**2
            total += gap / sigma**2
    if weight == 0.0:
        return step_s, math.inf
    return max(total / weight, 0.2 * step_s), 1.0 / math.sqrt(weight)


def _at(edge_s: float, time_s: Floats, temp_c: Floats, noise: float) -> tuple[float, float, float, float] | None:
    """Return value, rate and their sigmas at one end of a section; None where too few readings are near the end.

    They come from parabolas over the window and over half of it, whose difference estimates the model's error.
    """
    whole = _parabola(edge_s, time_s, temp_c, noise, window_s=_WINDOW_S)
    half = _parabola(edge_s, time_s, temp_c, noise, window_s=0.5 * _WINDOW_S)
    if whole is None or half is None:
        return whole
    value_sigma = math.hypot(half[2], half[0] - whole[0])
    rate_sigma = math.hypot(half[3], half[1] - whole[1])
    return half[0], half[1], value_sigma, rate_sigma


def _parabola(
    edge_s: float, time_s: Floats, temp_c: Floats, noise: float, *, window_s: float
) -> tuple[float, float, float, float] | None:
    near = (np.abs(time_s - edge_s) <= window_s) & np.isfinite(temp_c)
    if np.count_nonzero(near) < 8:
        return None
    x, y = time_s[near] - edge_s, temp_c[near]
    design = np.stack([np.ones_like(x), x, x**2], axis=1)
    keep = np.ones(len(x), dtype=np.bool_)
    # Spikes have not been removed yet: drop readings beyond four sigmas, and fit again.
    for _ in range(3):
        coefficient, *_ = np.linalg.lstsq(design[keep], y[keep], rcond=None)
        away = np.abs(y - design @ coefficient)
        limit = 4.0 * max(noise, robust_sigma(away))
        keep = away <= limit
    residual = y[keep] - design[keep] @ coefficient
    spread = max(noise, rms(residual))
    covariance = spread**2 * np.linalg.inv(design[keep].T @ design[keep])
    return float(coefficient[0]), float(coefficient[1]), float(covariance[0, 0] ** 0.5), float(covariance[1, 1] ** 0.5)
