"""Motion of the picture since the start, from the base or from the moving stick's circles (compiled).

The picture is shifted, rolled and scaled: a position z is carried to turn · z + step, in the complex plane. The state
holds the shift alone; where turn differs from 1 the present picture becomes the new start.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from torsight.core.compiled import compiled, internal, lending, shared
from torsight.core.units import Floats
from tracker.appearance.disc import Record
from tracker.appearance.lucas_kanade import Point
from tracker.follow.rotation_axis import OFF_CIRCLE_PX, arm_px, carry_axis, on_circle
from tracker.follow.state import Scene
from tracker.innovation import SIGMAS, passes
from tracker.rows import SEEN

SHAKE_PX: Final = 2.0
"""Standard deviation of the picture's shift along each axis by a shaking camera: the worst that the tracker is required
to follow."""
_STEP_PX2: Final = 2.0 * SHAKE_PX**2
"""Variance of the change of that shift from one frame to the next, if both are independent."""
TURN_RAD: Final = math.radians(0.7)
"""Standard deviation of the base's turn from one frame to the next, as a hand rolls a camera; a turn or a relative
change of scale that is larger than this makes the present picture the new start."""
OFF_CIRCLE: Final = 0.1
"""Three standard deviations of a marker's distance from its axis, relative, in addition to those in px: perspective."""
KNOWN: Final = 2
"""Votes from which it is known which stick lies above."""


@lending
def seen(scene: Scene, index: int) -> bool:
    """Return whether a marker's reading is accepted."""
    return scene.readings[index].state == SEEN  # type: ignore[no-any-return]


@lending
def at(scene: Scene, index: int) -> Point:
    """Return the position of a marker's reading, or its predicted position where it was not read."""
    reading = scene.readings[index]
    if reading.state == SEEN:
        return reading.x, reading.y
    return reading.predicted[0], reading.predicted[1]


@shared
def circle_sigma_px(away_px: float, varies: float) -> float:
    """Return the standard deviation of the distance to the axis of a marker whose usual distance is ``away_px``.

    In an oblique view circles are ellipses, with the relative flattening ``varies`` of the stick's own length.
    """
    return ((OFF_CIRCLE + varies) * away_px + OFF_CIRCLE_PX) / SIGMAS


@shared
def own_circle_sigma_px(own: Record, end: int) -> float:
    """Return the standard deviation, px, of the distance to the axis of a stick's marker; ``own`` is a STICK."""
    return math.hypot(circle_sigma_px(arm_px(own.axis, end), own.longest / own.shortest - 1.0), own.axis.sigma)


@lending
def beyond(own: Record, length: float) -> float:
    """Return by how much a length, px at the scale of the start, lies outside a stick's bounds; negative inside."""
    return max(length - own.longest, own.shortest - length)  # type: ignore[no-any-return]


@shared
def circle_misfit(own: Record, shift: Floats, point: Point, end: int) -> float:
    """Return the distance of a position from a marker's circle in standard deviations; 0 while the axis is unknown.

    ``own`` is a STICK, ``shift`` that of the picture.
    """
    axis = own.axis
    if not axis.known:
        return 0.0
    away = math.hypot(point[0] - axis.centre[0] - shift[0], point[1] - axis.centre[1] - shift[1])
    return abs(away - arm_px(axis, end)) / own_circle_sigma_px(own, end)


@compiled
def base_shift(base: Record, zero: Floats, shift: Floats) -> bool:
    """Set ``shift`` (2,) to the base's displacement since the start; return whether any of its readings is seen.

    ``base`` (2,) are its readings, ``zero`` (2, 2) its positions at the start.
    """
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
    """Measure the shift of the picture; return whether that was possible.

    It is measured on the base, or on the moving stick's circles while the base is not seen.
    """
    rig, i = scene.rig[0], 2 - 2 * scene.rig[0].moving
    if base_shift(scene.readings[i : i + 2], rig.zero, rig.shift_now):
        return True
    off = np.empty((2, 2))
    # Unless the moving stick is known to lie above the base, its readings may be of the base's own dots.
    if rig.offset_known and rig.above >= KNOWN and circles_off(scene, off):
        x, y = middle_of(off[:, 0]) - rig.offset[0], middle_of(off[:, 1]) - rig.offset[1]
        away = (x - rig.shift[0]) ** 2 + (y - rig.shift[1]) ** 2
        if passes(away / (_STEP_PX2 * (2 + rig.unknown)), 2):
            rig.shift_now[0], rig.shift_now[1] = x, y
            return True
    return False


@internal
def circles_off(scene: Scene, out: Floats) -> bool:
    """Compute the offsets (2, 2) of both moving markers from their circles; False while the axis is not known."""
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
def turn_of(scene: Scene, a: Point, b: Point) -> complex:
    """Return the picture's turn, exp(i roll) times its scale, for a base with its markers at two positions."""
    zero = scene.rig[0].zero
    return complex(b[0] - a[0], b[1] - a[1]) / complex(zero[1, 0] - zero[0, 0], zero[1, 1] - zero[0, 1])


@compiled
def goes_with_picture(scene: Scene, shift: Floats, turn: complex) -> bool:
    """Return whether the moving stick's circles are consistent with a shift (2,) and a turn measured on the base.

    The picture moves as a whole: dots that moved differently are not the base. The turn is not known where the shift
    comes from one dot, and is 1 then. True while the circles are not known.
    """
    rig, own, off = scene.rig[0], scene.sticks[scene.rig[0].moving], np.empty((2, 2))
    if not circles_off(scene, off):
        return True
    axis = complex(own.axis.centre[0], own.axis.centre[1])
    away = axis - complex(middle_of(rig.zero[:, 0]), middle_of(rig.zero[:, 1]))
    common, rolled_px, found, i = (turn - 1.0) * away, TURN_RAD * abs(away), 0.0, 2 * rig.moving
    for end in range(2):
        reading, moved = scene.readings[i + end], complex(off[end, 0] - shift[0], off[end, 1] - shift[1])
        on_circle_px = complex(reading.x - off[end, 0], reading.y - off[end, 1]) - axis
        apart = abs(moved - common - (abs(turn) - 1.0) * on_circle_px)
        found += apart**2 / (own_circle_sigma_px(own, end) ** 2 + rolled_px**2)
    # Both sticks have one scale: a base that is longer because one of its markers slides is not followed.
    (ax, ay), (bx, by), size = at(scene, i), at(scene, i + 1), own.size * abs(turn)
    beyond_px = max(size * beyond(own, math.hypot(bx - ax, by - ay) / size), 0.0)
    return passes(found, 4) and passes((beyond_px / circle_sigma_px(own.longest, 0.0)) ** 2, 1)


@lending
def middle_of(ends: Floats) -> float:
    """Return the middle of a coordinate (2,) of both ends."""
    return 0.5 * (ends[0] + ends[1])  # type: ignore[no-any-return]


@compiled
def take_turn(scene: Scene, a: Point, b: Point) -> None:
    """Make the present picture the new start, by the turn and shift of a base with its markers at two positions.

    All stored positions refer to the picture at the start, with a shift alone: they are transformed.
    """
    rig, moving = scene.rig[0], scene.rig[0].moving
    turn = turn_of(scene, a, b)
    size = abs(turn)
    middle = complex(middle_of(rig.zero[:, 0]), middle_of(rig.zero[:, 1]))
    step = 0.5 * (complex(a[0], a[1]) + complex(b[0], b[1])) - turn * middle
    own = scene.sticks[moving]
    carry_axis(own.axis, turn, step)
    own.length, own.size = size * own.length, size * own.size
    for end in range(2):
        carry(rig.zero[end], turn, step)
        marker = scene.markers[2 * moving + end]
        for k in range(marker.count):
            carry(marker.history[k, 1:], turn, step)
    carry(rig.offset, turn, 0j)
    for index in range(len(scene.markers)):
        shape = scene.markers[index].shape
        shape.radius, shape.strip = size * shape.radius, size * shape.strip
        for side in range(2):
            shape.edges[side] *= size
        scene.markers[index].first_radius *= size
        forget(scene.looks[index][2])
    rig.shift[:] = 0.0
    rig.shift_now[:] = 0.0
    rig.anchor[:] = 0.0


@lending
def forget(systems: Record) -> None:
    """Empty a marker's cache: its shape has changed."""
    for slot in range(len(systems)):
        systems[slot].filled = 0


@lending
def carry(place: Floats, turn: complex, step: complex) -> None:
    """Turn a position (2,) about the picture's corner, and shift it, in place."""
    now = turn * complex(place[0], place[1]) + step
    place[0], place[1] = now.real, now.imag
