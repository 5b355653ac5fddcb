"""One marker at the start of tracking: its record, and the cache for reading it."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from torsight.core.errors import NoResultError
from tracker.appearance.disc import COLUMNS
from tracker.appearance.dot_fit import Dot
from tracker.appearance.lucas_kanade import PHASES, READING, SYSTEM, read_dot, unused_look, zeros_on_demand
from tracker.detect.sticks import Stick, edges_beside, half_width
from tracker.follow.reading import Looks, share_of_step
from tracker.follow.state import MARKER


class Marker:
    """A round dot as fitted in the first picture.

    ``strip_px`` is half the width of the stick that carries the dot, ``edges_px`` the distances of its two edges.
    """

    def __init__(
        self, dot: Dot, *, strip_px: float = math.inf, edges_px: tuple[float, float] = (math.inf, math.inf)
    ) -> None:
        self.record = np.zeros(1, MARKER)
        own = self.record["shape"]
        own["radius"], own["edge"], own["stretch"] = dot.radius_px, dot.edge_px, dot.stretch
        own["contrast"], own["strip"], own["window"] = dot.contrast, strip_px, dot.window_px
        own["edges"] = edges_px
        self.record["first_radius"] = dot.radius_px
        self.look = unused_look(dot.window_px)

    def read(self, luma: NDArray[np.uint8], x_px: float, y_px: float) -> NDArray[np.void] | None:
        """Return the reading (READING) within the marker's radius of a position.

        None where the window leaves the picture, or the fit diverges: of texture it may end anywhere.
        """
        out = np.zeros(1, READING)
        inside = read_dot(luma, x_px, y_px, self.record[0], self.look, (0.0, 0.0), out[0])
        reading: NDArray[np.void] = out[0]
        off_px = math.hypot(reading["x"] - x_px, reading["y"] - y_px)
        return reading if inside and off_px < self.record["shape"]["radius"][0] else None

    def begin(self, reading: NDArray[np.void]) -> None:
        """Initialise the record with the first reading, which is known to be of the marker."""
        for name in ("x", "y", "light"):
            self.record[name] = reading[name]
        self.record["step"] = abs(reading["step"])
        # The mean deviation of the residual's logarithm, until it is learned: white noise over 100 pixels has 0.07, and
        # no noise is white.
        self.record["residual"] = share_of_step(float(reading["residual"]), float(reading["step"])), 0.15

    @property
    def x_px(self) -> float:
        """Position where the marker was found, to the right, px."""
        return float(self.record["x"][0])

    @property
    def y_px(self) -> float:
        """Position where the marker was found, down, px."""
        return float(self.record["y"][0])

    @property
    def radius_px(self) -> float:
        """Radius when the marker was found, px."""
        return float(self.record["first_radius"][0])


def looks_of(markers: Sequence[Marker]) -> Looks:
    """Return empty looks of many markers, which are read together."""
    count = [marker.look[0].shape[1] for marker in markers]
    slots, first = PHASES * PHASES, np.concatenate([[0], np.cumsum(count, dtype=np.int64)])
    pixels = np.concatenate([np.zeros(0, np.int64), *(marker.look[0].ravel() for marker in markers)])
    models = zeros_on_demand((slots * (COLUMNS + 2) * int(first[-1]),))
    return pixels, models, zeros_on_demand((len(markers), slots), SYSTEM), first


def markers_on(luma: NDArray[np.uint8], *sticks: Stick) -> list[Marker]:
    """Return both markers of each stick, read for the first time; :class:`NoResultError` for one at the border."""
    markers: list[Marker] = []
    for stick in sticks:
        strip_px = half_width(luma, stick)
        edges_px = edges_beside(luma, stick), edges_beside(luma, stick.turned())[::-1]
        for dot, edges in zip((stick.inner, stick.outer), edges_px, strict=True):
            markers.append(Marker(dot, strip_px=strip_px, edges_px=edges))
            reading = markers[-1].read(luma, dot.x_px, dot.y_px)
            if reading is None:
                raise NoResultError(
                    "a marker lies at the border of the picture",
                    value=f"[{dot.x_px:.0f}, {dot.y_px:.0f}]",
                    do="keep the sticks inside the picture",
                )
            markers[-1].begin(reading)
    return markers
