"""Prediction of each marker in the next frame: by its own last motion, or by the axis and its partner (compiled)."""

from __future__ import annotations

import cmath
import math
from typing import Final

from torsight.core.compiled import compiled, copy_to, internal, lending, shared
from tracker.appearance.disc import Record
from tracker.follow.rotation_axis import STANDS_PX, arm_px, direction_from, on_circle
from tracker.follow.state import Scene
from tracker.frames.frame import DEFAULT_FPS

STALE: Final = round(0.5 * DEFAULT_FPS)
"""Frames for which a lost marker is extrapolated along its last motion: half a second at 30 frames a second."""
JUMP: Final = 0.2
"""Standard deviation of a stick's jump from its prediction, over its markers' distance, at any size of the picture: a
stick that starts abruptly, a camera that is bumped."""


@shared
def is_base(rig: Record, stick: int) -> bool:
    """Return whether a stick is known to be the base."""
    return rig.moving >= 0 and stick != rig.moving  # type: ignore[no-any-return]


@compiled
def extrapolated(marker: Record, axis: Record, time_s: float) -> complex:
    """Return the position of a marker at a time, without the picture's shift: it turns on as in its last step.

    Its last step is repeated, turned by the angle at which it appears from the axis: an axis that is wrong by some
    pixels bends the path a little too much or too little, but does not change its direction. The path is straight while
    the axis is not known, and the marker at rest where one reading is known.
    """
    count, h = marker.count, marker.history
    now = complex(h[count - 1, 1], h[count - 1, 2])
    if count < 2:
        return now
    before = complex(h[0, 1], h[0, 2])
    ahead, half = (time_s - h[1, 0]) / (h[1, 0] - h[0, 0]), 0.0
    if axis.known:
        centre = complex(axis.centre[0], axis.centre[1])
        half = 0.5 * cmath.phase((now - centre) * (before - centre).conjugate())
    # The ratio of two chords of a circle.
    longer = math.sin(ahead * half) / math.sin(half) if half != 0.0 else ahead
    return now + longer * (now - before) * cmath.exp(1j * half * (1.0 + ahead))


@shared
def jump_px(length_px: float, lost: int) -> float:
    """Return the standard deviation, px, of the position of a marker that was seen ``lost`` frames ago.

    It is that of a motion whose acceleration is a random walk: the variance grows with the fifth power of the time
    (Bar-Shalom and others, as in :mod:`tracker.innovation`, section 6.2.3).
    """
    return JUMP * length_px * math.sqrt(lost**5)


@shared
def by_other_px(own: Record, end: int) -> float:
    """Return the standard deviation, px, of a marker's position predicted from the other marker of its stick.

    It is very large where the other marker lies on the axis. ``own`` is the STICK.
    """
    arm = max(arm_px(own.axis, 1 - end), 1e-9)
    sigma_px = math.hypot(own.axis.sigma, STANDS_PX * arm_px(own.axis, end) / arm)
    return math.hypot(jump_px(own.length, 1), sigma_px)


@shared
def goes_on(rig: Record) -> bool:
    """Return whether the picture goes on moving as in its last step: a camera is carried rather than shaken.

    A single jump makes both errors equal, and independent shaking that of going on three times as large.
    """
    return bool(2.0 * rig.off[1] < rig.off[0])


@internal
def predict(scene: Scene, time_s: float) -> None:
    """Set the predicted position of every marker, and its predicted motion since the last frame."""
    rig = scene.rig[0]
    copy_to(rig.shift_now, rig.shift)
    base = 1 - rig.moving if rig.moving >= 0 and len(scene.sticks) > 1 else -1
    if base >= 0 and goes_on(rig):
        _carry_base(scene, base)
    for index in range(len(scene.markers)):
        marker, reading = scene.markers[index], scene.readings[index]
        reading.predicted[0], reading.predicted[1] = marker.x, marker.y
        reading.path[:] = 0.0
        if index // 2 != base and marker.count > 0:
            place = extrapolated(marker, scene.sticks[index // 2].axis, time_s)
            reading.predicted[0], reading.predicted[1] = place.real + rig.shift_now[0], place.imag + rig.shift_now[1]
    for stick in range(len(scene.sticks)):
        if stick != base:
            if scene.sticks[stick].axis.known:
                _carry_lost(scene, stick)
            for index in (2 * stick, 2 * stick + 1):
                _set_path(rig, scene.markers[index], scene.readings[index])


@lending
def _set_path(rig: Record, marker: Record, reading: Record) -> None:
    """Set a marker's predicted motion since the last frame."""
    for i in range(2):
        if marker.count > 0 and marker.lost > 0:
            reading.path[i] = reading.predicted[i] - (marker.x if i == 0 else marker.y)
        elif marker.count > 0:
            reading.path[i] = reading.predicted[i] - rig.shift_now[i] - marker.history[marker.count - 1, 1 + i]


@lending
def _carry_base(scene: Scene, base: int) -> None:
    """Carry the base on by its last step, in the picture that goes on moving."""
    rig, own, last, step = scene.rig[0], scene.sticks[base], scene.rig[0].last, scene.rig[0].step
    for k in range(2):
        rig.shift_now[k] += 0.5 * (step[0, k] + step[1, k])
    for end in range(2):
        scene.markers[2 * base + end].x += step[end, 0]
        scene.markers[2 * base + end].y += step[end, 1]
    offset = complex(last[1, 0] - last[0, 0], last[1, 1] - last[0, 1])
    turn = 1.0 + complex(step[1, 0] - step[0, 0], step[1, 1] - step[0, 1]) / offset
    own.start_rad += cmath.phase(turn)
    own.length *= abs(turn)


@lending
def _carry_lost(scene: Scene, stick: int) -> None:
    """Predict lost markers on their circles from the other marker, where that is more precise than their own motion."""
    shift, own = scene.rig[0].shift_now, scene.sticks[stick]
    for end in range(2):
        marker, other = scene.markers[2 * stick + end], 2 * stick + 1 - end
        more_precise = by_other_px(own, end) < jump_px(own.length, 1 + marker.lost)
        if marker.lost > 0 and scene.markers[other].lost == 0 and more_precise:
            at, predicted = scene.readings[other].predicted, scene.readings[2 * stick + end].predicted
            direction = direction_from(own.axis, at[0] - shift[0], at[1] - shift[1], 1 - end)
            x, y = on_circle(own.axis, direction, end)
            predicted[0], predicted[1] = x + shift[0], y + shift[1]
