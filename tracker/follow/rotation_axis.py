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
        ("guessed_across", "c16"),
        ("sigma", "f8"),
        ("last_rad", "f8"),
    ]
)
"""Axis c and arms q (inner, outer), px, in the picture of the camera at its position at the start. Sums over the frames
that were added: their number, exp(iψ), both positions, and each position times exp(−iψ). A first guess g of the axis,
with the information matrix that multiplies z to guessed · z + guessed_across · conj(z), in units of one frame's. The
standard deviation of c along its least known direction, px, infinite where nothing is known. The direction at which a
frame was last added."""
STANDS_PX: Final = 0.8
"""Standard deviation of a marker's position from the expected one: noise, and an edge of the other stick nearby."""
OFF_CIRCLE_PX: Final = 5.0
"""Three standard deviations of a marker's distance from its axis, if the axis is known: tilt, and an edge nearby."""
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
def suppose_axis(axis: Record, one: tuple[Point, Point], other: tuple[Point, Point], radius_px: float) -> None:
    """Set a first guess of the axis from the markers (inner, outer) of both sticks; motion soon outweighs it.

    The axis lies on the middle line of a stick to within a marker's radius, and beyond its inner marker, by half a
    stick's length give or take as much.
    """
    weight, across, right = 0.0, 0j, 0j
    for (near_x, near_y), (far_x, far_y) in (one, other):
        along = complex(near_x - far_x, near_y - far_y)
        half = 0.5 * abs(along)
        unit, at = along / (2.0 * half), complex(near_x, near_y) + 0.5 * along
        sides = (STANDS_PX / radius_px) ** 2, (STANDS_PX / half) ** 2
        own, own_across = 0.5 * (sides[0] + sides[1]), 0.5 * (sides[1] - sides[0]) * unit**2
        weight, across, right = weight + own, across + own_across, right + own * at + own_across * at.conjugate()
    axis.guessed, axis.guessed_across, axis.guess = weight, across, solved(weight, across, right)
    solve_axis(axis)


@lending
def solved(weight: float, across: complex, right: complex) -> complex:
    """Return z of weight · z + across · conj(z) = right, with ``weight`` larger than the modulus of ``across``."""
    return (weight * right - across * right.conjugate()) / (weight**2 - abs(across) ** 2)


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
    """Transform the sums for a picture that is turned, rolled and scaled, by a complex number, and then shifted."""
    size = abs(turn)
    axis.unit *= turn / size
    for end in range(2):
        axis.back[end] = size * axis.back[end] + step * axis.unit.conjugate()
    axis.places = turn * axis.places + 2.0 * axis.frames * step
    axis.guess = turn * axis.guess + step
    axis.guessed_across *= (turn / size) ** 2
    axis.last_rad += cmath.phase(turn)
    solve_axis(axis)


@internal
def solve_axis(axis: Record) -> None:
    """Solve the normal equations: eliminating the arms leaves one equation for the axis."""
    n = axis.frames
    weight = axis.guessed + 2.0 * n - 2.0 * abs(axis.unit) ** 2 / max(n, 1.0)
    least = weight - abs(axis.guessed_across)
    axis.known, axis.sigma = 0, np.inf
    # Rounding of the sums of a stick that was guessed nothing and has not turned.
    if n > 0.0 and least > 1e-9 * n:
        axis.known, axis.sigma = 1, STANDS_PX / math.sqrt(least)
        right = axis.guessed * axis.guess + axis.guessed_across * axis.guess.conjugate()
        right += axis.places - axis.unit * (axis.back[0] + axis.back[1]) / n
        centre = solved(weight, axis.guessed_across, right)
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
