"""Detection of dots in one picture, of any size and on any background.

Normalised correlation with discs of many radii proposes positions; the least-squares fit decides. Both are robust to
uneven illumination and to backgrounds with texture: correlation does not depend on brightness and contrast, and the
fit's criterion is the share of the window's variance that a dot explains. A whole picture is correlated where its dots
have half the size that they have for the fit, and in full only around the positions that are found there.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from torsight.core.compiled import compiled, shared
from torsight.core.units import Floats, Ints
from tracker.appearance.dot_fit import Dot, fit_dot

Levels = list[NDArray[np.uint8]]
"""A picture and its successive halves."""

SMALLEST_PX: Final = 2.6
HUGE_PX: Final = 46.0
"""Radii of the smallest and the largest dots that are found."""
_RATIO: Final = 1.22
"""Ratio of successive radii: a disc with a radius that is 10 % wrong still correlates at 0.95."""
_RADII: Final = tuple(SMALLEST_PX * _RATIO**step for step in range(15))
"""Radii of the discs that are tried, up to ``HUGE_PX``."""
_LIKELY: Final = 0.5
"""Correlation above which a dot is fitted at a position; the fit then decides."""
_SMALL_PX: Final = 7.5
"""Radius above which the picture is halved before correlation and the first fit, whose time grows with the radius'
square: a start within a pixel is close enough for the last fit."""
FAINTEST: Final = 6.0
"""Smallest contrast of a dot, grey levels."""
EXPLAINED: Final = 0.75
"""Smallest share of the window's variance that a dot has to explain."""
_RIM_PX: Final = 1.5
"""Width of the rim of a dot beyond its radius, also in widths of its edge, which in a large picture are larger than a
pixel: 7 % of its step are left there."""
_SOFTEST: Final = 0.2
"""Largest width of that rim over the radius: the rim of the drawn dots of benchmarks/tracking/drawing.py has 0.14, and
what is softer is a blotch, beyond which plain ground is no evidence of a dot."""
_MOST: Final = 120
"""Most positions that are fitted in a picture: a sheet's holes, about ten by ten, may be as clear as the markers."""
_ROUGHLY: Final = 0.4
"""Correlation at half the size above which a position is correlated in full. Of the 24,000 positions that full
correlation finds in 203 pictures, the first of the benchmarks' and the real films, 99.6 % are above it."""
_PROPOSED: Final = 50 * _MOST
"""Most positions that are correlated in full, the clearest at half the size: as many as a textured picture of
640 × 480 has."""


@dataclass(frozen=True, slots=True)
class Refused:
    """A position that looks like a dot at coarse resolution, and why it is rejected, with the value and its limit."""

    x_px: float
    y_px: float
    radius_px: float
    reason: str


def find_and_refuse(luma: NDArray[np.uint8]) -> tuple[list[Dot], list[Refused]]:
    """Return the dots in a picture (h, w), the clearest first, and the rejected positions, the most similar first."""
    dots: list[Dot] = []
    refused: list[Refused] = []
    levels = _halved(luma)
    for _, x, y, radius, sign in _places(levels).tolist():
        if any(math.hypot(x - dot.x_px, y - dot.y_px) < dot.radius_px for dot in dots):
            continue
        dot = _judge_dot(levels, x, y, radius_px=radius, sign=sign)
        if isinstance(dot, str):
            refused.append(Refused(x, y, radius, dot))
            continue
        if any(math.hypot(dot.x_px - o.x_px, dot.y_px - o.y_px) < o.radius_px for o in dots):
            continue
        dots.append(dot)
    return sorted(dots, key=lambda dot: -dot.explained), refused


def _judge_dot(
    levels: Levels, x_px: float, y_px: float, *, radius_px: float, sign: float, beside: float = 0.25
) -> Dot | str:
    """Return the dot near a position, fitted within the uniform background around it, or in words why there is none.

    ``beside`` is the width of the ring around the dot that the first fit includes, as a share of the radius.
    """
    luma, (coarse, scale), light_dot, close = levels[0], _coarse(levels, radius_px), sign > 0.0, None
    # First in the coarse picture: what is no dot there is none in the fine one, with up to 64 times the pixels.
    for level, size in [(luma, 1.0)] if scale == 1.0 else [(coarse, scale), (luma, 1.0)]:
        x, y, radius = x_px * size, y_px * size, _rim(level, x_px * size, y_px * size, radius_px * size, sign)
        close = fit_dot(
            level, x, y, radius_px=radius, light_dot=light_dot, room_px=(1.0 + beside) * radius + 1.5, ellipse=False
        )
        if close is None or close.explained < EXPLAINED:
            return _unexplained(close)
        x_px, y_px, radius_px = close.x_px / size, close.y_px / size, close.radius_px / size
    assert close is not None  # noqa: S101 - for the type checker
    begin_px = radius_px + max(_RIM_PX, min(_RIM_PX * close.edge_px, _SOFTEST * radius_px))
    room = _room(luma, x_px, y_px, begin_px, max(0.25 * close.step, 4.0 * close.residual))
    fit = fit_dot(luma, x_px, y_px, radius_px=radius_px, light_dot=light_dot, room_px=room)
    if fit is None or fit.explained < EXPLAINED:
        return _unexplained(fit)
    needed = max(3.0 * fit.residual, FAINTEST)
    if fit.step < needed:
        return f"its contrast is {fit.step:.0f} grey levels; {needed:.0f} needed to stand out of the noise"
    if not SMALLEST_PX <= fit.radius_px <= HUGE_PX:
        return f"its radius is {fit.radius_px:.1f} px; {SMALLEST_PX:g} to {HUGE_PX:g} px are looked for"
    return fit


def _unexplained(fit: Dot | None) -> str:
    if fit is None:
        return "no disc can be fitted: too close to the border, or nothing round"
    share = math.floor(100.0 * max(fit.explained, 0.0))
    return f"not a plain round dot: a disc explains {share} % of the window; {100.0 * EXPLAINED:.0f} % needed"


def dot_near(luma: NDArray[np.uint8], x_px: float, y_px: float, *, reach_px: float) -> Dot | None:
    """Return the dot whose centre is nearest to a position, within ``reach_px`` or within its own radius."""
    levels = _halved(luma)
    # A dot nearly as wide as its stick, on a ground of other brightness, correlates with no disc, but can be fitted.
    here = np.array([[0.0, x_px, y_px, radius, sign] for radius in _RADII for sign in (1.0, -1.0)])
    for places, reach, beside in ((_places(levels, near=(x_px, y_px, reach_px)), reach_px, 0.25), (here, 0.0, 0.0)):
        found = list[tuple[float, Dot]]()
        for _, x, y, radius, sign in places.tolist():
            dot = _judge_dot(levels, x, y, radius_px=radius, sign=sign, beside=beside)
            if isinstance(dot, str):
                continue
            distance = math.hypot(dot.x_px - x_px, dot.y_px - y_px)
            if distance <= max(reach, dot.radius_px):
                found.append((distance - 6.0 * dot.explained, dot))
        if found:
            return min(found, key=lambda one: one[0])[1]
    return None


@compiled
def _rim(luma: NDArray[np.uint8], x_px: float, y_px: float, radius_px: float, sign: float) -> float:
    """Return the radius, near a first guess, with the largest step in brightness, falling outwards with ``sign`` 1."""
    most, found = -math.inf, radius_px
    before, last = 0.0, 0.0
    for ring in range(15):
        reach = radius_px * (0.7 + 0.05 * ring)
        level = 0.0
        for k in range(32):
            x, y = _on_ring(x_px, y_px, reach, 2.0 * math.pi * k / 32)
            if x < 0 or y < 0 or x >= luma.shape[1] or y >= luma.shape[0]:
                return radius_px
            level += luma[y, x]
        step = sign * (before - level)
        if ring > 1 and step > most:
            most, found = step, radius_px * (0.65 + 0.05 * ring)
        before, last = last, level
    return found


@compiled
def _room(luma: NDArray[np.uint8], x_px: float, y_px: float, begin_px: float, limit: float) -> float:
    """Return the distance from a dot's centre up to which the brightness is that of the stick to within a limit, px.

    ``begin_px`` is a distance at which the rim is past.
    """
    ring, level, reach = np.empty(48), math.nan, begin_px
    while reach < 2.0 * begin_px + 5.0:
        for k in range(48):
            x, y = _on_ring(x_px, y_px, reach, 2.0 * math.pi * k / 48)
            if x < 0 or y < 0 or x >= luma.shape[1] or y >= luma.shape[0]:
                return reach - 1.0
            ring[k] = luma[y, x]
        if math.isnan(level):
            ordered = np.sort(ring)
            level = 0.5 * (ordered[23] + ordered[24])
        # A quarter of the step, at three of the 48 points, which noise does not cause: the stick's blurred outer edge.
        if np.sum(np.abs(ring - level) > limit) >= 3:
            break
        reach += 0.5
    return reach - 1.0


@shared
def _on_ring(x_px: float, y_px: float, reach_px: float, angle_rad: float) -> tuple[int, int]:
    """Return the pixel at a distance and in a direction from a position."""
    return round(x_px + reach_px * math.cos(angle_rad)), round(y_px + reach_px * math.sin(angle_rad))


def _places(levels: Levels, *, near: tuple[float, float, float] | None = None) -> Floats:
    """Return the positions that look like a dot of some radius, the best first, as :func:`places_in`.

    ``near`` (x, y, reach) limits them as in :func:`_places_near`.
    """
    found = _clearest_first(
        _places_seen_small(levels) if near is None else [_places_near(levels[0], radius, *near) for radius in _RADII]
    )
    at, size = found[:, 1] + 1j * found[:, 2], found[:, 3]
    kept, left = list[int](), np.ones(len(found), bool)
    # A dot of one radius also correlates with discs whose radius is up to three steps smaller or larger.
    alike = _RATIO**3.5
    while left.any() and len(kept) < _MOST:
        best = int(np.argmax(left))
        kept.append(best)
        ratio = size / size[best]
        close = np.abs(at - at[best]) <= 0.6 * np.maximum(size, size[best])
        left &= ~(close & (ratio <= alike) & (ratio >= 1.0 / alike))
    return found[kept]


def _clearest_first(places: Sequence[Floats]) -> Floats:
    found = np.concatenate(places)
    return found[np.argsort(-found[:, 0], kind="stable")]


def _places_near(luma: NDArray[np.uint8], radius_px: float, x_px: float, y_px: float, reach_px: float) -> Floats:
    """Return the positions within a reach or the dot's own radius from a position, plus the coarse steps."""
    far = max(reach_px, 1.2 * radius_px) + 3.0
    box = (math.floor(x_px - far), math.floor(y_px - far), math.ceil(x_px + far), math.ceil(y_px + far))
    places = places_in(luma, radius_px, box)
    return np.asarray(places[np.hypot(places[:, 1] - x_px, places[:, 2] - y_px) <= far])


def _places_seen_small(levels: Levels) -> list[Floats]:
    """Return the positions in a whole picture that look like a dot of each radius, in full and at half the size.

    At half the size every second radius is tried.
    """
    rough, beside = [], _RATIO**1.5
    for radius in _RADII[::2]:
        number = min(_number_of(levels, radius) + 1, len(levels) - 1)
        scale = 0.5**number
        # Halved like the picture: a disc drawn at half the size would fit only in the middle of a pixel.
        pattern = np.asarray(cv2.pyrDown(_disc_picture(2.0 * radius * scale, even=True)), np.float32)
        rough.append(_places_like(levels[number], scale, radius, pattern, _ROUGHLY))
    likely = _clearest_first(rough)[:_PROPOSED]
    near = [likely[(likely[:, 3] < radius * beside) & (likely[:, 3] * beside > radius)] for radius in _RADII]
    return [_closer(levels, radius, some) for radius, some in zip(_RADII, near, strict=True)]


def _closer(levels: Levels, radius_px: float, rough: Floats) -> Floats:
    """Return the positions that look like a dot of a radius in full, next to those that look so at half the size."""
    level, scale = _coarse(levels, radius_px)
    pattern = _disc_picture(radius_px * scale)
    side, sign = pattern.shape[0], rough[:, 4]
    at = np.rint(rough[:, 1:3] * scale).astype(np.int64) - side // 2
    rows, columns, like = _climbed(level, (pattern - pattern.mean()).astype(np.float64), at[:, 1], at[:, 0], sign)
    _, first = np.unique(rows * level.shape[1] + columns, return_index=True)
    one = first[(sign * like)[first] > _LIKELY]
    return _rows_of(level, scale, radius_px, pattern, (rows[one], columns[one], like[one]), _LIKELY)


@compiled
def _climbed(
    level: NDArray[np.uint8], pattern: Floats, rows: Ints, columns: Ints, signs: Floats
) -> tuple[Ints, Ints, Floats]:
    """Return rows, columns and correlations (p,) of the best squares near some top left pixels (p,).

    ``pattern`` (n, n) has the mean 0. They are up to three pixels away, which is a pixel of the picture of half the
    size and rounding: first two, then one more.
    """
    (height, width), side, norm = level.shape, len(pattern), math.sqrt(np.sum(pattern**2))
    best_row, best_column, found = rows.copy(), columns.copy(), np.zeros(len(rows))
    for k in range(len(rows)):
        for step in (2, 1):
            row, column = best_row[k], best_column[k]
            for place in range(9):
                top, left = row + step * (place // 3 - 1), column + step * (place % 3 - 1)
                if top < 0 or left < 0 or top + side > height or left + side > width:
                    continue
                like = _likeness(level[top : top + side, left : left + side], pattern) / norm
                if signs[k] * like > signs[k] * found[k]:
                    best_row[k], best_column[k], found[k] = top, left, like
    return best_row, best_column, found


@shared
def _likeness(square: NDArray[np.uint8], pattern: Floats) -> float:
    """Return the correlation of a square with a pattern of the mean 0, times the pattern's norm."""
    total, squared, both = 0, 0, 0.0
    for row in range(len(pattern)):
        for column in range(len(pattern)):
            value = int(square[row, column])
            total, squared = total + value, squared + value * value
            both += pattern[row, column] * value
    spread = squared - total**2 / len(pattern) ** 2
    return both / math.sqrt(spread) if spread > 0.0 else 0.0


def _halved(luma: NDArray[np.uint8], radius_px: float = HUGE_PX) -> Levels:
    """Return a picture, and its successive halves, as coarse as dots up to a radius need."""
    levels = [luma]
    while radius_px > _SMALL_PX and min(levels[-1].shape) > 4:
        levels.append(np.asarray(cv2.pyrDown(np.ascontiguousarray(levels[-1])), dtype=np.uint8))
        radius_px *= 0.5
    return levels


def _coarse(levels: Levels, radius_px: float) -> tuple[NDArray[np.uint8], float]:
    """Return the picture in which dots of a radius are small, and its scale."""
    number = _number_of(levels, radius_px)
    return levels[number], 0.5**number


def _number_of(levels: Levels, radius_px: float) -> int:
    return min(max(math.ceil(math.log2(radius_px / _SMALL_PX)), 0), len(levels) - 1)


def _disc_picture(radius_px: float, *, even: bool = False) -> NDArray[np.float32]:
    """Return a blurred light disc in the smallest square that contains its rim; ``even``: so that it can be halved."""
    half = math.ceil(1.35 * radius_px + 0.5)
    half += even * (half % 2)
    y, x = np.mgrid[-half : half + 1, -half : half + 1]
    return np.asarray(np.clip(radius_px + 0.5 - np.hypot(x, y), 0.0, 1.0), dtype=np.float32)


def places_in(luma: NDArray[np.uint8], radius_px: float, box: tuple[int, int, int, int]) -> Floats:
    """Return the positions that look like a dot of a radius in a part of a picture: left, top, right and bottom.

    Rows (p, 5) are the clearness, x, y, the radius, and the sign of the dot: 1 where it is lighter than its
    surroundings, else −1.
    """
    # With a margin, so that a dot at the rim is seen whole.
    more, (height, width) = math.ceil(2.0 * radius_px), luma.shape
    left, top = max(0, box[0] - more), max(0, box[1] - more)
    part = luma[top : min(height, box[3] + more), left : min(width, box[2] + more)]
    return np.asarray(_places_of(_halved(part, radius_px), radius_px) + np.array([0.0, left, top, 0.0, 0.0]))


def _places_of(levels: Levels, radius_px: float) -> Floats:
    """Return the positions in a picture that look like a dot of a radius, as :func:`places_in`."""
    level, scale = _coarse(levels, radius_px)
    return _places_like(level, scale, radius_px, _disc_picture(radius_px * scale), _LIKELY)


def _places_like(
    level: NDArray[np.uint8], scale: float, radius_px: float, pattern: NDArray[np.float32], least: float
) -> Floats:
    """Return the positions at which a picture correlates with the pattern of a disc by ``least`` or more."""
    side = pattern.shape[0]
    if min(level.shape) <= side:
        return np.empty((0, 5))
    score = cv2.matchTemplate(level.astype(np.float32), pattern, cv2.TM_CCOEFF_NORMED)
    around = np.ones((side - 2, side - 2), np.uint8)
    light = (score > least) & (score == cv2.dilate(score, around))
    rows, columns = np.nonzero(light | ((score < -least) & (score == cv2.erode(score, around))))
    squares = (rows, columns, score[rows, columns].astype(np.float64))
    return _rows_of(level, scale, radius_px, pattern, squares, least)


def _rows_of(
    level: NDArray[np.uint8],
    scale: float,
    radius_px: float,
    pattern: NDArray[np.float32],
    squares: tuple[Ints, Ints, Floats],
    least: float,
) -> Floats:
    """Return squares of a picture, by their top left pixels and correlations (p,), as positions (p, 5)."""
    (rows, columns, like), half = squares, pattern.shape[0] // 2
    # Clearness of the dot: a disc explains the square of the correlation, and the spread is proportional to its step.
    variance = _variances(level, rows, columns, pattern.shape[0])
    clear = np.abs(like) ** 8 * variance**0.25
    size = np.full(len(rows), radius_px)
    found = np.stack([clear, (columns + half) / scale, (rows + half) / scale, size, np.sign(like)], axis=1)
    # The disc's step by regression; of a dot whose radius or place is between those tried, as much as correlates.
    return np.asarray(found[np.abs(like) * np.sqrt(variance) > least * FAINTEST * float(pattern.std())])


@compiled
def _variances(level: NDArray[np.uint8], rows: Ints, columns: Ints, side: int) -> Floats:
    """Return the variances (p,) of the brightness in squares of a side, px, from their top left pixels (p,).

    Sums over the whole picture would be eight times as large as that, twice.
    """
    found = np.empty(len(rows))
    for k in range(len(rows)):
        total = square = 0
        for row in range(rows[k], rows[k] + side):
            for column in range(columns[k], columns[k] + side):
                value = int(level[row, column])
                total, square = total + value, square + value * value
        found[k] = square / side**2 - (total / side**2) ** 2
    return found
