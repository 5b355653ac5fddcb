"""Tests of the readings of both sticks against each other: occlusion, a base at rest, circles (compiled).

The base moves only with the camera; the moving stick turns about an axis that is learned. Where the moving stick passes
over the base's markers these are held instead of read: two dots with the same appearance at the same position cannot be
distinguished.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from torsight.core.compiled import compiled, copy_to, internal, lending, shared
from torsight.core.units import Floats
from tracker.appearance.disc import Record
from tracker.appearance.lucas_kanade import Point
from tracker.follow.camera_state import (
    KNOWN,
    SHAKE_PX,
    TURN_RAD,
    at,
    base_shift,
    beyond,
    circle_misfit,
    circles_off,
    goes_with_picture,
    seen,
    turn_of,
)
from tracker.follow.motion_model import STALE, is_base
from tracker.follow.rotation_axis import STANDS_PX, turned
from tracker.follow.state import Scene
from tracker.innovation import SIGMAS, passes
from tracker.rows import HIDDEN, LOST, SEEN, SHADOWED

_LENGTH_PX: Final = 0.8
_LENGTH: Final = 0.01
"""Three standard deviations of the distance of a stick's markers: in px, by the noise of both; and relative, by the
tilt of 8 degrees that the sticks of a rig may have against each other."""
CLOSE: Final = 0.6
"""Distance from a base dot, in radii, below which dots cannot be distinguished."""
NEAR: Final = 1.6
"""The same after a gap, and for dots that show which stick is above: two dots touch at 2."""
UNSEEN_PX: Final = 2.0 * SHAKE_PX
"""Largest displacement of a base dot with the picture since it was seen."""
MOVED_RAD: Final = math.radians(1.0)
"""Turn that no base makes: a stick that has turned by more since the start is the moving one, and dots of the moving
stick that point away by more from the base's last direction are not the base's."""
MOST_VOTES: Final = 20
"""Limit of the sum of votes, in either direction."""
SOON: Final = 3
"""Frames after which a lost marker is no longer assumed to be near its prediction, and its last reading gives no speed:
by then :func:`tracker.follow.motion_model.jump_px` exceeds the stick's length."""
_ALONE, _TWO, _OWN = range(3)
"""One dot of the moving stick is seen; two are; both are known to be its own."""
BEYOND: Final = 0.6
"""Assumed length of a stick beyond each of its markers, over their distance."""
_ROOM_PX: Final = 2.5
"""Smallest distance of the moving stick's edge from the window of a base marker that is read: for blur and shadow."""


@shared
def to_strip(point: Point, a: Point, b: Point, beyond: float) -> float:
    """Return the distance of a point from the segment a–b, extended by a share of its length on both sides."""
    ux, uy = b[0] - a[0], b[1] - a[1]
    along = ((point[0] - a[0]) * ux + (point[1] - a[1]) * uy) / max(ux * ux + uy * uy, 1e-9)
    along = min(max(along, -beyond), 1.0 + beyond)
    return math.hypot(point[0] - a[0] - along * ux, point[1] - a[1] - along * uy)


@shared
def covers(scene: Scene, stick: int, point: Point, index: int) -> bool:
    """Return whether a stick, as read or predicted, reaches into the window of another stick's marker at a position.

    ``index`` is that of the marker.
    """
    i = 2 * stick
    shape = scene.markers[i].shape
    # Where its edges are not seen the stick is at least as wide as its dots' windows.
    width = shape.strip if math.isfinite(shape.strip) else shape.window
    away = to_strip(point, at(scene, i), at(scene, i + 1), BEYOND)
    return away < scene.markers[index].shape.radius + width + _ROOM_PX  # type: ignore[no-any-return]


# --- one rigid stick ------------------------------------------------------------------------------------------------


@lending
def _length_misfit(own: Record, length: float, lost: int) -> float:
    """Return the deviation of a distance between a stick's markers from the expected one, in standard deviations.

    In an oblique view the length changes as the stick turns: by more, the longer the stick was not seen, but within the
    bounds observed so far. That of the base changes with the camera's distance alone.
    """
    off = abs(length - own.length)
    if own.still:
        return SIGMAS * off / (_LENGTH_PX + _LENGTH * own.length)  # type: ignore[no-any-return]
    if lost > 0:
        off = min(off, own.size * max(beyond(own, length / own.size), 0.0))
    share = _LENGTH * (1.0 + 0.5 * min(lost, STALE))
    return SIGMAS * off / (_LENGTH_PX + share * own.length)  # type: ignore[no-any-return]


@compiled
def rigid_misfit(own: Record, shift: Floats, a: Point, b: Point, lost: int, expected_px: float) -> tuple[float, int]:
    """Return χ² of two positions as both markers of a stick, and its degrees of freedom; ``own`` is a STICK.

    It is computed from their distance (``expected_px`` between the predictions), from the direction of the base, and
    from the circles of a turning stick that was ``lost`` for some frames: while it is followed from frame to frame the
    circles are not tested, so that a wrong estimate of the axis can be corrected.
    """
    length = math.hypot(b[0] - a[0], b[1] - a[1])
    off = _length_misfit(own, length, lost)
    if lost == 0 and not own.still:
        # In an oblique view its length in the picture changes from frame to frame if it turns fast.
        off = min(off, _length_misfit(own, own.length + length - expected_px, 0))
    found, freedom = off * off, 1
    if own.still:
        found += (turned(math.atan2(b[1] - a[1], b[0] - a[0]), own.start_rad) / TURN_RAD) ** 2
        freedom += 1
    elif lost > 0 and own.axis.known:
        found += circle_misfit(own, shift, a, 0) ** 2 + circle_misfit(own, shift, b, 1) ** 2
        freedom += 2
    return found, freedom


@shared
def further(off_px: float, other_px: float) -> bool:
    """Return whether one marker is clearly further from its prediction than the other of its stick."""
    return off_px > 2.0 * other_px + 0.5


@internal
def judge_pair(scene: Scene, stick: int) -> None:
    """Reject the marker that is clearly further from its prediction if both are not of one rigid stick, or else both.

    Of the base both are rejected: a base at another position is another stick.
    """
    rig, i, j = scene.rig[0], 2 * stick, 2 * stick + 1
    if not (seen(scene, i) and seen(scene, j)):
        return
    a, b, p, q = at(scene, i), at(scene, j), scene.readings[i].predicted, scene.readings[j].predicted
    lost = scene.markers[i].lost + scene.markers[j].lost
    expected_px = math.hypot(q[0] - p[0], q[1] - p[1])
    found, freedom = rigid_misfit(scene.sticks[stick], rig.shift_now, a, b, lost, expected_px)
    if passes(found, freedom):
        return
    off_a, off_b = math.hypot(a[0] - p[0], a[1] - p[1]), math.hypot(b[0] - q[0], b[1] - q[1])
    if not is_base(rig, stick) and further(off_a, off_b):
        scene.readings[i].state = HIDDEN
    elif not is_base(rig, stick) and further(off_b, off_a):
        scene.readings[j].state = HIDDEN
    else:
        scene.readings[i].state = scene.readings[j].state = HIDDEN


# --- the base -------------------------------------------------------------------------------------------------------


@lending
def _cover(scene: Scene, index: int) -> int:
    """Reject the reading of a base marker that the moving stick reaches; return evidence that the latter is above.

    The evidence is positive for a dot that is hidden right under the stick, negative for one that is seen whole there.
    """
    marker, reading, i = scene.markers[index], scene.readings[index], 2 * scene.rig[0].moving
    here = (marker.x, marker.y)
    if not covers(scene, scene.rig[0].moving, here, index):
        return 0
    state, reading.state = reading.state, SHADOWED
    a, b, radius = at(scene, i), at(scene, i + 1), marker.shape.radius
    ends = min(math.hypot(here[0] - a[0], here[1] - a[1]), math.hypot(here[0] - b[0], here[1] - b[1]))
    if ends <= 2.5 * radius or to_strip(here, a, b, BEYOND) >= 0.4 * radius:
        return 0
    return 1 if state == HIDDEN else (-1 if state == SEEN else 0)


@lending
def vote(rig: Record, evidence: int) -> None:
    """Add evidence of which stick is above to the votes."""
    rig.above = max(-MOST_VOTES, min(MOST_VOTES, rig.above + evidence))


@internal
def judge_base(scene: Scene) -> bool:
    """Judge the base; return whether it has to be searched for.

    While the moving stick is seen, the base's shift has to be consistent with the moving stick's circles. A moving
    stick that is not seen may lie anywhere, even over the base: then one dot of the base alone has to keep its position
    from when the moving stick was last seen elsewhere.
    """
    rig, base = scene.rig[0], 1 - scene.rig[0].moving
    i, j, k = 2 * base, 2 * base + 1, 2 * rig.moving
    vote(rig, _cover(scene, i) + _cover(scene, j))
    elsewhere = seen(scene, k) and seen(scene, k + 1)
    if not elsewhere and not rig.anchored:
        copy_to(rig.anchor, rig.shift)
    rig.anchored = not elsewhere
    judge_pair(scene, base)
    if elsewhere and not base_goes_along(scene, i, j):
        for index in (i, j):
            if seen(scene, index):
                scene.readings[index].state = HIDDEN
    if not elsewhere and not (seen(scene, i) and seen(scene, j)):
        for end in range(2):
            (x, y), zero = at(scene, i + end), rig.zero[end]
            off = ((x - zero[0] - rig.anchor[0]) ** 2 + (y - zero[1] - rig.anchor[1]) ** 2) / STANDS_PX**2
            if seen(scene, i + end) and not passes(off, 2):
                scene.readings[i + end].state = LOST
    return _gone(scene, i) and _gone(scene, j)


@internal
def base_goes_along(scene: Scene, i: int, j: int) -> bool:
    """Return whether the moving stick's circles are consistent with the shift of the base's markers that are seen."""
    shift, turn = np.empty(2), 1.0 + 0.0j
    if not base_shift(scene.readings[i : j + 1], scene.rig[0].zero, shift):
        return True
    if seen(scene, i) and seen(scene, j):
        turn = turn_of(scene, at(scene, i), at(scene, j))
    return goes_with_picture(scene, shift, turn)


@lending
def _gone(scene: Scene, index: int) -> bool:
    return scene.readings[index].state not in (SEEN, SHADOWED)


# --- the moving stick -----------------------------------------------------------------------------------------------


@shared
def near_base(scene: Scene, point: Point, radii: float, more_px: float) -> bool:
    """Return whether a position lies within some radii of a base dot; ``more_px`` is added for one that is not seen."""
    i = 2 - 2 * scene.rig[0].moving
    for index in (i, i + 1):
        marker = scene.markers[index]
        # A base dot that was not seen lately may have moved with the picture.
        reach = radii * marker.shape.radius + (more_px if marker.lost else 0.0)
        if math.hypot(point[0] - marker.x, point[1] - marker.y) < reach:
            return True
    return False


@internal
def both_own(scene: Scene) -> bool:
    """Return whether both dots are known to be the moving stick's, even close to the base's dots.

    If one of them were a dot of the base, it would be off its circle relative to the other; if both were, the stick
    would point in the base's direction. Neither depends on a shake of the camera.
    """
    i, off = 2 * scene.rig[0].moving, np.empty((2, 2))
    if scene.markers[i].lost or scene.markers[i + 1].lost or not circles_off(scene, off):
        return False
    (ax, ay), (bx, by) = at(scene, i), at(scene, i + 1)
    if turned(math.atan2(by - ay, bx - ax), scene.sticks[1 - scene.rig[0].moving].start_rad) < MOVED_RAD:
        return False
    apart = (off[1, 0] - off[0, 0]) ** 2 + (off[1, 1] - off[0, 1]) ** 2
    return passes(apart / (_LENGTH_PX / SIGMAS) ** 2, 2)


@internal
def judge_moving(scene: Scene) -> bool:
    """Reject readings that may be of a base dot or are off their circle; return whether to search for the stick."""
    rig, i, j = scene.rig[0], 2 * scene.rig[0].moving, 2 * scene.rig[0].moving + 1
    judge_pair(scene, rig.moving)
    company = _ALONE if seen(scene, i) != seen(scene, j) else (_OWN if both_own(scene) else _TWO)
    for index in (i, j):
        if seen(scene, index):
            _judge_dot(scene, index, company)
    if min(scene.markers[i].lost, scene.markers[j].lost) > SOON and seen(scene, i) != seen(scene, j):
        # One dot alone, after a gap, may be any round object.
        for index in (i, j):
            if seen(scene, index):
                scene.readings[index].state = LOST
    return not (seen(scene, i) and seen(scene, j))


@compiled
def note_covered(scene: Scene) -> None:
    """Set moving markers that went below the base, and have not been seen since, to the state ``shadowed``.

    Such a marker was seen until then, not far from the base's edge, and no marker of its stick on the base's own
    surface: there, as for a stick that is known to be above, the occluder is something else.
    """
    rig, i, base = scene.rig[0], 2 * scene.rig[0].moving, 1 - scene.rig[0].moving
    one, two = scene.markers[2 * base], scene.markers[2 * base + 1]
    width, above = min(one.shape.strip, one.shape.window), rig.above >= KNOWN
    for index in (i, i + 1):
        marker = scene.markers[index]
        away = to_strip((marker.x, marker.y), (one.x, one.y), (two.x, two.y), BEYOND)
        above = above or (marker.lost == 0 and away < width)
    for index in (i, i + 1):
        marker, hidden, path = scene.markers[index], not seen(scene, index), scene.readings[index].path
        # A step that is longer than the base is wide may cross the base.
        near = marker.lost == 0 and math.hypot(path[0], path[1]) < 2.0 * width
        goes_below = near and not above and covers(scene, base, at(scene, index), index)
        marker.below = hidden and (marker.below > 0 or goes_below)
        if marker.below:
            scene.readings[index].state = SHADOWED


@lending
def _judge_dot(scene: Scene, index: int, company: int) -> None:
    """Judge one dot of the moving stick; ``company``: ``_ALONE``, ``_TWO`` or ``_OWN``."""
    rig, marker, reading, place = scene.rig[0], scene.markers[index], scene.readings[index], at(scene, index)
    partner = scene.markers[index + 1 - 2 * (index % 2)]
    b = 2 - 2 * rig.moving
    # Seen whole on the base stick's middle line, it is above; near a base dot only if both are known to be its own.
    if company == _OWN or not near_base(scene, place, NEAR, 0.0):
        one, two = scene.markers[b], scene.markers[b + 1]
        if to_strip(place, (one.x, one.y), (two.x, two.y), 0.1) < 1.2 * one.shape.radius:
            vote(rig, 1)
    followed = marker.lost <= SOON or partner.lost == 0
    alone = company == _ALONE
    radii = CLOSE if followed and not alone else NEAR
    near = near_base(scene, place, radii, UNSEEN_PX if alone else 0.0)
    if near and company != _OWN and (alone or rig.above < KNOWN):
        # One dot alone near a base dot may be either of the two, whichever stick is above.
        reading.state = SHADOWED
    elif alone:
        # While its partner is hidden, only the circle shows that a reading slides onto another object.
        off = circle_misfit(scene.sticks[rig.moving], rig.shift_now, place, index % 2)
        if not passes(off * off, 1):
            reading.state = HIDDEN
