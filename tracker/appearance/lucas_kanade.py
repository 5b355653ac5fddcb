"""Reading a round dot: Lucas–Kanade against a rendered template, inverse compositional (compiled).

The picture is compared with a template that is rendered from the dot's fitted shape, never taken from the last frame,
so nothing drifts. Free parameters, to first order, are position, brightness, contrast, radius and both terms of
stretch. As in the inverse compositional form (Baker & Matthews, Lucas–Kanade 20 years on, Int. J. Comput. Vision 56,
2004, section 3.2) the derivatives and the least-squares inverse belong to the template: they are computed once for
every eighth of a pixel and cached, a step is the products of its columns with the picture's window, and the warp, a
shift, is composed by addition. The residuals follow from the same products. The model of a dot with motion blur is
computed as needed. The cache depends on the shape alone, so it never changes a result.

A ``look`` is the cache of one marker: ``pixels`` (2, n), see :mod:`tracker.appearance.disc`; ``models`` (64, 9, n): the
columns (7) and the gradient of the light (2); ``systems`` (64,), records of SYSTEM.
"""

from __future__ import annotations

import math
from mmap import mmap
from typing import Any, Final

import numpy as np
from numpy.typing import DTypeLike, NDArray

from torsight.core.compiled import compiled, internal, lending
from torsight.core.units import Floats, Ints
from tracker.appearance.disc import COLUMNS, Record, fill_columns, window_pixels

Luma = NDArray[np.uint8]
Point = tuple[float, float]
Places = NDArray[np.complex128]
Look = tuple[Ints, Floats, NDArray[np.void]]

READING: Final = np.dtype(
    [
        ("x", "f8"),
        ("y", "f8"),
        ("covariance", "f8", (3,)),
        ("light", "f8"),
        ("step", "f8"),
        ("contrast", "f8"),
        ("residual", "f8"),
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
all in grey levels. contrast: step over the template's (gain for texture). change: radius (px) and stretch minus the
template's. slope: gradient of the light in this frame alone, relative change per pixel. predicted: expected position,
path: expected motion since the last frame, px. state: see :data:`tracker.rows.STATES`."""

PHASES: Final = 8
"""Steps per pixel at which models are cached; at half a step's distance the cubic term is below 1e-4 px."""
_MOST: Final = COLUMNS + 4
"""Most rows of a model: columns, two for the background beside a stick with motion blur, gradient of the light (2)."""
SYSTEM: Final = np.dtype(
    [
        ("filled", "i8"),
        ("products", "f8", (_MOST, _MOST)),
        ("inverse", "f8", (_MOST, _MOST)),
    ]
)
"""What a model's m rows determine. filled: whether they are computed. products: inner products of the rows (m, m).
inverse: the inverse of those of the columns, and below it the rows of the whole inverse that belong to the gradient."""
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


def unused_look(window_px: float) -> Look:
    """Return an empty look for a window of a radius."""
    pixels, slots = window_pixels(window_px), PHASES * PHASES
    return pixels, zeros_on_demand((slots, COLUMNS + 2, pixels.shape[1])), zeros_on_demand((slots,), SYSTEM)


def zeros_on_demand(shape: tuple[int, ...], dtype: DTypeLike = float) -> NDArray[Any]:
    """Return zeros whose memory is taken page by page, where it is written: of a look usually few models are filled.

    For 4 MB and more numpy asks the system for pages of 2 MB, each of which holds many models and costs a virtual
    machine up to 10 ms.
    """
    size = math.prod(shape)
    return np.frombuffer(mmap(-1, max(size * np.dtype(dtype).itemsize, 1)), dtype, size).reshape(shape)


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
def fill_model(model: Floats, system: Record, columns: int, pixels: Ints, shape: Record) -> None:
    """Complete a model whose columns are already stored: the gradient of the light, and the system (a SYSTEM)."""
    used = columns + 2
    for i in range(pixels.shape[1]):
        lit = 1.0 + shape.contrast * model[1, i]
        model[columns, i], model[columns + 1, i] = pixels[0, i] * lit, pixels[1, i] * lit
    both = products(model, used)
    inverse, wide = invert(both[:columns, :columns].copy()), invert(both)
    for k in range(used):
        for m in range(used):
            system.products[k, m] = both[k, m]
            system.inverse[k, m] = wide[k, m] if k >= columns else (inverse[k, m] if m < columns else 0.0)


@lending
def take_away(values: Floats, row: Floats, weight: float) -> None:
    """Subtract a weighted row from values, in place."""
    for i in range(values.shape[0]):
        values[i] -= weight * row[i]


@lending
def solve_model(seen: Floats, system: Record, marker: Record, found: Floats) -> None:
    """Compute the coefficients (m,) of a model's rows from their products (m,) with a window.

    Those of the last two are the marker's known gradient of the light.
    """
    columns = len(found) - 2
    scale = 0.0
    for m in range(columns):
        scale += system.inverse[0, m] * seen[m]
    scale = max(scale, 1.0)
    found[:columns] = 0.0
    found[columns], found[columns + 1] = marker.slope[0] * scale, marker.slope[1] * scale
    for m in range(columns):
        lit = system.products[m, columns] * found[columns] + system.products[m, columns + 1] * found[columns + 1]
        for k in range(columns):
            found[k] += system.inverse[k, m] * (seen[m] - lit)


@internal
def take_reading(values: Floats, seen: Floats, found: Floats, system: Record, marker: Record, out: Record) -> None:
    """Fill in all of a reading but the position, from the coefficients (m,) and the products ``seen`` (m,)."""
    columns = len(found) - 2
    light, step = found[0], found[1]
    left = inner(values, values)
    for k in range(len(found)):
        fitted = 0.0
        for m in range(len(found)):
            fitted += system.products[k, m] * found[m]
        left += found[k] * (fitted - 2.0 * seen[k])
    variance = max(left, 0.0) / max(1, len(values) - columns)
    for s in range(2):
        out.slope[s] = 0.0
        for m in range(len(found)):
            out.slope[s] += system.inverse[columns + s, m] * seen[m] / max(light, 1.0)
    for k in range(3):
        out.covariance[k] = variance / (step * step) * system.inverse[2 + k // 2, 2 + (k + 1) // 2]
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
def model_at(pixels: Ints, models: Floats, systems: Record, place: Point, shape: Record) -> int:
    """Return the index of the model of a dot at rest at ``place`` from the window's middle; computed if not cached."""
    off_x, off_y = round(place[0] * PHASES), round(place[1] * PHASES)
    slot = (off_y % PHASES) * PHASES + off_x % PHASES
    if not systems[slot].filled:
        fill_columns(models[slot], pixels, place[0], place[1], shape, 0.0, 0.0)
        fill_model(models[slot], systems[slot], COLUMNS, pixels, shape)
        systems[slot].filled = 1
    return slot


@compiled
def read_dot(luma: Luma, x_px: float, y_px: float, marker: Record, look: Look, smear: Point, out: Record) -> bool:
    """Read a dot near a position into ``out``; False where the window leaves the picture.

    ``marker`` has the ``shape`` of the dot and the ``slope`` (gradient) of the light; ``smear`` is the dot's path
    during the exposure, px.
    """
    pixels, models, systems = look
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
        models, systems = np.empty((1, _MOST, pixels.shape[1])), np.empty(1, systems.dtype)
    half = math.ceil(radius)
    values = np.empty(pixels.shape[1])
    for round_ in range(_ROUNDS):
        at_x, at_y = math.floor(x_px * PHASES + 0.5) / PHASES, math.floor(y_px * PHASES + 0.5) / PHASES
        cx, cy = math.floor(at_x + 0.5), math.floor(at_y + 0.5)
        if not take_values(luma, cx, cy, pixels, half, values):
            return False
        columns, slot = COLUMNS, 0
        if length > 0.0:
            columns = fill_columns(models[0], pixels, at_x - cx, at_y - cy, shape, smear_x, smear_y)
            fill_model(models[0], systems[0], columns, pixels, shape)
        else:
            slot = model_at(pixels, models, systems, (at_x - cx, at_y - cy), shape)
        seen, found = np.empty(columns + 2), np.empty(columns + 2)
        for k in range(columns + 2):
            seen[k] = inner(models[slot, k], values)
        solve_model(seen, systems[slot], marker, found)
        dx, dy = found[2] / found[1], found[3] / found[1]
        out.x, out.y = at_x + dx, at_y + dy
        # The model is linear only nearby: another step starts from the nearest position of a cached model.
        near = abs(dx) <= _NEAR_PX and abs(dy) <= _NEAR_PX
        if near or round_ == _ROUNDS - 1 or not math.isfinite(out.x) or not math.isfinite(out.y):
            out.converged = near
            take_reading(values, seen, found, systems[slot], marker, out)
            break
        limit = 0.5 * shape.radius
        x_px += min(max(out.x - x_px, -limit), limit)
        y_px += min(max(out.y - y_px, -limit), limit)
    return True
