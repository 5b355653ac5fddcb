"""The four markers in the first frames: given by the user, or found automatically."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from torsight.core.errors import InputError, NoResultError
from torsight.core.progress import Progress, silent
from torsight.core.words.wording import listed
from tracker.detect.dots import HUGE_PX
from tracker.detect.fiducials import MOST_MODULES, TagsSeen, usual_tags
from tracker.detect.given_positions import LOOKED_AT, decoded, first_frame
from tracker.detect.marker_file import MarkerHints
from tracker.detect.sticks import SIZES
from tracker.dot_searches import DotSearches, FoundDots
from tracker.follow.followed_dots import DotState
from tracker.follow.follower import Follower
from tracker.follow.marker import Marker, given_markers, markers_on
from tracker.follow.redetect import place_of
from tracker.frames.frame import Frame, FrameSource
from tracker.hypotheses import Choice


@dataclass(frozen=True, slots=True)
class Start:
    """Start of the tracking.

    ``markers`` are two of one stick, two of the other (none where a stick has no dots), found in ``frame``; ``moving``
    is the index of the stick that moves, None where it is not known yet; ``doubtful``: the markers are so faint that
    only their motion distinguishes them from the background. ``first``, the first frame, is stored for sticks without
    dots. ``choice`` is the choice among several couples of sticks.
    """

    markers: list[Marker]
    frame: int
    moving: int | None
    kinds: tuple[str, str] = ("dot", "dot")
    doubtful: bool = False
    first: Frame | None = None
    hints: MarkerHints | None = None
    choice: Choice | None = None

    @property
    def kind(self) -> str:
        """The kind of both sticks, or both kinds in words."""
        return "dot" if self.hints is None else self.hints.kind

    def follower(self, *, motion_tells: bool = False) -> Follower:
        """Return the follower of the markers from this start.

        ``motion_tells``: find out which stick moves from the motion, even if it was given.
        """
        moving = None if motion_tells else self.moving
        if self.hints is None or self.kinds == ("dot", "dot"):
            return Follower([DotState(self.markers)], moving=moving)
        from tracker.patches.initial_sticks import sticks_of

        return Follower(sticks_of(self.first, self.hints), moving=moving)


def find_start(source: FrameSource, hints: MarkerHints | None, *, progress: Progress = silent) -> Start:
    """Return the markers in the first frame in which they are found; ``progress`` is called before each frame.

    Raises :class:`ConfigError` for a given marker outside the picture, :class:`InputError` for a source without frames,
    and :class:`NoResultError` for a given position without a dot, or if four markers are not found.
    """
    if hints is not None:
        hints.check_inside(source.size_px)
        if hints.kinds == ("dot", "dot"):
            return _given(source, hints)
        return _other_kinds(source, hints, progress)
    return _found_by_itself(source, progress)


def _found_by_itself(source: FrameSource, progress: Progress) -> Start:
    """Return the start at the four dots that are clearest in one of the first frames, or else at two tags."""
    dots, tags, pictures, last = DotSearches(), TagsSeen(), list[NDArray[np.uint8]](), -1
    for frame in decoded(source):
        if dots.settled_by(frame) or (frame.index > LOOKED_AT[-1] and not dots.under_way):
            break
        if frame.index not in LOOKED_AT or frame.luma is None:
            continue
        last = frame.index
        pictures.append(frame.luma.copy())
        if not dots.hold:
            progress("looking for the markers", last, LOOKED_AT[-1])
            dots.search(last, pictures[-1])
            # The first dots are followed before anything else is looked for.
            if (len(pictures) > 1 or not dots.under_way) and _left_to_tags(dots.best) and tags.are_sure_in(pictures):
                break
    progress("looking for the markers", LOOKED_AT[-1], LOOKED_AT[-1])
    if last < 0:
        raise InputError("holds no frame that can be decoded", where=source.name)
    where = f"{source.name}, frames 0 to {last}"
    found = dots.best
    if _left_to_tags(found):
        tags.take(pictures)
        family, numbers = tags.pair
        if numbers:
            return _start_at_tags(family, numbers, where=where)
    if found is None:
        raise NoResultError(
            "four markers, two dots on each of two sticks, were not found",
            where=where,
            limit=f"round dots of 3 to {HUGE_PX:g} px radius, dark on a light stick or light on a dark one, none more "
            f"than {SIZES:g} times as large as another; or a tag on each stick",
            do="pick them with 'torsight markers' and name its file with --markers, or light the sticks better",
        )
    found = _earlier(source, found, dots.searched) if found.rank.enough else found
    return Start(_markers(found), found.index, None, doubtful=not found.rank.clear, choice=Choice.of(found.couples))


def _earlier(source: FrameSource, found: FoundDots, searched: Sequence[int]) -> FoundDots:
    """Return what an earlier picture shows than the one in which sticks were found, if it is enough, too.

    Pictures were passed over while the dots of an earlier one were followed. Only where a film shows sticks it is read
    once more for these.
    """
    numbers = [number for number in LOOKED_AT if number < found.index and number not in searched]
    dots = DotSearches()
    for frame in decoded(source) if numbers else ():
        if dots.settled_by(frame) or (frame.index > numbers[-1] and not dots.under_way):
            break
        if frame.index in numbers and frame.luma is not None:
            dots.search(frame.index, frame.luma.copy())
    best = dots.best
    return best if best is not None and best.rank.enough else found


def _left_to_tags(found: FoundDots | None) -> bool:
    """Return whether tags count more than dots: without any, and where they are faint or lie in tags.

    Four modules may look like dots on sticks.
    """
    return found is None or not found.rank.clear or all(_in_tag(found.luma, marker) for marker in _markers(found))


def _in_tag(luma: NDArray[np.uint8], marker: Marker) -> bool:
    """Return whether a marker lies in a tag: it is one of its modules then, or a few."""
    (x, y), reach = place_of(marker.record[0]), math.ceil(MOST_MODULES * 2.0 * marker.record[0]["shape"]["radius"])
    left, top = max(round(x) - reach, 0), max(round(y) - reach, 0)
    part = luma[top : round(y) + reach, left : round(x) + reach]
    return any(tag.holds(x - left, y - top) for found in usual_tags(part).values() for tag in found)


def _markers(found: FoundDots) -> list[Marker]:
    """Return new markers of the first couple: tracking modifies them."""
    couple = found.couples[0]
    return [marker for stick in (couple.base, couple.moving) for marker in markers_on(found.luma, stick)]


def _start_at_tags(family: str, numbers: Sequence[int], *, where: str) -> Start:
    """Return the start at the two tags that are seen in some of the first frames."""
    if len(numbers) > 2:
        raise NoResultError(
            "more than two tags are seen",
            where=where,
            value=f"{family}, numbers {listed([str(number) for number in numbers])}",
            limit="one tag on each stick",
            do=f'name the two in a file for --markers: kind = "tag", family = "{family}", base_id, moving_id',
        )
    nowhere = np.full((4, 2), np.nan)
    hints = MarkerHints(nowhere, ("tag", "tag"), where, family=family, ids=(numbers[0], numbers[1]))
    return Start([], 0, None, hints.kinds, hints=hints)


def _given(source: FrameSource, hints: MarkerHints) -> Start:
    frame = first_frame(source)
    return Start(given_markers(frame, hints, sticks=(0, 1)), frame.index, 1, hints=hints)


def _other_kinds(source: FrameSource, hints: MarkerHints, progress: Progress) -> Start:
    """Return the start for sticks of which at least one has no dots, after a check that they can be found."""
    from tracker.patches.initial_sticks import look_for_tags, sticks_of

    first = first_frame(source)
    assert first.luma is not None  # noqa: S101 - for the type checker: such frames are passed over
    # The frame's picture is valid only until the next one.
    first = replace(first, luma=first.luma.copy())
    sticks_of(first, hints)
    if "tag" in hints.kinds:
        look_for_tags(source, hints, progress=progress)
    return Start([], first.index, 1, hints.kinds, first=first, hints=hints)
