"""Where a stick's axis is in the picture and how its markers go around it, learned while it turns (compiled).

Each marker of a stick that turns is at p = c + R(ψ) q, with ψ the direction of the line through both markers: linear in
the axis c and the two arms q, so that sums over the frames so far are all that is kept. Tilt makes circles into
ellipses; for finding a marker again a few pixels do not matter.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from torsight.core.compiled import compiled, lending
from tracker.appearance.disc import Floats, Record
from tracker.appearance.lucas_kanade import Point, inner, invert

PARTS: Final = 36
AXIS: Final = np.dtype(
    [
        ("known", "i8"),
        ("centre", "f8", (2,)),
        ("arm", "f8", (2, 2)),
        ("normal", "f8", (6, 6)),
        ("right", "f8", (6,)),
        ("last_rad", "f8"),
        ("seen", "i8", (PARTS,)),
        ("supposed", "i8"),
    ]
)
"""Axis c and arms q (inner, outer), px, in the picture of the camera as it stood at the start; their normal equations;
the direction at which a frame was added last; how many frames were added of each ten degrees; whether there was a
first guess."""
_PRIOR: Final = 0.05
"""Weight of the first guess of the axis, in frames: two frames outweigh it forty times."""
_STEP_RAD: Final = math.radians(3.0)
"""How far the stick has to turn before another frame is added: closer ones tell the same."""
_ENOUGH: Final = 12
"""Frames that are added of each part: four swings past it."""
_ARC: Final = 3
"""Parts of ten degrees in which the stick was seen from which the axis is known well enough to look around it."""


@lending
def folded(angle: float) -> float:
    """Return an angle within half a turn of zero."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


@lending
def turned(one: float, other: float) -> float:
    """Return the size of the angle between two directions."""
    return abs(folded(one - other))


@compiled
def suppose_axis(axis: Record, x: float, y: float) -> None:
    """Take a first guess of the axis, which motion will soon outweigh."""
    axis.supposed = 1
    for k, value in ((0, x), (1, y)):
        axis.normal[k, k] += _PRIOR
        axis.right[k] += _PRIOR * value
    solve_axis(axis)


@compiled
def learn_axis(axis: Record, inner: Point, outer: Point) -> None:
    """Take in one frame with both markers, if it is of something new."""
    angle = math.atan2(outer[1] - inner[1], outer[0] - inner[0])
    if turned(angle, axis.last_rad) < _STEP_RAD:
        return
    part = int((angle % (2.0 * math.pi)) / (2.0 * math.pi) * PARTS) % PARTS
    if axis.seen[part] >= _ENOUGH:
        return
    axis.seen[part] += 1
    axis.last_rad = angle
    add_frame(axis.normal, axis.right, angle, inner, outer)
    solve_axis(axis)


@compiled
def add_frame(normal: Floats, right: Floats, angle: float, inner: Point, outer: Point) -> None:
    """Add one frame to the normal equations of (c, q_inner, q_outer)."""
    cos, sin = math.cos(angle), math.sin(angle)
    row = np.zeros(6)
    for end, point in ((0, inner), (1, outer)):
        at = 2 + 2 * end
        for k in range(2):
            row[:] = 0.0
            row[k] = 1.0
            row[at], row[at + 1] = (cos, -sin) if k == 0 else (sin, cos)
            for i in range(6):
                right[i] += row[i] * point[k]
                for j in range(6):
                    normal[i, j] += row[i] * row[j]


@compiled
def solve_axis(axis: Record) -> None:
    """Solve the normal equations."""
    parts = 0
    for k in range(PARTS):
        parts += axis.seen[k] > 0
    axis.known = parts >= (1 if axis.supposed else _ARC)
    if axis.known:
        inverse, right = invert(axis.normal.copy()), axis.right.copy()
        for k in range(2):
            axis.centre[k] = inner(inverse[k], right)
            for end in range(2):
                axis.arm[end, k] = inner(inverse[2 + 2 * end + k], right)


@lending
def arm_px(axis: Record, end: int) -> float:
    """Return the distance of the inner (0) or outer (1) marker from the axis."""
    return math.hypot(axis.arm[end, 0], axis.arm[end, 1])


@lending
def direction_from(axis: Record, x: float, y: float, end: int) -> float:
    """Return the stick's direction when one of its markers is at a place."""
    return math.atan2(y - axis.centre[1], x - axis.centre[0]) - math.atan2(axis.arm[end, 1], axis.arm[end, 0])


@lending
def on_circle(axis: Record, direction_rad: float, end: int) -> Point:
    """Return where a marker is when the stick points in a direction."""
    cos, sin, qx, qy = math.cos(direction_rad), math.sin(direction_rad), axis.arm[end, 0], axis.arm[end, 1]
    return axis.centre[0] + cos * qx - sin * qy, axis.centre[1] + sin * qx + cos * qy
