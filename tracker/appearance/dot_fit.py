"""The picture of a round dot on a stick, and its least-squares fit.

Model, in a window around the dot: light · (1 + k · D), where D falls from 1 inside the dot to 0 outside over an edge of
width ``edge_px``, and the light is uneven: a plane. A dark dot has k < 0, a light one k > 0. Circles look like ellipses
in an oblique view, so the shape has two anisotropy terms, its stretch. Only a disc-shaped window that ends short of the
stick's own edges is fitted.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from torsight.core.compiled import compiled, copy_to, internal, lending
from torsight.core.units import Floats
from tracker.appearance.disc import MOST_STRETCH, SHAPE, Record, disc_point
from tracker.appearance.lucas_kanade import eliminate, inner, take_away

EDGE_PX: Final = 0.5
"""Edge width at the start of a fit: standard deviation of the blur by a good lens."""
_SHARPEST_PX: Final = 0.12
"""Smallest edge width: below it the blur is hidden by the averaging over a pixel, which is modelled separately."""
_ROUNDS: Final = 15
"""Most Levenberg-Marquardt steps."""
_LOOK: Final = 3
_SMALL_PX: Final = 1e-3
"""Step below which the fit stops: convergence is quadratic, so the next step would be negligible."""
_DOUBTFUL: Final = 0.3
_HOPELESS: Final = 0.55
"""Shares of the variance that a fit has to explain: the first from its start, the second after ``_LOOK`` rounds;
otherwise it is given up as not that of a dot."""


@dataclass(frozen=True, slots=True)
class Dot:
    """A dot fitted in one picture; ``radius_px`` is that of the circle of the same area.

    ``edge_px``: standard deviation of the blur of its edge; ``stretch``: relative lengthening along x (and shortening
    along y), and along the diagonal; ``contrast``: brightness inside over that outside, less 1; ``window_px``: radius
    of the window that is fitted. ``light`` is the brightness of the stick around the dot, ``residual`` the rms residual
    of the fit, both in grey levels; ``explained`` is the share of the window's variance that the fit explains.
    """

    x_px: float
    y_px: float
    radius_px: float
    edge_px: float
    stretch: tuple[float, float]
    contrast: float
    window_px: float
    light: float
    residual: float
    explained: float

    @property
    def step(self) -> float:
        """Absolute difference of the brightness inside and outside, grey levels."""
        return abs(self.contrast) * self.light


def window_for(radius_px: float, edge_px: float = EDGE_PX, room_px: float = np.inf) -> float:
    """Return the radius of the window for a dot, given the distance from its centre to the stick's edge.

    The window contains the whole rim and a little of the stick, within 95 % of that distance: sticks look narrower in
    an oblique view.
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
) -> Dot | None:
    """Fit position, shape, contrast and brightness of the dot of a known approximate radius near a position.

    ``luma`` is the picture (h, w). ``room_px`` is the distance from the dot's centre to the stick's edge, which the
    window must not pass; with ``ellipse`` the stretch is fitted, too. None where the fit diverges, or the window leaves
    the picture.
    """
    values = np.array([x_px, y_px, radius_px, max(EDGE_PX, 0.05 * radius_px), 0.0, 0.0])
    # First with a wide window, which contains the rim even from a poor start; then twice with the right one.
    window_px, free = min(1.25 * radius_px + 1.5, max(room_px, radius_px + 1.5)), 4
    for _ in range(3):
        window = _cut(luma, values[0], values[1], window_px)
        if not window.size:
            return None
        pixels = window.shape[1]
        spread = max(float(np.sum((window[2] - window[2].mean()) ** 2)), 1e-12 * pixels)
        light, step, square = settle(window, values, np.zeros(1, SHAPE)[0], free, radius_px, spread)
        if not math.isfinite(square):
            return None
        window_px, free = window_for(values[2], values[3], room_px), 6 if ellipse else 4
    if light <= 0 or step * (1.0 if light_dot else -1.0) <= 0:
        return None
    x, y, radius, edge, *stretch = values.tolist()
    contrast, residual = step / max(light, 1.0), math.sqrt(square / pixels)
    return Dot(x, y, radius, edge, (*stretch,), contrast, window_px, light, residual, 1.0 - square / spread)


@compiled
def settle(
    window: Floats, values: Floats, shape: Record, free: int, radius_px: float, spread: float
) -> tuple[float, float, float]:
    """Fit the first ``free`` of a dot's six values, in place, by the Levenberg-Marquardt method.

    Return light, step, and the sum of squared residuals, infinite where the fit explains too little of ``spread``, the
    window's sum of squares.
    """
    rows, products, weights = np.empty((11, window.shape[1])), np.empty((4, 4)), np.empty((4, 1))
    normal, damped = np.empty((free, free)), np.empty((free, free))
    gradient, delta = np.empty(free), np.empty((free, 1))
    start, trial, damping = values.copy(), values.copy(), 1e-3
    square = misfit(window, values, shape, rows, products, weights)
    light, step = weights[0, 0], weights[1, 0]
    fill_normal(rows, step, products, normal, gradient)
    for count in range(_ROUNDS):
        if not 1.0 - square / spread >= (_DOUBTFUL if count < _LOOK else _HOPELESS):
            return light, step, math.inf
        for i in range(free):
            for j in range(free):
                damped[i, j] = normal[i, j]
            # The constant makes the step of a value without effect zero.
            damped[i, i] += damping * normal[i, i] + 1e-9
            delta[i, 0] = gradient[i]
        for i in range(free):
            eliminate(damped, delta, i)
        largest_px = 0.0
        for i in range(free):
            trial[i] = values[i] + min(max(delta[i, 0], -0.3 * radius_px), 0.3 * radius_px)
            largest_px = max(largest_px, abs(delta[i, 0]))
        trial[3] = max(trial[3], _SHARPEST_PX)
        left = math.inf
        if is_sane(trial, values, start, radius_px):
            left = misfit(window, trial, shape, rows, products, weights)
        if left <= square:
            copy_to(values, trial)
            square, damping, light, step = left, 0.2 * damping, weights[0, 0], weights[1, 0]
            fill_normal(rows, step, products, normal, gradient)
        else:
            damping = 10.0 * max(damping, 1e-4)
        # Also a step that is not taken: more damping would only shorten it.
        if largest_px < _SMALL_PX:
            break
    return light, step, square


@internal
def misfit(window: Floats, values: Floats, shape: Record, rows: Floats, products: Floats, weights: Floats) -> float:
    """Return the sum of squared residuals of a shape, with its linear part solved for (variable projection).

    ``rows`` (11, n) then hold, from the fifth, the residuals of the brightness and the derivatives of D; ``products``
    (4, 4) the inner products of the linear part's columns; ``weights`` (4, 1) light, step and gradient of the light.
    """
    shape.radius, shape.edge, shape.stretch[0], shape.stretch[1] = values[2], values[3], values[4], values[5]
    fill_rows(window, values, shape, rows)
    for m in range(4):
        for k in range(m + 1):
            products[m, k] = products[k, m] = inner(rows[m], rows[k])
        weights[m, 0] = inner(rows[m], rows[4])
    solve_linear(products, weights)
    for m in range(4):
        take_away(rows[4], rows[m], weights[m, 0])
    return inner(rows[4], rows[4])


@internal
def solve_linear(products: Floats, weights: Floats) -> None:
    """Replace products (4, k) of the linear part's columns with k rows by the weights that explain these rows."""
    left = products.copy()
    for m in range(4):
        eliminate(left, weights, m)


@internal
def fill_normal(rows: Floats, step: float, products: Floats, normal: Floats, gradient: Floats) -> None:
    """Compute the normal equations of the next step: of what the linear part does not explain of the derivatives."""
    free = len(gradient)
    both = np.empty((4, free))
    for m in range(4):
        for i in range(free):
            both[m, i] = inner(rows[m], rows[5 + i])
    weights = both.copy()
    solve_linear(products, weights)
    for i in range(free):
        gradient[i] = step * inner(rows[5 + i], rows[4])
        for j in range(i + 1):
            left = inner(rows[5 + i], rows[5 + j])
            for m in range(4):
                left -= both[m, i] * weights[m, j]
            normal[i, j] = normal[j, i] = step * step * left


@compiled
def _cut(luma: NDArray[np.uint8], x_px: float, y_px: float, radius_px: float) -> Floats:
    """Return x, y and brightness (3, n) of the pixels in a disc around a position; none where it leaves the picture."""
    cx, cy, half = round(x_px), round(y_px), math.ceil(radius_px)
    height, width = luma.shape
    if cx - half < 0 or cy - half < 0 or cx + half >= width or cy + half >= height:
        return np.empty((3, 0))
    window, count = np.empty((3, (2 * half + 1) ** 2)), 0
    for y in range(cy - half, cy + half + 1):
        for x in range(cx - half, cx + half + 1):
            if (x - x_px) ** 2 + (y - y_px) ** 2 <= radius_px**2:
                window[0, count], window[1, count], window[2, count] = x, y, luma[y, x]
                count += 1
    return window[:, :count].copy()


@lending
def fill_rows(window: Floats, found: Floats, shape: Record, rows: Floats) -> None:
    """Fill ``rows`` (11, n): columns of the linear part (light, step, gradient), brightness, and derivatives of D.

    The derivatives are with respect to the six values.
    """
    for i in range(window.shape[1]):
        dx, dy = window[0, i] - found[0], window[1, i] - found[1]
        inside, along_x, along_y, rows[8, i] = disc_point(dx, dy, shape)
        rows[0, i], rows[1, i], rows[2, i], rows[3, i] = 1.0, inside, dx * (1.0 - inside), dy * (1.0 - inside)
        rows[4, i] = window[2, i]
        rows[5, i], rows[6, i], rows[7, i] = -along_x, -along_y, -(dx * along_x + dy * along_y) / found[2]
        rows[9, i], rows[10, i] = -(dx * along_x - dy * along_y), -(dy * along_x + dx * along_y)


@lending
def is_sane(trial: Floats, now: Floats, start: Floats, radius_px: float) -> bool:
    """Return whether position, radius, edge and stretch may still be those of the dot at the start."""
    return (
        math.hypot(trial[0] - start[0], trial[1] - start[1]) < 1.5 * radius_px + 2.0
        and 0.4 * radius_px < trial[2] < 2.0 * radius_px
        and _SHARPEST_PX <= trial[3] < 0.6 * max(now[2], 3.0)
        and math.hypot(trial[4], trial[5]) < MOST_STRETCH
    )
