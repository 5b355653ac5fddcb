"""The picture of a round dot, D, and of its derivatives, pixel by pixel (compiled).

A pixel sums up the light over its square, which is not the same as a wider blur: taken at its middle alone, a sharp rim
would shift the dot by up to 0.015 px, depending on how it lies on the pixels. Near the rim the mean over the square is
taken at Gauss–Legendre points. ``pixels`` (3, n) int64 are a window's offsets x and y from its middle, and the sector.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from torsight.core.compiled import compiled, lending, shared
from torsight.core.units import Floats, Ints

Record = Any
"""A record of one of the structured types; numba knows its fields."""

SHAPE: Final = np.dtype(
    [
        ("radius", "f8"),
        ("edge", "f8"),
        ("stretch", "f8", (2,)),
        ("contrast", "f8"),
        ("strip", "f8"),
        ("edges", "f8", (2,)),
        ("across", "f8", (2,)),
        ("window", "f8"),
    ]
)
"""Shape of a dot, px: radius of the circle of the same area; standard deviation of the blur of its edge; relative
lengthening along x (and shortening along y), and along the diagonal; brightness inside over that outside, less 1; half
the width of the stick that carries it; how far from its centre that stick's edges are, on one side and on the other,
infinite where one is not seen; a direction in the picture towards the first of them, as the stick lies now; radius of
the window in which it is compared."""

MOST_STRETCH: Final = 0.45
"""Stretch up to which it is a dot's: that of a plane seen from 67 degrees aside."""
SECTORS: Final = 8
"""Parts of a window over which residuals are averaged: a wire over a dot fills most of one or two."""
COLUMNS: Final = 7
"""Unknowns of a dot that is not smeared: light, step, place (2), radius, stretch (2)."""

_STEP_1, _STEP_3 = 1.5976, 0.07056
"""The falling normal step 1 − Φ(z) as a logistic curve with a cubic term, to 2e-4 (Bowling and
others, J. Ind. Eng. Manag. 2, 2009, p. 114)."""
_RIM_PX, _RIM = 0.75, 4.0
"""How far from the rim D still changes: half a pixel's diagonal, and this many widths of the edge."""
_SHARP_PX: Final = 0.35
"""Edge below which the mean over a pixel needs the finer set of points; from it on that of a smeared dot is taken as
from ``_SOFT_PX``: smears are rounded to whole pixels, which errs by more. With edges of 0.36 to 0.9 px and smears of 3
to 30 px places change by less than 5e-4 px, and reading takes a third of the time."""
_SOFT_PX: Final = 1.0
"""Edge from which the mean over a pixel is taken as a blur more, of variance 1/12 px², and the rim as shifted by its
curvature: right to 4e-4, twice what the logistic curve costs."""
_NODE_1, _WEIGHT_1 = np.polynomial.legendre.leggauss(1)
_NODE_3, _WEIGHT_3 = np.polynomial.legendre.leggauss(3)
_NODE_4, _WEIGHT_4 = np.polynomial.legendre.leggauss(4)


@shared
def disc_point(x: float, y: float, shape: Record, soft_px: float = _SOFT_PX) -> tuple[float, float, float, float]:
    """Return D and its slopes along x, y and the edge's width, the mean over one pixel at an offset from the centre.

    The mean over a pixel is a blur more from an edge of ``soft_px``.
    """
    e, f, radius, edge = shape.stretch[0], shape.stretch[1], shape.radius, shape.edge
    away = math.hypot((1.0 - e) * x - f * y, -f * x + (1.0 + e) * y) - radius
    if abs(away) >= _RIM_PX + _RIM * edge:
        return (1.0 if away < 0.0 else 0.0), 0.0, 0.0, 0.0
    nodes, weights, wide = _NODE_3, _WEIGHT_3, edge
    if edge < _SHARP_PX:
        nodes, weights = _NODE_4, _WEIGHT_4
    elif edge > soft_px:
        nodes, weights, wide = _NODE_1, _WEIGHT_1, math.sqrt(edge * edge + 1.0 / 12.0)
        radius -= 1.0 / (24.0 * radius)
    inside = along_x = along_y = along_edge = 0.0
    for i in range(len(nodes)):
        px = x + 0.5 * nodes[i]
        for j in range(len(nodes)):
            py = y + 0.5 * nodes[j]
            u, v = (1.0 - e) * px - f * py, -f * px + (1.0 + e) * py
            length = math.sqrt(u * u + v * v)
            z = min(max((length - radius) / wide, -6.0), 6.0)
            value = 1.0 / (1.0 + math.exp(z * (_STEP_1 + _STEP_3 * z * z)))
            weight = 0.25 * weights[i] * weights[j]
            inside += weight * value
            # The derivative of the logistic curve, and of the length of (u, v).
            fall = -value * (1.0 - value) * (_STEP_1 + 3.0 * _STEP_3 * z * z) / wide
            along_edge -= weight * fall * z * edge / wide
            fall /= max(length, 1e-9)
            along_x += weight * fall * (u * (1.0 - e) - v * f)
            along_y += weight * fall * (v * (1.0 + e) - u * f)
    return inside, along_x, along_y, along_edge


@lending
def smeared_point(
    x: float, y: float, shape: Record, smear_x: float, smear_y: float, count: int
) -> tuple[float, float, float]:
    """Return D and its slopes, the mean over ``count`` places along a smear."""
    if count == 1:
        inside, along_x, along_y, _ = disc_point(x, y, shape)
        return inside, along_x, along_y
    # Only places as near as this show anything of the dot, however it is stretched.
    reach = (shape.radius + _RIM_PX + _RIM * shape.edge) / (1.0 - math.hypot(shape.stretch[0], shape.stretch[1]))
    length = math.hypot(smear_x, smear_y)
    across, along = (x * smear_y - y * smear_x) / length, (x * smear_x + y * smear_y) / length
    if abs(across) >= reach:
        return 0.0, 0.0, 0.0
    middle, places = along / length * count + 0.5 * (count - 1), math.sqrt(reach**2 - across**2) / length * count
    inside = along_x = along_y = 0.0
    for k in range(max(0, math.floor(middle - places)), min(count, math.ceil(middle + places) + 1)):
        share = (k + 0.5) / count - 0.5
        d, dx, dy, _ = disc_point(x - share * smear_x, y - share * smear_y, shape, _SHARP_PX)
        inside += d
        along_x += dx
        along_y += dy
    return inside / count, along_x / count, along_y / count


@lending
def smear_count(length: float, edge: float) -> int:
    """Return in how many places a dot is drawn for a smear of a length."""
    return 1 if length < 0.5 else max(3, math.ceil(length / max(1.0, edge)))


@compiled
def window_pixels(radius_px: float) -> Ints:
    """Return the pixels in a disc around the middle of a square patch, row by row."""
    half = math.ceil(radius_px)
    pixels = np.empty((3, (2 * half + 1) ** 2), np.int64)
    count = 0
    for y in range(-half, half + 1):
        for x in range(-half, half + 1):
            if x * x + y * y <= radius_px * radius_px:
                turn = math.atan2(float(y), float(x)) / (2.0 * math.pi)
                pixels[0, count], pixels[1, count] = x, y
                pixels[2, count] = min(int((turn % 1.0) * SECTORS), SECTORS - 1)
                count += 1
    return pixels[:, :count].copy()


@lending
def fill_beside(
    rows: Floats, used: int, pixels: Ints, dx: float, dy: float, shape: Record, path: tuple[float, float], ramp: float
) -> int:
    """Add columns for what lies beside the stick, left and right of it; return how many columns there are now.

    A side of which no pixel shows half has none.

    With a smear across the stick it gets into the window: a step that is smeared is a ramp as long as the smear.
    """
    length = math.hypot(path[0], path[1])
    first = 0 if path[0] * shape.across[0] + path[1] * shape.across[1] >= 0.0 else 1
    for side in (1.0, -1.0):
        edge, most = shape.edges[first if side > 0.0 else 1 - first], 0.0
        if not math.isfinite(edge):
            continue
        for i in range(pixels.shape[1]):
            across = ((pixels[0, i] - dx) * path[0] + (pixels[1, i] - dy) * path[1]) / length
            rows[used, i] = min(max((side * across - edge) / ramp + 0.5, 0.0), 1.0)
            most = max(most, rows[used, i])
        if most > 0.5:
            used += 1
    return used


@lending
def fill_columns(out: Floats, pixels: Ints, dx: float, dy: float, shape: Record, smear_x: float, smear_y: float) -> int:
    """Fill the model's columns for a dot whose centre is (dx, dy) from the window's middle; return how many.

    To first order a change of radius or stretch moves the rim outwards by c · (u · grad): no further rendering.
    """
    length = math.hypot(smear_x, smear_y)
    count = smear_count(length, shape.edge)
    for i in range(pixels.shape[1]):
        x, y = pixels[0, i] - dx, pixels[1, i] - dy
        d, along_x, along_y = smeared_point(x, y, shape, smear_x, smear_y, count)
        out[0, i], out[1, i], out[2, i], out[3, i] = 1.0, d, -along_x, -along_y
        out[4, i] = -(x * along_x + y * along_y) / shape.radius
        out[5, i] = -(x * along_x - y * along_y)
        out[6, i] = -(y * along_x + x * along_y)
    if length <= 1.0:
        return COLUMNS
    return fill_beside(out, COLUMNS, pixels, dx, dy, shape, (smear_x, smear_y), length)
