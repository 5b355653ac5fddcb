"""The stick's direction from one marker alone, while something lies over the other.

Markers go around the axis: p = c + R(ψ) q. Axis and arms are found from the frames in which both markers are seen;
then one marker and the axis tell the direction ψ. What is not known of axis and arms, and how far both ways differ
where both can be had, is in the variance. A base stick that moves in the picture shows by how much the camera was
moved.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Points = tuple[Floats, Floats]

_FEWEST: Final = 20
_WORST_RAD: Final = np.deg2rad(1.0)
"""Error above which the direction counts as not known."""
_PARTS: Final = 6
"""Steps of direction that have to be seen: over less, noise bends the circle."""
_STEP_RAD: Final = np.deg2rad(2.0)
"""Frames closer to each other than this tell the same of the axis."""


@dataclass(frozen=True, slots=True, eq=False)
class Lone:
    """Directions from one marker alone.

    Attributes
    ----------
    angle_rad, variance_rad2 : (n,) float64
        Where only one marker is seen and it tells the direction; NaN elsewhere.
    """

    angle_rad: Floats
    variance_rad2: Floats


def lone_direction(base: tuple[Points, Points], moving: tuple[Points, Points], pair_rad: Floats) -> Lone:
    """Return the direction of the stick in frames in which one of its markers is seen.

    Parameters
    ----------
    base, moving : two of (n, 2) and (n, 2, 2) float64
        Positions of inner and outer marker in a plane, NaN where not seen, and covariances.
    pair_rad : (n,) float64
        Direction from both markers; NaN where it is not known.
    """
    n = len(pair_rad)
    nothing = Lone(np.full(n, np.nan), np.full(n, np.nan))
    seen = [np.isfinite(points[:, 0]) for points, _ in moving]
    alone = [seen[0] & ~seen[1], seen[1] & ~seen[0]]
    both = np.flatnonzero(np.isfinite(pair_rad))
    if not (alone[0].any() or alone[1].any()) or len(both) < _FEWEST:
        return nothing
    shift, shift_variance = _camera_shift(base)
    places = [points - shift for points, _ in moving]
    fitted = _axis_and_arms(places, pair_rad, _spread_out(pair_rad, both))
    if fitted is None:
        return nothing
    values, covariance = fitted
    angle, variance = nothing.angle_rad, nothing.variance_rad2
    for marker in (0, 1):
        direction, spread = _from_one(places[marker], moving[marker][1], shift_variance, values, covariance, marker)
        differs = np.angle(np.exp(1j * (direction[both] - pair_rad[both])))
        spread = np.maximum(spread, np.nanmean(differs**2))
        use = alone[marker] & (spread < _WORST_RAD**2)
        angle[use], variance[use] = direction[use], spread[use]
    return Lone(angle, variance)


def _camera_shift(base: tuple[Points, Points]) -> tuple[Floats, Floats]:
    """Return how far the base stick is from its usual place in every frame, and the variance of that."""
    away = []
    for points, _ in base:
        with np.errstate(invalid="ignore"):
            middle = np.nanmedian(points, axis=0) if np.isfinite(points).any() else np.zeros(2)
        away.append(points - middle)
    stacked = np.stack(away)
    known = np.isfinite(stacked[..., 0])
    count = known.sum(axis=0)
    shift = np.where(known[..., None], stacked, 0.0).sum(axis=0) / np.maximum(count, 1)[:, None]
    usual = float(np.mean(np.sum(shift[count > 0] ** 2, axis=1))) if (count > 0).any() else 0.0
    return shift, np.where(count > 0, 0.0, usual)


def _spread_out(pair_rad: Floats, both: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return frames that do not all stand at one place of the circle."""
    bins = np.floor(pair_rad[both] / _STEP_RAD).astype(np.int64)
    order = np.argsort(bins, kind="stable")
    rank = np.arange(len(both)) - np.searchsorted(bins[order], bins[order])
    return np.sort(both[order[rank < 8]])


def _axis_and_arms(places: list[Floats], pair_rad: Floats, rows: NDArray[np.int64]) -> tuple[Floats, Floats] | None:
    """Return axis and both arms, (6,), and their covariance from the misfit."""
    cos, sin = np.cos(pair_rad[rows]), np.sin(pair_rad[rows])
    columns = np.zeros((2, 2, len(rows), 6))
    for marker in (0, 1):
        at = 2 + 2 * marker
        columns[marker, 0, :, 0] = columns[marker, 1, :, 1] = 1.0
        columns[marker, 0, :, at], columns[marker, 0, :, at + 1] = cos, -sin
        columns[marker, 1, :, at], columns[marker, 1, :, at + 1] = sin, cos
    right = np.stack([np.stack([places[m][rows, a] for a in (0, 1)]) for m in (0, 1)])
    matrix, target = columns.reshape(-1, 6), right.reshape(-1)
    parts = len(np.unique(np.floor(pair_rad[rows] / _STEP_RAD)))
    if len(target) < _FEWEST or parts < _PARTS or np.linalg.cond(matrix) > 1e4:
        return None
    values = np.linalg.lstsq(matrix, target, rcond=None)[0]
    left = target - matrix @ values
    covariance = np.linalg.inv(matrix.T @ matrix) * float(left @ left) / (len(target) - 6)
    # The misfit of a tilted circle hangs together over many frames: it does not average out as noise does.
    return np.asarray(values), np.asarray(covariance * 4.0)


def _from_one(
    place: Floats, spread: Floats, shift_variance: Floats, values: Floats, covariance: Floats, marker: int
) -> tuple[Floats, Floats]:
    """Return the stick's direction from one marker, and its variance."""
    at = 2 + 2 * marker
    arm = values[at : at + 2]
    away = place - values[:2]
    square = np.sum(away**2, axis=1)
    direction = np.arctan2(away[:, 1], away[:, 0]) - np.arctan2(arm[1], arm[0])
    across = np.stack([-away[:, 1], away[:, 0]], axis=1) / square[:, None]
    own = np.einsum("ni,nij,nj->n", across, spread, across) + shift_variance / square
    slopes = np.zeros((len(place), 6))
    slopes[:, :2] = -across
    slopes[:, at : at + 2] = -np.array([-arm[1], arm[0]]) / (arm @ arm)
    return direction, own + np.einsum("ni,ij,nj->n", slopes, covariance, slopes)
