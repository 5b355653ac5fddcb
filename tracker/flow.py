"""Lucas–Kanade from the predicted positions, in small cut-outs, against rendered templates."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from tracker.linear import STILL, View
from tracker.template import DotTemplate

REACH_PX: Final = 8
"""How far a marker may lie from its predicted position to be found by the flow alone."""
_SMEAR_PX: Final = 2.0
"""Changes of a template's look that matter to the flow, which only has to lead close."""
_STOP: Final = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 12, 0.02)


class TileFlow:
    """Finds markers near their predicted positions.

    One strip of tiles holds the templates, another the cut-outs of the picture; one call of the pyramidal
    Lucas–Kanade tracker then serves all markers. Template gradients outside the dots are zero, so what the stick lies
    on does not matter.
    """

    def __init__(self, templates: Sequence[DotTemplate], lights: Sequence[float]) -> None:
        self._templates = tuple(templates)
        window = math.ceil(max(template.window_px for template in templates))
        self._half = window + REACH_PX + 1
        self._side = 2 * self._half + 1
        count = len(self._templates)
        self._wanted = np.zeros((self._side, self._side * count), np.uint8)
        self._seen = np.zeros_like(self._wanted)
        self._lights = [0.0] * count
        self._views: list[View] = [STILL] * count
        self._looks: list[list[float]] = [[] for _ in self._templates]
        self._origin = [(self._side * index + self._half, self._half) for index in range(count)]
        self._centres = np.array(self._origin, dtype=np.float32).reshape(-1, 1, 2)
        self._window = (2 * window + 1, 2 * window + 1)
        self.reach_px = float(REACH_PX)
        for index, light in enumerate(lights):
            self._render(index, light, STILL)

    def expect(self, index: int, *, light: float, view: View) -> None:
        """Render a marker's template anew where its light or view has changed enough to matter."""
        old, seen = self._lights[index], self._views[index]
        smeared = abs(view.smear_x_px - seen.smear_x_px) + abs(view.smear_y_px - seen.smear_y_px) > _SMEAR_PX
        if abs(light - old) < 0.15 * old and not smeared:
            return
        self._render(index, light, view)

    def to_state(self) -> list[tuple[float, list[float], list[float]]]:
        """Return what :meth:`restore` needs to look for the markers in the same way."""
        views = [list(view) for view in self._views]
        return list(zip(self._lights, views, self._looks, strict=True))

    def restore(self, state: Sequence[tuple[float, list[float], list[float]]]) -> None:
        """Go back to a noted state; the templates have to be restored before."""
        for index, (light, view, look) in enumerate(state):
            # A template may have followed its dot's shape since its tile was rendered.
            template = self._templates[index]
            now = template.to_state()
            template.restore(look)
            self._render(index, float(light), View(*(float(value) for value in view)))
            template.restore(now)

    def _render(self, index: int, light: float, view: View) -> None:
        self._lights[index], self._views[index] = light, view
        self._looks[index] = self._templates[index].to_state()
        columns = slice(self._side * index, self._side * (index + 1))
        self._wanted[:, columns] = self._templates[index].tile(self._half, light=light, view=view)

    def find(
        self, luma: NDArray[np.uint8], predicted_px: Sequence[tuple[float, float]], *, levels: int = 0
    ) -> list[tuple[float, float]]:
        """Return the positions to which the flow leads from the predicted ones (not judged)."""
        corners: list[tuple[int, int]] = []
        start = np.empty_like(self._centres)
        for index, (x, y) in enumerate(predicted_px):
            cx, cy = math.floor(x + 0.5), math.floor(y + 0.5)
            columns = slice(self._side * index, self._side * (index + 1))
            self._seen[:, columns] = cut_out(luma, cx, cy, self._half)
            ox, oy = self._origin[index]
            corners.append((cx - ox, cy - oy))
            start[index, 0, 0] = ox + x - cx
            start[index, 0, 1] = oy + y - cy
        found, _, _ = cv2.calcOpticalFlowPyrLK(
            self._wanted,
            self._seen,
            self._centres,
            start,
            winSize=self._window,
            maxLevel=levels,
            criteria=_STOP,
            flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
            minEigThreshold=1e-6,
        )
        positions = np.asarray(found, dtype=np.float64).reshape(-1, 2).tolist()
        return [(p[0] + c[0], p[1] + c[1]) for p, c in zip(positions, corners, strict=True)]


def cut_out(luma: NDArray[np.uint8], cx: int, cy: int, half: int) -> NDArray[np.uint8]:
    """Return the square around a pixel; outside the picture its border is repeated."""
    height, width = luma.shape
    if half <= cx < width - half and half <= cy < height - half:
        return luma[cy - half : cy + half + 1, cx - half : cx + half + 1]
    rows = np.clip(np.arange(cy - half, cy + half + 1), 0, height - 1)
    columns = np.clip(np.arange(cx - half, cx + half + 1), 0, width - 1)
    return luma[np.ix_(rows, columns)]
