"""Impossible readings: spikes, and readings that stay constant while the temperature changes.

A clean log passes unchanged: a reading is removed only if it differs from both neighbours by more than noise, steps and
a corner of the temperature explain, or if a constant run ends in a jump. Removed readings become NaN, not a guess.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Final

import numpy as np

from sync.log.repairs import Repair
from sync.log.timestamps import BRIDGED_S, longest_gap_s
from torsight.core.series import APART, constant_runs, rounding_variance, scatter, usual_step
from torsight.core.series.outliers import outliers
from torsight.core.units import Flags, Floats
from torsight.core.words.plausible import SPRING_C
from torsight.core.words.wording import counted

RANGE_C: Final = (-80.0, SPRING_C[1])
"""Range of readings of a spring; readings outside are errors of the instrument."""
_SPIKE_FLOOR_C: Final = 1.0
"""Least size of a spike, whatever the noise. With half this value a merged table's temperatures err as much, with twice
2 % more (benchmarks/sync/constants.py)."""
_LONGEST_S: Final = 30.0
"""Length of the longest excursion: a sensor that has lost contact regains it after seconds, or stays off. A choice;
half and twice this value change no reading of damaged logs (benchmarks/sync/constants.py)."""
_FROZEN_ROWS: Final = math.ceil(math.log2(1e9))
"""Number of readings in a row that are equal by chance once in 10⁹ times where most are not equal to the one before."""


def clean_channel(time_s: Floats, temp_c: Floats, *, name: str) -> tuple[Floats, list[Repair]]:
    """Return a column (n,) with spikes and stuck readings set to NaN, and the list of these repairs."""
    repairs: list[Repair] = []
    clean = np.where(np.isfinite(temp_c), temp_c, np.nan)
    missing = int(np.count_nonzero(np.isnan(clean)))
    if missing:
        repairs.append(Repair("not_a_number", missing, f"{name}: {counted(missing, 'field')} without a number"))
    clean = in_range(clean)
    clean[spikes(time_s, clean)] = np.nan
    spike = np.flatnonzero(np.isfinite(temp_c) & np.isnan(clean))
    if len(spike):
        first = f"the first {temp_c[spike[0]]:g} °C at {time_s[spike[0]]:g} s"
        repairs.append(Repair("spike", len(spike), f"{name}: {counted(len(spike), 'spike')} taken out, {first}"))
    stuck = np.flatnonzero(_stuck(time_s, clean))
    clean[stuck] = np.nan
    if len(stuck):
        text = f"{name}: {len(stuck)} readings stood still, the first at {time_s[stuck[0]]:g} s; taken out"
        repairs.append(Repair("stuck", len(stuck), text))
    return clean, repairs


def in_range(temp_c: Floats) -> Floats:
    """Return readings (n,) with NaN for those that no spring can have: infinite or outside :data:`RANGE_C`."""
    return np.where((temp_c >= RANGE_C[0]) & (temp_c <= RANGE_C[1]), temp_c, np.nan)


def noise_c(temp_c: Floats) -> float:
    """Return the noise of one reading, °C, from second differences (robust against corners and spikes).

    Of readings that are rounded more coarsely than they are noisy, this is the error of rounding.
    """
    known = temp_c[np.isfinite(temp_c)]
    if len(known) < 8:
        return 0.0
    return scatter(known, order=2) or rounding_c(known)


def rounding_c(temp_c: Floats) -> float:
    """Return the standard deviation of the rounding, °C, of readings that do not differ by noise; 0 for others.

    Where noise changes the last digit from reading to reading, a mean rounds much less; without noise the readings of a
    constant temperature are all rounded alike.
    """
    known = temp_c[np.isfinite(temp_c)]
    step = np.abs(np.diff(known))
    step = step[step > 0.0]
    return math.sqrt(rounding_variance(float(np.median(step)))) if len(step) and scatter(known, order=2) == 0.0 else 0.0


def spikes(time_s: Floats, temp_c: Floats) -> Flags:
    """Return the mask (n,) of readings that no wire can have had.

    Up to three in a row lie off the line of their neighbours. A longer excursion begins with a jump and ends with one
    back: a wire can be heated suddenly, but goes on cooling as it has begun.
    """
    found = np.zeros(len(temp_c), dtype=np.bool_)
    index = np.flatnonzero(np.isfinite(temp_c))
    if len(index) < 2:
        return found
    known, at_s = temp_c[index], time_s[index]
    step_s = usual_step(at_s)
    least_c = max(_SPIKE_FLOOR_C, APART * noise_c(known))
    bad = outliers(at_s, known, np.full(len(known), least_c))
    # Between readings that are further apart than a line can join them, a wire may cool by any amount.
    if step_s <= BRIDGED_S:
        for begin, end in _excursions(at_s, known, least_c):
            bad[begin:end] = True
    # Beside a gap the neighbours are too far away to predict the reading.
    near = np.maximum(np.diff(at_s, prepend=at_s[0]), np.diff(at_s, append=at_s[-1])) <= 20 * step_s
    found[index] = bad & near
    return found


def _excursions(time_s: Floats, temp_c: Floats, least_c: float) -> list[tuple[int, int]]:
    """Return begin and end (exclusive) of every run of readings (n,) between a jump and a jump back of a similar size.

    A jump is a step of ``least_c`` or more, and of more than twice the steps before and after: the first step of a
    cooling is followed by one of nearly the same size.
    """
    step = np.diff(temp_c)
    size = np.abs(step)
    beside = np.maximum(np.append(size[1:], 0.0), np.insert(size[:-1], 0, 0.0))
    jumps = np.flatnonzero(size > np.maximum(least_c, 2.0 * beside))
    found: list[tuple[int, int]] = []
    for to, back in pairwise(jumps.tolist()):
        similar = -2.0 < step[to] / step[back] < -0.5
        after_last = not found or to >= found[-1][1]
        if similar and after_last and time_s[back] - time_s[to] <= _LONGEST_S:
            found.append((to + 1, back + 1))
    return found


def _stuck(time_s: Floats, temp_c: Floats) -> Flags:
    """Return the mask of constant runs that end in a jump or are implausible with the channel's noise.

    The first reading of a run is kept.
    """
    stuck = np.zeros(len(temp_c), dtype=np.bool_)
    index = np.flatnonzero(np.isfinite(temp_c))
    known, at_s = temp_c[index], time_s[index]
    # Removing a run as short as the gaps that are bridged would put a line there, which is no better.
    least_s = longest_gap_s(at_s)
    step = np.abs(np.diff(known))
    jump_c = max(0.5, APART * noise_c(known), 12.0 * float(np.median(step[step > 0])) if (step > 0).any() else 0.5)
    same = constant_runs(known)
    for begin, end in same:
        if at_s[end - 1] - at_s[begin] < least_s or end == len(known):
            continue
        if abs(known[end] - known[begin]) > jump_c:
            stuck[index[begin + 1 : end]] = True
    for begin, end in _frozen(np.diff(known), same):
        if at_s[end - 1] - at_s[begin] >= least_s:
            stuck[index[begin + 1 : end]] = True
    return stuck


def _frozen(step_c: Floats, same: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Return runs of equal values in a channel whose neighbouring readings elsewhere are seldom equal.

    No runs are returned where they make up most of the log, or where the readings show no noise, which reverses steps:
    such a sensor is not stuck.
    """
    runs = [(begin, end) for begin, end in same if end - begin >= _FROZEN_ROWS]
    inside = sum(end - begin - 1 for begin, end in runs)
    alike = int(np.count_nonzero(step_c == 0)) - inside
    others = len(step_c) - inside
    moves = np.sign(step_c[step_c != 0])
    # White noise reverses two of three steps (Bienaymé 1874); a channel without noise follows its spring.
    noisy = len(moves) > 1 and np.count_nonzero(moves[1:] != moves[:-1]) > 0.5 * (2.0 / 3.0) * (len(moves) - 1)
    return runs if noisy and alike < 0.5 * others and inside < others else []
