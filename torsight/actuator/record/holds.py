"""Held temperatures of a noisy log, at whose level an incomplete transformation ends or waits.

A heating that is held for some seconds before cooling ends in a level top. The remaining noise bows up there, the
one-way transformation keeps the bow's maximum, and the angle is wrong throughout the rest that follows. Where the log
shows that a top is level to within less than its noise, the mean replaces the bow, together with the significant part
of a slope and a bow: a controlled top overshoots and sinks slowly to its level. In a hold on the way the transformation
waits at the maximum of the noise in the same way.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from torsight.actuator.record.log_noise import hidden_by_rounding, last_digit
from torsight.actuator.record.segments import turn_of
from torsight.actuator.record.turns import REVERSAL_C, turning_points, turns_of
from torsight.core.parameter import REACH
from torsight.core.series import runs, usual_step
from torsight.core.units import Floats

# benchmarks/actuator/log_constants.py measures the effect of half and twice of these constants: temperatures hardly
# change, tops err 1.5 times as much with twice the rows.
# Shortest level, in time and in rows.
LEAST_HOLD_S: Final = 4.0
_LEAST_ROWS: Final = 12
# Slope or bow, in standard deviations, from which a window is not level.
_REJECTED: Final = 1.5


def level_holds(
    time_s: Floats, temp_c: Floats, noise_c: float, *, value: Floats, rate: Floats, left_over: Floats
) -> None:
    """Replace the smoother's temperature by the level in every held top and in every hold on the way.

    ``value``, ``rate`` and ``left_over``, the smoother's temperature, slope and standard deviation (n,), are changed in
    place; the noise of the log's rows is taken as independent. The uncertainty of a level due to rounding is included.
    """
    digit_c = last_digit(temp_c)
    sense = turning_points(time_s, value, np.zeros(len(value), np.int64), turn_of(noise_c))
    tops = [_longest_level(time_s, temp_c, noise_c, int(edge)) for edge in np.flatnonzero(np.diff(sense) < 0)]
    between, corner_c = _holds_between(time_s, temp_c, noise_c, rate), beside_corners(value)
    windows = [*((first, last, 0.0) for first, last in between), *((*top, LEAST_HOLD_S) for top in tops if top)]
    for first, last, after_s in windows:
        level, slope, sigma = _level(time_s[first : last + 1], temp_c[first : last + 1], noise_c)
        rows = np.arange(first, last + 1)
        # The window may extend beyond a corner by a row or two: there the smoother's estimate is kept, which is below
        # the level by more than its 95 % interval.
        inside = value[rows] >= level - REACH * left_over[rows]
        if after_s == 0.0:
            # What follows a hold on the way may rise: the hold ends before the last rows that are above it.
            inside &= rows <= rows[value[rows] <= level + REACH * left_over[rows]].max(initial=first - 1)
        rows = rows[inside]
        value[rows], rate[rows] = level[inside], slope[inside]
        hidden = hidden_by_rounding(temp_c[first : last + 1], digit_c)
        left_over[rows] = np.hypot(np.minimum(left_over[rows], sigma[inside]), hidden)
        # An excess beside the level has the same cause, unless it is significant: cut it to the level.
        beside = slice(*np.searchsorted(time_s, [time_s[first] - LEAST_HOLD_S, time_s[last] + after_s]))
        above, known_c = value[beside] - level.max(), np.hypot(left_over[beside], corner_c[beside])
        value[beside] -= np.where((above > 0.0) & (above <= REACH * known_c), above, 0.0)


def beside_corners(temp_c: Floats) -> Floats:
    """Return the standard deviation (n,) of temperatures due to corners that lie between rows.

    The smoother's corners lie on rows, or on two rows beside each other. Two lines whose slopes differ by Δ and that
    meet within half a row of a row pass it at temperatures that differ by up to Δ/2 (per row); a corner on the row
    halves this difference. So the row errs by Δ/4 at most and by Δ/√48 in the root mean square. Δ is the bend over
    three rows in excess of that beside them, as of a cooling. What a spring reached at a turn, or in the hold before a
    cooling, is known better: there nothing is added.
    """
    slope = np.diff(temp_c)
    before, after = slope[:-1], slope[1:]
    bend = np.pad(np.where((after < before) & (after + before < 0.0), 0.0, np.abs(after - before)), 3)
    bend[2 + turns_of(temp_c, REVERSAL_C)[:, None] + np.arange(-1, 2)] = 0.0
    whole, beside = bend[1:-3] + bend[2:-2] + bend[3:-1], 3.0 * np.maximum(bend[:-4], bend[4:])
    return np.asarray(np.maximum(whole - beside, 0.0) / math.sqrt(48.0))


def _holds_between(time_s: Floats, temp_c: Floats, noise_c: float, rate: Floats) -> list[tuple[int, int]]:
    """Return first and last row of the level stretches whose smoothed slope changes less than the noise in a hold.

    A controller may need time to settle: of a stretch that is not level throughout, the longest half, quarter … at its
    end is taken that is.
    """
    found = []
    for begin, stop in runs(np.abs(rate) * LEAST_HOLD_S < noise_c):
        first, last = begin, stop - 1
        while time_s[last] - time_s[first] > 2.0 * LEAST_HOLD_S and last - first >= 2 * _LEAST_ROWS:
            bend, doubt = _unevenness(time_s[first : last + 1], temp_c[first : last + 1], noise_c)
            if bend <= _REJECTED * doubt and bend + doubt <= noise_c:
                found.append((first, last))
                break
            first = (first + last) // 2
    return found


def _level(time_s: Floats, temp_c: Floats, noise_c: float) -> tuple[Floats, Floats, Floats]:
    """Return value, slope and standard deviation of a nearly level window: its mean, with shrunk slope and bow.

    Slope and bow are each shrunk by their uncertainty (James and Stein), to zero below one standard deviation.
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
    """Return the shapes of slope and bow over −1 to 1: Legendre polynomials of first and second order."""
    return u, 1.5 * u * u - 0.5


def _longest_level(time_s: Floats, temp_c: Floats, noise_c: float, edge: int) -> tuple[int, int] | None:
    """Return the longest window around or before a top's end in which the log is level; None if there is none.

    It is level where slope and bow are not significant and, with their uncertainty, smaller than the noise.
    """
    interval_s = usual_step(time_s[max(0, edge - 200) : edge + 200])
    least = max(_LEAST_ROWS, math.ceil(LEAST_HOLD_S / interval_s))
    step = max(1, least // 8)
    best: tuple[int, int] | None = None
    # The row of the turn is known to a second or two: the hold ends near it.
    near = max(2, int(2.0 / interval_s))
    for last in range(max(0, edge - 2 * near), min(len(temp_c), edge + near + 1), max(1, near // 4)):
        for first in range(last - least + 1, -1, -step):
            if best is not None and last - first <= best[1] - best[0]:
                continue
            bend, doubt = _unevenness(time_s[first : last + 1], temp_c[first : last + 1], noise_c)
            if bend > _REJECTED * doubt:
                break
            if bend + doubt <= noise_c:
                best = first, last
    return best


def _unevenness(time_s: Floats, temp_c: Floats, noise_c: float) -> tuple[float, float]:
    """Return slope or bow of a window, whichever is more significant, and its standard deviation, °C."""
    found = [(abs(size), doubt) for size, doubt in _sizes(time_s, temp_c, noise_c)]
    return max(found, key=lambda item: item[0] / item[1])


def _sizes(time_s: Floats, temp_c: Floats, noise_c: float) -> list[tuple[float, float]]:
    """Return slope and bow of a window, °C at its end, each with its standard deviation."""
    u = 2.0 * (time_s - time_s[0]) / (time_s[-1] - time_s[0]) - 1.0
    found = []
    for shape in _shapes(u):
        weight = float(shape @ shape)
        size = float(shape @ temp_c) - float(np.mean(temp_c)) * float(shape.sum())
        found.append((size / weight, noise_c / math.sqrt(weight)))
    return found
