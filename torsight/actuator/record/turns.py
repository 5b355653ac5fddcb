"""Turns of a temperature: where a heating ends and a cooling begins."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from torsight.core.compiled import compiled
from torsight.core.series import extremes
from torsight.core.units import Floats, Ints

REVERSAL_C: Final = 3.0
"""A temperature must go back by so much before the other transformation begins, °C.

The hysteresis of the alloy is several times wider; a controller overshoots its reference by a degree or two and comes
back, and the heating goes on from there.
"""


@compiled
def turning_points(temperature: Floats, half: Ints, threshold: float) -> NDArray[np.int8]:
    """Return +1 where the active spring heats and −1 where it cools; a turn counts beyond ``threshold`` °C.

    The turn is placed where the temperature leaves its extremum for good, not where the threshold was crossed: a hold
    belongs to what came before it. Each half-cycle starts heating.
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
            # The knee: furthest from the straight way between the extremum and here.
            first, furthest = where, 0.0
            for i in range(first + 1, k):
                away = sense * (temperature[i] - extreme - (value - extreme) * (i - first) / (k - first))
                if away > furthest:
                    where, furthest = i, away
            sense = -sense
            for i in range(where + 1, k):
                direction[i] = sense
            extreme, where = value, k
        direction[k] = sense
    return direction


def turns_of(temp_c: Floats, least_c: float) -> Ints:
    """Return the samples (k,) of a temperature (n,) at which it turns and goes back by so much or more."""
    return np.array(extremes(temp_c, least_c)[1:-1], np.int64)


@compiled
def on_lines(course: Floats, places: Floats) -> Floats:
    """Return a course (n,) at places (m,) among its samples, from 0 to n − 1, on the lines between them."""
    found = np.empty(len(places))
    for i in range(len(places)):
        before = min(int(places[i]), len(course) - 2)
        found[i] = course[before] + (places[i] - before) * (course[before + 1] - course[before])
    return found


def at_places(temp_c: Floats, turns: Ints, places: Floats) -> Floats:
    """Return a temperature (n,) at places (m,), rising, among its samples: on lines, turns (k,) as they were reached.

    A turn that lies between two places stands at the later one. A transformation that only advances is, there, where
    the turn has left it; on the line it would have ended short of that, for all of the rest that follows.
    """
    found = on_lines(temp_c, places)
    after = np.searchsorted(places, turns)
    reached = (after > 0) & (after < len(places))
    found[after[reached]] = temp_c[turns[reached]]
    return found
