"""Detection of film times in minutes instead of seconds, from the log's heatings.

A film whose times are too small by a factor of 60 shows strokes in both directions within one heating. No offset
explains these, but with all times multiplied by 60 each stroke has its heating or cooling. A film in seconds does not
pass this test by chance: strokes that are 60 times as long and as far apart do not fit better than before.
"""

from __future__ import annotations

from dataclasses import replace

from sync.clock.motion_likelihood import MotionLikelihood
from sync.clock.offset_search import ALIKE, find_ranges
from sync.log.timestamps import longest_gap_s
from sync.signals.heating_segments import log_signals
from sync.signals.strokes import find_strokes
from torsight.core.errors import InputError
from torsight.core.records import TemperatureLog
from torsight.core.tracks import StickAngles


def require_seconds(angles: StickAngles, log: TemperatureLog, likelihood: MotionLikelihood | None) -> None:
    """Refuse a film whose motion the log explains only with the film's times as minutes.

    ``likelihood`` is the result with times in seconds, None if there is none.
    """
    if likelihood is not None and likelihood.strokes - likelihood.matched <= 1:
        return
    slower = replace(angles, time_s=60.0 * angles.time_s)
    strokes, signals = find_strokes(slower), log_signals(log, max_gap_s=longest_gap_s(log.time_s))
    if not strokes or not signals.segments:
        return
    span_s = (float(slower.time_s[0]), float(slower.time_s[-1]))
    score = max((part.score for part in find_ranges(strokes, signals, film_span_s=span_s)), default=0.0)
    before = 0.0 if likelihood is None else likelihood.ranges[0].score
    if score <= max(before + ALIKE, 1.0 - ALIKE):
        return
    matched = 0 if likelihood is None else likelihood.matched
    raise InputError(
        "the film's times seem to be in minutes",
        where="angles, column time_s",
        value=f"{matched} of {len(strokes)} strokes with a heating or cooling; with times 60 times as large they fit",
        limit="times in seconds",
        do="give the film's times in seconds",
    )
