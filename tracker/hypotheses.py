"""Which two of several pairs of dots are the sticks: what the film's motion says of each couple of pairs.

Dots that look like a stick's markers may lie on a ruler or a frame beside the rig. A picture does not tell them from
the markers; the film does. Of a rig is known that its base stands, that its moving stick goes around an axis, that both
sticks lie in line with that axis, and that they are alike in make. So every pair is followed by itself, and a couple
(base i, moving j) explains all the dots of the film by

    −2 ln p = s_i + t_j + Σ_d min(s_d, c_dj) + δ_ij² / σ_j² + ln σ_j² + u_ij − 2 ln g_ij,    σ_j² = r² + δ_jj² + σ_c²

up to a constant of all couples. s and t are χ² of a marker as one that stands and as one that goes around a circle, of
a usual frame (what errs is correlated over a film, and counts once), over what the camera's shaking adds to it; c_dj is
that of a dot d of neither stick as one that is carried around by pair j. Frames in which the dots of i, or d, may be
those of j tell nothing of them: what was followed as two may be one from where they met.
δ_ij is how far the axis that pair j shows lies beside the line of pair i. Markers are put on the middle of a stick
within their radius r, and sticks of one rig are made alike: as far as the axis is beside the moving stick's own line it
may be beside the base's. σ_c is what is not known of the axis; of a stick that hardly turned that is all, and no couple
is better than another. u_ij is χ² of the ratios of their dots' steps in brightness, of the light around them, and of
their lengths. g_ij: as much as the moving stick goes on to the axis, by the brightness of the line to it, the base is
expected to; and where the axis lies beyond the inner marker of one of them, it lies between those of the other with
the probability that is left for what is not usual; a dot on the axis, where sticks have a shaft or a screw, is a marker
with that probability, too. All count once the axis is known to a marker's radius.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from torsight.core.tracks import MarkerTracks
from torsight.core.units import Flags, Floats
from tracker.appearance.lucas_kanade import READING
from tracker.detect.given_positions import LOOKED_AT
from tracker.detect.sticks import LIKE, SIZES, Stick, reaches, towards_axis
from tracker.follow.followed_dots import DotState
from tracker.follow.judgement import MOVED_RAD, NEAR
from tracker.follow.marker import markers_on
from tracker.follow.motion_model import STALE
from tracker.follow.rotation_axis import STANDS_PX, axis_weight, suppose_axis, turned
from tracker.frames.frame import Frame
from tracker.innovation import SIGMAS, SURE, passes
from tracker.rows import SEEN
from tracker.stick_direction import square

Places = NDArray[np.complex128]

_NOWHERE: Final = complex(math.nan, math.nan)
"""The place of a marker that is not seen."""
_KEPT: Final = ["x", "y", "covariance"]
_NOT_READ: Final = np.full(2, np.nan, np.dtype([(name, READING[name]) for name in _KEPT]))
"""What is kept of the readings of a pair, and of one that was not seen."""


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
        unlike = [one for one, rad in zip(others, apart, strict=True) if rad > MOVED_RAD]
        return cls(
            taken,
            tuple(one for one in unlike if one.probability > 1.0 - SURE),
            1.0 - sum(one.probability for one in unlike),
            sum(one.probability * rad**2 for one, rad in zip(others, apart, strict=True)),
        )


@dataclass(frozen=True, slots=True, eq=False)
class _Motion:
    """What a pair's readings say: χ² if it turns, about which axis (2,), and how far its line is off.

    ``places`` (n, 2), complex, are its markers in every frame, NaN where one was not seen; ``variance_px2`` is that of
    the axis; px.
    """

    places: Places
    turns: float
    axis: Floats
    variance_px2: float
    beside_px: float

    @property
    def unit(self) -> Places:
        """Its direction (n,) in every frame, complex."""
        return np.asarray(np.exp(1j * np.angle(self.places[:, 1] - self.places[:, 0])))


def _usual(off_px: Places) -> Floats:
    """Return χ² of markers that are off by (…, n), NaN where they are not seen, in a usual one of n frames."""
    return np.asarray(_median(np.abs(off_px) ** 2) / STANDS_PX**2)


def _stands(places: Places) -> Floats:
    """Return χ² of markers at places (…, n) as ones that stand."""
    return _usual(places - _median(places.real)[..., None] - 1j * _median(places.imag)[..., None])


def _carried(places: Places, moving: _Motion) -> Floats:
    """Return χ² of markers at places (…, n) as ones that are carried around by a moving pair."""
    arms = (places - complex(*moving.axis)) * np.conj(moving.unit)
    return _usual(arms - _median(arms.real)[..., None] - 1j * _median(arms.imag)[..., None])


def _median(values: Floats) -> Floats:
    """Return the median of what is known along the last axis, 0 where nothing is."""
    last = np.isfinite(values).sum(axis=-1, keepdims=True) - 1
    if not (last >= 0).any():
        return np.zeros(values.shape[:-1])
    # What is not known comes last; numpy's nanmedian works on masked arrays, for six times as long.
    ordered = np.sort(values, axis=-1)
    low, high = (np.take_along_axis(ordered, np.maximum(at // 2, 0), axis=-1) for at in (last, last + 1))
    return np.asarray(np.where(last >= 0, 0.5 * (low + high), 0.0)[..., 0])


class Weighing:
    """Couples of pairs that were found in one picture ``luma``, followed and weighed frame by frame."""

    def __init__(self, luma: NDArray[np.uint8], couples: Sequence[tuple[Stick, Stick]]) -> None:
        self._luma, self._couples = luma, couples
        self._pairs = {id(pair): pair for couple in couples for pair in couple}
        self._states = {key: DotState(markers_on(luma, pair)) for key, pair in self._pairs.items()}
        self._time_s: list[float] = []
        self._any_seen = True
        self._read: dict[int, list[NDArray[np.void]]] = {key: [] for key in self._pairs}

    def add(self, frame: Frame) -> None:
        """Follow every pair into the next frame.

        Where all were lost at once the picture is of something else, or all is covered: the base comes back where it
        stood, and none is searched for until one is seen.
        """
        self._time_s.append(frame.time_s)
        any_seen = False
        for key, state in self._states.items():
            read = _NOT_READ
            if frame.luma is not None and not frame.damaged:
                luma, time_s = frame.luma, frame.time_s
                seen = state.step(luma, time_s, np.zeros(2)) if self._any_seen else state.glance(luma, time_s)
                if (seen["state"] == SEEN).all():
                    read, any_seen = seen[_KEPT].astype(_NOT_READ.dtype), True
            self._read[key].append(read)
        self._any_seen = any_seen

    def weighed(self, *, every: int = 1) -> list[Couple]:
        """Return the couples, each with either pair as the base, the likeliest first; by every so-many-th frame."""
        return _weighed(self._luma, self._couples, self._motion(every))

    def stands(self, couple: Couple) -> bool:
        """Return whether a couple's base keeps its dots' distance and direction, wherever the camera goes.

        No dot of either stick lies on the axis then: of such a one nothing says that it stands or turns.
        """
        motion = self._motion(1)
        base, turning = (
            next(key for key, pair in self._pairs.items() if pair.is_of(stick))
            for stick in (couple.base, couple.moving)
        )
        radius_px, moving = max(couple.base.inner.radius_px, couple.base.outer.radius_px), motion[turning]
        if moving.variance_px2 < radius_px**2 and _any_lies_at(couple.base, couple.moving, moving.axis):
            return False
        places = _beside({base: couple.base}, motion, turning)
        # Both dots are off by STANDS_PX each.
        return passes(0.5 * float(_stands(places[1] - places[0])), 2)

    def tracks(self, couple: Couple, *, every: int = 1) -> MarkerTracks:
        """Return what was read of a couple's markers in the frames since the picture, or in every so-many-th.

        Nothing was where one dot was read for both sticks.
        """
        read = np.concatenate([self._of(stick, every) for stick in (couple.base, couple.moving)], axis=1)
        places = read["x"] + 1j * read["y"]
        radius_px = max(couple.base.inner.radius_px, couple.base.outer.radius_px)
        read[_nearer(radius_px, places[:, :2], places[:, 2:]).any(axis=(1, 2))] = _NOT_READ[0]
        position_px = np.stack([read["x"], read["y"]], axis=-1)
        height, width = self._luma.shape
        return MarkerTracks(
            frame=np.arange(len(read), dtype=np.int64),
            time_s=np.array(self._time_s[::every]),
            position_px=position_px,
            covariance_px2=square(read["covariance"]),
            valid=np.isfinite(position_px[..., 0]),
            size_px=(width, height),
        )

    def _of(self, stick: Stick, every: int) -> NDArray[np.void]:
        """Return what was read (n, 2) of a stick's markers, the inner one first."""
        key, pair = next((key, pair) for key, pair in self._pairs.items() if pair.is_of(stick))
        read = np.array(self._read[key][::every], _NOT_READ.dtype).reshape(-1, 2)
        return read if pair.inner is stick.inner else read[:, ::-1]

    def _motion(self, every: int) -> dict[int, _Motion]:
        height, width = self._luma.shape
        found = {}
        for key, state in self._states.items():
            read = self._of(self._pairs[key], every)
            found[key] = _motion(state, read["x"] + 1j * read["y"], (width, height))
        return found


def weigh_couples(
    luma: NDArray[np.uint8], couples: Sequence[tuple[Stick, Stick]], frames: Iterable[Frame]
) -> tuple[list[Couple], bool]:
    """Return couples of pairs, each with either as the base, the likeliest first; and whether that one's base stands.

    ``luma`` is the picture in which they were found, ``frames`` are those after it: they are taken until a couple is as
    sure as :data:`tracker.innovation.SURE`, or to their end; no more than markers are looked for in where only which
    stick moves is open. Couples of which the film tells nothing keep their order.
    """
    weighing = Weighing(luma, couples)
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
            if found[0].probability > SURE and before and before[0].probability > SURE:
                break
            due *= 2
    else:
        found = weighing.weighed()
    return found, weighing.stands(found[0])


def _weighed(
    luma: NDArray[np.uint8], couples: Sequence[tuple[Stick, Stick]], motion: dict[int, _Motion]
) -> list[Couple]:
    both = [pair for one, two in couples for pair in ((one, two), (two, one))]
    # Hand-held, all dots go to and fro by what the steadiest one does: their errors are larger by as much.
    shake = 1.0 + min(float(_stands(one.places.T).min()) for one in motion.values())
    stands, rest = _explained(both, motion)
    score = np.array(
        [_score(luma, *couple, motion, stands=own, shake=shake) for couple, own in zip(both, stands, strict=True)]
    )
    score -= 0.5 * rest / shake
    chance = np.exp(score - score.max())
    chance /= chance.sum()
    found: list[Couple] = []
    for index in np.argsort(-chance, kind="stable").tolist():
        base, moving = both[index]
        found.append(Couple(*_inner_first(base, moving, motion[id(moving)]), probability=float(chance[index])))
    return found


def _explained(both: list[tuple[Stick, Stick]], motion: Mapping[int, _Motion]) -> tuple[Floats, Floats]:
    """Return χ² of the base's dots as ones that stand, for each couple, and of all dots that are of neither stick.

    Such a dot stands, or is carried by the moving stick. It may be of several pairs: that counts in which it is
    explained best.
    """
    pairs = {id(pair): pair for couple in both for pair in couple}
    at = {key: number for number, key in enumerate(pairs)}
    dots = [[id(pair.inner), id(pair.outer)] for pair in pairs.values()]
    number = np.unique(dots, return_inverse=True)[1].reshape(-1, 2)
    found: dict[int, tuple[Floats, Floats]] = {}
    for key in {id(moving) for _, moving in both}:
        places, best = _beside(pairs, motion, key), np.full(number.max() + 1, np.inf)
        stand = _stands(places)
        np.minimum.at(best, number.ravel(), np.minimum(stand, _carried(places, motion[key])))
        found[key] = stand.reshape(-1, 2).sum(axis=1), best
    told = []
    for base, moving in both:
        stand, best = found[id(moving)]
        own = number[[at[id(base)], at[id(moving)]]]
        told.append((stand[at[id(base)]], best.sum() - best[own].sum()))
    stands, rest = np.array(told).T
    return stands, rest


def _beside(pairs: Mapping[int, Stick], motion: Mapping[int, _Motion], key: int) -> Places:
    """Return where the dots of pairs are (2 p, n), without the frames in which one may be a dot of the moving pair."""
    places = np.stack([motion[other].places for other in pairs])
    near_px = NEAR * np.array([max(pair.inner.radius_px, pair.outer.radius_px) for pair in pairs.values()])
    near = _nearer(near_px[:, None, None, None], places, motion[key].places).any(axis=-1)
    return np.asarray(np.where(near, _NOWHERE, places).transpose(0, 2, 1).reshape(2 * len(pairs), -1))


def _inner_first(base: Stick, moving: Stick, motion: _Motion) -> tuple[Stick, Stick]:
    """Return a couple with the markers nearer to the axis first: that of the motion, or where both lines cross."""
    if math.sqrt(motion.variance_px2) > moving.length_px:
        return towards_axis(base, moving)
    x, y = motion.axis.tolist()
    return base.towards(x, y), moving.towards(x, y)


def _motion(state: DotState, at: Places, size_px: tuple[int, int]) -> _Motion:
    """Return what the places ``at`` (n, 2), complex, of a pair say, NaN where it was not seen.

    Nothing speaks for or against a pair that was never seen.
    """
    width, height = size_px
    axis = state.scene.sticks["axis"][0].copy()
    # Before anything moves the axis may be anywhere around the middle of the picture.
    anywhere_px2 = 0.25 * (width**2 + height**2)
    suppose_axis(axis, 0.5 * width, 0.5 * height, math.sqrt(anywhere_px2))
    nowhere = np.array([0.5 * width, 0.5 * height])
    arms = axis["arm"][:, 0] + 1j * axis["arm"][:, 1]
    if not np.isfinite(at).any() or not axis["known"]:
        return _Motion(at, 0.0, nowhere, anywhere_px2, 0.0)
    beside_px = abs(float(arms.mean().imag))
    # Arms are told along the line through both markers: what is across it is how far the axis is beside.
    found = _Motion(at, 0.0, axis["centre"], STANDS_PX**2 / axis_weight(axis), beside_px)
    return replace(found, turns=_usual((at - complex(*axis["centre"])).T - found.unit * arms[:, None]).sum())


def _score(
    luma: NDArray[np.uint8],
    base: Stick,
    turning: Stick,
    motion: Mapping[int, _Motion],
    *,
    stands: float,
    shake: float,
) -> float:
    """Return the logarithm of how well a couple explains its own motion, up to a constant of all couples.

    ``stands`` is χ² of the base's dots as ones that stand, ``shake`` is by how much the variance of a marker's
    place is larger than that before a camera that stands.
    """
    moving = motion[id(turning)]
    x, y = moving.axis.tolist()
    ux, uy = (
        (base.outer.x_px - base.inner.x_px) / base.length_px,
        (base.outer.y_px - base.inner.y_px) / base.length_px,
    )
    beside_px = ux * (y - base.inner.y_px) - uy * (x - base.inner.x_px)
    radius_px = max(base.inner.radius_px, base.outer.radius_px)
    spread = radius_px**2 + moving.beside_px**2 + moving.variance_px2
    misfit = (stands + moving.turns) / shake
    misfit += beside_px**2 / spread + _unlike(base, turning)
    goes_on = 0.0
    if moving.variance_px2 < radius_px**2:
        (bright, dark), (of_bright, of_dark) = (reaches(luma, one.towards(x, y), x, y) for one in (base, turning))
        share = (of_bright + 1.0) / (of_bright + of_dark + 2.0)
        goes_on = bright * math.log(share) + dark * math.log(1.0 - share)
        goes_on += math.log(1.0 - SURE) * (_holds(base, x, y) != _holds(turning, x, y))
        goes_on += math.log(1.0 - SURE) * _any_lies_at(base, turning, moving.axis)
    return float(goes_on - 0.5 * (misfit + math.log(spread)))


def _nearer(limit_px: float | Floats, one: Places, other: Places) -> Flags:
    """Return which dots (…, n, 2) are nearer to those of a pair (n, 2) than some distance, (…, n, 2, 2)."""
    between_px: Floats = np.abs(one[..., None] - other[:, None])
    return np.asarray(between_px < limit_px)


def _holds(stick: Stick, x_px: float, y_px: float) -> bool:
    """Return whether a place lies between a stick's markers, along it."""
    ends = ((stick.inner, stick.outer), (stick.outer, stick.inner))
    return all((b.x_px - a.x_px) * (x_px - a.x_px) + (b.y_px - a.y_px) * (y_px - a.y_px) > 0.0 for a, b in ends)


def _any_lies_at(base: Stick, moving: Stick, place: Floats) -> bool:
    """Return whether a dot of two sticks lies at a place (2,)."""
    dots = (base.inner, base.outer, moving.inner, moving.outer)
    return any(math.hypot(dot.x_px - place[0], dot.y_px - place[1]) < dot.radius_px for dot in dots)


def _unlike(one: Stick, two: Stick) -> float:
    """Return χ² of two sticks as those of one make: step of their dots in brightness, light around, and length."""
    values = [
        ([getattr(stick.inner, what) + getattr(stick.outer, what) for stick in (one, two)], LIKE)
        for what in ("step", "light")
    ]
    values.append(([one.length_px, two.length_px], SIZES))
    return sum((SIGMAS * math.log(a / b) / math.log(limit)) ** 2 for (a, b), limit in values)
