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
class Hand:
    """A hand with its forearm that comes from a point beyond a border within ``in_s``, stays, and goes back."""

    start_s: float
    end_s: float
    to_px: tuple[float, float]
    from_px: tuple[float, float]
    in_s: float = 0.4
    palm_px: float = 62.0
    level: float = 165.0
    tremor_px: float = 1.5


@dataclass(frozen=True)
class Lamp:
    """A lamp's reflection at a place of the picture from an instant on; it saturates what is nearer than its radius."""

    at_px: tuple[float, float]
    radius_px: float
    start_s: float = 1.0


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
    covers: list[Cover | Hand] = field(default_factory=list)
    lamps: list[Lamp] = field(default_factory=list)
    screws: list[tuple[int, float, float]] = field(default_factory=list)
    """Stick, place along and across it, of further dots."""
    clicked: dict[int, int] = field(default_factory=dict)
    """Screws that are given in place of markers."""
    overhang: float = 2.2
    carried: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]] | None = None
    """By what the picture is turned and scaled about its middle, and shifted: complex numbers at instants."""
    shown: Callable[[np.ndarray], np.ndarray] | None = None
    """Instants at which the pictures were taken that the frames show."""
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
        return np.concatenate(
            [self._on_stick(stick, [(r, 0.0) for r in self._radii(stick)], angle_deg) for stick in (0, 1)]
        )

    def _radii(self, stick: int) -> tuple[float, float]:
        return (self.base_px, self.moving_px)[stick]

    def _on_stick(self, stick: int, places: list[tuple[float, float]], angle_deg: float) -> np.ndarray:
        """World positions (n, 3) of places along and across a stick."""
        turn = np.exp(1j * np.deg2rad(self.base_deg + stick * angle_deg))
        at = np.array([complex(*place) for place in places]) * turn
        return np.column_stack([at.real, at.imag, np.full(len(at), stick * self.moving_z)])

    def motions(self) -> np.ndarray:
        """Return the affine maps (n, 2, 3) by which the picture moves in each frame."""
        rng = np.random.default_rng([self.seed, 4])
        times = self.times_s
        shift = rng.normal(0.0, 1.0, (len(times), 2)) * self.shake_px
        if self.bump_px is not None:
            shift[times >= self.bump_px[0]] += self.bump_px[1:]
        turn, off = np.ones(len(times), complex), shift[:, 0] + 1j * shift[:, 1]
        if self.carried is not None:
            turn, moved = self.carried(times)
            off = off + moved + (1.0 - turn) * complex(*self.middle)
        return np.stack([[turn.real, -turn.imag, off.real], [turn.imag, turn.real, off.imag]]).transpose(2, 0, 1)

    def markers_px(self) -> np.ndarray:
        """Return where the markers are seen (n, 4, 2)."""
        motions = self.motions()
        when = np.repeat(self.times_s[:, None], 4, axis=1)
        # A rolling shutter sees each marker at the instant of the row at which it then is.
        for _ in range(5 if self.row_s else 1):
            seen = np.array(
                [[self.project(self.centres_mm(a))[k] for k, a in enumerate(self.angle_deg(t))] for t in when]
            )
            seen = np.einsum("nij,nkj->nki", motions[..., :2], seen) + motions[:, None, :, 2]
            when = self.times_s[:, None] + seen[..., self.read_along] * self.row_s
        return seen

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
        at = self.markers_px()[0]
        for marker, screw in self.clicked.items():
            stick, *place = self.screws[screw]
            at[marker] = self.project(self._on_stick(stick, [tuple(place)], float(self.angle_deg(np.zeros(1))[0])))[0]
        places = np.round(at + rng.uniform(-1.5, 1.5, (4, 2)), 1).tolist()
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
        taken_s = self.times_s if self.shown is None else self.shown(self.times_s)
        seen = np.zeros((height, width), np.uint8)
        for number, (time_s, by) in enumerate(zip(taken_s, self.motions(), strict=True)):
            if number and time_s == taken_s[number - 1]:
                yield seen
                continue
            gain = 1.0 + self.flicker * np.sin(2.0 * np.pi * 8.7 * time_s)
            if self.dark_s is not None and self.dark_s[0] <= time_s < self.dark_s[1]:
                gain = 0.01
            picture = self._lit(ground, float(time_s), by) * light * gain + rng.normal(0.0, self.noise, light.shape)
            if self.averaged_grey:
                held = picture if held is None else held + self._taken(picture - held) * (picture - held)
                picture = held
            for lamp in self.lamps:
                near = np.hypot(x - lamp.at_px[0], y - lamp.at_px[1]) - lamp.radius_px
                picture = picture + 400.0 * (time_s >= lamp.start_s) / (1.0 + np.exp(np.clip(near / 3.0, -50.0, 50.0)))
            seen = np.clip(np.rint(picture), 0, 255).astype(np.uint8)
            yield seen

    def _lit(self, ground: np.ndarray, time_s: float, by: np.ndarray) -> np.ndarray:
        """Draw what the lens shows of a scene in even light."""
        place = np.column_stack([by[:, :2], by[:, 2] - by[:, :2] @ [40.0, 40.0]])
        how = {"flags": cv2.INTER_CUBIC, "borderMode": cv2.BORDER_REFLECT}
        picture = cv2.warpAffine(ground.astype(np.float32), place, self.size, **how)
        if self.row_s:
            for at in range(0, self.size[self.read_along], _ROWS):
                part = picture[:, at : at + _ROWS] if self.read_along == 0 else picture[at : at + _ROWS]
                before = np.array([at, 0.0] if self.read_along == 0 else [0.0, at])
                part[:] = self._exposed(part, time_s + (at + 0.5 * (_ROWS - 1)) * self.row_s, _moved(by, -before))
        else:
            picture = self._exposed(picture, time_s, by)
        for cover in self.covers:
            if cover.start_s <= time_s < cover.end_s:
                if isinstance(cover, Hand):
                    _reach(picture, cover, time_s)
                else:
                    self._cover(picture, cover, time_s, by)
        return cv2.GaussianBlur(picture, (0, 0), self.blur_px) if self.blur_px > 0 else picture

    def _taken(self, change: np.ndarray) -> np.ndarray:
        """Return the share of a change that a camera lets through which averages frames where they change little."""
        return np.clip(0.3 + 0.7 * np.abs(cv2.blur(change, (3, 3))) / self.averaged_grey, 0.3, 1.0)

    def _exposed(self, picture: np.ndarray, time_s: float, by: np.ndarray) -> np.ndarray:
        instants = self._instants(time_s)
        if len(instants) == 1:
            return self._draw(picture, instants[0], by)
        return np.mean([self._draw(picture.copy(), t, by) for t in instants], axis=0)

    def _instants(self, time_s: float) -> np.ndarray:
        if self.exposure <= 0.0:
            return np.array([time_s])
        half = 0.5 * self.exposure / self.fps
        ends = self.angle_deg(np.array([time_s - half, time_s + half]))
        path = abs(float(np.deg2rad(ends[1] - ends[0]))) * self.moving_px[1]
        count = int(np.clip(np.ceil(2.0 * path), 1, 40))
        return time_s + ((np.arange(count) + 0.5) / count - 0.5) * 2.0 * half

    def _draw(self, picture: np.ndarray, time_s: float, by: np.ndarray) -> np.ndarray:
        angle = float(self.angle_deg(np.array([time_s]))[0])
        sticks = [(self.base_px, 0.0, 0.0, self.stick), (self.moving_px, angle, self.moving_z, 0.96 * self.stick)]
        for radii, turn, z, level in sticks[::-1] if self.base_on_top else sticks:
            a = np.deg2rad(self.base_deg + turn)
            along, across = np.array([np.cos(a), np.sin(a)]), np.array([-np.sin(a), np.cos(a)])
            tail = min(-0.2 * radii[1], min(radii) - self.overhang * self.half_px)
            end = max(radii) + self.overhang * self.half_px
            steps = np.linspace(0.0, 1.0, 12)
            sides = [(tail + (end - tail) * steps, -self.half_px), (end + (tail - end) * steps, self.half_px)]
            outline = np.concatenate([np.outer(s, along) + side * across for s, side in sides])
            self._fill(picture, outline, z, level, by)
            for radius in radii:
                self._fill(picture, radius * along + self.radius_px * _CIRCLE, z, self.dot, by)
            own = [place for which, *place in self.screws if which == (z > 0.0)]
            for far, aside in own:
                self._fill(picture, far * along + aside * across + self.radius_px * _CIRCLE, z, self.dot, by)
        self._fill(picture, 1.3 * self.half_px * _CIRCLE, self.moving_z, 0.8 * self.ground, by)
        return picture

    def _fill(self, picture: np.ndarray, outline: np.ndarray, z: float, level: float, by: np.ndarray) -> None:
        corners = self.project(np.column_stack([outline, np.full(len(outline), z)]))
        fill(picture, corners @ by[:, :2].T + by[:, 2], np.float32(level))

    def _cover(self, picture: np.ndarray, cover: Cover, time_s: float, by: np.ndarray) -> None:
        when = time_s if cover.follows else cover.start_s
        seen = self.project(self.centres_mm(float(self.angle_deg(np.array([when]))[0]))) @ by[:, :2].T + by[:, 2]
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


def _moved(by: np.ndarray, step: np.ndarray) -> np.ndarray:
    return by + np.column_stack([np.zeros((2, 2)), step])


def _reach(picture: np.ndarray, hand: Hand, time_s: float) -> None:
    """Draw a hand: a forearm, a palm and four fingers."""
    share = np.clip(min(time_s - hand.start_s, hand.end_s - time_s) / hand.in_s, 0.0, 1.0)
    to, start, w = np.array(hand.to_px), np.array(hand.from_px), hand.palm_px
    u = (to - start) / np.hypot(*(to - start))
    v = np.array([-u[1], u[0]])
    at = start + share * (to - start) + hand.tremor_px * np.array([np.sin(44.0 * time_s), np.sin(31.0 * time_s)])
    bars = [(-900.0, 0.0, 0.0, 0.55 * w)] + [(0.0, 1.6 * w, side * w, 0.19 * w) for side in (-0.75, -0.25, 0.25, 0.75)]
    for tail, tip, side, half in bars:
        corners = [(tail, -half), (tip, -half), (tip, half), (tail, half)]
        fill(picture, np.array([at + a * u + (side + b) * v for a, b in corners]), np.float32(hand.level))
        fill(picture, at + tip * u + side * v + half * _CIRCLE, np.float32(hand.level))
    fill(picture, at + w * _CIRCLE, np.float32(0.96 * hand.level))


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
