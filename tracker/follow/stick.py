"""What reads a stick frame by frame, whatever is on it."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from tracker.appearance.lucas_kanade import READING

Point = tuple[float, float]


class Stick(Protocol):
    """Reads both markers of one stick, or all four of two, frame by frame."""

    drawn: bool
    """Whether its template is drawn: what a smeared picture leaves of it is no noise then."""

    def step(self, luma: NDArray[np.uint8], time_s: float, shift: NDArray[np.float64]) -> NDArray[np.void]:
        """Return what is read of its markers in the next frame (n,), records of READING with their states.

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


def nothing(state: int, *, markers: int = 2) -> NDArray[np.void]:
    """Return readings that are not taken, and why."""
    readings = np.zeros(markers, READING)
    readings["state"] = state
    return readings
