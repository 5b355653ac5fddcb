"""What tags and texture have in common."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from tracker.appearance.lucas_kanade import Point
from tracker.patches.align import Fit
from tracker.patches.warps import Floats
from tracker.rows import SEEN

KEPT: Final = 0.7
"""Least share of a patch that has to be seen: what lies over the rest is then outvoted by far."""


def put(readings: NDArray[np.void], index: int, fit: Fit, at: Point, covariance: Floats, *, spread: float) -> None:
    """Put a fit into readings as that of a point of its template."""
    own = readings[index]
    own["x"], own["y"] = at
    own["covariance"] = covariance[0, 0], covariance[0, 1], covariance[1, 1]
    own["light"], own["contrast"], own["step"] = fit.light, fit.gain, fit.gain * 2.0 * spread
    own["residual"], own["state"] = fit.residual, SEEN
