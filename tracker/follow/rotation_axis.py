"""Where a stick's axis is in the picture and how its markers go around it, learned while it turns (compiled).

Each marker of a stick that turns is at p = c + q exp(iψ) in the complex plane, with ψ the direction of the line through
both markers: linear in the axis c and the two arms q, so that four sums over the frames so far are all that is kept.
Tilt makes circles into ellipses; for finding a marker again a few pixels do not matter.
"""

from __future__ import annotations

import cmath
import math
from typing import Final

import numpy as np

from torsight.core.compiled import compiled, internal, lending, shared
from tracker.appearance.disc import Record
from tracker.appearance.lucas_kanade import Point
from tracker.innovation import SIGMAS

AXIS: Final = np.dtype(
    [
        ("known", "i8"),
        ("centre", "f8", (2,)),
        ("arm", "f8", (2, 2)),
        ("frames", "f8"),
        ("unit", "c16"),
        ("places", "c16"),
        ("back", "c16", (2,)),
        ("guess", "c16"),
        ("guessed", "f8"),
        ("last_rad", "f8"),
    ]
)
"""Axis c and arms q (inner, outer), px, in the picture of the camera as it stood at the start. Sums over the frames
that were added: their number, exp(iψ), both places, and each place times exp(−iψ). A first guess of the axis, and its
weight. The direction at which a frame was added last."""
STANDS_PX: Final = 0.8
"""Standard deviation of a marker against where it should be: noise, and an edge of the other stick nearby."""
OFF_CIRCLE_PX: Final = 5.0
"""Three standard deviations of a marker's distance from its axis: what a first guess of the axis is off."""
_KNOWN: Final = (SIGMAS * STANDS_PX / OFF_CIRCLE_PX) ** 2
"""Weight, in frames, from which the axis is known as well as that."""
STEP_RAD: Final = math.radians(3.0)
"""How far the stick has to turn before another frame is added: closer ones tell the same."""


@lending
def folded(angle: float) -> float:
    """Return an angle within half a turn of zero."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


@shared
def turned(one: float, other: float) -> float:
    """Return the size of the angle between two directions."""
    return abs(folded(one - other))


@compiled
def suppose_axis(axis: Record, x: float, y: float, sigma_px: float) -> None:
    """Take a first guess of the axis and its standard deviation, which motion will soon outweigh."""
    axis.guess, axis.guessed = complex(x, y), (STANDS_PX / sigma_px) ** 2
    solve_axis(axis)


@compiled
def learn_axis(axis: Record, inner: Point, outer: Point) -> None:
    """Take in one frame with both markers, if it is of something new."""
    angle = math.atan2(outer[1] - inner[1], outer[0] - inner[0])
    if turned(angle, axis.last_rad) < STEP_RAD:
        return
    axis.last_rad = angle
    unit, one, two = cmath.exp(1j * angle), complex(inner[0], inner[1]), complex(outer[0], outer[1])
    axis.frames += 1.0
    axis.unit += unit
    axis.places += one + two
    axis.back[0] += one / unit
    axis.back[1] += two / unit
    solve_axis(axis)


@lending
def carry_axis(axis: Record, turn: complex, step: complex) -> None:
    """Take in that the picture is turned, by a complex number of size one, and then shifted: places, not arms."""
    axis.back += step * (turn * axis.unit).conjugate()
    axis.unit *= turn
    axis.places = turn * axis.places + 2.0 * axis.frames * step
    axis.guess = turn * axis.guess + step
    axis.last_rad += cmath.phase(turn)
    solve_axis(axis)


@shared
def axis_weight(axis: Record) -> float:
    """Return how well the axis is known: over how many markers, each with an error of its own, its place is a mean."""
    turned_frames = 2.0 * axis.frames - 2.0 * abs(axis.unit) ** 2 / max(axis.frames, 1.0)
    return axis.guessed + turned_frames  # type: ignore[no-any-return]


@internal
def solve_axis(axis: Record) -> None:
    """Solve the normal equations: of the arms for a given axis, so that one equation is left for that."""
    n, weight = axis.frames, axis_weight(axis)
    axis.known = n > 0.0 and (axis.guessed > 0.0 or weight > _KNOWN)
    if axis.known:
        right = axis.guessed * axis.guess + axis.places - axis.unit * (axis.back[0] + axis.back[1]) / n
        centre = right / weight
        axis.centre[0], axis.centre[1] = centre.real, centre.imag
        for end in range(2):
            arm = (axis.back[end] - centre * axis.unit.conjugate()) / n
            axis.arm[end, 0], axis.arm[end, 1] = arm.real, arm.imag


@shared
def arm_px(axis: Record, end: int) -> float:
    """Return the distance of the inner (0) or outer (1) marker from the axis."""
    return math.hypot(axis.arm[end, 0], axis.arm[end, 1])


@shared
def direction_from(axis: Record, x: float, y: float, end: int) -> float:
    """Return the stick's direction when one of its markers is at a place."""
    return math.atan2(y - axis.centre[1], x - axis.centre[0]) - math.atan2(axis.arm[end, 1], axis.arm[end, 0])


@shared
def on_circle(axis: Record, direction_rad: float, end: int) -> Point:
    """Return where a marker is when the stick points in a direction."""
    cos, sin, qx, qy = math.cos(direction_rad), math.sin(direction_rad), axis.arm[end, 0], axis.arm[end, 1]
    return axis.centre[0] + cos * qx - sin * qy, axis.centre[1] + sin * qx + cos * qy
