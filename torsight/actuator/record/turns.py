"""Turns of a temperature: where a heating ends and a cooling begins."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from torsight.core.compiled import compiled
from torsight.core.series import extremes
from torsight.core.units import Floats, Ints

REVERSAL_C: Final = 3.0
"""Least reversal of a temperature before the other transformation begins, °C.

The hysteresis of the alloy is several times wider; a controller overshoots its reference by a degree or two and
returns, and the heating continues from there.
"""


@compiled
def turning_points(time_s: Floats, temperature: Floats, half: Ints, threshold: float) -> NDArray[np.int8]:
    """Return +1 where the active spring heats and −1 where it cools; a turn counts beyond ``threshold`` °C.

    The turn is placed where the temperature finally leaves its extremum, not where it crosses the threshold: a hold
    belongs to the heating or cooling before it. Each half-cycle starts with heating.
    """
    n = temperature.size
    direction = np.ones(n, np.int8)
    sense, extreme, where = 1, 0.0, 0
    for k in range(n):
        value = temperature[k]
        if k == 0 or half[k] != half[k - 1]:
            sense, extreme, where = 1, value, k
        elif sense * (value - extreme) > 0.0:
            extreme, where = value, k
        elif sense * (extreme - value) >= threshold:
            # The knee: the row furthest from the straight line between the extremum and the present row.
            first, furthest = where, 0.0
            slope = (value - extreme) / (time_s[k] - time_s[first])
            for i in range(first + 1, k):
                away = sense * (temperature[i] - extreme - slope * (time_s[i] - time_s[first]))
                if away > furthest:
                    where, furthest = i, away
            sense = -sense
            for i in range(where + 1, k):
                direction[i] = sense
            extreme, where = value, k
        direction[k] = sense
    return direction


def turns_of(temp_c: Floats, least_c: float) -> Ints:
    """Return the samples (k,) at which a temperature (n,) turns and reverses by ``least_c`` or more."""
    return np.array(extremes(temp_c, least_c)[1:-1], np.int64)


@compiled
def on_lines(course: Floats, places: Floats) -> Floats:
    """Return a series (n,) at fractional sample indices (m,) from 0 to n − 1, linearly interpolated."""
    found = np.empty(len(places))
    for i in range(len(places)):
        before = min(int(places[i]), len(course) - 2)
        found[i] = course[before] + (places[i] - before) * (course[before + 1] - course[before])
    return found


def at_places(temp_c: Floats, turns: Ints, places: Floats) -> Floats:
    """Return a temperature (n,) at increasing fractional sample indices (m,), interpolated, with its turns' extrema.

    The extremum of a turn (k,) between two of these indices replaces the value at the later one. There a transformation
    that only advances is still in the state that it reached at the turn; interpolation would cut it short, with an
    error throughout the rest that follows.
    """
    found = on_lines(temp_c, places)
    after = np.searchsorted(places, turns)
    reached = (after > 0) & (after < len(places))
    found[after[reached]] = temp_c[turns[reached]]
    return found
