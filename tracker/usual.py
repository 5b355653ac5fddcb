"""Frames of the usual kind, followed by the compiled kernel; the follower takes over where one is not."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from tracker import fields
from tracker.base import BaseStick
from tracker.compiled import FIELDS, X, Y
from tracker.marker import Marker
from tracker.moving import MovingStick
from tracker.rows import CODE, ROW
from tracker.swift import follow_frame

if TYPE_CHECKING:
    from tracker.follow import Follower

_CODES: Final = (CODE["seen"], CODE["shadowed"])
_GAUGE: Final = ("light", "step", "residual", "residual_spread", "patch", "patch_spread")


class UsualFrames:
    """The follower's state as the kernel wants it.

    It is taken over from the markers and sticks before a usual frame and given back before an unusual one, exactly.
    """

    def __init__(self, follower: Follower, base: BaseStick, moving: MovingStick) -> None:
        self._follower, self._base, self._moving = follower, base, moving
        self._markers = np.zeros((4, fields.MARKER_FIELDS))
        self._common = np.zeros(fields.COMMON_FIELDS)
        templates: list[Any] = [marker.template for marker in follower.markers]
        self._looks: Any = tuple(
            tuple(getattr(template, name) for template in templates)
            for name in ("pixels", "packed", "models", "extras")
        )
        self._readings = np.zeros((4, FIELDS))
        self._steps = np.zeros((4, 2))
        self._seen = np.zeros(4, np.bool_)
        self._rows = np.zeros(1, ROW)
        names = ("position_px", "covariance_px2", "light", "step", "residual", "state")
        self._row: Any = tuple(self._rows[name][0] for name in names)
        self._taken = False

    def step(self, time_s: float, luma: NDArray[np.uint8]) -> NDArray[np.void] | None:
        """Follow the markers into the next frame and return its row; None where the frame is not a usual one.

        The row is overwritten by the next frame's.
        """
        if not self._taken:
            if self._moving.inner.lost or self._moving.outer.lost:
                return None
            self._take_over()
        worth = follow_frame(
            luma, time_s, self._markers, self._common, self._looks, self._readings, self._steps, self._seen,
            self._moving.axis.seen, self._row, _CODES,
        )  # fmt: skip
        if worth == fields.UNUSUAL:
            self.give_back()
            return None
        if worth:
            self._learn(luma, worth)
        self._rows["time_s"] = time_s
        row: NDArray[np.void] = self._rows[0]
        return row

    def _learn(self, luma: NDArray[np.uint8], worth: int) -> None:
        """Learn what is seldom new: the shutter from fast markers, the axis from directions not seen yet."""
        i, j = self._moving.indices
        places = self._readings[:, X : Y + 1].tolist()
        shutter = self._follower.shutter
        for index, look in ((i, fields.LOOK_INNER), (j, fields.LOOK_OUTER)):
            if worth & look:
                path = self._steps[index].tolist()
                shutter.look(self._follower.markers[index], luma, tuple(places[index]), tuple(path))
        shutter.count = int(self._common[fields.FAST])
        self._take_shutter()
        if worth & fields.LOOK_AXIS:
            sx, sy = self._common[fields.SHIFT : fields.SHIFT + 2].tolist()
            (ax, ay), (bx, by) = places[i], places[j]
            self._moving.axis.add((ax - sx, ay - sy), (bx - sx, by - sy))
            self._take_axis()

    def _take_shutter(self) -> None:
        common, shutter = self._common, self._follower.shutter
        common[fields.SHARE], common[fields.SHUTTER_KNOWN] = shutter.share, shutter.known
        common[fields.FAST], common[fields.EVERY] = shutter.count, shutter.every

    def _take_over(self) -> None:
        follower, base, moving, common = self._follower, self._base, self._moving, self._common
        for values, marker in zip(self._markers, follower.markers, strict=True):
            _pack(values, marker)
        common[fields.SHIFT : fields.SHIFT + 2] = base.shift
        common[fields.ZERO : fields.ZERO + 4] = [*base.zero[0], *base.zero[1]]
        common[fields.REFERENCE], common[fields.LAST] = base.reference_rad, base.last_rad
        for pair in (base, moving):
            common[fields.LENGTH + pair.stick] = pair.length_px
            at = fields.RANGE + 2 * pair.stick
            common[at], common[at + 1] = pair.shortest_px, pair.longest_px
        common[fields.BRIGHTNESS], common[fields.ABOVE] = follower.brightness, moving.above
        self._take_shutter()
        common[fields.MOVING] = moving.stick
        common[fields.OFFSET] = moving.offset is not None
        common[fields.OFFSET + 1 : fields.OFFSET + 3] = moving.offset or (0.0, 0.0)
        self._take_axis()
        self._taken = True

    def _take_axis(self) -> None:
        solution = self._moving.axis.solution
        self._common[fields.AXIS] = solution is not None
        if solution is not None:
            self._common[fields.AXIS + 1 : fields.AXIS + 7] = solution
        self._common[fields.AXIS_LAST] = self._moving.axis.last_rad

    def give_back(self) -> None:
        """Bring the state back into the markers and sticks."""
        if not self._taken:
            return
        follower, base, moving = self._follower, self._base, self._moving
        for values, marker in zip(self._markers, follower.markers, strict=True):
            _unpack(values.tolist(), marker)
        common = self._common.tolist()
        base.shift = (common[fields.SHIFT], common[fields.SHIFT + 1])
        base.last_rad, base.anchor = common[fields.LAST], None
        for pair in (base, moving):
            pair.length_px = common[fields.LENGTH + pair.stick]
            at = fields.RANGE + 2 * pair.stick
            pair.shortest_px, pair.longest_px = common[at], common[at + 1]
        follower.shutter.count = int(common[fields.FAST])
        follower.brightness, moving.above = common[fields.BRIGHTNESS], int(common[fields.ABOVE])
        known = common[fields.OFFSET] > 0.0
        moving.offset = (common[fields.OFFSET + 1], common[fields.OFFSET + 2]) if known else None
        self._taken = False


def _pack(values: NDArray[np.float64], marker: Marker) -> None:
    template: Any = marker.template
    count = len(marker.history)
    values[:4] = marker.x_px, marker.y_px, marker.lost, count
    values[fields.HISTORY : fields.HISTORY + 3 * count] = np.array(marker.history).ravel()
    values[fields.MISSES : fields.MISSES + 4] = marker.misses
    values[fields.GAUGE : fields.GAUGE + 6] = [getattr(marker.gauge, name) for name in _GAUGE]
    values[fields.SLOPE : fields.SLOPE + 2] = marker.view.slope_x, marker.view.slope_y
    values[fields.CHANGE : fields.CHANGE + 3] = marker.change
    values[fields.OWN_RADIUS], values[fields.FIRST_RADIUS] = marker.radius_px, template.first.radius_px


def _unpack(values: list[float], marker: Marker) -> None:
    marker.x_px, marker.y_px, marker.lost = values[0], values[1], int(values[2])
    at = fields.HISTORY
    marker.history = [
        (values[at + 3 * k], values[at + 3 * k + 1], values[at + 3 * k + 2]) for k in range(int(values[fields.COUNT]))
    ]
    marker.misses = values[fields.MISSES : fields.MISSES + 4]
    for name, value in zip(_GAUGE, values[fields.GAUGE : fields.GAUGE + 6], strict=True):
        setattr(marker.gauge, name, value)
    marker.view = marker.view._replace(slope_x=values[fields.SLOPE], slope_y=values[fields.SLOPE + 1])
    marker.change = (values[fields.CHANGE], values[fields.CHANGE + 1], values[fields.CHANGE + 2])
