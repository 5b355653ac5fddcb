"""The angle of one frame in real time; at the end of the recording the whole record is oriented again, like a film."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from torsight.core.optics.camera import Camera
from torsight.core.optics.geometry import carried, on_plane
from torsight.core.units import Floats
from tracker.appearance.lucas_kanade import RATE
from tracker.stick_direction import stick_direction

_Map = Callable[[Floats], tuple[Floats, Floats]]
"""From pixels (4, 2) to positions (4, 2) in a plane, y up, and their derivatives (4, 2, 2)."""


class LiveAngle:
    """Turns the markers of one frame after the other into the unwrapped angle.

    With a camera's pose, rays are intersected with the sticks' planes; without, the picture is the plane of motion.
    """

    def __init__(self, camera: Camera | None, *, pixel_aspect: float = 1.0) -> None:
        self._maps = _maps(camera, pixel_aspect)
        self._heights = (
            None if camera is None or camera.pose is None else (camera.pose.base_z_mm, camera.pose.moving_z_mm)
        )
        self._base_rad: float | None = None
        self._last: tuple[float, float] | None = None
        self._speed_rad_s = 0.0

    def step(self, time_s: float, position_px: Floats, covariance_px2: Floats) -> tuple[float, float, Floats | None]:
        """Return angle and its sigma (rad; NaN where not known) and positions in space.

        Markers (4, 2) are in the order of ``torsight.core.tracks.MARKERS``, NaN where not seen, with covariances (4,
        2, 2).
        """
        plane = [onto(position_px[2 * stick : 2 * stick + 2]) for stick, onto in enumerate(self._maps)]
        points = np.concatenate([position for position, _ in plane])
        slopes = np.concatenate([slope for _, slope in plane])
        spread = carried(covariance_px2, slopes)
        inner, outer = (points[::2], spread[::2]), (points[1::2], spread[1::2])
        (base_rad, moving_rad), (base_variance, variance) = (each.tolist() for each in stick_direction(inner, outer))
        self._learn_base(base_rad)
        position_mm = self._in_space(points)
        if self._base_rad is None or not math.isfinite(moving_rad):
            return math.nan, math.nan, position_mm
        angle = self._unwrapped(time_s, moving_rad - self._base_rad)
        held = base_variance if math.isfinite(base_variance) else 0.0
        # A running mean with the weight w of a new value has w / (2 − w) of its variance.
        return angle, math.sqrt(variance + RATE / (2.0 - RATE) * held), position_mm

    def _learn_base(self, base_rad: float) -> None:
        if not math.isfinite(base_rad):
            return
        if self._base_rad is None:
            self._base_rad = base_rad
        else:
            self._base_rad += RATE * math.remainder(base_rad - self._base_rad, math.tau)

    def _unwrapped(self, time_s: float, angle_rad: float) -> float:
        """Return the unwrapped angle nearest to the extrapolation from the recent speed."""
        if self._last is None:
            whole = math.remainder(angle_rad, math.tau)
        else:
            last_s, last_rad = self._last
            step_s = max(time_s - last_s, 1e-6)
            expected = last_rad + self._speed_rad_s * step_s
            whole = expected + math.remainder(angle_rad - expected, math.tau)
            # The speed over the last fifth of a second: the speed between two frames is mostly noise.
            self._speed_rad_s += min(1.0, step_s / 0.2) * ((whole - last_rad) / step_s - self._speed_rad_s)
        self._last = (time_s, whole)
        return whole

    def _in_space(self, points: Floats) -> Floats | None:
        if self._heights is None:
            return None
        height = np.repeat(self._heights, 2)
        return np.column_stack([points, np.where(np.isfinite(points[:, 0]), height, np.nan)])


def _maps(camera: Camera | None, pixel_aspect: float) -> tuple[_Map, _Map]:
    if camera is None or camera.pose is None:
        upwards = np.diag([pixel_aspect, -1.0])

        def flat(pixels: Floats) -> tuple[Floats, Floats]:
            return pixels @ upwards, np.broadcast_to(upwards, (len(pixels), 2, 2))

        return flat, flat
    pose, intrinsics = camera.pose, camera.intrinsics

    def onto(z_mm: float) -> _Map:
        def met(pixels: Floats) -> tuple[Floats, Floats]:
            found, slopes = on_plane(pixels, intrinsics, pose=pose, z_mm=z_mm)
            return found[:, :2], slopes

        return met

    return onto(pose.base_z_mm), onto(pose.moving_z_mm)
