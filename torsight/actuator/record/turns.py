"""Turns of a temperature: where a heating ends and a cooling begins."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from torsight.core.compiled import compiled
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
