"""Warps: 3 × 3 matrices that map a template into a picture."""

from __future__ import annotations

import math

import numpy as np

from torsight.core.units import Floats

Point = tuple[float, float]


def place(warp: Floats, at: Point = (0.0, 0.0)) -> Point:
    """Return the position in the picture of a point of the template, px."""
    x, y, z = (warp @ (at[0], at[1], 1.0)).tolist()
    return (x / z, y / z) if z else (math.nan, math.nan)


def project(warp: Floats, points: Floats) -> Floats:
    """Return the positions (2, n) in the picture of points (2, n) of the template."""
    seen = warp[:, :2] @ points + warp[:, 2:]
    return np.asarray(seen[:2] / np.where(seen[2] == 0.0, np.nan, seen[2]))


def jacobian(warp: Floats, at: Point = (0.0, 0.0)) -> Floats:
    """Return the derivative (2, 2) of the warp at a point of the template."""
    return np.asarray((warp[:2, :2] - np.outer(place(warp, at), warp[2, :2])) / (warp[2] @ (at[0], at[1], 1.0)))


def turn_of(warp: Floats) -> float:
    """Return the rotation of the template at its middle, rad, y down."""
    j = jacobian(warp)
    return math.atan2(j[1, 0] - j[0, 1], j[0, 0] + j[1, 1])


def twist(before: Floats, after: Floats) -> Floats:
    """Return the motion (3, 3) of the template's plane between two warps: the logarithm of the warp between them.

    To second order in the rotation: at 15 degrees it is 0.6 % too small, which :func:`carried` undoes.
    """
    step = np.linalg.solve(before, after)
    step /= np.cbrt(np.linalg.det(step))
    return np.asarray(2.0 * np.linalg.solve(step + np.eye(3), step - np.eye(3)))


def carried(motion: Floats) -> Floats:
    """Return the warps (..., 3, 3) of the template's plane by motions (..., 3, 3)."""
    return np.asarray(np.linalg.solve(np.eye(3) - 0.5 * motion, np.eye(3) + 0.5 * motion))


def size_of(warp: Floats) -> float:
    """Return the magnification of the template at its middle."""
    return math.sqrt(abs(float(np.linalg.det(jacobian(warp)))))


def flatness_of(warp: Floats) -> float:
    """Return the ratio of the shorter to the longer axis of the image of a small circle at the template's middle."""
    longer, shorter = np.linalg.svd(jacobian(warp), compute_uv=False).tolist()
    return shorter / longer if longer > 0.0 else 0.0


def similarity(x_px: float, y_px: float, *, turn_rad: float = 0.0, scale: float = 1.0) -> Floats:
    """Return the warp of a patch that is rotated, scaled, and shifted to a position."""
    cos, sin = scale * math.cos(turn_rad), scale * math.sin(turn_rad)
    return np.array([[cos, -sin, x_px], [sin, cos, y_px], [0.0, 0.0, 1.0]])
