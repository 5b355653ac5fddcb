"""Heating and cooling of the two springs in the log: segments, and the direction in which each drives the actuator."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np

from sync.signals.even_signal import WINDOW_S, EvenSignal, even_signal
from torsight.core.records import TemperatureLog
from torsight.core.series import extremes
from torsight.core.units import Floats
from torsight.core.words.plausible import HEATED_C

_MIN_SHARE: Final = 0.3
"""A rise smaller than this share of the largest one is the other spring's warmth. Half and twice of it find the same
clock (benchmarks/sync/constants.py)."""
_HEATING_SHARE: Final = 0.03
"""Share of a heating over which its temperature is smoothed for the thresholds: 3 % of the way does not bend it.
Half and twice of it move a clock by 0.34 of its standard deviations at most (benchmarks/sync/constants.py)."""

Spring = Literal["a", "b"]


@dataclass(frozen=True, slots=True)
class HeatingSegment:
    """One heating or cooling of one spring: times of the log, and temperatures at its cold and its hot end.

    ``until_s`` is how long it may drive a motion: a cooling does until the temperature turns, beyond the end of its
    steep part, but not into the next heating of either spring.
    """

    spring: Spring
    heating: bool
    begin_s: float
    end_s: float
    low_c: float
    high_c: float
    until_s: float

    @property
    def sign(self) -> int:
        """Direction in which it drives the angle: heating A turns it down, heating B up, cooling the other way."""
        return (-1 if self.spring == "a" else 1) * (1 if self.heating else -1)


@dataclass(frozen=True, slots=True, eq=False)
class LogSignals:
    """The log as even signals of each spring's temperature, with its segments in the order of time.

    ``heated`` are the same signals smoothed over a time that is short against a heating: noise of a reading is an error
    of the clock that differs from one offset to the next, and favours one of them by chance.
    """

    springs: dict[Spring, EvenSignal]
    heated: dict[Spring, EvenSignal]
    segments: tuple[HeatingSegment, ...]


def log_signals(log: TemperatureLog, *, max_gap_s: float, slope_window_s: float | None = None) -> LogSignals:
    """Smooth both temperatures, their slopes over a window of its own, and find their segments."""
    readings: tuple[tuple[Spring, Floats], ...] = (("a", log.temp_a_c), ("b", log.temp_b_c))
    springs = _even(log, readings, window_s=WINDOW_S, max_gap_s=max_gap_s, slope_window_s=slope_window_s)
    rises = {name: float(np.ptp(signal.value)) for name, signal in springs.items()}
    largest = max(rises.values(), default=0.0)
    threshold_c = max(HEATED_C, _MIN_SHARE * largest)
    segments = [segment for name, signal in springs.items() for segment in _segments(name, signal, threshold_c)]
    heatings_s = [segment.end_s - segment.begin_s for segment in segments if segment.heating]
    # Never less than the log is smoothed by anyhow; beyond 20 s corners of slow programmes would go.
    window_s = float(np.clip(_HEATING_SHARE * np.median(heatings_s), WINDOW_S, 20.0)) if heatings_s else WINDOW_S
    heated = springs if window_s == WINDOW_S else _even(log, readings, window_s=window_s, max_gap_s=max_gap_s)
    return LogSignals(springs, heated, _until_the_next(sorted(segments, key=lambda segment: segment.begin_s)))


def _even(
    log: TemperatureLog,
    readings: tuple[tuple[Spring, Floats], ...],
    *,
    window_s: float,
    max_gap_s: float,
    slope_window_s: float | None = None,
) -> dict[Spring, EvenSignal]:
    signals = {
        name: even_signal(
            log.time_s, temperature, window_s=window_s, max_gap_s=max_gap_s, slope_window_s=slope_window_s
        )
        for name, temperature in readings
    }
    return {name: signal for name, signal in signals.items() if signal is not None}


def _until_the_next(segments: list[HeatingSegment]) -> tuple[HeatingSegment, ...]:
    """End every cooling where the next heating begins: a rest turns anywhere."""
    begins = [segment.begin_s for segment in segments if segment.heating]
    found: list[HeatingSegment] = []
    for segment in segments:
        following = min((begin for begin in begins if begin > segment.begin_s), default=segment.until_s)
        limit_s = segment.until_s if segment.heating else max(segment.end_s, min(segment.until_s, following))
        found.append(replace(segment, until_s=limit_s))
    return tuple(found)


def lag_window_s(signals: LogSignals) -> float:
    """Return the time over which a slope can be taken without rounding a cooling: a fifth of its time constant."""
    lengths = [segment.end_s - segment.begin_s for segment in signals.segments if not segment.heating]
    return float(np.clip(np.median(lengths) / 16.0, 0.5, 8.0)) if lengths else 2.0


def _segments(spring: Spring, signal: EvenSignal, threshold_c: float) -> list[HeatingSegment]:
    value, time_s = signal.value, signal.time_s
    # A finer look than at fifty thousand points finds no other heating.
    turns = extremes(value, threshold_c, stride=max(1, len(value) // 50_000))
    found: list[HeatingSegment] = []
    for first, last in itertools.pairwise(turns):
        low, high = sorted((float(value[first]), float(value[last])))
        if high - low < threshold_c:
            continue
        heating = bool(value[last] > value[first])
        piece = value[first : last + 1]
        # A turning point anywhere on a noisy rest says little: the segment begins and ends where 4 % of it are done.
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
