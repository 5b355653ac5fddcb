"""Prediction of each marker in the next frame: by its own last motion, or by the axis and its partner (compiled)."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from torsight.core.compiled import compiled, internal, lending, shared
from torsight.core.units import Floats
from tracker.appearance.disc import Record
from tracker.appearance.lucas_kanade import least
from tracker.follow.rotation_axis import STANDS_PX, arm_px, direction_from, folded, on_circle
from tracker.follow.state import Scene

STALE: Final = 15
"""Frames for which a lost marker is extrapolated along its last motion: half a second at 30 frames a second."""
JUMP: Final = 0.2
"""Standard deviation of a stick's jump from its prediction, over its markers' distance, at any size of the picture: a
stick that starts abruptly, a camera that is bumped."""
_GROWTH: Final = 2.5
"""Exponent with which that standard deviation grows with the frames since the stick was seen: a motion whose
acceleration is a random walk (Bar-Shalom and others, as in :mod:`tracker.innovation`, section 6.2.3)."""
REST, STEADY, AVERAGED, CURVED = range(4)
"""The predictors: at rest, constant speed, speed averaged over three steps, parabola."""


@shared
def is_base(rig: Record, stick: int) -> bool:
    """Return whether a stick is known to be the base."""
    return rig.moving >= 0 and stick != rig.moving  # type: ignore[no-any-return]


@compiled
def ways(marker: Record, time_s: float) -> Floats:
    """Return the positions (4, 2) of a marker at a time that each predictor extrapolates from the last readings.

    The parabola suits a smooth fast motion, the averaged speed a shaking camera.
    """
    out = np.empty((4, 2))
    count, h = marker.count, marker.history
    for axis in (1, 2):
        out[:, axis - 1] = h[count - 1, axis]
    if count < 2:
        return out
    t1, t2, t0 = h[count - 1, 0], h[count - 2, 0], h[0, 0]
    for axis in (1, 2):
        step = h[count - 1, axis] - h[count - 2, axis]
        out[STEADY:, axis - 1] = h[count - 1, axis] + (time_s - t1) / (t1 - t2) * step
    if count < 3:
        return out
    t3 = h[count - 3, 0]
    # Lagrange's parabola through the last three readings, whatever their spacing.
    a = (time_s - t2) * (time_s - t3) / ((t1 - t2) * (t1 - t3))
    b = (time_s - t1) * (time_s - t3) / ((t2 - t1) * (t2 - t3))
    c = (time_s - t1) * (time_s - t2) / ((t3 - t1) * (t3 - t2))
    for axis in (1, 2):
        out[AVERAGED, axis - 1] = h[count - 1, axis] + (time_s - t1) / (t1 - t0) * (h[count - 1, axis] - h[0, axis])
        out[CURVED, axis - 1] = a * h[count - 1, axis] + b * h[count - 2, axis] + c * h[count - 3, axis]
    return out


@shared
def jump_px(length_px: float, lost: int) -> float:
    """Return the standard deviation, px, of the position of a marker that was seen ``lost`` frames ago."""
    return JUMP * length_px * math.pow(lost, _GROWTH)


@shared
def by_other_px(own: Record, end: int) -> float:
    """Return the standard deviation, px, of a marker's position predicted from the other marker of its stick.

    It is very large where the other marker lies on the axis. ``own`` is the STICK.
    """
    arm = max(arm_px(own.axis, 1 - end), 1e-9)
    return math.hypot(jump_px(own.length, 1), STANDS_PX * arm_px(own.axis, end) / arm)


@internal
def predict(scene: Scene, time_s: float) -> None:
    """Set the predicted position of every marker, and its predicted motion since the last frame."""
    rig = scene.rig[0]
    for index in range(len(scene.markers)):
        marker, reading = scene.markers[index], scene.readings[index]
        reading.predicted[0], reading.predicted[1] = marker.x, marker.y
        reading.path[:] = 0.0
        if not is_base(rig, index // 2) and marker.count > 0:
            way = STEADY if marker.lost > 0 else least(marker.miss)
            place = ways(marker, time_s)[way]
            reading.predicted[0], reading.predicted[1] = place[0] + rig.shift[0], place[1] + rig.shift[1]
    for stick in range(len(scene.sticks)):
        if is_base(rig, stick):
            continue
        if scene.sticks[stick].axis.known:
            _carry_lost(scene, stick, time_s)
        for index in (2 * stick, 2 * stick + 1):
            marker, reading = scene.markers[index], scene.readings[index]
            if marker.count > 0 and marker.lost > 0:
                reading.path[0], reading.path[1] = reading.predicted[0] - marker.x, reading.predicted[1] - marker.y
            elif marker.count > 0:
                for i in range(2):
                    reading.path[i] = reading.predicted[i] - rig.shift[i] - marker.history[marker.count - 1, 1 + i]


@lending
def _carry_lost(scene: Scene, stick: int, time_s: float) -> None:
    """Predict lost markers on their circles: from the other marker where it is more precise, or from the last turn."""
    shift, own = scene.rig[0].shift, scene.sticks[stick]
    axis = own.axis
    last_known, last = _last_turning(scene, stick, time_s)
    for end in range(2):
        marker, other = scene.markers[2 * stick + end], 2 * stick + 1 - end
        if marker.lost == 0:
            continue
        known, direction = last_known, last
        if scene.markers[other].lost == 0 and by_other_px(own, end) < jump_px(own.length, 1 + marker.lost):
            at = scene.readings[other].predicted
            known, direction = True, direction_from(axis, at[0] - shift[0], at[1] - shift[1], 1 - end)
        if known:
            x, y = on_circle(axis, direction, end)
            predicted = scene.readings[2 * stick + end].predicted
            predicted[0], predicted[1] = x + shift[0], y + shift[1]


@lending
def _last_turning(scene: Scene, stick: int, time_s: float) -> tuple[bool, float]:
    """Return whether the last turn of a stick is known, and the direction extrapolated from it.

    That is the mean of both markers' directions, weighted by the squares of their arms.
    """
    axis, first, off, weight = scene.sticks[stick].axis, 0.0, 0.0, 0.0
    if scene.markers[2 * stick].lost + scene.markers[2 * stick + 1].lost > 2 * STALE:
        return False, 0.0
    for end in range(2):
        marker = scene.markers[2 * stick + end]
        if marker.count < 2:
            continue
        h = marker.history[marker.count - 2 : marker.count]
        before, now = direction_from(axis, h[0, 1], h[0, 2], end), direction_from(axis, h[1, 1], h[1, 2], end)
        rate = folded(now - before) / (h[1, 0] - h[0, 0])
        last = now + rate * (time_s - h[1, 0])
        first = last if weight == 0.0 else first
        off += arm_px(axis, end) ** 2 * folded(last - first)
        weight += arm_px(axis, end) ** 2
    return weight > 0.0, first + off / max(weight, 1e-9)
