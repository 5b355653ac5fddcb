"""Heating and cooling of the two springs in the log: flanks, and the direction in which each drives the actuator."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from sync.signals.even_signal import EvenSignal, even_signal
from torsight.core.records import TemperatureLog
from torsight.core.series import extremes

_MIN_RISE_C: Final = 12.0
_MIN_SHARE: Final = 0.3
"""A rise smaller than this share of the largest one is the other spring's warmth."""
_WINDOW_S: Final = 2.0
_HEATING_SHARE: Final = 0.03

Spring = Literal["a", "b"]


@dataclass(frozen=True, slots=True)
class Flank:
    """One heating or cooling of one spring.

    Attributes
    ----------
    spring : {"a", "b"}
        Which one.
    heating : bool
        False for a cooling.
    begin_s, end_s : float
        Times of the log.
    low_c, high_c : float
        Temperatures at its cold and its hot end.
    until_s : float
        How long it may drive a motion: a cooling does until the temperature turns, beyond the end of its steep part,
        but not into the next heating of either spring.
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
class LogPicture:
    """The log as even signals, with its flanks in the order of time.

    Attributes
    ----------
    springs : mapping
        Each spring's temperature.
    heated : mapping
        The same, smoothed over a time that is short against a heating: noise of a reading is an error of the clock
        that differs from one offset to the next, and looks like evidence for the luckier one.
    flanks : tuple of Flank
        In order.
    """

    springs: dict[Spring, EvenSignal]
    heated: dict[Spring, EvenSignal]
    flanks: tuple[Flank, ...]


def picture_log(log: TemperatureLog, *, max_gap_s: float, slope_window_s: float | None = None) -> LogPicture:
    """Smooth both temperatures, their slopes over a window of its own, and find their flanks."""
    readings: tuple[tuple[Spring, NDArray[np.float64]], ...] = (("a", log.temp_a_c), ("b", log.temp_b_c))
    springs = _even(log, readings, window_s=_WINDOW_S, max_gap_s=max_gap_s, slope_window_s=slope_window_s)
    rises = {name: float(np.ptp(signal.value)) for name, signal in springs.items()}
    largest = max(rises.values(), default=0.0)
    threshold_c = max(_MIN_RISE_C, _MIN_SHARE * largest)
    flanks = [flank for name, signal in springs.items() for flank in _flanks(name, signal, threshold_c)]
    heatings_s = [flank.end_s - flank.begin_s for flank in flanks if flank.heating]
    window_s = float(np.clip(_HEATING_SHARE * np.median(heatings_s), _WINDOW_S, 20.0)) if heatings_s else _WINDOW_S
    heated = springs if window_s == _WINDOW_S else _even(log, readings, window_s=window_s, max_gap_s=max_gap_s)
    return LogPicture(springs, heated, _until_the_next(sorted(flanks, key=lambda flank: flank.begin_s)))


def _even(
    log: TemperatureLog,
    readings: tuple[tuple[Spring, NDArray[np.float64]], ...],
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


def _until_the_next(flanks: list[Flank]) -> tuple[Flank, ...]:
    """End every cooling where the next heating begins: a rest turns anywhere."""
    begins = [flank.begin_s for flank in flanks if flank.heating]
    found: list[Flank] = []
    for flank in flanks:
        following = min((begin for begin in begins if begin > flank.begin_s), default=flank.until_s)
        limit_s = flank.until_s if flank.heating else max(flank.end_s, min(flank.until_s, following))
        found.append(replace(flank, until_s=limit_s))
    return tuple(found)


def lag_window_s(picture: LogPicture) -> float:
    """Return the time over which a slope can be taken without rounding a cooling: a fifth of its time constant."""
    lengths = [flank.end_s - flank.begin_s for flank in picture.flanks if not flank.heating]
    return float(np.clip(np.median(lengths) / 16.0, 0.5, 8.0)) if lengths else 2.0


def _flanks(spring: Spring, signal: EvenSignal, threshold_c: float) -> list[Flank]:
    value, time_s = signal.value, signal.time_s
    # A finer look than at fifty thousand points finds no other heating.
    turns = extremes(value, threshold_c, stride=max(1, len(value) // 50_000))
    found: list[Flank] = []
    for first, last in itertools.pairwise(turns):
        low, high = sorted((float(value[first]), float(value[last])))
        if high - low < threshold_c:
            continue
        heating = bool(value[last] > value[first])
        piece = value[first : last + 1]
        # A turning point anywhere on a noisy rest says little: the flank begins and ends where 4 % of it are done.
        margin = 0.04 * (high - low)
        if heating:
            begin = first + int(np.flatnonzero(piece <= low + margin)[-1])
            end = last
        else:
            begin = first
            end = first + int(np.flatnonzero(piece <= low + margin)[0])
        found.append(Flank(spring, heating, float(time_s[begin]), float(time_s[end]), low, high, float(time_s[last])))
    return found
