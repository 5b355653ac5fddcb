"""The picture of a round dot on a stick, and its least-squares fit.

Model, in a window around the dot: light · (1 + k · D), where D falls from 1 inside the dot to 0 outside over an edge of
width ``edge_px``, and the light is a plane: it is uneven. A dark dot has k < 0, a light one k > 0. Circles look like
ellipses from aside, so the shape carries two terms of anisotropy. Only a disc-shaped window that ends short of the
stick's own edges is fitted.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from tracker.appearance.disc import SHAPE, disc_at

EDGE_PX: Final = 0.5
"""Edge width at the start of a fit: standard deviation of the blur of a good lens."""
_SHARPEST_PX: Final = 0.12
"""Least edge: below it the mean over a pixel, which is taken apart, hides all of the blur."""
_NUDGE_PX: Final = 0.02
"""Change of the edge by which its slope is taken: a difference, since the edge has no closed form over a pixel."""
_ROUNDS: Final = 15
"""Steps of Levenberg and Marquardt at most."""
_LOOK: Final = 3
_DOUBTFUL: Final = 0.3
_HOPELESS: Final = 0.55
"""A start that explains less than the first share is not looked at; a fit that explains less than the second after a
few rounds is not of a dot."""


@dataclass(frozen=True, slots=True)
class DotShape:
    """Shape of one dot, which does not change while it moves.

    Attributes
    ----------
    radius_px : float
        Radius of the circle of the same area.
    edge_px : float
        Standard deviation of the blur of its edge.
    stretch : (float, float)
        Anisotropy: relative lengthening along x (and shortening along y), and along the diagonal.
    contrast : float
        Brightness inside over brightness outside, less 1; negative for a dark dot.
    window_px : float
        Radius of the window in which it is compared.
    """

    radius_px: float
    edge_px: float
    stretch: tuple[float, float]
    contrast: float
    window_px: float


@dataclass(frozen=True, slots=True)
class DotFit:
    """A dot fitted in one picture.

    Attributes
    ----------
    x_px, y_px : float
        Centre.
    shape : DotShape
        Its shape.
    light : float
        Brightness of the stick around it, grey levels.
    residual : float
        Root mean square of what the fit leaves, grey levels.
    explained : float
        Share of the window's variance that the fit explains.
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
    """Fit position, shape, contrast and light of the dot near a position.

    Parameters
    ----------
    luma : (h, w) uint8
        Picture.
    x_px, y_px, radius_px : float
        Where to start.
    light_dot : bool
        Whether the dot is lighter than the stick.
    room_px : float
        Distance from the dot's centre to the stick's edge, which the window must not pass.
    ellipse : bool
        Fit the anisotropy too.

    Returns
    -------
    DotFit or None
        None where the fit runs away, or the window leaves the picture.
    """
    start = np.array([x_px, y_px, radius_px, max(EDGE_PX, 0.05 * radius_px), 0.0, 0.0])
    # First with a wide window, which holds the rim even where the start is off; then with the right one.
    wide = min(1.25 * radius_px + 1.5, max(room_px, radius_px + 1.5))
    window = _window(luma, start, wide)
    found = None if window is None else _minimise(window, start, free=4, radius_px=radius_px)
    for _ in range(2):
        if found is None:
            return None
        parameters = found[0]
        window = _window(luma, parameters, window_for(parameters[2], parameters[3], room_px))
        found = None if window is None else _minimise(window, parameters, free=6 if ellipse else 4, radius_px=radius_px)
    if found is None:
        return None
    parameters, solved = found
    return _result(parameters, solved, 1.0 if light_dot else -1.0, window_for(parameters[2], parameters[3], room_px))


def _minimise(
    window: _Window, start: NDArray[np.float64], *, free: int, radius_px: float
) -> tuple[NDArray[np.float64], _Solved] | None:
    """Fit the first ``free`` parameters in one window by Levenberg and Marquardt; None where it is hopeless."""
    parameters, best, damping = start.copy(), _solve(window, start, free), 1e-3
    if best.explained < _DOUBTFUL:
        return None
    for round_number in range(_ROUNDS):
        if round_number == _LOOK and best.explained < _HOPELESS:
            return None
        normal = best.jacobian.T @ best.jacobian
        gradient = best.jacobian.T @ best.residual_vector
        delta = np.linalg.solve(normal + damping * np.diag(np.diag(normal) + 1e-9), gradient)
        trial = parameters.copy()
        trial[:free] += np.clip(delta, -0.3 * radius_px, 0.3 * radius_px)
        trial[3] = max(trial[3], _SHARPEST_PX)
        other = _solve(window, trial, free) if _sane(trial, parameters, start, radius_px) else None
        if other is None or other.mean_square > best.mean_square * (1.0 + 1e-9):
            damping = max(damping, 1e-4) * 10.0
            if damping > 1e4:
                break
            continue
        gain = 1.0 - other.mean_square / max(best.mean_square, 1e-12)
        parameters, best, damping = trial, other, max(damping * 0.2, 1e-9)
        if gain < 1e-5 or np.max(np.abs(delta)) < 1e-4:
            break
    return parameters, best


@dataclass(slots=True)
class _Window:
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    value: NDArray[np.float64]


@dataclass(slots=True)
class _Solved:
    residual_vector: NDArray[np.float64]
    jacobian: NDArray[np.float64]
    mean_square: float
    light: float
    step: float
    explained: float


def _window(luma: NDArray[np.uint8], parameters: NDArray[np.float64], radius_px: float) -> _Window | None:
    cx, cy = round(float(parameters[0])), round(float(parameters[1]))
    half = int(np.ceil(radius_px))
    height, width = luma.shape
    if cx - half < 0 or cy - half < 0 or cx + half >= width or cy + half >= height:
        return None
    y, x = np.mgrid[cy - half : cy + half + 1, cx - half : cx + half + 1]
    inside = (x - parameters[0]) ** 2 + (y - parameters[1]) ** 2 <= radius_px**2
    patch = luma[cy - half : cy + half + 1, cx - half : cx + half + 1]
    return _Window(x[inside].astype(np.float64), y[inside].astype(np.float64), patch[inside].astype(np.float64))


def _solve(window: _Window, parameters: NDArray[np.float64], free: int) -> _Solved:
    """Solve the linear part (light, contrast, slope) for a given shape, and return the slopes of the rest.

    The slopes are freed of what the linear part can make up for (variable projection).
    """
    dx, dy = window.x - parameters[0], window.y - parameters[1]
    radius, edge = float(parameters[2]), float(parameters[3])
    stretch = (float(parameters[4]), float(parameters[5]))
    shape = np.zeros(1, SHAPE)
    shape["radius"], shape["edge"], shape["stretch"] = radius, edge, stretch
    inside, along_x, along_y = disc_at(dx, dy, shape[0])
    shape["edge"] += _NUDGE_PX
    softer = (disc_at(dx, dy, shape[0])[0] - inside) / _NUDGE_PX
    basis = np.stack([np.ones_like(dx), inside, dx * (1.0 - inside), dy * (1.0 - inside)], axis=1)
    inverse = np.linalg.inv(basis.T @ basis + 1e-9 * np.eye(4)) @ basis.T
    linear = inverse @ window.value
    residual = window.value - basis @ linear
    radial = -(dx * along_x + dy * along_y) / radius
    across, diagonal = -(dx * along_x - dy * along_y), -(dy * along_x + dx * along_y)
    slopes = np.stack([-along_x, -along_y, radial, softer, across, diagonal][:free], axis=1) * linear[1]
    mean_square = float(residual @ residual) / len(residual)
    spread = float(np.var(window.value))
    return _Solved(
        residual_vector=residual,
        jacobian=slopes - basis @ (inverse @ slopes),
        mean_square=mean_square,
        light=float(linear[0]),
        step=float(linear[1]),
        explained=1.0 - mean_square / max(spread, 1e-12),
    )


def _sane(trial: NDArray[np.float64], now: NDArray[np.float64], start: NDArray[np.float64], radius_px: float) -> bool:
    return bool(
        np.all(np.isfinite(trial))
        and np.hypot(trial[0] - start[0], trial[1] - start[1]) < 1.5 * radius_px + 2.0
        and 0.4 * radius_px < trial[2] < 2.0 * radius_px
        and _SHARPEST_PX <= trial[3] < 0.6 * max(now[2], 3.0)
        and np.hypot(trial[4], trial[5]) < 0.45
    )


def _result(parameters: NDArray[np.float64], solved: _Solved, sign: float, window_px: float) -> DotFit | None:
    if solved.light <= 0 or solved.step * sign <= 0:
        return None
    shape = DotShape(
        radius_px=float(parameters[2]),
        edge_px=float(parameters[3]),
        stretch=(float(parameters[4]), float(parameters[5])),
        contrast=solved.step / max(solved.light, 1.0),
        window_px=window_px,
    )
    return DotFit(
        x_px=float(parameters[0]),
        y_px=float(parameters[1]),
        shape=shape,
        light=solved.light,
        residual=float(np.sqrt(solved.mean_square)),
        explained=solved.explained,
    )
