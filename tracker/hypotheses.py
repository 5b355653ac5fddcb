"""Which four of many dots are the markers: what the film's motion says of each couple of pairs.

Dots that look like a stick's markers may lie on a ruler, a sheet with holes or a frame beside the rig. A picture does
not tell them from the markers; the film does. Of a rig is known that its base stands, that its moving stick goes around
an axis, that both sticks lie in line with that axis, and that they are alike in make. So every dot is followed by
itself. The pairs that turn may be the moving stick, those that stand beside each of them its base, and a couple (base
i, moving j) explains all the dots of the film by

    −2 ln p = s_i + t_j + Σ_d min(s_d, c_dj) + δ_ij² / σ_j² + ln σ_j² + u_ij − 2 ln g_ij,    σ_j² = r² + δ_jj² + σ_c²

up to a constant of all couples. s and t are χ² of a marker as one that stands and as one that goes around a circle, of
a usual frame (what errs is correlated over a film, and counts once; frames are those between which the dots went
equally far), over what the camera's shaking adds to it; c_dj is that of a dot d of neither stick as one that is carried
around by pair j. Frames in which the dots of i, or d, may be those of j tell nothing of them: what was followed as two
may be one from where they met.
δ_ij is how far the axis that pair j shows lies beside the line of pair i. Markers are put on the middle of a stick
within their radius r, and sticks of one rig are made alike: as far as the axis is beside the moving stick's own line it
may be beside the base's. σ_c is what is not known of the axis. u_ij is χ² of the ratios of their dots' steps in
brightness, of the light around them, and of their lengths, of how clearly the moving stick's are dots, and of how much
less clearly the base's are. g_ij: as much as the moving stick goes on to the axis, by the brightness of the line to it,
the base is expected to; and where the axis lies beyond the inner marker of one of them, it lies between those of the
other with the probability that is left for what is not usual; a dot on the axis, where sticks have a shaft or a screw,
is a marker with that probability, too.
All count once the axis is known to a marker's radius.
The markers may be none of the dots. Such a couple is counted as one that is as clear as what is taken at first sight,
and fits as badly as three standard deviations allow: what is fainter than that, or fits worse, is not sure.
As long as nothing turns, the couples are those that the picture shows.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from torsight.core.tracks import MarkerTracks
from torsight.core.units import Flags, Floats, Ints
from tracker.appearance.dot_fit import Dot
from tracker.detect.dots import EXPLAINED
from tracker.detect.given_positions import LOOKED_AT
from tracker.detect.pairs import CLEARNESS, Pairs
from tracker.detect.sticks import (
    CLEAR,
    CLEARER,
    MOST,
    Stick,
    couples_in,
    reaches,
    stick_of,
    strip_share,
    towards_axis,
)
from tracker.dot_paths import DotPaths
from tracker.follow.judgement import MOVED_RAD, NEAR
from tracker.follow.motion_model import STALE
from tracker.follow.rotation_axis import OFF_CIRCLE_PX, STANDS_PX, STEP_RAD, turned
from tracker.frames.frame import Frame
from tracker.innovation import LIMITS, SIGMAS, SURE, passes
from tracker.stick_direction import square

Places = NDArray[np.complex128]

_NOWHERE: Final = complex(math.nan, math.nan)
"""The place of a marker that is not seen."""
_FRAMES: Final = 4 * STALE
"""Frames that are weighed at most: a median of so many is known to a sixth of its spread."""


@dataclass(frozen=True, slots=True)
class Couple:
    """Two pairs of dots as base and moving stick, inner markers first, and how likely they are among all couples."""

    base: Stick
    moving: Stick
    probability: float

    def swaps(self, other: Couple) -> bool:
        """Return whether the base here is the moving stick there, and the other way round."""
        return self.base.is_of(other.moving) and self.moving.is_of(other.base)

    @property
    def _angle_rad(self) -> float:
        return self.moving.direction_rad - self.base.direction_rad

    def apart_rad(self, other: Couple) -> float:
        """Return by how much the angles of two couples differ, where they were found.

        That holds for the film where the moving sticks are one, or one carries the other.
        """
        return turned(self._angle_rad, other._angle_rad)

    def to_json(self) -> dict[str, Any]:
        """Return what ``track.json`` says of it, as in a marker file."""
        sticks = {name: stick.places_px for name, stick in (("base", self.base), ("moving", self.moving))}
        return {**sticks, "probability": self.probability}


@dataclass(frozen=True, slots=True)
class Choice:
    """Which couple was taken, and what the others make of that.

    ``rivals`` are those that neither picture nor motion rule out and that have another angle. ``sure`` is the
    probability that the couple taken has the right one: which of two sticks is the base the film itself will tell, and
    couples whose angles differ by less than a base turns are one answer. ``spread_rad2`` is the variance of the angle
    by all others, each by its probability.
    """

    taken: Couple
    rivals: tuple[Couple, ...]
    sure: float
    spread_rad2: float

    @classmethod
    def of(cls, couples: Sequence[Couple]) -> Choice:
        """Return what is taken of weighed couples, the likeliest first."""
        taken, others = couples[0], [one for one in couples[1:] if not one.swaps(couples[0])]
        apart = [one.apart_rad(taken) for one in others]
        unlike = {id(one): one for one, rad in zip(others, apart, strict=True) if rad > MOVED_RAD}
        return cls(
            taken,
            tuple(one for one in unlike.values() if one.probability > 1.0 - SURE),
            sum(one.probability for one in couples if id(one) not in unlike),
            # Of no couple the angle may be any: as that of all, evenly.
            sum(one.probability * rad**2 for one, rad in zip(others, apart, strict=True))
            + (1.0 - sum(one.probability for one in couples)) * math.pi**2 / 3.0,
        )


class _Axis(NamedTuple):
    """Where a pair that turns shows the axis: variance of that, and how far it is beside the pair's line, px."""

    place: complex
    variance_px2: float
    beside_px: float


class _Bound(NamedTuple):
    """How likely a couple is at most, by a logarithm: numbers of the dots of base and moving stick, and the axis."""

    score: float
    base: tuple[int, int]
    moving: tuple[int, int]
    axis: _Axis


@dataclass(frozen=True, slots=True, eq=False)
class _Turning:
    """Pairs of dots that turn (p), over n frames: which dots, χ² of their circles, and the axes that they show.

    ``ends`` (p, 2) are numbers of dots, ``unit`` (n, p), complex, is a pair's direction in every frame, NaN where it
    was not seen, ``turns`` χ², ``axis`` complex, ``variance_px2`` that of the axis, ``beside_px`` how far it is beside
    the pair's line.
    """

    ends: Ints
    unit: Places
    turns: Floats
    axis: Places
    variance_px2: Floats
    beside_px: Floats

    def of(self, which: Ints | Flags) -> _Turning:
        """Return some of the pairs."""
        chosen = (self.ends[which], self.unit[:, which], self.turns[which], self.axis[which])
        return _Turning(*chosen, self.variance_px2[which], self.beside_px[which])


def _usual(off_px: Places) -> Floats:
    """Return χ² of markers that are off by (n, …), NaN where they are not seen, in a usual one of n frames."""
    return np.asarray(_median(np.abs(off_px) ** 2) / STANDS_PX**2)


def _stands(places: Places) -> Floats:
    """Return χ² of markers at places (n, …) as ones that stand."""
    return _usual(places - _median(places.real) - 1j * _median(places.imag))


def _median(values: Floats) -> Floats:
    """Return the median of what is known along the first axis, 0 where nothing is."""
    last = np.isfinite(values).sum(axis=0, keepdims=True) - 1
    if not (last >= 0).any():
        return np.zeros(values.shape[1:])
    # What is not known comes last; numpy's nanmedian works on masked arrays, for six times as long.
    ordered = np.sort(values, axis=0)
    low, high = (np.take_along_axis(ordered, np.maximum(at // 2, 0), axis=0) for at in (last, last + 1))
    return np.asarray(np.where(last >= 0, 0.5 * (low + high), 0.0)[0])


class Weighing:
    """Dots that were found in one picture ``luma``, followed frame by frame, and what they make of couples of pairs."""

    def __init__(self, luma: NDArray[np.uint8], dots: Sequence[Dot]) -> None:
        self._luma = luma
        self._paths = DotPaths(luma, dots)
        self._time_s: list[float] = []
        self._pairs = Pairs(self._paths.dots)
        self._strips: dict[tuple[int, int], float] = {}

    def add(self, frame: Frame) -> None:
        """Follow every dot into the next frame."""
        self._time_s.append(frame.time_s)
        self._paths.add(None if frame.damaged else frame.luma)

    def weighed(self) -> list[Couple]:
        """Return the couples, the likeliest first; none where picture and motion show none."""
        places = self._paths.places
        places = places[_apart(places)]
        stands = _stands(places)
        turning = self._turning(places, stands)
        if not len(turning.ends):
            return self._shown()
        # Hand-held, all dots go to and fro by what the steadiest one does: their errors are larger by as much.
        shake = 1.0 + float(stands.min())
        found, none = list[_Bound](), -math.inf
        for j in range(len(turning.ends)):
            more, neither = self._with_bases(places, turning.of(np.array([j])), shake)
            found, none = found + more, max(none, neither)
        if not found:
            return self._shown()
        found.sort(key=lambda one: -one[0])
        best, sure = -math.inf, list[tuple[float, Couple]]()
        for most, base, moving, axis in found:
            # What the lines to the axis say takes away only: the rest is no longer as likely as rounding.
            if most < best + math.log(np.finfo(float).eps):
                break
            one, two = (stick_of(*(self._paths.dots[number] for number in pair)) for pair in (base, moving))
            score = most + self._goes_on(one, two, axis)
            best = max(best, score)
            sure.append((score, Couple(*_inner_first(one, two, axis), probability=0.0)))
        return _likeliest(sure, none=none)

    def _shown(self) -> list[Couple]:
        """Return the couples that the picture shows, in their order, with either pair as the base."""
        both = [pair for one, two in couples_in(self._luma, dots=self._paths.dots) for pair in ((one, two), (two, one))]
        unlike = [self._pairs.unlike(self._numbers(one)[None], self._numbers(two))[0] for one, two in both]
        return _likeliest(
            [(-0.5 * off, Couple(*towards_axis(*two), 0.0)) for off, two in zip(unlike, both, strict=True)]
        )

    def _turning(self, places: Places, stands: Floats) -> _Turning:
        """Return the pairs of dots that may be the moving stick's, by what turns explains of how they went."""
        height, width = self._luma.shape
        found = _circles(places, self._pairs.ends, (width, height))
        went = stands[found.ends].sum(axis=1)
        # What is left of a pair that turns is no more than a fit leaves of a dot, and it goes further than a camera's
        # shaking takes the steadiest dot, by its two values.
        turns, most = found.turns < (1.0 - EXPLAINED) * went, 0.5 * float(stands.min()) * LIMITS[3]
        found = found.of(turns & (went - found.turns > most))
        if not len(found.ends):
            return found
        worth = CLEARNESS * np.log(self._pairs.score_of(found.ends)) - 0.5 * found.turns
        return found.of(np.argsort(-worth, kind="stable")[:MOST])

    def _with_bases(self, places: Places, moving: _Turning, shake: float) -> tuple[list[_Bound], float]:
        """Return the likeliest bases of one pair that turns, and how likely it is that none is the markers'."""
        own, pairs = moving.ends[0], self._pairs
        beside = _beside(places, own, pairs.radius_px)
        stand = _stands(beside)
        rest = np.minimum(stand, _carried(beside, moving))
        rest[own] = 0.0
        axis = _Axis(complex(moving.axis[0]), float(moving.variance_px2[0]), float(moving.beside_px[0]))
        apart = ~np.isin(pairs.ends, own).any(axis=1)
        ends = pairs.ends[apart]
        one, two = places[0, ends[:, 0]], places[0, ends[:, 1]]
        along = (two - one) / np.abs(two - one)
        beside_px = ((axis.place - one) * np.conj(along)).imag
        spread = pairs.radius_px[ends].max(axis=1) ** 2 + axis.beside_px**2 + axis.variance_px2
        misfit = (stand[ends].sum(axis=1) + moving.turns[0] + rest.sum() - rest[ends].sum(axis=1)) / shake
        misfit += beside_px**2 / spread + np.log(spread) + pairs.unlike(ends, own)
        clear = np.log(pairs.score_of(own[None]))
        # Of one make, the base's dots are as clear as the moving stick's; clearer ones are no better.
        less = np.maximum(clear - np.log(pairs.score_of(ends)), 0.0)
        misfit += (SIGMAS * less / math.log(CLEARER)) ** 2
        score = 2.0 * CLEARNESS * clear - 0.5 * misfit
        first, bounds = (int(own[0]), int(own[1])), list[_Bound]()
        for k in np.argsort(-score, kind="stable")[:MOST].tolist():
            second = (int(ends[k, 0]), int(ends[k, 1]))
            bounds.append(_Bound(float(score[k]) + self._strip(first) + self._strip(second), second, first, axis))
        beside_px2 = pairs.radius_px[own].max() ** 2 + axis.beside_px**2 + axis.variance_px2
        none = 2.0 * CLEARNESS * math.log(CLEAR) - 0.5 * ((moving.turns[0] + rest.sum()) / shake + LIMITS[3])
        return bounds, float(none - 0.5 * math.log(beside_px2))

    def _strip(self, pair: tuple[int, int]) -> float:
        """Return the logarithm of what the line between two dots, by their numbers, says of them as a stick."""
        if pair not in self._strips:
            one, two = (self._paths.dots[number] for number in pair)
            # It is told by eight points at least.
            self._strips[pair] = CLEARNESS * math.log(max(strip_share(self._luma, one, two), 0.125))
        return self._strips[pair]

    def _goes_on(self, base: Stick, moving: Stick, axis: _Axis) -> float:
        """Return the logarithm of what the lines to the axis say of two sticks."""
        radius_px, (x, y) = max(base.inner.radius_px, base.outer.radius_px), (axis.place.real, axis.place.imag)
        if axis.variance_px2 >= radius_px**2:
            return 0.0
        (bright, dark), (of_bright, of_dark) = (reaches(self._luma, one.towards(x, y), x, y) for one in (base, moving))
        share = (of_bright + 1.0) / (of_bright + of_dark + 2.0)
        goes_on = bright * math.log(share) + dark * math.log(1.0 - share)
        goes_on += math.log(1.0 - SURE) * (_holds(base, x, y) != _holds(moving, x, y))
        return goes_on + math.log(1.0 - SURE) * _any_lies_at(base, moving, axis.place)

    def read(self, couple: Couple) -> float:
        """Return the share of frames in which one of a couple's sticks is read: the other one may lie under it.

        None as long as the moving one does not turn, or where the base does not keep its dots' distance and direction,
        wherever the camera goes; nor where a dot of either lies on the axis: nothing says that it stands or turns.
        """
        base, moving = (self._numbers(stick) for stick in (couple.base, couple.moving))
        height, width = self._luma.shape
        every = self._paths.places
        places = every[_apart(every)]
        turning = _circles(places, moving[None], (width, height))
        radius_px = max(couple.base.inner.radius_px, couple.base.outer.radius_px)
        known = len(turning.ends) and turning.variance_px2[0] < radius_px**2
        beside = _beside(places, moving, self._pairs.radius_px)[:, base]
        if (
            not len(turning.ends)
            or (known and _any_lies_at(couple.base, couple.moving, complex(turning.axis[0])))
            # Both dots are off by STANDS_PX each.
            or not passes(0.5 * float(_stands(beside[:, 1] - beside[:, 0])), 2)
        ):
            return 0.0
        seen = np.isfinite(every[1:])
        return float((seen[:, base].all(axis=1) | seen[:, moving].all(axis=1)).mean())

    def tracks(self, couple: Couple, *, every: int = 1) -> MarkerTracks:
        """Return what was read of a couple's markers in the frames since the picture, or in every so-many-th.

        Nothing was where one dot was read for both sticks.
        """
        base, moving = (self._numbers(stick) for stick in (couple.base, couple.moving))
        places, covariance = self._paths.places[1::every], self._paths.covariance[1::every]
        places[:, base] = _beside(places, moving, self._pairs.radius_px)[:, base]
        own = np.concatenate([base, moving])
        places = places[:, own]
        height, width = self._luma.shape
        return MarkerTracks(
            frame=np.arange(len(places), dtype=np.int64),
            time_s=np.array(self._time_s[::every]),
            position_px=np.stack([places.real, places.imag], axis=-1),
            covariance_px2=square(covariance[:, own]),
            valid=np.isfinite(places),
            size_px=(width, height),
        )

    def _numbers(self, stick: Stick) -> Ints:
        """Return which dots are a stick's, the inner one first."""
        dots = [id(dot) for dot in self._paths.dots]
        return np.array([dots.index(id(dot)) for dot in (stick.inner, stick.outer)])


def weigh_couples(luma: NDArray[np.uint8], dots: Sequence[Dot], frames: Iterable[Frame]) -> tuple[list[Couple], float]:
    """Return couples of pairs, the likeliest first, and in which share of the frames that one is read.

    ``luma`` is the picture in which dots were found, ``frames`` are those after it: they are taken until a couple is as
    sure as :data:`tracker.innovation.SURE`, or to their end; no more than markers are looked for in where only which
    stick moves is open.
    """
    weighing = Weighing(luma, dots)
    due, found = STALE, list[Couple]()
    for number, frame in enumerate(frames, 1):
        weighing.add(frame)
        if number == due:
            before, found = found, weighing.weighed()
            # Which two pairs are the sticks is settled, whichever of them is the base.
            alike = sum(one.probability for one in found if one is found[0] or one.swaps(found[0]))
            if number >= LOOKED_AT[-1] and alike > SURE:
                break
            # Twice, the second time on twice as many frames: what fits a short stretch may not fit a longer one.
            if found and before and min(found[0].probability, before[0].probability) > SURE:
                break
            due *= 2
    else:
        found = weighing.weighed()
    return found, weighing.read(found[0]) if found else 0.0


def _likeliest(found: list[tuple[float, Couple]], *, none: float = -math.inf) -> list[Couple]:
    """Return couples with their probabilities, the likeliest first, of the logarithms of how likely they are.

    ``none``: that of no couple.
    """
    if not found:
        return []
    score = np.array([one for one, _ in found])
    most = max(float(score.max()), none)
    chance = np.exp(score - most)
    chance /= chance.sum() + math.exp(none - most)
    order = np.argsort(-chance, kind="stable").tolist()
    return [replace(found[index][1], probability=float(chance[index])) for index in order]


def _apart(places: Places) -> Ints:
    """Return frames, the first among them, between which the dots at places (n, d) went equally far."""
    step = np.nan_to_num(np.abs(np.diff(places, axis=0)))
    # A dot that jumps was not followed.
    far = np.concatenate([[0.0], np.cumsum(np.sqrt((np.minimum(step, OFF_CIRCLE_PX) ** 2).sum(axis=1)))])
    return np.unique(np.searchsorted(far, np.linspace(0.0, far[-1], _FRAMES)).clip(0, len(places) - 1))


def _circles(places: Places, ends: Ints, size_px: tuple[int, int]) -> _Turning:
    """Return what places (n, d) say of pairs of dots (p, 2) as ones that turn: of those that do by more than a base.

    The axis is that of :mod:`tracker.follow.rotation_axis`, with frames that count by how far the pair turned.
    """
    middle = complex(0.5 * size_px[0], 0.5 * size_px[1])
    # Before anything moves the axis may be anywhere around the middle of the picture.
    guessed = (STANDS_PX / abs(middle)) ** 2
    first = places[0, ends[:, 1]] - places[0, ends[:, 0]]
    unit = places[:, ends[:, 1]] - places[:, ends[:, 0]]
    with np.errstate(invalid="ignore"):
        # What is not known, and two dots that were read as one.
        unit /= np.abs(unit)
    turn_rad = np.angle(unit * np.conj(first / np.abs(first)))
    moved = np.nanmax(np.abs(turn_rad), axis=0) > MOVED_RAD
    ends, unit = ends[moved], unit[:, moved]
    one, two = places[:, ends[:, 0]], places[:, ends[:, 1]]
    known = np.isfinite(unit)
    # Of a frame counts what the pair turned since the one before it, up to what makes it another one.
    before = np.zeros(unit.shape[1], complex)
    weight = np.zeros(unit.shape)
    for k in range(len(unit)):
        weight[k] = np.where(known[k], np.minimum(np.abs(np.angle(unit[k] * np.conj(before))) / STEP_RAD, 1.0), 0.0)
        before = np.where(known[k], unit[k], before)
    weight[0] = 1.0
    u, p, q = (np.where(known, at, 0.0) for at in (unit, one, two))
    n, turned = weight.sum(axis=0), (weight * u).sum(axis=0)
    back = [(weight * at * np.conj(u)).sum(axis=0) for at in (p, q)]
    worth = guessed + 2.0 * n - 2.0 * np.abs(turned) ** 2 / n
    axis = (guessed * middle + (weight * (p + q)).sum(axis=0) - turned * (back[0] + back[1]) / n) / worth
    arms = [(at - axis * np.conj(turned)) / n for at in back]
    turns = np.sum([_usual(at - axis - arm * unit) for at, arm in zip((one, two), arms, strict=True)], axis=0)
    beside_px = np.abs(0.5 * (arms[0] + arms[1]).imag)
    return _Turning(ends, unit, np.asarray(turns), axis, STANDS_PX**2 / worth, beside_px)


def _carried(places: Places, moving: _Turning) -> Floats:
    """Return χ² of markers at places (n, d) as ones that are carried around by one moving pair."""
    arms = (places - moving.axis[0]) * np.conj(moving.unit)
    return _usual(arms - _median(arms.real) - 1j * _median(arms.imag))


def _beside(places: Places, moving: Ints, radius_px: Floats) -> Places:
    """Return where dots are (n, d), without the frames in which one may be a dot of a moving pair (2,)."""
    near = np.zeros(places.shape, bool)
    for end in moving.tolist():
        near |= np.abs(places - places[:, end, None]) < NEAR * np.maximum(radius_px, radius_px[end])
    return np.asarray(np.where(near, _NOWHERE, places))


def _inner_first(base: Stick, moving: Stick, axis: _Axis) -> tuple[Stick, Stick]:
    """Return a couple with the markers nearer to the axis first: that of the motion, or where both lines cross."""
    if math.sqrt(axis.variance_px2) > moving.length_px:
        return towards_axis(base, moving)
    x, y = axis.place.real, axis.place.imag
    return base.towards(x, y), moving.towards(x, y)


def _holds(stick: Stick, x_px: float, y_px: float) -> bool:
    """Return whether a place lies between a stick's markers, along it."""
    ends = ((stick.inner, stick.outer), (stick.outer, stick.inner))
    return all((b.x_px - a.x_px) * (x_px - a.x_px) + (b.y_px - a.y_px) * (y_px - a.y_px) > 0.0 for a, b in ends)


def _any_lies_at(base: Stick, moving: Stick, place: complex) -> bool:
    """Return whether a dot of two sticks lies at a place."""
    dots = (base.inner, base.outer, moving.inner, moving.outer)
    return any(math.hypot(dot.x_px - place.real, dot.y_px - place.imag) < dot.radius_px for dot in dots)
