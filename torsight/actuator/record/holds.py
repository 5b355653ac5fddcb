"""Tops of a noisy temperature that are holds: their level ends an incomplete transformation, not their noise.

A heating that is held for some seconds before it cools ends in a level. What noise leaves bows up there, the one-way
transformation keeps the bow's top, and the angle is off through all of the rest that follows. Where the log itself says
that a top is level, to within less than its noise, its mean takes the bow's place, and with it as much of a slope and a
bow as the log is sure of: a controlled top overshoots, and sinks to its level slowly.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from torsight.actuator.record.log_noise import hidden_by_rounding, last_digit
from torsight.actuator.record.segments import turn_of
from torsight.actuator.record.turns import turning_points
from torsight.core.parameter import REACH
from torsight.core.series import usual_step
from torsight.core.units import Floats

# How far from a top's end a level reaches, and how long it is at least. benchmarks/actuator/log_constants.py measures
# what half and twice of these constants do: temperatures hardly change, tops err 1.5 times as much with twice the rows
# or half of the share of the noise.
_REACH_S: Final = 20.0
LEAST_HOLD_S: Final = 4.0
_LEAST_ROWS: Final = 12
# Slope or bow of so many sigmas: the window is not level.
_REJECTED: Final = 1.5
# And level enough to take its mean where what it may slope or bow by is this share of the noise.
_LEVEL: Final = 0.7


def level_holds(
    time_s: Floats, temp_c: Floats, noise_c: float, *, value: Floats, rate: Floats, left_over: Floats
) -> None:
    """Put the level of every held top in place of what the smoother says of it.

    ``value``, ``rate`` and ``left_over``, the smoother's temperature, slope and sigma (n,), are changed in place; the
    noise of the log's rows is taken as independent. What a last digit hides of a level counts, too.
    """
    digit_c = last_digit(temp_c)
    sense = turning_points(value, np.zeros(len(value), np.int64), turn_of(noise_c))
    for edge in np.flatnonzero(np.diff(sense) < 0):
        window = _longest_level(time_s, temp_c, noise_c, int(edge))
        if window is None:
            continue
        first, last = window
        level, slope, sigma = _level(time_s[first : last + 1], temp_c[first : last + 1], noise_c)
        rows = np.arange(first, last + 1)
        # At its ends the window may reach over a corner by a row or two: there the corner's own fit stands, which is
        # below the level by more than its 95 % interval.
        inside = value[rows] >= level - REACH * left_over[rows]
        rows = rows[inside]
        value[rows], rate[rows] = level[inside], slope[inside]
        hidden = hidden_by_rounding(temp_c[first : last + 1], digit_c)
        left_over[rows] = np.hypot(np.minimum(left_over[rows], sigma[inside]), hidden)
        # What bows above the level beside it does so for the same reason, unless the log is sure of it.
        beside = slice(*np.searchsorted(time_s, [time_s[first] - LEAST_HOLD_S, time_s[last] + LEAST_HOLD_S]))
        above = value[beside] - level.max()
        value[beside] -= np.where((above > 0.0) & (above <= REACH * left_over[beside]), above, 0.0)


def _level(time_s: Floats, temp_c: Floats, noise_c: float) -> tuple[Floats, Floats, Floats]:
    """Return value, slope and sigma of a window that is nearly level: its mean, and what is sure of slope and bow.

    Slope and bow are each shrunk by what their doubt says (James and Stein): one of less than a sigma is none.
    """
    half_s = 0.5 * float(time_s[-1] - time_s[0])
    u = (time_s - time_s[0]) / half_s - 1.0
    level, slope = np.full(len(u), float(np.mean(temp_c))), np.zeros(len(u))
    variance = np.full(len(u), noise_c**2 / len(u))
    for (size, doubt), shape, change in zip(
        _sizes(time_s, temp_c, noise_c), _shapes(u), (np.ones(len(u)), 3.0 * u), strict=True
    ):
        sure = max(0.0, 1.0 - (doubt / size) ** 2) * size if size != 0.0 else 0.0
        level += sure * shape
        slope += sure * change / half_s
        variance += 0.5 * (doubt * shape) ** 2
    return level, slope, np.sqrt(variance)


def _shapes(u: Floats) -> tuple[Floats, Floats]:
    """Return slope and bow over −1 to 1: Legendre's polynomials of first and second order."""
    return u, 1.5 * u * u - 0.5


def _longest_level(time_s: Floats, temp_c: Floats, noise_c: float, edge: int) -> tuple[int, int] | None:
    """Return the longest window around or before a top's end in which the log is level; None where there is none."""
    interval_s = usual_step(time_s[max(0, edge - 200) : edge + 200])
    reach = int(_REACH_S / interval_s)
    least = max(_LEAST_ROWS, math.ceil(LEAST_HOLD_S / interval_s))
    low, high = max(0, edge - reach), min(len(temp_c) - 1, edge + reach)
    step = max(1, least // 8)
    best: tuple[int, int] | None = None
    # The turn is placed to within a second or two: the hold ends near it.
    near = max(2, int(2.0 / interval_s))
    for last in range(max(low, edge - 2 * near), min(high, edge + near) + 1, max(1, near // 4)):
        for first in range(last - least + 1, low - 1, -step):
            if best is not None and last - first <= best[1] - best[0]:
                continue
            bend, doubt = _unevenness(time_s[first : last + 1], temp_c[first : last + 1], noise_c)
            if bend > _REJECTED * doubt:
                break
            if bend + doubt <= _LEVEL * noise_c:
                best = first, last
    return best


def _unevenness(time_s: Floats, temp_c: Floats, noise_c: float) -> tuple[float, float]:
    """Return by how much the window slopes or bows, whichever is more certain, and one sigma of that, °C."""
    found = [(abs(size), doubt) for size, doubt in _sizes(time_s, temp_c, noise_c)]
    return max(found, key=lambda item: item[0] / item[1])


def _sizes(time_s: Floats, temp_c: Floats, noise_c: float) -> list[tuple[float, float]]:
    """Return slope and bow of a window, °C at its end, each with one sigma."""
    u = 2.0 * (time_s - time_s[0]) / (time_s[-1] - time_s[0]) - 1.0
    found = []
    for shape in _shapes(u):
        weight = float(shape @ shape)
        size = float(shape @ temp_c) - float(np.mean(temp_c)) * float(shape.sum())
        found.append((size / weight, noise_c / math.sqrt(weight)))
    return found
