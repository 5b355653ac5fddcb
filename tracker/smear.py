"""How long the shutter is open: fast markers leave a smear, from which it is learned."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from tracker.marker import Marker, Point
from tracker.sight import Sight
from tracker.template import DotTemplate

_SHARES: Final = (0.0, 0.15, 0.3, 0.45, 0.6, 0.75, 0.9, 1.05)
"""Shares of the frame interval that are tried."""
_RATE: Final = 0.15
_UNKNOWN: Final = 0.1
_KNOWN: Final = 0.015
_LEARNED: Final = 12
"""Fast readings after which the shutter counts as known."""
_SHARP_PX: Final = 1.5
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

    def sharp(self, step: Point) -> bool:
        """Return whether a marker that moves by ``step`` per frame is known to be sharp enough to show its shape."""
        length = math.hypot(*step)
        return length < _SHARP_PX or (self._count >= _LEARNED and self.share * length < _SHARP_PX)

    def slack(self, step: Point) -> float:
        """Return by which share of the brightness step a fit may be worse than at rest.

        While the shutter is not known yet, a sharp template meets smears of up to the whole step: measured over radii
        of 3 to 15 px their residual stays below a tenth of the brightness step times the root of the length.
        """
        length = math.hypot(*step)
        if length < 0.5:
            return 0.0
        return (_UNKNOWN if self._count < _LEARNED else _KNOWN) * math.sqrt(length)

    def learn(self, marker: Marker, sight: Sight, index: int, step: Point) -> None:
        """Compare how well smears of several lengths fit a fast marker's picture."""
        self._count += 1
        reading = sight.good(index)
        if (
            reading is None
            or not isinstance(marker.template, DotTemplate)
            or (self._count > _LEARNED and self._count % _EVERY)
        ):
            return
        costs: list[float] = []
        for share in _SHARES:
            misfit = marker.template.misfit(sight.luma, reading.x_px, reading.y_px, path=step, share=share)
            if misfit is None:
                return
            costs.append(math.log(misfit + 1e-3))
        # Short smears hardly differ: they say less.
        base = min(costs)
        weight = _RATE if math.hypot(*step) > 4.0 else 0.5 * _RATE
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
