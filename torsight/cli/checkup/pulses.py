"""Whether the readings of a spring ripple while it is heated: a heater that is switched on and off within seconds.

The wire's transformation only advances while it is heated, so it follows the peaks of such a ripple. How high they are
the preparation of a log knows to half of it only (:mod:`torsight.actuator.record.ripple`), unless there are many
readings to a pulse. What a reading differs from its neighbours by is compared between heatings and rests: noise and the
last digit are the same in both. Where the temperature merely bends, differences of readings that are further apart are
larger; those of pulses go up and down.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from sync import LogReading
from sync.log.timestamps import longest_gap_s
from sync.signals.heating_segments import HeatingSegment, Spring, log_signals
from torsight.actuator.record.log_noise import SHORTEST, last_digit
from torsight.core.series import rms, runs
from torsight.core.units import Flags, Floats

PLENTY: Final = 20
"""Readings to a pulse from which it is seen as it is (benchmarks/actuator/pulsed_heaters.py)."""
_MATTERS_C: Final = 0.1
"""Sensors are read to this; it moves the reference rig by 2° where it is steepest."""
_SLOW_SHARE: Final = 0.95
"""Corners of the temperature are the largest of the differences, and few."""


def ripple_c(reading: LogReading) -> dict[Spring, float]:
    """Return by how much, °C, the readings of a spring scatter in its most restless heating beyond those at rest.

    Only springs of which that is more than all the rest of the scatter, and matters. Timestamps that are cut off to
    whole steps, and readings that are held for several rows, show no ripple.
    """
    log = reading.log
    found: dict[Spring, float] = {}
    if reading.coarse_s > 0.0:
        return found
    segments = log_signals(log, max_gap_s=longest_gap_s(log.time_s)).segments
    springs: tuple[Spring, ...] = ("a", "b")
    for spring in springs:
        own = [segment for segment in segments if segment.spring == spring]
        known = np.isfinite(log.temp_c(spring))
        most = _most_restless(log.time_s[known], log.temp_c(spring)[known], own)
        if most > _MATTERS_C:
            found[spring] = most
    return found


def _most_restless(time_s: Floats, temp_c: Floats, segments: list[HeatingSegment]) -> float:
    inside = [(time_s >= segment.begin_s) & (time_s <= segment.end_s) for segment in segments]
    heated = [rows for segment, rows in zip(segments, inside, strict=True) if segment.heating]
    if not heated:
        return 0.0
    still = _sizes(time_s, temp_c, ~np.logical_or.reduce(inside))
    # A reading that stands still at rest has the error of its last digit while it moves.
    still = np.maximum(still, last_digit(temp_c) ** 2 / 12.0)
    changing = [rows for rows in heated if 2 * np.count_nonzero(np.diff(temp_c[rows])) >= np.count_nonzero(rows)]
    return max((_beyond(_sizes(time_s, temp_c, rows), still) for rows in changing), default=0.0)


def _beyond(driven: Floats, still: Floats) -> float:
    """Return the scatter of a heating beyond that at rest, from both variances by stride; 0 where none is of pulses."""
    count = min(len(driven), len(still))
    if count == 0:
        return 0.0
    driven, still = driven[:count], still[:count]
    at = int(np.argmax(driven - still))
    later = np.minimum.accumulate(driven[::-1])[::-1]
    bends_only = at == count - 1 and float((driven - later).max()) <= still[at]
    return 0.0 if bends_only or driven[at] <= 2.0 * still[at] else float(np.sqrt(driven[at] - still[at]))


def _sizes(time_s: Floats, temp_c: Floats, rows: Flags) -> Floats:
    """Return the variance of one reading by stride, for the strides of which there are enough differences."""
    longest = max((end - begin for begin, end in runs(rows)), default=0)
    strides = range(1, min(PLENTY // 2, (longest - SHORTEST) // 3) + 1)
    return np.square([_scatter(time_s, temp_c, rows, stride) for stride in strides])


def _scatter(time_s: Floats, temp_c: Floats, rows: Flags, stride: int) -> float:
    """Return the standard deviation of one reading, from third divided differences: they see no line or parabola."""
    found = [np.zeros(0)]
    for begin, end in runs(rows):
        count = end - begin - 3 * stride
        if count <= 0:
            continue
        at = begin + stride * np.arange(4)[:, None] + np.arange(count)
        apart_s = time_s[at][:, None] - time_s[at][None, :]
        weight = 1.0 / np.where(apart_s == 0.0, 1.0, apart_s).prod(axis=1)
        found.append(np.abs((weight * temp_c[at]).sum(axis=0)) / np.sqrt(np.square(weight).sum(axis=0)))
    size = np.concatenate(found)
    return rms(np.minimum(size, np.quantile(size, _SLOW_SHARE)))
