"""Where the axis is in the picture, by the moving markers' circles, and which end of each stick is nearer to it."""

from __future__ import annotations

from typing import Final

import numpy as np

from torsight.core.tracks import MarkerTracks
from torsight.core.units import Flags, Floats
from tracker.angle.plane import stick_direction
from tracker.angle.row_time import circles
from tracker.innovation import SIGMAS

_ARC_RAD: Final = np.deg2rad(20.0)
"""Turn of the moving stick from which its markers' circles tell where the axis is."""
_LEAST: Final = 5
"""Frames with both moving markers: three unknowns of two coordinates each, and what is left to tell the misfit."""


def axis_px(tracks: MarkerTracks) -> Floats | None:
    """Return the common centre (2,) of both moving markers' circles; None where they turn too little."""
    turn, _ = direction_of(tracks, 2)
    seen = np.isfinite(turn)
    if seen.sum() < _LEAST:
        return None
    unit = np.exp(1j * turn[seen])
    if np.ptp(np.angle(unit / unit[0])) < _ARC_RAD:
        return None
    return _centre(tracks, turn, seen)[0]


def away_px(tracks: MarkerTracks, axis: Floats) -> Floats:
    """Return each marker's usual distance (4,) from an axis; NaN of one that is never seen."""
    points = np.where(tracks.valid[..., None], tracks.position_px, np.nan)
    away = np.hypot(*np.moveaxis(points - axis, -1, 0))
    return np.array([np.median(one[np.isfinite(one)]) if np.isfinite(one).any() else np.nan for one in away.T])


def turned_round(tracks: MarkerTracks) -> tuple[bool, bool]:
    """Return of base and moving stick whether its inner marker is further from the axis than its outer one.

    False where the circles leave that open: by their misfit, which is correlated over a film and counts once.
    """
    turn, _ = direction_of(tracks, 2)
    seen = np.isfinite(turn)
    if seen.sum() < _LEAST:
        return False, False
    axis, sigma_px = _centre(tracks, turn, seen)
    away = away_px(tracks, axis)
    base, moving = (away[::2] - away[1::2] > SIGMAS * sigma_px).tolist()
    return base, moving


def direction_of(tracks: MarkerTracks, first: int) -> tuple[Floats, Floats]:
    """Return a stick's direction in the picture (n,), y down, and its variance; NaN where a marker is not valid."""
    places = np.where(tracks.valid[..., None], tracks.position_px, np.nan)
    inner, outer = ((places[:, marker], tracks.covariance_px2[:, marker]) for marker in (first, first + 1))
    return stick_direction(inner, outer)


def _centre(tracks: MarkerTracks, turn_rad: Floats, seen: Flags) -> tuple[Floats, float]:
    """Return the centre (2,) of the moving markers' circles, and its standard deviation along each axis, px."""
    points, unit = tracks.position_px[seen, 2:], np.exp(1j * turn_rad[seen])
    (centre, *arms), _ = circles(points, turn_rad[seen])
    left = points[..., 0] + 1j * points[..., 1] - centre - np.outer(unit, arms)
    # What is left of the normal equations once the arms are eliminated; all frames and both markers count once.
    weight = 1.0 - abs(unit.mean()) ** 2
    variance_px2 = 0.25 * float(np.mean(np.sum(np.abs(left) ** 2, axis=1))) / max(weight, 1e-12)
    return np.array([centre.real, centre.imag]), float(np.sqrt(variance_px2))
