"""Finding a stick again of which a marker is not where it was predicted: one search, one test.

A stick is predicted with a covariance: at first that of a camera that shakes, then that of a jump, which grows with the
frames for which the stick is lost. Places that look like a dot are read within three standard deviations, at last in
the whole picture. What reads as its markers is held against the prediction and against what is known of the stick, by
χ² of the innovation. A shake leads to the pair that fits best, whatever else is there; a jump to the only one that
passes.
"""

from __future__ import annotations

import cmath
import itertools
import math
import operator
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from torsight.core.units import Floats
from tracker.appearance.lucas_kanade import READING, Point
from tracker.detect.dots import places_in
from tracker.detect.sticks import MOST
from tracker.follow.camera_state import (
    SHAKE_PX,
    TURN_RAD,
    circle_misfit,
    goes_with_picture,
    own_circle_sigma_px,
    roll_of,
    take_roll,
)
from tracker.follow.frame_step import stick_at
from tracker.follow.judgement import CLOSE, NEAR, UNSEEN_PX, covers, near_base, rigid_misfit, sure_misfit
from tracker.follow.motion_model import by_other_px, is_base, jump_px
from tracker.follow.reading import read_at, read_marker
from tracker.follow.rotation_axis import arm_px
from tracker.follow.state import Scene
from tracker.innovation import SIGMAS, passes
from tracker.rows import SEEN, SHADOWED

Record = Any

_SLACK: Final = 0.05
"""Share of the step allowed for smear: a marker that is found again may be moving. Without it a tenth of the frames of
the disc on a pivot (benchmarks/tracking/table.py) have no angle."""
_EAGER, SELDOM = 20, 3
"""Frames for which a lost stick is looked for in each, and then in every so many, for what that costs."""


class Region(NamedTuple):
    """Part of the picture in which to look, px."""

    left: int
    top: int
    right: int
    bottom: int


@dataclass(frozen=True, slots=True)
class Prediction:
    """Where a stick should be: its markers, and the standard deviation of each along each axis, px.

    ``own`` is what is known of it, a STICK; ``shift`` (2,) that of the picture.
    """

    ends: tuple[Point, Point]
    sigma_px: float
    own: Record
    shift: Floats

    def innovation(self, ends: Sequence[Point], *, lost: int = 1) -> tuple[float, int]:
        """Return χ² of a pair of places against it, and its degrees of freedom; ``lost`` frames are of both markers."""
        found, freedom = rigid_misfit(self.own, self.shift, ends[0], ends[1], lost, math.nan)
        off = np.subtract(ends, self.ends) / self.sigma_px
        return float(found + np.square(off).sum()), freedom + 4

    def is_turned_round(self, ends: Sequence[Point]) -> bool:
        """Return whether a pair of places would be nearer to its markers the other way round.

        Both look alike: only once the axis is known do their circles tell which is which.
        """
        ways = [np.square(np.subtract(ends, own)).sum() for own in (self.ends, self.ends[::-1])]
        return bool(ways[0] > ways[1]) and not self.own["axis"]["known"]

    def rolled_with(self, ends: Sequence[Point]) -> Prediction:
        """Return the prediction of a stick that stands still in a picture that was rolled as a pair of places is."""
        own = self.own.copy()
        own["start_rad"] = direction(*ends)
        return replace(self, own=own)

    def region(self, end: int, size_px: tuple[int, int]) -> Region:
        """Return where one of its markers may be in a picture (width, height)."""
        low, high = (np.add(self.ends[end], reach) for reach in (-SIGMAS * self.sigma_px, SIGMAS * self.sigma_px))
        if self.own["axis"]["known"] and not self.own["still"]:
            reach = arm_px(self.own["axis"], end) + SIGMAS * own_circle_sigma_px(self.own, end)
            centre = self.own["axis"]["centre"] + self.shift
            low, high = np.maximum(low, centre - reach), np.minimum(high, centre + reach)
        low, high = (np.clip(rim, 0.0, size_px).astype(int).tolist() for rim in (np.floor(low), np.ceil(high)))
        return Region(*low, *high)


def redetect(scene: Scene, luma: NDArray[np.uint8], stage: int) -> None:
    """Look for the stick that the frame step misses at a stage; what is found is put into the readings."""
    stick = stick_at(scene, stage)
    lost = int(scene.markers["lost"][2 * stick : 2 * stick + 2].max())
    if lost > _EAGER and lost % SELDOM:
        return
    # A shake is of one frame: what is next to the place of a marker that was lost before may be another one.
    shaken = [] if lost else _pairs(scene, luma, stick, SHAKE_PX * math.sqrt(2.0))
    found = [min(shaken, key=operator.itemgetter(0))] if shaken else _pairs(scene, luma, stick, _jump_px(scene, stick))
    if len(found) == 1:
        for index, reading in zip((2 * stick, 2 * stick + 1), found[0][1:], strict=True):
            # The moving stick's edge in the window shifts a base dot, which still helped to find the pair.
            hidden = is_base(scene.rig[0], stick) and _both_seen(scene, 1 - stick)
            reading["state"] = SHADOWED if hidden and covers(scene, 1 - stick, place_of(reading), index) else SEEN
            scene.readings[index] = reading
        ends = place_of(found[0][1]), place_of(found[0][2])
        if is_base(scene.rig[0], stick) and abs(roll_of(scene, *ends)) > TURN_RAD:
            take_roll(scene, *ends)


def _jump_px(scene: Scene, stick: int) -> float:
    """Return the standard deviation of where a stick is, px: by how long ago it was seen, and by what is seen of it."""
    markers, readings = (part[2 * stick : 2 * stick + 2] for part in (scene.markers, scene.readings))
    missing = np.flatnonzero(readings["state"] != SEEN).tolist()
    own = scene.sticks[stick]
    length_px = float(own["length"])
    if is_base(scene.rig[0], stick):
        # A base goes with the picture, which the moving stick tells while that lies over it.
        return jump_px(length_px, 1 if len(missing) == 1 else 1 + int(scene.rig[0]["unknown"]))
    if len(missing) == 1:
        # A stick alone does not know the other one's dots, which may be as far from what is seen of it as its own.
        unknown_px = math.inf if len(scene.sticks) > 1 else jump_px(length_px, 1)
        by_other = by_other_px(own, missing[0]) if own["axis"]["known"] else unknown_px
        return min(by_other, jump_px(length_px, 1 + int(markers["lost"][missing[0]])))
    return jump_px(length_px, 1 + int(markers["lost"].min()))


def _pairs(scene: Scene, luma: NDArray[np.uint8], stick: int, sigma_px: float) -> list[tuple[float, Record, Record]]:
    """Return the pairs of readings that may be a stick, with their χ²: by the innovation, and not of another stick.

    What is seen of the stick in this frame is taken as right. What looks like the base may be the moving stick, as long
    as that one is not seen elsewhere: then that one has to be found where the picture went.
    """
    rig, both, least_px = scene.rig[0], (2 * stick, 2 * stick + 1), jump_px(float(scene.sticks["length"][stick]), 1)
    jump = sigma_px >= least_px
    markers, readings = (part[both[0] : both[1] + 1] for part in (scene.markers, scene.readings))
    seen, other_seen = readings["state"] == SEEN, len(scene.sticks) == 1 or _both_seen(scene, 1 - stick)
    if rig["moving"] < 0 and not other_seen and sigma_px > least_px:
        return []
    ends = [place_of(one) if known else one["predicted"] for one, known in zip(readings, seen, strict=True)]
    expected = Prediction((ends[0], ends[1]), sigma_px, scene.sticks[stick], rig["shift_now"])
    size_px = luma.shape[1], luma.shape[0]
    inner, outer = (
        [readings[end].copy()]
        if seen[end]
        else _read(scene, luma, both[end], _places(luma, markers[end], expected.region(end, size_px)))
        for end in (0, 1)
    )
    pairs = list(itertools.product(inner, outer))
    lost = max(1, int(markers["lost"].sum()))

    def fitting(*, rolled: bool) -> list[tuple[float, Record, Record]]:
        found: list[tuple[float, Record, Record]] = []
        for one, two in pairs:
            pair = place_of(one), place_of(two)
            if expected.is_turned_round(pair):
                continue
            misfit, freedom = (expected.rolled_with(pair) if rolled else expected).innovation(pair, lost=lost)
            if is_base(rig, stick) and not other_seen and not rolled:
                misfit, freedom = misfit + sure_misfit(rig, *pair) ** 2, freedom + 1
            if passes(misfit, freedom) and not _of_other_stick(scene, stick, pair, jump=jump):
                found.append((misfit, one, two))
        return [one for one in found if _goes_along(scene, luma, *one[1:])] if is_base(rig, stick) else found

    found = fitting(rolled=False)
    if found or not jump or not is_base(rig, stick) or not scene.sticks["axis"]["known"][1 - stick]:
        return found
    # Of a base that is turned only the moving stick tells that the camera was rolled.
    return fitting(rolled=True)


def _of_other_stick(scene: Scene, stick: int, pair: tuple[Point, Point], *, jump: bool) -> bool:
    """Return whether one of a pair may be a dot of the other stick.

    A shake takes both sticks along: what lay over a dot of the base still does, but a dot that is bare now is the
    base's.
    """
    if scene.rig["moving"][0] == stick:
        return any(near_base(scene, place, NEAR if jump else CLOSE, 0.0) for place in pair)
    if not jump:
        return False
    if scene.rig["moving"][0] < 0:
        return any(
            reading["state"] == SEEN
            and math.dist(place_of(reading), place) < NEAR * scene.markers["shape"]["radius"][other]
            for other, reading in enumerate(scene.readings)
            if other // 2 != stick
            for place in pair
        )
    return any(
        not marker["lost"] and math.dist(place, place_of(marker)) < UNSEEN_PX
        for marker in scene.markers[2 - 2 * stick : 4 - 2 * stick]
        for place in pair
    )


def _goes_along(scene: Scene, luma: NDArray[np.uint8], inner: Record, outer: Record) -> bool:
    """Return whether the moving stick went where the base, as it was read, says that the picture did.

    Where it is not seen yet it is read there; the readings are kept if it is.
    """
    kept, moving = scene.readings.copy(), 2 * int(scene.rig["moving"][0])
    pair = place_of(inner), place_of(outer)
    roll_rad, middle = roll_of(scene, *pair), np.mean(pair, axis=0)
    if not _both_seen(scene, moving // 2):
        base = [place_of(one) for one in scene.markers[2 - moving : 4 - moving]]
        before, now = complex(*np.mean(base, axis=0)), complex(*middle)
        turn = cmath.exp(1j * (roll_rad - roll_of(scene, base[0], base[1])))
        for index in (moving, moving + 1):
            place = now + turn * (complex(*scene.readings["predicted"][index]) - before)
            scene.readings["predicted"][index] = place.real, place.imag
            read_marker(scene, luma, index)
    both = _both_seen(scene, moving // 2)
    if both and goes_with_picture(scene, middle - scene.rig["zero"][0].mean(axis=0), roll_rad):
        return True
    scene.readings[:] = kept
    return False


def _read(scene: Scene, luma: NDArray[np.uint8], index: int, places: Sequence[Point]) -> list[Record]:
    """Return a marker as read at each of some places where it is itself there.

    Smeared as it was expected to move, or, where it was not expected to come to that place, as it went there, if that
    is on its circle. Before it is known which stick moves, any two dots are followed as one: they are not asked whether
    they might have.
    """
    out = np.zeros(len(places), READING)
    out["predicted"], expected = scene.readings["predicted"][index], scene.readings["path"][index].copy()
    own, shift, both = scene.sticks[index // 2], scene.rig["shift_now"][0], len(scene.sticks) > 1
    found = []
    for one, place in zip(out, places, strict=True):
        goes = both and circle_misfit(own, shift, place, index % 2) <= SIGMAS
        for path in [expected, _path_to(scene, index, place)] if goes else [expected]:
            scene.readings["path"][index] = one["path"] = path
            if read_at(scene, luma, index, place, _SLACK, one) == SEEN:
                found.append(one)
                break
    scene.readings["path"][index] = expected
    return found


def _path_to(scene: Scene, index: int, place: Point) -> Floats:
    """Return how far a marker moves in a frame if it went evenly from where it was seen last to a place, px (2,)."""
    marker, axis = scene.markers[index], scene.sticks[index // 2]["axis"]
    if not marker["count"]:
        return np.zeros(2)
    shift, frames = complex(*scene.rig[0]["shift_now"]), int(marker["lost"]) + 1
    last, now = complex(*marker["history"][marker["count"] - 1, 1:]), complex(*place) - shift
    step = (now - last) / frames
    if axis["known"]:
        away, before = (at - complex(*axis["centre"]) for at in (now, last))
        step = 1j * away * cmath.phase(away / before) / frames
    return np.array([step.real, step.imag])


def _places(luma: NDArray[np.uint8], marker: Record, region: Region) -> list[Point]:
    """Return the places in a region that look most like a dot of the marker's radius, the likeliest first."""
    radius, light_dot = float(marker["shape"]["radius"]), marker["shape"]["contrast"] > 0.0
    places = [place for place in places_in(luma, radius, region) if place[4] == light_dot]
    return [(x, y) for _, x, y, _, _ in sorted(places, key=lambda place: -place[0])[:MOST]]


def _both_seen(scene: Scene, stick: int) -> bool:
    return bool((scene.readings["state"][2 * stick : 2 * stick + 2] == SEEN).all())


def place_of(record: Record) -> Point:
    """Return where a marker, or a reading of one, is."""
    return float(record["x"]), float(record["y"])


def direction(a: Point, b: Point) -> float:
    """Return the direction from a to b in the picture (y down)."""
    return math.atan2(b[1] - a[1], b[0] - a[0])
