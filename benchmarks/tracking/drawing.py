"""Films of two sticks for the tracking benchmarks, drawn by exact areas of polygons: a renderer of its own.

Every outline (stick, dot, hand, wire) is a polygon, carried through the camera corner by corner, and every pixel takes
the share of its square that the polygon covers, exactly. Nothing here is shared with the other two renderers of the
project (samples of rays, edge functions), nor with the code that is measured.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np
from numba import njit

TICKS = 90000
_ROWS = 4
"""Rows that are drawn at one instant."""


@dataclass(frozen=True)
class Cover:
    """A hand (a wide bar) or a wire (a thin one) over a target for some seconds.

    ``target`` is an index of a marker or "moving" for both of the moving stick; ``follows`` tells whether it goes with
    the target or stays where the target was at the start.
    """

    start_s: float
    end_s: float
    target: int | str
    half_px: float
    level: float
    follows: bool = True


@dataclass(frozen=True)
class Film:
    """A rig, how it moves and how it is filmed; lengths in px of the picture at the axis, seen straight from above."""

    name: str
    angle_deg: Callable[[np.ndarray], np.ndarray]
    seed: int = 5
    frames: int = 200
    fps: float = 30.0
    size: tuple[int, int] = (640, 480)
    base_deg: float = 205.0
    base_px: tuple[float, float] = (58.0, 150.0)
    moving_px: tuple[float, float] = (52.0, 138.0)
    radius_px: float = 6.5
    half_px: float = 11.0
    stick: float = 196.0
    dot: float = 34.0
    ground: float = 96.0
    texture: float = 10.0
    noise: float = 2.0
    blur_px: float = 0.6
    uneven: float = 0.2
    tilt_deg: float = 0.0
    tilt_towards_deg: float = 35.0
    distance: float = 700.0
    k1: float = 0.0
    moving_z: float = 9.0
    camera: bool = True
    given: bool = True
    base_on_top: bool = False
    exposure: float = 0.0
    row_s: float = 0.0
    read_along: int = 1
    averaged_grey: float = 0.0
    flicker: float = 0.0
    shake_px: float = 0.0
    bump_px: tuple[float, float, float] | None = None
    dark_s: tuple[float, float] | None = None
    drop: float = 0.0
    jitter: float = 0.0
    covers: list[Cover] = field(default_factory=list)
    crf: int | None = 18
    turn_camera_deg: float = 0.0
    offset_mm: tuple[float, float] = (0.0, 0.0)

    # --- camera -------------------------------------------------------------------------------------------------

    @property
    def rotation(self) -> np.ndarray:
        """Camera from world: looks down the axis, tilted."""
        towards = np.deg2rad(self.tilt_towards_deg)
        tilt = _rotation(np.array([np.cos(towards), np.sin(towards), 0.0]) * np.deg2rad(self.tilt_deg))
        roll = _rotation(np.array([0.0, 0.0, 1.0]) * np.deg2rad(self.turn_camera_deg))
        return roll @ tilt @ np.diag([1.0, -1.0, -1.0])

    @property
    def translation(self) -> np.ndarray:
        """The world's origin in the camera."""
        return np.array([*self.offset_mm, self.distance])

    @property
    def middle(self) -> np.ndarray:
        """Principal point."""
        return np.array([(self.size[0] - 1) / 2.0 + 3.0, (self.size[1] - 1) / 2.0 - 2.0])

    def project(self, points: np.ndarray) -> np.ndarray:
        """World (n, 3) to pixels (n, 2)."""
        seen = points @ self.rotation.T + self.translation
        flat = seen[:, :2] / seen[:, 2:]
        flat = flat * (1.0 + self.k1 * np.sum(flat**2, axis=1, keepdims=True))
        return self.distance * flat + self.middle

    def plane_point(self, pixels: np.ndarray, z: float) -> np.ndarray:
        """Pixels (n, 2) to world x, y in the plane at height z."""
        bent = (pixels - self.middle) / self.distance
        flat = bent.copy()
        for _ in range(40 if self.k1 else 0):
            flat = bent / (1.0 + self.k1 * np.sum(flat**2, axis=1, keepdims=True))
        rays = np.column_stack([flat, np.ones(len(flat))]) @ self.rotation
        eye = -self.rotation.T @ self.translation
        reach = (z - eye[2]) / rays[:, 2]
        return (eye + reach[:, None] * rays)[:, :2]

    # --- truth ----------------------------------------------------------------------------------------------------

    @property
    def times_s(self) -> np.ndarray:
        """Timestamps of the frames: some are dropped, some late."""
        rng = np.random.default_rng([self.seed, 3])
        index = np.arange(self.frames, dtype=float)
        kept = rng.random(self.frames) >= self.drop
        kept[0] = True
        late = self.jitter * rng.uniform(-0.45, 0.45, self.frames)
        late[0] = 0.0
        return np.round((index + late)[kept] / self.fps * TICKS) / TICKS

    def centres_mm(self, angle_deg: float) -> np.ndarray:
        """World positions (4, 3) of the markers."""
        points = []
        for radii, turn, z in ((self.base_px, 0.0, 0.0), (self.moving_px, angle_deg, self.moving_z)):
            a = np.deg2rad(self.base_deg + turn)
            points += [[radius * np.cos(a), radius * np.sin(a), z] for radius in radii]
        return np.array(points)

    def shifts_px(self) -> np.ndarray:
        """By how much the picture moves in each frame."""
        rng = np.random.default_rng([self.seed, 4])
        times = self.times_s
        shift = rng.normal(0.0, 1.0, (len(times), 2)) * self.shake_px
        if self.bump_px is not None:
            shift[times >= self.bump_px[0]] += self.bump_px[1:]
        return shift

    def markers_px(self) -> np.ndarray:
        """Return where the markers are seen (n, 4, 2)."""
        shift = self.shifts_px()[:, None, :]
        when = np.repeat(self.times_s[:, None], 4, axis=1)
        # A rolling shutter sees each marker at the instant of the row at which it then is.
        for _ in range(5 if self.row_s else 1):
            seen = np.array(
                [[self.project(self.centres_mm(a))[k] for k, a in enumerate(self.angle_deg(t))] for t in when]
            )
            when = self.times_s[:, None] + (seen + shift)[..., self.read_along] * self.row_s
        return seen + shift

    def camera_toml(self) -> str:
        """Return the camera file."""
        rvec = cv2.Rodrigues(self.rotation)[0].ravel().tolist()
        return (
            f"{self.lens_toml('intrinsics')}[pose]\nrvec = {rvec}\ntvec_mm = {self.translation.tolist()}\n"
            f"[planes]\nbase_z_mm = 0.0\nmoving_z_mm = {self.moving_z}\n"
        )

    def lens_toml(self, table: str) -> str:
        """Return the lens as a table of a camera file."""
        f, (cx, cy) = self.distance, self.middle.tolist()
        return (
            f"[{table}]\nwidth = {self.size[0]}\nheight = {self.size[1]}\nfx_px = {f}\nfy_px = {f}\n"
            f"cx_px = {cx}\ncy_px = {cy}\ndistortion = [{self.k1}, 0, 0, 0, 0]\n"
        )

    def pair_toml(self, right: Film) -> str:
        """Return the camera file of this film as the left and another as the right one of a pair."""
        turn = right.rotation @ self.rotation.T
        move = right.translation - turn @ self.translation
        rvec = cv2.Rodrigues(turn)[0].ravel().tolist()
        return (
            f"{self.lens_toml('intrinsics')}{right.lens_toml('right.intrinsics')}"
            f"[right.from_left]\nrvec = {rvec}\ntvec_mm = {move.tolist()}\n"
        )

    def markers_toml(self) -> str:
        """Return where a person would click."""
        rng = np.random.default_rng([self.seed, 5])
        places = np.round(self.markers_px()[0] + rng.uniform(-1.5, 1.5, (4, 2)), 1).tolist()
        return f"base = {places[:2]}\nmoving = {places[2:]}\n"

    # --- pictures -------------------------------------------------------------------------------------------------

    def pictures(self) -> Iterator[np.ndarray]:
        """Draw the frames, (h, w) uint8."""
        rng = np.random.default_rng([self.seed, 6])
        width, height = self.size
        ground = _ground(rng, width + 80, height + 80) * self.texture + self.ground
        y, x = np.mgrid[:height, :width]
        light = 1.0 + self.uneven * (0.9 * x / width - 0.7 * y / height - 0.1)
        held: np.ndarray | None = None
        for time_s, shift in zip(self.times_s, self.shifts_px(), strict=True):
            ox, oy = np.round(shift).astype(int)
            picture = ground[40 - oy : 40 - oy + height, 40 - ox : 40 - ox + width].astype(np.float32)
            if self.row_s:
                for at in range(0, self.size[self.read_along], _ROWS):
                    part = picture[:, at : at + _ROWS] if self.read_along == 0 else picture[at : at + _ROWS]
                    before = np.array([at, 0.0] if self.read_along == 0 else [0.0, at])
                    part[:] = self._exposed(part, time_s + (at + 0.5 * (_ROWS - 1)) * self.row_s, shift - before)
            else:
                picture = self._exposed(picture, float(time_s), shift)
            for cover in self.covers:
                if cover.start_s <= time_s < cover.end_s:
                    self._cover(picture, cover, float(time_s), shift)
            if self.blur_px > 0:
                picture = cv2.GaussianBlur(picture, (0, 0), self.blur_px)
            gain = 1.0 + self.flicker * np.sin(2.0 * np.pi * 8.7 * time_s)
            if self.dark_s is not None and self.dark_s[0] <= time_s < self.dark_s[1]:
                gain = 0.01
            picture = picture * light * gain + rng.normal(0.0, self.noise, picture.shape)
            if self.averaged_grey:
                held = picture if held is None else held + self._taken(picture - held) * (picture - held)
                picture = held
            yield np.clip(np.rint(picture), 0, 255).astype(np.uint8)

    def _taken(self, change: np.ndarray) -> np.ndarray:
        """Return the share of a change that a camera lets through which averages frames where they change little."""
        return np.clip(0.3 + 0.7 * np.abs(cv2.blur(change, (3, 3))) / self.averaged_grey, 0.3, 1.0)

    def _exposed(self, picture: np.ndarray, time_s: float, shift: np.ndarray) -> np.ndarray:
        instants = self._instants(time_s)
        if len(instants) == 1:
            return self._draw(picture, instants[0], shift)
        return np.mean([self._draw(picture.copy(), t, shift) for t in instants], axis=0)

    def _instants(self, time_s: float) -> np.ndarray:
        if self.exposure <= 0.0:
            return np.array([time_s])
        half = 0.5 * self.exposure / self.fps
        ends = self.angle_deg(np.array([time_s - half, time_s + half]))
        path = abs(float(np.deg2rad(ends[1] - ends[0]))) * self.moving_px[1]
        count = int(np.clip(np.ceil(2.0 * path), 1, 40))
        return time_s + ((np.arange(count) + 0.5) / count - 0.5) * 2.0 * half

    def _draw(self, picture: np.ndarray, time_s: float, shift: np.ndarray) -> np.ndarray:
        angle = float(self.angle_deg(np.array([time_s]))[0])
        sticks = [(self.base_px, 0.0, 0.0, self.stick), (self.moving_px, angle, self.moving_z, 0.96 * self.stick)]
        for radii, turn, z, level in sticks[::-1] if self.base_on_top else sticks:
            a = np.deg2rad(self.base_deg + turn)
            along, across = np.array([np.cos(a), np.sin(a)]), np.array([-np.sin(a), np.cos(a)])
            tail, end = -0.2 * radii[1], radii[1] + 2.2 * self.half_px
            steps = np.linspace(0.0, 1.0, 12)
            sides = [(tail + (end - tail) * steps, -self.half_px), (end + (tail - end) * steps, self.half_px)]
            outline = np.concatenate([np.outer(s, along) + side * across for s, side in sides])
            self._fill(picture, outline, z, level, shift)
            for radius in radii:
                self._fill(picture, radius * along + self.radius_px * _CIRCLE, z, self.dot, shift)
        self._fill(picture, 1.3 * self.half_px * _CIRCLE, self.moving_z, 0.8 * self.ground, shift)
        return picture

    def _fill(self, picture: np.ndarray, outline: np.ndarray, z: float, level: float, shift: np.ndarray) -> None:
        corners = self.project(np.column_stack([outline, np.full(len(outline), z)])) + shift
        fill(picture, corners, np.float32(level))

    def _cover(self, picture: np.ndarray, cover: Cover, time_s: float, shift: np.ndarray) -> None:
        when = time_s if cover.follows else cover.start_s
        seen = self.project(self.centres_mm(float(self.angle_deg(np.array([when]))[0]))) + shift
        stick = seen[2:] if cover.target in ("moving", 2, 3) else seen[:2]
        u = (stick[1] - stick[0]) / np.hypot(*(stick[1] - stick[0]))
        v = np.array([-u[1], u[0]])
        ends, beyond = stick, cover.half_px
        if cover.target != "moving":
            # Across the stick, not quite at a right angle.
            ends, beyond = seen[[int(cover.target)] * 2], 90.0
            u, v = 0.26 * u + 0.97 * v, 0.97 * u - 0.26 * v
        a, b = ends[0] - beyond * u, ends[1] + beyond * u
        wave = cover.half_px * (1.0 + 0.12 * np.sin(np.arange(16) * 1.9))
        steps = np.linspace(0.0, 1.0, 16)[:, None]
        sides = a + steps * (b - a) + wave[:, None] * v, b + steps * (a - b) - wave[:, None] * v
        fill(picture, np.concatenate(sides), np.float32(cover.level))


_TURN = np.arange(72) * np.pi / 36.0
# A polygon of 72 corners has 0.13 % less area than its circle.
_CIRCLE = np.column_stack([np.cos(_TURN), np.sin(_TURN)]) * 1.00064


def _rotation(vector: np.ndarray) -> np.ndarray:
    return np.asarray(cv2.Rodrigues(vector)[0])


def _ground(rng: np.random.Generator, width: int, height: int) -> np.ndarray:
    total = np.zeros((height, width))
    for size in (3, 7, 19):
        coarse = rng.normal(0.0, 1.0, (height // size + 2, width // size + 2))
        total += cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC)
    return total / total.std()


@njit(cache=True)
def fill(picture, corners, level):  # noqa: ANN001, ANN201
    """Lay a polygon over a picture: each pixel takes the share of its square that lies inside, exactly."""
    height, width = picture.shape
    x0, x1 = max(int(np.floor(corners[:, 0].min())), 0), min(int(np.ceil(corners[:, 0].max())) + 2, width)
    y0, y1 = max(int(np.floor(corners[:, 1].min())), 0), min(int(np.ceil(corners[:, 1].max())) + 2, height)
    if x0 >= x1 or y0 >= y1:
        return
    part = np.zeros((y1 - y0, x1 - x0 + 1))
    count = len(corners)
    for k in range(count):
        # The square of pixel i reaches from i − 0.5 to i + 0.5.
        ax, ay = corners[k, 0] + 0.5 - x0, corners[k, 1] + 0.5 - y0
        bx, by = corners[(k + 1) % count, 0] + 0.5 - x0, corners[(k + 1) % count, 1] + 0.5 - y0
        if ay == by:
            continue
        sign = 1.0
        if ay > by:
            ax, ay, bx, by, sign = bx, by, ax, ay, -1.0
        slope = (bx - ax) / (by - ay)
        for row in range(max(0, int(np.floor(ay))), min(part.shape[0], int(np.ceil(by)))):
            top, bottom = max(ay, row), min(by, row + 1.0)
            if bottom <= top:
                continue
            p, q = ax + slope * (top - ay), ax + slope * (bottom - ay)
            if p > q:
                p, q = q, p
            _edge(part[row], p, q, sign * (bottom - top))
    for row in range(part.shape[0]):
        total = 0.0
        for column in range(x1 - x0):
            total += part[row, column]
            share = min(abs(total), 1.0)
            picture[y0 + row, x0 + column] += share * (level - picture[y0 + row, x0 + column])


@njit(cache=True)
def _edge(row, p, q, height):  # noqa: ANN001, ANN202
    """Add what lies right of an edge that falls from x = p to x = q within one row, as differences along the row."""
    last = len(row) - 1
    p, q = min(max(p, 0.0), last - 1e-9), min(max(q, 0.0), last - 1e-9)
    first, final = int(p), int(q)
    before = 0.0
    for column in range(first, final + 1):
        # Mean over the pixel of the share of the edge's height that lies left of the point.
        left, right = max(p, column), min(q, column + 1.0)
        if q - p < 1e-12:
            covered = column + 1.0 - p
        else:
            a, b = (left - p) / (q - p), (right - p) / (q - p)
            covered = 0.5 * (a + b) * (right - left) + (column + 1.0 - right)
        row[column] += height * (covered - before)
        before = covered
    if final + 1 <= last:
        row[final + 1] += height * (1.0 - before)


def write_film(film: Film, path: Path) -> Path:
    """Encode a film with its timestamps: H.264 at its CRF, or lossless."""
    codec = "ffv1" if film.crf is None else "libx264"
    path = path.with_suffix(".mkv" if film.crf is None else ".mp4")
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=round(film.fps))
        stream.width, stream.height = film.size
        stream.pix_fmt = "gray" if film.crf is None else "yuv420p"
        if film.crf is not None:
            stream.options = {"crf": str(film.crf), "preset": "veryfast"}
        stream.codec_context.time_base = Fraction(1, TICKS)
        for time_s, picture in zip(film.times_s, film.pictures(), strict=True):
            if film.crf is None:
                frame = av.VideoFrame.from_ndarray(picture, format="gray")
            else:
                planes = np.full((film.size[1] * 3 // 2, film.size[0]), 128, np.uint8)
                planes[: film.size[1]] = picture
                frame = av.VideoFrame.from_ndarray(planes, format="yuv420p")
            frame.pts, frame.time_base = round(float(time_s) * TICKS), Fraction(1, TICKS)
            for packet in stream.encode(frame):
                container.mux(packet)
        for packet in stream.encode(None):
            container.mux(packet)
    return path
