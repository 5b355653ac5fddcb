"""The stick's direction from one marker alone, while the other is occluded.

Markers go around the axis: p = c + R(ψ) q. Axis c and arms q are fitted to the frames in which both markers are seen;
then one marker and the axis determine the direction ψ. Its variance includes the uncertainty of axis and arms, and is
at least the mean square difference to the direction from both markers where both are seen.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from torsight.core.optics.hanging import direction_bins, spread_rows
from torsight.core.units import Floats
from tracker.angle.length_noise import LEAST_FRAMES
from tracker.angle.row_time import Complex, circles
from tracker.stick_direction import Points

_WORST_RAD: Final = np.deg2rad(1.0)
"""Standard deviation above which the direction counts as not known."""
_PARTS: Final = 6
"""Fewest bins of direction that have to be seen: over a shorter arc noise determines the circle's curvature."""


def single_marker_direction(moving: tuple[Points, Points], pair_rad: Floats) -> tuple[Floats, Floats]:
    """Return the stick's direction (n,) where one marker alone is seen and determines it, and its variance; else NaN.

    ``moving`` are positions (n, 2) and covariances of inner and outer marker in a plane, with the camera's motion
    removed, NaN where not seen; ``pair_rad`` (n,) is the direction from both markers.
    """
    n = len(pair_rad)
    angle, variance = np.full(n, np.nan), np.full(n, np.nan)
    seen = [np.isfinite(points[:, 0]) for points, _ in moving]
    alone = [seen[0] & ~seen[1], seen[1] & ~seen[0]]
    both = np.flatnonzero(np.isfinite(pair_rad))
    if not (alone[0].any() or alone[1].any()) or len(both) < LEAST_FRAMES:
        return angle, variance
    places = [points for points, _ in moving]
    fitted = _axis_and_arms(places, pair_rad, spread_rows(pair_rad, np.isfinite(pair_rad)))
    if fitted is None:
        return angle, variance
    values, covariance = fitted
    for marker in (0, 1):
        direction, spread = _from_one(places[marker], moving[marker][1], values, covariance, marker)
        differs = np.angle(np.exp(1j * (direction[both] - pair_rad[both])))
        spread = np.maximum(spread, np.nanmean(differs**2))
        use = alone[marker] & (spread < _WORST_RAD**2)
        angle[use], variance[use] = direction[use], spread[use]
    return angle, variance


def _axis_and_arms(places: list[Floats], pair_rad: Floats, rows: NDArray[np.intp]) -> tuple[Complex, Complex] | None:
    """Return axis and both arms (3,), and their covariance (3, 3) from the residuals; None where the arc is short."""
    points, turn = np.stack(places, axis=1)[rows], pair_rad[rows]
    if len(np.unique(direction_bins(turn))) < _PARTS:
        return None
    values, normal = circles(points, turn)
    place: Complex = points[..., 0] + 1j * points[..., 1]
    left = place - (values[0] + np.outer(np.exp(1j * turn), values[1:]))
    mean_square = float(np.sum(np.abs(left) ** 2)) / (4 * len(rows) - 2 * len(values))
    # The residuals of a tilted circle are correlated over some four frames, and average out that much less than noise.
    return values, np.asarray(4.0 * mean_square * np.linalg.inv(normal))


def _from_one(
    place: Floats, spread: Floats, values: Complex, covariance: Complex, marker: int
) -> tuple[Floats, Floats]:
    """Return the stick's direction from one marker, and its variance."""
    away, arm = place[:, 0] + 1j * place[:, 1] - values[0], values[1 + marker]
    direction = np.angle(away * np.conj(arm))
    across = np.stack([-away.imag, away.real], axis=1) / (np.abs(away) ** 2)[:, None]
    own = np.einsum("ni,nij,nj->n", across, spread, across)
    # The imaginary parts of these, times the errors of the values, are the errors of the direction.
    slopes = np.zeros((len(place), 3), np.complex128)
    slopes[:, 0], slopes[:, 1 + marker] = -across[:, 1] - 1j * across[:, 0], -1.0 / arm
    return direction, own + np.einsum("ni,ij,nj->n", slopes, covariance, np.conj(slopes)).real
