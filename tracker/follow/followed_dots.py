"""The dots of one stick or of two, frame by frame, and their state."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from torsight.core.units import Floats
from tracker.appearance.lucas_kanade import READING, Point
from tracker.appearance.motion_blur import share_limits
from tracker.checkpoint import Kept
from tracker.follow.frame_step import DONE, START, advance
from tracker.follow.learning import skip
from tracker.follow.marker import Marker
from tracker.follow.redetect import direction, place_of, redetect
from tracker.follow.rotation_axis import learn_axis, suppose_axis
from tracker.follow.state import Scene, state_type


class DotState(Kept):
    """State of the dots of one stick or of two, as one record; a single stick may be ``still``, the base."""

    drawn = False
    kept = ("_all",)

    def __init__(self, markers: Sequence[Marker], *, still: bool = False) -> None:
        self._all = np.zeros((), state_type(len(markers) // 2))
        for index, marker in enumerate(markers):
            self._all["markers"][index] = marker.record[0]
        readings = np.zeros(len(markers), READING)
        self.scene = Scene(self._all["markers"], self._all["sticks"], self._all["rig"], readings, ()).with_looks()
        self.scene.rig["moving"] = -1
        for stick, own in enumerate(self.scene.sticks):
            own["length"] = own["shortest"] = own["longest"] = math.dist(*self.ends(stick))
            own["size"], own["start_rad"], own["still"] = 1.0, direction(*self.ends(stick)), still
            own["axis"]["last_rad"] = math.nan
        if len(self.scene.sticks) > 1:
            for stick in (0, 1):
                own = self.scene.sticks[stick]["axis"]
                suppose_axis(own, self.ends(1 - stick), self.ends(stick), self.radius_px)
                learn_axis(own, *self.ends(stick))

    def ends(self, stick: int) -> tuple[Point, Point]:
        """Return the positions of both markers of a stick, px."""
        one, two = (place_of(marker) for marker in self.scene.markers[2 * stick : 2 * stick + 2])
        return one, two

    @property
    def radius_px(self) -> float:
        """Median radius of the dots at the start, px."""
        return float(np.median(self.scene.markers["first_radius"]))

    window_px = 0.0

    @property
    def half_px(self) -> float:
        """Half the width of the stick, px, which is at least that of its markers."""
        return self.radius_px

    @property
    def length_px(self) -> float:
        """Median distance between a stick's dots, px."""
        return float(np.median(self.scene.sticks["length"]))

    @property
    def shutter(self) -> tuple[float | None, tuple[float, float]]:
        """Exposure as a share of the frame interval, None where no motion blur is certain, and its bounds."""
        exposure = self.scene.rig[0]["exposure"]
        return min(float(exposure["share"]), 1.0) or None, share_limits(exposure["misfit"])

    @property
    def starts_rad(self) -> list[float]:
        """Direction of each stick at the start, y down."""
        return [float(own["start_rad"]) for own in self.scene.sticks]

    def name_moving(self, moving: int) -> None:
        """Set which of two sticks moves; the other is the base, at the position where it was last seen."""
        if len(self.scene.sticks) == 1:
            return
        scene = self.scene
        one, two = (_seen_last(marker) for marker in scene.markers[2 - 2 * moving : 4 - 2 * moving])
        ends = (one, two)
        rig, base = scene.rig[0], scene.sticks[1 - moving]
        rig["moving"], rig["zero"], rig["last"], rig["off"] = moving, ends, ends, 0.0
        base["still"], base["start_rad"] = True, direction(*ends)
        suppose_axis(scene.sticks[moving]["axis"], ends, self.ends(moving), self.radius_px)

    def step(self, luma: NDArray[np.uint8], time_s: float, shift: Floats) -> NDArray[np.void]:
        """Follow the markers into the next frame and return their readings, which the next frame overwrites.

        ``shift`` is not used: the axis of a stick that is followed alone moves with the picture.
        """
        del shift
        stage = advance(self.scene, luma, time_s, START)
        while stage != DONE:
            self.scene = redetect(self.scene, luma, stage)
            stage = advance(self.scene, luma, time_s, stage)
        return self.scene.readings

    def miss(self, time_s: float) -> None:
        """Skip a frame without a usable picture."""
        skip(self.scene, time_s)

    def restore(self, state: Mapping[str, Any]) -> None:
        """Restore a saved state exactly; the object has to be made from the same first frame."""
        # The scene's arrays are views of ``_all``, which therefore has to stay the same object.
        known = self._all
        super().restore(state)
        known[...], self._all = self._all, known
        self.scene = self.scene.with_looks()


def _seen_last(marker: np.void) -> Point:
    """Return a marker's last reading, without the picture's shift; the position of a lost marker is extrapolated."""
    last = marker["history"][marker["count"] - 1] if marker["count"] else [0.0, marker["x"], marker["y"]]
    return float(last[1]), float(last[2])
