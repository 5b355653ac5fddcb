"""Where each marker should be in the next frame: by its own last motion, or by the axis and what is seen (compiled)."""

from __future__ import annotations

from typing import Final

from torsight.core.compiled import compiled, lending
from tracker.appearance.disc import Record
from tracker.appearance.lucas_kanade import Point
from tracker.follow.rotation_axis import direction_from, folded, on_circle
from tracker.follow.state import Scene

STALE: Final = 15
"""Frames for which a lost marker is carried on along its last motion: half a second at 30 frames a second."""


@lending
def is_base(rig: Record, stick: int) -> bool:
    """Return whether a stick is known to be the base."""
    return rig.moving >= 0 and stick != rig.moving  # type: ignore[no-any-return]


@lending
def carried_on(marker: Record, time_s: float) -> Point:
    """Return where a marker's last readings carry it: along a parabola through three, a line through two, or at rest.

    One that is lost goes on along a line.
    """
    count, h = marker.count, marker.history
    last, second, third = count - 1, max(count - 2, 0), max(count - 3, 0)
    a, b, c = 1.0, 0.0, 0.0
    t1, t2, t3 = h[last, 0], h[second, 0], h[third, 0]
    if count > 2 and marker.lost == 0:
        # Lagrange's parabola, whatever the spacing of the readings.
        a = (time_s - t2) * (time_s - t3) / ((t1 - t2) * (t1 - t3))
        b = (time_s - t1) * (time_s - t3) / ((t2 - t1) * (t2 - t3))
        c = (time_s - t1) * (time_s - t2) / ((t3 - t1) * (t3 - t2))
    elif count > 1:
        a, b = (time_s - t2) / (t1 - t2), (t1 - time_s) / (t1 - t2)
    x = a * h[last, 1] + b * h[second, 1] + c * h[third, 1]
    return x, a * h[last, 2] + b * h[second, 2] + c * h[third, 2]


@compiled
def predict(scene: Scene, time_s: float) -> None:
    """Fill in where every marker is expected, and how far it is expected to have moved since the last frame."""
    rig = scene.rig[0]
    for index in range(len(scene.markers)):
        marker, reading = scene.markers[index], scene.readings[index]
        reading.predicted[0], reading.predicted[1] = marker.x, marker.y
        reading.path[:] = 0.0
        if not is_base(rig, index // 2) and marker.count > 0:
            x, y = carried_on(marker, time_s)
            reading.predicted[0], reading.predicted[1] = x + rig.shift[0], y + rig.shift[1]
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
                reading.path[:] = reading.predicted - rig.shift - marker.history[marker.count - 1, 1:]


@lending
def _carry_lost(scene: Scene, stick: int, time_s: float) -> None:
    """Expect lost markers on their circles: by the other one, or by the last turning where both are lost."""
    shift, axis = scene.rig[0].shift, scene.sticks[stick].axis
    lost = (scene.markers[2 * stick].lost > 0, scene.markers[2 * stick + 1].lost > 0)
    if not lost[0] and not lost[1]:
        return
    known, direction = False, 0.0
    if lost[0] and lost[1]:
        known, direction = _last_turning(scene, stick, time_s)
    else:
        seen = 1 if lost[0] else 0
        at = scene.readings[2 * stick + seen].predicted
        known, direction = True, direction_from(axis, at[0] - shift[0], at[1] - shift[1], seen)
    for end in range(2):
        if known and lost[end]:
            x, y = on_circle(axis, direction, end)
            predicted = scene.readings[2 * stick + end].predicted
            predicted[0], predicted[1] = x + shift[0], y + shift[1]


@lending
def _last_turning(scene: Scene, stick: int, time_s: float) -> tuple[bool, float]:
    """Return whether the last turning of a stick is known, and the direction to which it leads."""
    axis, first, last, count = scene.sticks[stick].axis, 0.0, 0.0, 0
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
        first = last if count == 0 else first
        count += 1
    return count > 0, first + 0.5 * folded(last - first)
