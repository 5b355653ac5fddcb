"""Choice of the four dots that are the markers, and of the two on each stick, from one picture."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from torsight.core.units import Flags, Floats, Ints
from tracker.appearance.dot_fit import EDGE_PX, Dot
from tracker.appearance.lucas_kanade import Places, Point
from tracker.detect.dots import find_and_refuse

_Real = TypeVar("_Real", float, Floats)

CLEAR: Final = 2.0
"""Score above which a pair of dots is accepted from one picture alone."""
_LEAST: Final = 1.2
"""Score below which two pairs of dots are taken for texture: 80 % explained at a step of 50 grey levels."""
CLEARER: Final = 2.0
"""Ratio of the scores of two pairs below which one picture does not decide between them."""
LIKE: Final = 1.6
"""Largest ratio of the brightness steps of markers, and of the light around them: all are made in the same way. Sizes
with a ratio below it are as likely as equal ones."""
SIZES: Final = 3.0
"""Largest ratio of the sizes of markers, and of the lengths of both sticks."""
MOST: Final = 24
"""Most dots that are searched for sticks: the number of pairs of pairs grows with the fourth power, and nobody reads a
longer list."""
PARALLEL: Final = 0.2
"""Sine of the smallest angle (12 degrees) of two lines that define a point, or a plane."""
_STRIP: Final = 0.8
"""Smallest share of the line between two dots that has to be as bright as a stick."""

_RIM: Final = 2.5
"""Distance from a dot's centre, in radii, at which a rim has ended: one as wide as the radius of the dot ends at 2, and
lens and pixels widen it."""


@dataclass(frozen=True, slots=True)
class Stick:
    """Two dots on one stick."""

    inner: Dot
    outer: Dot
    score: float

    @property
    def length_px(self) -> float:
        """Distance between the stick's dots, px."""
        return _gap(self.inner, self.outer)

    @property
    def direction_rad(self) -> float:
        """Direction from the inner dot to the outer one, y down."""
        return math.atan2(self.outer.y_px - self.inner.y_px, self.outer.x_px - self.inner.x_px)

    @property
    def places_px(self) -> list[list[float]]:
        """Positions of the dots, the inner one first."""
        return [[dot.x_px, dot.y_px] for dot in (self.inner, self.outer)]

    def is_of(self, other: Stick) -> bool:
        """Return whether these are the same two dots, whichever is the inner one."""
        return {id(self.inner), id(self.outer)} == {id(other.inner), id(other.outer)}

    def shared_dots(self, other: Stick) -> int:
        """Return the number of dots that lie at dots of a stick in another picture, within their radii."""
        return sum(
            _gap(one, two) < one.radius_px for one in (self.inner, self.outer) for two in (other.inner, other.outer)
        )

    def placed_as(self, other: Stick) -> Stick | None:
        """Return the stick with its dots in the order of those of a stick at the same place; None elsewhere."""
        if self.shared_dots(other) < 2:
            return None
        return self if _gap(self.inner, other.inner) < self.inner.radius_px else self.turned()

    def turned(self) -> Stick:
        """Return the stick with inner and outer dot exchanged."""
        return replace(self, inner=self.outer, outer=self.inner)

    def towards(self, x_px: float, y_px: float) -> Stick:
        """Return the stick with the dot that is nearer to a position as the inner one."""
        away = [math.hypot(dot.x_px - x_px, dot.y_px - y_px) for dot in (self.inner, self.outer)]
        return self if away[0] <= away[1] else self.turned()


def sticks_in(luma: NDArray[np.uint8], *, dots: Sequence[Dot] | None = None) -> tuple[Stick, Stick] | None:
    """Return the two sticks in a picture; None without any, or where they are faint and two other dots are clearer.

    ``dots`` are those of :func:`tracker.detect.dots.find_and_refuse`, if they were found already.
    """
    found = couples_in(luma, dots=dots)
    return towards_axis(*found[0]) if found else None


def couples_in(luma: NDArray[np.uint8], *, dots: Sequence[Dot] | None = None) -> list[tuple[Stick, Stick]]:
    """Return the couples (two pairs of dots) that may be the two sticks in a picture, the clearest first.

    Only couples with scores within a factor of ``CLEARER`` of the first one's are returned: the picture does not decide
    between these. There are none where the first couple is faint, and two other dots are clearer: among many dots of
    texture some four look like two sticks.
    """
    dots = find_and_refuse(luma)[0] if dots is None else dots
    found = choose_sticks(luma, dots)
    if not found:
        return []
    worst = _worst(found[0])
    if worst <= CLEAR:
        chosen = [dot for stick in found[0] for dot in (stick.inner, stick.outer)]
        limit = min(clearness(dot) for dot in chosen)
        if sum(clearness(dot) > limit and not any(dot is other for other in chosen) for dot in dots) >= 2:
            return []
    return [couple for couple in found if _worst(couple) * CLEARER > worst]


def _worst(couple: tuple[Stick, Stick]) -> float:
    return min(couple[0].score, couple[1].score)


def are_markers(sticks: tuple[Stick, Stick]) -> bool:
    """Return whether two pairs of dots are clear enough to be taken for the markers."""
    return _worst(sticks) > _LEAST


def choose_sticks(luma: NDArray[np.uint8], dots: Sequence[Dot]) -> list[tuple[Stick, Stick]]:
    """Return all couples of pairs of dots that may be two sticks, the clearest first.

    Two dots lie on one stick if they are similar and the line between them has the stick's brightness throughout.
    """
    pairs = pairs_in(luma, dots)
    one, two = np.triu_indices(len(pairs), 1)
    score = _couple_scores(pairs, one, two)
    best = np.argsort(-score, kind="stable")[: int((score > 0.0).sum())]
    return [(pairs[i], pairs[j]) for i, j in zip(one[best].tolist(), two[best].tolist(), strict=True)]


def pairs_in(luma: NDArray[np.uint8], dots: Sequence[Dot]) -> list[Stick]:
    """Return the pairs of dots that may lie on one stick."""
    return [
        Stick(a, b, score)
        for a, b in itertools.combinations(clearest(dots), 2)
        if not isinstance(score := judge_pair(luma, a, b), str)
    ]


def clearest(dots: Sequence[Dot]) -> list[Dot]:
    """Return the dots that are searched for sticks, the clearest first."""
    return sorted(dots, key=clearness, reverse=True)[:MOST]


def towards_axis(one: Stick, two: Stick) -> tuple[Stick, Stick]:
    """Return both sticks with the dot nearer to the crossing of their lines as the inner one."""
    axis = crossing_point(*one.places_px, *two.places_px)
    if axis is None:
        # Parallel sticks: the ends that lie closest together are the inner ones.
        pairs = itertools.product((one, one.turned()), (two, two.turned()))
        return min(pairs, key=lambda pair: _gap(pair[0].inner, pair[1].inner))
    return one.towards(*axis), two.towards(*axis)


def crossing_point(
    a: Sequence[float], b: Sequence[float], c: Sequence[float], d: Sequence[float]
) -> tuple[float, float] | None:
    """Return the crossing of the lines a–b and c–d; None where they meet at less than 12°."""
    (start, along), (other, across) = ((complex(*p), np.array(complex(*q) - complex(*p))) for p, q in ((a, b), (c, d)))
    crossing = complex(start + _crossing_shares(along, across, other - start)[0] * along)
    return None if math.isnan(crossing.real) else (crossing.real, crossing.imag)


def _crossing_shares(u: Places, v: Places, between: Places | complex) -> tuple[Floats, Floats]:
    """Return the distances of two lines' crossing from their starts, as shares of their directions u and v, complex.

    ``between`` is the start of the second line minus that of the first; NaN where the lines meet at less than 12°.
    """
    cross = (np.conj(u) * v).imag
    with np.errstate(divide="ignore", invalid="ignore"):
        cross = np.where(np.abs(cross) < PARALLEL * np.abs(u) * np.abs(v), np.nan, cross)
        return (np.conj(between) * v).imag / cross, (np.conj(between) * u).imag / cross


def half_width(luma: NDArray[np.uint8], stick: Stick) -> float:
    """Return half the width of a stick, px; infinite where its edges are not seen within three dot radii."""
    radius = max(stick.inner.radius_px, stick.outer.radius_px)
    seen = _edges_between(luma, stick, radius)
    return float(np.mean(seen)) if seen else math.inf


def edges_beside_line(luma: NDArray[np.uint8], one: Point, two: Point, *, window_px: float) -> list[float]:
    """Return the distances, px, of a stick's edges from the line between two of its points, as far as they are seen.

    They are at least ``window_px``, up to which around both points the picture is known to be of the stick. The texture
    there is taken for dots of twice its standard deviation. Where no edge is seen, the points are not known to lie on
    one bar: they may be places of something that is wider than the rig, such as a wall behind it.
    """
    left, top = (max(round(at - window_px), 0) for at in one)
    step = 2.0 * float(luma[top : round(one[1] + window_px), left : round(one[0] + window_px)].std())
    inner, outer = (Dot(*at, window_px, EDGE_PX, (0.0, 0.0), 1.0, window_px, step, 0.0, 1.0) for at in (one, two))
    return [max(edge, window_px) for edge in _edges_between(luma, Stick(inner, outer, 0.0), window_px)]


def _edges_between(luma: NDArray[np.uint8], stick: Stick, radius_px: float) -> list[float]:
    """Return the distances of a stick's edges that are seen between its dots, px, outside the radius of both."""
    along = np.linspace(radius_px + 3.0, stick.length_px - radius_px - 3.0, 24)
    return [edge for edge in _edges(luma, stick, along) if math.isfinite(edge)]


def edges_beside(luma: NDArray[np.uint8], stick: Stick) -> tuple[float, float]:
    """Return the distances, px, of a stick's edges from its inner dot: right and left, as seen towards the outer dot.

    In the picture's coordinates, y down; infinite for an edge that is not seen. They are measured within two diameters
    of the dot, which need not lie on the stick's middle line; nor need the line between both dots be parallel to that.
    """
    radius = stick.inner.radius_px
    return _edges(
        luma, stick, radius + 3.0 + np.linspace(0.0, min(4.0 * radius, 0.5 * stick.length_px - radius - 3.0), 24)
    )


def _edges(luma: NDArray[np.uint8], stick: Stick, along: Floats) -> tuple[float, float]:
    """Return the distances of a stick's edges from the line between its dots, right and left of it, px.

    The median profile across the stick is taken over positions ``along`` it that hold no dot; an edge is at half its
    rise or fall.
    """
    ax, ay, bx, by = stick.inner.x_px, stick.inner.y_px, stick.outer.x_px, stick.outer.y_px
    ux, uy = (bx - ax) / stick.length_px, (by - ay) / stick.length_px
    radius = max(stick.inner.radius_px, stick.outer.radius_px)
    reach = np.arange(0.0, 3.0 * radius + 4.0, 0.5)
    # Two standard deviations of the blur on both sides, at least that of a good lens, in half pixels.
    wide = round(8.0 * max(stick.inner.edge_px, stick.outer.edge_px, EDGE_PX))
    found = [math.inf, math.inf]
    for number, side in enumerate((1.0, -1.0)):
        x = (ax + along[:, None] * ux - side * reach * uy).astype(np.float32)
        y = (ay + along[:, None] * uy + side * reach * ux).astype(np.float32)
        if x.min() < 0 or y.min() < 0 or x.max() > luma.shape[1] - 1 or y.max() > luma.shape[0] - 1:
            continue
        profile = np.median(cv2.remap(luma, x, y, cv2.INTER_LINEAR), axis=0).astype(np.float64)
        middle = float(np.median(profile[reach < radius]))
        # Half way to the level at the end of the blur: further away the background may have any brightness.
        steps = np.abs(profile[wide:] - profile[:-wide])
        first = np.flatnonzero((steps > 0.25 * stick.inner.step) & (reach[wide // 2 : wide // 2 - wide] > radius))
        if len(first):
            top = first[0] + int(np.argmax(steps[first[0] : first[0] + wide + 1]))
            if abs(profile[top] - middle) < 0.5 * steps[top]:
                rise = (profile[top : top + wide + 1] - profile[top]) / (profile[top + wide] - profile[top])
                found[number] = float(np.interp(0.5, np.maximum.accumulate(rise), reach[top : top + wide + 1]))
    return found[0], found[1]


def _gap(a: Dot, b: Dot) -> float:
    return math.hypot(a.x_px - b.x_px, a.y_px - b.y_px)


def is_clear(dot: Dot) -> bool:
    """Return whether a dot is clear enough to be taken for a marker, together with a similar one."""
    return clearness(dot) * dot.explained**4 > _LEAST


def clearness(dot: Dot) -> float:
    """Return the clearness of a dot, from the quality of its fit and its step in brightness."""
    return dot.explained**4 * math.sqrt(dot.step)


def least_length(one_px: _Real, two_px: _Real) -> _Real:
    """Return the smallest distance between two dots of these radii on one stick, px."""
    return 1.5 * (one_px + two_px) + 3.0


def judge_pair(luma: NDArray[np.uint8], a: Dot, b: Dot) -> float | str:
    """Return the score of two dots as a stick's, or in words why they are not on one stick."""
    if (a.contrast > 0) != (b.contrast > 0):
        return "one of the two is dark and the other light"
    for name, ratio, limit in _ratios(a, b):
        if ratio > limit:
            return f"they differ in {name} by a factor of {ratio:.1f}; {limit:g} allowed"
    distance, needed = _gap(a, b), least_length(a.radius_px, b.radius_px)
    if distance < needed:
        return f"they are {distance:.0f} px apart; {needed:.0f} px needed"
    strip = strip_share(luma, a, b)
    if strip < _STRIP:
        share = math.floor(100.0 * strip)
        return f"{share} % of the line between them is as bright as a stick; {100.0 * _STRIP:.0f} % needed"
    return strip * stick_of(a, b).score


def _ratios(a: Dot, b: Dot) -> list[tuple[str, float, float]]:
    """Return name, ratio and largest allowed ratio of the properties by which two dots are compared."""
    values = (
        ("radius", a.radius_px, b.radius_px, SIZES),
        ("contrast", a.step, b.step, SIZES),
        ("light around them", a.light, b.light, LIKE),
    )
    return [(name, max(one, two) / max(min(one, two), 1e-6), limit) for name, one, two, limit in values]


def stick_of(a: Dot, b: Dot) -> Stick:
    """Return two dots as a stick, with the score of their similarity, fits and contrast."""
    likeness = math.prod(1.0 / ratio for _, ratio, _ in _ratios(a, b))
    return Stick(a, b, likeness * (a.explained * b.explained) ** 4 * math.sqrt(min(a.step, b.step)))


def strip_share(luma: NDArray[np.uint8], a: Dot, b: Dot) -> float:
    """Return the share of the line between two dots that is as bright as the stick around them."""
    distance = _gap(a, b)
    along = np.array([a.radius_px + 2.0, distance - b.radius_px - 2.0]) / distance
    return float(np.mean(_as_bright(luma, (a, b), (b.x_px, b.y_px), along)))


def has_rim(luma: NDArray[np.uint8], dot: Dot) -> bool:
    """Return whether a dot's surroundings end on all sides, as those of a ring do, but not those on a stick."""
    turn, (height, width) = np.linspace(0.0, math.tau, 24, endpoint=False), luma.shape
    x, y = (
        np.clip(np.rint(at + _RIM * dot.radius_px * unit), 0, most - 1).astype(np.int64)
        for at, unit, most in ((dot.x_px, np.cos(turn), width), (dot.y_px, np.sin(turn), height))
    )
    return not (np.abs(luma[y, x] - dot.light) < _tolerance(dot, dot)).any()


def compared_to_axis(luma: NDArray[np.uint8], sticks: Sequence[Stick], x_px: float, y_px: float) -> tuple[float, float]:
    """Return the numbers of points at which the lines from the axis (x, y) to two inner dots are alike, and are not.

    Points at the same distance from the axis are alike if both are as bright as their stick, or neither is. They are
    scaled to one point per diameter of the dots: points that are closer together are not independent.
    """
    dots = [stick.inner for stick in sticks]
    away = [math.hypot(x_px - dot.x_px, y_px - dot.y_px) for dot in dots]
    both = min(px - dot.radius_px - 2.0 for px, dot in zip(away, dots, strict=True))
    if both <= 0.0:
        return 0.0, 0.0
    bright = [
        _as_bright(luma, (dot, dot), (x_px, y_px), np.array([1.0 - both / px, 1.0]))
        for px, dot in zip(away, dots, strict=True)
    ]
    # The number of points is the distance in px: of both lines the same, but for rounding.
    count = min(len(line) for line in bright)
    share = float(np.mean(bright[0][-count:] == bright[1][-count:]))
    looks = both / (dots[0].radius_px + dots[1].radius_px)
    return looks * share, looks * (1.0 - share)


def _as_bright(luma: NDArray[np.uint8], dots: tuple[Dot, Dot], end: tuple[float, float], along: Floats) -> Flags:
    """Return whether each point of a line from the first of two dots to ``end`` is as bright as the stick around both.

    ``along`` (2,) are first and last point, as shares of the line.
    """
    (a, b), height, width = dots, *luma.shape
    distance = math.hypot(end[0] - a.x_px, end[1] - a.y_px)
    share = np.linspace(along[0], along[1], max(8, int((along[1] - along[0]) * distance)))
    x = np.clip(np.rint(a.x_px + share * (end[0] - a.x_px)), 0, width - 1).astype(np.int64)
    y = np.clip(np.rint(a.y_px + share * (end[1] - a.y_px)), 0, height - 1).astype(np.int64)
    expected = a.light + share * (b.light - a.light)
    return np.asarray(np.abs(luma[y, x] - expected) < _tolerance(a, b))


def _tolerance(a: Dot, b: Dot) -> float:
    """Return the difference in brightness, grey levels, below which a point is as bright as the stick around dots."""
    return max(0.3 * min(a.step, b.step), 3.0 * max(a.residual, b.residual))


def _couple_scores(pairs: Sequence[Stick], one: Ints, two: Ints) -> Floats:
    """Return scores (c,) of couples of pairs, by their indices, as the sticks of one rig; −∞ where they cannot be."""
    ends = [(pair.inner, pair.outer) for pair in pairs]
    at = np.array([[complex(dot.x_px, dot.y_px) for dot in both] for both in ends]).reshape(-1, 2)
    radii, steps = (
        np.array([[getattr(dot, what) for dot in both] for both in ends]).reshape(-1, 2)[np.stack([one, two], 1)]
        for what in ("radius_px", "step")
    )
    own = np.array([pair.score for pair in pairs])
    unlike, unsteady = (each.max(axis=(1, 2)) / each.min(axis=(1, 2)) for each in (radii, steps))
    along = at[:, 1] - at[:, 0]
    longer = np.exp(np.abs(np.log(np.abs(along[one]) / np.abs(along[two]))))
    shared = (at[one][:, :, None] == at[two][:, None]).any(axis=(1, 2))
    possible = ~shared & (unlike <= SIZES) & (unsteady <= 2.5) & (longer <= SIZES)
    score = (own[one] + own[two]) * (1.0 - np.maximum(0.0, 1.0 - LIKE / unlike))
    # The axis lies beyond the inner end of both sticks, not between a stick's markers.
    for share in _crossing_shares(along[one], along[two], at[two, 0] - at[one, 0]):
        score += np.where(np.isnan(share), 0.0, np.where((share > 0.0) & (share < 1.0), -1.0, 1.0))
    return np.where(possible, score, -np.inf)
