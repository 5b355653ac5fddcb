"""Redetection of a stick with a marker that is not at its predicted position: one search, one test.

A stick is predicted with a covariance: first that of a shaking camera, then that of a jump, which grows with the number
of frames for which the stick is lost. Positions that look like a dot are read within three standard deviations, in the
end in the whole picture. Readings that fit its markers are tested against the prediction and the stick's state, by χ²
of the innovation. After a shake the pair that fits best is accepted, whatever else passes; after a jump a pair is
accepted only if no other passes.
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
from tracker.appearance.lucas_kanade import READING, Point, unused_look
from tracker.detect.dots import places_in
from tracker.detect.sticks import MOST
from tracker.follow.camera_state import (
    SHAKE_PX,
    TURN_RAD,
    circle_misfit,
    goes_with_picture,
    own_circle_sigma_px,
    take_turn,
    turn_of,
)
from tracker.follow.frame_step import stick_at
from tracker.follow.judgement import CLOSE, NEAR, UNSEEN_PX, covers, near_base, rigid_misfit
from tracker.follow.motion_model import JUMP, by_other_px, is_base, jump_px
from tracker.follow.reading import read_at, read_marker, share_of_step
from tracker.follow.rotation_axis import arm_px
from tracker.follow.state import Scene
from tracker.innovation import SIGMAS, passes
from tracker.rows import SEEN, SHADOWED

Record = Any

_SLACK: Final = 0.05
"""Residual allowed for motion blur, as a share of the brightness step: a marker that is found again may be moving.
Without it a tenth of the frames of the disc on a pivot (benchmarks/tracking/table.py) have no angle."""
_EAGER, SELDOM = 20, 3
"""Frames in each of which a lost stick is searched for, and the interval of the searches after that: they are slow."""


_Found = tuple[float, Record, Record, NDArray[np.void]]
"""A pair of readings, after its χ², and all readings of the frame."""


class Region(NamedTuple):
    """Part of the picture to be searched, px."""

    left: int
    top: int
    right: int
    bottom: int


@dataclass(frozen=True, slots=True)
class Prediction:
    """Predicted positions of a stick's markers, and the standard deviation of each along each axis, px.

    ``own`` is the stick's state, a STICK; ``shift`` (2,) is that of the picture.
    """

    ends: tuple[Point, Point]
    sigma_px: float
    own: Record
    shift: Floats

    def innovation(self, ends: Sequence[Point], *, lost: int = 1) -> tuple[float, int]:
        """Return χ² of a pair of positions, and its degrees of freedom; ``lost`` counts the frames of both markers."""
        found, freedom = rigid_misfit(self.own, self.shift, ends[0], ends[1], lost, math.nan)
        off = np.subtract(ends, self.ends) / self.sigma_px
        return float(found + np.square(off).sum()), freedom + 4

    def turned_with(self, ends: Sequence[Point]) -> Prediction:
        """Return the prediction of a stick at rest in a picture that was turned so that the stick lies as ``ends``."""
        own = self.own.copy()
        own["start_rad"], own["length"] = direction(*ends), math.dist(*ends)
        return replace(self, own=own)

    def size_misfit(self, ends: Sequence[Point]) -> float:
        """Return the picture's change of scale, if the stick lies as ``ends``, over that by a jump of the camera."""
        return (math.dist(*ends) / float(self.own["length"]) - 1.0) / JUMP

    def region(self, end: int, size_px: tuple[int, int]) -> Region:
        """Return the region of a picture (width, height) in which the marker at ``end`` may be."""
        low, high = (np.add(self.ends[end], reach) for reach in (-SIGMAS * self.sigma_px, SIGMAS * self.sigma_px))
        if self.own["axis"]["known"] and not self.own["still"]:
            reach = arm_px(self.own["axis"], end) + SIGMAS * own_circle_sigma_px(self.own, end)
            centre = self.own["axis"]["centre"] + self.shift
            low, high = np.maximum(low, centre - reach), np.minimum(high, centre + reach)
        low, high = (np.clip(rim, 0.0, size_px).astype(int).tolist() for rim in (np.floor(low), np.ceil(high)))
        return Region(*low, *high)


def redetect(scene: Scene, luma: NDArray[np.uint8], stage: int) -> Scene:
    """Search for the stick that the frame step lacks at a stage; return the scene with the markers found as readings.

    The scene has other looks where a camera at another distance shows markers of another size.
    """
    stick = stick_at(scene, stage)
    lost = int(scene.markers["lost"][2 * stick : 2 * stick + 2].max())
    if lost > _EAGER and lost % SELDOM:
        return scene
    # A shake lasts one frame: where a marker was lost earlier there may be another dot. A base that was covered
    # moved only with the picture, whose shift the moving stick measures.
    since = int(scene.rig["unknown"][0]) if is_base(scene.rig[0], stick) else lost
    shaken = [] if since else _pairs(scene, luma, stick, SHAKE_PX * math.sqrt(2.0))
    found = [min(shaken, key=operator.itemgetter(0))] if shaken else _pairs(scene, luma, stick, _jump_px(scene, stick))
    if len(found) == 1:
        _, *pair, scene.readings[:] = found[0]
        for index, reading in zip((2 * stick, 2 * stick + 1), pair, strict=True):
            # A base dot with the moving stick's edge in its window helps to find the pair, but its position is biased.
            hidden = is_base(scene.rig[0], stick) and _both_seen(scene, 1 - stick)
            reading["state"] = SHADOWED if hidden and covers(scene, 1 - stick, place_of(reading), index) else SEEN
            scene.readings[index] = reading
        ends = place_of(pair[0]), place_of(pair[1])
        if is_base(scene.rig[0], stick) and abs(turn_of(scene, *ends) - 1.0) > TURN_RAD:
            scene = _turned(scene, ends)
            for marker, reading in zip(scene.markers, scene.readings, strict=True):
                if reading["state"] == SEEN:
                    # From another place the picture may be less sharp.
                    usual = share_of_step(float(reading["residual"]), float(reading["step"]))
                    marker["residual"][0] = max(marker["residual"][0], usual)
    return scene


def _turned(scene: Scene, ends: tuple[Point, Point]) -> Scene:
    """Return the scene in a picture that is turned and scaled so that the base lies at ``ends``."""
    size = abs(turn_of(scene, *ends))
    take_turn(scene, *ends)
    scene.markers["shape"]["window"] *= size
    return scene.with_looks()


def _jump_px(scene: Scene, stick: int) -> float:
    """Return the standard deviation of a stick's position, px, from the time since it was seen and its seen marker."""
    markers, readings = (part[2 * stick : 2 * stick + 2] for part in (scene.markers, scene.readings))
    missing = np.flatnonzero(readings["state"] != SEEN).tolist()
    own = scene.sticks[stick]
    length_px = float(own["length"])
    if is_base(scene.rig[0], stick):
        # A base moves only with the picture, whose shift the moving stick measures while it covers the base.
        return jump_px(length_px, 1 if len(missing) == 1 else 1 + int(scene.rig[0]["unknown"]))
    if len(missing) == 1:
        # A stick followed alone does not know the other stick's dots, which may be at its own markers' distance.
        unknown_px = math.inf if len(scene.sticks) > 1 else jump_px(length_px, 1)
        by_other = by_other_px(own, missing[0]) if own["axis"]["known"] else unknown_px
        return min(by_other, jump_px(length_px, 1 + int(markers["lost"][missing[0]])))
    return jump_px(length_px, 1 + int(markers["lost"].min()))


def _pairs(scene: Scene, luma: NDArray[np.uint8], stick: int, sigma_px: float) -> list[_Found]:
    """Return the pairs of readings, with their χ², that pass the innovation's test and are not of the other stick.

    With each pair come all readings, among them those of a moving stick that was read where the base implies it to be.

    A marker that is seen in this frame is kept. A pair that looks like the base may be the moving stick, unless this is
    seen elsewhere: it has to be found at its position in the shifted picture.
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
        else _read(scene, luma, both[end], _places(luma, markers[end], expected.region(end, size_px)), jump=jump)
        for end in (0, 1)
    )
    pairs = list(itertools.product(inner, outer))
    lost = max(1, int(markers["lost"].sum()))

    def fitting(*, turned: bool) -> list[_Found]:
        found: list[_Found] = []
        for one, two in pairs:
            pair = place_of(one), place_of(two)
            misfit, freedom = (expected.turned_with(pair) if turned else expected).innovation(pair, lost=lost)
            if turned:
                misfit, freedom = misfit + expected.size_misfit(pair) ** 2, freedom + 1
            if passes(misfit, freedom) and not _of_other_stick(scene, stick, pair, jump=jump):
                # Both markers look the same: with inner and outer one exchanged the pair has to be improbable.
                exchanged, _ = expected.innovation(pair[::-1], lost=lost)
                along = None if passes(exchanged - misfit, 2) else _going_along(scene, luma, stick, one, two)
                found += [] if along is None else [(misfit, one, two, along)]
        return found

    found = fitting(turned=False)
    if found or not jump or not is_base(rig, stick) or not scene.sticks["axis"]["known"][1 - stick]:
        return found
    # A base that lies otherwise is accepted if the moving stick confirms that the camera was moved.
    return fitting(turned=True)


def _of_other_stick(scene: Scene, stick: int, pair: tuple[Point, Point], *, jump: bool) -> bool:
    """Return whether one of a pair may be a dot of the other stick.

    A shake moves both sticks together: a marker that covered a base dot still does, but a dot that is uncovered now is
    the base's.
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


def _going_along(
    scene: Scene, luma: NDArray[np.uint8], stick: int, inner: Record, outer: Record
) -> NDArray[np.void] | None:
    """Return all readings if a stick may be at ``inner`` and ``outer``, else None.

    If it is the base the moving stick has to follow the motion of the picture that this implies. A moving stick that is
    not seen yet is read where it is by that motion, and the base once more, with markers of the size by that motion.
    """
    moving = 2 * int(scene.rig["moving"][0])
    if not is_base(scene.rig[0], stick):
        return scene.readings.copy()
    kept, now = [part.copy() for part in scene[:4]], scene
    pair, alike, i = (place_of(inner), place_of(outer)), True, 2 - moving
    turn, middle = turn_of(scene, *pair), np.mean(pair, axis=0)
    if not _both_seen(scene, moving // 2):
        base = [place_of(one) for one in scene.markers[i : i + 2]]
        before, after = complex(*np.mean(base, axis=0)), complex(*middle)
        since = turn / turn_of(scene, base[0], base[1])
        if abs(turn - 1.0) > TURN_RAD:
            now, again = _turned(scene, pair), np.zeros(2, READING)
            alike = all(read_at(now, luma, i + end, pair[end], _SLACK, again[end]) == SEEN for end in (0, 1))
        for index in (moving, moving + 1):
            place = after + since * (complex(*scene.readings["predicted"][index]) - before)
            scene.readings["predicted"][index] = place.real, place.imag
            read_marker(now, luma, index, _SLACK)
    # One dot is of one stick alone.
    close_px = CLOSE * float(now.markers["shape"]["radius"][i : i + 2].min())
    apart = all(
        math.dist(place_of(one), place) > close_px for one in scene.readings[moving : moving + 2] for place in pair
    )
    found = alike and apart and _both_seen(scene, moving // 2)
    found = found and goes_with_picture(scene, middle - scene.rig["zero"][0].mean(axis=0), turn_of(scene, *pair))
    readings = scene.readings.copy()
    for part, was in zip(scene[:4], kept, strict=True):
        part[...] = was
    return readings if found else None


def _read(scene: Scene, luma: NDArray[np.uint8], index: int, places: Sequence[Point], *, jump: bool) -> list[Record]:
    """Return the readings of a marker at those of some positions that show the marker itself.

    The motion blur is first that of the expected motion, then, at positions on the marker's circle, that of a motion to
    the position. The latter is not tried for a stick that is followed alone, as any two dots are while markers are
    chosen. A marker of the base has another size after a ``jump`` of the camera to another distance.
    """
    out = np.zeros(len(places), READING)
    out["predicted"], expected = scene.readings["predicted"][index], scene.readings["path"][index].copy()
    own, shift, both = scene.sticks[index // 2], scene.rig["shift_now"][0], len(scene.sticks) > 1
    resized = jump and both and is_base(scene.rig[0], index // 2)
    found = []
    for one, place in zip(out, places, strict=True):
        goes = both and circle_misfit(own, shift, place, index % 2) <= SIGMAS
        for path in [expected, _path_to(scene, index, place)] if goes else [expected]:
            scene.readings["path"][index] = one["path"] = path
            if read_at(scene, luma, index, place, _SLACK, one) == SEEN:
                found.append(one)
                break
        else:
            found += [one] if resized and _read_at_its_size(scene, luma, index, place, one) else []
    scene.readings["path"][index] = expected
    return found


def _read_at_its_size(scene: Scene, luma: NDArray[np.uint8], index: int, place: Point, out: Record) -> bool:
    """Read a marker of a size that is unknown within a jump of the camera; return whether it is the marker itself.

    ``out`` is its reading at its usual size: a reading shows the size to first order. Three estimates are sufficient
    from half to one and a half of the size, for radii of 4 to 10 px.
    """
    markers, size = scene.markers.copy(), 1.0
    shape = markers["shape"][index]
    for _ in range(3):
        by = 1.0 + float(out["change"][0] / shape["radius"])
        size *= by
        if not passes(((size - 1.0) / JUMP) ** 2, 1):
            return False
        for name in ("radius", "strip", "edges", "window"):
            shape[name] *= by
        looks = (*scene.looks[:index], unused_look(float(shape["window"])), *scene.looks[index + 1 :])
        if read_at(scene._replace(markers=markers, looks=looks), luma, index, place, _SLACK, out) == SEEN:
            return True
    return False


def _path_to(scene: Scene, index: int, place: Point) -> Floats:
    """Return the motion per frame (2,), px, of a marker at constant speed from its last reading to a position."""
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
    """Return the positions in a region that look most like a dot of the marker's radius, the best first."""
    places = places_in(luma, float(marker["shape"]["radius"]), region)
    places = places[places[:, 4] == np.sign(marker["shape"]["contrast"])]
    best = places[np.argsort(-places[:, 0], kind="stable")[:MOST]]
    return [(x, y) for _, x, y, _, _ in best.tolist()]


def _both_seen(scene: Scene, stick: int) -> bool:
    return bool((scene.readings["state"][2 * stick : 2 * stick + 2] == SEEN).all())


def place_of(record: Record) -> Point:
    """Return the position of a marker or a reading, px."""
    return float(record["x"]), float(record["y"])


def direction(a: Point, b: Point) -> float:
    """Return the direction from a to b in the picture (y down)."""
    return math.atan2(b[1] - a[1], b[0] - a[0])
