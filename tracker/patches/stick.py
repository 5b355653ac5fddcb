"""What reads a stick frame by frame, whatever is on it."""

from __future__ import annotations

from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from tracker.appearance.lucas_kanade import READING
from tracker.patches.align import Fit
from tracker.patches.warps import Floats
from tracker.rows import SEEN

Point = tuple[float, float]

KEPT: Final = 0.7
"""Least share of a patch that has to be seen: what lies over the rest is then outvoted by far."""


class Stick(Protocol):
    """Reads both markers of one stick, frame by frame."""

    def step(self, luma: NDArray[np.uint8], time_s: float, shift: Floats) -> NDArray[np.void]:
        """Return what is read of both markers in the next frame (2,), records of READING with their states.

        ``shift`` (2,) is that of the picture since the start, px, as the base told it last.
        """

    def miss(self, time_s: float) -> None:
        """Pass over a frame that shows nothing."""

    @property
    def radius_px(self) -> float:
        """Size of a marker."""

    @property
    def length_px(self) -> float:
        """Distance of both markers."""

    @property
    def shutter_share(self) -> float:
        """Share of a frame's time for which the shutter is open, where the markers tell it."""

    def to_state(self) -> dict[str, Any]:
        """Return what :meth:`restore` needs."""

    def restore(self, state: dict[str, Any]) -> None:
        """Go back to a noted state, exactly."""


def nothing(state: int) -> NDArray[np.void]:
    """Return two readings that are not taken, and why."""
    readings = np.zeros(2, READING)
    readings["state"] = state
    return readings


def put(readings: NDArray[np.void], index: int, fit: Fit, at: Point, covariance: Floats, *, spread: float) -> None:
    """Put a fit into readings as that of a point of its template."""
    own = readings[index]
    own["x"], own["y"] = at
    own["covariance"] = covariance[0, 0], covariance[0, 1], covariance[1, 1]
    own["light"], own["contrast"], own["step"] = fit.light, fit.gain, fit.gain * 2.0 * spread
    own["residual"], own["state"] = fit.residual, SEEN
