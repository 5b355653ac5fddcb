"""Outliers of a series among their neighbours: off the line of least median distance to a window of seven samples."""

from __future__ import annotations

from typing import Final

import numpy as np

from torsight.core.compiled import compiled
from torsight.core.series import APART
from torsight.core.units import Flags, Floats

_SIDE: Final = 3
"""Samples on either side of the one that is judged."""
_WINDOW: Final = 2 * _SIDE + 1
"""Samples of a window. Of seven, three may be wrong or belong to another line than the one in the middle."""


def outliers(time_s: Floats, values: Floats, least: Floats) -> Flags:
    """Return the mask (n,) of samples that lie off the line of their neighbours; NaN is not judged.

    An outlier is further from that line than ``least`` (n,) and than ``APART`` times the median distance of the seven
    samples around it. The line is that of least median distance (Rousseeuw, J. Am. Stat. Assoc. 79 (1984) 871), so that
    three of the seven may be wrong, or follow a step or the line after a corner. The first and last three samples have
    no neighbours on both sides, and are none.
    """
    good = np.flatnonzero(np.isfinite(values))
    out = np.zeros(len(values), np.bool_)
    if len(good) >= _WINDOW:
        out[good] = _off_their_lines(time_s[good], values[good], least[good], APART)
    return out


@compiled
def _off_their_lines(time_s: Floats, values: Floats, least: Floats, times: float) -> Flags:
    """Return the mask (n,) of samples off their window's line by ``least`` (n,) and ``times`` its median distance."""
    n, out = len(values), np.zeros(len(values), np.bool_)
    distance = np.empty(_WINDOW)
    for i in range(_SIDE, n - _SIDE):
        # Off the line of its two neighbours by less than half of that, a sample is at its place or beside a wrong one.
        share = (time_s[i] - time_s[i - 1]) / (time_s[i + 1] - time_s[i - 1])
        if 2.0 * abs(values[i] - values[i - 1] - share * (values[i + 1] - values[i - 1])) <= least[i]:
            continue
        first = i - _SIDE
        spread, off = np.inf, 0.0
        for a in range(first, first + _WINDOW):
            for b in range(a + 1, first + _WINDOW):
                slope = (values[b] - values[a]) / (time_s[b] - time_s[a])
                for k in range(_WINDOW):
                    distance[k] = abs(values[first + k] - values[a] - slope * (time_s[first + k] - time_s[a]))
                middle = np.sort(distance)[_SIDE]
                if middle < spread:
                    spread, off = middle, distance[_SIDE]
        out[i] = off > max(least[i], times * spread)
    return out
