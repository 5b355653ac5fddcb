"""Compiled reading of round dots: the model of :mod:`tracker.dot`, solved by one linear step at a time.

A step is Lucas' and Kanade's against a template that is rendered from the dot's fitted shape, with light, contrast and
small changes of the shape free beside the offset. Models of dots at rest are kept for every eighth of a pixel; smeared
ones are made as they are needed. What is kept depends on the shape alone, so it never changes a result.

Packed arrays beside those of :mod:`tracker.render`:

- ``models`` (64, 18, n): inverse (7), columns (7), slopes of the light (2), how slopes are seen (2);
- ``extras`` (64, 18): effect of the slopes on the coefficients (7, 2), covariance xx, xy, yy, whether it is filled;
- a reading (16,): see the constants below.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from torsight.core.compiled import njit
from tracker.render import (
    COLUMNS,
    DEPTH,
    EDGE,
    RADIUS,
    SECTORS,
    STRIP,
    WINDOW,
    Floats,
    Pixels,
    fill_beside,
    fill_columns,
    smear_count,
    smeared_point,
    window_pixels,
)

Luma = NDArray[np.uint8]

PHASES: Final = 8
"""Steps per pixel at which models are kept; half a step off, the cubic term is below 1e-4 px."""
MOST_COLUMNS: Final = 9
ROUNDS: Final = 4

(
    X, Y, XX, XY, YY, LIGHT, CONTRAST, STEP, RESIDUAL, PATCH, GREW, STRETCHED, SKEWED, SLOPE_X, SLOPE_Y, CONVERGED,
) = range(16)  # fmt: skip
FIELDS: Final = 16
_NEAR_ENOUGH: Final = 0.08
"""Offset from the model's place from which another step pays; half a step of the places, and a little."""


@njit(cache=True, nogil=True)
def eliminate(a: Floats, b: Floats, i: int) -> None:
    """Make column i of ``a`` a unit column by row operations, which ``b`` goes through too (Gauss and Jordan)."""
    n = a.shape[0]
    best = i
    for k in range(i + 1, n):
        if abs(a[k, i]) > abs(a[best, i]):
            best = k
    for j in range(n):
        a[i, j], a[best, j] = a[best, j], a[i, j]
        b[i, j], b[best, j] = b[best, j], b[i, j]
    pivot = a[i, i] if abs(a[i, i]) > 1e-30 else 1e-30
    for j in range(n):
        a[i, j] /= pivot
        b[i, j] /= pivot
    for k in range(n):
        factor = 0.0 if k == i else a[k, i]
        for j in range(n):
            a[k, j] -= factor * a[i, j]
            b[k, j] -= factor * b[i, j]


@njit(cache=True, nogil=True)
def invert(normal: Floats) -> Floats:
    """Return the inverse of a small symmetric matrix, scaled and with a weak ridge."""
    n = normal.shape[0]
    scale = np.empty(n)
    for i in range(n):
        scale[i] = math.sqrt(normal[i, i]) + 1e-12
    a, b = np.empty((n, n)), np.eye(n)
    for i in range(n):
        for j in range(n):
            a[i, j] = normal[i, j] / (scale[i] * scale[j])
        a[i, i] += 1e-9
    for i in range(n):
        eliminate(a, b, i)
    for i in range(n):
        for j in range(n):
            b[i, j] /= scale[i] * scale[j]
    return b


@njit(cache=True, nogil=True)
def combine(weights: Floats, rows: Floats, out: Floats) -> None:
    """Put the sum of weighted rows into ``out``."""
    out[:] = 0.0
    for m in range(len(weights)):
        w = weights[m]
        for i in range(out.shape[0]):
            out[i] += w * rows[m, i]


@njit(cache=True, nogil=True)
def products(rows: Floats, count: int) -> Floats:
    """Return the products of the first rows with each other."""
    normal = np.empty((count, count))
    for i in range(count):
        for j in range(i + 1):
            total = 0.0
            for p in range(rows.shape[1]):
                total += rows[i, p] * rows[j, p]
            normal[i, j] = normal[j, i] = total
    return normal


@njit(cache=True, nogil=True)
def fill_model(model: Floats, extra: Floats, columns: int, pixels: Pixels, shape: Floats) -> None:
    """Fill a model whose columns stand in rows ``columns`` to 2 ``columns`` already.

    Rows: inverse, columns, slopes of the light, how slopes are seen; ``extra`` see the head of the module.
    """
    n = pixels.shape[1]
    basis = model[columns : 2 * columns + 2]
    for i in range(n):
        lit = 1.0 + shape[DEPTH] * basis[1, i]
        basis[columns, i], basis[columns + 1, i] = pixels[0, i] * lit, pixels[1, i] * lit
    both = products(basis, columns + 2)
    inverse = invert(both[:columns, :columns].copy())
    wide = invert(both)
    for k in range(columns):
        combine(inverse[k], basis, model[k])
    for k in range(2):
        combine(wide[columns + k], basis, model[2 * columns + 2 + k])
    for k in range(columns):
        for s in range(2):
            total = 0.0
            for m in range(columns):
                total += inverse[k, m] * both[m, columns + s]
            extra[2 * k + s] = total
    extra[2 * columns], extra[2 * columns + 1], extra[2 * columns + 2] = inverse[2, 2], inverse[2, 3], inverse[3, 3]


@njit(cache=True, nogil=True)
def take_away(values: Floats, row: Floats, weight: float) -> None:
    """Take a weighted row away from values."""
    for i in range(values.shape[0]):
        values[i] -= weight * row[i]


@njit(cache=True, nogil=True)
def solve_model(
    values: Floats,
    model: Floats,
    extra: Floats,
    columns: int,
    pixels: Pixels,
    x0: float,
    y0: float,
    shape: Floats,
    slope_x: float,
    slope_y: float,
    out: Floats,
) -> None:
    """Read one window by one linear step."""
    n = values.shape[0]
    found = np.empty(columns)
    for k in range(columns):
        found[k] = np.dot(model[k], values)
    scale = max(found[0], 1.0)
    sx, sy = slope_x * scale, slope_y * scale
    for k in range(columns):
        found[k] -= extra[2 * k] * sx + extra[2 * k + 1] * sy
    last = 2 * columns
    seen_x, seen_y = np.dot(model[last + 2], values), np.dot(model[last + 3], values)
    left = values.copy()
    take_away(left, model[last], sx)
    take_away(left, model[last + 1], sy)
    for k in range(columns):
        take_away(left, model[columns + k], found[k])
    square = np.dot(left, left)
    sums, numbers = np.zeros(SECTORS), np.zeros(SECTORS)
    for i in range(n):
        sums[pixels[2, i]] += left[i]
        numbers[pixels[2, i]] += 1.0
    patch = 0.0
    for k in range(SECTORS):
        patch = max(patch, abs(sums[k]) / max(numbers[k], 1.0))
    light, step = found[0], found[1]
    size = step if abs(step) > 1e-3 else math.copysign(1e-3, step)
    dx, dy = found[2] / size, found[3] / size
    variance = square / max(1, n - columns)
    spread = variance / (size * size)
    out[X], out[Y] = x0 + dx, y0 + dy
    out[XX], out[XY], out[YY] = (
        spread * extra[2 * columns], spread * extra[2 * columns + 1], spread * extra[2 * columns + 2],
    )  # fmt: skip
    out[LIGHT], out[STEP] = light, step
    out[CONTRAST] = step / (light * shape[DEPTH]) if light > 1.0 else 0.0
    out[RESIDUAL], out[PATCH] = math.sqrt(variance), patch
    out[GREW], out[STRETCHED], out[SKEWED] = found[4] / size, found[5] / size, found[6] / size
    out[SLOPE_X], out[SLOPE_Y] = seen_x / scale, seen_y / scale
    out[CONVERGED] = 1.0 if abs(dx) < 0.2 and abs(dy) < 0.2 else 0.0


@njit(cache=True, nogil=True)
def take_values(luma: Luma, cx: int, cy: int, pixels: Pixels, half: int, values: Floats) -> bool:
    """Take the pixels around (cx, cy); return whether the window lies inside the picture."""
    height, width = luma.shape
    if cx < half or cy < half or cx + half >= width or cy + half >= height:
        return False
    for i in range(pixels.shape[1]):
        values[i] = luma[cy + pixels[1, i], cx + pixels[0, i]]
    return True


@njit(cache=True, nogil=True)
def read_dot(
    luma: Luma,
    x_px: float,
    y_px: float,
    pixels: Pixels,
    shape: Floats,
    models: Floats,
    extras: Floats,
    view: Floats,
    out: Floats,
) -> bool:
    """Read a dot near a position; False where the window leaves the picture.

    ``view``: smear x, smear y, slopes of the light x, y.
    """
    # Smear in whole pixels: half a pixel more or less changes the ends of a smear of several pixels, evenly.
    smear_x, smear_y = float(round(view[0])), float(round(view[1]))
    length = math.hypot(smear_x, smear_y)
    if length < 2.0:
        smear_x = smear_y = length = 0.0
    radius = shape[WINDOW] + math.ceil(0.5 * length)
    if length > 0.0:
        pixels = window_pixels(radius)
        # Its own models, which are not kept.
        models = np.empty((1, 2 * MOST_COLUMNS + 4, pixels.shape[1]))
        extras = np.empty((1, 2 * MOST_COLUMNS + 4))
    half = math.ceil(radius)
    values = np.empty(pixels.shape[1])
    for _ in range(ROUNDS):
        phase_x, phase_y = math.floor(x_px * PHASES + 0.5), math.floor(y_px * PHASES + 0.5)
        cx, cy = (phase_x + PHASES // 2) // PHASES, (phase_y + PHASES // 2) // PHASES
        if not take_values(luma, cx, cy, pixels, half, values):
            return False
        off_x, off_y = phase_x - cx * PHASES, phase_y - cy * PHASES
        columns, slot = COLUMNS, 0
        if length > 0.0:
            rows = np.empty((MOST_COLUMNS, pixels.shape[1]))
            columns = fill_columns(rows, pixels, off_x / PHASES, off_y / PHASES, shape, smear_x, smear_y)
            models[0, columns : 2 * columns] = rows[:columns]
            fill_model(models[0], extras[0], columns, pixels, shape)
        else:
            slot = (off_y % PHASES) * PHASES + off_x % PHASES
            if extras[slot, 17] == 0.0:
                fill_columns(models[slot, COLUMNS:], pixels, off_x / PHASES, off_y / PHASES, shape, 0.0, 0.0)
                fill_model(models[slot], extras[slot], COLUMNS, pixels, shape)
                extras[slot, 17] = 1.0
        solve_model(
            values, models[slot], extras[slot], columns, pixels, phase_x / PHASES, phase_y / PHASES, shape,
            view[2], view[3], out,
        )  # fmt: skip
        if not math.isfinite(out[X]) or not math.isfinite(out[Y]):
            break
        # The model is linear only close by: another step from the nearest place at which models are kept.
        if abs(out[X] - phase_x / PHASES) < _NEAR_ENOUGH and abs(out[Y] - phase_y / PHASES) < _NEAR_ENOUGH:
            break
        limit = 0.5 * shape[RADIUS]
        x_px += min(max(out[X] - x_px, -limit), limit)
        y_px += min(max(out[Y] - y_px, -limit), limit)
    return True


@njit(cache=True, nogil=True)
def residual_share(rows: Floats, values: Floats) -> float:
    """Return the residual of a linear fit over the coefficient of row 1, the step; negative where there is no step."""
    columns, n = rows.shape
    inverse = invert(products(rows, columns))
    right, found = np.zeros(columns), np.zeros(columns)
    for m in range(columns):
        for i in range(n):
            right[m] += rows[m, i] * values[i]
    for m in range(columns):
        for j in range(columns):
            found[m] += inverse[m, j] * right[j]
    square = 0.0
    for i in range(n):
        left = values[i]
        for m in range(columns):
            left -= rows[m, i] * found[m]
        square += left * left
    return -1.0 if abs(found[1]) <= 1.0 else math.sqrt(square / max(1, n - columns)) / abs(found[1])


@njit(cache=True, nogil=True)
def smear_misfits(
    luma: Luma, x_px: float, y_px: float, shape: Floats, path_x: float, path_y: float, shares: Floats, out: Floats
) -> bool:
    """Find how well smears along several shares of a path fit: the residual over the step; False where it is not told.

    Window and columns are the same for all shares, and the shape is taken as known: a stretched dot looks much like a
    short smear.
    """
    length = math.hypot(path_x, path_y)
    radius = shape[WINDOW] + math.ceil(0.5 * length)
    pixels = window_pixels(radius)
    n = pixels.shape[1]
    values, rows = np.empty(n), np.empty((6, n))
    cx, cy = math.floor(x_px + 0.5), math.floor(y_px + 0.5)
    if not take_values(luma, cx, cy, pixels, math.ceil(radius), values):
        return False
    for k in range(len(shares)):
        smear_x, smear_y = shares[k] * path_x, shares[k] * path_y
        count = smear_count(math.hypot(smear_x, smear_y), shape[EDGE])
        for i in range(n):
            x, y = pixels[0, i] - (x_px - cx), pixels[1, i] - (y_px - cy)
            d, along_x, along_y = smeared_point(x, y, shape, smear_x, smear_y, count)
            rows[0, i], rows[1, i], rows[2, i], rows[3, i] = 1.0, d, -along_x, -along_y
        ramp = max(1.0, shares[k] * length)
        columns = fill_beside(rows, 4, pixels, x_px - cx, y_px - cy, shape[STRIP], (path_x, path_y), ramp)
        out[k] = residual_share(rows[:columns], values)
        if out[k] < 0.0:
            return False
    return True
