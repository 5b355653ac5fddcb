"""Restarts whose gap is not known, as further unknowns of the clock beside offset and drift."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from torsight.core.units import Flags, Floats


@dataclass(frozen=True, slots=True)
class UnknownGap:
    """A joint of the log: rows behind it may belong later than they were put, by an unknown time.

    Attributes
    ----------
    after_s, begin_s : float
        Stamps of the last row before and of the first behind, as they were joined.
    sigma_s : float
        One standard deviation of the time that is missing between them.
    """

    after_s: float
    begin_s: float
    sigma_s: float


def log_time(
    film_s: Floats, point: Floats, gaps: Sequence[UnknownGap], *, middle_s: float
) -> tuple[Floats, Floats, Flags]:
    """Return the joined log's stamps at film times, their derivatives by the unknowns, and where the log has rows.

    ``point`` holds the offset at ``middle_s``, the drift, and the missing time of every gap.
    """
    away = film_s - middle_s
    stamp = film_s + point[0] + point[1] * away
    columns = [np.ones_like(film_s), away]
    covered = np.ones(len(film_s), dtype=np.bool_)
    for gap, missing_s in zip(gaps, point[2:], strict=True):
        behind = stamp > gap.after_s
        stamp = np.where(behind, stamp - missing_s, stamp)
        covered &= ~behind | (stamp >= gap.begin_s)
        columns.append(np.where(behind, -1.0, 0.0))
    return stamp, np.stack(columns, axis=1), covered
