"""Choice of the markers among many dots: the probability of each couple, a base pair and a moving pair, by its motion.

Dots that look like a stick's markers may lie on a ruler, a sheet with holes or a frame beside the rig. One picture does
not distinguish them from the markers; the film does. In a rig the base is at rest, the moving stick turns about an
axis, both sticks point at that axis, and both are made in the same way. So every dot is followed separately. The pairs
of dots that turn may be the moving stick, pairs at rest away from it its base, and a couple (base i, moving j) explains
all the dots of the film by

    −2 ln p = s_i + t_j + Σ_d min(s_d, c_dj, o) + δ_ij² / σ_j² + ln σ_j² + u_ij − 2 ln(g_ij h_j),

up to a constant that all couples share, with σ_j² = r² + δ_jj² + σ_c². s and t are χ² of a marker at rest and of one on
a circle, in a median frame (errors are correlated over a film, and count once; frames are chosen so that the dots move
equally far between them), divided by the factor by which the camera's shaking increases it; c_dj is χ² of a dot d of
neither stick as one that is carried around by pair j. A dot may also be of something else that moves, a fan or a hand,
with the probability 1 − ``SURE`` = exp(−o / 2). Frames in which the dots of i, or d, may be those of j are left out:
once two dots have met, both readings may be of the same dot.
δ_ij is the distance of the axis shown by pair j from the line of pair i. Markers lie on the middle line of a stick to
within their radius r, and both sticks are made in the same way: the axis may be as far from the base's line as from
that of the moving stick. σ_c is the standard deviation of the axis. u_ij is χ² of the ratios of the dots' steps in
brightness and of the light around them (or, with the probability 1 − ``SURE``, each stick is made in its own way), of
the sticks' lengths, of the moving pair's score as dots on a stick, and of how far the base's score is below it. h_j is
the density of δ_jj for a stick over that for the line of any two dots. g_ij expects the base's line to the axis to be
bright where the moving stick's is, at the same distance from the axis: both have one hub. Where only one of the two
lines reaches, it is evidence neither for a couple nor against it. A base dot that is lost, without the moving pair over
it, counts as one that moves. The distances of both inner dots from the axis are as similar as lengths, but with a
Cauchy distribution: a base may be a frame around the rig. If the axis lies beyond the inner marker of one stick, the
probability that it lies between those of the other is only 1 − ``SURE``; so is that of a dot on the axis, where sticks
have a shaft or a screw, being a marker. These factors apply once the axis is known to within a marker's radius.
A marker may be none of the dots. That case has the probability of a couple with a misfit of three standard deviations,
whose moving pair is one marker and a dot as clear as one picture requires, and need not turn: couples that fit worse,
or of which one dot is less clear than the other, are not certain.
As long as nothing turns, the couples are those from the picture alone.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from torsight.core.tracks import MarkerTracks
from torsight.core.units import Flags, Floats, Ints
from tracker.appearance.dot_fit import Dot
from tracker.appearance.lucas_kanade import Places
from tracker.couples import Couple, likeliest
from tracker.detect.dots import EXPLAINED
from tracker.detect.given_positions import LOOKED_AT
from tracker.detect.pairs import CLEARNESS, Pairs
from tracker.detect.sticks import (
    CLEARER,
    MOST,
    SIZES,
    Stick,
    compared_to_axis,
    couples_in,
    has_rim,
    stick_of,
    strip_share,
    towards_axis,
)
from tracker.dot_paths import NOWHERE, DotPaths, median_known
from tracker.follow.judgement import MOVED_RAD, NEAR
from tracker.follow.motion_model import STALE
from tracker.follow.rotation_axis import OFF_CIRCLE_PX, STANDS_PX, STEP_RAD
from tracker.frames.frame import Frame
from tracker.innovation import LIMITS, SIGMAS, SURE, passes
from tracker.stick_direction import square

FRAMES: Final = 4 * STALE
"""Most frames that are evaluated: the median of so many is known to a sixth of its spread."""


class _Axis(NamedTuple):
    """Axis shown by a turning pair, px: its position, its variance, and its distance from the pair's line."""

    place: complex
    variance_px2: float
    beside_px: float


class _Bound(NamedTuple):
    """Upper bound of a couple's log probability, with the indices of both sticks' dots, and the axis."""

    score: float
    base: tuple[int, int]
    moving: tuple[int, int]
    axis: _Axis


@dataclass(frozen=True, slots=True, eq=False)
class _Turning:
    """Pairs of dots that turn (p), over n frames: their dots, χ² of their circles, and their axes.

    ``ends`` (p, 2) are indices of dots, ``unit`` (n, p), complex, is a pair's direction in every frame, NaN where it
    was not seen, ``turns`` (p,) is χ², ``axis`` (p,), complex, the axis, ``variance_px2`` its variance, ``beside_px``
    its distance from the pair's line.
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


def _usual(off_px: Places | Floats) -> Floats:
    """Return χ² of markers with residuals (n, …), NaN where they are not seen, in the median of n frames."""
    return np.asarray(median_known(np.abs(off_px) ** 2) / STANDS_PX**2)


def _stands(places: Places) -> Floats:
    """Return χ² of markers with positions (n, …) as ones at rest."""
    return _usual(_off_rest(places))


def _off_rest(places: Places) -> Places:
    """Return the residuals of markers with positions (n, …) as ones at rest."""
    return np.asarray(places - median_known(places.real) - 1j * median_known(places.imag))


class Weighing:
    """Dots that were found in one picture ``luma``, followed frame by frame, and the couples' probabilities by them.

    Dots that are known to be ``at_rest`` (d,) are not followed. ``none`` is the probability, by the last weighing, that
    the markers are none of the dots; 0 as long as they may be dots that have not turned yet.
    """

    def __init__(self, luma: NDArray[np.uint8], dots: Sequence[Dot], *, at_rest: Flags | None = None) -> None:
        self.none = 0.0
        self._luma = luma
        self._paths = DotPaths(luma, dots, np.zeros(len(dots), bool) if at_rest is None else at_rest)
        self.places_after = self._paths.places_after
        self._time_s: list[float] = []
        self._number = {id(dot): number for number, dot in enumerate(self._paths.dots)}
        self._pairs = Pairs(self._paths.dots)
        self._strips: dict[tuple[int, int], float] = {}

    def add(self, frame: Frame) -> None:
        """Follow every dot into the next frame."""
        self._time_s.append(frame.time_s)
        self._paths.add(None if frame.damaged else frame.luma)

    def weighed(self) -> list[Couple]:
        """Return the couples, the most probable first; none where picture and motion show none."""
        places, self.none = self._paths.places, 0.0
        places = places[_apart(places)]
        stands = _stands(places)
        turning = self._turning(places, stands)
        if not len(turning.ends):
            return self.shown
        # In a hand-held film all dots shake at least as much as the steadiest one, which increases their variance.
        shake = 1.0 + float(stands.min())
        found, none = list[_Bound](), -math.inf
        for j in range(len(turning.ends)):
            more, neither = self._with_bases(places, turning.of(np.array([j])), shake)
            found, none = found + more, max(none, neither)
        if not found:
            return self.shown
        found.sort(key=lambda one: -one[0])
        best, sure = -math.inf, list[tuple[float, Couple]]()
        for most, base, moving, axis in found:
            # The lines to the axis only reduce a probability: all further couples are below rounding.
            if most < best + math.log(np.finfo(float).eps):
                break
            one, two = (stick_of(*(self._paths.dots[number] for number in pair)) for pair in (base, moving))
            score = most + self._goes_on(one, two, axis)
            best = max(best, score)
            sure.append((score, Couple(*_inner_first(one, two, axis), probability=0.0)))
        couples = likeliest(sure, none=none)
        # Dots at rest that look like two sticks may turn yet.
        self.none = 0.0 if self.shown else 1.0 - sum(one.probability for one in couples)
        return couples

    @cached_property
    def shown(self) -> list[Couple]:
        """The couples from the picture alone, with either pair as the base, the most probable first."""
        found = couples_in(self._luma, dots=self._paths.dots)
        pairs = {id(stick): stick for couple in found for stick in couple}
        numbers = {one: self._numbers(stick).tolist() for one, stick in pairs.items()}
        ends = np.array([[numbers[id(one)], numbers[id(two)]] for one, two in found], np.int64).reshape(-1, 2, 2)
        score = -0.5 * self._pairs.unlike(ends[:, 0], ends[:, 1])
        order = np.argsort(-score, kind="stable")
        both = [
            (float(score[k]), Couple(*towards_axis(*couple), probability=0.0))
            for k in order[:MOST].tolist()
            for couple in (found[k], found[k][::-1])
        ]
        # Those beyond a list that anybody reads count together.
        return likeliest(both, none=float(np.logaddexp.reduce(score[order[MOST:]], initial=-np.inf)) + math.log(2.0))

    def _turning(self, places: Places, stands: Floats) -> _Turning:
        """Return the pairs of dots that may be the moving stick's: those whose motion is explained by a rotation."""
        height, width = self._luma.shape
        found = _circles(places, self._pairs.ends, (width, height))
        went = stands[found.ends].sum(axis=1)
        # A rotation leaves at most the share of a pair's motion that a fit may leave of a dot, and explains more motion
        # than the camera's shaking causes, which is estimated from both coordinates of the steadiest dot.
        turns, most = found.turns < (1.0 - EXPLAINED) * went, 0.5 * float(stands.min()) * LIMITS[3]
        found = found.of(turns & (went - found.turns > most))
        if not len(found.ends):
            return found
        worth = CLEARNESS * np.log(self._pairs.score_of(found.ends)) - 0.5 * found.turns
        return found.of(np.argsort(-worth, kind="stable")[:MOST])

    def _with_bases(self, places: Places, moving: _Turning, shake: float) -> tuple[list[_Bound], float]:
        """Return the most probable bases of one turning pair, and the log likelihood that none of them is right.

        The bases' log likelihoods are upper bounds: they do not include the lines to the axis.
        """
        own, pairs = moving.ends[0], self._pairs
        beside = _beside(places, own, pairs.radius_px)
        # A dot at rest is lost as seldom as something else moves, unless the moving pair may lie over it.
        gone = np.where(np.isnan(places), math.sqrt(LIMITS[1] * shake) * STANDS_PX, np.abs(_off_rest(beside)))
        stand, carried = _usual(gone), _stands((beside - moving.axis[0]) * np.conj(moving.unit))
        # A dot may also be of something else that moves: −2 ln(1 − SURE) is the quantile for two coordinates.
        rest = np.minimum(np.minimum(stand, carried), LIMITS[1] * shake)
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
        # Both sticks are made in the same way: base dots that are clearer than the moving stick's count no more.
        less = np.maximum(clear - np.log(pairs.score_of(ends)), 0.0)
        misfit += (SIGMAS * less / math.log(CLEARER)) ** 2
        first, bounds = (int(own[0]), int(own[1])), list[_Bound]()
        score = 2.0 * CLEARNESS * clear - 0.5 * misfit + self._central(first, axis)
        for k in np.argsort(-score, kind="stable")[:MOST].tolist():
            second = (int(ends[k, 0]), int(ends[k, 1]))
            bounds.append(_Bound(float(score[k]) + self._strips_of(first, second), second, first, axis))
        beside_px2 = pairs.radius_px[own].max() ** 2 + axis.beside_px**2 + axis.variance_px2
        none = 2.0 * CLEARNESS * math.log(pairs.score_by_chance(own))
        # Two dots that are of no stick need not turn together.
        misfit_of_two = min(float(moving.turns[0]) / shake, 2.0 * LIMITS[1])
        none -= 0.5 * (misfit_of_two + rest.sum() / shake + LIMITS[3] + math.log(beside_px2))
        return bounds, float(none)

    def _central(self, pair: tuple[int, int], axis: _Axis) -> float:
        """Return the log likelihood of the axis' distance from a moving stick's line, over that of any two dots' line.

        For a stick it has a Cauchy distribution with the dots' radius as its scale, as sticks that were not put on
        centrally are not rare. The line of any two dots that turn passes the axis at up to their mean distance from it.
        """
        dots, sigma_px = [self._paths.dots[number] for number in pair], math.sqrt(axis.variance_px2)
        scale = math.hypot(max(dot.radius_px for dot in dots), sigma_px)
        away = 0.5 * sum(math.hypot(dot.x_px - axis.place.real, dot.y_px - axis.place.imag) for dot in dots)
        away = math.hypot(away, sigma_px)
        return math.log(2.0 * away / (math.pi * scale)) - math.log1p((axis.beside_px / scale) ** 2)

    def _strips_of(self, one: tuple[int, int], two: tuple[int, int]) -> float:
        """Return the log likelihood of two pairs of dots as two sticks', from the lines between the dots.

        The line is as bright as the surroundings of the dots, or all four have a rim of their own: rings, labels.
        """
        lines, own_rims = self._strip(one) + self._strip(two), math.log(1.0 - SURE)
        if lines < own_rims and all(has_rim(self._luma, self._paths.dots[number]) for number in one + two):
            return float(np.logaddexp(lines, own_rims))
        return lines

    def _strip(self, pair: tuple[int, int]) -> float:
        """Return the log likelihood of two dots, by their numbers, as a stick's, from the line between them."""
        if pair not in self._strips:
            one, two = (self._paths.dots[number] for number in pair)
            # The share is that of eight points at least.
            self._strips[pair] = CLEARNESS * math.log(max(strip_share(self._luma, one, two), 0.125))
        return self._strips[pair]

    def _goes_on(self, base: Stick, moving: Stick, axis: _Axis) -> float:
        """Return the log likelihood of two sticks from the lines between their dots and the axis."""
        radius_px, (x, y) = max(base.inner.radius_px, base.outer.radius_px), (axis.place.real, axis.place.imag)
        if axis.variance_px2 >= radius_px**2:
            return 0.0
        sticks = [one.towards(x, y) for one in (base, moving)]
        alike, unlike = compared_to_axis(self._luma, sticks, x, y)
        # By the rule of succession, for a point that is not alike after as many that are.
        goes_on = -unlike * math.log(alike + unlike + 1.0)
        arms_px = [max(math.hypot(one.inner.x_px - x, one.inner.y_px - y), radius_px) for one in sticks]
        goes_on -= math.log1p((SIGMAS * math.log(arms_px[0] / arms_px[1]) / math.log(SIZES)) ** 2)
        dots = (base.inner, base.outer, moving.inner, moving.outer)
        goes_on += math.log(1.0 - SURE) * (_holds(base, x, y) != _holds(moving, x, y))
        return goes_on + math.log(1.0 - SURE) * _any_lies_at(dots, axis.place)

    def read(self, couple: Couple) -> float:
        """Return the share of frames in which a couple is read; see :func:`share_read`."""
        own = np.concatenate([self._numbers(stick) for stick in (couple.base, couple.moving)])
        every = self._paths.places
        height, width = self._luma.shape
        return share_read(couple, every[:, own], (width, height), chosen=_apart(every))

    def tracks(self, couple: Couple, *, every: int = 1) -> MarkerTracks:
        """Return the tracks of a couple's markers in the frames since the picture, or in one of ``every`` frames.

        Base dots are not valid in frames in which they may be dots of the moving stick.
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

    def resting(self) -> Places:
        """Return the positions of the dots that were at rest all the time."""
        places = self._paths.places
        rests = np.isfinite(places).all(axis=0) & (np.abs(places - places[0]).max(axis=0) < SIGMAS * STANDS_PX)
        return np.asarray(places[0, rests])

    def _numbers(self, stick: Stick) -> Ints:
        """Return the indices of a stick's dots, the inner one first."""
        return np.array([self._number[id(dot)] for dot in (stick.inner, stick.outer)])


def share_read(couple: Couple, places: Places, size_px: tuple[int, int], *, chosen: Ints | None = None) -> float:
    """Return the share of frames in which at least one stick of a couple is read, as the other one may be hidden.

    Zero as long as the moving stick does not turn, or where the base does not keep its dots' distance and direction,
    whatever the camera's shift; also where a dot of either stick lies on the axis: such a dot could belong to a base or
    to a moving stick. ``places`` (n, 4), complex, are the positions of base and moving stick in the picture and in the
    frames after it, NaN where not seen; ``chosen`` (k,) are the frames that are evaluated.
    """
    radius_px = np.array([dot.radius_px for dot in couple.dots])
    some = places[_apart(places) if chosen is None else chosen]
    turning = _circles(some, np.array([[2, 3]]), size_px)
    known = len(turning.ends) and turning.variance_px2[0] < radius_px[:2].max() ** 2
    beside = _beside(some, np.array([2, 3]), radius_px)
    if (
        not len(turning.ends)
        or (known and _any_lies_at(couple.dots, complex(turning.axis[0])))
        # The variance of the difference is twice that of a dot, STANDS_PX².
        or not passes(0.5 * float(_stands(beside[:, 1] - beside[:, 0])), 2)
    ):
        return 0.0
    seen = np.isfinite(places[1:])
    return float((seen[:, :2].all(axis=1) | seen[:, 2:].all(axis=1)).mean())


class Search:
    """The choice among the couples of one picture ``luma``, from as many frames after it as it takes.

    It is settled once a couple's probability, or that of none, exceeds :data:`tracker.innovation.SURE` twice in
    succession, or, if only the choice between base and moving stick is open, at the last of ``LOOKED_AT``; otherwise
    the film's end settles it. Dots that are known to be ``at_rest`` (d,) are not followed. ``found`` are the couples by
    the last weighing, the most probable first.
    """

    def __init__(self, luma: NDArray[np.uint8], dots: Sequence[Dot], *, at_rest: Flags) -> None:
        self.luma = luma
        self._weighing = Weighing(luma, dots, at_rest=at_rest)
        self.resting, self.places_after = self._weighing.resting, self._weighing.places_after
        self._number, self._due, self.found = 0, STALE, list[Couple]()

    @property
    def shown(self) -> list[Couple]:
        """The couples from the picture alone, two pairs once, the most probable first."""
        return [one for k, one in enumerate(self._weighing.shown) if not any(map(one.swaps, self._weighing.shown[:k]))]

    def add(self, frame: Frame) -> bool:
        """Follow all dots into the next frame; return whether the choice is settled."""
        self._weighing.add(frame)
        self._number += 1
        if self._number < self._due:
            return False
        self._due *= 2
        before, none, self.found = self.found, self._weighing.none, self._weighing.weighed()
        found = self.found
        # That none of the couples is right may be as certain as that one is.
        if min(none, self._weighing.none) > SURE:
            return True
        # Probability that these two pairs are the sticks, whichever of them is the base.
        alike = sum(one.probability for one in found if one is found[0] or one.swaps(found[0]))
        if self._number >= LOOKED_AT[-1] and alike > SURE:
            return True
        # Twice, the second time with twice as many frames: a couple that fits a short stretch may not fit a longer.
        return bool(found and before) and min(found[0].probability, before[0].probability) > SURE

    def result(self) -> tuple[list[Couple], float]:
        """Return the couples, the most probable first, and the share of the frames in which the first one is read."""
        if 2 * self._number != self._due:
            self.found = self._weighing.weighed()
        return self.found, self._weighing.read(self.found[0]) if self.found else 0.0


def _apart(places: Places) -> Ints:
    """Return indices of frames, with the first one, between which the dots at positions (n, d) moved equally far."""
    step = np.nan_to_num(np.abs(np.diff(places, axis=0)))
    # The jump of a dot that was not followed counts as OFF_CIRCLE_PX at most.
    far = np.concatenate([[0.0], np.cumsum(np.sqrt((np.minimum(step, OFF_CIRCLE_PX) ** 2).sum(axis=1)))])
    return np.unique(np.searchsorted(far, np.linspace(0.0, far[-1], FRAMES)).clip(0, len(places) - 1))


def _circles(places: Places, ends: Ints, size_px: tuple[int, int]) -> _Turning:
    """Return the circles of pairs (p, 2) of dots at positions (n, d), only for pairs that turn by more than a base.

    The axis is estimated as in :mod:`tracker.follow.rotation_axis`, with frames weighted by the pair's turn.
    """
    middle = complex(0.5 * size_px[0], 0.5 * size_px[1])
    # Before anything moves the axis may be anywhere around the middle of the picture.
    guessed = (STANDS_PX / abs(middle)) ** 2
    first = places[0, ends[:, 1]] - places[0, ends[:, 0]]
    unit = places[:, ends[:, 1]] - places[:, ends[:, 0]]
    with np.errstate(invalid="ignore"):
        # NaN for unknown positions, and for two dots that were read as one.
        unit /= np.abs(unit)
    turn_rad = np.angle(unit * np.conj(first / np.abs(first)))
    moved = np.nanmax(np.abs(turn_rad), axis=0) > MOVED_RAD
    ends, unit = ends[moved], unit[:, moved]
    one, two = places[:, ends[:, 0]], places[:, ends[:, 1]]
    known = np.isfinite(unit)
    # A frame's weight is the pair's turn since the frame before, up to STEP_RAD, which gives a weight of one.
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


def _beside(places: Places, moving: Ints, radius_px: Floats) -> Places:
    """Return the positions (n, d), NaN in frames in which a dot may be one of a moving pair (2,)."""
    near = np.zeros(places.shape, bool)
    for end in moving.tolist():
        near |= np.abs(places - places[:, end, None]) < NEAR * np.maximum(radius_px, radius_px[end])
    return np.asarray(np.where(near, NOWHERE, places))


def _inner_first(base: Stick, moving: Stick, axis: _Axis) -> tuple[Stick, Stick]:
    """Return a couple, markers nearer to the axis first; for an uncertain axis the crossing of both lines is used."""
    if math.sqrt(axis.variance_px2) > moving.length_px:
        return towards_axis(base, moving)
    x, y = axis.place.real, axis.place.imag
    return base.towards(x, y), moving.towards(x, y)


def _holds(stick: Stick, x_px: float, y_px: float) -> bool:
    """Return whether a position lies between a stick's markers, in the stick's direction."""
    ends = ((stick.inner, stick.outer), (stick.outer, stick.inner))
    return all((b.x_px - a.x_px) * (x_px - a.x_px) + (b.y_px - a.y_px) * (y_px - a.y_px) > 0.0 for a, b in ends)


def _any_lies_at(dots: Sequence[Dot], place: complex) -> bool:
    """Return whether one of the dots covers a position."""
    return any(math.hypot(dot.x_px - place.real, dot.y_px - place.imag) < dot.radius_px for dot in dots)
