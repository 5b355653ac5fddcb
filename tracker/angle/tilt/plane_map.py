"""Map from the picture to the plane of motion: a homography after the lens's radial distortion."""

from __future__ import annotations

import numpy as np

from torsight.core.units import Floats


def rectify(points: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Return points (..., 2) as seen along the axis, up to a rotation and a scale, and the derivatives (..., 2, 2)."""
    flat, slopes = mapped(points[..., 0], points[..., 1], values)
    return np.stack(flat, axis=-1), np.stack(slopes, axis=-1).reshape(*points.shape, 2)


def mapped(x: Floats, y: Floats, values: Floats) -> tuple[tuple[Floats, Floats], tuple[Floats, ...]]:
    """Return the mapped x and y, and the derivatives of the new x by x and y, and of the new y by x and y."""
    e1, e2, l1, l2, k = values[:5].tolist()
    bend = 1.0 + k * (x * x + y * y)
    u, v = x * bend, y * bend
    deep = 1.0 / (1.0 + l1 * u + l2 * v)
    flat_x, flat_y = ((1.0 + e1) * u + e2 * v) * deep, (e2 * u + (1.0 - e1) * v) * deep
    x_u, y_u = (1.0 + e1 - l1 * flat_x) * deep, (e2 - l1 * flat_y) * deep
    x_v, y_v = (e2 - l2 * flat_x) * deep, (1.0 - e1 - l2 * flat_y) * deep
    u_x, both, v_y = bend + 2.0 * k * x * x, 2.0 * k * x * y, bend + 2.0 * k * y * y
    slopes = (x_u * u_x + x_v * both, x_u * both + x_v * v_y, y_u * u_x + y_v * both, y_u * both + y_v * v_y)
    return (flat_x, flat_y), slopes
