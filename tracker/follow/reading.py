"""Reading one marker and judging it by itself: where it was predicted, and fitting as it usually does.

Compiled. The fit is judged against what the marker has shown so far: residual and worst sector, as logarithms of their
share of the step, may be five mean deviations above their means (four standard deviations of a normal variable).
"""

from __future__ import annotations

import math
from typing import Final

from torsight.core.compiled import compiled, lending, shared
from tracker.appearance.disc import Record
from tracker.appearance.lucas_kanade import Look, Luma, Point, read_dot
from tracker.appearance.motion_blur import smear_slack
from tracker.follow.state import Scene
from tracker.innovation import SIGMAS, passes
from tracker.rows import HIDDEN, OUTSIDE, SEEN

LEAST_STEP: Final = 4.0
"""Grey levels below which there is no dot to be seen."""
_CONTRAST: Final = (0.45, 1.8)
"""Contrast over the template's outside of which it is not this dot: a factor of two, and a little."""
_DEVIATIONS: Final = 5.0
_LEAST_SPREAD: Final = (0.35, 0.7)
"""Least allowance for residual and worst sector, logarithms: factors of 1.4 and 2."""
_NEVER: Final = 0.3
"""What is left above the marker's usual noise, in quadrature, is not of a dot from this share of the step."""
_ALWAYS: Final = 0.015
"""A residual below this share of the step hides nothing: it is rounding for a step of 20 grey levels."""


@shared
def share_of_step(value: float, step: float) -> float:
    """Return the logarithm of a residual's share of the step."""
    return math.log(max(value, 1e-3) / max(abs(step), 1.0))


@lending
def fits(marker: Record, reading: Record, slack: float) -> bool:
    """Return whether a reading is of the marker itself, by how well the marker has fitted so far.

    ``slack`` is the share of the step by which it may be worse, for smear that is not known yet.
    """
    step = abs(reading.step)
    if step < LEAST_STEP or not reading.converged:
        return False
    if not _CONTRAST[0] < reading.contrast < _CONTRAST[1]:
        return False
    limit = math.exp(marker.residual[0] + max(_DEVIATIONS * marker.residual[1], _LEAST_SPREAD[0])) + slack
    patch_limit = math.exp(marker.patch[0] + max(_DEVIATIONS * marker.patch[1], _LEAST_SPREAD[1])) + slack
    share, patch = reading.residual / step, reading.patch / step
    # In little light the noise alone may be a quarter of the step.
    noise = math.exp(marker.residual[0]) * marker.step
    if reading.residual**2 > noise**2 + (_NEVER * step) ** 2:
        return False
    return bool(share <= max(limit, _ALWAYS) and patch <= max(patch_limit, _ALWAYS))


@lending
def _lay_across(scene: Scene, index: int) -> None:
    """Note where a marker's stick has its first edge, as the stick is expected to lie."""
    i = index - index % 2
    inner, outer, across = (
        scene.readings[i].predicted,
        scene.readings[i + 1].predicted,
        scene.markers[index].shape.across,
    )
    across[0], across[1] = inner[1] - outer[1], outer[0] - inner[0]


@compiled
def read_at(scene: Scene, luma: Luma, index: int, place: Point, slack: float, out: Record) -> int:
    """Read a marker from a place and return its state there; ``slack`` is added to that for its own speed."""
    marker, path, rig = scene.markers[index], scene.readings[index].path, scene.rig[0]
    _lay_across(scene, index)
    smear = (rig.shutter_share * path[0], rig.shutter_share * path[1])
    if not read_dot(luma, place[0], place[1], marker, scene.looks[index], smear, out):
        return OUTSIDE
    loose = max(slack, smear_slack(rig, math.hypot(path[0], path[1])))
    return SEEN if fits(marker, out, loose) else HIDDEN


@lending
def _is_near(marker: Record, reading: Record, x: float, y: float) -> bool:
    """Return whether a reading is within the basin of Lucas–Kanade, a dot's radius, of where it was begun."""
    variance = (marker.shape.radius / SIGMAS) ** 2
    return passes(((reading.x - x) ** 2 + (reading.y - y) ** 2) / variance, 2)


@compiled
def glance_at(luma: Luma, marker: Record, look: Look, place: Point, slack: float, out: Record) -> bool:
    """Read a dot of which only its picture is known from a place; return whether it is there."""
    inside = read_dot(luma, place[0], place[1], marker, look, (0.0, 0.0), out)
    return inside and fits(marker, out, slack) and _is_near(marker, out, place[0], place[1])


@compiled
def read_marker(scene: Scene, luma: Luma, index: int) -> None:
    """Read a marker from where it is predicted, and hold what is found against the prediction."""
    reading = scene.readings[index]
    x, y = reading.predicted[0], reading.predicted[1]
    state = read_at(scene, luma, index, (x, y), 0.0, reading)
    if state == SEEN and not _is_near(scene.markers[index], reading, x, y):
        state = HIDDEN
    reading.state = state
