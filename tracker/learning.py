"""What a usual frame leaves behind, compiled: histories, gauges, shapes, and the row that is noted of it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from torsight.core.compiled import njit
from tracker.compiled import GREW, LIGHT, PATCH, RESIDUAL, SLOPE_X, STEP, XX, X, Y
from tracker.fields import (
    AT_X,
    AT_Y,
    CHANGE,
    COUNT,
    FIRST_RADIUS,
    GAUGE,
    HISTORY,
    LENGTH,
    LOST,
    MISSES,
    MOVING,
    RANGE,
    SHARE,
    SHIFT,
    SHUTTER_KNOWN,
    SLOPE,
    ZERO,
)
from tracker.render import RADIUS, STRETCH_E, STRETCH_F, Floats, Pixels
from tracker.rules import CHANGE_PX, GAUGE_RATE, KEPT, LIGHT_RATE, MOST_STRETCH, RATE, SHARP_PX, STALE

Looks = tuple[
    tuple[Pixels, Pixels, Pixels, Pixels],
    tuple[Floats, Floats, Floats, Floats],
    tuple[Floats, Floats, Floats, Floats],
    tuple[Floats, Floats, Floats, Floats],
]
"""Of the four markers: pixels, shapes, models, extras (see :mod:`tracker.compiled`)."""
Single = NDArray[np.float32]
Row = tuple[Floats, Floats, Single, Single, Single, NDArray[np.uint8]]
"""Positions, covariances, light, step, residual and state of a row (see :mod:`tracker.rows`)."""


@njit(cache=True, nogil=True)
def ways(marker: Floats, time_s: float) -> Floats:
    """Return where a marker's last readings carry it (4, 2): at rest, steady, averaged over three steps, curved."""
    out = np.empty((4, 2))
    count = int(marker[COUNT])
    h = marker[HISTORY : HISTORY + 3 * count].reshape(-1, 3)
    for axis in (1, 2):
        out[:, axis - 1] = h[count - 1, axis]
    if count < 2:
        return out
    t1, t2, t0 = h[count - 1, 0], h[count - 2, 0], h[0, 0]
    for axis in (1, 2):
        out[1:, axis - 1] = h[count - 1, axis] + (time_s - t1) / (t1 - t2) * (h[count - 1, axis] - h[count - 2, axis])
    if count < 3:
        return out
    t3 = h[count - 3, 0]
    # Lagrange's parabola through the last three readings, whatever their spacing.
    a = (time_s - t2) * (time_s - t3) / ((t1 - t2) * (t1 - t3))
    b = (time_s - t1) * (time_s - t3) / ((t2 - t1) * (t2 - t3))
    c = (time_s - t1) * (time_s - t2) / ((t3 - t1) * (t3 - t2))
    for axis in (1, 2):
        out[2, axis - 1] = h[count - 1, axis] + (time_s - t1) / (t1 - t0) * (h[count - 1, axis] - h[0, axis])
        out[3, axis - 1] = a * h[count - 1, axis] + b * h[count - 2, axis] + c * h[count - 3, axis]
    return out


@njit(cache=True, nogil=True)
def learn_fit(marker: Floats, reading: Floats) -> None:
    """Take in how well a good reading fits."""
    step = max(abs(reading[STEP]), 1.0)
    for k, value in ((2, reading[RESIDUAL]), (4, reading[PATCH])):
        off = math.log(max(value, 1e-3) / step) - marker[GAUGE + k]
        marker[GAUGE + k] += GAUGE_RATE * off
        marker[GAUGE + k + 1] += GAUGE_RATE * (abs(off) - marker[GAUGE + k + 1])


@njit(cache=True, nogil=True)
def learn_shape(marker: Floats, reading: Floats, shape: Floats, extras: Floats) -> None:
    """Follow slow changes of shape and light; the template is rendered anew once they are large enough to matter."""
    for k in range(3):
        marker[CHANGE + k] += RATE * (reading[GREW + k] - marker[CHANGE + k])
    for k in range(2):
        marker[SLOPE + k] += RATE * (reading[SLOPE_X + k] - marker[SLOPE + k])
    radius = shape[RADIUS] + marker[CHANGE]
    e, f = marker[CHANGE + 1], marker[CHANGE + 2]
    if max(abs(marker[CHANGE]), abs(e) * radius, abs(f) * radius) < CHANGE_PX:
        return
    e, f = shape[STRETCH_E] + e, shape[STRETCH_F] + f
    if 0.7 < radius / marker[FIRST_RADIUS] < 1.4 and math.hypot(e, f) <= MOST_STRETCH:
        shape[RADIUS], shape[STRETCH_E], shape[STRETCH_F] = radius, e, f
        extras[:, -1] = 0.0
    marker[CHANGE : CHANGE + 3] = 0.0


@njit(cache=True, nogil=True)
def take(marker: Floats, time_s: float, reading: Floats, shift: Floats) -> None:
    """Note a good reading in a marker's history."""
    x, y = reading[X] - shift[0], reading[Y] - shift[1]
    count = int(marker[COUNT])
    if marker[LOST] > 0.0:
        # Only readings close to each other tell a velocity.
        kept = min(count, 1) if marker[LOST] <= 3.0 else 0
        for k in range(3 * kept):
            marker[HISTORY + k] = marker[HISTORY + 3 * (count - 1) + k]
        count = kept
    elif count == KEPT:
        guesses = ways(marker, time_s)
        for way in range(4):
            miss = (x - guesses[way, 0]) ** 2 + (y - guesses[way, 1]) ** 2
            marker[MISSES + way] += RATE * (miss - marker[MISSES + way])
        for k in range(3 * (KEPT - 1)):
            marker[HISTORY + k] = marker[HISTORY + k + 3]
        count = KEPT - 1
    marker[HISTORY + 3 * count], marker[HISTORY + 3 * count + 1], marker[HISTORY + 3 * count + 2] = time_s, x, y
    marker[COUNT] = count + 1.0
    marker[AT_X], marker[AT_Y], marker[LOST] = reading[X], reading[Y], 0.0


@njit(cache=True, nogil=True)
def note(
    time_s: float, markers: Floats, common: Floats, looks: Looks, readings: Floats, steps: Floats,
    seen: NDArray[np.bool_],
) -> None:  # fmt: skip
    """Take in what was read of all four markers."""
    base = 2 - 2 * int(common[MOVING])
    for index in range(4):
        marker, reading = markers[index], readings[index]
        if not seen[index]:
            marker[AT_X] = common[ZERO + 2 * (index - base)] + common[SHIFT]
            marker[AT_Y] = common[ZERO + 2 * (index - base) + 1] + common[SHIFT + 1]
            marker[LOST] += 1.0
            if marker[LOST] > STALE:
                marker[COUNT] = 0.0
            continue
        marker[GAUGE] += LIGHT_RATE * (reading[LIGHT] - marker[GAUGE])
        marker[GAUGE + 1] += LIGHT_RATE * (abs(reading[STEP]) - marker[GAUGE + 1])
        length = math.hypot(steps[index, 0], steps[index, 1])
        if length < SHARP_PX or (common[SHUTTER_KNOWN] > 0.0 and common[SHARE] * length < SHARP_PX):
            learn_fit(marker, reading)
            learn_shape(marker, reading, looks[1][index], looks[3][index])
        take(marker, time_s, reading, common[SHIFT : SHIFT + 2])
    for stick in range(2):
        one, two = readings[2 * stick], readings[2 * stick + 1]
        if seen[2 * stick] and seen[2 * stick + 1]:
            length = math.hypot(two[X] - one[X], two[Y] - one[Y])
            common[LENGTH + stick] += 0.2 * (length - common[LENGTH + stick])
            common[RANGE + 2 * stick] = min(common[RANGE + 2 * stick], common[LENGTH + stick])
            common[RANGE + 2 * stick + 1] = max(common[RANGE + 2 * stick + 1], common[LENGTH + stick])


@njit(cache=True, nogil=True)
def write_row(row: Row, readings: Floats, seen: NDArray[np.bool_], codes: tuple[int, int]) -> None:
    """Write what is noted of the frame; ``codes`` of a marker that is seen, and of one under the other stick."""
    position, covariance, light, step, residual, state = row
    for index in range(4):
        reading = readings[index]
        state[index] = codes[0] if seen[index] else codes[1]
        for k in range(2):
            position[index, k] = reading[X + k] if seen[index] else np.nan
        for k in range(3):
            covariance[index, k] = reading[XX + k] if seen[index] else np.nan
        light[index] = reading[LIGHT] if seen[index] else 0.0
        step[index] = reading[STEP] if seen[index] else 0.0
        residual[index] = reading[RESIDUAL] if seen[index] else 0.0
