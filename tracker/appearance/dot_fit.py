"""The picture of a round dot on a stick, and its least-squares fit.

Model, in a window around the dot: light · (1 + k · D), where D falls from 1 inside the dot to 0 outside over an edge of
width ``edge_px``, and the light is a plane: it is uneven. A dark dot has k < 0, a light one k > 0. Circles look like
ellipses from aside, so the shape carries two terms of anisotropy. Only a disc-shaped window that ends short of the
stick's own edges is fitted.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from torsight.core.compiled import compiled
from tracker.appearance.disc import SHAPE, Floats, Record, disc_point
from tracker.appearance.lucas_kanade import inner, invert, products

LIGHT, STEP, SQUARE, EXPLAINED = 6, 7, 8, 9
"""Where the outcome stands behind the six parameters of a fit."""

EDGE_PX: Final = 0.5
"""Edge width at the start of a fit: standard deviation of the blur of a good lens."""
_SHARPEST_PX: Final = 0.12
"""Least edge: below it the mean over a pixel, which is taken apart, hides all of the blur."""
_ROUNDS: Final = 15
"""Steps of Levenberg and Marquardt at most."""
_LOOK: Final = 3
_DOUBTFUL: Final = 0.3
_HOPELESS: Final = 0.55
"""A start that explains less than the first share is not looked at; a fit that explains less than the second after a
few rounds is not of a dot."""


@dataclass(frozen=True, slots=True)
class DotShape:
    """Shape of one dot, which does not change while it moves; ``radius_px`` is that of the circle of the same area.

    ``edge_px``: standard deviation of the blur of its edge; ``stretch``: relative lengthening along x (and shortening
    along y), and along the diagonal; ``contrast``: brightness inside over that outside, less 1; ``window_px``: radius
    of the window in which it is compared.
    """

    radius_px: float
    edge_px: float
    stretch: tuple[float, float]
    contrast: float
    window_px: float


@dataclass(frozen=True, slots=True)
class DotFit:
    """A dot fitted in one picture.

    ``light`` is the brightness of the stick around it, ``residual`` the root mean square of what the fit leaves, grey
    levels; ``explained`` the share of the window's variance that the fit explains.
    """

    x_px: float
    y_px: float
    shape: DotShape
    light: float
    residual: float
    explained: float


def window_for(radius_px: float, edge_px: float = EDGE_PX, room_px: float = np.inf) -> float:
    """Return the radius of the window for a dot, given the distance from its centre to the stick's edge.

    It holds the whole rim and a little of the stick; seen from aside, sticks get narrower, so some room is left over.
    """
    wanted = 1.05 * radius_px + 1.0 + 1.5 * edge_px
    return max(radius_px + 0.8, min(wanted, 0.95 * room_px))


def fit_dot(
    luma: NDArray[np.uint8],
    x_px: float,
    y_px: float,
    *,
    radius_px: float,
    light_dot: bool,
    room_px: float = np.inf,
    ellipse: bool = True,
) -> DotFit | None:
    """Fit position, shape, contrast and light of the dot near a position in a picture (h, w), with its radius.

    ``room_px`` is the distance from its centre to the stick's edge, which the window must not pass; ``ellipse``: fit
    the stretch too. None where the fit runs away, or the window leaves the picture.
    """
    start = np.array([x_px, y_px, radius_px, max(EDGE_PX, 0.05 * radius_px), 0.0, 0.0])
    # First with a wide window, which holds the rim even where the start is off; then with the right one.
    found = _fitted(luma, start, 4, min(1.25 * radius_px + 1.5, max(room_px, radius_px + 1.5)), radius_px)
    for _ in range(2):
        if found is None:
            return None
        last = found[:6]
        found = _fitted(luma, last, 6 if ellipse else 4, window_for(last[2], last[3], room_px), radius_px)
    if found is None:
        return None
    return _result(found, 1.0 if light_dot else -1.0, window_for(found[2], found[3], room_px))


def _fitted(luma: NDArray[np.uint8], start: Floats, free: int, window_px: float, radius_px: float) -> Floats | None:
    """Fit the first ``free`` parameters in one window; None where it is hopeless, or leaves the picture."""
    window = cut_window(luma, start[0], start[1], window_px)
    if not len(window[0]):
        return None
    found = minimise(window, start, free, radius_px, np.zeros(1, SHAPE))
    return found if found[EXPLAINED] > 0.0 else None


@compiled
def cut_window(luma: NDArray[np.uint8], x_px: float, y_px: float, radius_px: float) -> Floats:
    """Return x, y and brightness (3, n) of the pixels around a place; none where they leave the picture."""
    cx, cy, half = round(x_px), round(y_px), math.ceil(radius_px)
    height, width = luma.shape
    out = np.empty((3, (2 * half + 1) ** 2))
    n = 0
    if cx - half < 0 or cy - half < 0 or cx + half >= width or cy + half >= height:
        return out[:, :0].copy()
    for y in range(cy - half, cy + half + 1):
        for x in range(cx - half, cx + half + 1):
            if (x - x_px) ** 2 + (y - y_px) ** 2 <= radius_px * radius_px:
                out[0, n], out[1, n], out[2, n] = x, y, luma[y, x]
                n += 1
    return out[:, :n].copy()


@compiled
def set_shape(shape: Record, found: Floats) -> None:
    """Take radius, edge and stretch from the parameters."""
    shape.radius, shape.edge = found[2], found[3]
    shape.stretch[0], shape.stretch[1] = found[4], found[5]


@compiled
def solve_linear(window: Floats, found: Floats, free: int, shape: Record, rows: Floats) -> None:
    """Solve the linear part (light, contrast, slope) for a given shape, and find the slopes of the rest.

    ``rows`` (11, n): four columns of the linear part, the slopes by six parameters, freed of what the linear part can
    make up for (variable projection), and the residual.
    """
    n = window.shape[1]
    set_shape(shape, found)
    for i in range(n):
        dx, dy = window[0, i] - found[0], window[1, i] - found[1]
        inside, along_x, along_y, rows[7, i] = disc_point(dx, dy, shape)
        rows[0, i], rows[1, i], rows[2, i], rows[3, i] = 1.0, inside, dx * (1.0 - inside), dy * (1.0 - inside)
        rows[4, i], rows[5, i], rows[6, i] = -along_x, -along_y, -(dx * along_x + dy * along_y) / found[2]
        rows[8, i], rows[9, i] = -(dx * along_x - dy * along_y), -(dy * along_x + dx * along_y)
    inverse = invert(products(rows, 4))
    linear = project_out(window[2], rows, inverse, rows[10])
    for k in range(4, 4 + free):
        for i in range(n):
            rows[k, i] *= linear[1]
        project_out(rows[k].copy(), rows, inverse, rows[k])
    square, mean = 0.0, window[2].sum() / n
    spread = 0.0
    for i in range(n):
        square += rows[10, i] ** 2
        spread += (window[2, i] - mean) ** 2
    found[LIGHT], found[STEP], found[SQUARE] = linear[0], linear[1], square / n
    found[EXPLAINED] = 1.0 - square / max(spread, 1e-12 * n)


@compiled
def project_out(values: Floats, rows: Floats, inverse: Floats, out: Floats) -> Floats:
    """Leave in ``out`` of values what the first rows cannot make up for; return what they can, by row."""
    weights = solved(inverse, rows, values)
    out[:] = values
    for k in range(len(inverse)):
        for i in range(len(values)):
            out[i] -= weights[k] * rows[k, i]
    return weights


@compiled
def solved(inverse: Floats, rows: Floats, values: Floats) -> Floats:
    """Return an inverse (k, k) times the first k rows times values."""
    weights = np.zeros(len(inverse))
    for m in range(len(inverse)):
        total = inner(rows[m], values)
        for k in range(len(inverse)):
            weights[k] += inverse[k, m] * total
    return weights


@compiled
def minimise(window: Floats, start: Floats, free: int, radius_px: float, shapes: NDArray[np.void]) -> Floats:
    """Fit the first ``free`` parameters by Levenberg and Marquardt.

    Returned (10,) are x, y, radius, edge, stretch (2), light, step, mean square of the residual, and the share that is
    explained: 0 where it is hopeless.
    """
    n = window.shape[1]
    best, other = np.empty((11, n)), np.empty((11, n))
    found, trial = np.zeros(10), np.zeros(10)
    found[:6] = start[:6]
    damping = 1e-3
    solve_linear(window, found, free, shapes[0], best)
    if found[EXPLAINED] < _DOUBTFUL:
        found[EXPLAINED] = 0.0
        return found
    for step in range(_ROUNDS):
        if step == _LOOK and found[EXPLAINED] < _HOPELESS:
            found[EXPLAINED] = 0.0
            break
        largest = step_from(found, best, free, damping, radius_px, trial)
        good = is_sane(trial, found, start, radius_px)
        if good:
            solve_linear(window, trial, free, shapes[0], other)
        if not good or trial[SQUARE] > found[SQUARE] * (1.0 + 1e-9):
            damping = max(damping, 1e-4) * 10.0
            if damping > 1e4:
                break
            continue
        gain = 1.0 - trial[SQUARE] / max(found[SQUARE], 1e-12)
        damping = max(damping * 0.2, 1e-9)
        found[:], best[:] = trial, other
        if gain < 1e-5 or largest < 1e-4:
            break
    return found


@compiled
def step_from(found: Floats, rows: Floats, free: int, damping: float, radius_px: float, trial: Floats) -> float:
    """Put the parameters after a damped step into ``trial``; return the largest change that it would make."""
    normal = products(rows[4:], free)
    for k in range(free):
        normal[k, k] += damping * (normal[k, k] + 1e-9)
    delta = solved(invert(normal), rows[4:], rows[10])
    trial[:6] = found[:6]
    for k in range(free):
        trial[k] += min(max(delta[k], -0.3 * radius_px), 0.3 * radius_px)
    trial[3] = max(trial[3], _SHARPEST_PX)
    return float(np.abs(delta).max())


@compiled
def is_sane(trial: Floats, now: Floats, start: Floats, radius_px: float) -> bool:
    """Return whether parameters may still be those of the dot at the start."""
    return bool(
        np.isfinite(trial[:6]).all()
        and math.hypot(trial[0] - start[0], trial[1] - start[1]) < 1.5 * radius_px + 2.0
        and 0.4 * radius_px < trial[2] < 2.0 * radius_px
        and _SHARPEST_PX <= trial[3] < 0.6 * max(now[2], 3.0)
        and math.hypot(trial[4], trial[5]) < 0.45
    )


def _result(found: Floats, sign: float, window_px: float) -> DotFit | None:
    x_px, y_px, radius, edge, across, diagonal, light, step, mean_square, explained = found.tolist()
    if light <= 0 or step * sign <= 0:
        return None
    shape = DotShape(radius, edge, (across, diagonal), step / max(light, 1.0), window_px)
    return DotFit(x_px, y_px, shape, light, math.sqrt(mean_square), explained)
