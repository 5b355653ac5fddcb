"""Finding a stick again after both of its markers were lost."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from tracker.detect import disc_picture
from tracker.linear import Reading
from tracker.marker import Marker

Point = tuple[float, float]

_LIKELY: Final = 0.45
_MOST: Final = 14
_SLACK: Final = 0.05
"""Share of the step allowed for smear: a marker that is found again may be moving."""


@dataclass(frozen=True, slots=True)
class Region:
    """Part of the picture in which to look: a square around a centre."""

    x_px: float
    y_px: float
    half_px: float


@dataclass(frozen=True, slots=True)
class Found:
    """A pair of dots at the stick's marker distance, as inner and outer marker."""

    inner: Reading
    outer: Reading

    @property
    def length_px(self) -> float:
        """Distance between both."""
        return math.hypot(self.outer.x_px - self.inner.x_px, self.outer.y_px - self.inner.y_px)

    @property
    def direction_rad(self) -> float:
        """Direction from inner to outer in the picture (y down)."""
        return math.atan2(self.outer.y_px - self.inner.y_px, self.outer.x_px - self.inner.x_px)


def places_like(luma: NDArray[np.uint8], *, radius_px: float, light_dot: bool, region: Region) -> list[Point]:
    """Return the places in a region that look most like a dot of a radius, the likeliest first."""
    height, width = luma.shape
    left, right = max(0, math.floor(region.x_px - region.half_px)), min(width, math.ceil(region.x_px + region.half_px))
    top, bottom = max(0, math.floor(region.y_px - region.half_px)), min(height, math.ceil(region.y_px + region.half_px))
    part = luma[top:bottom, left:right]
    scale = 1.0
    while radius_px * scale > 7.5 and min(part.shape) > 4:
        part, scale = np.asarray(cv2.pyrDown(np.ascontiguousarray(part)), dtype=np.uint8), 0.5 * scale
    pattern = disc_picture(radius_px * scale)
    half = pattern.shape[0] // 2
    if part.shape[0] <= 2 * half + 1 or part.shape[1] <= 2 * half + 1:
        return []
    score = cv2.matchTemplate(part.astype(np.float32), pattern, cv2.TM_CCOEFF_NORMED)
    score = score if light_dot else -score
    crest = cv2.dilate(score, np.ones((2 * half - 1, 2 * half - 1), np.uint8))
    rows, columns = np.nonzero((score >= crest) & (score > _LIKELY) & np.isfinite(score))
    order = np.argsort(-score[rows, columns], kind="stable")[: 4 * _MOST]
    # Faint texture correlates too; the brightness step at the place tells it from a marker.
    ranked = sorted(
        (
            (-float(score[rows[i], columns[i]]) * _spread(part, int(rows[i]), int(columns[i]), half), int(i))
            for i in order
        ),
    )
    return [((columns[i] + half) / scale + left, (rows[i] + half) / scale + top) for _, i in ranked[:_MOST]]


def _spread(part: NDArray[np.uint8], row: int, column: int, half: int) -> float:
    return float(np.std(part[row : row + 2 * half + 1, column : column + 2 * half + 1]))


def pairs_at_distance(
    luma: NDArray[np.uint8],
    places: list[Point],
    *,
    inner: Marker,
    outer: Marker,
    length_px: float,
    tolerance_px: float,
) -> list[Found]:
    """Return every ordered pair of places that read as the stick's two markers at their distance."""
    readings: dict[tuple[int, int], Reading | None] = {}

    def read(which: int, index: int) -> Reading | None:
        key = (which, index)
        if key not in readings:
            marker = outer if which else inner
            reading = marker.read(luma, *places[index])
            bad = marker.gauge.judge(reading, slack=_SLACK)
            readings[key] = None if bad else reading
        return readings[key]

    found: list[Found] = []
    for i, a in enumerate(places):
        for j, b in enumerate(places):
            if i == j or abs(math.hypot(a[0] - b[0], a[1] - b[1]) - length_px) > tolerance_px + 4.0:
                continue
            first, second = read(0, i), read(1, j)
            if first is None or second is None:
                continue
            pair = Found(first, second)
            if abs(pair.length_px - length_px) <= tolerance_px:
                found.append(pair)
    return found
