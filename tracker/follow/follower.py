"""Two sticks with dots through a film: the state of all that is known, frame by frame."""

from __future__ import annotations

import base64
import math
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from tracker.appearance.lucas_kanade import READING
from tracker.detect.sticks import crossing_point
from tracker.follow.frame_step import DONE, START, advance
from tracker.follow.learning import skip, write_row
from tracker.follow.marker import Marker
from tracker.follow.redetect import direction, place_of, redetect
from tracker.follow.rotation_axis import suppose_axis, turned
from tracker.follow.state import Scene, state_type
from tracker.frames.frame import Frame
from tracker.rows import DAMAGED, ROW

_MOVED_RAD: Final = math.radians(1.0)
"""A stick that turned by this much, and three times as much as the other, is the moving one."""


class DotState:
    """All that is known of the dots of one stick or of two, as one record; one alone may be ``still``."""

    def __init__(self, markers: Sequence[Marker], *, still: bool = False) -> None:
        self._all = np.zeros((), state_type(len(markers) // 2))
        # Always of four markers: a tuple of another length would be compiled anew.
        looks = (*(marker.look for marker in markers), *(markers[0].look,) * (4 - len(markers)))
        readings = np.zeros(len(markers), READING)
        self.scene = Scene(self._all["markers"], self._all["sticks"], self._all["rig"], readings, looks)
        for index, marker in enumerate(markers):
            self.scene.markers[index] = marker.record[0]
        self.scene.rig["moving"] = -1
        for stick, own in enumerate(self.scene.sticks):
            own["length"] = own["shortest"] = own["longest"] = math.dist(*self.ends(stick))
            own["start_rad"], own["still"] = direction(*self.ends(stick)), still
            own["axis"]["last_rad"] = math.nan

    def ends(self, stick: int) -> tuple[tuple[float, float], tuple[float, float]]:
        """Return where both markers of a stick are."""
        one, two = (place_of(marker) for marker in self.scene.markers[2 * stick : 2 * stick + 2])
        return one, two

    @property
    def radius_px(self) -> float:
        """Usual radius of a dot."""
        return float(np.median(self.scene.markers["first_radius"]))

    @property
    def length_px(self) -> float:
        """Usual distance of a stick's dots."""
        return float(np.median(self.scene.sticks["length"]))

    @property
    def shutter_share(self) -> float:
        """Share of a frame's time for which the shutter is open."""
        return float(self.scene.rig["shutter_share"][0])

    def step(self, luma: NDArray[np.uint8], time_s: float, shift: NDArray[np.float64]) -> NDArray[np.void]:
        """Follow one stick as :class:`tracker.patches.stick.Stick` does; its axis is taken as the picture shows it."""
        del shift
        return self.follow(luma, time_s)

    def follow(self, luma: NDArray[np.uint8], time_s: float) -> NDArray[np.void]:
        """Follow the markers into the next frame and return their readings, which the next frame overwrites."""
        stage = advance(self.scene, luma, time_s, START)
        while stage != DONE:
            redetect(self.scene, luma, stage)
            stage = advance(self.scene, luma, time_s, stage)
        return self.scene.readings

    def miss(self, time_s: float) -> None:
        """Pass over a frame that shows nothing."""
        skip(self.scene, time_s)

    def to_state(self) -> dict[str, Any]:
        """Return everything that :meth:`restore` needs to go on in the same way."""
        return {"dots": base64.b64encode(self._all.tobytes()).decode()}

    def restore(self, state: dict[str, Any]) -> None:
        """Go back to a noted state, exactly; it has to be made from the same first frame."""
        self._all[...] = np.frombuffer(base64.b64decode(state["dots"]), self._all.dtype)[0]
        for _, _, extras in self.scene.looks:
            extras[:, -1] = 0.0


class Follower:
    """Follows four markers, two of one stick, two of the other; ``moving`` is None until it shows."""

    def __init__(self, markers: Sequence[Marker], *, moving: int | None) -> None:
        self._state = DotState(markers)
        self._rows = np.zeros(1, ROW)
        if moving is not None:
            self._name_sticks(moving)

    def step(self, frame: Frame) -> NDArray[np.void]:
        """Follow the markers into the next frame and return its row, which the next frame overwrites."""
        scene = self._state.scene
        if frame.luma is None or frame.damaged:
            self._state.miss(frame.time_s)
            scene.readings["state"] = DAMAGED
        else:
            self._state.follow(frame.luma, frame.time_s)
            if self.moving is None:
                self._look_for_motion()
        write_row(scene.readings, self._rows[0])
        self._rows["time_s"] = frame.time_s
        row: NDArray[np.void] = self._rows[0]
        return row

    @property
    def moving(self) -> int | None:
        """Which stick moves, 0 or 1; None until it shows."""
        number = int(self._state.scene.rig["moving"][0])
        return None if number < 0 else number

    def _look_for_motion(self) -> None:
        if self._state.scene.readings["state"].any():
            return
        sticks = self._state.scene.sticks
        angles = [turned(direction(*self._state.ends(k)), float(sticks["start_rad"][k])) for k in (0, 1)]
        moving = stick_that_moves(angles)
        if moving is not None:
            self._name_sticks(moving)

    def _name_sticks(self, moving: int) -> None:
        """Settle which stick moves."""
        scene, ends = self._state.scene, self._state.ends(1 - moving)
        rig = scene.rig[0]
        rig["moving"], rig["zero"] = moving, ends
        base, rig["last_rad"] = scene.sticks[1 - moving], direction(*ends)
        base["still"], base["start_rad"] = True, rig["last_rad"]
        centre = crossing_point(*ends, *self._state.ends(moving))
        if centre is not None:
            suppose_axis(scene.sticks[moving]["axis"], *centre)

    def report(self) -> dict[str, float]:
        """Return sizes for ``track.json``: of dots and sticks, and the shutter."""
        dots = self._state
        return {
            "radius_px": dots.radius_px,
            "stick_length_px": dots.length_px,
            "shutter_share_of_frame": dots.shutter_share,
        }

    def to_state(self) -> dict[str, Any]:
        """Return everything that :meth:`restore` needs to go on in the same way."""
        return self._state.to_state()

    def restore(self, state: dict[str, Any]) -> None:
        """Go back to a noted state, exactly; the follower has to be made from the same first frame."""
        self._state.restore(state)


def stick_that_moves(turned_rad: Sequence[float]) -> int | None:
    """Return which of two sticks moves, from how far each has turned since the start; None while that is open."""
    for stick in (0, 1):
        if turned_rad[stick] > _MOVED_RAD + 3.0 * turned_rad[1 - stick]:
            return stick
    return None
