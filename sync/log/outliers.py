"""Impossible readings: spikes, and readings that stay constant while the temperature changes.

A clean log passes unchanged: a reading goes only when it stands out from both neighbours by more than noise, steps and
a corner of the temperature can make, or when a constant run ends in a jump. What goes becomes NaN, not a guess.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from scipy.ndimage import median_filter

from sync.log.repairs import Repair
from sync.log.timestamps import BRIDGED_S
from torsight.core.series import APART, constant_runs, robust_sigma, scatter, usual_step
from torsight.core.units import Flags, Floats
from torsight.core.words.plausible import SPRING_C

RANGE_C: Final = (-80.0, SPRING_C[1])
"""Readings outside are the instrument's, not the spring's."""
_SPIKE_FLOOR_C: Final = 1.0
"""A smaller spike stays, whatever the noise. With half of it a merged table's temperatures err as much, with twice of
it 5 % more (benchmarks/sync/constants.py)."""
_STUCK_ROWS: Final = 8
"""A reading that stands still for fewer rows may be a slow instrument's; where it does for less time than is bridged
(:data:`~sync.log.timestamps.BRIDGED_S`), taking it out would put a straight line there, which is no better known. Half
and twice of it, and of the shares below, change no reading of damaged logs (benchmarks/sync/constants.py)."""
_ALIKE_SHARE: Final = 0.4
"""Less than this share of readings equal the one before where normal noise is 0.65 of their last digit or more."""
_FROZEN_ROWS: Final = round(math.log(1e-12) / math.log(_ALIKE_SHARE))
"""Thirty such readings in a row: 0.4³⁰ = 10⁻¹², no chance in any log."""
_FROZEN_SHARE: Final = 0.3
"""Where such runs make up more of the log, the sensor is a quiet one."""
_TO_AND_FRO: Final = 0.25
"""White noise turns two steps of three back; a sensor that only follows its spring turns few."""


def clean_channel(time_s: Floats, temp_c: Floats, *, name: str) -> tuple[Floats, list[Repair]]:
    """Set spikes and stuck readings (n,) of a column to NaN; return it with the list of what was found."""
    repairs: list[Repair] = []
    clean = temp_c.copy()
    missing = int(np.count_nonzero(~np.isfinite(clean)))
    if missing:
        clean[~np.isfinite(clean)] = np.nan
        repairs.append(Repair("not_a_number", missing, f"{name}: {missing} fields held no number"))
    wild = np.isfinite(clean) & ~np.isfinite(in_range(clean))
    clean[wild] = np.nan
    spike = spikes(time_s, clean)
    clean[spike] = np.nan
    total = int(np.count_nonzero(wild | spike))
    if total:
        worst = int(np.flatnonzero(wild | spike)[0])
        repairs.append(
            Repair(
                "spike",
                total,
                f"{name}: {total} spikes were taken out, the first {temp_c[worst]:g} °C at {time_s[worst]:g} s",
            )
        )
    stuck = _stuck(time_s, clean)
    clean[stuck] = np.nan
    if stuck.any():
        first = int(np.flatnonzero(stuck)[0])
        count = int(np.count_nonzero(stuck))
        repairs.append(
            Repair("stuck", count, f"{name}: {count} readings stood still, the first at {time_s[first]:g} s; taken out")
        )
    return clean, repairs


def in_range(temp_c: Floats) -> Floats:
    """Return readings (n,) with those as NaN that no spring can have: infinite ones, and outside :data:`RANGE_C`."""
    return np.where((temp_c >= RANGE_C[0]) & (temp_c <= RANGE_C[1]), temp_c, np.nan)


def noise_c(temp_c: Floats) -> float:
    """Return the noise of one reading, °C, from second differences (robust against corners and spikes)."""
    known = temp_c[np.isfinite(temp_c)]
    if len(known) < 8:
        return 0.0
    return scatter(known, order=2)


def spikes(time_s: Floats, temp_c: Floats) -> Flags:
    """Return which readings (n,) stand out from those around them by more than noise and a corner can make."""
    index = np.flatnonzero(np.isfinite(temp_c))
    found = np.zeros(len(temp_c), dtype=np.bool_)
    if len(index) < 9:
        return found
    known, at_s = temp_c[index], time_s[index]
    middle = median_filter(known, size=7, mode="nearest")
    away = np.abs(known - middle)
    noise = robust_sigma(away)
    # What a straight flank or a corner moves within the window: the spread of the medians around.
    spread = np.maximum(np.abs(np.roll(middle, 4) - middle), np.abs(np.roll(middle, -4) - middle))
    spread[:4], spread[-4:] = spread[4:8].max(), spread[-8:-4].max()
    # Beside a gap the neighbours lie too far away to say what the reading should be.
    lonely = np.maximum(np.diff(at_s, prepend=at_s[0]), np.diff(at_s, append=at_s[-1])) > 20 * usual_step(at_s)
    bad = (away > np.maximum(_SPIKE_FLOOR_C, APART * noise) + 2.0 * spread) & ~lonely
    found[index] = bad
    return found


def _stuck(time_s: Floats, temp_c: Floats) -> Flags:
    """Mark constant runs that end in a jump, or that noise would have changed; the run's first reading is kept."""
    stuck = np.zeros(len(temp_c), dtype=np.bool_)
    index = np.flatnonzero(np.isfinite(temp_c))
    if len(index) < _STUCK_ROWS:
        return stuck
    known, at_s = temp_c[index], time_s[index]
    step = np.abs(np.diff(known))
    jump_c = max(0.5, APART * noise_c(known), 12.0 * float(np.median(step[step > 0])) if (step > 0).any() else 0.5)
    same = constant_runs(known)
    for begin, end in same:
        if end - begin < _STUCK_ROWS or at_s[end - 1] - at_s[begin] < BRIDGED_S or end == len(known):
            continue
        if abs(known[end] - known[begin]) > jump_c:
            stuck[index[begin + 1 : end]] = True
    for begin, end in _frozen(np.diff(known), same):
        if at_s[end - 1] - at_s[begin] >= BRIDGED_S:
            stuck[index[begin + 1 : end]] = True
    return stuck


def _frozen(step_c: Floats, same: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Return runs of one value in a channel whose neighbouring readings elsewhere are seldom alike.

    None where they make up much of the log, or where no noise moves the readings to and fro: then the sensor is a quiet
    one.
    """
    runs = [(begin, end) for begin, end in same if end - begin >= _FROZEN_ROWS]
    inside = sum(end - begin - 1 for begin, end in runs)
    alike = int(np.count_nonzero(step_c == 0)) - inside
    others = len(step_c) - inside
    seldom = others > 0 and alike < _ALIKE_SHARE * others
    moves = np.sign(step_c[step_c != 0])
    seldom &= len(moves) > 1 and float(np.mean(moves[1:] != moves[:-1])) > _TO_AND_FRO
    return runs if seldom and inside < _FROZEN_SHARE * len(step_c) else []
