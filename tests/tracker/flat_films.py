"""Films of flat things that turn: pictures of tags or textures, carried through a camera, with known angles.

Nothing here uses the code under test. A sprite (a picture with its size in mm) lies in the plane of a stick; every
instant of the exposure is drawn three times as fine as the film and averaged, blurred as by a lens, and made noisy.
World: mm, x to the right and y up as displayed, 1 mm = 1 px in the middle of a picture that is not tilted.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np

FINE = 3
LOSSLESS = ("ffv1", "rawvideo")


@dataclass
class Sprite:
    """A picture on a stick: its middle along and across the stick, its width, and its own turn on the stick."""

    picture: np.ndarray
    along_mm: float
    width_mm: float
    across_mm: float = 0.0
    turn_deg: float = 0.0


@dataclass
class Hand:
    """A grey blob over a place (mm) or over the moving stick ("moving") for some frames."""

    first: int
    last: int
    at_mm: tuple[float, float] | str
    radius_mm: float = 40.0
    level: float = 120.0


@dataclass
class FlatFilm:
    """Sprites of a base stick and of a moving one, and how they are filmed."""

    base: list[Sprite]
    moving: list[Sprite]
    angle_deg: Callable[[np.ndarray], np.ndarray]
    seed: int = 3
    size: tuple[int, int] = (320, 240)
    frames: int = 60
    fps: float = 30.0
    base_deg: float = 180.0
    ground: float = 150.0
    grain: float = 6.0
    noise: float = 2.0
    blur_px: float = 0.6
    exposure: float = 0.0
    tilt_deg: float = 0.0
    distance_mm: float = 700.0
    light: float = 0.15
    shift_mm: tuple[float, float] = (0.0, 0.0)
    hands: list[Hand] = field(default_factory=list)
    mirrored: bool = False
    enlarged: int = 1
    """How many times the pictures are larger than ``size``: details, noise and motion are larger alike."""

    @property
    def times(self) -> np.ndarray:
        return np.arange(self.frames) / self.fps

    @property
    def truth_deg(self) -> np.ndarray:
        return np.asarray(self.angle_deg(self.times), float) * np.ones(self.frames)

    def camera(self) -> np.ndarray:
        """World mm in the plane (x, y, 1) to pixels."""
        t = np.deg2rad(self.tilt_deg)
        # The plane is turned about the picture's x axis, then seen from a distance.
        plane = np.array([[1.0, 0.0, 0.0], [0.0, np.cos(t), 0.0], [0.0, np.sin(t), self.distance_mm]])
        plane[0, 2], plane[1, 2] = self.shift_mm
        cx, cy = (self.size[0] - 1) / 2.0, (self.size[1] - 1) / 2.0
        lens = np.array([[self.distance_mm, 0.0, cx], [0.0, -self.distance_mm, cy], [0.0, 0.0, 1.0]])
        return lens @ plane

    def on_stick(self, stick: int, angle_deg: float, along_mm: float, across_mm: float = 0.0) -> np.ndarray:
        """Pixel position of a point of a stick (0 base, 1 moving)."""
        seen = self.camera() @ _turned(self.base_deg + (angle_deg if stick else 0.0)) @ [along_mm, across_mm, 1.0]
        return (seen[:2] / seen[2] + 0.5) * self.enlarged - 0.5

    def pictures(self) -> Iterator[np.ndarray]:
        rng = np.random.default_rng(self.seed)
        width, height = self.size
        ground = (self.ground + self.grain * _blotches(rng, height * FINE, width * FINE)).astype(np.float32)
        y, x = np.mgrid[:height, :width]
        light = 1.0 + self.light * ((x / width - 0.5) + 0.5 * (y / height - 0.5))
        for number, time_s in enumerate(self.times):
            instants = [time_s]
            if self.exposure > 0.0:
                instants = time_s + self.exposure / self.fps * (np.arange(7) / 6.0 - 0.5)
            fine, *others = (self._sharp(ground, float(self.angle_deg(np.array(t))), number) for t in instants)
            if others:
                fine = sum(others, start=fine) / len(instants)
            picture = cv2.resize(fine, (width, height), interpolation=cv2.INTER_AREA)
            picture = cv2.GaussianBlur(picture, (0, 0), self.blur_px) * light
            picture = picture + rng.normal(0.0, self.noise, picture.shape)
            seen = np.clip(np.rint(picture), 0, 255).astype(np.uint8)
            seen = cv2.resize(seen, None, fx=self.enlarged, fy=self.enlarged, interpolation=cv2.INTER_CUBIC)
            yield np.ascontiguousarray(seen[:, ::-1]) if self.mirrored else seen

    def sprites(self, number: int) -> tuple[list[Sprite], list[Sprite]]:
        """Those of the base and of the moving stick in a frame."""
        del number
        return self.base, self.moving

    def _sharp(self, ground: np.ndarray, angle_deg: float, number: int) -> np.ndarray:
        fine = ground.copy()
        # Pixel i of the film covers the fine pixels FINE · i to FINE · i + FINE - 1.
        to_fine = np.array([[FINE, 0.0, (FINE - 1) / 2.0], [0.0, FINE, (FINE - 1) / 2.0], [0.0, 0.0, 1.0]])
        for sprites, turn_deg in zip(self.sprites(number), (self.base_deg, self.base_deg + angle_deg), strict=True):
            for sprite in sprites:
                _lay(fine, sprite, to_fine @ self.camera() @ _turned(turn_deg))
        for hand in self.hands:
            if hand.first <= number < hand.last:
                at = hand.at_mm
                if isinstance(at, str):
                    at = tuple((_turned(self.base_deg + angle_deg) @ [self.moving[0].along_mm, 0.0, 1.0])[:2])
                seen = to_fine @ self.camera() @ [*at, 1.0]
                place = tuple(int(v) for v in np.rint(seen[:2] / seen[2]))
                cv2.circle(fine, place, round(hand.radius_mm * FINE), hand.level, -1)
        return fine

    def write(self, path: Path, *, codec: str = "rawvideo", crf: int = 18) -> Path:
        """Write the film: pictures as they are, FFV1, or H.264 with its rate factor."""
        with av.open(str(path), "w") as container:
            stream = container.add_stream(codec, rate=Fraction(self.fps))
            stream.width, stream.height = width, height = [self.enlarged * side for side in self.size]
            stream.pix_fmt = "gray" if codec in LOSSLESS else "yuv420p"
            stream.options = {} if codec in LOSSLESS else {"crf": str(crf), "preset": "veryfast"}
            for number, picture in enumerate(self.pictures()):
                frame = av.VideoFrame.from_ndarray(picture, format="gray")
                if codec not in LOSSLESS:
                    planes = np.full((height * 3 // 2, width), 128, np.uint8)
                    planes[:height] = picture
                    frame = av.VideoFrame.from_ndarray(planes, format="yuv420p")
                frame.pts = number
                frame.time_base = 1 / Fraction(self.fps)
                container.mux(stream.encode(frame))
            container.mux(stream.encode(None))
        return path


def tag_picture(family: str, number: int, *, module: int = 16, white: float = 225.0, black: float = 25.0) -> np.ndarray:
    """Return a tag as OpenCV draws it, with a white border of one module."""
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_{family}"))
    bits = cv2.aruco.generateImageMarker(dictionary, number, dictionary.markerSize + 2) > 0
    fine = np.kron(np.pad(bits, 1, constant_values=True), np.ones((module, module)))
    return np.where(fine, white, black).astype(np.float32)


def tag(family: str, number: int, *, side_mm: float, **where: float) -> dict:
    """Keywords of a sprite whose black square has a side."""
    picture = tag_picture(family, number)
    return {"picture": picture, "width_mm": side_mm * picture.shape[1] / (picture.shape[1] - 32), **where}


def texture_picture(rng: np.random.Generator, height: int, width: int, *, contrast: float = 35.0) -> np.ndarray:
    """Blotches of several sizes."""
    return np.clip(150.0 + contrast * _blotches(rng, height, width), 5.0, 250.0).astype(np.float32)


def _blotches(rng: np.random.Generator, height: int, width: int) -> np.ndarray:
    total = np.zeros((height, width), np.float32)
    for size in (9, 21, 55):
        coarse = rng.normal(size=(height // size + 2, width // size + 2)).astype(np.float32)
        total += cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC)
    return total / total.std()


def _turned(turn_deg: float) -> np.ndarray:
    a = np.deg2rad(turn_deg)
    return np.array([[np.cos(a), -np.sin(a), 0.0], [np.sin(a), np.cos(a), 0.0], [0.0, 0.0, 1.0]])


def _lay(fine: np.ndarray, sprite: Sprite, stick: np.ndarray) -> None:
    """Draw a sprite over what is there; its rim is blended by the share that it covers."""
    rows, columns = sprite.picture.shape
    step = sprite.width_mm / columns
    # Sprite pixels (y down) to mm on the stick (y up).
    own = np.array([[step, 0.0, -step * (columns - 1) / 2], [0.0, -step, step * (rows - 1) / 2], [0.0, 0.0, 1.0]])
    placed = _turned(sprite.turn_deg) @ own
    placed[0, 2] += sprite.along_mm
    placed[1, 2] += sprite.across_mm
    warp = stick @ placed
    corners = warp @ np.array([[0, columns, columns, 0], [0, 0, rows, rows], [1, 1, 1, 1]], float)
    corners = corners[:2] / corners[2]
    x0, y0 = np.maximum(np.floor(corners.min(axis=1)).astype(int) - 2, 0)
    x1, y1 = np.minimum(np.ceil(corners.max(axis=1)).astype(int) + 3, fine.shape[::-1])
    if x1 <= x0 or y1 <= y0:
        return
    # Where the sprite's pixels are finer than the film's they are averaged first.
    scale = np.sqrt(abs(np.linalg.det(warp[:2, :2] / warp[2, 2])))
    picture = sprite.picture if scale > 0.5 else cv2.GaussianBlur(sprite.picture, (0, 0), 0.4 / scale)
    part = np.array([[1.0, 0.0, -x0], [0.0, 1.0, -y0], [0.0, 0.0, 1.0]]) @ warp
    size = (int(x1 - x0), int(y1 - y0))
    seen = cv2.warpPerspective(picture, part, size, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    share = cv2.warpPerspective(np.ones_like(picture), part, size, flags=cv2.INTER_LINEAR)
    view = fine[y0:y1, x0:x1]
    view += share * (seen - view)
