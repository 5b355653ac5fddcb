"""Warps: 3 × 3 matrices that put a template into a picture."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def project(warp: Floats, points: Floats) -> Floats:
    """Return where points (3, n), x, y and 1 each, lie in the picture (2, n)."""
    seen = warp @ points
    return np.asarray(seen[:2] / seen[2], dtype=np.float64)


def place(warp: Floats, at: tuple[float, float] = (0.0, 0.0)) -> tuple[float, float]:
    """Return where a point of the template lies in the picture."""
    x, y, z = (warp @ np.array([at[0], at[1], 1.0])).tolist()
    return x / z, y / z


def jacobian(warp: Floats, at: tuple[float, float] = (0.0, 0.0)) -> Floats:
    """Return the derivative (2, 2) of the warp at a point of the template."""
    x, y = place(warp, at)
    z = float(warp[2] @ np.array([at[0], at[1], 1.0]))
    return np.asarray((warp[:2, :2] - np.outer([x, y], warp[2, :2])) / z, dtype=np.float64)


def turn_of(warp: Floats) -> float:
    """Return by how much the template is turned at its middle, rad, y down."""
    (a, b), (c, d) = jacobian(warp).tolist()
    return math.atan2(c - b, a + d)


def size_of(warp: Floats) -> float:
    """Return by how much the template is enlarged at its middle."""
    return math.sqrt(abs(float(np.linalg.det(jacobian(warp)))))


def flatness_of(warp: Floats) -> float:
    """Return the shorter over the longer axis of what a circle around the template's middle looks like."""
    long, short = np.linalg.svd(jacobian(warp), compute_uv=False).tolist()
    return short / long if long > 0.0 else 0.0


def similarity(x_px: float, y_px: float, *, turn_rad: float = 0.0, scale: float = 1.0) -> Floats:
    """Return the warp of a patch that is turned, scaled, and put at a place."""
    cos, sin = scale * math.cos(turn_rad), scale * math.sin(turn_rad)
    return np.array([[cos, -sin, x_px], [sin, cos, y_px], [0.0, 0.0, 1.0]])
