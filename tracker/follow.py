"""From frame to frame: predict, find by Lucas–Kanade, read by least squares, judge, find again.

The base stick does not move but for the camera's own shaking; the moving stick turns around an axis that is learned.
While the moving stick passes over the base stick's markers these are not read at all but held: two markers of one
look in one place cannot be told apart by how they look.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from tracker.base import BaseStick
from tracker.flow import TileFlow
from tracker.linear import Reading
from tracker.marker import Marker, Point
from tracker.moving import UNSEEN_PX, MovingStick, near_dot
from tracker.pair import Pair
from tracker.recover import Region, places_like
from tracker.rules import DARK, NEAR, SHARP_PX, SPARSE
from tracker.sight import Sight, between, make_row
from tracker.smear import Shutter
from tracker.source import Frame
from tracker.sticks import crossing_point
from tracker.usual import UsualFrames

_MOVED_RAD: Final = math.radians(1.0)
"""A stick that turned by this much, and three times as much as the other, is the moving one."""
_NEARBY: Final = 3
"""Frames after which a lost marker is no longer looked for next to where it is expected."""
_SHAKEN_PX: Final = 0.7
"""Shift between two frames from which the moving stick is looked for again at the shifted place."""


class Follower:
    """Follows four markers through a film.

    Parameters
    ----------
    markers : four Marker
        Two of one stick, two of the other.
    moving : int or None
        Which stick moves (0 or 1); None until it shows.
    """

    def __init__(self, markers: Sequence[Marker], *, moving: int | None) -> None:
        self.markers = list(markers)
        self.pairs: list[Pair] = [Pair(self.markers, 0), Pair(self.markers, 1)]
        self.flow = TileFlow([m.template for m in markers], [m.gauge.light for m in markers])
        self.shutter = Shutter()
        self.base: BaseStick | None = None
        self.moving: MovingStick | None = None
        self.brightness = 0.0
        self.usual: UsualFrames | None = None
        if moving is not None:
            self._name_sticks(moving)

    def step(self, frame: Frame) -> NDArray[np.void]:
        """Follow the markers into the next frame and return its row."""
        if self.usual is not None and frame.luma is not None and not frame.damaged:
            row = self.usual.step(frame.time_s, frame.luma)
            if row is not None:
                return row
        predicted = self._predict(frame.time_s)
        if frame.luma is None or frame.damaged:
            for index, marker in enumerate(self.markers):
                marker.miss(*predicted[index])
            return make_row(frame.time_s, [None] * 4, ["damaged"] * 4)
        sight = Sight(frame.time_s, frame.luma, predicted, [None] * 4, ["lost"] * 4)
        self._read(sight, (0, 1, 2, 3))
        shift = (0.0, 0.0)
        if self.base is not None and self.moving is not None:
            shift = self._judge(sight, self.base, self.moving)
        else:
            for pair, other in (self.pairs, self.pairs[::-1]):
                pair.check_length(sight)
                self._find_unnamed(sight, pair, other)
        self._tell_dark(sight)
        self._note(sight, shift)
        return sight.row()

    # --- prediction and reading ---------------------------------------------------------------------------------

    def _predict(self, time_s: float) -> list[Point]:
        if self.base is None or self.moving is None:
            return [marker.predict(time_s) or (marker.x_px, marker.y_px) for marker in self.markers]
        shift = self.base.shift
        predicted = [(marker.x_px, marker.y_px) for marker in self.markers]
        for index in self.moving.indices:
            ahead = self.markers[index].predict(time_s)
            if ahead is not None:
                predicted[index] = (ahead[0] + shift[0], ahead[1] + shift[1])
        i, j = self.moving.indices
        for lost, seen in ((i, j), (j, i)):
            if self.markers[lost].lost and not self.markers[seen].lost:
                place = self.moving.place_from(seen, predicted[seen], shift)
                predicted[lost] = place or predicted[lost]
        if self.markers[i].lost and self.markers[j].lost:
            carried = self.moving.ahead(time_s, shift)
            if carried is not None:
                predicted[i], predicted[j] = carried
        return predicted

    def _read(self, sight: Sight, which: Sequence[int]) -> None:
        """Find some markers from their predicted positions, read them, and judge each by itself."""
        for index, marker in enumerate(self.markers):
            smear = self.shutter.smear(self._step_of(index, sight))
            marker.view = marker.view._replace(smear_x_px=smear[0], smear_y_px=smear[1])
            self.flow.expect(index, light=marker.gauge.light, view=marker.view)
        found = self.flow.find(sight.luma, sight.predicted)
        for index in which:
            marker, (px, py), (x, y) = self.markers[index], sight.predicted[index], found[index]
            sight.readings[index], sight.reasons[index] = None, "lost"
            if not math.hypot(x - px, y - py) <= 1.5 * self.flow.reach_px:
                continue
            reading = marker.read(sight.luma, x, y)
            reason = marker.gauge.judge(reading, slack=self.shutter.slack(self._step_of(index, sight)))
            if reading is not None and math.hypot(reading.x_px - x, reading.y_px - y) > marker.radius_px:
                reason = reason or "hidden"
            sight.readings[index], sight.reasons[index] = reading, reason
        if self.brightness and not self._is_dark(sight):
            for index in which:
                self._read_nearby(sight, index)

    def _read_nearby(self, sight: Sight, index: int) -> None:
        """Look for a marker next to where it was expected, after the flow has led astray: the picture has jumped."""
        marker, (px, py) = self.markers[index], sight.predicted[index]
        if not sight.reasons[index] or marker.lost > _NEARBY:
            return
        reach = self.flow.reach_px + 2.0 * marker.radius_px
        places = places_like(
            sight.luma,
            radius_px=marker.radius_px,
            light_dot=marker.template.shape.contrast > 0,
            region=Region(px, py, reach + marker.radius_px),
        )
        slack = self.shutter.slack(self._step_of(index, sight))
        good = [
            reading
            for place in places
            if (reading := marker.read(sight.luma, *place)) is not None
            and math.hypot(reading.x_px - px, reading.y_px - py) < reach
            and not marker.gauge.judge(reading, slack=slack)
            and not self._next_to_base(index, reading)
        ]
        if len(good) == 1:
            sight.take(index, good[0])

    def _next_to_base(self, index: int, reading: Reading) -> bool:
        """Return whether what was read for the moving stick may be a dot of the base."""
        return (
            self.base is not None
            and index not in self.base.indices
            and near_dot(reading, self.base, NEAR, more_px=UNSEEN_PX)
        )

    def _step_of(self, index: int, sight: Sight) -> Point:
        """Return how far a marker of the moving stick is expected to have moved since the last frame."""
        if self.moving is None or self.base is None or index not in self.moving.indices:
            return 0.0, 0.0
        marker, (px, py) = self.markers[index], sight.predicted[index]
        if marker.lost:
            return (px - marker.x_px, py - marker.y_px) if marker.history else (0.0, 0.0)
        if not marker.history:
            return 0.0, 0.0
        _, x, y = marker.history[-1]
        return px - self.base.shift[0] - x, py - self.base.shift[1] - y

    # --- judgement ------------------------------------------------------------------------------------------------

    def _judge(self, sight: Sight, base: BaseStick, moving: MovingStick) -> Point:
        """Judge the sticks against each other, find again what was lost, and return the shift of the picture."""
        i, j = moving.indices
        strip = (sight.place(i), sight.place(j))
        moving.vote(base.cover(sight, strip, moving.inner.template.window_px))
        base.judge(sight, moving_seen=not (sight.reasons[i] or sight.reasons[j]))
        if not self._is_dark(sight):
            base.find(sight, moving, lambda step: self._goes_along(sight, moving, step))
        shift = base.seen_shift(sight) or moving.told_shift(sight, base.shift)
        dx, dy = shift[0] - base.shift[0], shift[1] - base.shift[1]
        if math.hypot(dx, dy) > _SHAKEN_PX and any(sight.reasons[k] for k in moving.indices):
            for k in moving.indices:
                x, y = sight.predicted[k]
                sight.predicted[k] = (x + dx, y + dy)
            self._read(sight, moving.indices)
        moving.judge(sight, base, shift)
        if not self._is_dark(sight):
            moving.find(sight, base, shift)
        return shift

    def _goes_along(self, sight: Sight, moving: MovingStick, step: Point) -> bool:
        """Return whether the moving stick is read shifted by a step; the readings are kept if it is."""
        before = (list(sight.predicted), list(sight.readings), list(sight.reasons))
        for k in moving.indices:
            x, y = sight.predicted[k]
            sight.predicted[k] = (x + step[0], y + step[1])
        self._read(sight, moving.indices)
        if not any(sight.reasons[k] for k in moving.indices):
            return True
        sight.predicted[:], sight.readings[:], sight.reasons[:] = before
        return False

    def _find_unnamed(self, sight: Sight, pair: Pair, other: Pair) -> None:
        """Look for a stick that is lost before it is known which one moves: it may turn fast from the start."""
        if not any(sight.reasons[k] for k in pair.indices) or any(sight.reasons[k] for k in other.indices):
            return
        if self._is_dark(sight):
            return
        (ax, ay), (bx, by) = pair.ends
        region = Region(0.5 * (ax + bx), 0.5 * (ay + by), 1.5 * pair.length_px + 40.0)
        taken = [(sight.place(k), marker.radius_px) for k, marker in zip(other.indices, other.markers, strict=True)]
        found = [
            candidate
            for candidate in pair.look_for(sight.luma, region)
            if all(
                math.dist(place, (dot.x_px, dot.y_px)) > 1.6 * radius
                for place, radius in taken
                for dot in (candidate.inner, candidate.outer)
            )
        ]
        # Dots of one make can be paired both ways round: the one that has turned less is meant.
        found.sort(key=lambda candidate: between(candidate.direction_rad, pair.direction_rad))
        if len(found) == 1 or (len(found) == 2 and between(found[0].direction_rad, found[1].direction_rad) > 2.5):
            sight.take(pair.indices[0], found[0].inner)
            sight.take(pair.indices[1], found[0].outer)

    def _is_dark(self, sight: Sight) -> bool:
        level = float(sight.luma[::SPARSE, ::SPARSE].mean())
        return level < DARK * self.brightness

    def _tell_dark(self, sight: Sight) -> None:
        """Name darkness as the reason, and keep account of the usual brightness."""
        level = float(sight.luma[::SPARSE, ::SPARSE].mean())
        if level < DARK * self.brightness:
            sight.reasons = ["dark" if reason else "" for reason in sight.reasons]
            return
        self.brightness = level if self.brightness == 0.0 else self.brightness + 0.05 * (level - self.brightness)

    # --- bookkeeping ----------------------------------------------------------------------------------------------

    def _note(self, sight: Sight, shift: Point) -> None:
        steps = [self._step_of(index, sight) for index in range(4)]
        if self.base is not None and self.moving is not None:
            self._look_at_smear(sight, steps)
            self.base.shift = shift
        for index, marker in enumerate(self.markers):
            reading: Reading | None = sight.good(index)
            if reading is not None:
                marker.take(sight.time_s, reading, shift, still=self.shutter.sharp(steps[index]))
            elif self.base is not None and index in self.base.indices:
                marker.miss(*self.base.assumed(index))
            else:
                marker.miss(*sight.predicted[index])
        for pair in self.pairs:
            pair.note_length(sight)
        if self.moving is not None:
            seen = self.base is not None and self.base.seen_shift(sight) is not None
            self.moving.learn(sight, shift, base_seen=seen)
        else:
            self._look_for_motion(sight)

    def _look_at_smear(self, sight: Sight, steps: Sequence[Point]) -> None:
        for index, step in enumerate(steps):
            reading = sight.good(index)
            if math.hypot(*step) > SHARP_PX and reading is not None:
                self.shutter.learn(self.markers[index], sight.luma, (reading.x_px, reading.y_px), step)

    def _look_for_motion(self, sight: Sight) -> None:
        if any(sight.reasons):
            return
        turned = [between(pair.direction_rad, pair.start_rad) for pair in self.pairs]
        for stick in (0, 1):
            if turned[stick] > _MOVED_RAD + 3.0 * turned[1 - stick]:
                self._name_sticks(stick)
                return

    def _name_sticks(self, moving: int) -> None:
        """Settle which stick moves."""
        starts = [pair.start_rad for pair in self.pairs]
        lengths = [pair.length_px for pair in self.pairs]
        self.base = BaseStick(self.markers, 1 - moving)
        self.moving = MovingStick(self.markers, moving)
        self.pairs = [self.base, self.moving] if moving else [self.moving, self.base]
        for pair, start, length in zip(self.pairs, starts, lengths, strict=True):
            pair.start_rad, pair.length_px = start, length
        centre = crossing_point(*self.base.ends, *self.moving.ends)
        if centre is not None:
            self.moving.axis.suppose(centre)
        self.usual = UsualFrames(self, self.base, self.moving)

    def settle(self) -> None:
        """Bring all that the compiled way has learned back into the markers and sticks."""
        if self.usual is not None:
            self.usual.give_back()

    def report(self) -> dict[str, float]:
        """Return sizes for ``track.json``: of dots and sticks, and the shutter."""
        return {
            "radius_px": float(np.median([marker.radius_px for marker in self.markers])),
            "stick_length_px": float(np.median([pair.length_px for pair in self.pairs])),
            "shutter_share_of_frame": self.shutter.share,
        }

    def to_state(self) -> dict[str, Any]:
        """Return everything that :meth:`restore` needs to go on in the same way."""
        self.settle()
        return {
            "moving": None if self.moving is None else self.moving.stick,
            "markers": [marker.to_state() for marker in self.markers],
            "pairs": [pair.to_state() for pair in self.pairs],
            "shutter": self.shutter.to_state(),
            "flow": self.flow.to_state(),
            "brightness": self.brightness,
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Go back to a noted state, exactly; the follower has to be made from the same first frame."""
        if state["moving"] is not None and self.moving is None:
            self._name_sticks(int(state["moving"]))
        for marker, content in zip(self.markers, state["markers"], strict=True):
            marker.restore(content)
        for pair, content in zip(self.pairs, state["pairs"], strict=True):
            pair.restore(content)
        self.shutter.restore(state["shutter"])
        self.flow.restore(state["flow"])
        self.brightness = float(state["brightness"])
