"""The base stick: it stands still, but for a camera that shakes or is bumped."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, Final

from tracker.linear import Reading
from tracker.marker import Marker, Point
from tracker.pair import Pair
from tracker.recover import Region
from tracker.rules import ALONE_PX, APART_PX, JUMP_PX, TURN_RAD
from tracker.sight import Sight, between, direction, distance_to_strip

_SURE_RAD: Final = math.radians(0.4)
"""How far it may turn at once while the moving stick, which may lie over it, is not seen."""
_SEARCH_PX: Final = 45.0


class BaseStick(Pair):
    """The base stick and, with it, where the camera points."""

    def __init__(self, markers: Sequence[Marker], stick: int) -> None:
        super().__init__(markers, stick)
        self.reference_rad = self.last_rad = self.direction_rad
        self.zero = self.ends
        self.shift: Point = (0.0, 0.0)
        self.anchor: Point | None = None

    def cover(self, sight: Sight, strip: tuple[Point, Point], width_px: float) -> int:
        """Do not read markers that the moving stick's strip reaches; return evidence of which stick is above.

        Positive where a base dot is hidden right under the strip, negative where one is seen whole there.
        """
        evidence = 0
        for index, marker in zip(self.indices, self.markers, strict=True):
            here = (marker.x_px, marker.y_px)
            if not self._covered(marker, here, strip, width_px):
                continue
            away = distance_to_strip(here, strip, beyond=0.6)
            clear = min(math.dist(here, end) for end in strip) > 2.5 * marker.radius_px
            if clear and away < 0.4 * marker.radius_px:
                evidence += {"": -1, "hidden": 1}.get(sight.reasons[index], 0)
            sight.reasons[index] = "shadowed"
        return evidence

    def judge(self, sight: Sight, *, moving_seen: bool) -> None:
        """Refuse readings that are not of a stick that stands still.

        While the moving stick is not seen it may lie anywhere, even over the base: then only the base's own direction
        will do.
        """
        self.check_length(sight)
        self.anchor = None if moving_seen else self.anchor or self.shift
        i, j = self.indices
        a, b = sight.good(i), sight.good(j)
        if a is not None and b is not None:
            one = (a.x_px - self.inner.x_px, a.y_px - self.inner.y_px)
            two = (b.x_px - self.outer.x_px, b.y_px - self.outer.y_px)
            now_rad = direction((a.x_px, a.y_px), (b.x_px, b.y_px))
            jumped = max(math.hypot(*one), math.hypot(*two)) > JUMP_PX
            turned = between(now_rad, self.reference_rad) > TURN_RAD
            if not moving_seen:
                turned = turned or between(now_rad, self.last_rad) > _SURE_RAD
            if math.dist(one, two) > APART_PX or jumped or turned:
                sight.reasons[i] = sight.reasons[j] = "lost"
            elif moving_seen:
                self.last_rad = now_rad
            return
        for index, marker, reading in ((i, self.inner, a), (j, self.outer, b)):
            if reading is None:
                continue
            if marker.distance(reading.x_px, reading.y_px) > ALONE_PX or self._astray(index, reading):
                sight.reasons[index] = "lost"

    def _astray(self, index: int, reading: Reading) -> bool:
        """Return whether one dot alone has gone from where it was when the moving stick was last seen elsewhere."""
        if self.anchor is None:
            return False
        zero = self.zero[index - self.indices[0]]
        away = (reading.x_px - zero[0] - self.anchor[0], reading.y_px - zero[1] - self.anchor[1])
        return math.hypot(*away) > APART_PX

    def find(self, sight: Sight, moving: Pair, goes_along: Callable[[Point], bool]) -> None:
        """Look for it nearby after both markers were lost: a bump carries it away but hardly turns it.

        What looks like the base may be the moving stick, as long as that one is not seen elsewhere: then
        ``goes_along(step)`` has to find that one shifted by the same step.
        """
        if any(sight.reasons[i] in ("", "shadowed", "dark") for i in self.indices):
            return
        if self.inner.lost > 3 and self.inner.lost % 4:
            return
        (ax, ay), (bx, by) = self.ends
        region = Region(0.5 * (ax + bx), 0.5 * (ay + by), 0.5 * self.length_px + _SEARCH_PX)
        pairs = [
            pair
            for pair in self.look_for(sight.luma, region)
            if between(pair.direction_rad, self.reference_rad) < TURN_RAD
            and abs(pair.length_px - self.length_px) < 0.8 + 0.01 * self.length_px
            and all(
                marker.lost or marker.distance(dot.x_px, dot.y_px) > 4.0
                for marker in moving.markers
                for dot in (pair.inner, pair.outer)
            )
        ]
        if any(sight.reasons[i] for i in moving.indices):
            pairs = [
                pair
                for pair in pairs
                if between(pair.direction_rad, self.last_rad) < _SURE_RAD
                and goes_along((pair.inner.x_px - self.inner.x_px, pair.inner.y_px - self.inner.y_px))
            ]
        if len(pairs) != 1:
            return
        i, j = moving.indices
        strip = None if sight.good(i) is None or sight.good(j) is None else (sight.place(i), sight.place(j))
        width_px = moving.inner.template.window_px
        for index, marker, dot in zip(self.indices, self.markers, (pairs[0].inner, pairs[0].outer), strict=True):
            if strip is not None and self._covered(marker, (dot.x_px, dot.y_px), strip, width_px):
                # It helped to find the pair, but the edge of the moving stick in its window shifts it.
                sight.reasons[index] = "shadowed"
            else:
                sight.take(index, dot)

    @staticmethod
    def _covered(marker: Marker, at: Point, strip: tuple[Point, Point], width_px: float) -> bool:
        """Return whether the moving stick's strip reaches into a marker's window."""
        return distance_to_strip(at, strip, beyond=0.6) < marker.radius_px + width_px + 2.5

    def seen_shift(self, sight: Sight) -> Point | None:
        """Return the shift of the picture since the start; None where the base is not seen."""
        shifts = [
            (reading.x_px - zero[0], reading.y_px - zero[1])
            for index, zero in zip(self.indices, self.zero, strict=True)
            if (reading := sight.good(index)) is not None
        ]
        if not shifts:
            return None
        return sum(s[0] for s in shifts) / len(shifts), sum(s[1] for s in shifts) / len(shifts)

    def assumed(self, index: int) -> Point:
        """Return where a marker is that was not read: it goes with the picture."""
        zero = self.zero[index - self.indices[0]]
        return zero[0] + self.shift[0], zero[1] + self.shift[1]

    def to_state(self) -> dict[str, Any]:
        """Return what :meth:`restore` needs."""
        state = {"reference_rad": self.reference_rad, "zero": self.zero, "shift": self.shift}
        return super().to_state() | state | {"last_rad": self.last_rad, "anchor": self.anchor}

    def restore(self, state: dict[str, Any]) -> None:
        """Go back to a noted state."""
        super().restore(state)
        self.reference_rad, self.last_rad = float(state["reference_rad"]), float(state["last_rad"])
        anchor = state["anchor"]
        self.anchor = None if anchor is None else (float(anchor[0]), float(anchor[1]))
        inner, outer = state["zero"]
        self.zero = ((float(inner[0]), float(inner[1])), (float(outer[0]), float(outer[1])))
        self.shift = (float(state["shift"][0]), float(state["shift"][1]))
