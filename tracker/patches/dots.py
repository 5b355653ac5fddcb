"""A stick with two dots beside one with a tag or texture: no dot can be taken for one of the other stick's."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from tracker.axis import Axis
from tracker.flow import TileFlow
from tracker.linear import Reading
from tracker.marker import Marker, Point
from tracker.pair import Pair
from tracker.recover import Found, Region
from tracker.rules import TURN_RAD
from tracker.sight import Sight, between
from tracker.smear import Shutter

_OPPOSITE_RAD: Final = 2.5
"""Two finds that differ by this much are one stick, once the other way round."""
_OFF_CIRCLE: Final = 0.1
_OFF_CIRCLE_PX: Final = 5.0
"""How far a marker that is found again may be from its circle about the axis: share of the arm, and px."""

_ARC: Final = 3
"""Parts of ten degrees in which the stick was seen from which its axis is known well enough to look around it."""


class DotStick:
    """Reads a stick's two dots.

    Parameters
    ----------
    markers : two Marker
        Inner and outer one.
    still : bool
        True for the base, whose direction does not change.
    """

    def __init__(self, markers: list[Marker], *, still: bool) -> None:
        self.markers = markers
        self._still = still
        self.pair = Pair(markers, 0)
        self.shutter = Shutter()
        self.axis = Axis()
        self._flow = TileFlow([marker.template for marker in markers], [marker.gauge.light for marker in markers])

    @property
    def radius_px(self) -> float:
        """Mean radius of the dots."""
        return 0.5 * sum(marker.radius_px for marker in self.markers)

    @property
    def length_px(self) -> float:
        """Distance of both dots."""
        return self.pair.length_px

    @property
    def shutter_share(self) -> float:
        """Share of a frame's time for which the shutter is open."""
        return self.shutter.share

    def step(self, luma: NDArray[np.uint8], time_s: float) -> tuple[list[Reading | None], list[str]]:
        """Return what is read in the next frame."""
        predicted = self._predict(time_s)
        sight = Sight(time_s, luma, predicted, [None, None], ["lost", "lost"])
        steps = [self._step_of(marker, at) for marker, at in zip(self.markers, predicted, strict=True)]
        for index, (marker, step) in enumerate(zip(self.markers, steps, strict=True)):
            smear = self.shutter.smear(step)
            marker.view = marker.view._replace(smear_x_px=smear[0], smear_y_px=smear[1])
            self._flow.expect(index, light=marker.gauge.light, view=marker.view)
        for index, (x, y) in enumerate(self._flow.find(luma, predicted)):
            self._read(sight, index, (x, y), steps[index])
        self.pair.check_length(sight)
        if any(sight.reasons):
            self._find(sight)
        self._note(sight, steps)
        return [sight.good(index) for index in (0, 1)], sight.reasons

    def miss(self) -> None:
        """Pass over a frame that shows nothing."""
        for marker in self.markers:
            marker.miss(marker.x_px, marker.y_px)

    def _predict(self, time_s: float) -> list[Point]:
        places = [marker.predict(time_s) or (marker.x_px, marker.y_px) for marker in self.markers]
        for lost, seen in ((0, 1), (1, 0)):
            if self.markers[lost].lost and not self.markers[seen].lost:
                angle = self.axis.direction_from(places[seen], outer=seen == 1)
                carried = None if angle is None else self.axis.place(angle, outer=lost == 1)
                places[lost] = carried or places[lost]
        return places

    def _read(self, sight: Sight, index: int, at: Point, step: Point) -> None:
        marker, expected = self.markers[index], sight.predicted[index]
        if not math.dist(at, expected) <= 1.5 * self._flow.reach_px:
            return
        reading = marker.read(sight.luma, *at)
        reason = marker.gauge.judge(reading, slack=self.shutter.slack(step))
        if reading is not None and math.dist(at, (reading.x_px, reading.y_px)) > marker.radius_px:
            reason = reason or "hidden"
        sight.readings[index], sight.reasons[index] = reading, reason

    @staticmethod
    def _step_of(marker: Marker, expected: Point) -> Point:
        if not marker.history or marker.lost:
            return 0.0, 0.0
        _, x, y = marker.history[-1]
        return expected[0] - x, expected[1] - y

    def _find(self, sight: Sight) -> None:
        """Look for both dots around their last places, the wider the longer they were lost."""
        lost = max(marker.lost for marker in self.markers)
        (ax, ay), (bx, by) = self.pair.ends
        centre = self._centre()
        if centre is not None:
            region = Region(*centre, 1.15 * self.axis.arm(outer=True) + 20.0)
        elif lost % 10 == 9:
            height, width = sight.luma.shape
            region = Region(0.5 * width, 0.5 * height, 0.5 * max(height, width))
        else:
            region = Region(0.5 * (ax + bx), 0.5 * (ay + by), 1.5 * self.pair.length_px + 40.0)
        found = [one for one in self.pair.look_for(sight.luma, region) if self._may_be(one)]
        found.sort(key=lambda one: between(one.direction_rad, self.pair.direction_rad))
        opposite = len(found) == 2 and between(found[0].direction_rad, found[1].direction_rad) > _OPPOSITE_RAD
        # After a longer loss nothing tells which of two opposite ways is meant, unless the arms differ.
        if len(found) == 1 or (opposite and lost < 3):
            sight.take(0, found[0].inner)
            sight.take(1, found[0].outer)

    def _centre(self) -> Point | None:
        """Return the axis where the stick has turned enough to tell it."""
        return self.axis.centre if np.count_nonzero(self.axis.seen) >= _ARC else None

    def _may_be(self, found: Found) -> bool:
        """Return whether two dots may be this stick, and not this stick the other way round."""
        if self._still:
            return between(found.direction_rad, self.pair.start_rad) < TURN_RAD
        centre = self._centre()
        if centre is None:
            return between(found.direction_rad, self.pair.direction_rad) < 0.5 * math.pi
        for dot, outer in ((found.inner, False), (found.outer, True)):
            arm = self.axis.arm(outer=outer)
            away = math.dist(centre, (dot.x_px, dot.y_px))
            if abs(away - arm) > (_OFF_CIRCLE + self.pair.varies) * arm + _OFF_CIRCLE_PX:
                return False
        return True

    def _note(self, sight: Sight, steps: list[Point]) -> None:
        for index, marker in enumerate(self.markers):
            reading = sight.good(index)
            if reading is None:
                marker.miss(*sight.predicted[index])
                continue
            if not self.shutter.sharp(steps[index]) or math.hypot(*steps[index]) > 4.0:
                self.shutter.learn(marker, sight.luma, (reading.x_px, reading.y_px), steps[index])
            marker.take(sight.time_s, reading, (0.0, 0.0), still=self.shutter.sharp(steps[index]))
        self.pair.note_length(sight)
        a, b = sight.good(0), sight.good(1)
        if a is not None and b is not None:
            self.axis.add((a.x_px, a.y_px), (b.x_px, b.y_px))

    def to_state(self) -> dict[str, Any]:
        """Return what :meth:`restore` needs."""
        return {
            "markers": [marker.to_state() for marker in self.markers],
            "pair": self.pair.to_state(),
            "shutter": self.shutter.to_state(),
            "axis": self.axis.to_state(),
            "flow": self._flow.to_state(),
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Go back to a noted state, exactly."""
        for marker, content in zip(self.markers, state["markers"], strict=True):
            marker.restore(content)
        self.pair.restore(state["pair"])
        self.shutter.restore(state["shutter"])
        self.axis = Axis.from_state(state["axis"])
        self._flow.restore(state["flow"])
