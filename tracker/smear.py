"""How long the shutter is open: fast markers leave a smear, from which it is learned."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from tracker.marker import Marker, Point
from tracker.rules import SHARP_PX, SLACK_KNOWN, SLACK_UNKNOWN

_SHARES: Final = (0.0, 0.15, 0.3, 0.45, 0.6, 0.75, 0.9, 1.05)
"""Shares of the frame interval that are tried."""
_TRIED: Final = np.array(_SHARES)
_RATE: Final = 0.15
_CLEAR: Final = 0.15
"""By how much (of the logarithm of the residual) a smear has to fit better than none: compression softens moving dots,
and that looks a little like a smear."""
_LEARNED: Final = 12
"""Fast readings after which the shutter counts as known."""
_SELDOM: Final = 200
"""Once the shutter is known only every so many fast readings are looked at: each costs as much as several frames."""


class Shutter:
    """Share of the frame interval during which the shutter is open."""

    def __init__(self) -> None:
        self.share = 0.0
        self._cost = [0.0] * len(_SHARES)
        self.count = 0

    def smear(self, step: Point) -> Point:
        """Return the smear of a marker that moves by ``step`` per frame."""
        return self.share * step[0], self.share * step[1]

    def sharp(self, step: Point) -> bool:
        """Return whether a marker that moves by ``step`` per frame is known to be sharp enough to show its shape."""
        length = math.hypot(*step)
        return length < SHARP_PX or (self.known and self.share * length < SHARP_PX)

    def slack(self, step: Point) -> float:
        """Return by which share of the brightness step a fit may be worse than at rest.

        While the shutter is not known yet, a sharp template meets smears of up to the whole step: measured over radii
        of 3 to 15 px their residual stays below a tenth of the brightness step times the root of the length.
        """
        length = math.hypot(*step)
        if length < 0.5:
            return 0.0
        return (SLACK_UNKNOWN if not self.known else SLACK_KNOWN) * math.sqrt(length)

    @property
    def known(self) -> bool:
        """Whether enough fast readings have been seen."""
        return self.count >= _LEARNED

    def learn(self, marker: Marker, luma: NDArray[np.uint8], place: Point, step: Point) -> None:
        """Take in a fast marker; every now and then look at it."""
        self.count += 1
        if self.count % self.every == 0:
            self.look(marker, luma, place, step)

    def look(self, marker: Marker, luma: NDArray[np.uint8], place: Point, step: Point) -> None:
        """Compare how well smears of several lengths fit a fast marker's picture."""
        misfits = marker.template.misfits(luma, *place, path=step, shares=_TRIED)
        if misfits is None:
            return
        costs = [math.log(misfit + 1e-3) for misfit in misfits]
        # Short smears hardly differ: they say less.
        base = min(costs)
        weight = _RATE if math.hypot(*step) > 4.0 else 0.5 * _RATE
        self._cost = [was + weight * (min(cost - base, 2.0) - was) for was, cost in zip(self._cost, costs, strict=True)]
        self.share = self._best()

    @property
    def every(self) -> int:
        """Return how often to look: often at first, for a shutter seldom changes."""
        if self.count <= 2 * _LEARNED:
            return 1
        return 4 if self.count <= 8 * _LEARNED else _SELDOM

    def _best(self) -> float:
        """Return the share of least cost, between the ones that were tried."""
        at = int(np.argmin(self._cost))
        if self._cost[0] - self._cost[at] < _CLEAR:
            return 0.0
        if at in (0, len(_SHARES) - 1):
            return _SHARES[at]
        a, b, c = self._cost[at - 1 : at + 2]
        bend = a - 2.0 * b + c
        off = 0.0 if bend <= 1e-9 else 0.5 * (a - c) / bend
        return _SHARES[at] + max(-0.5, min(0.5, off)) * (_SHARES[1] - _SHARES[0])

    def to_state(self) -> dict[str, Any]:
        """Return what :meth:`restore` needs."""
        return {"share": self.share, "cost": list(self._cost), "count": self.count}

    def restore(self, state: dict[str, Any]) -> None:
        """Go back to a noted state."""
        self.share = float(state["share"])
        self._cost = [float(value) for value in state["cost"]]
        self.count = int(state["count"])
