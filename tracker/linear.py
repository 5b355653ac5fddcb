"""One linear least-squares step that reads a marker's position out of a picture.

For a position known to a fraction of a pixel the model is linear in all that is unknown: light, contrast, the
remaining offset, and small changes of shape.

Uneven light shifts a dot (a slope of 0.1 grey levels per pixel by 0.005 px), but a free slope in every frame costs a
third of the precision, since it looks like an offset. So slopes are measured and averaged over frames, and taken as
known.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

_SECTORS: Final = 8


class View(NamedTuple):
    """How a marker is expected to look just now.

    Attributes
    ----------
    turn_rad : float
        Turn of its stick since the first frame, in the picture (y down).
    smear_x_px, smear_y_px : float
        Its path during the exposure.
    slope_x, slope_y : float
        Relative change of the light per pixel.
    """

    turn_rad: float = 0.0
    smear_x_px: float = 0.0
    smear_y_px: float = 0.0
    slope_x: float = 0.0
    slope_y: float = 0.0


STILL: Final = View()
Change = tuple[float, float, float]
SAME: Final[Change] = (0.0, 0.0, 0.0)


@dataclass(slots=True)
class Reading:
    """A marker as read in one picture.

    Attributes
    ----------
    x_px, y_px : float
        Position.
    xx_px2, xy_px2, yy_px2 : float
        Covariance for white noise of the size of ``residual``.
    light : float
        Brightness around the dot (mean brightness for texture), grey levels.
    contrast : float
        Brightness step of the dot relative to the template's (gain for texture); 1 is as expected.
    step : float
        Size of the brightness step, grey levels.
    residual : float
        Root mean square of what the model leaves, grey levels.
    patch : float
        Largest mean over a sector of the window of what the model leaves, grey levels: something lies over it.
    change : (float, float, float)
        How the shape differs from the template's: radius, px, and both terms of stretch; zeros for texture.
    slope : (float, float)
        Slope of the light as seen in this frame alone.
    converged : bool
        Whether the last step was small.
    """

    x_px: float
    y_px: float
    xx_px2: float
    xy_px2: float
    yy_px2: float
    light: float
    contrast: float
    step: float
    residual: float
    patch: float
    change: Change
    slope: tuple[float, float]
    converged: bool


@dataclass(slots=True)
class LinearModel:
    """Linear least squares in one window, for one sub-pixel position.

    Columns: one, the dot, its offsets in x and y, changes of its shape; then the slopes of the light. Changes of
    shape are even where offsets are odd, so they cost no precision.
    """

    inverse: NDArray[np.float64]
    basis: NDArray[np.float64]
    slopes: NDArray[np.float64]
    slope_inverse: NDArray[np.float64]
    slope_effect: NDArray[np.float64]
    covariance: NDArray[np.float64]
    sectors: NDArray[np.float64]
    freedom: int
    shaped: bool


def linear_model(
    basis: NDArray[np.float64], slopes: NDArray[np.float64], window: Window, *, shaped: bool
) -> LinearModel:
    """Return the least-squares inverses of a basis (n, k) with the slopes (n, 2) given and free.

    ``shaped``: columns 4 to 6 are changes of radius and stretch.
    """
    covariance = _inverse(basis.T @ basis)
    inverse = covariance @ basis.T
    both = np.concatenate([basis, slopes], axis=1)
    return LinearModel(
        inverse=inverse,
        basis=basis,
        slopes=slopes,
        slope_inverse=(_inverse(both.T @ both) @ both.T)[-2:],
        slope_effect=inverse @ slopes,
        covariance=covariance[2:4, 2:4],
        sectors=window.sectors,
        freedom=max(1, basis.shape[0] - basis.shape[1]),
        shaped=shaped,
    )


def _inverse(normal: NDArray[np.float64]) -> NDArray[np.float64]:
    scale = np.sqrt(np.diag(normal)) + 1e-12
    square = np.outer(scale, scale)
    return np.asarray(np.linalg.inv(normal / square + 1e-9 * np.eye(len(scale))) / square)


class Window:
    """Pixels in a disc around the middle of a square patch."""

    def __init__(self, radius_px: float) -> None:
        self.half = math.ceil(radius_px)
        y, x = np.mgrid[-self.half : self.half + 1, -self.half : self.half + 1].astype(np.float64)
        chosen = np.hypot(x, y) <= radius_px
        self.index = np.flatnonzero(chosen)
        self.x = x[chosen]
        self.y = y[chosen]
        sector = ((np.arctan2(self.y, self.x) / (2.0 * np.pi) % 1.0) * _SECTORS).astype(np.int64)
        means = np.zeros((_SECTORS, len(self.x)))
        means[sector, np.arange(len(self.x))] = 1.0
        self.sectors = means / means.sum(axis=1, keepdims=True)

    def values(self, luma: NDArray[np.uint8], cx: int, cy: int) -> NDArray[np.float64] | None:
        """Return the pixels around (cx, cy), or None where the patch leaves the picture."""
        half = self.half
        height, width = luma.shape
        if cx < half or cy < half or cx + half >= width or cy + half >= height:
            return None
        patch = luma[cy - half : cy + half + 1, cx - half : cx + half + 1]
        return patch.ravel()[self.index].astype(np.float64)


def solve(
    model: LinearModel,
    values: NDArray[np.float64],
    *,
    x0: float,
    y0: float,
    contrast: float,
    slope: tuple[float, float],
) -> Reading:
    """Return the reading of one window by one linear step."""
    found = model.inverse @ values
    scale = max(float(found[0]), 1.0)
    tilted = np.array(slope) * scale
    found -= model.slope_effect @ tilted
    left = values - model.basis @ found - model.slopes @ tilted
    seen = model.slope_inverse @ values
    light, step = float(found[0]), float(found[1])
    size = step if abs(step) > 1e-3 else math.copysign(1e-3, step)
    dx, dy = float(found[2]) / size, float(found[3]) / size
    variance = float(left @ left) / model.freedom
    spread = variance / (size * size)
    return Reading(
        x_px=x0 + dx,
        y_px=y0 + dy,
        xx_px2=spread * float(model.covariance[0, 0]),
        xy_px2=spread * float(model.covariance[0, 1]),
        yy_px2=spread * float(model.covariance[1, 1]),
        light=light,
        contrast=step / (light * contrast) if light > 1.0 else 0.0,
        step=step,
        residual=math.sqrt(variance),
        patch=float(np.abs(model.sectors @ left).max()),
        change=(float(found[4]) / size, float(found[5]) / size, float(found[6]) / size) if model.shaped else SAME,
        slope=(float(seen[0]) / scale, float(seen[1]) / scale),
        converged=abs(dx) < 0.2 and abs(dy) < 0.2,
    )
