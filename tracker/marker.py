"""One marker while it is followed: where it was, where it should be next, how it should look."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, Final

from tracker.gauge import Gauge
from tracker.template import AT_REST, Pose, Template

Point = tuple[float, float]

_KEPT: Final = 3
_STALE: Final = 12
"""Frames for which a lost marker is still carried on along its last motion."""


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
        The last readings, at most three, the newest last; empty after a long loss.
    lost : int
        Frames since it was last read.
    pose : Pose
        Turn and smear with which it is expected.
    """

    template: Template
    gauge: Gauge
    radius_px: float
    x_px: float
    y_px: float
    history: list[tuple[float, float, float]] = field(default_factory=list)
    lost: int = 0
    pose: Pose = AT_REST

    def predict(self, time_s: float) -> Point:
        """Return where its own last motion carries it."""
        past = self.history
        if self.lost > _STALE or len(past) < 2:
            return self.x_px, self.y_px
        t1, x1, y1 = past[-1]
        t2, x2, y2 = past[-2]
        s = (time_s - t1) / (t1 - t2)
        if len(past) < 3 or self.lost:
            return x1 + s * (x1 - x2), y1 + s * (y1 - y2)
        t3, x3, y3 = past[-3]
        # Lagrange's parabola through the last three readings, whatever their spacing.
        a = (time_s - t2) * (time_s - t3) / ((t1 - t2) * (t1 - t3))
        b = (time_s - t1) * (time_s - t3) / ((t2 - t1) * (t2 - t3))
        c = (time_s - t1) * (time_s - t2) / ((t3 - t1) * (t3 - t2))
        return a * x1 + b * x2 + c * x3, a * y1 + b * y2 + c * y3

    def velocity(self) -> Point:
        """Return its last velocity, px/s."""
        if len(self.history) < 2:
            return 0.0, 0.0
        t1, x1, y1 = self.history[-1]
        t2, x2, y2 = self.history[-2]
        return (x1 - x2) / (t1 - t2), (y1 - y2) / (t1 - t2)

    def take(self, time_s: float, x_px: float, y_px: float) -> None:
        """Note a reading."""
        if self.lost:
            # Only readings next to each other tell a velocity.
            self.history = self.history[-1:] if self.lost <= _STALE else []
        self.history.append((time_s, x_px, y_px))
        del self.history[:-_KEPT]
        self.x_px, self.y_px = x_px, y_px
        self.lost = 0

    def miss(self, x_px: float, y_px: float) -> None:
        """Note that it was not read, and where it is taken to be."""
        self.x_px, self.y_px = x_px, y_px
        self.lost += 1
        if self.lost > _STALE:
            self.history = []

    def distance(self, x_px: float, y_px: float) -> float:
        """Return the distance of a place from where it is."""
        return math.hypot(x_px - self.x_px, y_px - self.y_px)

    def to_state(self) -> dict[str, Any]:
        """Return what :meth:`restore` needs; the template is made anew from its shape."""
        return {
            "gauge": self.gauge.to_state(),
            "x_px": self.x_px,
            "y_px": self.y_px,
            "history": [list(entry) for entry in self.history],
            "lost": self.lost,
            "pose": list(self.pose),
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Go back to a noted state, exactly."""
        self.gauge = Gauge.from_state(state["gauge"])
        self.x_px, self.y_px = float(state["x_px"]), float(state["y_px"])
        self.history = [(float(t), float(x), float(y)) for t, x, y in state["history"]]
        self.lost = int(state["lost"])
        turn, smear_x, smear_y = state["pose"]
        self.pose = (float(turn), float(smear_x), float(smear_y))
