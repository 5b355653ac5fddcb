"""Update of the state by a frame (compiled): histories, running means of fit and shape, lengths, axis, exposure, row.

Uneven light shifts a dot (a gradient of 0.1 grey levels per pixel by 0.005 px), but a free gradient in every frame
costs a third of the precision, since it looks like an offset. So the gradient is measured, averaged over frames, and
then taken as known.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from torsight.core.compiled import compiled, copy_to, inlined, internal, lending, shared
from torsight.core.units import Floats
from tracker.appearance.disc import MOST_STRETCH, Record
from tracker.appearance.lucas_kanade import PHASES, RATE, SHARP_PX, Luma
from tracker.appearance.motion_blur import SHARES, is_due, is_sharp, learn_exposure, smear_misfits
from tracker.follow.camera_state import (
    TURN_RAD,
    at,
    circles_off,
    forget,
    middle_of,
    seen,
    take_turn,
    turn_of,
)
from tracker.follow.judgement import SOON, base_goes_along
from tracker.follow.motion_model import STALE, is_base, predict
from tracker.follow.reading import share_of_step
from tracker.follow.rotation_axis import learn_axis
from tracker.follow.state import Scene
from tracker.rows import SEEN

_CHANGE_PX: Final = 1.0 / PHASES
"""Change of the rim's position above which the template is rendered again: smaller ones are followed to first order, as
are positions between those of cached models."""
SIZES: Final = (0.7, 1.4)
"""Range of a marker's size over its first one: that of a stick in a plane seen at up to 45 degrees from its normal."""


@internal
def learn_look(marker: Record, systems: Record, reading: Record) -> None:
    """Update a marker's statistics of fit from a sharp reading, and follow slow changes of shape and light."""
    off = share_of_step(reading.residual, reading.step) - marker.residual[0]
    marker.residual[0] += RATE * off
    marker.residual[1] += RATE * (abs(off) - marker.residual[1])
    _follow(marker.change, reading.change)
    _follow(marker.slope, reading.slope)
    shape = marker.shape
    radius = shape.radius + marker.change[0]
    e, f = marker.change[1], marker.change[2]
    if max(abs(marker.change[0]), abs(e) * radius, abs(f) * radius) < _CHANGE_PX:
        return
    e, f = shape.stretch[0] + e, shape.stretch[1] + f
    in_range = SIZES[0] < radius / marker.first_radius < SIZES[1]
    if in_range and math.hypot(e, f) <= MOST_STRETCH:
        shape.radius, shape.stretch[0], shape.stretch[1] = radius, e, f
        forget(systems)
    marker.change[:] = 0.0


@inlined
def _follow(mean: Floats, values: Floats) -> None:
    """Update running means (n,) with new values."""
    for i in range(len(mean)):
        mean[i] += RATE * (values[i] - mean[i])


@internal
def take(marker: Record, time_s: float, reading: Record, shift: Floats) -> None:
    """Add a reading to a marker's history."""
    h, count = marker.history, min(marker.count, 1)
    if marker.lost > SOON:
        # Only readings close in time give a speed.
        count = 0
    if count:
        copy_to(h[0], h[marker.count - 1])
    h[count, 0], h[count, 1], h[count, 2] = time_s, reading.x - shift[0], reading.y - shift[1]
    marker.count = count + 1
    marker.x, marker.y, marker.lost = reading.x, reading.y, 0


@lending
def miss(marker: Record, x: float, y: float) -> None:
    """Count a frame in which a marker was not read, and set its assumed position."""
    marker.x, marker.y = x, y
    marker.lost += 1
    if marker.lost > STALE:
        marker.count = 0


@internal
def note(scene: Scene, luma: Luma, time_s: float) -> None:
    """Update the state with the readings of all markers."""
    rig = scene.rig[0]
    copy_to(rig.shift, rig.shift_now)
    base, k = 2 - 2 * rig.moving, 2 * rig.moving
    with_base = rig.moving >= 0 and len(scene.sticks) > 1
    if with_base and rig.anchored and seen(scene, k) and seen(scene, k + 1):
        # The moving stick was found after the base was judged.
        rig.anchored = not base_goes_along(scene, base, base + 1)
    for index in range(len(scene.markers)):
        _note_marker(scene, index, time_s)
    misfits = np.empty(len(SHARES))
    for index in range(len(scene.markers)):
        reading, shape = scene.readings[index], scene.markers[index].shape
        place, path = (reading.x, reading.y), (reading.path[0], reading.path[1])
        length = math.hypot(path[0], path[1])
        fast = reading.state == SEEN and length > SHARP_PX and is_due(rig.exposure)
        if fast and smear_misfits(luma, place, shape, path, misfits):
            learn_exposure(rig.exposure, misfits, length / (2.0 * shape.radius))
    for stick in range(len(scene.sticks)):
        _note_stick(scene, stick)
    if with_base:
        _note_step(scene, base)
        both = seen(scene, base) and seen(scene, base + 1)
        if both and not rig.anchored and abs(turn_of(scene, at(scene, base), at(scene, base + 1)) - 1.0) > TURN_RAD:
            take_turn(scene, at(scene, base), at(scene, base + 1))


@lending
def _note_step(scene: Scene, base: int) -> None:
    """Update the base's step, and the errors of predicting its markers, from ``base`` on, at rest and going on.

    A base that is not seen counts as one at rest, and keeps its step.
    """
    rig, rest, going = scene.rig[0], 0.0, 0.0
    told = (seen(scene, base) or seen(scene, base + 1)) and not rig.anchored
    for end in range(2):
        marker = scene.markers[base + end]
        for k in range(2):
            now = marker.x if k == 0 else marker.y
            step = now - rig.last[end, k] if told else 0.0
            rest, going = rest + step**2, going + (step - rig.step[end, k]) ** 2
            rig.last[end, k] = now
            if told:
                rig.step[end, k] = step
    rig.off[0] += RATE * (rest - rig.off[0])
    rig.off[1] += RATE * (going - rig.off[1])


@compiled
def skip(scene: Scene, time_s: float) -> None:
    """Skip a frame without a usable picture: markers are extrapolated, and lost for one more frame."""
    predict(scene, time_s)
    for index in range(len(scene.markers)):
        predicted = scene.readings[index].predicted
        miss(scene.markers[index], predicted[0], predicted[1])


@internal
def _note_marker(scene: Scene, index: int, time_s: float) -> None:
    rig, marker, reading = scene.rig[0], scene.markers[index], scene.readings[index]
    if reading.state != SEEN:
        if is_base(rig, index // 2):
            # The base moves with the picture.
            end = index % 2
            miss(marker, rig.zero[end, 0] + rig.shift[0], rig.zero[end, 1] + rig.shift[1])
        else:
            miss(marker, reading.predicted[0], reading.predicted[1])
        return
    marker.light += RATE * (reading.light - marker.light)
    marker.step += RATE * (abs(reading.step) - marker.step)
    if is_sharp(rig.exposure, math.hypot(reading.path[0], reading.path[1])):
        learn_look(marker, scene.looks[index][2], reading)
    take(marker, time_s, reading, rig.shift)


@internal
def _note_stick(scene: Scene, stick: int) -> None:
    """Update the distance of a stick's markers, and its axis if it turns."""
    rig, own, i = scene.rig[0], scene.sticks[stick], 2 * stick
    if not (seen(scene, i) and seen(scene, i + 1)):
        return
    (ax, ay), (bx, by) = at(scene, i), at(scene, i + 1)
    if own.still:
        # A moving stick that is not seen may lie over the base.
        if not rig.anchored:
            own.length, own.start_rad = math.hypot(bx - ax, by - ay), math.atan2(by - ay, bx - ax)
        return
    own.length = math.hypot(bx - ax, by - ay)
    if abs(own.size - 1.0) < TURN_RAD:
        length = own.length / own.size
        own.shortest, own.longest = min(own.shortest, length), max(own.longest, length)
    base = 2 - 2 * stick
    if rig.moving >= 0 and not (seen(scene, base) and seen(scene, base + 1)):
        # With one base dot alone, a misread one would shift the axis.
        return
    dx, dy = rig.shift[0], rig.shift[1]
    learn_axis(own.axis, (ax - dx, ay - dy), (bx - dx, by - dy))
    off = np.empty((2, 2))
    if rig.moving >= 0 and circles_off(scene, off):
        rig.offset_known = 1
        rig.offset[0], rig.offset[1] = middle_of(off[:, 0]) - dx, middle_of(off[:, 1]) - dy


@shared
def write_row(readings: Record, rows: Record, time_s: float, level: float) -> None:
    """Write the readings of a frame into rows (1,) (see :mod:`tracker.rows`); for unseen markers only the state."""
    row = rows[0]
    row.time_s, row.level = time_s, level
    for index in range(len(readings)):
        reading = readings[index]
        taken = reading.state == SEEN
        row.state[index] = reading.state
        row.position_px[index, 0] = reading.x if taken else np.nan
        row.position_px[index, 1] = reading.y if taken else np.nan
        for k in range(3):
            row.covariance_px2[index, k] = reading.covariance[k] if taken else np.nan
        row.light[index] = reading.light if taken else 0.0
        row.step[index] = reading.step if taken else 0.0
        row.residual[index] = reading.residual if taken else 0.0
