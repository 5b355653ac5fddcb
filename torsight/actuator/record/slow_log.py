"""Readings of a temperature log that are seconds apart, and the wire's corners between them.

A merged table has the log's temperatures at every frame, on straight lines between the readings. Where readings are
seconds apart the lines cut corners off: a heating that ends between two readings ends lower in the table than at the
wire, and an incomplete transformation keeps that difference. The lines meet at the readings, so that these can be taken
back out of the table, as they can where it repeats every reading until the next. A ramp goes on until the corner and
what follows begins there, so the lines on both sides of a gap, continued into it, meet at the corner.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from torsight.actuator.record.log_noise import SHORTEST
from torsight.core.series import BY_CHANCE, usual_step
from torsight.core.units import Flags, Floats, Ints

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
_LONGEST_HOLD_S: Final = 40.0
"""Half of all heatings are switched off where they end, the others are held, evenly up to so long: a choice. With half
and twice of it later records behind readings every 3 s are off by 0.81 and 0.79° (0.78°) where nothing is held, and by
1.57 and 1.62° (1.60°) where tops are held for up to 15 s (benchmarks/actuator/slow_logs.py)."""
_SHARP: Final = 4.0
"""And changes the slope by so many times what the gaps beside it do: a wire that bends evenly, by twice that."""


def own_readings(time_s: Floats, temp_c: Floats) -> tuple[Floats, Floats] | None:
    """Return times and temperatures of the readings between which rows (n,) were interpolated, or which they repeat.

    None where readings are no further apart than the rows, or have no noise that would tell.
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
    if not regular or interval_s < _FEW_ROWS * usual_step(time_s):
        return None
    # Readings that one line joins, at rest to the last digit, are no meeting: they lie evenly on it.
    ends = np.r_[time_s[0], times, time_s[-1]], np.r_[temp_c[0], temps, temp_c[-1]]
    whole = np.maximum(np.rint(np.diff(ends[0]) / interval_s), 1.0).astype(np.int64)
    number = np.concatenate([[0], np.cumsum(whole)])
    wanted_s = np.interp(np.arange(number[-1] + 1), number, ends[0])
    if stands:
        return wanted_s, temp_c[np.searchsorted(time_s, wanted_s + 0.5 * usual_step(time_s)) - 1]
    return wanted_s, np.interp(wanted_s, *ends)


def corner_gaps(time_s: Floats, temp_c: Floats, noise_c: Floats | float) -> Flags:
    """Return in which gaps (n − 1) between readings (n,) the wire has a corner; ``noise_c`` is one, or each gap's.

    The slope changes there by more than noise does and than the wire bends beside it, and the lines beside the gap meet
    in it.
    """
    slope = np.diff(temp_c) / np.diff(time_s)
    first, before, after, last = (_beside(slope, step) for step in (-2, -1, 1, 2))
    bend = np.maximum(np.abs(before - first), np.abs(last - after))
    seen = np.abs(after - before) > BY_CHANCE * 2.0 * noise_c / np.diff(time_s) + _SHARP * bend
    return np.asarray(seen & ((before - slope) * (after - slope) < 0.0))


def _beside(slope: Floats, step: int) -> Floats:
    """Return the slope (n − 1) so many gaps further on; at the ends, the last."""
    return slope[np.clip(np.arange(len(slope)) + step, 0, len(slope) - 1)]


def turns_between(time_s: Floats, temp_c: Floats, corners: Flags) -> tuple[Ints, Floats, Floats]:
    """Return the gaps (k,) between readings (n,) in which the wire turns, how far it gets there, and one sigma of that.

    A heating that is switched off between two readings ends above both: where the lines beside them meet if it is not
    held, and anywhere below that if it is held for less than the gap.
    """
    slope, span_s = np.diff(temp_c) / np.diff(time_s), np.diff(time_s)
    before, after = _beside(slope, -1), _beside(slope, 1)
    gaps = np.flatnonzero(corners & (before * after < 0.0))
    low, high, before, after, span_s = temp_c[gaps], temp_c[gaps + 1], before[gaps], after[gaps], span_s[gaps]
    meet = low + before * np.clip((high - after * span_s - low) / (before - after), 0.0, span_s)
    nearest = np.where(before > 0.0, np.maximum(low, high), np.minimum(low, high))
    # Of those that are held for up to the longest hold, so many are held for less than the gap.
    held = 1.0 / (1.0 + _LONGEST_HOLD_S / span_s)
    turn_c = meet + 0.5 * held * (nearest - meet)
    return gaps, turn_c, np.abs(meet - nearest) * np.sqrt(held / 12.0 + held * (1.0 - held) / 4.0)


def turns_reached(time_s: Floats, temp_c: Floats, sigma_c: Floats) -> tuple[Floats, Floats]:
    """Return temperatures (n,) of a wire and their sigmas, its turns between two readings at the later one.

    A transformation that only advances is, there, where the turn has left it
    (:func:`torsight.actuator.record.turns.at_places`).
    """
    gaps, turn_c, doubt_c = turns_between(time_s, temp_c, corner_gaps(time_s, temp_c, sigma_c[:-1]))
    reached, sigma = temp_c.copy(), sigma_c.copy()
    reached[gaps + 1] = turn_c
    sigma[gaps + 1] = np.hypot(sigma[gaps + 1], doubt_c)
    return reached, sigma


def between(time_s: Floats, temp_c: Floats, corners: Flags, wanted_s: Floats) -> tuple[Floats, Floats]:
    """Return the temperatures (m,) between readings (n,), and what is not known of turns there, one sigma.

    On lines; in a gap with a corner on those beside it, held between them at the turn's height.
    """
    slope = np.diff(temp_c) / np.diff(time_s)
    low = np.clip(np.searchsorted(time_s, wanted_s, side="right") - 1, 0, len(slope) - 1)
    before, after = _beside(slope, -1)[low], _beside(slope, 1)[low]
    past_s, left_s = wanted_s - time_s[low], time_s[low + 1] - wanted_s
    from_before, from_after = temp_c[low] + before * past_s, temp_c[low + 1] - after * left_s
    gaps, turn_c, doubt_c = turns_between(time_s, temp_c, corners)
    held_c, doubt = np.full(len(slope), np.nan), np.zeros(len(slope))
    held_c[gaps], doubt[gaps] = turn_c, doubt_c
    # No number stands for a corner that is no turn: there is nothing to hold at.
    top = np.fmin(np.minimum(from_before, from_after), held_c[low])
    bottom = np.fmax(np.maximum(from_before, from_after), held_c[low])
    known_c = np.where(corners[low], np.where(before > after, top, bottom), temp_c[low] + slope[low] * past_s)
    return known_c, doubt[low]


def _meetings(time_s: Floats, temp_c: Floats) -> tuple[Floats, Floats, bool]:
    """Return times and temperatures at which straight lines of rows meet: on a row, or between two rows.

    Level lines do not meet: where most are, every reading stands until the next, from its first row.
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
