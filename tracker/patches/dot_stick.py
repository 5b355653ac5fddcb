"""A stick with two dots beside one with a tag or texture: no dot can be taken for one of the other stick's."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tracker.follow.follower import DotState
from tracker.follow.marker import Marker


class DotStick:
    """Reads a stick's two dots.

    Parameters
    ----------
    markers : two Marker
        Inner and outer one.
    still : bool
        True for the base, whose direction does not change.
    """

    def __init__(self, markers: Sequence[Marker], *, still: bool) -> None:
        self._state = DotState(markers, still=still)

    @property
    def radius_px(self) -> float:
        """Mean radius of the dots."""
        return float(self._state.scene.markers["first_radius"].mean())

    @property
    def length_px(self) -> float:
        """Distance of both dots."""
        return float(self._state.scene.sticks["length"][0])

    @property
    def shutter_share(self) -> float:
        """Share of a frame's time for which the shutter is open."""
        return float(self._state.scene.rig["shutter_share"][0])

    def step(self, luma: NDArray[np.uint8], time_s: float) -> NDArray[np.void]:
        """Return what is read of both markers in the next frame."""
        return self._state.follow(luma, time_s)

    def miss(self, time_s: float) -> None:
        """Pass over a frame that shows nothing."""
        self._state.skip(time_s)

    def to_state(self) -> dict[str, Any]:
        """Return what :meth:`restore` needs."""
        return {"dots": self._state.to_state()}

    def restore(self, state: dict[str, Any]) -> None:
        """Go back to a noted state, exactly."""
        self._state.restore(state["dots"])
