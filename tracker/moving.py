"""The moving stick: it turns around an axis that is learned, and passes over the base or under it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

from tracker.axis import Axis
from tracker.base import BaseStick
from tracker.linear import Reading
from tracker.marker import Marker, Point
from tracker.pair import Pair
from tracker.recover import Region
from tracker.rules import CLOSE, MOST_VOTES, NEAR, OWN_PX, OWN_RAD, SHAKE_PX, VOTES
from tracker.sight import Sight, between, direction, distance_to_strip

_SAME_PX: Final = 1.0
UNSEEN_PX: Final = 4.0
"""How far a base dot may have gone with the picture since it was seen."""
_CARRIED: Final = 15
"""Frames for which its last turning is carried on while it is not seen."""
_SHORT: Final = 5
"""Frames after which one dot alone is no longer taken for a marker."""


class MovingStick(Pair):
    """The moving stick, its axis, and whether it lies above the base."""

    def __init__(self, markers: Sequence[Marker], stick: int) -> None:
        super().__init__(markers, stick)
        self.axis = Axis()
        self.above = 0
        self.offset: Point | None = None

    def place_from(self, seen: int, at: Point, shift: Point) -> Point | None:
        """Return where the other marker is when one is at a place; None while the axis is not known."""
        inner_seen = seen == self.indices[0]
        angle = self.axis.direction_from((at[0] - shift[0], at[1] - shift[1]), outer=not inner_seen)
        place = None if angle is None else self.axis.place(angle, outer=inner_seen)
        return None if place is None else (place[0] + shift[0], place[1] + shift[1])

    def ahead(self, time_s: float, shift: Point) -> tuple[Point, Point] | None:
        """Return where its last turning carries both markers on their circles; None where that is not known."""
        a, b = self.inner.history, self.outer.history
        known = [entry for entry in (a, b) if len(entry) >= 2]
        if self.axis.solution is None or not known or self.inner.lost + self.outer.lost > 2 * _CARRIED:
            return None
        angles: list[float] = []
        for history in known:
            outer = history is b
            (t1, x1, y1), (t2, x2, y2) = history[-1], history[-2]
            now = self.axis.direction_from((x1, y1), outer=outer)
            before = self.axis.direction_from((x2, y2), outer=outer)
            if now is None or before is None:
                return None
            rate = math.remainder(now - before, math.tau) / (t1 - t2)
            angles.append(now + rate * (time_s - t1))
        angle = angles[0] + 0.5 * math.remainder(angles[-1] - angles[0], math.tau)
        inner, outer_ = self.axis.place(angle, outer=False), self.axis.place(angle, outer=True)
        if inner is None or outer_ is None:
            return None
        return (inner[0] + shift[0], inner[1] + shift[1]), (outer_[0] + shift[0], outer_[1] + shift[1])

    def vote(self, evidence: int) -> None:
        """Take in evidence of which stick is above."""
        self.above = max(-MOST_VOTES, min(MOST_VOTES, self.above + evidence))

    def judge(self, sight: Sight, base: BaseStick, shift: Point) -> None:
        """Refuse readings that could be of a base dot, or are not on the marker's circle."""
        self.check_length(sight)
        alone = sum(sight.good(index) is None for index in self.indices) == 1
        own = self._both_own(sight, base)
        for index, marker in zip(self.indices, self.markers, strict=True):
            reading = sight.good(index)
            if reading is None:
                continue
            if self._crossing(reading, base, own=own):
                self.vote(1)
            followed = marker.lost <= 3 or self.inner.lost + self.outer.lost == marker.lost
            radii = CLOSE if followed and not alone else NEAR
            near = near_dot(reading, base, radii, more_px=UNSEEN_PX if alone else 0.0)
            if near and not own and (alone or self.above < VOTES):
                # One dot alone next to a base dot may be either, whichever stick is above.
                sight.reasons[index] = "shadowed"
            elif marker.lost and self._off_circle(reading, shift, outer=marker is self.outer):
                sight.reasons[index] = "hidden"
        if all(marker.lost > _SHORT for marker in self.markers):
            seen = [i for i in self.indices if not sight.reasons[i]]
            if len(seen) == 1:
                # One dot alone, after a gap, could be anything that is round.
                sight.reasons[seen[0]] = "lost"

    def find(self, sight: Sight, base: BaseStick, shift: Point) -> None:
        """Look for the stick all around its axis after a marker was lost; one that is seen has to be part of it."""
        reasons = [sight.reasons[i] for i in self.indices]
        if "dark" in reasons or not any(reasons):
            return
        seen = [sight.good(i) for i in self.indices]
        if max(self.inner.lost, self.outer.lost) > 20 and max(self.inner.lost, self.outer.lost) % 3:
            return
        pairs = [
            pair
            for pair in self.look_for(sight.luma, self._region(shift))
            if not near_dot(pair.inner, base, NEAR)
            and not near_dot(pair.outer, base, NEAR)
            and not self._off_circle(pair.inner, shift, outer=False)
            and not self._off_circle(pair.outer, shift, outer=True)
            and all(
                known is None or math.dist((known.x_px, known.y_px), (dot.x_px, dot.y_px)) < _SAME_PX
                for known, dot in zip(seen, (pair.inner, pair.outer), strict=True)
            )
        ]
        if len(pairs) == 1:
            sight.take(self.indices[0], pairs[0].inner)
            sight.take(self.indices[1], pairs[0].outer)

    def told_shift(self, sight: Sight, last: Point) -> Point:
        """Return the shift of the picture as its circles tell it while the base is not seen; the last one otherwise."""
        away = self._away(sight)
        if away is None or self.offset is None or self.above < VOTES:
            # Under the base, or not known to be above it, what is seen here may be the base's own dots.
            return last
        shift = (away[0] - self.offset[0], away[1] - self.offset[1])
        return shift if math.dist(shift, last) < SHAKE_PX else last

    def _away(self, sight: Sight) -> Point | None:
        """Return how far both markers are, in the mean, from where they would be in the picture of the first frame."""
        a, b = sight.good(self.indices[0]), sight.good(self.indices[1])
        if a is None or b is None:
            return None
        if abs(math.hypot(b.x_px - a.x_px, b.y_px - a.y_px) - self.length_px) > 0.8 + 0.01 * self.length_px:
            return None
        off = self._off_circles(a, b)
        return None if off is None else (0.5 * (off[0][0] + off[1][0]), 0.5 * (off[0][1] + off[1][1]))

    def _off_circles(self, a: Reading, b: Reading) -> tuple[Point, Point] | None:
        """Return how far either marker is from where its circle puts it; None while the axis is not known."""
        turn = direction((a.x_px, a.y_px), (b.x_px, b.y_px))
        inner, outer = self.axis.place(turn, outer=False), self.axis.place(turn, outer=True)
        if inner is None or outer is None:
            return None
        return (a.x_px - inner[0], a.y_px - inner[1]), (b.x_px - outer[0], b.y_px - outer[1])

    def _both_own(self, sight: Sight, base: BaseStick) -> bool:
        """Return whether both dots are known to be its own, next to the base's dots as they may be.

        Had one of them been a dot of the base, it would be off its circle against the other; had both, the stick would
        point as the base does. Neither depends on a shake of the camera.
        """
        a, b = sight.good(self.indices[0]), sight.good(self.indices[1])
        if a is None or b is None or any(marker.lost for marker in self.markers):
            return False
        if between(direction((a.x_px, a.y_px), (b.x_px, b.y_px)), base.last_rad) < OWN_RAD:
            return False
        off = self._off_circles(a, b)
        return off is not None and math.dist(*off) < OWN_PX

    def learn(self, sight: Sight, shift: Point, *, base_seen: bool) -> None:
        """Take a frame with both markers into the account of the axis."""
        if not base_seen:
            return
        a, b = sight.good(self.indices[0]), sight.good(self.indices[1])
        if a is not None and b is not None:
            self.axis.add((a.x_px - shift[0], a.y_px - shift[1]), (b.x_px - shift[0], b.y_px - shift[1]))
            away = self._away(sight)
            self.offset = None if away is None else (away[0] - shift[0], away[1] - shift[1])

    def _region(self, shift: Point) -> Region:
        centre = self.axis.centre
        if centre is not None:
            return Region(centre[0] + shift[0], centre[1] + shift[1], 1.15 * self.axis.arm(outer=True) + 20.0)
        (ax, ay), (bx, by) = self.ends
        return Region(0.5 * (ax + bx), 0.5 * (ay + by), 1.5 * self.length_px + 40.0)

    def _off_circle(self, reading: Reading, shift: Point, *, outer: bool) -> bool:
        centre = self.axis.centre
        if centre is None:
            return False
        arm = self.axis.arm(outer=outer)
        away = math.hypot(reading.x_px - centre[0] - shift[0], reading.y_px - centre[1] - shift[1])
        # Seen from aside circles are ellipses, as flat as the stick's own length varies.
        return abs(away - arm) > (0.1 + self.varies) * arm + 5.0

    def _crossing(self, reading: Reading, base: BaseStick, *, own: bool) -> bool:
        """Return whether a marker is seen whole in the middle of the base stick: it is above.

        Next to a dot of the base that takes both markers to be known as the moving stick's ``own``.
        """
        if not own and near_dot(reading, base, NEAR):
            return False
        away = distance_to_strip((reading.x_px, reading.y_px), base.ends, beyond=0.1)
        return away < 1.2 * base.inner.radius_px

    def to_state(self) -> dict[str, Any]:
        """Return what :meth:`restore` needs."""
        return super().to_state() | {"axis": self.axis.to_state(), "above": self.above, "offset": self.offset}

    def restore(self, state: dict[str, Any]) -> None:
        """Go back to a noted state."""
        super().restore(state)
        self.axis = Axis.from_state(state["axis"])
        self.above = int(state["above"])
        self.offset = None if state["offset"] is None else (float(state["offset"][0]), float(state["offset"][1]))


def near_dot(reading: Reading, base: BaseStick, radii: float, *, more_px: float = 0.0) -> bool:
    """Return whether a reading lies within some radii of a dot of the base."""
    # A base dot that was not seen lately may have moved with the picture.
    return any(
        m.distance(reading.x_px, reading.y_px) < radii * m.radius_px + (more_px if m.lost else 0.0)
        for m in base.markers
    )
