"""Recovery of a log's readings that are seconds apart, and of the wire's corners between them.

A merged table has the log's temperatures at every frame, linearly interpolated between the readings. Where readings are
seconds apart, interpolation cuts corners off: a heating that ends between two readings ends lower in the table than at
the wire, and an incomplete transformation keeps that difference. The lines meet at the readings, so that the readings
can be recovered from the table, as they can where it repeats every reading until the next. A ramp continues to the
corner and the next ramp begins there, so that the lines on both sides of a gap, extrapolated into it, meet at the
corner. A heating that is held for a short time ends below this meeting, and as far below it as the readings between the
lines say. The tops of a log of several rows a second are found in the same way.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from scipy.special import bdtrc

from torsight.actuator.record.log_noise import FINEST_C, NEGLIGIBLE_C, SHORTEST
from torsight.actuator.record.turns import REVERSAL_C, turns_of
from torsight.core.series import APART, BY_CHANCE, usual_step
from torsight.core.units import Flags, Floats

SLOW_S: Final = 1.0
"""Interval above which rows miss the temperature's corners, where a heating ends (benchmarks/actuator/slow_logs.py)."""
_ROUNDED_C: Final = 2e-5
"""Largest deviation of rows from their common line: tables are written with five decimals."""
_OFF: Final = 0.15
_UNRELATED: Final = 1e-6
"""Readings are regular if most of their distances are multiples of one interval, to within the share ``_OFF`` of it,
and so many that only one of 10⁶ sets of points unrelated to a log's clock (corners of a log without noise) has as many:
of those three distances in ten are."""
_LONGEST_HOLD_S: Final = 40.0
"""Prior of holds: half of all heatings are switched off at their top, the others are held, for times evenly distributed
up to this value: a choice. With half and twice this value the error on later records with readings every 3 s is 0.75
and 0.41° (0.51°) where nothing is held, and 0.89 and 0.94° (0.92°) where tops are held for up to 15 s
(benchmarks/actuator/slow_logs.py, --seeds 10)."""


def own_readings(time_s: Floats, temp_c: Floats) -> tuple[Floats, Floats] | None:
    """Return times and temperatures of the readings from which rows (n,) were interpolated or repeated.

    None where the readings are no further apart than the rows, or have no noise by which they can be found.
    """
    if len(time_s) < SHORTEST:
        return None
    times, temps, stands = _meetings(time_s, temp_c)
    if len(times) < SHORTEST:
        return None
    interval_s = _common_interval_s(np.diff(times))
    if interval_s is None and not _bend_by_noise(times, temps):
        return None
    # Rows no closer than the readings are the readings.
    if round((interval_s or float(np.median(np.diff(times)))) / usual_step(time_s)) < 2:
        return None
    wanted_s = np.r_[time_s[0], times, time_s[-1]]
    if interval_s is not None:
        # Readings on one common line (at rest to the last digit) are not found as meetings: they lie evenly on it.
        whole = np.maximum(np.rint(np.diff(wanted_s) / interval_s), 1.0).astype(np.int64)
        number = np.concatenate([[0], np.cumsum(whole)])
        wanted_s = np.interp(np.arange(number[-1] + 1), number, wanted_s)
    if stands:
        wanted_c = temp_c[np.searchsorted(time_s, wanted_s + 0.5 * usual_step(time_s)) - 1]
        rows_c = wanted_c[np.searchsorted(wanted_s, time_s, side="right") - 1]
    else:
        wanted_c = np.interp(wanted_s, *_together(times, temps, time_s, temp_c))
        rows_c = np.interp(time_s, wanted_s, wanted_c)
    missed = np.abs(rows_c - temp_c) > NEGLIGIBLE_C
    if interval_s is None:
        # Where two readings lie between the same two rows, the rows themselves say what there is to know.
        return _together(wanted_s, wanted_c, time_s[missed], temp_c[missed])
    # The corners of a programme without noise may be as even as readings: then rows between them do not follow.
    return None if missed.any() else (wanted_s, wanted_c)


def _together(time_s: Floats, temp_c: Floats, others_s: Floats, others_c: Floats) -> tuple[Floats, Floats]:
    """Return points (n,) and others (m,) in the order of their times; of two at one time the former."""
    known_s, first = np.unique(np.r_[time_s, others_s], return_index=True)
    return known_s, np.r_[temp_c, others_c][first]


def _off_lines(time_s: Floats, temp_c: Floats) -> Floats:
    """Return the distances (n − 2,) of points from the lines between their neighbours, °C."""
    share = (time_s[1:-1] - time_s[:-2]) / (time_s[2:] - time_s[:-2])
    return np.abs(temp_c[1:-1] - temp_c[:-2] - share * (temp_c[2:] - temp_c[:-2]))


def _common_interval_s(apart_s: Floats) -> float | None:
    """Return the interval of which distances (n,) are multiples; None where they are not.

    It is sought from the usual distance, and from a short one: where a log stands still, readings are not found.
    """
    found = []
    for usual_s in np.quantile(apart_s, [0.5, 0.1]):
        steps = np.maximum(np.rint(apart_s / usual_s), 1.0)
        interval_s = float(np.median(apart_s / steps))
        found.append((np.count_nonzero(np.abs(apart_s - steps * interval_s) <= _OFF * interval_s), interval_s))
    regular, interval_s = max(found)
    sure = 2 * regular > len(apart_s) and bdtrc(regular - 1, len(apart_s), 2.0 * _OFF) < _UNRELATED
    return interval_s if sure else None


def _bend_by_noise(time_s: Floats, temp_c: Floats) -> bool:
    """Return whether points (n,) deviate from the lines between their neighbours as readings do, not as corners.

    A programme with k corners on its way between its extremes deviates by 1/k of their distance or more at half of
    these, and no programme of straight lines has a hundred.
    """
    return bool(np.median(_off_lines(time_s, temp_c)) < 0.01 * np.ptp(temp_c))


class _Line(NamedTuple):
    """The wire's course on one side of an extremum, counted upwards to it: a parabola from its nearest reading on.

    ``value`` (°C) and ``sigma`` are those of the reading, ``slope`` is per s beyond it and ``bend`` per s²; ``span_s``
    is the distance of the readings.
    """

    value: float
    sigma: float
    slope: float
    bend: float
    span_s: float

    @classmethod
    def towards(cls, time_s: Floats, temp_c: Floats, sigma_c: float) -> _Line:
        """Return the course beyond the last of three readings; a bend counts as far as noise does not explain it."""
        spans_s, steps_c = np.abs(np.diff(time_s)), np.diff(temp_c)
        before, slope = (steps_c / spans_s).tolist()
        span_s = float(np.mean(spans_s))
        bend, noise = (slope - before) / span_s, math.sqrt(6.0) * sigma_c / span_s**2
        sure = max(0.0, 1.0 - (noise / bend) ** 2) if bend != 0.0 else 0.0
        return cls(float(temp_c[-1]), sigma_c, slope + 0.5 * sure * bend * span_s, sure * bend, span_s)

    def at(self, past_s: Floats) -> Floats:
        """Return the temperature at times (n,) beyond the reading."""
        return self.value + (self.slope + 0.5 * self.bend * past_s) * past_s

    def spread(self, past_s: Floats) -> Floats:
        """Return the standard deviation there: by the noise of two readings, and by half of what the bend adds."""
        share = past_s / self.span_s
        noise = self.sigma * np.hypot(1.0 + share, share)
        return np.hypot(noise, 0.25 * self.bend * past_s * (past_s + self.span_s))


class Read(NamedTuple):
    """Readings (n,) of a log and their standard deviations (n,)."""

    temp_c: Floats
    sigma_c: Floats


class Top(NamedTuple):
    """An extremum of the wire's temperature beside a few readings, between the lines of the other readings.

    ``begin_s`` and ``end_s`` are the times of the last reading before and the first one after it, ``at_s`` that at
    which the wire reaches it. ``height`` and ``sigma`` are its temperature, times ``sense`` (−1 for a lowest one), and
    the standard deviation.
    """

    begin_s: float
    end_s: float
    at_s: float
    sense: float
    height: float
    sigma: float
    up: _Line
    down: _Line

    def course(self, time_s: Floats) -> Floats:
        """Return the wire's temperature at times (n,) within."""
        lines = np.minimum(self.up.at(time_s - self.begin_s), self.down.at(self.end_s - time_s))
        return self.sense * np.minimum(lines, self.height)


def tops_of(time_s: Floats, temp_c: Floats, sigma_c: Floats, read: Read | None = None) -> list[Top]:
    """Return the extrema of a wire's temperature (n,) that lie between readings or are held over two at most.

    A heating ends anywhere below the meeting of the lines before and after its top: at the meeting if it is not held.
    The height has a posterior: the prior of a hold's duration, and the readings between the lines. A smoothed log is
    less accurate beside a top than before and after it: where the readings that were smoothed are given, ``read``, the
    lines lead through rows :data:`SLOW_S` apart, and these readings count between them.
    """
    found, stride = [], 1 if read is None else max(1, round(SLOW_S / usual_step(time_s)))
    own = read or Read(temp_c, sigma_c)
    for turn in turns_of(temp_c, REVERSAL_C).tolist():
        first = last = turn
        least = APART * float(sigma_c[turn])
        # Longer holds are no extrema that are sought here.
        while first > 0 and last - first < 2 * stride and abs(temp_c[first - 1] - temp_c[turn]) <= least:
            first -= 1
        while last < len(temp_c) - 1 and last - first < 2 * stride and abs(temp_c[last + 1] - temp_c[turn]) <= least:
            last += 1
        if last - first < 2 * stride and first >= 3 * stride and last < len(temp_c) - 3 * stride:
            top = _top(time_s, temp_c, sigma_c, own, (first, last), stride)
            found += [] if top is None else [top]
    return found


def _top(time_s: Floats, temp_c: Floats, sigma_c: Floats, read: Read, ends: tuple[int, int], stride: int) -> Top | None:
    """Return the extremum beside the rows from the first to the last; None where no lines lead to it.

    ``read`` are the readings that count between the lines.
    """
    before, after = ends[0] - stride, ends[1] + stride
    to, back = slice(before - 2 * stride, before + 1, stride), slice(after, after + 2 * stride + 1, stride)
    sense = 1.0 if temp_c[ends[0]] > temp_c[before] else -1.0
    begin_s, end_s, course = time_s[before], time_s[after], sense * temp_c
    up = _Line.towards(time_s[to], course[to], float(sigma_c[before]))
    down = _Line.towards(time_s[back][::-1], course[back][::-1], float(sigma_c[after]))
    if min(up.slope, down.slope) <= 0.0:
        return None
    # Times and heights at which the posterior is computed: a grid 80 times finer than what is not known.
    past_s = np.linspace(0.0, end_s - begin_s, 81)
    limit = np.minimum(up.at(past_s), down.at(past_s[::-1]))
    meets = int(np.argmax(limit))
    # Readings without noise are known to their last digit.
    rows = slice(before + 1, after)
    own_s, own, own_sigma = time_s[rows], sense * read.temp_c[rows], read.sigma_c[rows] + FINEST_C
    # A grid that is fine where a reading leaves little doubt.
    near = (own[:, None] + own_sigma[:, None] * np.linspace(-BY_CHANCE, BY_CHANCE, len(past_s))).ravel()
    least = max(course[before], course[after])
    if limit[meets] <= least or np.max(own - BY_CHANCE * own_sigma) > limit[meets]:
        return None
    height = np.unique(np.clip(np.r_[np.linspace(least, limit[meets], len(past_s)), near], least, limit[meets]))
    ends_s = np.interp(-height, -limit[meets:], past_s[meets:])
    lasts_s = ends_s - np.interp(height, limit[: meets + 1], past_s[: meets + 1])
    # Half of all heatings are held, for any time up to the longest; the others end where the lines meet.
    prior = np.append(np.abs(np.gradient(lasts_s)) / _LONGEST_HOLD_S, 1.0)
    height = np.append(height, limit[meets])
    ways = np.stack([up.at(own_s - begin_s), down.at(end_s - own_s)])
    nearer = np.argmin(ways, axis=0), np.arange(len(own_s))
    spread = np.stack([up.spread(own_s - begin_s), down.spread(end_s - own_s)])[nearer]
    free = height[:, None] >= ways[nearer]
    spread = np.where(free, np.hypot(spread, own_sigma), own_sigma)
    off = (own - np.minimum(ways[nearer], height[:, None])) / spread
    log = -np.sum(0.5 * off**2 + np.log(spread), axis=1)
    weight = prior * np.exp(log - log.max())
    weight /= weight.sum()
    mean = float(weight @ height)
    # The meeting is as uncertain as both lines are there.
    by_up = float(up.spread(past_s)[meets]) * down.slope
    by_down = float(down.spread(past_s[::-1])[meets]) * up.slope
    meeting = math.hypot(by_up, by_down) / (up.slope + down.slope)
    sigma = math.sqrt(float(weight @ (height - mean) ** 2) + float(weight[-1]) * meeting**2)
    at_s = begin_s + past_s[np.argmax(limit >= min(mean, limit[meets]))]
    return Top(float(begin_s), float(end_s), float(at_s), sense, mean, sigma, up, down)


def turns_reached(time_s: Floats, temp_c: Floats, sigma_c: Floats, tops: Sequence[Top]) -> tuple[Floats, Floats]:
    """Return temperatures (n,) of a wire and their sigmas, with turns between two rows placed at the later row.

    At the later row a transformation that only advances is still in the state that it reached at the turn
    (:func:`torsight.actuator.record.turns.at_places`).
    """
    reached, sigma = temp_c.copy(), sigma_c.copy()
    for top in tops:
        place = int(np.searchsorted(time_s, top.at_s))
        # A slice: the turn may be later than all rows.
        reached[place : place + 1], sigma[place : place + 1] = top.sense * top.height, top.sigma
    return reached, sigma


def turns_missed(time_s: Floats, temp_c: Floats, noise_c: float) -> Floats:
    """Return the sigmas (n,) of the temperatures of a log without noise: at a turn, how far the wire went beyond it.

    Whether the wire turned on the row or between two rows, the log does not show: a computed log may contain all that
    drives the model, a measured one does not.
    """
    sigma = np.full(len(temp_c), noise_c)
    for top in tops_of(time_s, temp_c, sigma):
        rows = np.arange(*np.searchsorted(time_s, [top.begin_s, top.end_s])) + 1
        place = rows[np.argmax(top.sense * temp_c[rows])]
        sigma[place] = math.hypot(noise_c, top.height - top.sense * temp_c[place], top.sigma)
    return sigma


def between(time_s: Floats, temp_c: Floats, sigma_c: Floats, wanted_s: Floats) -> tuple[Floats, Floats]:
    """Return the temperatures (m,) between readings (n,), and the standard deviation (m,) due to tops there.

    The temperatures lie on the line between two readings. In a gap with a corner they lie on the lines beside the gap,
    and beside a top on the lines to it, limited to its height.
    """
    slope = np.diff(temp_c) / np.diff(time_s)
    low = np.clip(np.searchsorted(time_s, wanted_s, side="right") - 1, 0, len(slope) - 1)
    before, after = _beside(slope, -1)[low], _beside(slope, 1)[low]
    past_s, left_s = wanted_s - time_s[low], time_s[low + 1] - wanted_s
    from_before, from_after = temp_c[low] + before * past_s, temp_c[low + 1] - after * left_s
    outer = np.where(before > after, np.minimum(from_before, from_after), np.maximum(from_before, from_after))
    corners = _corner_gaps(time_s, temp_c, sigma_c)
    known_c = np.where(corners[low], outer, temp_c[low] + slope[low] * past_s)
    doubt, tops = np.zeros(len(wanted_s)), tops_of(time_s, temp_c, sigma_c)
    for top in tops:
        here = (wanted_s > top.begin_s) & (wanted_s < top.end_s)
        known_c[here], doubt[here] = top.course(wanted_s[here]), top.sigma
    return turns_reached(wanted_s, known_c, doubt, tops)


def _corner_gaps(time_s: Floats, temp_c: Floats, sigma_c: Floats) -> Flags:
    """Return the mask (n − 1,) of the gaps between readings (n,) in which the wire has a corner.

    At a corner the slope changes by more than noise explains, and by more than four times the bend beside it (for a
    wire that bends evenly it is twice), and the lines beside the gap meet within it.
    """
    slope = np.diff(temp_c) / np.diff(time_s)
    first, before, after, last = (_beside(slope, step) for step in (-2, -1, 1, 2))
    bend = np.maximum(np.abs(before - first), np.abs(last - after))
    seen = np.abs(after - before) > BY_CHANCE * 2.0 * sigma_c[:-1] / np.diff(time_s) + 4.0 * bend
    return np.asarray(seen & ((before - slope) * (after - slope) < 0.0))


def _beside(slope: Floats, step: int) -> Floats:
    """Return the slopes (n − 1,) shifted by ``step`` gaps, with the end values repeated."""
    return slope[np.clip(np.arange(len(slope)) + step, 0, len(slope) - 1)]


def _meetings(time_s: Floats, temp_c: Floats) -> tuple[Floats, Floats, bool]:
    """Return times and temperatures at which straight lines of rows meet (on a row or between two rows).

    Where more than two rows in succession bend, each counts: two meetings lie among them. Level lines do not meet:
    where most lines are level, every reading is repeated until the next, from its first row, and the third value is
    true.
    """
    slope = np.diff(temp_c) / np.diff(time_s)
    bent = np.concatenate([[False], _off_lines(time_s, temp_c) > _ROUNDED_C, [False]])
    pair = np.flatnonzero(bent[1:-2] & bent[2:-1] & ~bent[:-3] & ~bent[3:]) + 1
    before, after, gap_s = slope[pair - 1], slope[pair + 1], time_s[pair + 1] - time_s[pair]
    level = (before == 0.0) & (after == 0.0)
    turn = np.where(before == after, 1.0, before - after)
    past_s = np.where(level, gap_s, np.clip((temp_c[pair + 1] - after * gap_s - temp_c[pair]) / turn, 0.0, gap_s))
    bent[np.concatenate([pair, pair + 1])] = False
    times = np.concatenate([time_s[bent], time_s[pair] + past_s])
    temps = np.concatenate([temp_c[bent], temp_c[pair] + before * past_s])
    order = np.argsort(times)
    return times[order], temps[order], bool(2 * np.count_nonzero(level) > len(times))
