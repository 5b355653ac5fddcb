"""What reads a stick frame by frame, whatever is on it."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from tracker.linear import SAME, Reading
from tracker.patches.align import Fit
from tracker.patches.warps import Floats

Point = tuple[float, float]
Seen = tuple[list[Reading | None], list[str]]
"""What was read of both markers, and why a reading is not taken (see :data:`tracker.rows.STATES`)."""


class Stick(Protocol):
    """Reads both markers of one stick, frame by frame."""

    def step(self, luma: NDArray[np.uint8], time_s: float) -> Seen:
        """Return what is read in the next frame."""

    def miss(self) -> None:
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


def reading_of(fit: Fit, at: Point, covariance: Floats, spread: float) -> Reading:
    """Return a fit as the reading of a point of its template."""
    return Reading(
        x_px=at[0],
        y_px=at[1],
        xx_px2=float(covariance[0, 0]),
        xy_px2=float(covariance[0, 1]),
        yy_px2=float(covariance[1, 1]),
        light=fit.light,
        contrast=fit.gain,
        step=fit.gain * 2.0 * spread,
        residual=fit.residual,
        patch=0.0,
        change=SAME,
        slope=(0.0, 0.0),
        converged=True,
    )
