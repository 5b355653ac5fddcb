"""Base dots that the moving stick half covers: so faint that the fit alone does not tell.

The base stands still, or the whole picture moves and both of its dots with it. One dot that goes where the other does
not, next to the moving stick, is seen in part: what shows of it has another middle.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from torsight.core.optics.hanging import USUAL_PX
from torsight.core.series import BY_CHANCE, runs
from torsight.core.units import Flags, Ints
from tracker.angle.length_noise import LEAST_FRAMES
from tracker.follow.judgement import BEYOND, to_strip
from tracker.rows import CODE

_QUIET: Final = 2.0
"""By how many standard deviations the base stick is off when a dot that was displaced is back."""
_WORSE: Final = 1.25
"""By how much the fit of a dot that is seen in part is worse than usual: residual over step."""
_BESIDE_RADII: Final = 4.0
"""How near the moving stick's line has to come to a dot that it covers."""
_RAYLEIGH: Final = math.sqrt(2.0 * math.log(2.0))
"""Median of a distance in the plane over its standard deviation along one axis (Rayleigh's distribution)."""


def cover_base(rows: NDArray[np.void], *, radius_px: float) -> None:
    """Mark base dots that the moving stick covers in part as shadowed, and take their positions away.

    ``rows`` are of the film, markers in the order of :data:`torsight.core.tracks.MARKERS`, and changed in place.
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
    """Return the frames in which each base dot is seen in part, (n, 2).

    The line from one dot to the other is the same wherever the camera points. A camera that is rolled makes a second
    usual line, for those frames that are far from the first.
    """
    covered = np.zeros((len(rows), 2), bool)
    left = (rows["state"][:, :2] == CODE["seen"]).all(axis=1)
    offset = rows["position_px"][:, 1] - rows["position_px"][:, 0]
    while left.sum() >= LEAST_FRAMES:
        away_px = np.linalg.norm(offset - np.median(offset[left], axis=0), axis=1)
        fit_px2 = float(np.median(rows["covariance_px2"][left][:, :2, [0, 2]].sum(axis=1)))
        usual = left & (away_px < np.median(away_px[left]))
        sigma_px = max(float(np.median(away_px[left])) / _RAYLEIGH, math.sqrt(fit_px2), math.sqrt(2.0) * USUAL_PX)
        for begin, end in runs(left & (away_px > _QUIET * sigma_px)):
            run = np.arange(begin, end)[away_px[begin:end] > BY_CHANCE * sigma_px]
            for marker in (0, 1):
                if len(run) and _looks_covered(rows, run, usual, marker, radius_px):
                    covered[begin:end, marker] = True
        left &= (away_px > BY_CHANCE * sigma_px) & ~covered.any(axis=1)
    return covered


def _looks_covered(rows: NDArray[np.void], run: Ints, usual: Flags, marker: int, radius_px: float) -> bool:
    """Return whether a dot fits worse than it usually does and the moving stick is beside it."""
    share = rows["residual"][:, marker] / np.maximum(np.abs(rows["step"][:, marker]), 1.0)
    if np.median(share[run]) < _WORSE * np.median(share[usual]):
        return False
    places = rows["position_px"][run].tolist()
    beside = [to_strip(tuple(place[marker]), tuple(place[2]), tuple(place[3]), BEYOND) for place in places]
    return bool(np.min(beside) < _BESIDE_RADII * radius_px)
