"""Exposure as a share of the frame interval, learned from the motion blur of fast markers of any kind (compiled)."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from torsight.core.compiled import compiled, internal, lending, shared
from torsight.core.units import Floats
from tracker.appearance.disc import Record, fill_beside, smear_count, smeared_point, window_pixels
from tracker.appearance.lucas_kanade import (
    RATE,
    SHARP_PX,
    Luma,
    Point,
    inner,
    invert,
    least,
    products,
    take_away,
    take_values,
)

SHARES: Final = np.array([0.0, 0.075, 0.15, 0.3, 0.45, 0.6, 0.75, 0.9, 1.05])
"""Shares of the frame interval that are tried; the shortest blurs a marker that moves by 25 px per frame by two."""
EXPOSURE: Final = np.dtype([("share", "f8"), ("misfit", "f8", (len(SHARES),)), ("looks", "f8"), ("fast", "i8")])
"""What is known of the exposure: its share, the logarithm of the residual at each of ``SHARES`` above the smallest (a
mean of the total weight ``looks``), and the number of fast readings."""
CLEAR: Final = 0.15
"""Difference in the logarithm of the residual by which motion blur has to fit better than none: compression softens
moving markers, which looks a little like motion blur."""
LEARNED: Final = round(1.0 / RATE)
"""Fast readings after which the exposure counts as known: as many as a running mean covers."""
_SLACK_UNKNOWN: Final = 0.1
_SLACK_KNOWN: Final = 0.015
"""Allowance for motion blur before and after the exposure is known: share of the brightness step, per root of the
motion in px per frame. While it is not known, a sharp template is fitted to dots blurred along up to the whole motion:
measured over radii of 3 to 15 px, the residual stays below a tenth of the brightness step times the root of the
length."""


@lending
def is_sharp(exposure: Record, length: float) -> bool:
    """Return whether a marker that moves by ``length`` px per frame is known to be sharp enough to show its shape."""
    return length < SHARP_PX or (exposure.fast >= LEARNED and exposure.share * length < SHARP_PX)


@shared
def smear_slack(exposure: Record, length: float) -> float:
    """Return the residual allowed for motion blur, as a share of the brightness step."""
    if length < 0.5:
        return 0.0
    return (_SLACK_KNOWN if exposure.fast >= LEARNED else _SLACK_UNKNOWN) * math.sqrt(length)


@compiled
def is_due(exposure: Record) -> bool:
    """Count a fast reading; return whether motion blurs of several lengths are compared in it.

    A comparison costs as much as several frames, and the exposure seldom changes: the intervals grow with the number of
    readings, from one once it is known.
    """
    exposure.fast += 1
    return bool(exposure.fast % (1 + exposure.fast // LEARNED) == 0)


@compiled
def learn_exposure(exposure: Record, misfits: Floats, motion: float) -> None:
    """Update the exposure by the residuals that motion blurs by each of ``SHARES`` leave.

    ``motion`` is that per frame, over the marker's width. Motion blur widens a marker by the square of its length, so a
    path shorter than the marker has the square of their ratio as its weight: many slow readings, which carry little
    information, do not outweigh a fast one.
    """
    look = min(1.0, motion**2)
    exposure.looks += look * (1.0 - RATE * exposure.looks)
    # A residual of a thousandth of the step is that of the model itself.
    lowest = misfits[least(misfits)] + 1e-3
    for i in range(len(misfits)):
        off = min(math.log((misfits[i] + 1e-3) / lowest), 2.0)
        exposure.misfit[i] += look / exposure.looks * (off - exposure.misfit[i])
    exposure.share = best_share(exposure.misfit)


@shared
def best_share(misfit: Floats) -> float:
    """Return the share of least misfit, on the parabola through three shares; 0 where no blur is clearly better."""
    at = min(max(least(misfit), 1), len(SHARES) - 2)
    before, middle, after, first = SHARES[at - 1], SHARES[at], SHARES[at + 1], misfit[at - 1]
    rise = (misfit[at] - first) / (middle - before)
    bend = ((misfit[at + 1] - first) / (after - before) - rise) / (after - middle)
    best = after if rise < 0.0 else before
    if bend > 0.0:
        best = min(max(0.5 * (before + middle - rise / bend), before), after)
    lowest = first + (best - before) * (rise + bend * (best - middle))
    return best if misfit[0] - lowest >= CLEAR else 0.0


def share_limits(misfit: Floats) -> tuple[float, float]:
    """Return bounds of the exposure's share: the shares nearest to the best one that fit worse by ``CLEAR``."""
    at, refused = int(np.argmin(misfit)), np.flatnonzero(misfit - misfit.min() >= CLEAR)
    below, above = refused[refused < at], refused[refused > at]
    low = float(SHARES[below[-1]]) if len(below) else 0.0
    # No exposure is longer than a frame; a larger share is tried only to interpolate around 0.9.
    return low, min(float(SHARES[above[0]]), 1.0) if len(above) else 1.0


@internal
def residual_share(rows: Floats, values: Floats) -> float:
    """Return a linear fit's rms residual over the coefficient of row 1, the brightness step; negative without one."""
    columns, n = rows.shape
    inverse, right, left = invert(products(rows, columns)), np.empty(columns), values.copy()
    for m in range(columns):
        right[m] = inner(rows[m], values)
    for m in range(columns):
        take_away(left, rows[m], inner(inverse[m], right))
    step = abs(inner(inverse[1], right))
    return -1.0 if step <= 1.0 else math.sqrt(inner(left, left) / max(1, n - columns)) / step


@compiled
def smear_misfits(luma: Luma, place: Point, shape: Record, path: Point, out: Floats) -> bool:
    """Compute a dot's residual over the brightness step for motion blur along each of ``SHARES`` of a path.

    Return False where there is no result. Window and columns are the same for all shares, and the shape is taken as
    known: a stretched dot looks much like a short blur. The stick's own edges are modelled by ramps with the variance
    of a pixel, the lens's blur and the motion blur together. If their width came from motion blur alone, blur by the
    lens would be taken for it.
    """
    (x_px, y_px), (path_x, path_y) = place, path
    length = math.hypot(path_x, path_y)
    radius = shape.window + math.ceil(0.5 * length)
    pixels = window_pixels(radius)
    n = pixels.shape[1]
    values, rows = np.empty(n), np.empty((6, n))
    cx, cy = math.floor(x_px + 0.5), math.floor(y_px + 0.5)
    if not take_values(luma, cx, cy, pixels, math.ceil(radius), values):
        return False
    for k in range(len(SHARES)):
        smear_x, smear_y = SHARES[k] * path_x, SHARES[k] * path_y
        count = smear_count(math.hypot(smear_x, smear_y), shape.edge)
        for i in range(n):
            x, y = pixels[0, i] - (x_px - cx), pixels[1, i] - (y_px - cy)
            d, along_x, along_y = smeared_point(x, y, shape, smear_x, smear_y, count)
            rows[0, i], rows[1, i], rows[2, i], rows[3, i] = 1.0, d, -along_x, -along_y
        ramp = math.sqrt(1.0 + 12.0 * shape.edge**2 + (SHARES[k] * length) ** 2)
        columns = fill_beside(rows, 4, pixels, x_px - cx, y_px - cy, shape, (path_x, path_y), ramp)
        out[k] = residual_share(rows[:columns], values)
        if out[k] < 0.0:
            return False
    return True
