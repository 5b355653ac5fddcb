"""Where on the log's clock the film can lie at all: motion against heating and cooling over the whole range.

Every stroke must lie inside a heating or cooling that drives the angle its way. The share of the strokes' time for
which that holds, as a function of the offset, has plateaus: on each, every stroke can be given the flank that drove it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sync.signals.heating_segments import Flank, LogPicture
from sync.signals.strokes import Stroke
from torsight.core.series import runs

_STEP_S: Final = 0.5
_NEAR_BEST: Final = 0.12
_IDLE_WEIGHT: Final = 0.5


@dataclass(frozen=True, slots=True)
class Plateau:
    """A range of offsets at which the strokes fall into flanks that explain them.

    Attributes
    ----------
    low_s, high_s : float
        The range.
    score : float
        Best share of explained motion in it, 1 where everything fits.
    """

    low_s: float
    high_s: float
    score: float


def find_plateaus(
    strokes: Sequence[Stroke], picture: LogPicture, *, film_span_s: tuple[float, float]
) -> tuple[Plateau, ...]:
    """Return the ranges of offset that explain the motion about as well as the best, best first."""
    if not strokes or not picture.flanks:
        return ()
    log_begin = min(signal.start_s for signal in picture.springs.values())
    log_end = max(signal.start_s + signal.step_s * len(signal.value) for signal in picture.springs.values())
    low = log_begin - strokes[-1].end_s
    high = log_end - strokes[0].begin_s
    offset_s = np.arange(low, high + _STEP_S, _STEP_S)
    score = explained_share(strokes, picture.flanks, offset_s)
    score -= _IDLE_WEIGHT * _idle_share(strokes, picture.flanks, offset_s, film_span_s)
    best = float(score.max())
    if best <= 0.3:
        return ()
    good = score >= best - _NEAR_BEST
    plateaus = [
        Plateau(
            low_s=float(offset_s[begin]) - _STEP_S,
            high_s=float(offset_s[end - 1]) + _STEP_S,
            score=float(score[begin:end].max()),
        )
        for begin, end in runs(good)
    ]
    return tuple(sorted(plateaus, key=lambda plateau: -plateau.score))


def explained_share(
    strokes: Sequence[Stroke], flanks: Sequence[Flank], offset_s: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the mean over strokes of the share of their duration that lies in a flank of their direction."""
    share = np.zeros(len(offset_s))
    weights = np.array([np.sqrt(stroke.length_rad) for stroke in strokes])
    for stroke, weight in zip(strokes, weights / weights.sum(), strict=True):
        begin, end = stroke.begin_s + offset_s, stroke.end_s + offset_s
        inside = np.zeros(len(offset_s))
        for flank in flanks:
            if flank.sign == stroke.sign:
                inside += np.maximum(0.0, np.minimum(end, flank.until_s) - np.maximum(begin, flank.begin_s))
        share += weight * np.minimum(1.0, inside / max(stroke.end_s - stroke.begin_s, 1e-9))
    return share


def best_share(strokes: Sequence[Stroke], flanks: Sequence[Flank], *, step_s: float) -> float:
    """Return the largest explained share over all offsets at which strokes and flanks meet."""
    low = min(flank.begin_s for flank in flanks) - strokes[-1].end_s
    high = max(flank.until_s for flank in flanks) - strokes[0].begin_s
    return float(explained_share(strokes, flanks, np.arange(low, high + step_s, step_s)).max())


def _idle_share(
    strokes: Sequence[Stroke],
    flanks: Sequence[Flank],
    offset_s: NDArray[np.float64],
    film_span_s: tuple[float, float],
) -> NDArray[np.float64]:
    """Return the share of heatings, wholly on the film, during which nothing moved their way."""
    heatings = [flank for flank in flanks if flank.heating]
    idle = np.zeros(len(offset_s))
    seen = np.zeros(len(offset_s))
    for flank in heatings:
        on_film = (flank.begin_s - offset_s >= film_span_s[0]) & (flank.end_s - offset_s <= film_span_s[1])
        moved = np.zeros(len(offset_s), dtype=np.bool_)
        for stroke in strokes:
            if stroke.sign == flank.sign:
                moved |= (stroke.begin_s + offset_s < flank.until_s) & (stroke.end_s + offset_s > flank.begin_s)
        seen += on_film
        idle += on_film & ~moved
    return np.where(seen > 0, idle / np.maximum(seen, 1), 0.0)


def assign(strokes: Sequence[Stroke], flanks: Sequence[Flank], offset_s: float) -> list[Flank | None]:
    """Return the flank that drives each stroke at an offset: the one of its direction that shares most time with it."""
    chosen: list[Flank | None] = []
    for stroke in strokes:
        begin, end = stroke.begin_s + offset_s, stroke.end_s + offset_s
        best: Flank | None = None
        most = 0.4 * (end - begin)
        for flank in flanks:
            shared = min(end, flank.until_s) - max(begin, flank.begin_s)
            if flank.sign == stroke.sign and shared > most:
                best, most = flank, shared
        chosen.append(best)
    return chosen
