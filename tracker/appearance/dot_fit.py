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
from torsight.core.units import Floats
from tracker.appearance.disc import MOST_STRETCH, SHAPE, Record, disc_point

EDGE_PX: Final = 0.5
"""Edge width at the start of a fit: standard deviation of the blur of a good lens."""
_SHARPEST_PX: Final = 0.12
"""Least edge: below it the mean over a pixel, which is taken apart, hides all of the blur."""
_ROUNDS: Final = 15
"""Steps of Levenberg and Marquardt at most."""
_LOOK: Final = 3
_SMALL_PX: Final = 1e-3
"""A step below which the next one changes nothing: steps shrink with their square."""
_DOUBTFUL: Final = 0.3
_HOPELESS: Final = 0.55
"""A start that explains less than the first share is not looked at; a fit that explains less than the second after a
few rounds is not of a dot."""


@dataclass(frozen=True, slots=True)
class Dot:
    """A dot fitted in one picture; ``radius_px`` is that of the circle of the same area.

    ``edge_px``: standard deviation of the blur of its edge; ``stretch``: relative lengthening along x (and shortening
    along y), and along the diagonal; ``contrast``: brightness inside over that outside, less 1; ``window_px``: radius
    of the window in which it is compared. ``light`` is the brightness of the stick around it, ``residual`` the root
    mean square of what the fit leaves, grey levels; ``explained`` the share of the window's variance that the fit
    explains.
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
        """Brightness inside against outside, grey levels."""
        return abs(self.contrast) * self.light


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
) -> Dot | None:
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
        window_px = window_for(found.values[2], found.values[3], room_px)
        found = _fitted(luma, found.values, 6 if ellipse else 4, window_px, radius_px)
    if found is None:
        return None
    x, y, radius, edge, across, diagonal = found.values.tolist()
    light, step = found.linear[:2].tolist()
    if light <= 0 or step * (1.0 if light_dot else -1.0) <= 0:
        return None
    window_px, residual = window_for(radius, edge, room_px), math.sqrt(found.square / len(found.left))
    contrast = step / max(light, 1.0)
    return Dot(x, y, radius, edge, (across, diagonal), contrast, window_px, light, residual, found.explained)


@dataclass(frozen=True, slots=True, eq=False)
class _Trial:
    """A dot in a window: its ``values`` x, y, radius, edge and stretch (6,), and how it fits.

    ``linear`` (4,) are light, step and two slopes of the light that fit best; ``left`` (n,) is what they leave,
    ``slopes`` (k, n) its derivatives, ``spread`` the window's sum of squares and ``square`` that of what is left.
    """

    values: Floats
    linear: Floats
    left: Floats
    slopes: Floats
    spread: float
    square: float

    @classmethod
    def of(cls, window: Floats, values: Floats, free: int, spread: float) -> _Trial:
        """Solve the linear part for a given shape (variable projection); the first ``free`` values are to be fitted."""
        shape, rows = np.zeros(1, SHAPE), np.empty((11, window.shape[1]))
        shape["radius"], shape["edge"], shape["stretch"] = values[2], values[3], values[4:6]
        fill_rows(window, values, shape[0], rows)
        plain, wanted = rows[:4], rows[4 : 5 + free]
        weights = np.asarray(np.linalg.solve(plain @ plain.T, plain @ wanted.T), np.float64)
        left = wanted - weights.T @ plain
        return cls(values, weights[:, 0], left[0], weights[1, 0] * left[1:], spread, float(left[0] @ left[0]))

    @property
    def explained(self) -> float:
        """Share of the window's variance that the dot explains."""
        return 1.0 - self.square / max(self.spread, 1e-12 * len(self.left))

    def normal(self) -> tuple[Floats, Floats]:
        """Return the normal equations of the next step: (k, k), and (k,)."""
        return self.slopes @ self.slopes.T, self.slopes @ self.left


def _fitted(luma: NDArray[np.uint8], start: Floats, free: int, window_px: float, radius_px: float) -> _Trial | None:
    """Fit the first ``free`` values in one window by Levenberg and Marquardt.

    None where that is hopeless, or the window leaves the picture.
    """
    window = _cut(luma, start[0], start[1], window_px)
    if window is None:
        return None
    spread = float(np.sum((window[2] - window[2].mean()) ** 2))
    found, damping = _Trial.of(window, start, free, spread), 1e-3
    normal, gradient = found.normal()
    for step in range(_ROUNDS):
        if found.explained < (_DOUBTFUL if step < _LOOK else _HOPELESS):
            return None
        damped = normal.copy()
        # Where a value changes nothing its step is nought.
        damped.ravel()[:: free + 1] += damping * normal.diagonal() + 1e-9
        delta = np.linalg.solve(damped, gradient)
        values = found.values.copy()
        values[:free] += np.clip(delta, -0.3 * radius_px, 0.3 * radius_px)
        values[3] = max(values[3], _SHARPEST_PX)
        trial = _Trial.of(window, values, free, spread) if _is_sane(values, found.values, start, radius_px) else None
        if trial is None or trial.square > found.square:
            damping = 10.0 * max(damping, 1e-4)
            continue
        found, damping = trial, 0.2 * damping
        normal, gradient = found.normal()
        if np.abs(delta).max() < _SMALL_PX:
            break
    return found


def _cut(luma: NDArray[np.uint8], x_px: float, y_px: float, radius_px: float) -> Floats | None:
    """Return x, y and brightness (3, n) of the pixels around a place; None where they leave the picture."""
    cx, cy, half = round(x_px), round(y_px), math.ceil(radius_px)
    height, width = luma.shape
    if cx - half < 0 or cy - half < 0 or cx + half >= width or cy + half >= height:
        return None
    y, x = np.mgrid[cy - half : cy + half + 1, cx - half : cx + half + 1].reshape(2, -1)
    inside = (x - x_px) ** 2 + (y - y_px) ** 2 <= radius_px**2
    return np.array([x[inside], y[inside], luma[y[inside], x[inside]]], dtype=np.float64)


@compiled
def fill_rows(window: Floats, found: Floats, shape: Record, rows: Floats) -> None:
    """Fill the columns of the linear part (light, step, slope), the brightness, and the slopes of D by the six values.

    ``rows`` (11, n).
    """
    for i in range(window.shape[1]):
        dx, dy = window[0, i] - found[0], window[1, i] - found[1]
        inside, along_x, along_y, rows[8, i] = disc_point(dx, dy, shape)
        rows[0, i], rows[1, i], rows[2, i], rows[3, i] = 1.0, inside, dx * (1.0 - inside), dy * (1.0 - inside)
        rows[4, i] = window[2, i]
        rows[5, i], rows[6, i], rows[7, i] = -along_x, -along_y, -(dx * along_x + dy * along_y) / found[2]
        rows[9, i], rows[10, i] = -(dx * along_x - dy * along_y), -(dy * along_x + dx * along_y)


def _is_sane(trial: Floats, now: Floats, start: Floats, radius_px: float) -> bool:
    """Return whether values may still be those of the dot at the start."""
    return bool(
        np.isfinite(trial).all()
        and math.hypot(trial[0] - start[0], trial[1] - start[1]) < 1.5 * radius_px + 2.0
        and 0.4 * radius_px < trial[2] < 2.0 * radius_px
        and _SHARPEST_PX <= trial[3] < 0.6 * max(now[2], 3.0)
        and math.hypot(trial[4], trial[5]) < MOST_STRETCH
    )
