"""Estimation of the time at which a stroke passes an angle, with its standard deviation, from the frames around.

Smoothing rounds the onset of a motion, where the speed jumps within a frame or two: it is good enough to detect a
motion, not to time it. Here only as many frames are combined as the noise of the angle requires, and the uncertainty
between frames counts as an error of the time.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from torsight.core.units import Floats

_POWERS: Final = 2
"""Degree of the polynomial through the frames: a speed that changes linearly."""
_FEWEST: Final = _POWERS + 2
_MOST: Final = _FEWEST * 2**4
"""Number of frames that are combined: one more than the coefficients, doubled at most four times."""
_NOISE_PER_STEP: Final = 0.05
"""More frames are combined until noise shifts the crossing by less than this share of the time between frames. Half and
twice this value move a clock by 0.12 of its standard deviations at most (benchmarks/sync/constants.py)."""


def crossing_time(
    time_s: Floats, travel_rad: Floats, level_rad: float, *, near_s: float, noise_rad: float
) -> tuple[float, float]:
    """Return the time near ``near_s`` at which the travel passes a level, and its standard deviation, s.

    NaN where the frames around do not determine it, because they end or the travel does not grow there. ``travel_rad``
    (n,) is the travel at each frame of the stroke, ``noise_rad`` its standard deviation.
    """
    count = _FEWEST
    while True:
        found = _with(time_s, travel_rad, level_rad, near_s=near_s, noise_rad=noise_rad, count=count)
        if found is None:
            return float("nan"), float("nan")
        at_s, noise_s, unseen_s, step_s = found
        if noise_s <= max(_NOISE_PER_STEP * step_s, unseen_s) or count >= _MOST or 2 * count > len(time_s):
            return at_s, float(np.hypot(noise_s, unseen_s))
        count *= 2


def _with(
    time_s: Floats, travel_rad: Floats, level_rad: float, *, near_s: float, noise_rad: float, count: int
) -> tuple[float, float, float, float] | None:
    """Return the time, its error from noise, its error from the motion between frames, and the frames' distance.

    The error between frames is half of the difference between a straight line and a parabola through them.
    """
    right = int(np.searchsorted(time_s, near_s))
    first, last = right - count // 2, right + count // 2
    if first < 0 or last > len(time_s):
        return None
    x, y = time_s[first:last] - near_s, travel_rad[first:last] - level_rad
    step_s = float(x[-1] - x[0]) / (count - 1)
    line = np.polyfit(x, y, 1)
    powers = np.vander(x / step_s, _POWERS + 1, increasing=True)
    coefficient = np.linalg.lstsq(powers, y, rcond=None)[0]
    reach_s = 0.5 * float(x[-1] - x[0])
    root_s = _root(coefficient, reach_s / step_s) * step_s
    if line[0] <= 0.0 or not np.isfinite(root_s):
        return None
    speed = float(coefficient[1] + 2.0 * coefficient[2] * root_s / step_s) / step_s
    if speed <= 0.0:
        return None
    straight_s = float(np.clip(-line[1] / line[0], -reach_s, reach_s))
    gain = float(np.sqrt((np.linalg.inv(powers.T @ powers))[0, 0]))
    return near_s + root_s, noise_rad * gain / speed, 0.5 * abs(straight_s - root_s), step_s


def _root(coefficient: NDArray[np.floating[Any]], reach: float) -> float:
    """Return the root of a parabola nearest to 0, in units of the step; NaN where there is none within reach."""
    level, slope, bend = (float(value) for value in coefficient)
    if abs(bend) * reach < 1e-6 * abs(slope):
        root = -level / slope if slope else float("nan")
    else:
        inside = slope**2 - 4.0 * bend * level
        if inside < 0.0:
            return float("nan")
        # The increasing branch, computed without the difference of nearly equal numbers.
        root = -2.0 * level / (slope + float(np.sqrt(inside)))
    return root if abs(root) <= reach else float("nan")
