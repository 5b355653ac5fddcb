"""What a marker looks like: a round dot, rendered from its fitted shape.

A template is rendered, never taken from the last frame, so it cannot drift. Linear models are made once for every
eighth of a pixel and kept; a second step follows where the offset was large.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from tracker.dot import DotShape, disc_and_slopes
from tracker.linear import STILL, Change, LinearModel, Reading, View, Window, linear_model, solve

_PHASES: Final = 8
"""Steps per pixel at which linear models are kept; half a step off, the cubic term is below 1e-4 px."""
_CHANGE_PX: Final = 0.15
"""Change of a rim's place from which a template is rendered anew."""
_KEPT: Final = 1024
"""Linear models kept per marker, some 20 kB each."""


class Template(Protocol):
    """How one marker looks."""

    window_px: float
    turns: bool

    def tile(self, half: int, *, light: float, view: View) -> NDArray[np.uint8]:
        """Return the marker's picture, centred in a square of side 2 · half + 1."""

    def read(self, luma: NDArray[np.uint8], x_px: float, y_px: float, *, view: View = STILL) -> Reading | None:
        """Read the marker near a position; None where the window leaves the picture."""

    def reshape(self, change: Change) -> bool:
        """Follow a change of the shape; return whether it was taken."""

    def to_state(self) -> list[float]:
        """Return what :meth:`restore` needs to look the same again."""

    def restore(self, state: list[float]) -> None:
        """Go back to a noted state."""


class DotTemplate:
    """A round dot, rendered from its fitted shape."""

    def __init__(self, shape: DotShape, *, strip_px: float = math.inf) -> None:
        self.shape = self.first = shape
        self.strip_px = strip_px
        self.window_px = shape.window_px
        self.turns = False
        self._windows: dict[int, Window] = {}
        self._models: dict[tuple[int, int, int, int], LinearModel] = {}

    def tile(self, half: int, *, light: float, view: View) -> NDArray[np.uint8]:
        """Return the dot's picture, centred in a square of side 2 · half + 1."""
        y, x = np.mgrid[-half : half + 1, -half : half + 1].astype(np.float64)
        inside = self._disc(self.shape, x, y, view.smear_x_px, view.smear_y_px)[0]
        picture = light * (1.0 + self.shape.contrast * inside)
        return np.clip(np.rint(picture), 0, 255).astype(np.uint8)

    def read(self, luma: NDArray[np.uint8], x_px: float, y_px: float, *, view: View = STILL) -> Reading | None:
        """Read the dot near a position; None where the window leaves the picture."""
        reading = None
        for _ in range(3):
            phase_x, phase_y = round(x_px * _PHASES), round(y_px * _PHASES)
            cx, cy = (phase_x + _PHASES // 2) // _PHASES, (phase_y + _PHASES // 2) // _PHASES
            window, model = self._model(phase_x - cx * _PHASES, phase_y - cy * _PHASES, view)
            values = window.values(luma, cx, cy)
            if values is None:
                return None
            reading = solve(
                model,
                values,
                x0=phase_x / _PHASES,
                y0=phase_y / _PHASES,
                contrast=self.shape.contrast,
                slope=(view.slope_x, view.slope_y),
            )
            if reading.converged or not math.isfinite(reading.x_px):
                return reading
            limit = 0.5 * self.shape.radius_px
            x_px += min(max(reading.x_px - x_px, -limit), limit)
            y_px += min(max(reading.y_px - y_px, -limit), limit)
        return reading

    def reshape(self, change: Change) -> bool:
        """Follow a change of the shape once it is large enough to matter; return whether it was."""
        shape = self.shape
        radius = shape.radius_px + change[0]
        if max(abs(change[0]), abs(change[1]) * radius, abs(change[2]) * radius) < _CHANGE_PX:
            return False
        stretch = (shape.stretch[0] + change[1], shape.stretch[1] + change[2])
        if not 0.7 < radius / self.first.radius_px < 1.4 or math.hypot(*stretch) > 0.45:
            return True
        self.shape = replace(shape, radius_px=radius, stretch=stretch)
        self._models.clear()
        return True

    def to_state(self) -> list[float]:
        """Return what :meth:`restore` needs to look the same again."""
        return [self.shape.radius_px, *self.shape.stretch]

    def restore(self, state: list[float]) -> None:
        """Go back to a noted state."""
        radius, e, f = state
        self.shape = replace(self.first, radius_px=radius, stretch=(e, f))
        self._models.clear()

    def _disc(
        self, shape: DotShape, x: NDArray[np.float64], y: NDArray[np.float64], smear_x: float, smear_y: float
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return D and its slopes, smeared along a line."""
        length = math.hypot(smear_x, smear_y)
        count = 1 if length < 0.5 else max(3, math.ceil(length / max(1.0, shape.edge_px)))
        parts = [
            disc_and_slopes(
                x - share * smear_x,
                y - share * smear_y,
                radius_px=shape.radius_px,
                edge_px=shape.edge_px,
                stretch=shape.stretch,
            )
            for share in ((np.arange(count) + 0.5) / count - 0.5)
        ]
        if count == 1:
            return parts[0]
        inside, along_x, along_y = (np.mean([part[i] for part in parts], axis=0) for i in range(3))
        return inside, along_x, along_y

    def _beside(self, across: NDArray[np.float64], length: float) -> list[NDArray[np.float64]]:
        """Return what lies beside the stick, left and right: with a smear across the stick it gets into the window."""
        columns: list[NDArray[np.float64]] = []
        for side in (1.0, -1.0):
            # A step that is smeared is a ramp as long as the smear.
            ramp = np.clip((side * across - self.strip_px) / length + 0.5, 0.0, 1.0)
            if ramp.max() > 0.05:
                columns.append(ramp)
        return columns

    def misfit(
        self, luma: NDArray[np.uint8], x_px: float, y_px: float, *, path: tuple[float, float], share: float
    ) -> float | None:
        """Return the residual over the step for a smear along a share of a path.

        Window and columns are the same for all shares, and the shape is taken as known: a stretched dot looks much
        like a short smear.
        """
        length = math.hypot(*path)
        window = self._window(math.ceil(0.5 * length))
        phase_x, phase_y = round(x_px * _PHASES), round(y_px * _PHASES)
        cx, cy = (phase_x + _PHASES // 2) // _PHASES, (phase_y + _PHASES // 2) // _PHASES
        values = window.values(luma, cx, cy)
        if values is None:
            return None
        x, y = window.x - x_px + cx, window.y - y_px + cy
        inside, along_x, along_y = self._disc(self.shape, x, y, share * path[0], share * path[1])
        columns = [np.ones_like(x), inside, -along_x, -along_y]
        columns += self._beside((x * path[0] + y * path[1]) / length, max(1.0, share * length))
        slopes = np.stack([window.x, window.y], axis=1)
        model = linear_model(np.stack(columns, axis=1), slopes, window, shaped=False)
        reading = solve(model, values, x0=x_px, y0=y_px, contrast=self.shape.contrast, slope=(0.0, 0.0))
        return reading.residual / abs(reading.step) if abs(reading.step) > 1.0 else None

    def _window(self, longest: int) -> Window:
        window = self._windows.get(longest)
        if window is None:
            window = self._windows[longest] = Window(self.window_px + longest)
        return window

    def _model(self, phase_x: int, phase_y: int, view: View) -> tuple[Window, LinearModel]:
        # Smear in whole pixels: half a pixel more or less changes the ends of a smear of several pixels, evenly.
        smear_x, smear_y = round(view.smear_x_px), round(view.smear_y_px)
        if smear_x * smear_x + smear_y * smear_y < 4:
            smear_x = smear_y = 0
        window = self._window(math.ceil(0.5 * math.hypot(smear_x, smear_y)))
        key = (phase_x, phase_y, smear_x, smear_y)
        model = self._models.get(key)
        if model is None:
            if len(self._models) >= _KEPT:
                self._models.clear()
            x, y = window.x - phase_x / _PHASES, window.y - phase_y / _PHASES
            model = self._models[key] = self._fit_for(window, x, y, (smear_x, smear_y))
        return window, model

    def _fit_for(
        self, window: Window, x: NDArray[np.float64], y: NDArray[np.float64], smear: tuple[float, float]
    ) -> LinearModel:
        """Return the linear model for offsets from the dot's centre."""
        smear_x, smear_y = smear
        inside, along_x, along_y = self._disc(self.shape, x, y, smear_x, smear_y)
        # To first order a change of radius or stretch moves the rim outwards by c · (u · grad): no further rendering.
        radial = -(x * along_x + y * along_y) / self.shape.radius_px
        across = -(x * along_x - y * along_y)
        diagonal = -(y * along_x + x * along_y)
        lit = 1.0 + self.shape.contrast * inside
        columns = [np.ones_like(x), inside, -along_x, -along_y, radial, across, diagonal]
        length = math.hypot(smear_x, smear_y)
        if length > 1.0:
            columns += self._beside((x * smear_x + y * smear_y) / length, length)
        basis = np.stack(columns, axis=1)
        slopes = np.stack([window.x * lit, window.y * lit], axis=1)
        return linear_model(basis, slopes, window, shaped=True)
