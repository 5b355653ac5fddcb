"""What a marker looks like: a round dot, rendered from its fitted shape.

A template is rendered, never taken from the last frame, so it cannot drift.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tracker.compiled import FIELDS, PHASES, read_dot, smear_misfits
from tracker.dot import DotShape
from tracker.linear import STILL, Change, Reading, View
from tracker.render import COLUMNS, DEPTH, smeared_disc, window_pixels
from tracker.rules import CHANGE_PX, MOST_STRETCH

Floats = NDArray[np.float64]


class DotTemplate:
    """A round dot, rendered from its fitted shape; see :mod:`tracker.compiled` for how it is read."""

    def __init__(self, shape: DotShape, *, strip_px: float = math.inf) -> None:
        self.first = shape
        self.strip_px = strip_px
        self.window_px = shape.window_px
        self.pixels = window_pixels(shape.window_px)
        self.packed = np.empty(7)
        self.models = np.empty((PHASES * PHASES, 2 * COLUMNS + 4, self.pixels.shape[1]))
        self.extras = np.zeros((PHASES * PHASES, 2 * COLUMNS + 4))
        self._set(shape)

    @property
    def shape(self) -> DotShape:
        """The shape as it is now."""
        radius, edge, e, f, depth, _, window = self.packed.tolist()
        return DotShape(radius_px=radius, edge_px=edge, stretch=(e, f), contrast=depth, window_px=window)

    def _set(self, shape: DotShape) -> None:
        self.packed[:] = (
            shape.radius_px, shape.edge_px, *shape.stretch, shape.contrast, self.strip_px, shape.window_px,
        )  # fmt: skip
        self.extras[:, -1] = 0.0

    def tile(self, half: int, *, light: float, view: View) -> NDArray[np.uint8]:
        """Return the dot's picture, centred in a square of side 2 · half + 1."""
        inside = smeared_disc(self.packed, half, view.smear_x_px, view.smear_y_px)
        picture = light * (1.0 + self.packed[DEPTH] * inside)
        return np.asarray(np.clip(np.rint(picture), 0, 255), dtype=np.uint8)

    def read(self, luma: NDArray[np.uint8], x_px: float, y_px: float, *, view: View = STILL) -> Reading | None:
        """Read the dot near a position; None where the window leaves the picture."""
        out = np.empty(FIELDS)
        seen = np.array(view)
        inside = read_dot(luma, x_px, y_px, self.pixels, self.packed, self.models, self.extras, seen, out)
        return reading_of(out) if inside else None

    def reshape(self, change: Change) -> bool:
        """Follow a change of the shape once it is large enough to matter; return whether it was."""
        shape = self.shape
        radius = shape.radius_px + change[0]
        if max(abs(change[0]), abs(change[1]) * radius, abs(change[2]) * radius) < CHANGE_PX:
            return False
        stretch = (shape.stretch[0] + change[1], shape.stretch[1] + change[2])
        if 0.7 < radius / self.first.radius_px < 1.4 and math.hypot(*stretch) <= MOST_STRETCH:
            self._set(replace(shape, radius_px=radius, stretch=stretch))
        return True

    def to_state(self) -> list[float]:
        """Return what :meth:`restore` needs to look the same again."""
        shape = self.shape
        return [shape.radius_px, *shape.stretch]

    def restore(self, state: list[float]) -> None:
        """Go back to a noted state."""
        radius, e, f = state
        self._set(replace(self.first, radius_px=radius, stretch=(e, f)))

    def misfits(
        self, luma: NDArray[np.uint8], x_px: float, y_px: float, *, path: tuple[float, float], shares: Floats
    ) -> list[float] | None:
        """Return the residual over the step for smears along several shares of a path; None where it is not told."""
        out = np.empty(len(shares))
        told = smear_misfits(luma, x_px, y_px, self.packed, path[0], path[1], shares, out)
        return out.tolist() if told else None


def reading_of(out: Floats) -> Reading:
    """Return a packed reading as an object."""
    x, y, xx, xy, yy, light, contrast, step, residual, patch, grew, e, f, sx, sy, converged = out.tolist()
    return Reading(
        x, y, xx, xy, yy, light, contrast, step, residual, patch, (grew, e, f), (sx, sy), converged=converged > 0.0
    )
