"""Base dots that the moving stick half covers: so faint that the fit alone does not tell.

The base stands still, or the whole picture moves and both of its dots with it. One dot that goes where the other does
not, next to the moving stick, is seen in part: what shows of it has another middle.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from torsight.core.series import runs
from tracker.follow.judgement import BEYOND, to_strip
from tracker.rows import CODE

_FEWEST: Final = 50
"""Frames from which a place counts: its median is then known to a sixth of one frame's noise."""
_PLACES: Final = 4
"""Places of the camera in one film that are looked at, the most usual first."""
_NEAR: Final = 5.0
_FAR: Final = 15.0
_QUIET: Final = 2.0
"""Distances from the usual place, in standard deviations, of a dot that stays, is displaced, and is back again."""
_FAR_PX: Final = 0.4
"""Least distance that counts as far."""
_THERE_PX: Final = 3.0 * _FAR_PX
_TRIED: Final = 40
_SOME: Final = 4000
"""Stretches of a long film that are tried as the usual place, and frames by which they are compared."""
_WORSE: Final = 1.25
"""By how much the fit of a dot that is seen in part is worse than usual: residual over step."""
_BESIDE_RADII: Final = 4.0
"""How near the moving stick's line has to come to a dot that it covers."""
_RAYLEIGH: Final = math.sqrt(2.0 * math.log(2.0))
"""Median of a distance in the plane over its standard deviation along one axis: Rayleigh's distribution."""

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]


def cover_base(rows: NDArray[np.void], *, radius_px: float) -> None:
    """Mark base dots that the moving stick covers in part as shadowed, and take their positions away.

    Parameters
    ----------
    rows : (n,) structured
        Of the film, markers in the order of :data:`torsight.core.tracks.MARKERS`; changed in place.
    radius_px : float
        Of a dot.
    """
    covered = half_covered(rows, radius_px=radius_px)
    for marker in (0, 1):
        at = covered[:, marker]
        rows["state"][at, marker] = CODE["shadowed"]
        for name in ("position_px", "covariance_px2"):
            rows[name][at, marker] = np.nan
        for name in ("light", "step", "residual"):
            rows[name][at, marker] = 0.0


def half_covered(rows: NDArray[np.void], *, radius_px: float) -> Flags:
    """Return the frames in which each base dot is seen in part, (n, 2)."""
    covered = np.zeros((len(rows), 2), bool)
    left = (rows["state"][:, :2] == CODE["seen"]).all(axis=1)
    for _ in range(_PLACES):
        if left.sum() < _FEWEST:
            break
        away = _away(rows, left)
        near = away < _NEAR
        for marker in (0, 1):
            far = left & (away[:, marker] > _FAR) & near[:, 1 - marker]
            for begin, end in runs(left & (away[:, marker] > _QUIET)):
                run = np.arange(begin, end)[far[begin:end]]
                if len(run) and _looks_covered(rows, run, left & near.all(axis=1), marker, radius_px):
                    covered[begin:end, marker] = left[begin:end]
        left &= ~near.any(axis=1) & ~covered.any(axis=1)
    return covered


def _away(rows: NDArray[np.void], left: Flags) -> Floats:
    """Return how far both base dots are from their most usual places (n, 2), in standard deviations."""
    position = rows["position_px"][:, :2]
    distance = np.linalg.norm(position - _usual_place(position[left]), axis=2)
    there = left & (distance < _THERE_PX).all(axis=1)
    there = there if there.sum() >= _FEWEST else left
    fit_px2 = 0.5 * (rows["covariance_px2"][there, :2, 0] + rows["covariance_px2"][there, :2, 2])
    sigma_px = np.maximum(np.median(distance[there], axis=0) / _RAYLEIGH, np.sqrt(np.median(fit_px2, axis=0)))
    away: Floats = distance / np.maximum(sigma_px, _FAR_PX / _FAR)
    return np.nan_to_num(away)


def _usual_place(position: Floats) -> Floats:
    """Return where both dots (n, 2, 2) are most of the time (2, 2): a bump of the camera makes more than one place."""
    blocks = np.array_split(position, max(1, len(position) // _FEWEST))
    # A few of many: a long film does not have more places.
    places = [np.median(block, axis=0) for block in blocks[:: max(1, len(blocks) // _TRIED)]]
    some = position[:: max(1, len(position) // _SOME)]
    costs = [np.minimum(np.linalg.norm(some - place, axis=2), _FAR_PX).sum() for place in places]
    return np.asarray(places[int(np.argmin(costs))], dtype=np.float64)


def _looks_covered(rows: NDArray[np.void], run: NDArray[np.int64], usual: Flags, marker: int, radius_px: float) -> bool:
    """Return whether a dot fits worse than it usually does and the moving stick is beside it."""
    if not usual.any():
        return False
    share = rows["residual"][:, marker] / np.maximum(np.abs(rows["step"][:, marker]), 1.0)
    if np.median(share[run]) < _WORSE * np.median(share[usual]):
        return False
    places = rows["position_px"][run].tolist()
    beside = [to_strip(tuple(place[marker]), tuple(place[2]), tuple(place[3]), BEYOND) for place in places]
    return bool(np.min(beside) < _BESIDE_RADII * radius_px)
