"""Readings of the angle that belong to no motion: a marker was taken for another one, or a hand passed."""

from __future__ import annotations

from typing import Final

import numpy as np

from torsight.core.compiled import compiled
from torsight.core.series import APART, scatter
from torsight.core.units import Flags, Floats

_SIDE: Final = 3
"""Rows on either side of the one that is judged."""
_ROWS: Final = 2 * _SIDE + 1
"""Rows of a window. Of seven, three may be wrong or belong to another motion than the one in the middle."""
_LEAST_RAD: Final = 1e-5
"""Least scatter of an angle: differences below this value are rounding errors."""


def wrong_frames(time_s: Floats, angle_rad: Floats, sigma_rad: Floats) -> Flags:
    """Return the mask (n,) of rows whose angle is an outlier among its neighbours: a wrong frame, not a motion.

    An outlier lies off the line of its neighbours by more than ``APART`` times the largest of their median distance to
    that line, the row's own sigma and the angle's scatter. The line is that of least median distance to seven rows
    (Rousseeuw, J. Am. Stat. Assoc. 79 (1984) 871): three of them may be wrong, or follow a step or the start of a
    motion. The first and last three rows have no neighbours on both sides, and are none.
    """
    good = np.flatnonzero(np.isfinite(angle_rad))
    out = np.zeros(len(angle_rad), np.bool_)
    if len(good) < _ROWS:
        return out
    angle = angle_rad[good]
    least = np.fmax(sigma_rad[good], max(scatter(angle), _LEAST_RAD))
    out[good] = _off_their_lines(time_s[good], angle, APART * least, APART)
    return out


@compiled
def _off_their_lines(time_s: Floats, angle: Floats, least: Floats, times: float) -> Flags:
    """Return the mask (n,) of rows off the line of their window by ``least`` (n,) and ``times`` its median distance."""
    n, out = len(angle), np.zeros(len(angle), np.bool_)
    distance = np.empty(_ROWS)
    for i in range(_SIDE, n - _SIDE):
        # Off the line of its two neighbours by less than half of that, a row is at its place or beside a wrong one.
        share = (time_s[i] - time_s[i - 1]) / (time_s[i + 1] - time_s[i - 1])
        if 2.0 * abs(angle[i] - angle[i - 1] - share * (angle[i + 1] - angle[i - 1])) <= least[i]:
            continue
        first = i - _SIDE
        spread, off = np.inf, 0.0
        for a in range(first, first + _ROWS):
            for b in range(a + 1, first + _ROWS):
                slope = (angle[b] - angle[a]) / (time_s[b] - time_s[a])
                for k in range(_ROWS):
                    distance[k] = abs(angle[first + k] - angle[a] - slope * (time_s[first + k] - time_s[a]))
                middle = np.sort(distance)[_SIDE]
                if middle < spread:
                    spread, off = middle, distance[_SIDE]
        out[i] = off > max(least[i], times * spread)
    return out
