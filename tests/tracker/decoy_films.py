"""Films of a rig beside which other things carry two dots that look like a stick's markers, at random places.

Drawn with OpenCV's polygons four times as fine as the film; nothing here uses the code under test. Pixels, y down.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from tests.grey_film import write_grey

FINE = 4


@dataclass(frozen=True)
class Bar:
    """A bar with two dots: where its origin is, its direction (counter-clockwise as displayed), from where to where."""

    x: float
    y: float
    turn_deg: float
    ends: tuple[float, float]
    dots: tuple[float, float]
    across: tuple[float, float]
    radius: float
    level: float
    dot_level: float

    def point(self, along: float, across: float = 0.0) -> np.ndarray:
        a = np.deg2rad(self.turn_deg)
        u, v = np.array([np.cos(a), -np.sin(a)]), np.array([np.sin(a), np.cos(a)])
        return np.array([self.x, self.y]) + along * u + across * v

    def corners(self, more: float = 0.0) -> np.ndarray:
        low, high, half = self.ends[0] - more, self.ends[1] + more, self.half + more
        return np.array([self.point(*place) for place in ((low, -half), (high, -half), (high, half), (low, half))])

    @property
    def half(self) -> float:
        return 1.9 * self.radius

    @property
    def dots_px(self) -> np.ndarray:
        return np.array([self.point(*place) for place in zip(self.dots, self.across, strict=True)])

    @property
    def line_deg(self) -> float:
        offset = self.dots_px[1] - self.dots_px[0]
        return float(np.rad2deg(np.arctan2(-offset[1], offset[0])))


@dataclass(frozen=True)
class DecoyFilm:
    """A rig with decoys, all of it drawn from a seed."""

    base: Bar
    moving: Bar
    decoys: tuple[Bar, ...]
    angle_deg: np.ndarray
    size: tuple[int, int]
    shake_px: np.ndarray
    seed: int

    @classmethod
    def of(
        cls, seed: int, *, frames: int = 75, size: tuple[int, int] = (400, 300), decoys: int | None = None
    ) -> DecoyFilm:
        rng = np.random.default_rng([seed, 11])
        radius = float(rng.uniform(3.6, 6.0))
        level, dot = (rng.uniform(170, 215), rng.uniform(25, 55)) if rng.random() < 0.7 else (52.0, 205.0)
        x, y = size[0] * rng.uniform(0.4, 0.6), size[1] * rng.uniform(0.4, 0.6)

        def stick(turn_deg: float, x: float, y: float, inner: float, outer: float) -> Bar:
            # Dots are put on by hand: within half their radius of the middle of the bar.
            return Bar(
                x, y, turn_deg, (-14.0 if inner > 0 else inner - 12.0, outer + 12.0), (inner, outer),
                tuple(rng.uniform(-0.5, 0.5, 2) * radius), radius * rng.uniform(0.95, 1.05),
                level * rng.uniform(0.95, 1.05), dot * rng.uniform(0.9, 1.1),
            )  # fmt: skip

        base_deg = float(rng.uniform(0, 360))
        base = stick(base_deg, x, y, *np.cumsum(rng.uniform((22, 45), (34, 70))))
        start, range_deg = rng.uniform(25, 335), rng.choice((-1, 1)) * rng.uniform(15, 150)
        phase = 2 * np.pi * np.arange(frames) / rng.uniform(60, 110)
        angle = start + range_deg * (1 - np.cos(phase)) / 2
        moving = stick(base_deg + angle[0], x, y, *np.cumsum(rng.uniform((20, 45), (34, 70))))
        placed: list[Bar] = []
        for _ in range(1000):
            if len(placed) == (decoys if decoys is not None else 1 + seed % 3):
                break
            half = rng.uniform(20, 38)
            turn = base_deg + rng.normal(0, 3) if rng.random() < 0.4 else rng.uniform(0, 360)
            one = stick(float(turn), rng.uniform(0, size[0]), rng.uniform(0, size[1]), -half, half)
            corners = one.corners(6.0)
            inside = (corners > 8).all() and (corners < np.array(size) - 8).all()
            clear = [
                cv2.rotatedRectangleIntersection(_rectangle(one), _rectangle(bar))[0] == 0
                for bar in (base, moving, *placed)
            ]
            if inside and all(clear):
                placed.append(one)
        shake = rng.normal(0, rng.choice((0.0, 1.0)), (frames, 2))
        return cls(base, moving, tuple(placed), angle, size, shake, seed)

    def at(self, number: int) -> Bar:
        """Return the moving stick in a frame."""
        return self._turned(self.base.turn_deg + float(self.angle_deg[number]))

    def _turned(self, turn_deg: float) -> Bar:
        return Bar(**{**vars(self.moving), "turn_deg": turn_deg})

    @property
    def truth_deg(self) -> np.ndarray:
        """The angle from the base's dots to the moving stick's, in every frame."""
        return np.array([self.at(number).line_deg for number in range(len(self.angle_deg))]) - self.base.line_deg

    def pictures(self) -> Iterator[np.ndarray]:
        rng = np.random.default_rng([self.seed, 12])
        width, height = self.size
        ground = cv2.resize(rng.normal(110, 14, (height // 6, width // 6)), self.size, interpolation=cv2.INTER_CUBIC)
        bare = cv2.resize(ground.astype(np.float32), (FINE * width, FINE * height), interpolation=cv2.INTER_LINEAR)
        for number in range(len(self.angle_deg)):
            fine = bare.copy()
            for bar in (*self.decoys, self.base, self.at(number)):
                _draw(fine, bar, self.shake_px[number])
            cv2.circle(
                fine,
                _fixed(np.array([self.base.x, self.base.y]) + self.shake_px[number]),
                int(9 * FINE * 16),
                95.0,
                -1,
                cv2.LINE_AA,
                4,
            )
            picture = cv2.GaussianBlur(cv2.resize(fine, self.size, interpolation=cv2.INTER_AREA), (0, 0), 0.6)
            yield np.clip(np.rint(picture + rng.normal(0, 2, picture.shape)), 0, 255).astype(np.uint8)

    def write(self, path: Path) -> Path:
        return write_grey(path, self.pictures(), fps=30.0)


def _rectangle(bar: Bar) -> tuple[tuple[float, float], tuple[float, float], float]:
    middle = bar.point((bar.ends[0] + bar.ends[1]) / 2)
    return tuple(middle.tolist()), (bar.ends[1] - bar.ends[0] + 12.0, 2 * bar.half + 12.0), -bar.turn_deg


def _fixed(point: np.ndarray) -> tuple[int, int]:
    x, y = np.rint(((point + 0.5) * FINE - 0.5) * 16).astype(int)
    return int(x), int(y)


def _draw(fine: np.ndarray, bar: Bar, shift: np.ndarray) -> None:
    outline = np.array([_fixed(corner + shift) for corner in bar.corners()], np.int32)
    cv2.fillPoly(fine, [outline], bar.level, cv2.LINE_AA, 4)
    for dot in bar.dots_px:
        cv2.circle(fine, _fixed(dot + shift), round(bar.radius * FINE * 16), bar.dot_level, -1, cv2.LINE_AA, 4)
