"""Search for the possible ranges of the offset: motion against heating and cooling over the whole log.

Every stroke must lie within a heating or cooling that drives the angle in its direction, and not where the temperature
is held, because then nothing moves: that distinguishes the stairs of a programme from each other. The share of the
strokes' time for which this holds, as a function of the offset, has plateaus: ranges in which every stroke can be
assigned to the segment that drove it.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np

from sync.clock.clock_priors import PRIORS
from sync.signals.even_signal import WINDOW_S
from sync.signals.heating_segments import HeatingSegment, LogSignals
from sync.signals.strokes import Stroke
from torsight.core.series import runs
from torsight.core.units import Floats

_STEP_S: Final = 0.25 * WINDOW_S
"""Step of the search: signals that are smoothed over a window hardly change over a quarter of it."""
ALIKE: Final = 0.12
"""Difference below which shares of explained motion count as equal: one stroke of eight, the fewest of a programme.
Half this value moves a clock by 0.03 of its standard deviations at most, twice by 1.5
(benchmarks/sync/constants.py)."""


@dataclass(frozen=True, slots=True)
class OffsetRange:
    """A range of offsets at which the strokes lie in segments that explain them.

    ``score`` is the largest share of explained motion in the range, 1 where everything fits.
    """

    low_s: float
    high_s: float
    score: float


class Assignment(NamedTuple):
    """A part of a range, with the segment of each stroke (None without any), and whether that segment drives it."""

    where: OffsetRange
    segments: list[HeatingSegment | None]
    driven: list[bool]

    @property
    def lost(self) -> float:
        """Decrease of the log-likelihood by strokes that nothing drives."""
        return PRIORS.no_segment_log * self.driven.count(False)


def find_ranges(strokes: Sequence[Stroke], signals: LogSignals) -> tuple[OffsetRange, ...]:
    """Return the ranges of offset that explain the motion about as well as the best, best first.

    There must be strokes and segments.
    """
    log_begin = min(signal.start_s for signal in signals.springs.values())
    log_end = max(signal.start_s + signal.step_s * len(signal.value) for signal in signals.springs.values())
    low = log_begin - strokes[-1].end_s
    high = log_end - strokes[0].begin_s
    offset_s = np.arange(low, high + _STEP_S, _STEP_S)
    score = explained_share(strokes, signals.segments, offset_s)
    best = float(score.max())
    if best <= 0.0:
        return ()
    good = score >= best - ALIKE
    ranges = [
        OffsetRange(
            low_s=float(offset_s[begin]) - _STEP_S,
            high_s=float(offset_s[end - 1]) + _STEP_S,
            score=float(score[begin:end].max()),
        )
        for begin, end in runs(good)
    ]
    return tuple(sorted(ranges, key=lambda offset_range: -offset_range.score))


def explained_share(strokes: Sequence[Stroke], segments: Sequence[HeatingSegment], offset_s: Floats) -> Floats:
    """Return the mean over strokes of the share of their duration that lies in a segment of their direction."""
    share = np.zeros(len(offset_s))
    weights = np.array([np.sqrt(stroke.length_rad) for stroke in strokes])
    for stroke, weight in zip(strokes, weights / weights.sum(), strict=True):
        begin, end = stroke.begin_s + offset_s, stroke.end_s + offset_s
        inside = np.zeros(len(offset_s))
        for segment in segments:
            if segment.sign == stroke.sign:
                inside += segment.drives_s(begin, end)
        share += weight * np.minimum(1.0, inside / max(stroke.end_s - stroke.begin_s, 1e-9))
    return share


def best_share(strokes: Sequence[Stroke], segments: Sequence[HeatingSegment], *, step_s: float) -> float:
    """Return the largest explained share over all offsets at which strokes and segments meet."""
    low = min(segment.begin_s for segment in segments) - strokes[-1].end_s
    high = max(segment.until_s for segment in segments) - strokes[0].begin_s
    return float(explained_share(strokes, segments, np.arange(low, high + step_s, step_s)).max())


def assignments(
    strokes: Sequence[Stroke], segments: Sequence[HeatingSegment], offset_range: OffsetRange
) -> list[Assignment]:
    """Return the parts of a range in which each stroke has the same segment, and the same strokes are driven by it."""
    count = max(1, int((offset_range.high_s - offset_range.low_s) / _STEP_S))
    edges_s = np.linspace(offset_range.low_s, offset_range.high_s, count + 1)
    found: list[Assignment] = []
    for low_s, high_s in itertools.pairwise(edges_s):
        offset_s = 0.5 * (low_s + high_s)
        assigned = assign(strokes, segments, offset_s)
        driven = [_is_driven(stroke, one, offset_s) for stroke, one in zip(strokes, assigned, strict=True)]
        if found and found[-1].segments == assigned and found[-1].driven == driven:
            found[-1] = found[-1]._replace(where=replace(found[-1].where, high_s=float(high_s)))
        else:
            part = replace(offset_range, low_s=float(low_s), high_s=float(high_s))
            found.append(Assignment(part, assigned, driven))
    return found


def _is_driven(stroke: Stroke, segment: HeatingSegment | None, offset_s: float) -> bool:
    """Return whether most of a stroke lies in its segment, and not where the temperature is held."""
    begin_s, end_s = np.array(stroke.begin_s + offset_s), np.array(stroke.end_s + offset_s)
    return segment is not None and float(segment.drives_s(begin_s, end_s)) > 0.5 * float(end_s - begin_s)


def assign(
    strokes: Sequence[Stroke], segments: Sequence[HeatingSegment], offset_s: float
) -> list[HeatingSegment | None]:
    """Return for each stroke the segment of its direction in which most of it lies at an offset, or None."""
    chosen: list[HeatingSegment | None] = []
    for stroke in strokes:
        begin, end = stroke.begin_s + offset_s, stroke.end_s + offset_s
        best: HeatingSegment | None = None
        most = 0.5 * (end - begin)
        for segment in segments:
            shared = min(end, segment.until_s) - max(begin, segment.begin_s)
            if segment.sign == stroke.sign and shared > most:
                best, most = segment, shared
        chosen.append(best)
    return chosen
