"""Reading of one marker, and tests of that reading alone: near its prediction, and as good a fit as usual (compiled).

The fit is compared with the marker's earlier ones: the residual, as the logarithm of its share of the step, may be five
mean deviations above its mean (four standard deviations of a normal variable).
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from torsight.core.compiled import compiled, lending, shared
from torsight.core.series import rounding_variance
from torsight.core.units import Floats, Ints
from tracker.appearance.disc import COLUMNS, Record
from tracker.appearance.lucas_kanade import PHASES, Luma, Places, Point, read_dot
from tracker.appearance.motion_blur import smear_slack
from tracker.follow.state import Scene
from tracker.innovation import SIGMAS, passes
from tracker.rows import HIDDEN, LOST, OUTSIDE, SEEN

Looks = tuple[Ints, Floats, NDArray[np.void], Ints]
"""The looks of many dots: their pixels and models, each one after the other in one row, their systems (d, 64), and the
number of pixels before each (d + 1)."""

LEAST_STEP: Final = 4.0
"""Brightness step, grey levels, below which no dot is visible."""
_CONTRAST: Final = (0.45, 1.8)
"""Range of the contrast over the template's in which it is the same dot: about a factor of two."""
_DEVIATIONS: Final = SIGMAS * math.sqrt(0.5 * math.pi)
"""Mean absolute deviations of the residual's logarithm that are allowed: √(2/π) of standard ones if it is normal."""
_LEAST_SPREAD: Final = 0.35
"""Smallest allowance for the residual, a logarithm: a factor of 1.4."""
_NEVER: Final = 0.3
"""Residual in excess of the marker's usual noise, in quadrature, as a share of the step, above which it is no dot."""
_ROUNDING: Final = math.sqrt(rounding_variance())
"""Residual in grey levels that is always accepted."""


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
    limit = math.exp(marker.residual[0] + max(_DEVIATIONS * marker.residual[1], _LEAST_SPREAD)) + slack
    # In dim light the noise alone may be a quarter of the step.
    noise = math.exp(marker.residual[0]) * marker.step
    if reading.residual**2 > noise**2 + (_NEVER * step) ** 2:
        return False
    return bool(reading.residual <= max(limit * step, _ROUNDING))


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
    smear = (rig.exposure.share * path[0], rig.exposure.share * path[1])
    if not read_dot(luma, place[0], place[1], marker, scene.looks[index], smear, out):
        return OUTSIDE
    loose = max(slack, smear_slack(rig.exposure, math.hypot(path[0], path[1])))
    return SEEN if fits(marker, out, loose) else HIDDEN


@lending
def _is_near(marker: Record, reading: Record, x: float, y: float) -> bool:
    """Return whether a reading is within Lucas–Kanade's basin of convergence, a dot's radius, around its start."""
    variance = (marker.shape.radius / SIGMAS) ** 2
    return passes(((reading.x - x) ** 2 + (reading.y - y) ** 2) / variance, 2)


@compiled
def glance_at(
    luma: Luma, markers: NDArray[np.void], looks: Looks, tried: Places, last: Places, rig: Record, out: NDArray[np.void]
) -> None:
    """Read dots of which only the appearance is known, each at the first of some positions near which it is there.

    ``markers`` (d,) are records of MARKER, ``tried`` (d, k), complex, the positions, NaN for a dot that is not read,
    ``last`` (d,) the positions in the last frame. The states of the readings ``out`` (d,) are SEEN or LOST.
    """
    pixels, models, systems, first = looks
    rows = PHASES * PHASES * (COLUMNS + 2)
    for d in range(len(out)):
        out[d].state = LOST
        begin, end = first[d], first[d + 1]
        own = (
            pixels[2 * begin : 2 * end].reshape((2, end - begin)),
            models[rows * begin : rows * end].reshape((PHASES * PHASES, COLUMNS + 2, end - begin)),
            systems[d],
        )
        for k in range(tried.shape[1]):
            x, y = tried[d, k].real, tried[d, k].imag
            if math.isnan(x) or not read_dot(luma, x, y, markers[d], own, (0.0, 0.0), out[d]):
                continue
            slack = smear_slack(rig.exposure, abs(tried[d, k] - last[d]))
            if fits(markers[d], out[d], slack) and _is_near(markers[d], out[d], x, y):
                out[d].state = SEEN
                break


@compiled
def read_marker(scene: Scene, luma: Luma, index: int, slack: float) -> None:
    """Read a marker near its predicted position; it is hidden if the reading is not close to that.

    For ``slack`` see :func:`read_at`.
    """
    reading = scene.readings[index]
    x, y = reading.predicted[0], reading.predicted[1]
    state = read_at(scene, luma, index, (x, y), slack, reading)
    if state == SEEN and not _is_near(scene.markers[index], reading, x, y):
        state = HIDDEN
    reading.state = state
