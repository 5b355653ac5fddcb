"""How long the shutter is open: fast markers leave a smear, from which it is learned."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from tracker.marker import Marker, Point
from tracker.sight import Sight

_SHARES: Final = (0.0, 0.15, 0.3, 0.45, 0.6, 0.75, 0.9, 1.05)
"""Shares of the frame interval that are tried."""
_RATE: Final = 0.15
_EVERY: Final = 3
"""Only every so many fast readings are looked at: each costs as much as several readings."""


class Shutter:
    """Share of the frame interval during which the shutter is open."""

    def __init__(self) -> None:
        self.share = 0.0
        self._cost = [0.0] * len(_SHARES)
        self._count = 0

    def smear(self, step: Point) -> Point:
        """Return the smear of a marker that moves by ``step`` per frame."""
        return self.share * step[0], self.share * step[1]

    def learn(self, marker: Marker, sight: Sight, index: int, step: Point) -> None:
        """Compare how well smears of several lengths fit a fast marker's picture."""
        self._count += 1
        reading = sight.good(index)
        if reading is None or self._count % _EVERY:
            return
        lengths = [math.hypot(*step) * share for share in _SHARES]
        costs: list[float] = []
        for share in _SHARES:
            view = marker.view._replace(smear_x_px=share * step[0], smear_y_px=share * step[1])
            other = marker.template.read(sight.luma, reading.x_px, reading.y_px, view=view)
            if other is None or abs(other.step) < 1.0:
                return
            costs.append(math.log(other.residual / abs(other.step) + 1e-3))
        # A smear of less than two pixels looks like none: such lengths say nothing of each other.
        base = min(costs)
        weight = _RATE if max(lengths) > 4.0 else 0.5 * _RATE
        self._cost = [was + weight * (min(cost - base, 2.0) - was) for was, cost in zip(self._cost, costs, strict=True)]
        self.share = self._best()

    def _best(self) -> float:
        """Return the share of least cost, between the ones that were tried."""
        at = int(np.argmin(self._cost))
        if at in (0, len(_SHARES) - 1):
            return _SHARES[at]
        a, b, c = self._cost[at - 1 : at + 2]
        bend = a - 2.0 * b + c
        off = 0.0 if bend <= 1e-9 else 0.5 * (a - c) / bend
        return _SHARES[at] + max(-0.5, min(0.5, off)) * (_SHARES[1] - _SHARES[0])

    def to_state(self) -> dict[str, Any]:
        """Return what :meth:`restore` needs."""
        return {"share": self.share, "cost": list(self._cost), "count": self._count}

    def restore(self, state: dict[str, Any]) -> None:
        """Go back to a noted state."""
        self.share = float(state["share"])
        self._cost = [float(value) for value in state["cost"]]
        self._count = int(state["count"])
