"""Readings of a temperature log that are seconds apart, and the wire's corners between them.

A merged table has the log's temperatures at every frame, on straight lines between the readings. Where readings are
seconds apart the lines cut corners off: a heating that ends between two readings ends lower in the table than at the
wire, and an incomplete transformation keeps that difference. The lines meet at the readings, so that these can be taken
back out of the table. A ramp goes on until the corner and what follows begins there, so the lines on both sides of a
gap, continued into it, meet at the corner.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from torsight.actuator.record.log_noise import SHORTEST
from torsight.core.series import BY_CHANCE, usual_step
from torsight.core.units import Flags, Floats

SLOW_S: Final = 1.0
"""Rows further apart miss the corners of the temperature, where a heating ends (benchmarks/actuator/slow_logs.py)."""
_ROUNDED_C: Final = 2e-5
"""How far rows of one line may be off it: tables are written with five decimals."""
_OFF: Final = 0.15
_REGULAR: Final = 0.9
"""Readings are multiples of one interval apart, to such a share of it, in such a share of them. Of places that have
nothing to do with a log's clock (corners of a log without noise) three in ten are: 16 of them in 10⁶ cases once."""
_FEW_ROWS: Final = 2.5
"""Lines of fewer rows than three are not known from noise."""
_SHARP: Final = 4.0
"""And changes the slope by so many times what the gaps beside it do: a wire that bends evenly, by twice that."""


def own_readings(time_s: Floats, temp_c: Floats) -> tuple[Floats, Floats] | None:
    """Return times and temperatures of the readings between which rows (n,) were interpolated.

    None where readings are no further apart than the rows, or have no noise that would tell.
    """
    if len(time_s) < SHORTEST:
        return None
    times, temps = _meetings(time_s, temp_c)
    if len(times) < SHORTEST:
        return None
    apart_s = np.diff(times)
    shortest_s = float(np.quantile(apart_s, 0.1))
    steps = np.maximum(np.rint(apart_s / shortest_s), 1.0)
    interval_s = float(np.median(apart_s / steps))
    regular = np.mean(np.abs(apart_s - steps * interval_s) <= _OFF * interval_s) >= _REGULAR
    if not regular or interval_s < _FEW_ROWS * usual_step(time_s):
        return None
    # Readings that one line joins, at rest to the last digit, are no meeting: they lie evenly on it.
    ends = np.r_[time_s[0], times, time_s[-1]], np.r_[temp_c[0], temps, temp_c[-1]]
    whole = np.maximum(np.rint(np.diff(ends[0]) / interval_s), 1.0).astype(np.int64)
    number = np.concatenate([[0], np.cumsum(whole)])
    wanted_s = np.interp(np.arange(number[-1] + 1), number, ends[0])
    return wanted_s, np.interp(wanted_s, *ends)


def corner_gaps(time_s: Floats, temp_c: Floats, noise_c: float) -> Flags:
    """Return in which gaps (n − 1) between readings (n,) of so much noise the wire has a corner.

    The slope changes there by more than noise does and than the wire bends beside it, and the lines beside the gap meet
    in it.
    """
    slope = np.diff(temp_c) / np.diff(time_s)
    gap = np.arange(len(slope))
    first, before, after, last = (slope[np.clip(gap + step, 0, len(slope) - 1)] for step in (-2, -1, 1, 2))
    bend = np.maximum(np.abs(before - first), np.abs(last - after))
    seen = np.abs(after - before) > BY_CHANCE * 2.0 * noise_c / np.diff(time_s) + _SHARP * bend
    return np.asarray(seen & ((before - slope) * (after - slope) < 0.0))


def between(time_s: Floats, temp_c: Floats, corners: Flags, wanted_s: Floats) -> Floats:
    """Return the temperatures (m,) between readings (n,): on lines, in a gap with a corner on those beside it."""
    slope = np.diff(temp_c) / np.diff(time_s)
    low = np.clip(np.searchsorted(time_s, wanted_s, side="right") - 1, 0, len(slope) - 1)
    before, across, after = (slope[np.clip(low + step, 0, len(slope) - 1)] for step in (-1, 0, 1))
    past_s, left_s = wanted_s - time_s[low], time_s[low + 1] - wanted_s
    from_before, from_after = temp_c[low] + before * past_s, temp_c[low + 1] - after * left_s
    meet = np.where(before > after, np.minimum(from_before, from_after), np.maximum(from_before, from_after))
    return np.where(corners[low], meet, temp_c[low] + across * past_s)


def _meetings(time_s: Floats, temp_c: Floats) -> tuple[Floats, Floats]:
    """Return times and temperatures at which straight lines of rows meet: on a row, or between two rows."""
    slope = np.diff(temp_c) / np.diff(time_s)
    share = (time_s[1:-1] - time_s[:-2]) / (time_s[2:] - time_s[:-2])
    off = np.abs(temp_c[1:-1] - temp_c[:-2] - share * (temp_c[2:] - temp_c[:-2])) > _ROUNDED_C
    bent = np.concatenate([[False], off, [False]])
    alone = np.flatnonzero(bent[1:-1] & ~bent[:-2] & ~bent[2:]) + 1
    pair = np.flatnonzero(bent[1:-2] & bent[2:-1] & ~bent[:-3] & ~bent[3:]) + 1
    before, after, gap_s = slope[pair - 1], slope[pair + 1], time_s[pair + 1] - time_s[pair]
    turn = np.where(before == after, 1.0, before - after)
    past_s = np.clip((temp_c[pair + 1] - after * gap_s - temp_c[pair]) / turn, 0.0, gap_s)
    times = np.concatenate([time_s[alone], time_s[pair] + past_s])
    temps = np.concatenate([temp_c[alone], temp_c[pair] + before * past_s])
    order = np.argsort(times)
    return times[order], temps[order]
