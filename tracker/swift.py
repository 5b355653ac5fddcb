"""The usual frame, compiled: both markers of the moving stick in sight, the base in sight or under the moving stick.

What is done here is what :class:`tracker.follow.Follower` does, with the same rules and numbers. Whatever is unusual (a
marker that is covered or lost, a jump, darkness, doubt which dot is which) is left to it: the kernel then changes
nothing and says so. All state is in two arrays: one row per marker, and what is common.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from torsight.core.compiled import njit
from tracker.compiled import CONTRAST, CONVERGED, PATCH, RESIDUAL, STEP, Luma, X, Y, read_dot
from tracker.fields import (
    ABOVE,
    AT_X,
    AT_Y,
    AXIS,
    AXIS_LAST,
    BRIGHTNESS,
    COUNT,
    EVERY,
    FAST,
    GAUGE,
    HISTORY,
    LAST,
    LENGTH,
    LOOK_AXIS,
    LOOK_INNER,
    LOST,
    MISSES,
    MOVING,
    OFFSET,
    OWN_RADIUS,
    REFERENCE,
    SHARE,
    SHIFT,
    SHUTTER_KNOWN,
    SLOPE,
    UNUSUAL,
    ZERO,
)
from tracker.learning import Looks, Row, note, ways, write_row
from tracker.render import WINDOW, Floats
from tracker.rules import (
    ALONE_PX,
    ALWAYS,
    APART_PX,
    AXIS_ENOUGH,
    AXIS_STEP_RAD,
    CLOSE,
    DARK,
    JUMP_PX,
    LEAST_STEP,
    MOST_VOTES,
    NEAR,
    NEVER,
    OWN_PX,
    OWN_RAD,
    SHAKE_PX,
    SHARP_PX,
    SLACK_KNOWN,
    SLACK_UNKNOWN,
    SPARSE,
    TURN_RAD,
    VOTES,
)

Point = tuple[float, float]


@njit(cache=True, nogil=True)
def level_of(luma: Luma) -> float:
    """Return the brightness of the picture, from a sparse grid."""
    total, count = 0, 0
    for y in range(0, luma.shape[0], SPARSE):
        for x in range(0, luma.shape[1], SPARSE):
            total += luma[y, x]
            count += 1
    return total / count


@njit(cache=True, nogil=True)
def slack(common: Floats, length: float) -> float:
    """Return by which share of the step a fit of a marker that moves by ``length`` may be worse than at rest."""
    if length < 0.5:
        return 0.0
    return (SLACK_KNOWN if common[SHUTTER_KNOWN] > 0.0 else SLACK_UNKNOWN) * math.sqrt(length)


@njit(cache=True, nogil=True)
def fits(marker: Floats, reading: Floats, loose: float) -> bool:
    """Return whether a reading is of the marker itself, by how well the marker has fitted so far."""
    step = abs(reading[STEP])
    if step < max(LEAST_STEP, 0.2 * marker[GAUGE + 1]) or reading[CONVERGED] == 0.0:
        return False
    if not 0.45 < reading[CONTRAST] < 1.8:
        return False
    share, patch = reading[RESIDUAL] / step, reading[PATCH] / step
    limit = math.exp(marker[GAUGE + 2] + max(5.0 * marker[GAUGE + 3], 0.35)) + loose
    patch_limit = math.exp(marker[GAUGE + 4] + max(5.0 * marker[GAUGE + 5], 0.7)) + loose
    return bool(share <= min(max(limit, ALWAYS), NEVER) and patch <= max(patch_limit, ALWAYS))


@njit(cache=True, nogil=True)
def read_marker(
    luma: Luma, index: int, place: Point, step: Point, markers: Floats, common: Floats, looks: Looks, out: Floats
) -> bool:
    """Read one marker from where it is expected; return whether it was found there and is itself."""
    marker = markers[index]
    view = np.array([common[SHARE] * step[0], common[SHARE] * step[1], marker[SLOPE], marker[SLOPE + 1]])
    inside = read_dot(
        luma, place[0], place[1], looks[0][index], looks[1][index], looks[2][index], looks[3][index], view, out
    )
    if not inside or not math.hypot(out[X] - place[0], out[Y] - place[1]) <= marker[OWN_RADIUS]:
        return False
    return fits(marker, out, slack(common, math.hypot(step[0], step[1])))


@njit(cache=True, nogil=True)
def to_strip(x: float, y: float, a: Floats, b: Floats, beyond: float) -> float:
    """Return the distance of a point from the line a–b, drawn out by a share of its length on both sides."""
    ux, uy = b[0] - a[0], b[1] - a[1]
    along = ((x - a[0]) * ux + (y - a[1]) * uy) / max(ux * ux + uy * uy, 1e-9)
    along = min(max(along, -beyond), 1.0 + beyond)
    return math.hypot(x - a[0] - along * ux, y - a[1] - along * uy)


@njit(cache=True, nogil=True)
def right_length(one: Floats, two: Floats, length: float) -> bool:
    """Return whether the distance of two readings is that of the stick's markers."""
    return abs(math.hypot(two[X] - one[X], two[Y] - one[Y]) - length) <= 0.8 + 0.01 * length


@njit(cache=True, nogil=True)
def read_moving(
    luma: Luma, time_s: float, markers: Floats, common: Floats, looks: Looks, readings: Floats, steps: Floats
) -> bool:
    """Read both markers of the moving stick; return whether both are where they are expected."""
    first = 2 * int(common[MOVING])
    places = np.empty((2, 2))
    for index in (first, first + 1):
        marker = markers[index]
        if marker[LOST] > 0.0 or marker[COUNT] < 2.0:
            return False
        way = ways(marker, time_s)[int(np.argmin(marker[MISSES : MISSES + 4]))]
        newest = HISTORY + 3 * (int(marker[COUNT]) - 1)
        steps[index, 0], steps[index, 1] = way[0] - marker[newest + 1], way[1] - marker[newest + 2]
        place = (way[0] + common[SHIFT], way[1] + common[SHIFT + 1])
        places[index - first, 0], places[index - first, 1] = place
        step = (steps[index, 0], steps[index, 1])
        if not read_marker(luma, index, place, step, markers, common, looks, readings[index]):
            return False
    # It may turn fast enough, seen from aside, for its length in the picture to change from frame to frame.
    expected = math.hypot(places[1, 0] - places[0, 0], places[1, 1] - places[0, 1])
    usual = common[LENGTH + int(common[MOVING])]
    one, two = readings[first], readings[first + 1]
    return right_length(one, two, usual) or right_length(one, two, expected)


@njit(cache=True, nogil=True)
def circles_away(common: Floats, readings: Floats, out: Floats) -> bool:
    """Find how far either moving marker is from where its circle puts it (2, 2); False while unknown."""
    if common[AXIS] == 0.0:
        return False
    first = 2 * int(common[MOVING])
    one, two = readings[first], readings[first + 1]
    turn = math.atan2(two[Y] - one[Y], two[X] - one[X])
    cos, sin = math.cos(turn), math.sin(turn)
    s = common[AXIS + 1 : AXIS + 7]
    for k in range(2):
        out[k, 0] = readings[first + k, X] - s[0] - cos * s[2 + 2 * k] + sin * s[3 + 2 * k]
        out[k, 1] = readings[first + k, Y] - s[1] - sin * s[2 + 2 * k] - cos * s[3 + 2 * k]
    return True


@njit(cache=True, nogil=True)
def both_own(common: Floats, readings: Floats) -> bool:
    """Return whether both dots are known to be the moving stick's, next to the base's dots as they may be.

    Had one of them been a dot of the base, it would be off its circle against the other; had both, the stick would
    point as the base does. Neither depends on a shake of the camera.
    """
    first = 2 * int(common[MOVING])
    one, two = readings[first], readings[first + 1]
    turn = math.atan2(two[Y] - one[Y], two[X] - one[X])
    if abs((turn - common[LAST] + math.pi) % (2.0 * math.pi) - math.pi) < OWN_RAD:
        return False
    away = np.empty((2, 2))
    if not circles_away(common, readings, away):
        return False
    return math.hypot(away[1, 0] - away[0, 0], away[1, 1] - away[0, 1]) < OWN_PX


@njit(cache=True, nogil=True)
def votes_of(markers: Floats, common: Floats, readings: Floats) -> float:
    """Return votes that the moving stick is above, from its markers that lie on the base stick; −1 where in doubt."""
    first, base = 2 * int(common[MOVING]), 2 - 2 * int(common[MOVING])
    votes = 0.0
    own = both_own(common, readings)
    for index in (first, first + 1):
        x, y = readings[index, X], readings[index, Y]
        close = near = False
        for k in (base, base + 1):
            radii = math.hypot(x - markers[k, AT_X], y - markers[k, AT_Y]) / markers[k, OWN_RADIUS]
            close |= radii < CLOSE
            near |= radii < NEAR
        if close and common[ABOVE] < VOTES and not own:
            return -1.0
        away = to_strip(x, y, markers[base, AT_X : AT_Y + 1], markers[base + 1, AT_X : AT_Y + 1], 0.1)
        if (own or not near) and away < 1.2 * markers[base, OWN_RADIUS]:
            votes += 1.0
    return votes


@njit(cache=True, nogil=True)
def read_base(
    luma: Luma, markers: Floats, common: Floats, looks: Looks, readings: Floats, seen: NDArray[np.bool_]
) -> bool:
    """Read the base's markers that the moving stick does not reach; return whether all is as usual."""
    first, base = 2 * int(common[MOVING]), 2 - 2 * int(common[MOVING])
    width = looks[1][first][WINDOW]
    for index in (base, base + 1):
        marker = markers[index]
        a, b = readings[first, X : Y + 1], readings[first + 1, X : Y + 1]
        away = to_strip(marker[AT_X], marker[AT_Y], a, b, 0.6)
        seen[index] = away >= marker[OWN_RADIUS] + width + 2.5
        if not seen[index]:
            if common[ABOVE] < VOTES:
                return False
            continue
        place = (marker[AT_X], marker[AT_Y])
        if not read_marker(luma, index, place, (0.0, 0.0), markers, common, looks, readings[index]):
            return False
    return base_stands(markers, common, readings, seen)


@njit(cache=True, nogil=True)
def base_stands(markers: Floats, common: Floats, readings: Floats, seen: NDArray[np.bool_]) -> bool:
    """Return whether what was read of the base is of a stick that stands still."""
    base = 2 - 2 * int(common[MOVING])
    away = np.zeros((2, 2))
    for k in range(2):
        if seen[base + k]:
            away[k, 0] = readings[base + k, X] - markers[base + k, AT_X]
            away[k, 1] = readings[base + k, Y] - markers[base + k, AT_Y]
    far = max(math.hypot(away[0, 0], away[0, 1]), math.hypot(away[1, 0], away[1, 1]))
    if not (seen[base] and seen[base + 1]):
        return far <= ALONE_PX
    one, two = readings[base], readings[base + 1]
    turn = math.atan2(two[Y] - one[Y], two[X] - one[X])
    turned = abs((turn - common[REFERENCE] + math.pi) % (2.0 * math.pi) - math.pi)
    if math.hypot(away[0, 0] - away[1, 0], away[0, 1] - away[1, 1]) > APART_PX or far > JUMP_PX or turned > TURN_RAD:
        return False
    if not right_length(one, two, common[LENGTH + base // 2]):
        return False
    common[LAST] = turn
    return True


@njit(cache=True, nogil=True)
def find_shift(common: Floats, readings: Floats, seen: NDArray[np.bool_]) -> None:
    """Find the shift of the picture: from the base, or from the moving stick's circles while the base is not seen."""
    base = 2 - 2 * int(common[MOVING])
    each = np.zeros((2, 2))
    known = circles_away(common, readings, each)
    away = (0.5 * (each[0, 0] + each[1, 0]), 0.5 * (each[0, 1] + each[1, 1]))
    count, x, y = 0, 0.0, 0.0
    for k in range(2):
        if seen[base + k]:
            x += readings[base + k, X] - common[ZERO + 2 * k]
            y += readings[base + k, Y] - common[ZERO + 2 * k + 1]
            count += 1
    if count:
        common[SHIFT], common[SHIFT + 1] = x / count, y / count
        common[OFFSET] = 1.0 if known else 0.0
        common[OFFSET + 1], common[OFFSET + 2] = away[0] - common[SHIFT], away[1] - common[SHIFT + 1]
    elif known and common[OFFSET] > 0.0 and common[ABOVE] >= VOTES:
        x, y = away[0] - common[OFFSET + 1], away[1] - common[OFFSET + 2]
        if math.hypot(x - common[SHIFT], y - common[SHIFT + 1]) < SHAKE_PX:
            common[SHIFT], common[SHIFT + 1] = x, y


@njit(cache=True, nogil=True)
def worth_a_look(
    common: Floats, readings: Floats, steps: Floats, seen: NDArray[np.bool_], parts: NDArray[np.int64]
) -> int:
    """Return what can be learned from this frame beyond what is learned from every one."""
    first, base = 2 * int(common[MOVING]), 2 - 2 * int(common[MOVING])
    found = 0
    for k in range(2):
        if math.hypot(steps[first + k, 0], steps[first + k, 1]) > SHARP_PX:
            common[FAST] += 1.0
            if common[FAST] % common[EVERY] == 0.0:
                found |= LOOK_INNER << k
    if seen[base] or seen[base + 1]:
        one, two = readings[first], readings[first + 1]
        turn = math.atan2(two[Y] - one[Y], two[X] - one[X])
        part = int((turn % (2.0 * math.pi)) / (2.0 * math.pi) * len(parts)) % len(parts)
        off = abs((turn - common[AXIS_LAST] + math.pi) % (2.0 * math.pi) - math.pi)
        if parts[part] < AXIS_ENOUGH and not off < AXIS_STEP_RAD:
            found |= LOOK_AXIS
    return found


@njit(cache=True, nogil=True)
def follow_frame(
    luma: Luma,
    time_s: float,
    markers: Floats,
    common: Floats,
    looks: Looks,
    readings: Floats,
    steps: Floats,
    seen: NDArray[np.bool_],
    parts: NDArray[np.int64],
    row: Row,
    codes: tuple[int, int],
) -> int:
    """Follow all markers into the next frame; UNUSUAL, and nothing changed, where anything is.

    ``readings`` (4, 16), ``steps`` (4, 2), ``seen`` (4,) and ``row`` are filled: what was read, how far the moving
    markers were expected to move, which markers were read, and what is noted. ``parts`` are the frames that the axis
    has of each part of the circle. Returned are the looks that are worth while.
    """
    level = level_of(luma)
    if level < DARK * common[BRIGHTNESS]:
        return UNUSUAL
    steps[:] = 0.0
    seen[:] = True
    if not read_moving(luma, time_s, markers, common, looks, readings, steps):
        return UNUSUAL
    votes = votes_of(markers, common, readings)
    if votes < 0.0 or not read_base(luma, markers, common, looks, readings, seen):
        return UNUSUAL
    common[ABOVE] = min(MOST_VOTES, common[ABOVE] + votes)
    common[BRIGHTNESS] += 0.05 * (level - common[BRIGHTNESS])
    find_shift(common, readings, seen)
    note(time_s, markers, common, looks, readings, steps, seen)
    write_row(row, readings, seen, codes)
    return worth_a_look(common, readings, steps, seen, parts)
