"""Finding markers again that are not where they were predicted: one search, for one marker or for a stick.

Places that look like a dot are read; what reads as the marker, lies where the marker may have gone (χ² of the
innovation), and is the only one of its kind, is taken.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from tracker.appearance.lucas_kanade import READING
from tracker.detect.dots import places_of
from tracker.follow.frame_step import NEARBY, stick_at
from tracker.follow.innovation import passes
from tracker.follow.judgement import (
    NEAR,
    SOON,
    SURE_RAD,
    TURN_RAD,
    UNSEEN_PX,
    circle_misfit,
    covers,
    length_misfit,
    near_base,
)
from tracker.follow.motion_model import is_base
from tracker.follow.reading import read_at, read_marker
from tracker.follow.rotation_axis import arm_px, turned
from tracker.follow.state import Scene
from tracker.rows import SEEN, SHADOWED

Point = tuple[float, float]
Record = Any

REACH_PX: Final = 8.0
"""How far beyond its own diameter a marker is looked for next to where it was predicted: a jump of the picture."""
_BUMP_PX: Final = 15.0
"""Standard deviation of where a camera that is bumped takes the base: the search ends at three of them."""
_AROUND: Final = (1.15, 20.0)
"""How far a stick is looked for around its axis: over the arm of its outer marker, and px, for tilt and window."""
_AROUND_LAST: Final = (1.5, 40.0)
"""The same around its middle, over its length, while the axis is not known: by then it has hardly turned."""
_WHOLE: Final = 10
"""Every so many frames that is looked for in the whole picture."""
_SAME_PX: Final = 0.33
"""Standard deviation between two readings of one dot: a pixel is three of them."""
_SLACK: Final = 0.05
"""Share of the step allowed for smear: a marker that is found again may be moving."""
_MOST: Final = 14
"""Places that are read, by correlation and contrast: four dots, and ten that look alike."""
_EAGER, _SELDOM = 20, 3
"""Frames for which a lost stick is looked for in each, and then in every so many, for what that costs."""
_OPPOSITE_RAD: Final = 2.5
"""Two finds that differ by more are one stick, once the other way round."""


@dataclass(frozen=True, slots=True)
class Region:
    """Part of the picture in which to look: a square around a centre."""

    x_px: float
    y_px: float
    half_px: float


@dataclass(frozen=True, slots=True)
class Pair:
    """Two dots at a stick's marker distance, as inner and outer marker: records of READING."""

    inner: Record
    outer: Record

    @property
    def ends(self) -> tuple[Point, Point]:
        """Where both are."""
        return place_of(self.inner), place_of(self.outer)

    @property
    def length_px(self) -> float:
        """Distance between both."""
        return math.dist(*self.ends)

    @property
    def direction_rad(self) -> float:
        """Direction from inner to outer in the picture (y down)."""
        return direction(*self.ends)


def redetect(scene: Scene, luma: NDArray[np.uint8], stage: int) -> None:
    """Look for what the frame step misses at a stage; what is found is put into the readings."""
    if stage == NEARBY:
        for index in range(len(scene.markers)):
            _look_nearby(scene, luma, index)
        return
    stick = stick_at(scene, stage)
    lost = int(scene.markers["lost"][2 * stick : 2 * stick + 2].max())
    if lost > _EAGER and lost % _SELDOM:
        return
    found = _candidates(scene, luma, stick)
    if len(found) == 1:
        for index, reading in ((2 * stick, found[0].inner), (2 * stick + 1, found[0].outer)):
            # The moving stick's edge in the window shifts a base dot, which still helped to find the pair.
            hidden = is_base(scene.rig[0], stick) and _both_seen(scene, 1 - stick)
            state = SHADOWED if hidden and covers(scene, place_of(reading), index) else SEEN
            reading["state"] = state
            scene.readings[index] = reading


# --- one marker, next to where it was predicted ---------------------------------------------------------------------


def _look_nearby(scene: Scene, luma: NDArray[np.uint8], index: int) -> None:
    """Look for a marker next to where it was predicted: the picture has jumped, or the stick turns faster."""
    marker, reading = scene.markers[index], scene.readings[index]
    if reading["state"] in (SEEN, SHADOWED) or marker["lost"] > SOON:
        return
    if is_base(scene.rig[0], index // 2) and covers(scene, place_of(marker), index):
        return
    radius, (x, y) = float(marker["shape"]["radius"]), reading["predicted"].tolist()
    reach = REACH_PX + 2.0 * radius
    good: list[tuple[float, Record]] = []
    for place in _places(luma, marker, Region(x, y, reach + radius)):
        found = _read(scene, luma, index, place, slack=0.0)
        away = math.inf if found is None else math.dist(place_of(found), (x, y))
        if passes((away / (reach / 3.0)) ** 2, 2) and (away < REACH_PX or not _of_other(scene, index, place_of(found))):
            good.append((away, found))
    good.sort(key=lambda one: one[0])
    # A small step leads to the nearest one, whatever else is there; a large one only where nothing else is.
    if len(good) == 1 or (good and good[0][0] < REACH_PX):
        good[0][1]["state"] = SEEN
        scene.readings[index] = good[0][1]


def _of_other(scene: Scene, index: int, place: Point) -> bool:
    """Return whether a place may be of another marker."""
    stick = index // 2
    if scene.rig["moving"][0] == stick and near_base(scene, place, NEAR, UNSEEN_PX):
        return True
    return any(
        reading["state"] == SEEN
        and math.dist(place_of(reading), place) < NEAR * scene.markers["shape"]["radius"][other]
        for other, reading in enumerate(scene.readings)
        if other != index and (other // 2 == stick or scene.rig["moving"][0] < 0)
    )


# --- a stick --------------------------------------------------------------------------------------------------------


def _candidates(scene: Scene, luma: NDArray[np.uint8], stick: int) -> list[Pair]:
    """Return the pairs that may be a stick: where it may have gone, and not of another stick.

    What looks like the base may be the moving stick, as long as that one is not seen elsewhere: then that one has to be
    found shifted by the same step.
    """
    moving, other_seen = int(scene.rig["moving"][0]), len(scene.sticks) == 1 or _both_seen(scene, 1 - stick)
    if moving < 0 and not other_seen:
        return []
    found = [
        pair
        for pair in _pairs(scene, luma, stick)
        if passes(*_innovation(scene, stick, pair)) and not _of_other_stick(scene, stick, pair)
    ]
    here = _ends(scene, stick)
    if moving == 1 - stick and not other_seen:
        return [pair for pair in found if _goes_along(scene, luma, pair.ends[0], here[0])]
    lost = int(scene.markers["lost"][2 * stick : 2 * stick + 2].max())
    opposite = len(found) == 2 and turned(found[0].direction_rad, found[1].direction_rad) > _OPPOSITE_RAD
    # Of two opposite ways the one that turned less; after a longer loss nothing tells, unless the arms differ.
    if moving < 0 and opposite and lost < SOON:
        return [min(found, key=lambda pair: turned(pair.direction_rad, direction(*here)))]
    return found


def _innovation(scene: Scene, stick: int, pair: Pair) -> tuple[float, int]:
    """Return χ² of a pair against where the stick may have gone, and its degrees of freedom.

    A bump carries the base away but hardly turns it; the moving stick goes around its axis. What is seen of the stick
    in this frame is taken as right.
    """
    rig, own, square = scene.rig[0], scene.sticks[stick], np.square
    if is_base(rig, stick):
        steps = np.subtract(pair.ends, _ends(scene, stick))
        misfits = [*(steps.mean(axis=0) / _BUMP_PX), turned(pair.direction_rad, float(rig["reference_rad"])) / TURN_RAD]
        if not _both_seen(scene, 1 - stick):
            misfits.append(turned(pair.direction_rad, float(rig["last_rad"])) / SURE_RAD)
        return float(square(misfits).sum()), len(misfits)
    misfits = [circle_misfit(own, rig["shift_now"], place, end) for end, place in enumerate(pair.ends)]
    if own["still"]:
        misfits.append(turned(pair.direction_rad, float(own["start_rad"])) / TURN_RAD)
    for place, known in zip(pair.ends, scene.readings[2 * stick : 2 * stick + 2], strict=True):
        if known["state"] == SEEN and rig["moving"] >= 0:
            misfits += (np.subtract(place_of(known), place) / _SAME_PX).tolist()
    return float(square(misfits).sum()), len(misfits)


def _of_other_stick(scene: Scene, stick: int, pair: Pair) -> bool:
    """Return whether one of a pair may be a dot of the other stick."""
    if scene.rig["moving"][0] == stick:
        return any(near_base(scene, place, NEAR, 0.0) for place in pair.ends)
    if scene.rig["moving"][0] < 0:
        return len(scene.sticks) > 1 and any(
            _of_other(scene, 2 * stick + end, place) for end, place in enumerate(pair.ends)
        )
    return any(
        not marker["lost"] and math.dist(place, place_of(marker)) < UNSEEN_PX
        for marker in scene.markers[2 - 2 * stick : 4 - 2 * stick]
        for place in pair.ends
    )


def _goes_along(scene: Scene, luma: NDArray[np.uint8], now: Point, before: Point) -> bool:
    """Return whether the moving stick is read shifted by a step of the base; the readings are kept if it is."""
    kept, moving = scene.readings.copy(), 2 * int(scene.rig["moving"][0])
    for index in (moving, moving + 1):
        scene.readings["predicted"][index] += np.subtract(now, before)
        read_marker(scene, luma, index)
    if _both_seen(scene, moving // 2):
        return True
    scene.readings[:] = kept
    return False


def _pairs(scene: Scene, luma: NDArray[np.uint8], stick: int) -> list[Pair]:
    """Return every ordered pair of places that read as a stick's two markers at their distance."""
    own, i, j = scene.sticks[stick], 2 * stick, 2 * stick + 1
    lost = max(1, int(scene.markers["lost"][i] + scene.markers["lost"][j]))
    places = _places(luma, scene.markers[i], _region(scene, luma, stick))
    inner, outer = ([_read(scene, luma, index, place, slack=_SLACK) for place in places] for index in (i, j))
    pairs = (
        Pair(one.copy(), two.copy())
        for a, one in enumerate(inner)
        for b, two in enumerate(outer)
        if a != b and one is not None and two is not None
    )
    return [pair for pair in pairs if passes(length_misfit(own, pair.length_px, lost) ** 2, 1)]


def _region(scene: Scene, luma: NDArray[np.uint8], stick: int) -> Region:
    """Return where a stick may have gone."""
    own, shift = scene.sticks[stick], scene.rig["shift_now"][0]
    (ax, ay), (bx, by) = _ends(scene, stick)
    middle, length = (0.5 * (ax + bx), 0.5 * (ay + by)), float(own["length"])
    if is_base(scene.rig[0], stick):
        return Region(*middle, 0.5 * length + 3.0 * _BUMP_PX)
    if own["axis"]["known"]:
        x, y = (own["axis"]["centre"] + shift).tolist()
        return Region(x, y, _AROUND[0] * arm_px(own["axis"], 1) + _AROUND[1])
    if int(scene.markers["lost"][2 * stick]) % _WHOLE == _WHOLE - 1:
        height, width = luma.shape
        return Region(0.5 * width, 0.5 * height, 0.5 * max(height, width))
    return Region(*middle, _AROUND_LAST[0] * length + _AROUND_LAST[1])


# --- places and readings --------------------------------------------------------------------------------------------


def _read(scene: Scene, luma: NDArray[np.uint8], index: int, place: Point, *, slack: float) -> Record | None:
    """Return a marker as read at a place; None where it is not itself there."""
    out = np.zeros(1, READING)
    if read_at(scene, luma, index, place, slack, out[0]) != SEEN:
        return None
    for name in ("predicted", "path"):
        out[name] = scene.readings[name][index]
    return out[0]


def _places(luma: NDArray[np.uint8], marker: Record, region: Region) -> list[Point]:
    """Return the places in a region that look most like a dot of the marker's radius, the likeliest first."""
    radius, light_dot = float(marker["shape"]["radius"]), marker["shape"]["contrast"] > 0.0
    height, width = luma.shape
    left, right = max(0, math.floor(region.x_px - region.half_px)), min(width, math.ceil(region.x_px + region.half_px))
    top, bottom = max(0, math.floor(region.y_px - region.half_px)), min(height, math.ceil(region.y_px + region.half_px))
    places = [place for place in places_of(luma[top:bottom, left:right], radius) if place[4] == light_dot]
    return [(x + left, y + top) for _, x, y, _, _ in sorted(places, key=lambda place: -place[0])[:_MOST]]


def _ends(scene: Scene, stick: int) -> tuple[Point, Point]:
    """Return where both markers of a stick are, or are taken to be."""
    one, two = (place_of(marker) for marker in scene.markers[2 * stick : 2 * stick + 2])
    return one, two


def _both_seen(scene: Scene, stick: int) -> bool:
    return bool((scene.readings["state"][2 * stick : 2 * stick + 2] == SEEN).all())


def place_of(record: Record) -> Point:
    """Return where a marker, or a reading of one, is."""
    return float(record["x"]), float(record["y"])


def direction(a: Point, b: Point) -> float:
    """Return the direction from a to b in the picture (y down)."""
    return math.atan2(b[1] - a[1], b[0] - a[0])
