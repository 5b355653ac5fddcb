"""A camera's pictures of a scene, frame by frame."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from torsight.core.series import rounding_variance
from torsight.core.units import DEG, Floats, Ints
from torsight.synthetic.filming.camera_work import Bar, marker_points
from torsight.synthetic.filming.optics import View
from torsight.synthetic.filming.picture import MARGIN_PX, Canvas, Stick, draw_bar, draw_stick, expose, row_spans
from torsight.synthetic.scene import LightSettings, Scene


class Studio:
    """Draws one camera's picture: a fixed background with the base stick, the moving stick, occluders, noise."""

    def __init__(self, scene: Scene, view: View, *, purpose: str) -> None:
        self._scene, self._view = scene, view
        self._rays = view.rays(MARGIN_PX)
        self._rng = scene.rng(f"picture noise {purpose}")
        # The pool from which a frame's noise is taken: fourteen frames of VGA, 16 MB.
        self._noise = self._rng.standard_normal(1 << 22, dtype=np.float32)
        width, height = view.intrinsics.size_px
        self._light = _light(scene, width, height)
        self._texture = _texture(scene, width, height)
        # The area of a pixel blurs an edge like a box of width one.
        self._blur_px = math.sqrt(scene.light.blur_px**2 + rounding_variance())
        heights = (scene.camera.base_z_mm, scene.camera.moving_z_mm)
        self._planes = [view.plane_from_ray(z_mm) for z_mm in heights]
        sticks = scene.sticks
        stick = [sticks.length_mm, 0.5 * sticks.width_mm, 0.5 * sticks.width_mm, sticks.inner_mm, sticks.outer_mm]
        look = [sticks.dot_mm, sticks.level, sticks.dot_level]
        self._base_shape = np.array([*stick, *look, 0.0, 0.0])
        self._moving_shape = np.array([*stick, *look, sticks.hub_mm, sticks.hub_level])
        self._still: NDArray[np.float32] | None = None

    def frame(
        self, stick_rad: Floats, *, shift_px: Floats, gain: float, bars: list[Bar], lit: bool
    ) -> NDArray[np.uint8]:
        """Return one frame (h, w).

        ``stick_rad`` (n,) is the moving stick less the base stick at evenly spaced moments while the shutter is open,
        ``shift_px`` by how much the picture has moved, ``gain`` the frame's light; the bars stand in front.
        """
        picture = self._set(shift_px)
        self._draw(picture, 1, stick_rad, shift_px)
        led = self._scene.led
        if led.radius_px > 0.0:
            place = np.array(led.position_px) + shift_px
            level = led.level if lit else 40.0
            draw_bar(picture, self._light, np.array([*place, *place]), led.radius_px, level, self._blur_px)
        for bar in bars:
            draw_bar(picture, self._light, bar.ends_px, bar.radius_px, bar.level, 2.0 * self._blur_px)
        out = np.empty(picture.shape, np.uint8)
        light = self._scene.light
        # A random section of a pool of normal numbers: new numbers for each frame would take longer than the rest.
        start = int(self._rng.integers(self._noise.size - out.size))
        noise = self._noise[start : start + out.size]
        expose(picture, np.float32(gain), np.float32(light.read_noise), np.float32(light.shot_noise), noise, out)
        return out

    def poses(self, speed_rad: float) -> int:
        """Return the number of poses that represent the stick's path of ``speed_rad`` while the shutter is open."""
        jacobian = self._view.jacobian(np.array([0.0, 0.0, self._scene.camera.moving_z_mm]))
        px_per_mm = float(np.sqrt(abs(np.linalg.det(jacobian))))
        reach_px = abs(speed_rad) * self._scene.sticks.length_mm * px_per_mm
        # Half of the usual lens' blur apart; 24 are enough for a smear of 8 px.
        step_px = 0.5 * LightSettings().blur_px
        return int(min(max(math.ceil(reach_px / step_px), 1), 24))

    def _set(self, shift_px: Floats) -> NDArray[np.float32]:
        """Return the background with the base stick, which is drawn only once for a camera that does not shake."""
        if not np.any(shift_px):
            if self._still is None:
                self._still = self._draw_set(shift_px)
            return self._still.copy()
        return self._draw_set(shift_px)

    def _draw_set(self, shift_px: Floats) -> NDArray[np.float32]:
        width, height = self._view.intrinsics.size_px
        move = np.array([[1.0, 0.0, shift_px[0] - MARGIN_PX], [0.0, 1.0, shift_px[1] - MARGIN_PX]])
        moved = cv2.warpAffine(self._texture, move, (width, height), flags=cv2.INTER_LINEAR)
        picture: NDArray[np.float32] = np.multiply(moved, self._light, dtype=np.float32)
        light = self._scene.light
        if light.plate_mm > 0.0:
            plate = np.zeros(10)
            plate[8:] = light.plate_mm, light.plate_level
            self._draw(picture, 0, np.zeros(1), shift_px, shape=plate)
        self._draw(picture, 0, np.zeros(1), shift_px)
        return picture

    def _draw(
        self, picture: NDArray[np.float32], stick: int, stick_rad: Floats, shift_px: Floats, shape: Floats | None = None
    ) -> None:
        directions = self._scene.sticks.base_deg * DEG + stick_rad
        if shape is None:
            shape = self._moving_shape if stick else self._base_shape
        z_mm = self._scene.camera.moving_z_mm if stick else self._scene.camera.base_z_mm
        first_row, spans = self._area(directions, z_mm, shape, shift_px)
        turns = np.column_stack([np.cos(directions), np.sin(directions)])
        drawn = Stick(self._planes[stick], turns, shape, self._scale(directions.mean(), z_mm, shape))
        draw_stick(Canvas(picture, self._light, self._rays, shift_px, self._blur_px), drawn, first_row, spans)

    def _scale(self, direction: float, z_mm: float, shape: Floats) -> Floats:
        """Return the plane's metric at the stick's middle and at its markers."""
        unit = np.array([math.cos(direction), math.sin(direction), 0.0])
        rows = []
        for radius in (0.5 * shape[0], shape[3], shape[4]):
            to_mm = np.linalg.inv(self._view.jacobian(radius * unit + np.array([0.0, 0.0, z_mm])))
            metric = to_mm @ to_mm.T
            rows.append([metric[0, 0], metric[0, 1], metric[1, 1]])
        return np.array(rows)

    def _area(self, directions: Floats, z_mm: float, shape: Floats, shift_px: Floats) -> tuple[int, Ints]:
        """Return the pixels that a stick can touch: the first row, and the range of columns in each row."""
        corners = []
        for direction in directions:
            u = np.array([math.cos(direction), math.sin(direction)])
            v = np.array([-u[1], u[0]])
            corners += [along * u + across * v for along in (-shape[2], shape[0]) for across in (-shape[1], shape[1])]
        if shape[8] > 0.0:
            corners += [shape[8] * np.array(place) for place in ((1, 1), (1, -1), (-1, 1), (-1, -1))]
        points = np.column_stack([np.array(corners), np.full(len(corners), z_mm)])
        seen = self._view.project(points) + shift_px
        hull = cv2.convexHull(seen.astype(np.float32)).reshape(-1, 2).astype(np.float64)
        # Margin for blur, and for the curvature of straight edges by distortion.
        reach = 5.0 * self._blur_px + 2.0
        width, height = self._view.intrinsics.size_px
        first = max(int(np.floor(hull[:, 1].min() - reach)), 0)
        last = min(int(np.ceil(hull[:, 1].max() + reach)) + 1, height)
        return first, row_spans(hull, reach, width, first, max(last - first, 0))

    def first_markers(self, stick_rad: float, shift_px: Floats) -> Floats:
        """Return the positions of the four markers in the picture (4, 2), px."""
        return self._view.project(marker_points(self._scene, stick_rad)) + shift_px


def _light(scene: Scene, width: int, height: int) -> NDArray[np.float32]:
    """Return the relative light (h, w): brighter to one side, with a bow across it."""
    x, y = np.meshgrid(np.linspace(-1.0, 1.0, width), np.linspace(-1.0, 1.0, height))
    towards = scene.light.uneven_towards_deg * DEG
    along = (math.cos(towards) * x - math.sin(towards) * y) / math.sqrt(2.0)
    across = (math.sin(towards) * x + math.cos(towards) * y) / math.sqrt(2.0)
    field = 1.0 + scene.light.uneven * (0.5 * along - 0.25 * across**2)
    return field.astype(np.float32)


def _texture(scene: Scene, width: int, height: int) -> NDArray[np.float32]:
    """Return the background's grey levels before light, with a margin."""
    size = (height + 2 * MARGIN_PX, width + 2 * MARGIN_PX)
    level = np.full(size, scene.light.background, np.float32)
    if scene.light.texture == 0.0:
        return level
    grain = scene.rng("texture").standard_normal(size, dtype=np.float32)
    smooth = cv2.GaussianBlur(grain, (0, 0), scene.light.grain_px, borderType=cv2.BORDER_REFLECT)
    return np.clip(level + smooth * np.float32(scene.light.texture / smooth.std()), 0.0, 255.0)
