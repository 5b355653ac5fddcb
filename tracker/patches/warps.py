"""Warps: 3 × 3 matrices that map a template into a picture (compiled: numpy takes ten times as long for one)."""

from __future__ import annotations

import math

import numpy as np

from torsight.core.compiled import compiled, shared
from torsight.core.units import Floats

Point = tuple[float, float]


@shared
def place(warp: Floats, at: Point = (0.0, 0.0)) -> Point:
    """Return the position in the picture of a point of the template, px."""
    x, y = at
    z = warp[2, 0] * x + warp[2, 1] * y + warp[2, 2]
    if z == 0.0:
        return math.nan, math.nan
    return (warp[0, 0] * x + warp[0, 1] * y + warp[0, 2]) / z, (warp[1, 0] * x + warp[1, 1] * y + warp[1, 2]) / z


@compiled
def project(warp: Floats, points: Floats) -> Floats:
    """Return the positions (2, n) in the picture of points (2, n) of the template."""
    seen = np.empty((2, points.shape[1]))
    for i in range(points.shape[1]):
        seen[0, i], seen[1, i] = place(warp, (points[0, i], points[1, i]))
    return seen


@compiled
def jacobian(warp: Floats, at: Point = (0.0, 0.0)) -> Floats:
    """Return the derivative (2, 2) of the warp at a point of the template."""
    found, seen = np.empty((2, 2)), place(warp, at)
    z = warp[2, 0] * at[0] + warp[2, 1] * at[1] + warp[2, 2]
    for i in range(2):
        for k in range(2):
            found[i, k] = (warp[i, k] - seen[i] * warp[2, k]) / z
    return found


@compiled
def turn_of(warp: Floats) -> float:
    """Return the rotation of the template at its middle, rad, y down."""
    j = jacobian(warp, (0.0, 0.0))
    return math.atan2(j[1, 0] - j[0, 1], j[0, 0] + j[1, 1])


@shared
def determinant(matrix: Floats) -> float:
    """Return the determinant of a matrix (3, 3)."""
    size: float = 0.0
    for k in range(3):
        a, b = (k + 1) % 3, (k + 2) % 3
        size += matrix[0, k] * (matrix[1, a] * matrix[2, b] - matrix[1, b] * matrix[2, a])
    return size


@compiled
def solved(left: Floats, right: Floats) -> Floats:
    """Return X (3, 3) of ``left`` X = ``right`` by Cramer's rule; NaN or infinite without a solution."""
    found, size = np.zeros((3, 3)), determinant(left)
    for i in range(3):
        a, b = (i + 1) % 3, (i + 2) % 3
        for m in range(3):
            c, d = (m + 1) % 3, (m + 2) % 3
            cofactor = (left[c, a] * left[d, b] - left[c, b] * left[d, a]) / size
            for k in range(3):
                found[i, k] += cofactor * right[m, k]
    return found


@compiled
def before_step(warp: Floats, step: Floats) -> Floats:
    """Return W (1 + δ)⁻¹, with 1 as its last element, of a warp W and the derivative δ (3, 3) of a step."""
    # The transposed equation: (1 + δ)ᵀ Xᵀ = Wᵀ.
    found = solved((np.eye(3) + step).T, warp.T).T
    found /= found[2, 2]
    return found


@compiled
def twist(before: Floats, after: Floats) -> Floats:
    """Return the motion (3, 3) of the template's plane between two warps: the logarithm of the warp between them.

    To second order in the rotation: at 15 degrees it is 0.6 % too small, which :func:`carried` undoes.
    """
    step, one = solved(before, after), np.eye(3)
    step /= np.cbrt(determinant(step))
    return 2.0 * solved(step + one, step - one)


@compiled
def carried(motion: Floats) -> Floats:
    """Return the warp (3, 3) of the template's plane by a motion (3, 3)."""
    one = np.eye(3)
    return solved(one - 0.5 * motion, one + 0.5 * motion)


@compiled
def size_of(warp: Floats) -> float:
    """Return the magnification of the template at its middle."""
    j = jacobian(warp, (0.0, 0.0))
    return math.sqrt(abs(j[0, 0] * j[1, 1] - j[0, 1] * j[1, 0]))


@compiled
def flatness_of(warp: Floats) -> float:
    """Return the ratio of the shorter to the longer axis of the image of a small circle at the template's middle."""
    j = jacobian(warp, (0.0, 0.0))
    # A rotation with a magnification, and a reflection with one: the axes are their sum and their difference.
    turned = math.hypot(j[0, 0] + j[1, 1], j[1, 0] - j[0, 1])
    mirrored = math.hypot(j[0, 0] - j[1, 1], j[1, 0] + j[0, 1])
    return abs(turned - mirrored) / (turned + mirrored) if turned + mirrored > 0.0 else 0.0


def similarity(x_px: float, y_px: float, *, turn_rad: float = 0.0) -> Floats:
    """Return the warp of a patch that is rotated, and shifted to a position."""
    cos, sin = math.cos(turn_rad), math.sin(turn_rad)
    return np.array([[cos, -sin, x_px], [sin, cos, y_px], [0.0, 0.0, 1.0]])
