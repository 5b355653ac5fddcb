"""Where the moving stick's axis is and how its markers go around it, learned while it turns.

In the picture each marker of the moving stick is at p = c + R(ψ) q, with ψ the direction of the line through both
markers: linear in the axis c and the two arms q, so that sums over the frames so far are all that is kept. Tilt
makes circles into ellipses; for finding a marker again a few pixels do not matter.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from tracker.rules import AXIS_ENOUGH, AXIS_STEP_RAD

Point = tuple[float, float]

_PARTS: Final = 36
_PRIOR: Final = 0.05
"""Weight of the first guess of the axis, in frames."""


@dataclass(slots=True)
class Axis:
    """Sums of the linear least squares for the axis and both arms, in the picture of the unmoved camera.

    Attributes
    ----------
    normal, right : (6, 6), (6,) float64
        Normal equations of (c, q_inner, q_outer).
    last_rad : float
        Direction at which the last frame was added.
    seen : (36,) int64
        How many frames were taken in of each ten degrees.
    solution : (6,) float64 or None
        The present estimate; None while nothing is known.
    """

    normal: NDArray[np.float64] = field(default_factory=lambda: np.zeros((6, 6)))
    right: NDArray[np.float64] = field(default_factory=lambda: np.zeros(6))
    last_rad: float = math.nan
    seen: NDArray[np.int64] = field(default_factory=lambda: np.zeros(_PARTS, np.int64))
    solution: NDArray[np.float64] | None = None

    def suppose(self, centre: Point) -> None:
        """Take a first guess of the axis, which motion will soon outweigh."""
        for axis in range(2):
            self.normal[axis, axis] += _PRIOR
            self.right[axis] += _PRIOR * centre[axis]

    def add(self, inner: Point, outer: Point) -> bool:
        """Take in one frame with both markers, if it is of something new; return whether it was."""
        angle = math.atan2(outer[1] - inner[1], outer[0] - inner[0])
        if not math.isnan(self.last_rad) and abs(math.remainder(angle - self.last_rad, math.tau)) < AXIS_STEP_RAD:
            return False
        part = int((angle % math.tau) / math.tau * _PARTS) % _PARTS
        if self.seen[part] >= AXIS_ENOUGH:
            return False
        self.seen[part] += 1
        self.last_rad = angle
        cos, sin = math.cos(angle), math.sin(angle)
        for index, point in enumerate((inner, outer)):
            rows = np.zeros((2, 6))
            rows[0, 0] = rows[1, 1] = 1.0
            at = 2 + 2 * index
            rows[:, at : at + 2] = ((cos, -sin), (sin, cos))
            self.normal += rows.T @ rows
            self.right += rows.T @ np.array(point)
        self._solve()
        return True

    def _solve(self) -> None:
        values = np.linalg.eigvalsh(self.normal)
        self.solution = None
        if values[0] > 1e-4 * _PRIOR:
            self.solution = np.asarray(np.linalg.solve(self.normal, self.right), dtype=np.float64)

    @property
    def centre(self) -> Point | None:
        """The axis in the picture."""
        return None if self.solution is None else (float(self.solution[0]), float(self.solution[1]))

    def arm(self, *, outer: bool) -> float:
        """Distance of a marker from the axis."""
        if self.solution is None:
            return math.nan
        at = 4 if outer else 2
        return math.hypot(float(self.solution[at]), float(self.solution[at + 1]))

    def direction_from(self, point: Point, *, outer: bool) -> float | None:
        """Return the stick's direction when one of its markers is at ``point``; None while nothing is known."""
        if self.solution is None:
            return None
        at = 4 if outer else 2
        own = math.atan2(float(self.solution[at + 1]), float(self.solution[at]))
        return math.atan2(point[1] - float(self.solution[1]), point[0] - float(self.solution[0])) - own

    def place(self, direction_rad: float, *, outer: bool) -> Point | None:
        """Return where a marker is when the stick points in a direction; None while nothing is known."""
        if self.solution is None:
            return None
        at = 4 if outer else 2
        qx, qy = float(self.solution[at]), float(self.solution[at + 1])
        cos, sin = math.cos(direction_rad), math.sin(direction_rad)
        return (
            float(self.solution[0]) + cos * qx - sin * qy,
            float(self.solution[1]) + sin * qx + cos * qy,
        )

    def to_state(self) -> dict[str, Any]:
        """Return what :meth:`from_state` restores exactly."""
        return {
            "normal": self.normal.tolist(),
            "right": self.right.tolist(),
            "last_rad": None if math.isnan(self.last_rad) else self.last_rad,
            "seen": self.seen.tolist(),
        }

    @classmethod
    def from_state(cls, state: dict[str, Any]) -> Axis:
        """Restore an axis."""
        axis = cls(
            normal=np.array(state["normal"]),
            right=np.array(state["right"]),
            last_rad=math.nan if state["last_rad"] is None else float(state["last_rad"]),
            seen=np.array(state["seen"], np.int64),
        )
        if axis.normal.any():
            axis._solve()
        return axis
