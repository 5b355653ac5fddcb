"""The frame step: predict, read by Lucas–Kanade, judge, and learn (compiled).

The step is interrupted where a stick that should be seen was not found at its predicted position, and returns that
stage: :mod:`tracker.follow.redetect` searches for the stick, and the step is resumed. A usual frame takes one call.
"""

from __future__ import annotations

from torsight.core.compiled import compiled, internal, shared
from tracker.appearance.lucas_kanade import Luma
from tracker.follow.camera_state import KNOWN, find_shift, seen
from tracker.follow.judgement import covers, judge_base, judge_moving, judge_pair, note_covered
from tracker.follow.learning import note
from tracker.follow.motion_model import is_base, predict
from tracker.follow.reading import read_marker
from tracker.follow.state import Scene
from tracker.rows import SHADOWED

START, FIRST, SECOND, DONE = range(4)
"""Stages: the start of a step; interruptions to search for the stick that is judged first or second (base and moving
one, once they are known); and its end."""


@shared
def stick_at(scene: Scene, stage: int) -> int:
    """Return the stick that is judged at a stage; −1 where there is none."""
    moving = scene.rig[0].moving
    if stage - FIRST >= len(scene.sticks):
        return -1
    if moving < 0:
        return stage - FIRST
    return 1 - moving if stage == FIRST else moving  # type: ignore[no-any-return]


@internal
def read_all(scene: Scene, luma: Luma) -> None:
    """Read all markers near their predicted positions, the moving stick's first.

    A base marker that the moving stick reaches is read only until it is known which stick lies above.
    """
    rig = scene.rig[0]
    for base in (False, True):
        for index in range(len(scene.markers)):
            if is_base(rig, index // 2) != base:
                continue
            marker = scene.markers[index]
            if base and rig.above >= KNOWN and covers(scene, rig.moving, (marker.x, marker.y), index):
                scene.readings[index].state = SHADOWED
            else:
                read_marker(scene, luma, index, 0.0)


@internal
def judge_stick(scene: Scene, stage: int) -> bool:
    """Judge the stick of a stage; return whether it has to be searched for."""
    stick = stick_at(scene, stage)
    if stick < 0:
        return False
    if scene.rig[0].moving < 0:
        judge_pair(scene, stick)
        return not (seen(scene, 2 * stick) and seen(scene, 2 * stick + 1))
    if is_base(scene.rig[0], stick):
        return judge_base(scene)
    find_shift(scene)
    return judge_moving(scene)


@compiled
def advance(scene: Scene, luma: Luma, time_s: float, stage: int) -> int:
    """Process a frame from a stage on; return the stage at which it is interrupted, or ``DONE``."""
    rig = scene.rig[0]
    if stage == START:
        predict(scene, time_s)
        read_all(scene, luma)
    for stop in (FIRST, SECOND):
        if stage < stop and judge_stick(scene, stop):
            return stop
    if rig.moving >= 0:
        rig.unknown = 0 if find_shift(scene) else rig.unknown + 1
        if len(scene.sticks) > 1:
            note_covered(scene)
    note(scene, luma, time_s)
    return DONE
