"""What a marker looks like, and one linear least-squares step that reads its position out of a picture.

A template is rendered, never taken from the last frame, so it cannot drift. For a position known to a fraction of a pixel
the model is linear in all that is unknown: light, its slope, contrast, and the remaining offset; the pseudo-inverse is
made once for every eighth of a pixel and kept. A second step follows where the offset was large.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from tracker.dot import DotShape, disc

_PHASES: Final = 8
"""Steps per pixel at which linear models are kept; half a step off, the cubic term is below 1e-4 px."""
_SECTORS: Final = 8
_KEPT: Final = 1024
"""Linear models kept per marker, some 20 kB each."""

Pose = tuple[float, float, float]
"""Turn of the stick since the first frame, rad, and smear of the marker during the exposure (x and y), px."""
AT_REST: Final[Pose] = (0.0, 0.0, 0.0)


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
    converged: bool


class Template(Protocol):
    """How one marker looks."""

    window_px: float

    def tile(self, half: int, *, light: float, pose: Pose) -> NDArray[np.uint8]:
        """Return the marker's picture, centred in a square of side 2 · half + 1."""

    def read(self, luma: NDArray[np.uint8], x_px: float, y_px: float, *, pose: Pose) -> Reading | None:
        """Read the marker near a position; None where the window leaves the picture."""


@dataclass(slots=True)
class LinearModel:
    """Linear least squares in one window, for one sub-pixel position."""

    inverse: NDArray[np.float64]
    basis: NDArray[np.float64]
    covariance: NDArray[np.float64]
    sectors: NDArray[np.float64]
    freedom: int


def linear_model(basis: NDArray[np.float64], sectors: NDArray[np.float64]) -> LinearModel:
    """Return the least-squares inverse of a basis (n, k), whose columns 2 and 3 are the offsets in x and y."""
    normal = basis.T @ basis
    scale = np.sqrt(np.diag(normal)) + 1e-12
    covariance = np.linalg.inv(normal / np.outer(scale, scale) + 1e-9 * np.eye(len(scale)))
    covariance /= np.outer(scale, scale)
    return LinearModel(
        inverse=covariance @ basis.T,
        basis=basis,
        covariance=covariance[2:4, 2:4],
        sectors=sectors,
        freedom=max(1, basis.shape[0] - basis.shape[1]),
    )


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


class DotTemplate:
    """A round dot, rendered from its fitted shape."""

    def __init__(self, shape: DotShape) -> None:
        self.shape = shape
        self.window_px = shape.window_px
        self._windows: dict[int, Window] = {}
        self._models: dict[tuple[int, int, int, int], LinearModel] = {}

    def tile(self, half: int, *, light: float, pose: Pose) -> NDArray[np.uint8]:
        """Return the dot's picture, centred in a square of side 2 · half + 1."""
        y, x = np.mgrid[-half : half + 1, -half : half + 1].astype(np.float64)
        inside = self._disc(x, y, pose[1], pose[2])
        picture = light * (1.0 + self.shape.contrast * inside)
        return np.clip(np.rint(picture), 0, 255).astype(np.uint8)

    def read(self, luma: NDArray[np.uint8], x_px: float, y_px: float, *, pose: Pose = AT_REST) -> Reading | None:
        """Read the dot near a position; None where the window leaves the picture."""
        reading = None
        for _ in range(3):
            phase_x, phase_y = round(x_px * _PHASES), round(y_px * _PHASES)
            cx, cy = (phase_x + _PHASES // 2) // _PHASES, (phase_y + _PHASES // 2) // _PHASES
            window, model = self._model(phase_x - cx * _PHASES, phase_y - cy * _PHASES, pose)
            values = window.values(luma, cx, cy)
            if values is None:
                return None
            reading = solve(model, values, x0=phase_x / _PHASES, y0=phase_y / _PHASES, contrast=self.shape.contrast)
            if reading.converged or not math.isfinite(reading.x_px):
                return reading
            limit = 0.5 * self.shape.radius_px
            x_px += min(max(reading.x_px - x_px, -limit), limit)
            y_px += min(max(reading.y_px - y_px, -limit), limit)
        return reading

    def _disc(
        self, x: NDArray[np.float64], y: NDArray[np.float64], smear_x: float, smear_y: float
    ) -> NDArray[np.float64]:
        shape = self.shape
        options = {"radius_px": shape.radius_px, "edge_px": shape.edge_px, "stretch": shape.stretch}
        length = math.hypot(smear_x, smear_y)
        if length < 0.5:
            return disc(x, y, **options)
        count = max(3, math.ceil(length / max(1.0, shape.edge_px)))
        shifts = (np.arange(count) + 0.5) / count - 0.5
        return sum(disc(x - s * smear_x, y - s * smear_y, **options) for s in shifts) / count

    def _model(self, phase_x: int, phase_y: int, pose: Pose) -> tuple[Window, LinearModel]:
        # Smear in whole pixels: half a pixel more or less changes the ends of a smear of several pixels, evenly.
        smear_x, smear_y = round(pose[1]), round(pose[2])
        if smear_x * smear_x + smear_y * smear_y < 4:
            smear_x = smear_y = 0
        longest = math.ceil(0.5 * math.hypot(smear_x, smear_y))
        window = self._windows.get(longest)
        if window is None:
            window = self._windows[longest] = Window(self.window_px + longest)
        key = (phase_x, phase_y, smear_x, smear_y)
        model = self._models.get(key)
        if model is None:
            if len(self._models) >= _KEPT:
                self._models.clear()
            model = self._models[key] = self._make(window, phase_x, phase_y, smear_x, smear_y)
        return window, model

    def _make(self, window: Window, phase_x: int, phase_y: int, smear_x: int, smear_y: int) -> LinearModel:
        x, y = window.x - phase_x / _PHASES, window.y - phase_y / _PHASES
        h = 0.05
        inside = self._disc(x, y, smear_x, smear_y)
        along_x = (self._disc(x - h, y, smear_x, smear_y) - self._disc(x + h, y, smear_x, smear_y)) / (2.0 * h)
        along_y = (self._disc(x, y - h, smear_x, smear_y) - self._disc(x, y + h, smear_x, smear_y)) / (2.0 * h)
        lit = 1.0 + self.shape.contrast * inside
        basis = np.stack([np.ones_like(x), inside, along_x, along_y, window.x * lit, window.y * lit], axis=1)
        return linear_model(basis, window.sectors)


def solve(model: LinearModel, values: NDArray[np.float64], *, x0: float, y0: float, contrast: float) -> Reading:
    """Return the reading of one window by one linear step."""
    found = model.inverse @ values
    left = values - model.basis @ found
    light, step = float(found[0]), float(found[1])
    scale = step if abs(step) > 1e-3 else math.copysign(1e-3, step)
    dx, dy = float(found[2]) / scale, float(found[3]) / scale
    variance = float(left @ left) / model.freedom
    spread = variance / (scale * scale)
    return Reading(
        x_px=x0 + dx,
        y_px=y0 + dy,
        xx_px2=spread * model.covariance[0, 0],
        xy_px2=spread * model.covariance[0, 1],
        yy_px2=spread * model.covariance[1, 1],
        light=light,
        contrast=step / (light * contrast) if light > 1.0 else 0.0,
        step=step,
        residual=math.sqrt(variance),
        patch=float(np.abs(model.sectors @ left).max()),
        converged=abs(dx) < 0.2 and abs(dy) < 0.2,
    )
