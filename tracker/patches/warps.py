"""Warps: 3 × 3 matrices that map a template into a picture; functions that are called often are compiled."""

from __future__ import annotations

import math

import numpy as np

from torsight.core.compiled import compiled
from torsight.core.units import Floats

Point = tuple[float, float]


@compiled
def place(warp: Floats, at: Point = (0.0, 0.0)) -> Point:
    """Return the position in the picture of a point of the template, px."""
    z = warp[2, 0] * at[0] + warp[2, 1] * at[1] + warp[2, 2]
    z = z if z != 0.0 else math.nan
    x = warp[0, 0] * at[0] + warp[0, 1] * at[1] + warp[0, 2]
    return x / z, (warp[1, 0] * at[0] + warp[1, 1] * at[1] + warp[1, 2]) / z


@compiled
def project(warp: Floats, points: Floats) -> Floats:
    """Return the positions (2, n) in the picture of points (2, n) of the template."""
    out = np.empty((2, points.shape[1]))
    for i in range(points.shape[1]):
        out[0, i], out[1, i] = place(warp, (points[0, i], points[1, i]))
    return out


@compiled
def jacobian(warp: Floats, at: Point = (0.0, 0.0)) -> Floats:
    """Return the derivative (2, 2) of the warp at a point of the template."""
    seen = place(warp, at)
    z = warp[2, 0] * at[0] + warp[2, 1] * at[1] + warp[2, 2]
    out = np.empty((2, 2))
    for i in range(2):
        for j in range(2):
            out[i, j] = (warp[i, j] - seen[i] * warp[2, j]) / z
    return out


@compiled
def turn_of(warp: Floats) -> float:
    """Return the rotation of the template at its middle, rad, y down."""
    j = jacobian(warp)
    return math.atan2(j[1, 0] - j[0, 1], j[0, 0] + j[1, 1])


@compiled
def size_of(warp: Floats) -> float:
    """Return the magnification of the template at its middle."""
    j = jacobian(warp)
    return math.sqrt(abs(j[0, 0] * j[1, 1] - j[0, 1] * j[1, 0]))


@compiled
def flatness_of(warp: Floats) -> float:
    """Return the ratio of the shorter to the longer axis of the image of a small circle at the template's middle."""
    j = jacobian(warp)
    # Singular values of a 2 × 2 matrix, from its rotating and its reflecting part.
    turn, mirror = math.hypot(j[0, 0] + j[1, 1], j[1, 0] - j[0, 1]), math.hypot(j[0, 0] - j[1, 1], j[1, 0] + j[0, 1])
    return abs(turn - mirror) / (turn + mirror) if turn + mirror > 0.0 else 0.0


def similarity(x_px: float, y_px: float, *, turn_rad: float = 0.0, scale: float = 1.0) -> Floats:
    """Return the warp of a patch that is rotated, scaled, and shifted to a position."""
    cos, sin = scale * math.cos(turn_rad), scale * math.sin(turn_rad)
    return np.array([[cos, -sin, x_px], [sin, cos, y_px], [0.0, 0.0, 1.0]])
