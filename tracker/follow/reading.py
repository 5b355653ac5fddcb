"""Reading of one marker, and tests of that reading alone: near its prediction, and as good a fit as usual (compiled).

The fit is compared with the marker's earlier ones: residual and worst sector, as logarithms of their share of the step,
may be five mean deviations above their means (four standard deviations of a normal variable).
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
"""Brightness step, grey levels, below which no dot is visible."""
_CONTRAST: Final = (0.45, 1.8)
"""Range of the contrast over the template's in which it is the same dot: about a factor of two."""
_DEVIATIONS: Final = 5.0
_LEAST_SPREAD: Final = (0.35, 0.7)
"""Smallest allowance for residual and worst sector, logarithms: factors of 1.4 and 2."""
_NEVER: Final = 0.3
"""Residual in excess of the marker's usual noise, in quadrature, as a share of the step, above which it is no dot."""
_ALWAYS: Final = 0.015
"""Residual, as a share of the step, that is always accepted: it is the rounding for a step of 20 grey levels."""


@shared
def share_of_step(value: float, step: float) -> float:
    """Return the logarithm of a residual over the brightness step."""
    return math.log(max(value, 1e-3) / max(abs(step), 1.0))


@lending
def fits(marker: Record, reading: Record, slack: float) -> bool:
    """Return whether a reading is of the marker itself, by comparison with the marker's fits so far.

    ``slack`` is added to the limits of the residuals, as a share of the step, for motion blur that is not known yet.
    """
    step = abs(reading.step)
    if step < LEAST_STEP or not reading.converged:
        return False
    if not _CONTRAST[0] < reading.contrast < _CONTRAST[1]:
        return False
    limit = math.exp(marker.residual[0] + max(_DEVIATIONS * marker.residual[1], _LEAST_SPREAD[0])) + slack
    patch_limit = math.exp(marker.patch[0] + max(_DEVIATIONS * marker.patch[1], _LEAST_SPREAD[1])) + slack
    share, patch = reading.residual / step, reading.patch / step
    # In dim light the noise alone may be a quarter of the step.
    noise = math.exp(marker.residual[0]) * marker.step
    if reading.residual**2 > noise**2 + (_NEVER * step) ** 2:
        return False
    return bool(share <= max(limit, _ALWAYS) and patch <= max(patch_limit, _ALWAYS))


@lending
def _lay_across(scene: Scene, index: int) -> None:
    """Set the direction towards the first edge of a marker's stick, from the stick's predicted position."""
    i = index - index % 2
    inner, outer, across = (
        scene.readings[i].predicted,
        scene.readings[i + 1].predicted,
        scene.markers[index].shape.across,
    )
    across[0], across[1] = inner[1] - outer[1], outer[0] - inner[0]


@compiled
def read_at(scene: Scene, luma: Luma, index: int, place: Point, slack: float, out: Record) -> int:
    """Read a marker near a position, and return its state; the limits get ``slack`` or that of its speed."""
    marker, path, rig = scene.markers[index], scene.readings[index].path, scene.rig[0]
    _lay_across(scene, index)
    smear = (rig.shutter_share * path[0], rig.shutter_share * path[1])
    if not read_dot(luma, place[0], place[1], marker, scene.looks[index], smear, out):
        return OUTSIDE
    loose = max(slack, smear_slack(rig, math.hypot(path[0], path[1])))
    return SEEN if fits(marker, out, loose) else HIDDEN


@lending
def _is_near(marker: Record, reading: Record, x: float, y: float) -> bool:
    """Return whether a reading is within Lucas–Kanade's basin of convergence, a dot's radius, around its start."""
    variance = (marker.shape.radius / SIGMAS) ** 2
    return passes(((reading.x - x) ** 2 + (reading.y - y) ** 2) / variance, 2)


@compiled
def glance_at(luma: Luma, marker: Record, look: Look, place: Point, slack: float, out: Record) -> bool:
    """Read a dot of which only the appearance is known near a position; return whether it is there."""
    inside = read_dot(luma, place[0], place[1], marker, look, (0.0, 0.0), out)
    return inside and fits(marker, out, slack) and _is_near(marker, out, place[0], place[1])


@compiled
def read_marker(scene: Scene, luma: Luma, index: int) -> None:
    """Read a marker near its predicted position; it is hidden if the reading is not close to that."""
    reading = scene.readings[index]
    x, y = reading.predicted[0], reading.predicted[1]
    state = read_at(scene, luma, index, (x, y), 0.0, reading)
    if state == SEEN and not _is_near(scene.markers[index], reading, x, y):
        state = HIDDEN
    reading.state = state
