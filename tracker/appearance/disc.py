"""The picture of a round dot, D, and its derivatives, pixel by pixel (compiled).

A pixel integrates the light over its square, which differs from a wider blur: evaluated at the pixel's middle alone, a
sharp rim would shift the dot by up to 0.015 px, depending on its position between the pixels. Near the rim the mean
over the square is computed by Gauss–Legendre quadrature. ``pixels`` (2, n) int64 are a window's offsets x and y from
its middle.
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
the width of the stick that carries the dot; distances from the dot's centre to that stick's edges, on one side and on
the other, infinite for an edge that is not seen; direction (2,) in the picture towards the first edge, in the stick's
present position; radius of the window that is compared."""

MOST_STRETCH: Final = 0.45
"""Largest stretch of a dot: that of a plane seen at 67 degrees from its normal."""
COLUMNS: Final = 7
"""Unknowns of a dot without motion blur: light, step, position (2), radius, stretch (2)."""

_STEP_1, _STEP_3 = 1.5976, 0.07056
"""The falling normal step 1 − Φ(z) as a logistic curve with a cubic term, to 2e-4 (Bowling and
others, J. Ind. Eng. Manag. 2, 2009, p. 114)."""
_RIM_PX, _RIM = 0.75, 4.0
"""Distance from the rim within which D changes: half a pixel's diagonal, plus this many widths of the edge."""
_SHARP_PX: Final = 0.35
"""Edge width below which the mean over a pixel needs the finer quadrature. Above it, a dot with motion blur is treated
as one above ``_SOFT_PX``: blur lengths are rounded to whole pixels, which has a larger error. With edges of 0.36 to 0.9
px and blur lengths of 3 to 30 px positions change by less than 5e-4 px, and reading takes a third of the time."""
_SOFT_PX: Final = 1.0
"""Edge width above which the mean over a pixel is approximated by additional blur of variance 1/12 px², and by a shift
of the rim due to its curvature: correct to 4e-4, twice the error of the logistic curve."""
_NODE_1, _WEIGHT_1 = np.polynomial.legendre.leggauss(1)
_NODE_3, _WEIGHT_3 = np.polynomial.legendre.leggauss(3)
_NODE_4, _WEIGHT_4 = np.polynomial.legendre.leggauss(4)


@shared
def disc_point(x: float, y: float, shape: Record, soft_px: float = _SOFT_PX) -> tuple[float, float, float, float]:
    """Return D and its derivatives by x, y and the edge's width: means over the pixel at an offset from the centre.

    For edges wider than ``soft_px`` the mean over the pixel is approximated by additional blur.
    """
    e, f, radius, edge = shape.stretch[0], shape.stretch[1], shape.radius, shape.edge
    u, v = (1.0 - e) * x - f * y, -f * x + (1.0 + e) * y
    # A library's hypot, which heeds overflow, takes a third of the time of rendering.
    away = math.sqrt(u * u + v * v) - radius
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
            weight, z = 0.25 * weights[i] * weights[j], (length - radius) / wide
            value = 1.0 / (1.0 + math.exp(z * (_STEP_1 + _STEP_3 * z * z)))
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
    """Return D and its derivatives by x and y, the means over ``count`` positions along the path of a motion blur."""
    if count == 1:
        inside, along_x, along_y, _ = disc_point(x, y, shape)
        return inside, along_x, along_y
    # Positions further away than this do not show the dot, whatever its stretch.
    reach = (shape.radius + _RIM_PX + _RIM * shape.edge) / (1.0 - math.hypot(shape.stretch[0], shape.stretch[1]))
    # So wide apart the positions have the variance of the whole path.
    wide = count / math.sqrt(count * count - 1.0)
    smear_x, smear_y = wide * smear_x, wide * smear_y
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
    """Return the number of positions at which a dot is rendered for motion blur of a length."""
    return 1 if length == 0.0 else max(3, math.ceil(length / max(1.0, edge)))


@compiled
def window_pixels(radius_px: float) -> Ints:
    """Return the pixels (2, n) in a disc around the middle of a window, row by row: offsets x and y."""
    half = math.ceil(radius_px)
    pixels = np.empty((2, (2 * half + 1) ** 2), np.int64)
    count = 0
    for y in range(-half, half + 1):
        for x in range(-half, half + 1):
            if x * x + y * y <= radius_px * radius_px:
                pixels[0, count], pixels[1, count] = x, y
                count += 1
    return pixels[:, :count].copy()


@lending
def fill_beside(
    rows: Floats, used: int, pixels: Ints, dx: float, dy: float, shape: Record, path: tuple[float, float], ramp: float
) -> int:
    """Add columns for the background on either side of the stick; return the number of columns.

    With motion blur across the stick the background enters the window, as a ramp of the width ``ramp``. A side that
    covers no pixel by more than half has no column.
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
    """Fill the model's columns for a dot with its centre at (dx, dy) from the window's middle; return their number.

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
