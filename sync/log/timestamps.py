"""Ordering of timestamps: rows that are misplaced, repeated or wrong, and restarts of the clock.

A timestamp that is smaller than the one before has one of three causes, which need different repairs:

- rows written out of order: there is a gap in the times before, into which they are sorted;
- a wrong timestamp: there is no such gap; it is interpolated from its neighbours if they leave a gap, else its row is
  dropped;
- a restart of the clock: the rows after it repeat times that were there already; they are shifted as a block.

A clock that restarts at zero from negative timestamps jumps forward instead, which is recognised by the zero.
"""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass
from typing import Final

import numpy as np

from sync.log.repairs import Repair
from torsight.core.series import usual_step
from torsight.core.units import Flags, Floats, Ints
from torsight.core.words.wording import counted

BRIDGED_S: Final = 2.0
"""Longest gap that is interpolated: a straight line over 2 s misses a cooling by A (2 s / τ)² / 8, 0.03 °C for 60 °C
with a time constant of 30 s. Where the reference rig moves back the error is 0.015 °C, 0.2° of its angle, about the
residual of a good record; over 5 s it is 1.1°."""
_CLOCK_SET_S: Final = 6 * 3600.0
"""Step forward above which the clock was set, instead of a pause in logging: a choice. Half and twice this value change
no reading of damaged logs (benchmarks/sync/constants.py)."""


@dataclass(frozen=True, slots=True)
class OrderedTimestamps:
    """The kept rows of the file in the order of time, and the repairs.

    Timestamps (m,) do not decrease within a block, and may repeat. ``block`` is 0 before the first restart of the
    clock, 1 after it, ...
    """

    row: Ints
    time_s: Floats
    block: Ints
    repairs: tuple[Repair, ...]


def order_timestamps(timestamp_s: Floats, *, first_line: int) -> OrderedTimestamps:
    """Sort rows by time, block by block.

    ``timestamp_s`` (n,) are the timestamps of the file, NaN where missing; row 0 is on line ``first_line``.
    """
    repairs: list[Repair] = []
    row = np.flatnonzero(np.isfinite(timestamp_s))
    lost = len(timestamp_s) - len(row)
    if lost:
        line = int(np.flatnonzero(~np.isfinite(timestamp_s))[0]) + first_line
        text = f"{counted(lost, 'row')} without a timestamp dropped, the first on line {line}"
        repairs.append(Repair("no_stamp", lost, text))
    if not len(row):
        return OrderedTimestamps(row, np.empty(0), row, tuple(repairs))
    time_s = timestamp_s[row].copy()
    block = _blocks(time_s)
    if block[-1]:
        lines = [str(int(row[i]) + first_line) for i in np.flatnonzero(np.diff(block)) + 1]
        at = ", ".join(lines[:5]) + (", ..." if len(lines) > 5 else "")
        times = counted(int(block[-1]), "time")
        repairs.append(Repair("restart", int(block[-1]), f"the clock restarted {times}, at line {at}"))
    counts = {"reordered": [0, 0], "wrong_stamp": [0, 0], "dropped_stamp": [0, 0]}
    inside = [block == index for index in range(int(block[-1]) + 1)]
    parts = [_ordered_block(row[one], time_s[one], counts, first_line) for one in inside]
    for kind, name, text in (
        ("reordered", "row", "out of order sorted in"),
        ("wrong_stamp", "timestamp", "that fitted nowhere interpolated from the rows around"),
        ("dropped_stamp", "row", "whose timestamp fitted nowhere dropped"),
    ):
        count, line = counts[kind]
        if count:
            repairs.append(Repair(kind, count, f"{counted(count, name)} {text}, the first on line {line}"))
    kept_row, kept_s = (np.concatenate(one) for one in zip(*parts, strict=True))
    number = np.repeat(np.arange(len(parts)), [len(one) for one, _ in parts])
    return OrderedTimestamps(kept_row, kept_s, number, tuple(repairs))


def longest_gap_s(time_s: Floats) -> float:
    """Return the longest distance of samples at times (n,) that is interpolated linearly.

    A longer one is a gap in all stages: it is reported, stays empty in the merged table and does not count in a fit.
    The limit is :data:`BRIDGED_S`, or five usual steps if longer: such a log consists of lines over seconds anyway, and
    up to four readings in a row may be missing.
    """
    return max(BRIDGED_S, 5.0 * usual_step(time_s))


def _blocks(time_s: Floats) -> Ints:
    """Return the number of restarts before every row (n,)."""
    block = np.zeros(len(time_s), dtype=np.int64)
    step = np.diff(time_s)
    begin = 0
    usual_s = usual_step(time_s)
    # A clock with negative timestamps that restarts at zero jumps forward, which would count as a pause.
    to_zero = (np.abs(time_s[1:]) <= 2.0 * usual_s) & (step > max(5.0, 20.0 * usual_s))
    backs = np.append(np.flatnonzero(step < 0) + 1, len(time_s))
    for at in np.flatnonzero((step < 0) | (step > _CLOCK_SET_S) | to_zero) + 1:
        # A block of a single row has no step to compare with that of a restart.
        if at < begin + 2:
            continue
        later = time_s[at:]
        if to_zero[at - 1]:
            restarted = True
        elif step[at - 1] > 0:
            # A single wrong timestamp jumps, too; after a clock was set, the rows continue from there.
            restarted = len(later) >= 3 and bool(np.all(np.abs(later[:3] - later[0]) < _CLOCK_SET_S))
        else:
            until = int(backs[np.searchsorted(backs, at, side="right")])
            restarted = _runs_over(time_s[begin:at], time_s[at:until])
        if restarted:
            block[at:] += 1
            begin = int(at)
    return block


def _runs_over(before: Floats, later: Floats) -> bool:
    """Return whether the rows after a step back, up to the next step back, repeat times that were there already."""
    last_s = float(np.median(before[-3:]))
    # Rows before the last earlier timestamp is passed again.
    back = later[: int(np.searchsorted(later[1:], last_s)) + 1]
    if len(back) < 3 or back[0] >= last_s:
        return False
    # Rows within the range of the earlier timestamps.
    inside = int(np.count_nonzero(back >= before.min()))
    there = int(np.count_nonzero((before >= back[0]) & (before <= back[-1])))
    return inside == 0 or there > inside // 3


def _ordered_block(row: Ints, time_s: Floats, counts: dict[str, list[int]], first_line: int) -> tuple[Ints, Floats]:
    if len(time_s) < 2 or not np.any(np.diff(time_s) < 0):
        return row, time_s
    step_s = usual_step(time_s)
    kept = _longest_increasing(time_s)
    good = time_s[kept]
    added: list[tuple[float, int]] = []
    for index in np.flatnonzero(~kept):
        line = int(row[index]) + first_line
        timestamp = float(time_s[index])
        place = int(np.searchsorted(good, timestamp))
        room = (good[place] if place < len(good) else np.inf) - (good[place - 1] if place else -np.inf)
        position = int(np.count_nonzero(kept[:index]))
        # The gap must hold one more row, allowing for the variation of a logger's steps.
        if room > 1.3 * step_s and np.isfinite(room):
            kind = "reordered"
        elif 0 < position < len(good) and good[position] - good[position - 1] > 1.3 * step_s:
            kind = "wrong_stamp"
            timestamp = 0.5 * float(good[position] + good[position - 1])
        else:
            kind = "dropped_stamp"
        counts[kind][0] += 1
        counts[kind][1] = counts[kind][1] or line
        if kind != "dropped_stamp":
            added.append((timestamp, int(row[index])))
    all_time = np.concatenate([good, [timestamp for timestamp, _ in added]])
    all_row = np.concatenate([row[kept], np.array([item for _, item in added], dtype=np.int64)])
    order = np.argsort(all_time, kind="stable")
    return all_row[order], all_time[order]


def _longest_increasing(time_s: Floats) -> Flags:
    """Return the mask of the longest non-decreasing subsequence (patience sorting)."""
    tails: list[float] = []
    tail_index: list[int] = []
    previous = np.full(len(time_s), -1, dtype=np.int64)
    for index, timestamp in enumerate(time_s.tolist()):
        place = bisect_right(tails, timestamp)
        previous[index] = tail_index[place - 1] if place else -1
        if place == len(tails):
            tails.append(timestamp)
            tail_index.append(index)
        else:
            tails[place] = timestamp
            tail_index[place] = index
    marked = np.zeros(len(time_s), dtype=np.bool_)
    index = tail_index[-1]
    while index >= 0:
        marked[index] = True
        index = int(previous[index])
    return marked
