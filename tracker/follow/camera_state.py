"""How the picture lies against its start: shift and roll, by the base or by the moving stick's circles (compiled)."""

from __future__ import annotations

import cmath
import math
from typing import Final

import numpy as np

from torsight.core.compiled import compiled, copy_to, internal, lending, shared
from torsight.core.units import Floats
from tracker.appearance.disc import Record
from tracker.appearance.lucas_kanade import Point
from tracker.follow.rotation_axis import OFF_CIRCLE_PX, arm_px, carry_axis, folded, on_circle
from tracker.follow.state import Scene
from tracker.innovation import SIGMAS, passes
from tracker.rows import SEEN

SHAKE_PX: Final = 2.0
"""Standard deviation of where a camera that shakes points: the worst that is asked of the tracker, along each axis."""
_STEP_PX2: Final = 2.0 * SHAKE_PX**2
"""Variance of its step from one frame to the next, where both are independent."""
TURN_RAD: Final = math.radians(0.7)
"""Standard deviation of the base's direction while nothing confirms that the camera was rolled; what it is rolled by
beyond that is taken into the state."""
OFF_CIRCLE: Final = 0.1
"""Three standard deviations of a marker's distance from its axis, as a share, besides those in px: perspective."""
KNOWN: Final = 2
"""Votes from which it is known which stick lies above."""


@lending
def seen(scene: Scene, index: int) -> bool:
    """Return whether a marker's reading is taken."""
    return scene.readings[index].state == SEEN  # type: ignore[no-any-return]


@lending
def at(scene: Scene, index: int) -> Point:
    """Return where a marker is, or is expected where it was not read."""
    reading = scene.readings[index]
    if reading.state == SEEN:
        return reading.x, reading.y
    return reading.predicted[0], reading.predicted[1]


@shared
def circle_sigma_px(away_px: float, varies: float) -> float:
    """Return the standard deviation of the distance from the axis of a marker that is usually so far ``away_px``.

    Seen from aside circles are ellipses, as flat as the stick's own length ``varies``, as a share.
    """
    return ((OFF_CIRCLE + varies) * away_px + OFF_CIRCLE_PX) / SIGMAS


@shared
def own_circle_sigma_px(own: Record, end: int) -> float:
    """Return the same of a marker of a stick; ``own`` is a STICK."""
    return circle_sigma_px(arm_px(own.axis, end), own.longest / own.shortest - 1.0)


@shared
def circle_misfit(own: Record, shift: Floats, point: Point, end: int) -> float:
    """Return by how many standard deviations a place is off a marker's circle about the axis; 0 while unknown.

    ``own`` is a STICK, ``shift`` that of the picture.
    """
    axis = own.axis
    if not axis.known:
        return 0.0
    away = math.hypot(point[0] - axis.centre[0] - shift[0], point[1] - axis.centre[1] - shift[1])
    return abs(away - arm_px(axis, end)) / own_circle_sigma_px(own, end)


@compiled
def base_shift(base: Record, zero: Floats, shift: Floats) -> bool:
    """Find by how much the base's readings (2,) are off their places at the start (2, 2); return whether they tell."""
    count, x, y = 0, 0.0, 0.0
    for end in range(2):
        if base[end].state == SEEN:
            x += base[end].x - zero[end, 0]
            y += base[end].y - zero[end, 1]
            count += 1
    if count:
        shift[0], shift[1] = x / count, y / count
    return count > 0


@internal
def find_shift(scene: Scene) -> bool:
    """Find the shift of the picture; return whether anything tells it.

    That is the base, or the moving stick's circles while the base is not seen.
    """
    rig, i = scene.rig[0], 2 - 2 * scene.rig[0].moving
    copy_to(rig.shift_now, rig.shift)
    if base_shift(scene.readings[i : i + 2], rig.zero, rig.shift_now):
        return True
    off = np.empty((2, 2))
    # Under the base, or not known to be above it, what is seen of the moving stick may be the base's own dots.
    if rig.offset_known and rig.above >= KNOWN and circles_off(scene, off):
        x, y = 0.5 * (off[0, 0] + off[1, 0]) - rig.offset[0], 0.5 * (off[0, 1] + off[1, 1]) - rig.offset[1]
        away = (x - rig.shift[0]) ** 2 + (y - rig.shift[1]) ** 2
        if passes(away / (_STEP_PX2 * (2 + rig.unknown)), 2):
            rig.shift_now[0], rig.shift_now[1] = x, y
            return True
    return False


@internal
def circles_off(scene: Scene, out: Floats) -> bool:
    """Find how far either moving marker is from where its circle puts it (2, 2); False while that is not known."""
    stick = scene.rig[0].moving
    axis, i = scene.sticks[stick].axis, 2 * stick
    if not (axis.known and seen(scene, i) and seen(scene, i + 1)):
        return False
    (ax, ay), (bx, by) = at(scene, i), at(scene, i + 1)
    direction = math.atan2(by - ay, bx - ax)
    for end in range(2):
        x, y = on_circle(axis, direction, end)
        out[end, 0], out[end, 1] = scene.readings[i + end].x - x, scene.readings[i + end].y - y
    return True


@shared
def roll_of(scene: Scene, a: Point, b: Point) -> float:
    """Return by how much a base with its markers at two places says that the picture is turned."""
    start_rad = scene.sticks[1 - scene.rig[0].moving].start_rad
    return folded(math.atan2(b[1] - a[1], b[0] - a[0]) - start_rad)


@compiled
def goes_with_picture(scene: Scene, shift: Floats, roll_rad: float) -> bool:
    """Return whether the moving stick's circles allow a shift (2,) and a roll of the picture that the base tells.

    The picture moves as one: what went elsewhere alone is no base. Where one dot tells the shift a roll is not known.
    True while the circles are not known.
    """
    rig, own, off = scene.rig[0], scene.sticks[scene.rig[0].moving], np.empty((2, 2))
    if not circles_off(scene, off):
        return True
    x, y = own.axis.centre[0] - middle_of(rig.zero[:, 0]), own.axis.centre[1] - middle_of(rig.zero[:, 1])
    cos, sin = math.cos(roll_rad), math.sin(roll_rad)
    expected = (shift[0] + cos * x - sin * y - x, shift[1] + sin * x + cos * y - y)
    rolled_px = TURN_RAD * math.hypot(x, y)
    found = 0.0
    for end in range(2):
        apart = (off[end, 0] - expected[0]) ** 2 + (off[end, 1] - expected[1]) ** 2
        found += apart / (own_circle_sigma_px(own, end) ** 2 + rolled_px**2)
    return passes(found, 4)


@lending
def middle_of(ends: Floats) -> float:
    """Return the middle of a coordinate (2,) of both ends."""
    return 0.5 * (ends[0] + ends[1])  # type: ignore[no-any-return]


@compiled
def take_roll(scene: Scene, a: Point, b: Point) -> None:
    """Start anew from the picture as it is now, turned and shifted as a base with its markers at two places says.

    All places that are kept as in the picture at the start, of which a shift alone is known, are carried along.
    """
    rig, moving = scene.rig[0], scene.rig[0].moving
    roll_rad = roll_of(scene, a, b)
    turn = cmath.exp(1j * roll_rad)
    middle = complex(middle_of(rig.zero[:, 0]), middle_of(rig.zero[:, 1]))
    step = 0.5 * (complex(a[0], a[1]) + complex(b[0], b[1])) - turn * middle
    carry_axis(scene.sticks[moving].axis, turn, step)
    for end in range(2):
        carry(rig.zero[end], turn, step)
        marker = scene.markers[2 * moving + end]
        for k in range(marker.count):
            carry(marker.history[k, 1:], turn, step)
    carry(rig.offset, turn, 0j)
    scene.sticks[1 - moving].start_rad += roll_rad
    rig.last_rad = scene.sticks[1 - moving].start_rad
    rig.shift[:] = 0.0
    rig.shift_now[:] = 0.0
    rig.anchor[:] = 0.0


@lending
def carry(place: Floats, turn: complex, step: complex) -> None:
    """Turn a place (2,) about the picture's corner, and shift it."""
    now = turn * complex(place[0], place[1]) + step
    place[0], place[1] = now.real, now.imag
