"""What one frame shows of the four markers, while it is being judged."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracker.linear import Reading
from tracker.rows import CODE, ROW

Point = tuple[float, float]


@dataclass(slots=True)
class Sight:
    """One frame.

    Attributes
    ----------
    time_s : float
        Its time.
    luma : (h, w) uint8
        Its picture.
    predicted : list of Point
        Where the four markers were expected.
    readings : list of Reading or None
        What was read.
    reasons : list of str
        Why a reading is not taken (see :data:`tracker.rows.STATES`); empty where it is.
    """

    time_s: float
    luma: NDArray[np.uint8]
    predicted: list[Point]
    readings: list[Reading | None]
    reasons: list[str]

    def good(self, index: int) -> Reading | None:
        """Return a marker's reading where it is taken."""
        return None if self.reasons[index] else self.readings[index]

    def take(self, index: int, reading: Reading) -> None:
        """Take a reading."""
        self.readings[index], self.reasons[index] = reading, ""

    def place(self, index: int) -> Point:
        """Return where a marker is, or is expected where it was not read."""
        reading = self.good(index)
        return self.predicted[index] if reading is None else (reading.x_px, reading.y_px)

    def row(self) -> NDArray[np.void]:
        """Return what is noted of the frame."""
        return make_row(self.time_s, [self.good(i) for i in range(4)], self.reasons)


def make_row(time_s: float, readings: Sequence[Reading | None], reasons: Sequence[str]) -> NDArray[np.void]:
    """Return the row of a frame."""
    row = np.zeros((), ROW)
    row["time_s"] = time_s
    row["state"] = [CODE[reason or "seen"] for reason in reasons]
    row["position_px"] = [(r.x_px, r.y_px) if r else _NOWHERE[:2] for r in readings]
    row["covariance_px2"] = [(r.xx_px2, r.xy_px2, r.yy_px2) if r else _NOWHERE for r in readings]
    row["light"] = [r.light if r else 0.0 for r in readings]
    row["step"] = [r.step if r else 0.0 for r in readings]
    row["residual"] = [r.residual if r else 0.0 for r in readings]
    return row


_NOWHERE = (math.nan, math.nan, math.nan)


def direction(a: Point, b: Point) -> float:
    """Return the direction from a to b in the picture (y down)."""
    return math.atan2(b[1] - a[1], b[0] - a[0])


def between(a: float, b: float) -> float:
    """Return the size of the angle between two directions."""
    return abs(math.remainder(a - b, math.tau))


def distance_to_strip(point: Point, ends: tuple[Point, Point], *, beyond: float) -> float:
    """Return the distance of a point from a stick's line, drawn out by a share of its length on both sides."""
    (ax, ay), (bx, by) = ends
    ux, uy = bx - ax, by - ay
    along = ((point[0] - ax) * ux + (point[1] - ay) * uy) / max(ux * ux + uy * uy, 1e-9)
    along = min(max(along, -beyond), 1.0 + beyond)
    return math.hypot(point[0] - ax - along * ux, point[1] - ay - along * uy)
