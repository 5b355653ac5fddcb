# ruff: noqa: FBT001
# Compiled functions call each other by position, flags too.
"""The samples for the stepping rule, from both wires' temperatures."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from torsight.actuator.record.turns import REVERSAL_C, turning_points
from torsight.core.compiled import compiled, copy_to
from torsight.core.units import Floats, Ints


class Samples(NamedTuple):
    """The inputs of the stepping rule, sample by sample."""

    per_s: Floats
    """(n,): One over the time since the sample before, 1/s (0 for the first)."""
    temps: Floats
    """(2, n): Wire temperature of the driven spring of this half-cycle, and of the other spring, °C."""
    active: NDArray[np.int8]
    """(n,): 0 while A is driven, 1 while B is."""
    half: Ints
    """(n,): Number of the half-cycle, from 0."""
    directions: NDArray[np.int8]
    """(2, n): From :func:`torsight.actuator.record.turns.turning_points`, for either row of ``temps``."""
    friction_scale: Floats
    """(n,): Factor on the friction at each sample."""
    load_change: Floats
    """(4, n): Factor on the passive spring's torque; additional torques of the active and the passive spring (N·m);
    factor on the torque of cold martensite in either spring, which multiplies the first. No columns where nothing
    changes."""
    slipped: Floats
    """(2, n): Slip of the fixed ends of A and of B, by which their windings are reduced, rad. No columns where none
    slips."""


@compiled
def sampled(
    time_s: Floats, temp_a_c: Floats, temp_b_c: Floats, active: NDArray[np.int8], half: Ints, passive: bool
) -> tuple[Floats, Floats, NDArray[np.int8]]:
    """Return ``per_s``, ``temps`` and ``directions`` of :class:`Samples`.

    The turns of the spring that is not driven are found only with ``passive``, where this spring transforms, too.
    """
    n = time_s.size
    per_s, temps, directions = np.zeros(n), np.empty((2, n)), np.ones((2, n), np.int8)
    for k in range(n):
        if k > 0:
            per_s[k] = 1.0 / (time_s[k] - time_s[k - 1])
        who = int(active[k])
        temps[who, k], temps[1 - who, k] = temp_a_c[k], temp_b_c[k]
    for row in range(2 if passive else 1):
        copy_to(directions[row], turning_points(temps[row], half, REVERSAL_C))
    return per_s, temps, directions
