"""Effects of illumination on a track: glare on a marker, and flicker."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from torsight.core.series import runs
from torsight.core.units import Flags, Floats
from tracker.angle.length_noise import LEAST_FRAMES
from tracker.detect.moving_part import LOOKED_AT
from tracker.quality.gap_pictures import ALIKE, Luma, Pictures, spread_over
from tracker.rows import CODE
from tracker.track import TrackResult

_SATURATED: Final = 230
"""Grey level above which a pixel is saturated: white is 235 in video, and compression changes it by a few levels."""
GLARES: Final = 0.125
"""Share of saturated pixels within two radii of a marker, in excess of the usual share there, above which there is
glare on the marker: half of the dot's own area."""
_TIMES: Final = 3
"""Fewest periods in a film: two may be a lamp that was switched off twice."""
FELT: Final = 1.5
"""Error over the usual one above which its cause is reported: in dim frames over that in bright ones, for flicker; over
that of white noise, for compression."""


def glare_at_loss(missed: Flags, result: TrackResult, pictures: Pictures, markers: Sequence[int]) -> float:
    """Return the share of saturated pixels around a marker as it is lost, minus that where it is seen.

    ``missed`` (n,) marks the frames in question, ``markers`` are indices; ``pictures`` returns frames by number. The
    longest gaps of each marker are examined, without those under the other stick; the marker with the largest share
    counts.
    """
    tracks, state = result.tracks, result.rows["state"]
    starts: dict[int, list[int]] = {}
    held: dict[int, list[int]] = {}
    for marker in markers:
        gone = [
            (begin, end)
            for begin, end in runs(~tracks.valid[:, marker])
            if begin and missed[begin:end].any() and state[begin, marker] in (CODE["hidden"], CODE["lost"])
        ]
        gone.sort(key=lambda one: one[0] - one[1])
        starts[marker] = [begin for begin, _ in gone[:LOOKED_AT]]
        held[marker] = spread_over(np.flatnonzero(tracks.valid[:, marker])).tolist() if gone else []
    shown = pictures(sorted({one for frames in (*starts.values(), *held.values()) for one in frames}))
    reach = 2.0 * float(result.report["markers"]["radius_px"])
    share = [0.0]
    for marker in markers:
        place = tracks.position_px[:, marker]
        # The marker's place at its loss is extrapolated with constant speed.
        lost = [
            _saturated(shown[one], place[one - 1] + np.nan_to_num(place[one - 1] - place[max(one - 2, 0)]), reach)
            for one in starts[marker]
            if one in shown
        ]
        usual = [_saturated(shown[one], place[one], reach) for one in held[marker] if one in shown]
        if lost and usual:
            share.append(float(np.median(lost) - np.median(usual)))
    return max(share)


def _saturated(picture: Luma, place: Floats, reach: float) -> float:
    """Return the share of saturated pixels within a distance ``reach`` of a position, px."""
    (left, top), (right, bottom) = (np.floor(place - reach), np.ceil(place + reach) + 1.0)
    height, width = picture.shape
    rows = np.arange(max(0, int(top)), min(height, int(bottom)))
    columns = np.arange(max(0, int(left)), min(width, int(right)))
    near = np.hypot(columns[None, :] - place[0], rows[:, None] - place[1]) < reach
    return float(np.mean(picture[np.ix_(rows, columns)][near] >= _SATURATED)) if near.any() else 0.0


@dataclass(frozen=True, slots=True)
class Flicker:
    """Periodic brightness: its period in ``frames``, and the ``depth`` of its fall as a share of the highest.

    ``error`` is the markers' error in dim frames over that in bright ones.
    """

    frames: int
    depth: float
    error: float

    @property
    def felt(self) -> bool:
        """Whether the errors in dim frames are so much larger that flicker is reported."""
        return self.error >= FELT

    @property
    def words(self) -> str:
        """Return the advice on flicker."""
        return (
            f"the light flickers: its brightness falls by {self.depth:.0%} every {self.frames} frames or so; use a "
            "lamp without flicker (on direct current), or a shutter time of one or two half periods of the mains "
            "(1/100 or 1/50 s, with 60 Hz 1/120 or 1/60 s)."
        )


def flicker_of(rows: NDArray[np.void]) -> Flicker | None:
    """Return the flicker of the light, from the pictures' mean grey level; None where there is none.

    A stick that goes to and fro changes that level as well, but not the light around the base's markers; around its own
    ones, where the base is hardly seen, that changes otherwise.
    """
    read = np.flatnonzero(rows["level"] > 0.0)
    if not len(read):
        return None
    level = np.interp(np.arange(len(rows)), read, rows["level"][read])
    for stick in (np.s_[:2], np.s_[2:]):
        lit = (rows["state"][:, stick] == CODE["seen"]).all(axis=1) & (rows["light"][:, stick] > 0.0).all(axis=1)
        if lit.sum() >= LEAST_FRAMES:
            shares = [np.log(values / values.mean()) for values in (level[lit], rows["light"][lit, stick].mean(axis=1))]
            # The slope of the light there over the picture's is 1 for a lamp, and 0 for something that moves.
            if 2.0 * (shares[0] @ shares[1]) < shares[0] @ shares[0]:
                return None
            break
    again = _comes_again(level - level.mean())
    low, high = np.quantile(level, [0.05, 0.95])
    bright = level > 0.5 * (low + high)
    seen = rows["state"] == CODE["seen"]
    variance_px2 = [rows["covariance_px2"][seen & part[:, None]][:, [0, 2]].sum(axis=1) for part in (~bright, bright)]
    if again is None or not all(map(len, variance_px2)):
        return None
    dim_px, bright_px = (float(np.sqrt(np.mean(values))) for values in variance_px2)
    return Flicker(again, float(1.0 - low / high), dim_px / bright_px)


def _comes_again(level: Floats) -> int | None:
    """Return the period, in frames, of a brightness (n,) without its mean; None where it is not periodic."""
    n = len(level)
    size = 1 << (2 * n - 1).bit_length()
    product = np.fft.irfft(np.abs(np.fft.rfft(level, size)) ** 2, size)[: n // _TIMES + 2]
    if product[0] <= 0.0:
        return None
    alike = product / product[0] * n / (n - np.arange(len(product)))
    apart = np.flatnonzero(alike < 0.0)
    if not len(apart):
        return None
    lags = np.arange(apart[0], len(alike) - 1)
    peak = (alike[lags] > ALIKE) & (alike[lags] >= alike[lags - 1]) & (alike[lags] >= alike[lags + 1])
    return int(lags[peak][0]) if peak.any() else None
