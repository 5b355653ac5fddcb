"""What a marker looks like, and one linear least-squares step that reads its position out of a picture.

A template is rendered, never taken from the last frame, so it cannot drift. For a position known to a fraction of a pixel
the model is linear in all that is unknown: light, contrast, the remaining offset, and a little growth; the pseudo-inverse is
made once for every eighth of a pixel and kept. A second step follows where the offset was large.

Uneven light shifts a dot (a slope of 0.1 grey levels per pixel by 0.005 px), but a free slope in every frame costs a
third of the precision, since it looks like an offset. So slopes are measured and averaged over frames, and taken as known.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from tracker.dot import DotShape, disc_and_slopes

_PHASES: Final = 8
"""Steps per pixel at which linear models are kept; half a step off, the cubic term is below 1e-4 px."""
_SECTORS: Final = 8
_CHANGE_PX: Final = 0.15
"""Change of a rim's place from which a template is rendered anew."""
_KEPT: Final = 1024
"""Linear models kept per marker, some 20 kB each."""


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


@dataclass(slots=True)
class LinearModel:
    """Linear least squares in one window, for one sub-pixel position.

    Columns: one, the dot, its offsets in x and y, changes of its shape; then the slopes of the light. Changes of shape are
    even where offsets are odd, so they cost no precision.
    """

    inverse: NDArray[np.float64]
    basis: NDArray[np.float64]
    slopes: NDArray[np.float64]
    slope_inverse: NDArray[np.float64]
    slope_effect: NDArray[np.float64]
    covariance: NDArray[np.float64]
    sectors: NDArray[np.float64]
    freedom: int


def linear_model(basis: NDArray[np.float64], slopes: NDArray[np.float64], sectors: NDArray[np.float64]) -> LinearModel:
    """Return the least-squares inverses of a basis (n, k) with the slopes (n, 2) given and free."""
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
        sectors=sectors,
        freedom=max(1, basis.shape[0] - basis.shape[1]),
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


class DotTemplate:
    """A round dot, rendered from its fitted shape."""

    def __init__(self, shape: DotShape) -> None:
        self.shape = self.first = shape
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

    def _model(self, phase_x: int, phase_y: int, view: View) -> tuple[Window, LinearModel]:
        # Smear in whole pixels: half a pixel more or less changes the ends of a smear of several pixels, evenly.
        smear_x, smear_y = round(view.smear_x_px), round(view.smear_y_px)
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
            model = self._models[key] = self._make(window, key)
        return window, model

    def _make(self, window: Window, key: tuple[int, int, int, int]) -> LinearModel:
        phase_x, phase_y, smear_x, smear_y = key
        x, y = window.x - phase_x / _PHASES, window.y - phase_y / _PHASES
        inside, along_x, along_y = self._disc(self.shape, x, y, smear_x, smear_y)
        # To first order a change of radius or stretch moves the rim outwards by c · (u · grad): no further rendering.
        radial = -(x * along_x + y * along_y) / self.shape.radius_px
        across = -(x * along_x - y * along_y)
        diagonal = -(y * along_x + x * along_y)
        lit = 1.0 + self.shape.contrast * inside
        basis = np.stack([np.ones_like(x), inside, -along_x, -along_y, radial, across, diagonal], axis=1)
        return linear_model(basis, np.stack([window.x * lit, window.y * lit], axis=1), window.sectors)


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
        change=(float(found[4]) / size, float(found[5]) / size, float(found[6]) / size) if len(found) > 5 else SAME,
        slope=(float(seen[0]) / scale, float(seen[1]) / scale),
        converged=abs(dx) < 0.2 and abs(dy) < 0.2,
    )
