"""The search for the markers among the dots of some of a film's pictures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tracker.appearance.dot_fit import Dot
from tracker.detect.dots import find_and_refuse
from tracker.detect.given_positions import LOOKED_AT
from tracker.detect.sticks import CLEAR, are_markers, is_clear
from tracker.follow.motion_model import STALE
from tracker.frames.frame import Frame
from tracker.hypotheses import Couple, Places, Weighing
from tracker.innovation import SURE


class _Rank(NamedTuple):
    """Order of pictures: no other one is needed (``enough``), the sticks are ``clear``, by what equals are compared."""

    enough: bool
    clear: bool
    by: float


@dataclass(frozen=True, slots=True, eq=False)
class FoundDots:
    """What the dots of picture ``index`` tell: ``couples``, the most probable first, and how often that is read.

    ``read`` is the share of the frames after the picture.
    """

    index: int
    luma: NDArray[np.uint8]
    couples: list[Couple]
    read: float

    @property
    def rank(self) -> _Rank:
        """The picture's order; all zero where it shows no markers."""
        if not self.couples or not are_markers((self.couples[0].base, self.couples[0].moving)):
            return _Rank(enough=False, clear=False, by=0.0)
        first = self.couples[0]
        if first.score <= CLEAR:
            return _Rank(enough=False, clear=False, by=first.score)
        # A couple that is certain remains so where light, focus or a hand hides it afterwards.
        enough = self.read > 0.0 and (first.probability > SURE or 2.0 * self.read >= 1.0)
        return _Rank(enough, clear=True, by=0.0 if enough else self.read)


class PictureSearch:
    """The choice among the couples of one picture ``luma``, by as many frames after it as it takes.

    What decides is how far the dots move, not for how long: errors are correlated over a film. So the couples are
    weighed after 15, 30, 60, … frames, and settled is what twice in succession is :data:`tracker.innovation.SURE`: that
    a certain couple is right if any is, provided that this is more probable than that none is; or that none is right,
    ``refuted``, unless the sticks of a clear one are read. If only the choice between base and moving stick is open,
    the last of ``LOOKED_AT`` decides; otherwise the film's end does.
    """

    def __init__(self, index: int, luma: NDArray[np.uint8], dots: Sequence[Dot]) -> None:
        self.index, self.luma, self.refuted = index, luma, False
        self._weighing, self._at = Weighing(luma, dots), _places_of(dots)
        self._number, self._due, self._found = 0, STALE, list[Couple]()

    @property
    def asked(self) -> bool:
        """Whether the couples were weighed twice."""
        return self._due > 2 * STALE

    def add(self, frame: Frame) -> bool:
        """Follow all dots into the next frame; return whether the choice is settled."""
        self._weighing.add(frame)
        self._number += 1
        if self._number < self._due:
            return False
        self._due *= 2
        before, self._found = self._found, self._weighing.weighed()
        if not self.asked:
            return False
        # Twice, the second time with twice as many frames: a couple that fits a short stretch may not fit a longer.
        if max(_any(before), _any(self._found)) < 1.0 - SURE:
            self.refuted = not self.found().rank.enough
            return self.refuted
        if not before or not self._found:
            return False
        if self._number >= LOOKED_AT[-1] and _alike(self._found) > SURE:
            return True
        return self._found[0].is_of(before[0]) and all(
            found[0].probability > max(0.5, SURE * _any(found)) for found in (before, self._found)
        )

    def holds(self) -> bool:
        """Return whether the first couple's sticks are more probable than all others, and one of them is seen."""
        return bool(self._found) and _alike(self._found) > 0.5 and self._weighing.sees(self._found[0])

    def begins_at(self, dots: Sequence[Dot]) -> bool:
        """Return whether all dots lie, within their radii, where dots of this search were first."""
        radius_px = np.array([dot.radius_px for dot in dots])
        return bool((np.abs(_places_of(dots)[:, None] - self._at).min(axis=1) < radius_px).all())

    def found(self) -> FoundDots:
        """Return what the frames so far tell."""
        couples = self._found if 2 * self._number == self._due else self._weighing.weighed()
        return FoundDots(self.index, self.luma, couples, self._weighing.read(couples[0]) if couples else 0.0)


def _places_of(dots: Sequence[Dot]) -> Places:
    return np.array([complex(dot.x_px, dot.y_px) for dot in dots])


def _any(found: Sequence[Couple]) -> float:
    """Return the probability that any couple is right."""
    return sum(one.probability for one in found)


def _alike(found: Sequence[Couple]) -> float:
    """Return the probability that the first couple's pairs are the sticks, whichever of them is the base."""
    return sum(one.probability for one in found if one is found[0] or one.swaps(found[0]))


class DotSearches:
    """The dots of some pictures, each followed from its picture on.

    Dots of one picture may be the wrong ones: while the light comes on, while something else is before the camera, or
    where one stick lies over a dot of the other. Wrong dots are lost in the frames that follow, their base is not at
    rest, or nothing moves. So further pictures are searched unless a couple holds (``hold``), until the sticks of one
    are certain or are read in most of the frames after it; otherwise the picture counts whose sticks are read in the
    largest share of them. ``searched`` are the numbers of these pictures.
    """

    def __init__(self) -> None:
        self.under_way: list[PictureSearch] = []
        self.searched: list[int] = []
        self._settled: list[PictureSearch] = []

    @property
    def hold(self) -> bool:
        """Whether no further picture is to be searched: a couple holds, or those of a picture are still to be asked."""
        return any(search.holds() or not search.asked for search in self.under_way)

    def search(self, index: int, luma: NDArray[np.uint8]) -> None:
        """Begin to follow the dots of a picture, unless they are followed from these places already."""
        self.searched.append(index)
        dots = [dot for dot in find_and_refuse(luma)[0] if is_clear(dot)]
        if len(dots) >= 4 and not any(search.begins_at(dots) for search in self.under_way):
            self.under_way.append(PictureSearch(index, luma, dots))

    def settled_by(self, frame: Frame) -> bool:
        """Follow the dots of all pictures into a frame; return whether the sticks of one are found."""
        settled = [search for search in self.under_way if search.add(frame)]
        self.under_way = [search for search in self.under_way if search not in settled]
        self._settled += [search for search in settled if not search.refuted]
        return any(not search.refuted and search.found().rank.enough for search in settled)

    @property
    def best(self) -> FoundDots | None:
        """What the best picture shows."""
        searches = sorted([*self._settled, *self.under_way], key=lambda search: search.index)
        found = [search.found() for search in searches]
        return max((one for one in found if any(one.rank)), key=lambda one: one.rank, default=None)
