"""Reading a round dot: Lucas–Kanade against a rendered template, inverse compositional (compiled).

The picture is compared with a template that is rendered from the dot's fitted shape, never taken from the last frame,
so nothing drifts. Free parameters, to first order, are position, brightness, contrast, radius and both terms of
stretch. As in the inverse compositional form (Baker & Matthews, Lucas–Kanade 20 years on, Int. J. Comput. Vision 56,
2004, section 3.2) the derivatives and the least-squares inverse belong to the template: they are computed once for
every eighth of a pixel and cached, a step is one product with the picture's window, and the warp, a shift, is composed
by addition. The model of a dot with motion blur is computed as needed. The cache depends on the shape alone, so it
never changes a result.

A ``look`` is the cache of one marker: ``pixels`` (3, n), see :mod:`tracker.appearance.disc`; ``models`` (64, 18, n):
inverse (7), columns (7), gradient of the light (2), estimators of that gradient (2); ``extras`` (64, 18): effect of the
gradient on the coefficients (7, 2), covariance xx, xy, yy, whether the model is filled.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from torsight.core.compiled import compiled, copy_to, internal, lending
from torsight.core.units import Floats, Ints
from tracker.appearance.disc import COLUMNS, SECTORS, Record, fill_columns, window_pixels

Luma = NDArray[np.uint8]
Point = tuple[float, float]
Look = tuple[Ints, Floats, Floats]

READING: Final = np.dtype(
    [
        ("x", "f8"),
        ("y", "f8"),
        ("covariance", "f8", (3,)),
        ("light", "f8"),
        ("step", "f8"),
        ("contrast", "f8"),
        ("residual", "f8"),
        ("patch", "f8"),
        ("change", "f8", (3,)),
        ("slope", "f8", (2,)),
        ("converged", "i8"),
        ("predicted", "f8", (2,)),
        ("path", "f8", (2,)),
        ("state", "i8"),
    ]
)
"""A marker as read in one picture. x, y: px. covariance: xx, xy, yy for white noise of the size of ``residual``, px².
light: brightness around the dot (mean brightness for texture), step: of the dot, residual: rms residual of the model,
patch: the largest mean residual over a sector of the window (occluded if large), all in grey levels. contrast: step
over the template's (gain for texture). change: radius (px) and stretch minus the template's. slope: gradient of the
light in this frame alone, relative change per pixel. predicted: expected position, path: expected motion since the last
frame, px. state: see :data:`tracker.rows.STATES`."""

PHASES: Final = 8
"""Steps per pixel at which models are cached; at half a step's distance the cubic term is below 1e-4 px."""
_MOST_COLUMNS: Final = COLUMNS + 2
_ROUNDS: Final = 4
"""Most steps: each is at most half a radius, so together they reach two radii."""
RATE: Final = 0.1
"""Weight of a new value in the running means of shape, fit, length, light (also that of the picture) and misses: ten
frames, over which noise averages to a quarter."""
SHARP_PX: Final = 1.5
"""Motion or motion blur, px per frame, up to which a marker shows its shape: a dot is blurred by less than 0.5 px
(1.5/√12)."""
_NEAR_PX: Final = math.sqrt(0.5) / PHASES
"""Offset from the model's position below which a reading has converged: half a diagonal of the grid of models, beyond
which another model is nearer."""


@lending
def eliminate(a: Floats, b: Floats, i: int) -> None:
    """Reduce column i of ``a`` to a unit column by row operations, also applied to ``b`` (Gauss-Jordan elimination)."""
    n = a.shape[0]
    best = i
    for k in range(i + 1, n):
        if abs(a[k, i]) > abs(a[best, i]):
            best = k
    for j in range(n):
        a[i, j], a[best, j] = a[best, j], a[i, j]
    for j in range(b.shape[1]):
        b[i, j], b[best, j] = b[best, j], b[i, j]
    pivot = a[i, i]
    for j in range(n):
        a[i, j] /= pivot
    for j in range(b.shape[1]):
        b[i, j] /= pivot
    for k in range(n):
        factor = 0.0 if k == i else a[k, i]
        for j in range(n):
            a[k, j] -= factor * a[i, j]
        for j in range(b.shape[1]):
            b[k, j] -= factor * b[i, j]


@internal
def unit(n: int) -> Floats:
    """Return the unit matrix: numba's own takes a quarter of a second to compile."""
    out = np.empty((n, n))
    for i in range(n):
        for j in range(n):
            out[i, j] = 1.0 if i == j else 0.0
    return out


@lending
def least(values: Floats) -> int:
    """Return the index of the smallest value; numba's own function takes a third of a second to compile."""
    at = 0
    for i in range(1, len(values)):
        if values[i] < values[at]:
            at = i
    return at


@internal
def invert(normal: Floats) -> Floats:
    """Return the inverse of a small symmetric matrix, scaled and with a weak ridge."""
    n = normal.shape[0]
    scale = np.empty(n)
    for i in range(n):
        scale[i] = math.sqrt(normal[i, i]) + 1e-12
    a, b = np.empty((n, n)), unit(n)
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


@lending
def combine(weights: Floats, rows: Floats, out: Floats) -> None:
    """Store the weighted sum of rows in ``out``."""
    out[:] = 0.0
    for m in range(len(weights)):
        w = weights[m]
        for i in range(out.shape[0]):
            out[i] += w * rows[m, i]


@lending
def inner(one: Floats, other: Floats) -> float:
    """Return the inner product of two rows, as four partial sums that the processor adds in parallel."""
    even = len(one) - len(one) % 4
    a = b = c = d = 0.0
    for i in range(0, even, 4):
        a += one[i] * other[i]
        b += one[i + 1] * other[i + 1]
        c += one[i + 2] * other[i + 2]
        d += one[i + 3] * other[i + 3]
    for i in range(even, len(one)):
        a += one[i] * other[i]
    return (a + b) + (c + d)


@internal
def products(rows: Floats, count: int) -> Floats:
    """Return the inner products (count, count) of the first ``count`` rows."""
    normal = np.empty((count, count))
    for i in range(count):
        for j in range(i + 1):
            normal[i, j] = normal[j, i] = inner(rows[i], rows[j])
    return normal


@internal
def fill_model(model: Floats, extra: Floats, columns: int, pixels: Ints, shape: Record) -> None:
    """Complete a model whose columns are already stored in rows ``columns`` to 2 ``columns``.

    Rows: inverse, columns, gradient of the light, estimators of that gradient; for ``extra`` see the top of the module.
    """
    n = pixels.shape[1]
    basis = model[columns : 2 * columns + 2]
    for i in range(n):
        lit = 1.0 + shape.contrast * basis[1, i]
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


@lending
def take_away(values: Floats, row: Floats, weight: float) -> None:
    """Subtract a weighted row from values, in place."""
    for i in range(values.shape[0]):
        values[i] -= weight * row[i]


@internal
def worst_sector(left: Floats, pixels: Ints) -> float:
    """Return the largest absolute mean of residuals (n,) over a sector of a window."""
    sums, numbers = np.zeros(SECTORS), np.zeros(SECTORS)
    for i in range(len(left)):
        sums[pixels[2, i]] += left[i]
        numbers[pixels[2, i]] += 1.0
    worst = 0.0
    for k in range(SECTORS):
        worst = max(worst, abs(sums[k]) / max(numbers[k], 1.0))
    return worst


@lending
def solve_model(values: Floats, model: Floats, extra: Floats, marker: Record, found: Floats) -> None:
    """Solve for the coefficients of a window's columns, corrected for the marker's known gradient of the light."""
    for k in range(len(found)):
        found[k] = inner(model[k], values)
    scale = max(found[0], 1.0)
    for k in range(len(found)):
        found[k] -= extra[2 * k] * marker.slope[0] * scale + extra[2 * k + 1] * marker.slope[1] * scale


@internal
def take_reading(
    values: Floats, found: Floats, model: Floats, extra: Floats, pixels: Ints, marker: Record, out: Record
) -> None:
    """Fill in all of a reading but the position, from the coefficients of a window and their residuals."""
    columns = len(found)
    scale, last = max(found[0], 1.0), 2 * columns
    out.slope[0], out.slope[1] = inner(model[last + 2], values) / scale, inner(model[last + 3], values) / scale
    left = values.copy()
    take_away(left, model[last], marker.slope[0] * scale)
    take_away(left, model[last + 1], marker.slope[1] * scale)
    for k in range(columns):
        take_away(left, model[columns + k], found[k])
    out.patch = worst_sector(left, pixels)
    light, step = found[0], found[1]
    variance = inner(left, left) / max(1, len(values) - columns)
    for k in range(3):
        out.covariance[k] = variance / (step * step) * extra[last + k]
        out.change[k] = found[4 + k] / step
    out.light, out.step, out.residual = light, step, math.sqrt(variance)
    out.contrast = step / (light * marker.shape.contrast) if light > 1.0 else 0.0


@lending
def take_values(luma: Luma, cx: int, cy: int, pixels: Ints, half: int, values: Floats) -> bool:
    """Copy the pixels around (cx, cy) into ``values``; return whether the window lies inside the picture."""
    height, width = luma.shape
    if cx < half or cy < half or cx + half >= width or cy + half >= height:
        return False
    for i in range(pixels.shape[1]):
        values[i] = luma[cy + pixels[1, i], cx + pixels[0, i]]
    return True


@internal
def model_at(pixels: Ints, models: Floats, extras: Floats, place: Point, shape: Record) -> int:
    """Return the index of the model of a dot at rest at ``place`` from the window's middle; computed if not cached."""
    off_x, off_y = round(place[0] * PHASES), round(place[1] * PHASES)
    slot = (off_y % PHASES) * PHASES + off_x % PHASES
    if extras[slot, -1] == 0.0:
        fill_columns(models[slot, COLUMNS:], pixels, place[0], place[1], shape, 0.0, 0.0)
        fill_model(models[slot], extras[slot], COLUMNS, pixels, shape)
        extras[slot, -1] = 1.0
    return slot


@compiled
def read_dot(luma: Luma, x_px: float, y_px: float, marker: Record, look: Look, smear: Point, out: Record) -> bool:
    """Read a dot near a position into ``out``; False where the window leaves the picture.

    ``marker`` has the ``shape`` of the dot and the ``slope`` (gradient) of the light; ``smear`` is the dot's path
    during the exposure, px.
    """
    pixels, models, extras = look
    shape = marker.shape
    # Motion blur in whole pixels: half a pixel more or less changes only the ends of a path of several, symmetrically.
    smear_x, smear_y = float(round(smear[0])), float(round(smear[1]))
    length = math.hypot(smear_x, smear_y)
    if length < SHARP_PX:
        length = 0.0
    radius = shape.window + math.ceil(0.5 * length)
    if length > 0.0:
        pixels = window_pixels(radius)
        # Temporary models, which are not cached.
        models = np.empty((1, 2 * _MOST_COLUMNS + 4, pixels.shape[1]))
        extras = np.empty((1, 2 * _MOST_COLUMNS + 4))
    half = math.ceil(radius)
    values = np.empty(pixels.shape[1])
    for round_ in range(_ROUNDS):
        at_x, at_y = math.floor(x_px * PHASES + 0.5) / PHASES, math.floor(y_px * PHASES + 0.5) / PHASES
        cx, cy = math.floor(at_x + 0.5), math.floor(at_y + 0.5)
        if not take_values(luma, cx, cy, pixels, half, values):
            return False
        columns, slot = COLUMNS, 0
        if length > 0.0:
            rows = np.empty((_MOST_COLUMNS, pixels.shape[1]))
            columns = fill_columns(rows, pixels, at_x - cx, at_y - cy, shape, smear_x, smear_y)
            for k in range(columns):
                copy_to(models[0, columns + k], rows[k])
            fill_model(models[0], extras[0], columns, pixels, shape)
        else:
            slot = model_at(pixels, models, extras, (at_x - cx, at_y - cy), shape)
        found = np.empty(columns)
        solve_model(values, models[slot], extras[slot], marker, found)
        dx, dy = found[2] / found[1], found[3] / found[1]
        out.x, out.y = at_x + dx, at_y + dy
        # The model is linear only nearby: another step starts from the nearest position of a cached model.
        near = abs(dx) <= _NEAR_PX and abs(dy) <= _NEAR_PX
        if near or round_ == _ROUNDS - 1 or not math.isfinite(out.x) or not math.isfinite(out.y):
            out.converged = near
            take_reading(values, found, models[slot], extras[slot], pixels, marker, out)
            break
        limit = 0.5 * shape.radius
        x_px += min(max(out.x - x_px, -limit), limit)
        y_px += min(max(out.y - y_px, -limit), limit)
    return True
