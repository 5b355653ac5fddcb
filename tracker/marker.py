"""One marker while it is followed: where it was, where it should be next, how it should look."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tracker.gauge import Gauge
from tracker.linear import SAME, STILL, Change, Reading, View
from tracker.rules import KEPT, RATE, STALE
from tracker.template import DotTemplate

Point = tuple[float, float]


@dataclass(slots=True)
class Marker:
    """A marker's template, the account of its readings, and its last positions.

    Attributes
    ----------
    template, gauge, radius_px
        How it looks, how well it has fitted, how large it is.
    x_px, y_px : float
        Where it is, or where it is taken to be while it is not seen.
    history : list of (time_s, x, y)
        The last readings less the shift of the camera, the newest last; empty after a long loss.
    misses : list of float
        Running mean square errors of the predictions: at rest, steady, averaged, curved.
    lost : int
        Frames since it was last read.
    view : View
        How it is expected to look.
    change : Change
        How its shape differs from the template's, averaged over frames.
    """

    template: DotTemplate
    gauge: Gauge
    radius_px: float
    x_px: float
    y_px: float
    history: list[tuple[float, float, float]] = field(default_factory=list)
    misses: list[float] = field(default_factory=lambda: [1.0, 0.0, 1.0, 1.0])
    lost: int = 0
    view: View = STILL
    change: Change = SAME

    def read(self, luma: NDArray[np.uint8], x_px: float, y_px: float) -> Reading | None:
        """Read it near a position."""
        return self.template.read(luma, x_px, y_px, view=self.view)

    def predict(self, time_s: float) -> Point | None:
        """Return where its own last motion carries it, less the shift of the camera; None where nothing is known.

        Of several ways to predict the one is taken that did best lately: a smooth fast motion wants the curved one, a
        shaking camera the averaged one.
        """
        if not self.history or self.lost > STALE:
            return None
        if self.lost:
            return _ways(self.history, time_s)[1]
        return _ways(self.history, time_s)[self.misses.index(min(self.misses))]

    def take(self, time_s: float, reading: Reading, shift: Point, *, still: bool) -> None:
        """Note a good reading; of one that moves fast, and may be smeared, neither shape nor fit is learned."""
        if still:
            self.gauge.learn(reading)
            self._look(reading)
        else:
            self.gauge.learn_light(reading)
        x, y = reading.x_px - shift[0], reading.y_px - shift[1]
        if self.lost:
            # Only readings close to each other tell a velocity.
            self.history = self.history[-1:] if self.lost <= 3 else []
        elif len(self.history) == KEPT:
            for way, (px, py) in enumerate(_ways(self.history, time_s)):
                miss = (x - px) ** 2 + (y - py) ** 2
                self.misses[way] += RATE * (miss - self.misses[way])
        self.history.append((time_s, x, y))
        del self.history[:-KEPT]
        self.x_px, self.y_px = reading.x_px, reading.y_px
        self.lost = 0

    def _look(self, reading: Reading) -> None:
        old, view = self.change, self.view
        radius, e, f = (was + RATE * (now - was) for was, now in zip(old, reading.change, strict=True))
        self.change = SAME if self.template.reshape((radius, e, f)) else (radius, e, f)
        self.view = view._replace(
            slope_x=view.slope_x + RATE * (reading.slope[0] - view.slope_x),
            slope_y=view.slope_y + RATE * (reading.slope[1] - view.slope_y),
        )

    def miss(self, x_px: float, y_px: float) -> None:
        """Note that it was not read, and where it is taken to be."""
        self.x_px, self.y_px = x_px, y_px
        self.lost += 1
        if self.lost > STALE:
            self.history = []

    def distance(self, x_px: float, y_px: float) -> float:
        """Return the distance of a place from where it is."""
        return math.hypot(x_px - self.x_px, y_px - self.y_px)

    def to_state(self) -> dict[str, Any]:
        """Return what :meth:`restore` needs; the template itself is made anew from the first frame."""
        return {
            "gauge": self.gauge.to_state(),
            "x_px": self.x_px,
            "y_px": self.y_px,
            "history": [list(entry) for entry in self.history],
            "misses": list(self.misses),
            "lost": self.lost,
            "view": list(self.view),
            "change": list(self.change),
            "template": self.template.to_state(),
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Go back to a noted state, exactly."""
        self.gauge = Gauge.from_state(state["gauge"])
        self.x_px, self.y_px = float(state["x_px"]), float(state["y_px"])
        self.history = [(float(t), float(x), float(y)) for t, x, y in state["history"]]
        self.misses = [float(value) for value in state["misses"]]
        self.lost = int(state["lost"])
        self.view = View(*(float(value) for value in state["view"]))
        radius, e, f = state["change"]
        self.change = (float(radius), float(e), float(f))
        self.template.restore([float(value) for value in state["template"]])


def _ways(history: list[tuple[float, float, float]], time_s: float) -> tuple[Point, Point, Point, Point]:
    """Return the predictions from the last readings: at rest, steady, averaged over three steps, curved."""
    t1, x1, y1 = history[-1]
    rest = (x1, y1)
    if len(history) < 2:
        return rest, rest, rest, rest
    t2, x2, y2 = history[-2]
    s = (time_s - t1) / (t1 - t2)
    steady = (x1 + s * (x1 - x2), y1 + s * (y1 - y2))
    if len(history) < 3:
        return rest, steady, steady, steady
    t0, x0, y0 = history[0]
    s = (time_s - t1) / (t1 - t0)
    averaged = (x1 + s * (x1 - x0), y1 + s * (y1 - y0))
    t3, x3, y3 = history[-3]
    # Lagrange's parabola through the last three readings, whatever their spacing.
    a = (time_s - t2) * (time_s - t3) / ((t1 - t2) * (t1 - t3))
    b = (time_s - t1) * (time_s - t3) / ((t2 - t1) * (t2 - t3))
    c = (time_s - t1) * (time_s - t2) / ((t3 - t1) * (t3 - t2))
    return rest, steady, averaged, (a * x1 + b * x2 + c * x3, a * y1 + b * y2 + c * y3)
