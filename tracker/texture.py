"""A point without a dot: the texture around it in the first frame is its template, turned with the stick."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from tracker.linear import SAME, STILL, Change, LinearModel, Reading, View, Window, linear_model, solve

_ROUNDS: Final = 6
_TURN_STEP_RAD: Final = 1e-3


class TextureTemplate:
    """The stored texture around a point.

    It is kept as a cubic spline, so that it can be turned and shifted without losing sharpness; light and contrast are
    free in every frame. Since it always is the first frame's texture it cannot drift.

    Parameters
    ----------
    luma : (h, w) uint8
        First frame.
    x_px, y_px : float
        The point.
    window_px : float
        Radius of the window.
    """

    def __init__(self, luma: NDArray[np.uint8], x_px: float, y_px: float, *, window_px: float) -> None:
        from scipy import ndimage

        self.window_px = window_px
        self.turns = True
        self._map = ndimage.map_coordinates
        margin = math.ceil(1.5 * window_px) + 6
        height, width = luma.shape
        self._left, self._top = max(0, round(x_px) - margin), max(0, round(y_px) - margin)
        right, bottom = min(width, round(x_px) + margin + 1), min(height, round(y_px) + margin + 1)
        part = luma[self._top : bottom, self._left : right].astype(np.float64)
        self._spline = ndimage.spline_filter(part, order=3, mode="nearest")
        self._x, self._y = x_px - self._left, y_px - self._top
        self._window = Window(window_px)
        middle = self._sample(self._window.x, self._window.y, turn_rad=0.0)
        self.light = float(middle.mean())
        self.spread = float(middle.std())

    def tile(self, half: int, *, light: float, view: View) -> NDArray[np.uint8]:
        """Return the turned texture in a disc on its mean brightness."""
        y, x = np.mgrid[-half : half + 1, -half : half + 1].astype(np.float64)
        picture = self._sample(x.ravel(), y.ravel(), turn_rad=view.turn_rad).reshape(x.shape)
        weight = np.clip(self.window_px + 1.0 - np.hypot(x, y), 0.0, 1.0)
        picture = light + (picture * light / max(self.light, 1.0) - light) * weight
        return np.asarray(np.clip(np.rint(picture), 0, 255), dtype=np.uint8)

    def read(self, luma: NDArray[np.uint8], x_px: float, y_px: float, *, view: View = STILL) -> Reading | None:
        """Read the point near a position; None where the window leaves the picture."""
        reading = None
        for _ in range(_ROUNDS):
            cx, cy = round(x_px), round(y_px)
            values = self._window.values(luma, cx, cy)
            if values is None:
                return None
            model = self._model(x_px - cx, y_px - cy, view.turn_rad)
            reading = solve(model, values, x0=x_px, y0=y_px, contrast=1.0, slope=(view.slope_x, view.slope_y))
            reading.contrast = reading.step
            reading.step *= self.spread
            dx, dy = reading.x_px - x_px, reading.y_px - y_px
            if not math.isfinite(dx) or math.hypot(dx, dy) > self.window_px:
                reading.converged = False
                return reading
            x_px, y_px = reading.x_px, reading.y_px
            if abs(dx) < 0.01 and abs(dy) < 0.01:
                break
        return reading

    def reshape(self, change: Change) -> bool:
        """Keep the texture as it is."""
        return change != SAME

    def to_state(self) -> list[float]:
        """Return nothing: texture does not change."""
        return []

    def restore(self, state: list[float]) -> None:
        """Go back to a noted state."""

    def _sample(self, x: NDArray[np.float64], y: NDArray[np.float64], *, turn_rad: float) -> NDArray[np.float64]:
        """Return the texture at offsets from the point in a picture in which it is turned (y down)."""
        cos, sin = math.cos(turn_rad), math.sin(turn_rad)
        at = np.stack([self._y - sin * x + cos * y, self._x + cos * x + sin * y])
        return np.asarray(self._map(self._spline, at, order=3, prefilter=False, mode="nearest"), dtype=np.float64)

    def _model(self, dx: float, dy: float, turn_rad: float) -> LinearModel:
        x, y, h = self._window.x - dx, self._window.y - dy, 0.25
        middle = self._sample(x, y, turn_rad=turn_rad)
        along_x = self._sample(x - h, y, turn_rad=turn_rad) - self._sample(x + h, y, turn_rad=turn_rad)
        along_y = self._sample(x, y - h, turn_rad=turn_rad) - self._sample(x, y + h, turn_rad=turn_rad)
        turned = (
            self._sample(x, y, turn_rad=turn_rad + _TURN_STEP_RAD)
            - self._sample(x, y, turn_rad=turn_rad - _TURN_STEP_RAD)
        ) / (2.0 * _TURN_STEP_RAD)
        one = np.ones_like(x)
        basis = np.stack([one, middle - self.light, along_x / (2.0 * h), along_y / (2.0 * h), turned], axis=1)
        slopes = np.stack([self._window.x, self._window.y], axis=1)
        return linear_model(basis, slopes, self._window, shaped=False)
