"""How long the shutter is open: fast markers leave a smear, from which it is learned (compiled).

``rig`` is the record that holds ``shutter_share`` (of the frame interval), ``shutter_cost`` of every share that is
tried, a mean over ``shutter_looks``, and ``fast``, how many fast readings there were.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from torsight.core.compiled import compiled, internal, lending, shared
from torsight.core.units import Floats
from tracker.appearance.disc import Record, fill_beside, smear_count, smeared_point, window_pixels
from tracker.appearance.lucas_kanade import (
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

SHARES: Final = np.array([0.0, 0.15, 0.3, 0.45, 0.6, 0.75, 0.9, 1.05])
"""Shares of the frame interval that are tried."""
_RATE: Final = 0.15
"""Share of a new whole look in the account. A smear makes a dot wider by the square of its length, so a path that is
shorter than the dot is wide counts by the square of its share of that: many slow looks, which tell nothing, do not
outweigh a fast one."""
_CLEAR: Final = 0.15
"""By how much (of the logarithm of the residual) a smear has to fit better than none: compression softens moving dots,
and that looks a little like a smear."""
_LEARNED: Final = 12
"""Fast readings after which the shutter counts as known: by then a first look has a weight below 0.15."""
_OFTEN, _SELDOM = 4, 200
"""Every so many fast readings are looked at once the shutter is known, and well known: a look costs as much as several
frames, and a shutter seldom changes."""
_SLACK_UNKNOWN: Final = 0.1
_SLACK_KNOWN: Final = 0.015
"""Allowance for smear, before and after the shutter is known: share of the step, per root of the speed in px. While it
is not known a sharp template meets smears of up to the whole step: measured over radii of 3 to 15 px their residual
stays below a tenth of the step times the root of the length."""


@lending
def shutter_known(rig: Record) -> bool:
    """Return whether enough fast readings have been seen."""
    return bool(rig.fast >= _LEARNED)


@lending
def is_sharp(rig: Record, length: float) -> bool:
    """Return whether a marker that moves by a length per frame is known to be sharp enough to show its shape."""
    return length < SHARP_PX or (shutter_known(rig) and rig.shutter_share * length < SHARP_PX)


@shared
def smear_slack(rig: Record, length: float) -> float:
    """Return by which share of the brightness step a fit may be worse than at rest."""
    if length < 0.5:
        return 0.0
    return (_SLACK_KNOWN if shutter_known(rig) else _SLACK_UNKNOWN) * math.sqrt(length)


@internal
def learn_shutter(rig: Record, shape: Record, luma: Luma, place: Point, path: Point) -> None:
    """Take in a fast marker; every now and then compare how well smears of several lengths fit its picture."""
    rig.fast += 1
    every = 1 if rig.fast <= 2 * _LEARNED else (_OFTEN if rig.fast <= 8 * _LEARNED else _SELDOM)
    costs = np.empty(len(SHARES))
    if rig.fast % every or not smear_misfits(luma, place, shape, path, SHARES, costs):
        return
    costs = np.log(costs + 1e-3)
    look = min(1.0, (path[0] ** 2 + path[1] ** 2) / (2.0 * shape.radius) ** 2)
    rig.shutter_looks += look * (1.0 - _RATE * rig.shutter_looks)
    lowest = costs[least(costs)]
    for i in range(len(costs)):
        rig.shutter_cost[i] += look / rig.shutter_looks * (min(costs[i] - lowest, 2.0) - rig.shutter_cost[i])
    rig.shutter_share = best_share(rig.shutter_cost)


@shared
def best_share(cost: Floats) -> float:
    """Return the share of least cost, between the ones that were tried."""
    at = least(cost)
    if cost[0] - cost[at] < _CLEAR:
        return 0.0
    if at == len(SHARES) - 1:
        return float(SHARES[at])
    bend = cost[at - 1] - 2.0 * cost[at] + cost[at + 1]
    off = 0.0 if bend <= 0.0 else 0.5 * (cost[at - 1] - cost[at + 1]) / bend
    return float(SHARES[at] + max(-0.5, min(0.5, off)) * (SHARES[1] - SHARES[0]))


def shutter_limits(cost: Floats) -> tuple[float, float]:
    """Return the shares between which the shutter's lies: those next to the best that fit worse by what is clear."""
    at, refused = int(np.argmin(cost)), np.flatnonzero(cost - cost.min() >= _CLEAR)
    below, above = refused[refused < at], refused[refused > at]
    low = float(SHARES[below[-1]]) if len(below) else 0.0
    # No shutter is open for longer than a frame; a share beyond is tried for the best one to have two neighbours.
    return low, min(float(SHARES[above[0]]), 1.0) if len(above) else 1.0


@internal
def residual_share(rows: Floats, values: Floats) -> float:
    """Return the residual of a linear fit over the coefficient of row 1, the step; negative where there is no step."""
    columns, n = rows.shape
    inverse, right, left = invert(products(rows, columns)), np.empty(columns), values.copy()
    for m in range(columns):
        right[m] = inner(rows[m], values)
    for m in range(columns):
        take_away(left, rows[m], inner(inverse[m], right))
    step = abs(inner(inverse[1], right))
    return -1.0 if step <= 1.0 else math.sqrt(inner(left, left) / max(1, n - columns)) / step


@compiled
def smear_misfits(luma: Luma, place: Point, shape: Record, path: Point, shares: Floats, out: Floats) -> bool:
    """Find how well smears along several shares of a path fit: the residual over the step; False where it is not told.

    Window and columns are the same for all shares, and the shape is taken as known: a stretched dot looks much like a
    short smear. The stick's own edges are as soft as the dot's, at rest already: a ramp of the variance of a pixel, the
    lens' blur and the smear stands for them. If the smear alone made them soft, blur would be taken for it.
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
    for k in range(len(shares)):
        smear_x, smear_y = shares[k] * path_x, shares[k] * path_y
        count = smear_count(math.hypot(smear_x, smear_y), shape.edge)
        for i in range(n):
            x, y = pixels[0, i] - (x_px - cx), pixels[1, i] - (y_px - cy)
            d, along_x, along_y = smeared_point(x, y, shape, smear_x, smear_y, count)
            rows[0, i], rows[1, i], rows[2, i], rows[3, i] = 1.0, d, -along_x, -along_y
        ramp = math.sqrt(1.0 + 12.0 * shape.edge**2 + (shares[k] * length) ** 2)
        columns = fill_beside(rows, 4, pixels, x_px - cx, y_px - cy, shape, (path_x, path_y), ramp)
        out[k] = residual_share(rows[:columns], values)
        if out[k] < 0.0:
            return False
    return True
