"""The axis' position in the picture, from the moving markers' circles, and which end of each stick is nearer to it."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from torsight.core.series import known_median
from torsight.core.tracks import MarkerTracks
from torsight.core.units import Flags, Floats
from tracker.angle.plane import FLOOR_PX
from tracker.angle.row_time import circles
from tracker.stick_direction import stick_direction

_ARC_RAD: Final = np.deg2rad(20.0)
"""Smallest turn of the moving stick over which its markers' circles determine the axis."""
_LEAST: Final = 5
"""Fewest frames with both moving markers: three unknown points of two coordinates each, and degrees of freedom that
remain for the residuals."""


def axis_px(tracks: MarkerTracks) -> Floats | None:
    """Return the common centre (2,) of both moving markers' circles; None where they turn too little."""
    turn, _ = direction_of(tracks, 2)
    seen = np.isfinite(turn)
    if seen.sum() < _LEAST:
        return None
    unit = np.exp(1j * turn[seen])
    if np.ptp(np.angle(unit / unit[0])) < _ARC_RAD:
        return None
    return _centre(tracks, turn, seen, 0.0)[0]


def away_px(tracks: MarkerTracks, axis: Floats) -> Floats:
    """Return each marker's median distance (4,) from an axis; NaN for a marker that is never seen."""
    points = np.where(tracks.valid[..., None], tracks.position_px, np.nan)
    away = np.hypot(*np.moveaxis(points - axis, -1, 0))
    return np.array([known_median(one) for one in away.T])


def turned_round(tracks: MarkerTracks, *, radius_px: float) -> Floats:
    """Return the probability, for base and moving stick (2,), that the inner marker is the one further from the axis.

    The axis is estimated from the circles and from the lines of both sticks: a stick points at the axis, and its
    markers, ``radius_px`` in size, lie on its centre line to within about that radius. The residuals of the circles are
    correlated over a film, so together they count as one measurement.
    """
    turn, turn_rad2 = direction_of(tracks, 2)
    seen, base = np.isfinite(turn), tracks.valid[:, :2].all(axis=1)
    if not seen.any() or not base.any():
        return np.zeros(2)
    centre, sigma_px = _centre(tracks, turn, seen, float(np.median(turn_rad2[seen])))
    # The error is not below the floor set by the pixels, and the axis no further away than the picture's diagonal.
    sigma_px = float(np.clip(sigma_px if seen.sum() >= _LEAST else np.inf, FLOOR_PX, math.hypot(*tracks.size_px)))
    ends = np.stack([np.median(tracks.position_px[base, :2], axis=0), tracks.position_px[np.argmax(seen), 2:]])
    middle, along = ends.mean(axis=1), np.diff(ends, axis=1)[:, 0]
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    across = along @ np.array([[0.0, 1.0], [-1.0, 0.0]])
    # Each stick's line is one measurement of the axis' position, perpendicular to the line (as an inverse covariance).
    weight = across[:, :, None] * across[:, None, :] / radius_px**2
    inverse = np.linalg.inv(np.eye(2) / sigma_px**2 + weight.sum(axis=0))
    centre = inverse @ (centre / sigma_px**2 + np.einsum("sij,sj->i", weight, middle))
    outwards = np.einsum("si,si->s", centre - middle, along)
    sigma = np.sqrt(np.einsum("si,ij,sj->s", along, inverse, along))
    return np.array([0.5 * math.erfc(-sigmas / math.sqrt(2.0)) for sigmas in outwards / sigma])


def direction_of(tracks: MarkerTracks, first: int) -> tuple[Floats, Floats]:
    """Return a stick's direction in the picture (n,), y down, and its variance (n,); NaN where a marker is not valid.

    ``first`` is the index of the stick's inner marker.
    """
    places = np.where(tracks.valid[..., None], tracks.position_px, np.nan)
    inner, outer = ((places[:, marker], tracks.covariance_px2[:, marker]) for marker in (first, first + 1))
    return stick_direction(inner, outer)


def _centre(tracks: MarkerTracks, turn_rad: Floats, seen: Flags, turn_rad2: float) -> tuple[Floats, float]:
    """Return the centre (2,) of the moving markers' circles, and the standard deviation of its x and of its y, px.

    ``turn_rad2`` is the median variance of the directions ``turn_rad`` (n,). Errors of the directions turn the stick
    about its own middle, and bias the centre towards it, by the ratio of that variance to the directions' scatter.
    """
    points, unit = tracks.position_px[seen, 2:], np.exp(1j * turn_rad[seen])
    (centre, *arms), _ = circles(points, turn_rad[seen])
    left = points[..., 0] + 1j * points[..., 1] - centre - np.outer(unit, arms)
    # The centre's element of the normal matrix after eliminating the arms, per frame and marker, not times their
    # number: the residuals are correlated over the film.
    weight = 1.0 - abs(unit.mean()) ** 2
    variance_px2 = 0.25 * float(np.mean(np.sum(np.abs(left) ** 2, axis=1))) / max(weight, 1e-12)
    drawn_px = 0.5 * abs(sum(arms)) * turn_rad2 / max(weight - turn_rad2, 1e-12)
    return np.array([centre.real, centre.imag]), float(np.hypot(np.sqrt(variance_px2), drawn_px))
