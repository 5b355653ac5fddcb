"""Films of two sticks with known angles, drawn pixel by pixel: nothing here uses the code under test.

World: mm, z along the rotation axis towards the camera, x to the right and y up as displayed. Every pixel is sampled
at several points (and instants, for smear), each of which looks up which surface its ray meets first. Imported as
``tests.tracker.films`` everywhere: numba asks for kept code by the module's name that compiled it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import av
import numba
import numpy as np

LOSSLESS = ("ffv1", "rawvideo")
_BLOCK = 8
"""Samples are drawn in squares of so many: most of them see ground only."""


@dataclass
class Cover:
    """Something that lies over a stick or a marker for a while.

    ``target`` is "moving", "base", or a marker's name; ``kind`` is "hand" (a blob) or "wire" (a dark line).
    """

    start_s: float
    end_s: float
    target: str
    kind: str = "hand"
    size_px: float = 18.0


@dataclass
class Rig:
    """The scene and how it is filmed; lengths in px of the undistorted, untilted picture (scale 1 px = 1 mm)."""

    angle_deg: Callable[[np.ndarray], np.ndarray]
    seed: int = 1
    size: tuple[int, int] = (320, 240)
    frames: int = 60
    fps: float = 30.0
    base_deg: float = 200.0
    base_px: tuple[float, float] = (30.0, 80.0)
    moving_px: tuple[float, float] = (26.0, 76.0)
    off_deg: tuple[float, float] = (0.0, 0.0)
    radius_px: float = 5.0
    base_radius_px: float | None = None
    half_width_px: float = 8.5
    overhang_px: float = 14.0
    stick: float = 185.0
    dot: float = 45.0
    ground: float = 95.0
    texture: float = 8.0
    noise: float = 2.0
    uneven: float = 0.2
    hub_px: float = 10.0
    base_z: float = 0.0
    moving_z: float = 6.0
    tilt_deg: tuple[float, float] = (0.0, 0.0)
    distance: float = 600.0
    k1: float = 0.0
    base_on_top: bool = False
    shake_px: float = 0.0
    bump: tuple[float, float, float] | None = None
    flicker: float = 0.0
    dark_s: tuple[float, float] | None = None
    exposure: float = 0.0
    covers: list[Cover] = field(default_factory=list)
    drop: tuple[int, ...] = ()
    jitter: float = 0.0
    samples: int = 2
    centre: tuple[float, float] | None = None
    extra_dots: list[tuple[float, float, float]] = field(default_factory=list)

    # --- camera -------------------------------------------------------------------------------------------------

    @property
    def middle(self) -> tuple[float, float]:
        return self.centre or ((self.size[0] - 1) / 2.0, (self.size[1] - 1) / 2.0)

    @property
    def rotation(self) -> np.ndarray:
        return _tilted(self.tilt_deg)

    @property
    def translation(self) -> np.ndarray:
        return np.array([0.0, 0.0, self.distance])

    def project(self, points: np.ndarray) -> np.ndarray:
        """World points (..., 3) to pixels (..., 2)."""
        seen = points @ self.rotation.T + self.translation
        plane = seen[..., :2] / seen[..., 2:]
        square = np.sum(plane**2, axis=-1, keepdims=True)
        return self.distance * plane * (1.0 + self.k1 * square) + np.array(self.middle)

    def planes(self, x: np.ndarray, y: np.ndarray) -> tuple[tuple[np.ndarray, np.ndarray], ...]:
        """World x, y where the rays of pixels meet the ground, the base's plane and the moving stick's plane."""
        u, v = (x - self.middle[0]) / self.distance, (y - self.middle[1]) / self.distance
        a, b = u.copy(), v.copy()
        for _ in range(12 if self.k1 else 0):
            factor = 1.0 + self.k1 * (a * a + b * b)
            a, b = u / factor, v / factor
        rotation = self.rotation
        eye = -rotation.T @ self.translation
        direction = [rotation[0, i] * a + rotation[1, i] * b + rotation[2, i] for i in range(3)]
        found = []
        for z in (self.base_z, self.moving_z):
            reach = (z - eye[2]) / direction[2]
            points = (eye[0] + reach * direction[0], eye[1] + reach * direction[1])
            found.append(tuple(axis.astype(np.float32) for axis in points))
        return tuple(found)

    # --- truth ----------------------------------------------------------------------------------------------------

    @property
    def times(self) -> np.ndarray:
        rng = np.random.default_rng(self.seed + 77)
        index = np.array([i for i in range(self.frames) if i not in self.drop], float)
        return (index + self.jitter * rng.uniform(-0.45, 0.45, len(index))) / self.fps

    @property
    def truth_deg(self) -> np.ndarray:
        return self.angle_deg(self.times)

    def marker_px(self, angle_deg: float | np.ndarray) -> np.ndarray:
        """Pixel positions (4, 2), or (..., 4, 2), of the markers without shaking, in the order of the contract."""
        moving_deg = self.base_deg + np.asarray(angle_deg, float)
        base_deg = np.full_like(moving_deg, self.base_deg)
        turn = np.deg2rad(np.stack([base_deg, base_deg, moving_deg, moving_deg], axis=-1))
        radii, z = np.array([*self.base_px, *self.moving_px]), [self.base_z] * 2 + [self.moving_z] * 2
        return self.project(np.stack([radii * np.cos(turn), radii * np.sin(turn), np.broadcast_to(z, turn.shape)], -1))

    def camera_toml(self) -> str:
        r = _rotation_vector(self.rotation)
        f, (cx, cy) = self.distance, self.middle
        return (
            f"[intrinsics]\nwidth = {self.size[0]}\nheight = {self.size[1]}\nfx_px = {f}\nfy_px = {f}\n"
            f"cx_px = {cx}\ncy_px = {cy}\ndistortion = [{self.k1}, 0, 0, 0, 0]\n"
            f"[pose]\nrvec = {r.tolist()}\ntvec_mm = {self.translation.tolist()}\n"
            f"[planes]\nbase_z_mm = {self.base_z}\nmoving_z_mm = {self.moving_z}\n"
        )

    def pair_toml(self, right: Rig) -> str:
        """Return the camera file of this rig as the left camera and another one as the right."""
        turn = right.rotation @ self.rotation.T
        move = right.translation - turn @ self.translation
        head = self.camera_toml().split("[pose]")[0]
        lens = right.camera_toml().split("[pose]")[0].replace("[intrinsics]", "[right.intrinsics]")
        rvec = _rotation_vector(turn).tolist()
        return f"{head}{lens}[right.from_left]\nrvec = {rvec}\ntvec_mm = {move.tolist()}\n"

    def markers_toml(self) -> str:
        p = np.round(self.marker_px(float(self.truth_deg[0])), 1).tolist()
        return f"base = {p[:2]}\nmoving = {p[2:]}\n"

    # --- picture --------------------------------------------------------------------------------------------------

    def pictures(self) -> Iterator[np.ndarray]:
        """Draw the frames, (h, w) uint8."""
        rng = np.random.default_rng(self.seed)
        width, height = self.size
        ground = _texture(rng, height + 40, width + 40) * self.texture + self.ground
        shakes = rng.normal(0.0, 1.0, (self.frames, 2)) * self.shake_px
        fine = (np.arange(self.samples) + 0.5) / self.samples - 0.5
        columns, rows = self._part()
        xs = (np.arange(width)[columns, None] + fine).ravel()
        ys = (np.arange(height)[rows, None] + fine).ravel()
        still = self.planes(*np.meshgrid(xs, ys))
        light = self._light(width, height)
        shift, under = None, None
        for number, time_s in enumerate(self.times):
            dx, dy = shakes[number]
            if self.bump is not None and time_s >= self.bump[0]:
                dx, dy = dx + self.bump[1], dy + self.bump[2]
            planes = still if dx == dy == 0 else self.planes(*np.meshgrid(xs - dx, ys - dy))
            if (dx, dy) != shift:
                shift, under = (dx, dy), self._under(ground, dx, dy)
            picture = self._expose(planes, under, time_s)
            gain = 1.0 + self.flicker * np.sin(2 * np.pi * 7.3 * time_s)
            if self.dark_s is not None and self.dark_s[0] <= time_s < self.dark_s[1]:
                gain *= 0.02
            yield _developed(picture, light, float(gain), rng.standard_normal(picture.shape), float(self.noise))

    def _part(self) -> tuple[slice, slice]:
        """Return the part of the picture in which anything but ground can be seen."""
        reach = 1.12 * max(self.base_px[1], self.moving_px[1]) + self.overhang_px + self.half_width_px + 25.0
        reach += 0.0 if self.bump is None else max(abs(self.bump[1]), abs(self.bump[2]))
        for x, y, r in self.extra_dots:
            reach = max(reach, np.hypot(x, y) + r + 5.0)
        spans = []
        for middle, length in zip(self.middle, self.size, strict=True):
            spans.append(slice(max(0, int(middle - reach)), min(length, int(middle + reach) + 1)))
        return spans[0], spans[1]

    def _light(self, width: int, height: int) -> np.ndarray:
        y, x = np.mgrid[:height, :width]
        return 1.0 + self.uneven * ((x / width - 0.5) + 0.6 * (y / height - 0.5))

    def _under(self, ground, dx: float, dy: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the ground as a camera that is moved so far sees it, and the samples to draw the rest on."""
        width, height = self.size
        i = np.clip(np.rint(np.arange(height) - dy).astype(int) + 20, 0, height + 39)
        j = np.clip(np.rint(np.arange(width) - dx).astype(int) + 20, 0, width + 39)
        whole = ground[np.ix_(i, j)]
        columns, rows = self._part()
        return whole, _sampled(whole[rows, columns], self.samples)

    def _expose(self, planes, under, time_s: float) -> np.ndarray:
        if self.exposure <= 0:
            instants = np.array([time_s])
        else:
            speed = abs(
                float(
                    self.angle_deg(np.array([time_s + 0.5 / self.fps]))[0]
                    - self.angle_deg(np.array([time_s - 0.5 / self.fps]))[0]
                )
            )
            count = int(np.clip(np.ceil(np.deg2rad(speed) * self.moving_px[1] * self.exposure * 2), 1, 24))
            instants = time_s + ((np.arange(count) + 0.5) / count - 0.5) * self.exposure / self.fps
        total = 0.0
        for instant in instants:
            total = total + self._sharp(planes, under, float(instant))
        return total / len(instants)

    def _sharp(self, planes, under, time_s: float) -> np.ndarray:
        s = self.samples
        angle = float(self.angle_deg(np.array([time_s]))[0])
        whole, picture = (one.copy() for one in under)
        columns, rows = self._part()
        layers = [
            (planes[0], self.base_deg, self.base_px, self.stick, self.base_radius_px or self.radius_px),
            (planes[1], self.base_deg + angle, self.moving_px, 0.97 * self.stick, self.radius_px),
        ]
        if self.base_on_top:
            layers.reverse()
        for plane, turn, radii, brightness, dot_px in layers:
            way = (math.cos(math.radians(turn)), math.sin(math.radians(turn)))
            ends = (-float(self.overhang_px), float(radii[1] + self.overhang_px))
            _draw_stick(picture, *plane, way, ends, float(self.half_width_px), float(brightness), s)
            for radius in radii:
                self._blend(picture, plane, (radius * way[0], radius * way[1], dot_px), self.dot)
        if self.hub_px:
            self._blend(picture, planes[1], (0.0, 0.0, self.hub_px), self.ground * 0.9)
        for dot in self.extra_dots:
            self._blend(picture, planes[0], dot, self.dot)
        for cover in self.covers:
            if cover.start_s <= time_s < cover.end_s:
                self._draw_cover(picture, planes[1], cover, angle)
        _averaged(picture, s, whole[rows, columns])
        return whole

    def _blend(self, picture, plane, disc: tuple[float, float, float], brightness: float) -> None:
        x, y, radius = disc
        _draw_disc(picture, *plane, (float(x), float(y), float(radius)), float(brightness), self.samples)

    def _draw_cover(self, picture, plane, cover: Cover, angle: float) -> None:
        spots = self._spots(angle)
        x, y = plane
        for spot in {"moving": spots[2:], "base": spots[:2]}.get(cover.target) or [
            spots[("base_inner", "base_outer", "moving_inner", "moving_outer").index(cover.target)]
        ]:
            if cover.kind == "hand":
                on = (x - spot[0] - 3) ** 2 + 0.7 * (y - spot[1] + 2) ** 2 < cover.size_px**2
                picture[on] = 130.0 + 6.0 * np.sin(0.4 * x[on] + 0.3 * y[on])
            else:
                on = np.abs((x - spot[0]) * 0.8 + (y - spot[1]) * 0.6) < cover.size_px
                picture[on] = 20.0

    def _spots(self, angle: float) -> list[tuple[float, float]]:
        spots = []
        for radii, turn in ((self.base_px, self.base_deg), (self.moving_px, self.base_deg + angle)):
            a = np.deg2rad(turn)
            spots += [(r * np.cos(a), r * np.sin(a)) for r in radii]
        return spots


@numba.njit(cache=True)
def _slack(samples):
    """Return how far from a block's first sample nothing of the block lies any more, px."""
    return 3.0 * _BLOCK / samples


@numba.njit(cache=True)
def _draw_stick(picture, x, y, way, ends, half_width, brightness, samples):
    """Draw a bar along a direction, between two distances from the axis."""
    slack = _slack(samples)
    middle, half = 0.5 * (ends[0] + ends[1]), 0.5 * (ends[1] - ends[0])
    for top in range(0, picture.shape[0], _BLOCK):
        for left in range(0, picture.shape[1], _BLOCK):
            along = way[0] * x[top, left] + way[1] * y[top, left]
            across = way[0] * y[top, left] - way[1] * x[top, left]
            if abs(along - middle) > half + slack or abs(across) > half_width + slack:
                continue
            for i in range(top, min(top + _BLOCK, picture.shape[0])):
                for j in range(left, min(left + _BLOCK, picture.shape[1])):
                    along = way[0] * x[i, j] + way[1] * y[i, j]
                    across = way[0] * y[i, j] - way[1] * x[i, j]
                    if abs(across) < half_width and ends[0] < along < ends[1]:
                        picture[i, j] = brightness


@numba.njit(cache=True)
def _draw_disc(picture, x, y, disc, brightness, samples):
    """Draw a disc (centre, radius); samples on its rim take the share of their own area that it covers."""
    middle_x, middle_y, radius = disc
    slack = _slack(samples)
    for top in range(0, picture.shape[0], _BLOCK):
        for left in range(0, picture.shape[1], _BLOCK):
            if (x[top, left] - middle_x) ** 2 + (y[top, left] - middle_y) ** 2 > (radius + slack) ** 2:
                continue
            for i in range(top, min(top + _BLOCK, picture.shape[0])):
                for j in range(left, min(left + _BLOCK, picture.shape[1])):
                    away = np.hypot(x[i, j] - middle_x, y[i, j] - middle_y)
                    if away < radius + 1.0:
                        share = min(max((radius - away) * samples + 0.5, 0.0), 1.0)
                        picture[i, j] += share * (brightness - picture[i, j])


@numba.njit(cache=True)
def _sampled(picture, samples):
    """Return the samples of a picture of which each pixel is alike all over."""
    fine = np.empty((picture.shape[0] * samples, picture.shape[1] * samples), np.float32)
    for i in range(fine.shape[0]):
        for j in range(picture.shape[1]):
            for k in range(samples):
                fine[i, j * samples + k] = picture[i // samples, j]
    return fine


@numba.njit(cache=True)
def _averaged(fine, samples, picture):
    """Write into a picture the means of its pixels' samples."""
    for i in range(picture.shape[0]):
        for j in range(picture.shape[1]):
            total = 0.0
            for k in range(samples):
                for m in range(samples):
                    total += fine[i * samples + k, j * samples + m]
            picture[i, j] = total / samples**2


@numba.njit(cache=True)
def _developed(picture, light, gain, noise, sigma):
    """Return the grey levels that a sensor makes of light, under noise of a standard deviation."""
    found = np.empty(picture.shape, np.uint8)
    for i in range(picture.shape[0]):
        for j in range(picture.shape[1]):
            level = np.rint(picture[i, j] * light[i, j] * gain + noise[i, j] * sigma)
            found[i, j] = np.uint8(min(max(level, 0.0), 255.0))
    return found


@cache
def _tilted(tilt_deg: tuple[float, float]) -> np.ndarray:
    """Return the camera's rotation; once for all frames, whose markers each ask for it."""
    a, b = np.deg2rad(tilt_deg)
    about_x = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
    about_y = np.array([[np.cos(b), 0, np.sin(b)], [0, 1, 0], [-np.sin(b), 0, np.cos(b)]])
    return np.diag([1.0, -1.0, -1.0]) @ about_x @ about_y


def _rotation_vector(rotation: np.ndarray) -> np.ndarray:
    angle = np.arccos(np.clip((np.trace(rotation) - 1) / 2, -1, 1))
    _, vectors = np.linalg.eigh((rotation + rotation.T) / 2)
    axis = vectors[:, -1]
    best = min((axis * s for s in (1, -1)), key=lambda r: np.abs(_rodrigues(r * angle) - rotation).max())
    assert np.abs(_rodrigues(best * angle) - rotation).max() < 1e-6
    return best * angle


def _rodrigues(r: np.ndarray) -> np.ndarray:
    angle = np.linalg.norm(r)
    if angle == 0:
        return np.eye(3)
    k = r / angle
    cross = np.array([[0, -k[2], k[1]], [k[2], 0, -k[0]], [-k[1], k[0], 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def _texture(rng: np.random.Generator, height: int, width: int) -> np.ndarray:
    """Blotches of several sizes, unit spread."""
    total = np.zeros((height, width))
    for size in (4, 9, 23):
        coarse = rng.normal(0.0, 1.0, (height // size + 3, width // size + 3))
        y, x = np.arange(height) / size, np.arange(width) / size
        iy, ix = y.astype(int), x.astype(int)
        fy, fx = (y - iy)[:, None], (x - ix)[None, :]
        fy, fx = fy * fy * (3 - 2 * fy), fx * fx * (3 - 2 * fx)
        a = coarse[np.ix_(iy, ix)] * (1 - fx) + coarse[np.ix_(iy, ix + 1)] * fx
        b = coarse[np.ix_(iy + 1, ix)] * (1 - fx) + coarse[np.ix_(iy + 1, ix + 1)] * fx
        total += a * (1 - fy) + b * fy
    return total / total.std()


def write_film(
    rig: Rig, path: Path, *, codec: str = "rawvideo", crf: int | None = None, options: dict | None = None
) -> Path:
    """Encode a rig's frames with their times; returns the path.

    Without a codec they are stored as they are: to pack and unpack them takes half as long as to draw them.
    """
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=int(rig.fps))
        stream.width, stream.height = rig.size
        stream.pix_fmt = "gray" if codec in LOSSLESS else "yuvj420p" if codec == "mjpeg" else "yuv420p"
        stream.options = dict(options or {})
        if crf is not None:
            stream.options = {"crf": str(crf), "preset": "veryfast", **(options or {})}
        ticks = 90000
        from fractions import Fraction

        stream.codec_context.time_base = Fraction(1, ticks)
        times_s = rig.times
        for time_s, picture in zip(times_s, rig.pictures(), strict=True):
            frame = av.VideoFrame.from_ndarray(picture, format="gray")
            if stream.pix_fmt != "gray":
                frame = _as_luma(picture, stream.pix_fmt)
            frame.pts = round((time_s - times_s[0]) * ticks)
            frame.time_base = Fraction(1, ticks)
            for packet in stream.encode(frame):
                container.mux(packet)
        for packet in stream.encode(None):
            container.mux(packet)
    return path


def _as_luma(picture: np.ndarray, pix_fmt: str) -> av.VideoFrame:
    """Return a frame whose luma is the picture, unscaled, with neutral colour."""
    height, width = picture.shape
    planes = np.full((height * 3 // 2, width), 128, np.uint8)
    planes[:height] = picture
    return av.VideoFrame.from_ndarray(planes, format=pix_fmt)


def write_pictures(rig: Rig, folder: Path) -> Path:
    """Write a rig's frames as PNG files in a folder."""
    import cv2

    folder.mkdir(parents=True, exist_ok=True)
    for number, picture in enumerate(rig.pictures()):
        cv2.imwrite(str(folder / f"picture_{number:05d}.png"), picture)
    return folder
