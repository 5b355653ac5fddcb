"""Recursive estimate of a stick's axis and its markers' arms in the picture, while the stick turns (compiled).

Each marker of a stick that turns is at p = c + q exp(iψ) in the complex plane, with ψ the direction of the line through
both markers: linear in the axis c and the two arms q, so that four sums over the frames so far are sufficient. Tilt
turns circles into ellipses; for finding a marker again a few pixels do not matter.
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
"""Axis c and arms q (inner, outer), px, in the picture of the camera at its position at the start. Sums over the frames
that were added: their number, exp(iψ), both positions, and each position times exp(−iψ). A first guess of the axis, and
its weight. The direction at which a frame was last added."""
STANDS_PX: Final = 0.8
"""Standard deviation of a marker's position from the expected one: noise, and an edge of the other stick nearby."""
OFF_CIRCLE_PX: Final = 5.0
"""Three standard deviations of a marker's distance from its axis: the error of a first guess of the axis."""
_KNOWN: Final = (SIGMAS * STANDS_PX / OFF_CIRCLE_PX) ** 2
"""Weight, in frames, above which the axis is known as precisely as by that guess."""
STEP_RAD: Final = math.radians(3.0)
"""Turn of the stick after which another frame is added: closer frames carry no new information."""


@lending
def folded(angle: float) -> float:
    """Return an angle wrapped to [−π, π)."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


@shared
def turned(one: float, other: float) -> float:
    """Return the size of the angle between two directions."""
    return abs(folded(one - other))


@compiled
def suppose_axis(axis: Record, x: float, y: float, sigma_px: float) -> None:
    """Set a first guess of the axis and its standard deviation; motion soon outweighs it."""
    axis.guess, axis.guessed = complex(x, y), (STANDS_PX / sigma_px) ** 2
    solve_axis(axis)


@compiled
def learn_axis(axis: Record, inner: Point, outer: Point) -> None:
    """Add a frame with both markers to the sums, if the stick has turned by ``STEP_RAD`` since the last one."""
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
    """Transform the sums for a picture that is rotated by a complex number of modulus one, and then shifted."""
    axis.back += step * (turn * axis.unit).conjugate()
    axis.unit *= turn
    axis.places = turn * axis.places + 2.0 * axis.frames * step
    axis.guess = turn * axis.guess + step
    axis.last_rad += cmath.phase(turn)
    solve_axis(axis)


@shared
def axis_weight(axis: Record) -> float:
    """Return the axis' weight: the number of independent marker positions with the same precision."""
    turned_frames = 2.0 * axis.frames - 2.0 * abs(axis.unit) ** 2 / max(axis.frames, 1.0)
    return axis.guessed + turned_frames  # type: ignore[no-any-return]


@internal
def solve_axis(axis: Record) -> None:
    """Solve the normal equations: eliminating the arms leaves one equation for the axis."""
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
    """Return the distance of the inner (0) or outer (1) marker from the axis, px."""
    return math.hypot(axis.arm[end, 0], axis.arm[end, 1])


@shared
def direction_from(axis: Record, x: float, y: float, end: int) -> float:
    """Return the stick's direction for a position of its inner (0) or outer (1) marker."""
    return math.atan2(y - axis.centre[1], x - axis.centre[0]) - math.atan2(axis.arm[end, 1], axis.arm[end, 0])


@shared
def on_circle(axis: Record, direction_rad: float, end: int) -> Point:
    """Return the position of the inner (0) or outer (1) marker for a direction of the stick."""
    cos, sin, qx, qy = math.cos(direction_rad), math.sin(direction_rad), axis.arm[end, 0], axis.arm[end, 1]
    return axis.centre[0] + cos * qx - sin * qy, axis.centre[1] + sin * qx + cos * qy
