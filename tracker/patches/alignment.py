"""Steps of the inverse compositional Lucas–Kanade of a patch (compiled); see :mod:`tracker.patches.align`."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from torsight.core.compiled import compiled, internal
from torsight.core.units import Floats
from tracker.appearance.lucas_kanade import eliminate, inner, unit
from tracker.patches.warps import project


class Template(NamedTuple):
    """Data of a template for one step, known at ``points`` (2, n) relative to its middle.

    ``inverse`` (first + k, n): least-squares inverse, whose rows give illumination, gain (row 3) and other nuisance
    parameters, then δ times gain; ``generators`` (k, 3, 3) of the warp; ``rim`` (2, m): points on the template's rim;
    ``half_px``, ``spread``: its half width, and the standard deviation of its brightness.
    """

    points: Floats
    inverse: Floats
    generators: Floats
    rim: Floats
    half_px: float
    spread: float


class Part(NamedTuple):
    """Part of a picture, blurred, with the pixel at its top left corner, and the limits (x, y) of valid positions."""

    values: NDArray[np.float32]
    left: int
    top: int
    low: tuple[float, float]
    high: tuple[float, float]


LIGHT, ALONG_X, ALONG_Y, GAIN = range(4)
"""First rows of the solution: brightness at the middle, its gradient, and the contrast over the template's."""
_LEAST_SPREAD: Final = 1.0
"""Standard deviation, grey levels, below which a patch shows nothing: that by rounding alone is a third of it."""
_FARTHEST: Final = 0.7
"""Largest step over the half width: beyond it, the picture there is unknown to the template."""


@internal
def in_part(warp: Floats, rim: Floats, part: Part) -> bool:
    """Return whether the rim of a patch lies within a part of a picture."""
    seen = project(warp, rim)
    for i in range(seen.shape[1]):
        for k in range(2):
            if not part.low[k] <= seen[k, i] <= part.high[k]:
                return False
    return True


@internal
def without(warp: Floats, change: Floats) -> Floats:
    """Return W D⁻¹, scaled: its transpose X solves Dᵀ X = Wᵀ.

    Numba's own inverse imports all of scipy.linalg, a tenth of a second of CPU at the start.
    """
    left, right, out = change.T.copy(), warp.T.copy(), np.empty((3, 3))
    for i in range(3):
        eliminate(left, right, i)
    for i in range(3):
        for j in range(3):
            out[i, j] = right[j, i] / right[2, 2]
    return out


@compiled
def step_warp(found: Floats, warp: Floats, template: Template, part: Part) -> tuple[bool, Floats]:
    """Return whether a step is valid (contrast, size, within the part), and the warp after it: W D⁻¹."""
    gain, count = found[GAIN], len(template.generators)
    if abs(gain) * template.spread < _LEAST_SPREAD:
        return False, warp
    change = unit(3)
    for k in range(count):
        delta = found[len(found) - count + k] / gain
        if not abs(delta) < _FARTHEST * template.half_px:
            return False, warp
        for i in range(3):
            for j in range(3):
                change[i, j] += delta * template.generators[k, i, j]
    after = without(warp, change)
    return in_part(after, template.rim, part), after


@compiled
def sample(part: Part, warp: Floats, points: Floats) -> Floats:
    """Return the picture's brightness (n,) at points (2, n) of the template, by linear interpolation."""
    values = part.values
    height, width = values.shape
    out = np.empty(points.shape[1])
    seen = project(warp, points)
    for i in range(len(out)):
        x = min(max(seen[0, i] - part.left, 0.0), width - 1.0)
        y = min(max(seen[1, i] - part.top, 0.0), height - 1.0)
        column, row = min(int(x), width - 2), min(int(y), height - 2)
        f, g = x - column, y - row
        upper = (1.0 - f) * values[row, column] + f * values[row, column + 1]
        lower = (1.0 - f) * values[row + 1, column] + f * values[row + 1, column + 1]
        out[i] = (1.0 - g) * upper + g * lower
    return out


@compiled
def largest_step(before: Floats, after: Floats, rim: Floats) -> float:
    """Return the largest change of a coordinate of the rim by a step, px."""
    old, new, largest_px = project(before, rim), project(after, rim), 0.0
    for i in range(old.shape[1]):
        largest_px = max(largest_px, abs(new[0, i] - old[0, i]), abs(new[1, i] - old[1, i]))
    return largest_px


@compiled
def found_of(solved: Floats, usual: Floats) -> Floats:
    """Return the solution corrected for the template's usual residuals.

    ``solved`` is the solution for the picture, ``usual`` that for the residuals at a contrast of one.
    """
    found: Floats = solved - solved[GAIN] / (1.0 + usual[GAIN]) * usual
    return found


@compiled
def align_warp(
    warp: Floats, template: Template, part: Part, usual: Floats, rounds: int, stop_px: float
) -> tuple[bool, float, Floats, Floats]:
    """Iterate until steps are small; ``usual`` is the solution for the template's usual residuals.

    Returned are whether all steps were valid, the size of the last step, and the warps before and after it.
    """
    moved, before, found = np.inf, warp, np.empty(len(template.inverse))
    for _ in range(rounds):
        seen = sample(part, warp, template.points)
        for i in range(len(found)):
            found[i] = inner(template.inverse[i], seen)
        good, after = step_warp(found_of(found, usual), warp, template, part)
        if not good:
            return False, moved, warp, after
        moved, before, warp = largest_step(warp, after, template.rim), warp, after
        if moved < stop_px:
            break
    return True, moved, before, warp
