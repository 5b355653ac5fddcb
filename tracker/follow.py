"""From frame to frame: predict, find by Lucas–Kanade, read by least squares, judge, find again.

The base stick does not move but for the camera's own shaking; the moving stick turns around an axis that is learned. While
the moving stick passes over the base stick's markers these are not read at all but held: two markers of one look in one
place cannot be told apart by how they look.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from tracker.axis import Axis
from tracker.flow import TileFlow
from tracker.marker import Marker, Point
from tracker.recover import Found, Region, pairs_at_distance, places_like
from tracker.rows import CODE, ROW
from tracker.source import Frame
from tracker.sticks import crossing_point
from tracker.template import Reading

_MOVED_RAD: Final = math.radians(1.0)
"""A stick that turned by this much, and three times as much as the other, is the moving one."""
_SHAKE_PX: Final = 6.0
"""How far the base stick may jump between two frames when both of its markers agree."""
_BASE_TURN_RAD: Final = math.radians(2.0)
"""How far a bumped camera may turn the base stick."""


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
        self.moving = moving
        self.flow = TileFlow([m.template for m in markers], [m.gauge.light for m in markers])
        self.start_rad = [self._direction(0), self._direction(1)]
        self.reference_rad = list(self.start_rad)
        self.length_px = [self._length(0), self._length(1)]
        self.axis = Axis()
        self.shift: Point = (0.0, 0.0)
        self.on_top: int = 0
        centre = crossing_point(*((m.x_px, m.y_px) for m in self.markers))
        if centre is not None:
            self.axis.suppose(centre)

    def step(self, frame: Frame) -> NDArray[np.void]:
        """Follow the markers into the next frame and return its row."""
        predicted = self._predict(frame.time_s)
        if frame.luma is None or frame.damaged:
            for marker, place in zip(self.markers, predicted, strict=True):
                marker.miss(*place)
            return _row(frame.time_s, [None] * 4, ["damaged"] * 4)
        luma = frame.luma
        readings, reasons = self._read(luma, predicted)
        if self.moving is None:
            for stick in (0, 1):
                self._check_length(stick, readings, reasons, predicted)
        else:
            self._judge_base(luma, predicted, readings, reasons)
            self._judge_moving(luma, predicted, readings, reasons)
        self._note(frame.time_s, predicted, readings, reasons)
        return _row(frame.time_s, readings, reasons)

    # --- prediction and reading ---------------------------------------------------------------------------------

    def _predict(self, time_s: float) -> list[Point]:
        predicted = [(m.x_px, m.y_px) if self._is_base(i) else m.predict(time_s) for i, m in enumerate(self.markers)]
        if self.moving is None:
            return predicted
        first = 2 * self.moving
        for lost, seen in ((first, first + 1), (first + 1, first)):
            if self.markers[lost].lost and not self.markers[seen].lost:
                place = self._place_from(seen, predicted[seen])
                predicted[lost] = place or predicted[lost]
        return predicted

    def _place_from(self, seen: int, at: Point) -> Point | None:
        """Return where the other marker of a stick is when one is at a place; None while the axis is unknown."""
        if self.axis.solution is None:
            return None
        dx, dy = self.shift
        direction = self.axis.direction_from((at[0] - dx, at[1] - dy), outer=seen % 2 == 1)
        x, y = self.axis.place(direction, outer=seen % 2 == 0)
        return x + dx, y + dy

    def _read(
        self, luma: NDArray[np.uint8], predicted: list[Point], which: Sequence[int] = (0, 1, 2, 3)
    ) -> tuple[list[Reading | None], list[str]]:
        for stick in (0, 1):
            turn = _direction(predicted[2 * stick], predicted[2 * stick + 1]) - self.start_rad[stick]
            for index in (2 * stick, 2 * stick + 1):
                marker = self.markers[index]
                marker.view = marker.view._replace(turn_rad=turn)
                self.flow.expect(index, light=marker.gauge.light, view=marker.view)
        found = self.flow.find(luma, predicted)
        readings: list[Reading | None] = [None] * 4
        reasons = ["lost"] * 4
        for index in which:
            marker, (px, py) = self.markers[index], predicted[index]
            x, y = found[index]
            if not math.hypot(x - px, y - py) <= 1.5 * self.flow.reach_px:
                continue
            reading = marker.read(luma, x, y)
            speed = math.hypot(px - marker.x_px, py - marker.y_px)
            reasons[index] = marker.gauge.judge(reading, speed_px=speed)
            if reading is not None and math.hypot(reading.x_px - x, reading.y_px - y) > marker.radius_px:
                reasons[index] = reasons[index] or "hidden"
            readings[index] = reading
        return readings, reasons

    # --- judgement ------------------------------------------------------------------------------------------------

    def _check_length(
        self, stick: int, readings: list[Reading | None], reasons: list[str], predicted: list[Point]
    ) -> None:
        """Refuse the marker of a stick that is further from its prediction where their distance is not right."""
        i, j = 2 * stick, 2 * stick + 1
        a, b = readings[i], readings[j]
        if reasons[i] or reasons[j] or a is None or b is None:
            return
        length = math.hypot(b.x_px - a.x_px, b.y_px - a.y_px)
        stale = min(self.markers[i].lost + self.markers[j].lost, 20)
        tolerance = 0.8 + 0.01 * self.length_px[stick] * (1.0 + 0.5 * stale)
        if abs(length - self.length_px[stick]) <= tolerance:
            return
        off = [math.hypot(r.x_px - predicted[k][0], r.y_px - predicted[k][1]) for r, k in ((a, i), (b, j))]
        if max(off) > 2.0 * min(off) + 0.5:
            reasons[i if off[0] > off[1] else j] = "hidden"
        else:
            reasons[i] = reasons[j] = "hidden"

    def _judge_base(
        self,
        luma: NDArray[np.uint8],
        predicted: list[Point],
        readings: list[Reading | None],
        reasons: list[str],
    ) -> None:
        base = 2 * (1 - self._moving)
        ends = self._moving_ends(predicted, readings, reasons)
        for index in (base, base + 1):
            if self._covered(self.markers[index], ends):
                self._vote(index, reasons[index], ends)
                reasons[index] = "shadowed"
        self._check_length(1 - self._moving, readings, reasons, predicted)
        seen = [i for i in (base, base + 1) if not reasons[i]]
        moves = [self._move(i, readings) for i in seen]
        if len(seen) == 2:
            apart = math.hypot(moves[0][0] - moves[1][0], moves[0][1] - moves[1][1])
            turned = abs(
                math.remainder(_reading_direction(readings, base) - self.reference_rad[1 - self._moving], math.tau)
            )
            if apart > 2.5 or max(math.hypot(*m) for m in moves) > _SHAKE_PX + 2.0 or turned > _BASE_TURN_RAD:
                for i in seen:
                    reasons[i] = "lost"
        elif len(seen) == 1 and math.hypot(*moves[0]) > 0.5 * _SHAKE_PX:
            reasons[seen[0]] = "lost"
        if any(reasons[i] in ("", "shadowed", "dark") for i in (base, base + 1)):
            return
        self._find_base(luma, base, predicted, readings, reasons)

    def _find_base(
        self,
        luma: NDArray[np.uint8],
        base: int,
        predicted: list[Point],
        readings: list[Reading | None],
        reasons: list[str],
    ) -> None:
        """Look for the base stick nearby: a bumped camera carries it away but hardly turns it."""
        a, b = self.markers[base], self.markers[base + 1]
        if a.lost > 3 and a.lost % 4:
            return
        stick = 1 - self._moving
        middle = Region(0.5 * (a.x_px + b.x_px), 0.5 * (a.y_px + b.y_px), 0.5 * self.length_px[stick] + 45.0)
        pairs = [
            pair
            for pair in self._pairs(luma, stick, middle)
            if abs(math.remainder(pair.direction_rad - self.reference_rad[stick], math.tau)) < _BASE_TURN_RAD
            and min(self._distance_to_moving(pair.inner), self._distance_to_moving(pair.outer)) > 4.0
        ]
        if len(pairs) != 1:
            return
        pair = pairs[0]
        dx, dy = pair.inner.x_px - a.x_px, pair.inner.y_px - a.y_px
        readings[base], readings[base + 1] = pair.inner, pair.outer
        reasons[base] = reasons[base + 1] = ""
        moving = (2 * self._moving, 2 * self._moving + 1)
        if all(reasons[i] for i in moving):
            # The whole picture jumped: look for the moving stick where the jump puts it.
            for i in moving:
                predicted[i] = (predicted[i][0] + dx, predicted[i][1] + dy)
            again, why = self._read(luma, predicted, moving)
            for i in moving:
                readings[i], reasons[i] = again[i], why[i]

    def _judge_moving(
        self,
        luma: NDArray[np.uint8],
        predicted: list[Point],
        readings: list[Reading | None],
        reasons: list[str],
    ) -> None:
        first = 2 * self._moving
        self._check_length(self._moving, readings, reasons, predicted)
        for index in (first, first + 1):
            reading = readings[index]
            if reasons[index] or reading is None:
                continue
            crossed = self._crossing(reading)
            self.on_top = max(-20, min(20, self.on_top + crossed))
            if self._near_base_dot(reading, 0.6 if self.markers[index].lost <= 3 else 1.6) and self.on_top < 2:
                reasons[index] = "shadowed"
            elif self.markers[index].lost and self._off_circle(reading, outer=index % 2 == 1):
                reasons[index] = "hidden"
        both_lost = all(self.markers[i].lost > 5 for i in (first, first + 1))
        seen = [i for i in (first, first + 1) if not reasons[i]]
        if len(seen) == 1 and both_lost:
            # One dot alone, after a gap, could be anything that is round.
            reasons[seen[0]] = "lost"
            seen = []
        if not seen and not all(reasons[i] == "dark" for i in (first, first + 1)):
            self._find_moving(luma, first, readings, reasons)

    def _find_moving(
        self, luma: NDArray[np.uint8], first: int, readings: list[Reading | None], reasons: list[str]
    ) -> None:
        a, b = self.markers[first], self.markers[first + 1]
        if a.lost > 20 and a.lost % 3:
            return
        centre = self.axis.centre
        if centre is not None:
            arm = self.axis.arm(outer=True)
            region = Region(centre[0] + self.shift[0], centre[1] + self.shift[1], 1.15 * arm + 20.0)
        else:
            reach = 1.5 * self.length_px[self._moving] + 40.0
            region = Region(0.5 * (a.x_px + b.x_px), 0.5 * (a.y_px + b.y_px), reach)
        pairs = [
            pair
            for pair in self._pairs(luma, self._moving, region)
            if not self._near_base_dot(pair.inner)
            and not self._near_base_dot(pair.outer)
            and not self._off_circle(pair.inner, outer=False)
            and not self._off_circle(pair.outer, outer=True)
        ]
        if len(pairs) == 1:
            readings[first], readings[first + 1] = pairs[0].inner, pairs[0].outer
            reasons[first] = reasons[first + 1] = ""

    def _pairs(self, luma: NDArray[np.uint8], stick: int, region: Region) -> list[Found]:
        a, b = self.markers[2 * stick], self.markers[2 * stick + 1]
        shape = getattr(a.template, "shape", None)
        if shape is None:
            return []
        places = places_like(luma, radius_px=a.radius_px, light_dot=shape.contrast > 0, region=region)
        return pairs_at_distance(
            luma,
            places,
            inner=a,
            outer=b,
            length_px=self.length_px[stick],
            tolerance_px=1.5 + 0.05 * self.length_px[stick],
        )

    # --- geometry -------------------------------------------------------------------------------------------------

    def _is_base(self, index: int) -> bool:
        return self.moving is not None and index // 2 != self.moving

    @property
    def _moving(self) -> int:
        return 1 if self.moving is None else self.moving

    def _direction(self, stick: int) -> float:
        a, b = self.markers[2 * stick], self.markers[2 * stick + 1]
        return math.atan2(b.y_px - a.y_px, b.x_px - a.x_px)

    def _length(self, stick: int) -> float:
        a, b = self.markers[2 * stick], self.markers[2 * stick + 1]
        return math.hypot(b.x_px - a.x_px, b.y_px - a.y_px)

    def _move(self, index: int, readings: list[Reading | None]) -> Point:
        reading, marker = readings[index], self.markers[index]
        return (0.0, 0.0) if reading is None else (reading.x_px - marker.x_px, reading.y_px - marker.y_px)

    def _moving_ends(
        self, predicted: list[Point], readings: list[Reading | None], reasons: list[str]
    ) -> tuple[Point, Point]:
        ends: list[Point] = []
        for index in (2 * self._moving, 2 * self._moving + 1):
            reading = readings[index]
            good = reading is not None and not reasons[index]
            ends.append((reading.x_px, reading.y_px) if good and reading is not None else predicted[index])
        return ends[0], ends[1]

    def _covered(self, marker: Marker, ends: tuple[Point, Point]) -> bool:
        """Return whether the moving stick's strip reaches a marker of the base."""
        width = self.markers[2 * self._moving].template.window_px
        away = _distance_to_strip((marker.x_px, marker.y_px), ends, beyond=0.6)
        return away < marker.radius_px + width + 2.5

    def _vote(self, index: int, reason: str, ends: tuple[Point, Point]) -> None:
        """Learn which stick lies on top: a base dot seen whole right under the moving strip is above it."""
        marker = self.markers[index]
        here = (marker.x_px, marker.y_px)
        if min(math.dist(here, end) for end in ends) < 2.5 * marker.radius_px:
            return
        if _distance_to_strip(here, ends, beyond=0.0) < 0.4 * marker.radius_px:
            self.on_top += 1 if reason == "hidden" else -1 if not reason else 0
            self.on_top = max(-20, min(20, self.on_top))

    def _crossing(self, reading: Reading) -> int:
        """Return 1 for a moving marker seen whole in the middle of the base stick, away from its dots: it is above."""
        base = 2 * (1 - self._moving)
        inner, outer = self.markers[base : base + 2]
        here = (reading.x_px, reading.y_px)
        ends = ((inner.x_px, inner.y_px), (outer.x_px, outer.y_px))
        if self._near_base_dot(reading, 0.6):
            return 0
        return 1 if _distance_to_strip(here, ends, beyond=0.1) < 1.2 * inner.radius_px else 0

    def _near_base_dot(self, reading: Reading, radii: float = 1.6) -> bool:
        base = 2 * (1 - self._moving)
        return any(m.distance(reading.x_px, reading.y_px) < radii * m.radius_px for m in self.markers[base : base + 2])

    def _distance_to_moving(self, reading: Reading) -> float:
        first = 2 * self._moving
        return min(
            m.distance(reading.x_px, reading.y_px) if not m.lost else math.inf for m in self.markers[first : first + 2]
        )

    def _off_circle(self, reading: Reading, *, outer: bool) -> bool:
        centre = self.axis.centre
        if centre is None:
            return False
        arm = self.axis.arm(outer=outer)
        away = math.hypot(reading.x_px - centre[0] - self.shift[0], reading.y_px - centre[1] - self.shift[1])
        return abs(away - arm) > 0.1 * arm + 5.0

    # --- bookkeeping ----------------------------------------------------------------------------------------------

    def _note(
        self,
        time_s: float,
        predicted: list[Point],
        readings: list[Reading | None],
        reasons: list[str],
    ) -> None:
        for index, marker in enumerate(self.markers):
            reading = readings[index]
            if reasons[index] or reading is None:
                readings[index] = None
                marker.miss(*self._assumed(index, predicted, readings, reasons))
                continue
            marker.take(time_s, reading)
        for stick in (0, 1):
            if not reasons[2 * stick] and not reasons[2 * stick + 1]:
                self.length_px[stick] += 0.2 * (self._length(stick) - self.length_px[stick])
        if self.moving is None:
            self._look_for_motion(reasons)
        else:
            self._learn_axis(reasons)

    def _assumed(self, index: int, predicted: list[Point], readings: list[Reading | None], reasons: list[str]) -> Point:
        """Return where a marker is taken to be that was not read: a base marker goes with the other one."""
        other = index ^ 1
        reading, partner = readings[other], self.markers[other]
        if not self._is_base(index):
            return predicted[index]
        marker = self.markers[index]
        if reasons[other] or reading is None:
            return marker.x_px, marker.y_px
        angle, length = self.reference_rad[1 - self._moving], self.length_px[1 - self._moving]
        sign = 1.0 if index % 2 else -1.0
        del partner
        return reading.x_px + sign * length * math.cos(angle), reading.y_px + sign * length * math.sin(angle)

    def _look_for_motion(self, reasons: list[str]) -> None:
        if any(reasons):
            return
        turned = [abs(math.remainder(self._direction(stick) - self.start_rad[stick], math.tau)) for stick in (0, 1)]
        for stick in (0, 1):
            if turned[stick] > _MOVED_RAD + 3.0 * turned[1 - stick]:
                self.moving = stick
                self.reference_rad[1 - stick] = self._direction(1 - stick)
                self._origin()

    def _origin(self) -> None:
        base = self.markers[2 * (1 - self._moving)]
        self.shift = (0.0, 0.0)
        self._zero: Point = (base.x_px, base.y_px)

    def _learn_axis(self, reasons: list[str]) -> None:
        base, first = 2 * (1 - self._moving), 2 * self._moving
        if not hasattr(self, "_zero"):
            self._origin()
        marker = self.markers[base]
        self.shift = (marker.x_px - self._zero[0], marker.y_px - self._zero[1])
        if not reasons[first] and not reasons[first + 1]:
            a, b = self.markers[first], self.markers[first + 1]
            dx, dy = self.shift
            self.axis.add((a.x_px - dx, a.y_px - dy), (b.x_px - dx, b.y_px - dy))

    def to_state(self) -> dict[str, Any]:
        """Return everything that :meth:`restore` needs to go on in the same way."""
        return {
            "markers": [marker.to_state() for marker in self.markers],
            "moving": self.moving,
            "start_rad": self.start_rad,
            "reference_rad": self.reference_rad,
            "length_px": self.length_px,
            "axis": self.axis.to_state(),
            "shift": list(self.shift),
            "zero": list(getattr(self, "_zero", ())),
            "on_top": self.on_top,
        }


def _direction(a: Point, b: Point) -> float:
    return math.atan2(b[1] - a[1], b[0] - a[0])


def _reading_direction(readings: list[Reading | None], first: int) -> float:
    a, b = readings[first], readings[first + 1]
    return math.nan if a is None or b is None else math.atan2(b.y_px - a.y_px, b.x_px - a.x_px)


def _distance_to_strip(point: Point, ends: tuple[Point, Point], *, beyond: float) -> float:
    """Return the distance of a point from a stick's line, drawn out by a share of its length on both sides."""
    (ax, ay), (bx, by) = ends
    ux, uy = bx - ax, by - ay
    along = ((point[0] - ax) * ux + (point[1] - ay) * uy) / max(ux * ux + uy * uy, 1e-9)
    along = min(max(along, -beyond), 1.0 + beyond)
    return math.hypot(point[0] - ax - along * ux, point[1] - ay - along * uy)


def _row(time_s: float, readings: Sequence[Reading | None], reasons: Sequence[str]) -> NDArray[np.void]:
    row = np.zeros((), ROW)
    row["time_s"] = time_s
    for index, (reading, reason) in enumerate(zip(readings, reasons, strict=True)):
        row["state"][index] = CODE[reason or "seen"]
        if reading is None or reason:
            row["position_px"][index] = np.nan
            row["covariance_px2"][index] = np.nan
            continue
        row["position_px"][index] = reading.x_px, reading.y_px
        row["covariance_px2"][index] = reading.xx_px2, reading.xy_px2, reading.yy_px2
        row["light"][index], row["step"][index] = reading.light, reading.step
        row["residual"][index] = reading.residual
    return row
