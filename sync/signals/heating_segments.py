"""Heating and cooling of the two springs in the log: segments, and the direction in which each drives the actuator."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, Literal, get_args

import numpy as np

from sync.log.outliers import noise_c
from sync.signals.even_signal import WINDOW_S, EvenSignal, even_signal
from torsight.core.records import TemperatureLog
from torsight.core.series import BY_CHANCE, extremes, runs, usual_step
from torsight.core.units import Floats
from torsight.core.words.plausible import HEATED_C

_HEATING_SHARE: Final = 0.03
"""Share of a heating over which its temperature is smoothed for the thresholds: over 3 % it is nearly straight. Half
and twice this value move a clock by 0.34 of its standard deviations at most (benchmarks/sync/constants.py)."""

_HELD_SHARE: Final = 0.1
"""Rate, relative to the mean of its heating, below which a temperature is held: a motion is then ten times slower.
Half this value moves a clock by 2.4 of its standard deviations at most, twice by 0.1 (benchmarks/sync/constants.py)."""
LATEST_S: Final = 10.0
"""Longest delay of a motion behind its temperature: the time constant of a friction that stops the actuator from
following. Half and twice this value move a clock by 0.1 of its standard deviations at most
(benchmarks/sync/constants.py)."""

Spring = Literal["a", "b"]


@dataclass(frozen=True, slots=True)
class HeatingSegment:
    """One heating or cooling of one spring: times of the log, and temperatures at its cold and its hot end.

    ``until_s`` is the time until which the segment may drive a motion: for a cooling until the temperature turns,
    beyond the end of its steep part, but not into the next heating of either spring. During ``held_s`` a heating holds
    its temperature, so that nothing moves.
    """

    spring: Spring
    heating: bool
    begin_s: float
    end_s: float
    low_c: float
    high_c: float
    until_s: float
    held_s: tuple[tuple[float, float], ...] = ()

    def drives_s(self, begin_s: Floats, end_s: Floats) -> Floats:
        """Return how long the segment may drive a motion between given times (n,), s."""
        whole = _shared_s(begin_s, end_s, self.begin_s, self.until_s)
        return np.asarray(whole - sum(_shared_s(begin_s, end_s, *held) for held in self.held_s))

    def rises(self, log: TemperatureLog) -> tuple[HeatingSegment, ...]:
        """Return the parts of a heating that each end with a hold or with the heating: one where it is never held."""
        # Between two rows, so that no rounding of times decides on a row.
        before_s = 0.5 * usual_step(log.time_s)
        ends = [stop - before_s for _, stop in self.held_s if stop < self.end_s - LATEST_S]
        begins = [self.begin_s, *ends]
        known = np.isfinite(log.temp_c(self.spring))
        low_c = np.interp(ends, log.time_s[known], log.temp_c(self.spring)[known])
        return tuple(
            replace(self, begin_s=begin, end_s=end, low_c=low, held_s=())
            for begin, end, low in zip(begins, [*ends, self.end_s], [self.low_c, *low_c.tolist()], strict=True)
        )

    @property
    def rise_s(self) -> float:
        """Mean time for which the temperature rises between two holds."""
        held_s = sum(stop - first + LATEST_S for first, stop in self.held_s)
        return (self.end_s - self.begin_s - held_s) / (len(self.held_s) + 1)

    @property
    def sign(self) -> int:
        """Direction in which the segment drives the angle: heating A down, heating B up, cooling in reverse."""
        return (-1 if self.spring == "a" else 1) * (1 if self.heating else -1)


@dataclass(frozen=True, slots=True, eq=False)
class LogSignals:
    """The log as even signals of each spring's temperature, with its segments in the order of time.

    ``heated`` are the same signals smoothed over a longer time that is still short against a heating: a reading's noise
    acts as an error of the clock that differs between offsets and favours one of them by chance.
    """

    springs: dict[Spring, EvenSignal]
    heated: dict[Spring, EvenSignal]
    segments: tuple[HeatingSegment, ...]


def log_signals(log: TemperatureLog, *, max_gap_s: float) -> LogSignals:
    """Return both temperatures smoothed, and their segments."""
    springs = _even(log, window_s=WINDOW_S, max_gap_s=max_gap_s)
    segments = _driven([segment for name, signal in springs.items() for segment in _segments(name, signal)], springs)
    heatings = [segment for segment in segments if segment.heating]
    heated = _heated(log, springs, [one.end_s - one.begin_s for one in heatings], max_gap_s)
    held = {one: _with_holds(one, heated[one.spring]) for one in heatings}
    segments = [held.get(one, one) for one in segments]
    if any(one.held_s for one in segments):
        heated = _heated(log, springs, [one.rise_s for one in held.values()], max_gap_s)
    return LogSignals(springs, heated, _until_the_next(sorted(segments, key=lambda segment: segment.begin_s)))


def _heated(
    log: TemperatureLog, springs: dict[Spring, EvenSignal], rises_s: Sequence[float], max_gap_s: float
) -> dict[Spring, EvenSignal]:
    """Return the signals smoothed over a share of the usual rise of a temperature, ``rises_s`` (k,)."""
    # At least the window of the other signals; beyond 20 s the corners of slow programmes would vanish.
    window_s = float(np.clip(_HEATING_SHARE * np.median(rises_s), WINDOW_S, 20.0)) if rises_s else WINDOW_S
    return springs if window_s == WINDOW_S else _even(log, window_s=window_s, max_gap_s=max_gap_s)


def _driven(segments: Sequence[HeatingSegment], springs: Mapping[Spring, EvenSignal]) -> list[HeatingSegment]:
    """Return the segments of springs that are heated themselves, without those of the other spring's heat.

    Heat reaches the other spring later and weaker: of two heatings, one of each spring, the one whose temperature rises
    less while both last is due to the other, and so is the cooling after it.
    """
    heatings = [segment for segment in segments if segment.heating]

    def passive(segment: HeatingSegment) -> bool:
        for other in heatings:
            both_s = np.array([max(segment.begin_s, other.begin_s), min(segment.end_s, other.end_s)])
            lasts = both_s[1] - both_s[0] > 0.5 * (segment.end_s - segment.begin_s)
            if other.spring != segment.spring and lasts:
                rise, larger = (float(np.diff(springs[one.spring].at(both_s)[0])[0]) for one in (segment, other))
                if rise < larger:
                    return True
        return False

    driven: list[HeatingSegment] = []
    for name in springs:
        kept = True
        for segment in (one for one in segments if one.spring == name):
            kept = not passive(segment) if segment.heating else kept
            if kept:
                driven.append(segment)
    return driven


def _even(log: TemperatureLog, *, window_s: float, max_gap_s: float) -> dict[Spring, EvenSignal]:
    temps: dict[Spring, Floats] = {name: log.temp_c(name) for name in get_args(Spring)}
    found = {
        name: even_signal(log.time_s, temp_c, noise=noise_c(temp_c), window_s=window_s, max_gap_s=max_gap_s)
        for name, temp_c in temps.items()
    }
    return {name: signal for name, signal in found.items() if signal is not None}


def _until_the_next(segments: list[HeatingSegment]) -> tuple[HeatingSegment, ...]:
    """Return the segments with coolings that end where the next heating begins: at rest turning points are random."""
    begins = [segment.begin_s for segment in segments if segment.heating]

    def until_s(segment: HeatingSegment) -> float:
        return max(segment.end_s, min([segment.until_s, *(begin for begin in begins if begin > segment.begin_s)]))

    return tuple(one if one.heating else replace(one, until_s=until_s(one)) for one in segments)


def _segments(spring: Spring, signal: EvenSignal) -> list[HeatingSegment]:
    value, time_s = signal.value, signal.time_s
    # Fifty thousand points are enough to find all heatings.
    turns = extremes(value, HEATED_C, stride=max(1, len(value) // 50_000))
    found: list[HeatingSegment] = []
    for first, last in itertools.pairwise(turns):
        low, high = sorted((float(value[first]), float(value[last])))
        if high - low < HEATED_C:
            continue
        heating = bool(value[last] > value[first])
        piece = value[first : last + 1]
        # The turning point on a noisy rest is random: the segment begins and ends at 4 % of its rise.
        margin = 0.04 * (high - low)
        if heating:
            begin = first + int(np.flatnonzero(piece <= low + margin)[-1])
            end = last
        else:
            begin = first
            end = first + int(np.flatnonzero(piece <= low + margin)[0])
        found.append(
            HeatingSegment(spring, heating, float(time_s[begin]), float(time_s[end]), low, high, float(time_s[last]))
        )
    return found


def _with_holds(segment: HeatingSegment, signal: EvenSignal) -> HeatingSegment:
    """Return a heating with the times at which its temperature has been held for long enough.

    The motion may go on for a while, because it is late.
    """
    time_s, value, last = signal.time_s, signal.value, len(signal.value) - 1
    begin, end = np.searchsorted(time_s, [segment.begin_s, segment.end_s])
    usual = (segment.high_c - segment.low_c) / max(segment.end_s - segment.begin_s, signal.step_s)
    # Nearer to a hold than to the ramp beyond chance; as a whole, such a stretch is a hold or rises slowly.
    slow = signal.slope[begin:end] + BY_CHANCE * signal.slope_sigma < 0.5 * usual
    stretches = [(begin + i, min(begin + k, last)) for i, k in runs(slow)]
    spans = [
        (float(time_s[first]) + LATEST_S, float(time_s[stop]))
        for first, stop in stretches
        if value[stop] - value[first] < _HELD_SHARE * usual * (time_s[stop] - time_s[first])
    ]
    return replace(segment, held_s=tuple(span for span in spans if span[1] > span[0]))


def _shared_s(begin_s: Floats, end_s: Floats, first_s: float, last_s: float) -> Floats:
    """Return how long two spans of time have in common, s."""
    return np.asarray(np.maximum(0.0, np.minimum(end_s, last_s) - np.maximum(begin_s, first_s)))
