"""Recovery of a log's readings that are seconds apart, and of the wire's corners between them.

A merged table has the log's temperatures at every frame, linearly interpolated between the readings. Where readings are
seconds apart, interpolation cuts corners off: a heating that ends between two readings ends lower in the table than at
the wire, and an incomplete transformation keeps that difference. The lines meet at the readings, so that the readings
can be recovered from the table, as they can where it repeats every reading until the next. A ramp continues to the
corner and the next ramp begins there, so that the lines on both sides of a gap, extrapolated into it, meet at the
corner.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from torsight.actuator.record.log_noise import SHORTEST
from torsight.actuator.record.turns import REVERSAL_C, turns_of
from torsight.core.series import BY_CHANCE, usual_step
from torsight.core.units import Flags, Floats, Ints

SLOW_S: Final = 1.0
"""Interval above which rows miss the temperature's corners, where a heating ends (benchmarks/actuator/slow_logs.py)."""
_ROUNDED_C: Final = 2e-5
"""Largest deviation of rows from their common line: tables are written with five decimals."""
_OFF: Final = 0.15
_REGULAR: Final = 0.9
"""Readings are regular if the share ``_REGULAR`` of their distances are multiples of one interval to within the share
``_OFF`` of it. Of points unrelated to a log's clock (corners of a log without noise) three in ten distances are: 16
points pass in one of 10⁶ cases."""
_LONGEST_HOLD_S: Final = 40.0
"""Prior of holds: half of all heatings are switched off at their top, the others are held, for times evenly distributed
up to this value: a choice. With half and twice this value the error on later records with readings every 3 s is 0.81
and 0.79° (0.78°) where nothing is held, and 1.57 and 1.62° (1.60°) where tops are held for up to 15 s
(benchmarks/actuator/slow_logs.py)."""
_SHARP: Final = 4.0
"""Least change of slope at a corner, relative to that of the gaps beside it: for a wire that bends evenly it is two."""


def own_readings(time_s: Floats, temp_c: Floats) -> tuple[Floats, Floats] | None:
    """Return times and temperatures of the readings from which rows (n,) were interpolated or repeated.

    None where the readings are no further apart than the rows, or have no noise by which they can be found.
    """
    if len(time_s) < SHORTEST:
        return None
    times, temps, stands = _meetings(time_s, temp_c)
    if len(times) < SHORTEST:
        return None
    apart_s = np.diff(times)
    shortest_s = float(np.quantile(apart_s, 0.1))
    steps = np.maximum(np.rint(apart_s / shortest_s), 1.0)
    interval_s = float(np.median(apart_s / steps))
    regular = np.mean(np.abs(apart_s - steps * interval_s) <= _OFF * interval_s) >= _REGULAR
    # Lines of fewer rows than three cannot be distinguished from noise.
    if not regular or round(interval_s / usual_step(time_s)) < 3:
        return None
    # Readings on one common line (at rest to the last digit) are not found as meetings: they lie evenly on the line.
    ends = np.r_[time_s[0], times, time_s[-1]], np.r_[temp_c[0], temps, temp_c[-1]]
    whole = np.maximum(np.rint(np.diff(ends[0]) / interval_s), 1.0).astype(np.int64)
    number = np.concatenate([[0], np.cumsum(whole)])
    wanted_s = np.interp(np.arange(number[-1] + 1), number, ends[0])
    if stands:
        return wanted_s, temp_c[np.searchsorted(time_s, wanted_s + 0.5 * usual_step(time_s)) - 1]
    return wanted_s, np.interp(wanted_s, *ends)


def corner_gaps(time_s: Floats, temp_c: Floats, noise_c: Floats | float) -> Flags:
    """Return the mask (n − 1,) of the gaps between readings (n,) in which the wire has a corner.

    At a corner the slope changes by more than noise explains and the wire bends beside it, and the lines beside the gap
    meet within it. ``noise_c`` is one value for all gaps or one per gap.
    """
    slope = np.diff(temp_c) / np.diff(time_s)
    first, before, after, last = (_beside(slope, step) for step in (-2, -1, 1, 2))
    bend = np.maximum(np.abs(before - first), np.abs(last - after))
    seen = np.abs(after - before) > BY_CHANCE * 2.0 * noise_c / np.diff(time_s) + _SHARP * bend
    return np.asarray(seen & ((before - slope) * (after - slope) < 0.0))


def _beside(slope: Floats, step: int) -> Floats:
    """Return the slopes (n − 1,) shifted by ``step`` gaps, with the end values repeated."""
    return slope[np.clip(np.arange(len(slope)) + step, 0, len(slope) - 1)]


def turns_between(time_s: Floats, temp_c: Floats, corners: Flags) -> tuple[Ints, Floats, Floats]:
    """Return the gaps (k,) between readings (n,) in which the wire turns, the turns' temperatures and their sigma.

    A heating that is switched off between two readings ends above both: at the meeting of the lines beside the gap if
    it is not held, and anywhere below this point if it is held for less than the gap.
    """
    slope, span_s = np.diff(temp_c) / np.diff(time_s), np.diff(time_s)
    before, after = _beside(slope, -1), _beside(slope, 1)
    gaps = np.flatnonzero(corners & (before * after < 0.0))
    low, high, before, after, span_s = temp_c[gaps], temp_c[gaps + 1], before[gaps], after[gaps], span_s[gaps]
    meet = low + before * np.clip((high - after * span_s - low) / (before - after), 0.0, span_s)
    nearest = np.where(before > 0.0, np.maximum(low, high), np.minimum(low, high))
    # Posterior share of tops that are held: of all held ones only those held for less than the gap are possible here.
    held = 1.0 / (1.0 + _LONGEST_HOLD_S / span_s)
    turn_c = meet + 0.5 * held * (nearest - meet)
    return gaps, turn_c, np.abs(meet - nearest) * np.sqrt(held / 12.0 + held * (1.0 - held) / 4.0)


def turns_reached(time_s: Floats, temp_c: Floats, sigma_c: Floats) -> tuple[Floats, Floats]:
    """Return temperatures (n,) of a wire and their sigmas, with turns between two readings placed at the later reading.

    At the later reading a transformation that only advances is still in the state that it reached at the turn
    (:func:`torsight.actuator.record.turns.at_places`). Where a held temperature goes on, it only seems to turn.
    """
    turns = turns_of(temp_c, REVERSAL_C)
    corners = corner_gaps(time_s, temp_c, sigma_c[:-1])
    corners &= np.isin(np.arange(len(corners)), [turns - 1, turns])
    gaps, turn_c, doubt_c = turns_between(time_s, temp_c, corners)
    reached, sigma = temp_c.copy(), sigma_c.copy()
    reached[gaps + 1] = turn_c
    sigma[gaps + 1] = np.hypot(sigma[gaps + 1], doubt_c)
    return reached, sigma


def between(time_s: Floats, temp_c: Floats, corners: Flags, wanted_s: Floats) -> tuple[Floats, Floats]:
    """Return the temperatures (m,) between readings (n,), and the standard deviation (m,) due to turns there.

    The temperatures lie on the line between two readings. In a gap with a corner they lie on the lines beside the gap,
    limited to the turn's temperature.
    """
    slope = np.diff(temp_c) / np.diff(time_s)
    low = np.clip(np.searchsorted(time_s, wanted_s, side="right") - 1, 0, len(slope) - 1)
    before, after = _beside(slope, -1)[low], _beside(slope, 1)[low]
    past_s, left_s = wanted_s - time_s[low], time_s[low + 1] - wanted_s
    from_before, from_after = temp_c[low] + before * past_s, temp_c[low + 1] - after * left_s
    gaps, turn_c, doubt_c = turns_between(time_s, temp_c, corners)
    held_c, doubt = np.full(len(slope), np.nan), np.zeros(len(slope))
    held_c[gaps], doubt[gaps] = turn_c, doubt_c
    # NaN marks a corner that is no turn, where no temperature limits the lines.
    top = np.fmin(np.minimum(from_before, from_after), held_c[low])
    bottom = np.fmax(np.maximum(from_before, from_after), held_c[low])
    known_c = np.where(corners[low], np.where(before > after, top, bottom), temp_c[low] + slope[low] * past_s)
    return known_c, doubt[low]


def _meetings(time_s: Floats, temp_c: Floats) -> tuple[Floats, Floats, bool]:
    """Return times and temperatures at which straight lines of rows meet (on a row or between two rows).

    Level lines do not meet: where most lines are level, every reading is repeated until the next, from its first row,
    and the third value is true.
    """
    slope = np.diff(temp_c) / np.diff(time_s)
    share = (time_s[1:-1] - time_s[:-2]) / (time_s[2:] - time_s[:-2])
    off = np.abs(temp_c[1:-1] - temp_c[:-2] - share * (temp_c[2:] - temp_c[:-2])) > _ROUNDED_C
    bent = np.concatenate([[False], off, [False]])
    alone = np.flatnonzero(bent[1:-1] & ~bent[:-2] & ~bent[2:]) + 1
    pair = np.flatnonzero(bent[1:-2] & bent[2:-1] & ~bent[:-3] & ~bent[3:]) + 1
    before, after, gap_s = slope[pair - 1], slope[pair + 1], time_s[pair + 1] - time_s[pair]
    level = (before == 0.0) & (after == 0.0)
    turn = np.where(before == after, 1.0, before - after)
    past_s = np.where(level, gap_s, np.clip((temp_c[pair + 1] - after * gap_s - temp_c[pair]) / turn, 0.0, gap_s))
    times = np.concatenate([time_s[alone], time_s[pair] + past_s])
    temps = np.concatenate([temp_c[alone], temp_c[pair] + before * past_s])
    order = np.argsort(times)
    return times[order], temps[order], bool(2 * np.count_nonzero(level) > len(times))
