"""Ripple of a spring's readings while it is heated, from a heater that is switched on and off within seconds.

The wire's transformation only advances while it is heated, so it follows the peaks of such a ripple. The conditioning
of a log knows the height of the peaks only to half of it (:mod:`torsight.actuator.record.ripple`), unless there are
many readings per pulse. Differences between neighbouring readings are compared between heatings and rests: noise and
the last digit are the same in both. Where the temperature is merely curved, these differences grow with the distance
between the readings; with pulses they rise and fall.
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
"""Readings per pulse that resolve its shape (benchmarks/actuator/pulsed_heaters.py)."""
_MATTERS_C: Final = 0.1
"""Usual resolution of sensors, °C; such a change moves the reference rig by 2° where the angle is steepest."""
_SLOW_SHARE: Final = 0.95
"""Quantile at which differences are clipped: corners of the temperature cause the largest differences, but few."""


def ripple_c(reading: LogReading) -> dict[Spring, float]:
    """Return the scatter of a spring's readings beyond that at rest, °C, in the heating in which it is largest.

    Only springs are included whose ripple exceeds the remaining scatter and :data:`_MATTERS_C`. Timestamps that are
    truncated to whole steps, and readings that are held for several rows, show no ripple.
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
    # Readings that do not change at rest have the error of the last digit when the temperature changes.
    still = np.maximum(still, last_digit(temp_c) ** 2 / 12.0)
    changing = [rows for rows in heated if 2 * np.count_nonzero(np.diff(temp_c[rows])) >= np.count_nonzero(rows)]
    return max((_beyond(_sizes(time_s, temp_c, rows), still) for rows in changing), default=0.0)


def _beyond(driven: Floats, still: Floats) -> float:
    """Return the scatter of a heating beyond that at rest, from both variances by stride; 0 without pulses."""
    count = min(len(driven), len(still))
    if count == 0:
        return 0.0
    driven, still = driven[:count], still[:count]
    at = int(np.argmax(driven - still))
    later = np.minimum.accumulate(driven[::-1])[::-1]
    bends_only = at == count - 1 and float((driven - later).max()) <= still[at]
    return 0.0 if bends_only or driven[at] <= 2.0 * still[at] else float(np.sqrt(driven[at] - still[at]))


def _sizes(time_s: Floats, temp_c: Floats, rows: Flags) -> Floats:
    """Return the variance of one reading by stride, for the strides with enough differences."""
    longest = max((end - begin for begin, end in runs(rows)), default=0)
    strides = range(1, min(PLENTY // 2, (longest - SHORTEST) // 3) + 1)
    return np.square([_scatter(time_s, temp_c, rows, stride) for stride in strides])


def _scatter(time_s: Floats, temp_c: Floats, rows: Flags, stride: int) -> float:
    """Return the standard deviation of one reading, from third divided differences, in which parabolas vanish."""
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
