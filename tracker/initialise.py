"""The four markers in the first frames: given by the user, or found automatically."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from torsight.core.errors import InputError, NoResultError
from torsight.core.frozen import Frozen
from torsight.core.progress import Progress, silent
from torsight.core.words.wording import listed
from tracker.appearance.dot_fit import Dot
from tracker.appearance.lucas_kanade import Luma, Places
from tracker.couples import Choice, Couple, likeliest
from tracker.detect.dots import HUGE_PX, find_and_refuse
from tracker.detect.fiducials import TagsSeen, most_modules, usual_tags
from tracker.detect.given_positions import LOOKED_AT, decoded, first_frame, given_dots
from tracker.detect.marker_file import STICKS, MarkerHints
from tracker.detect.moving_part import SHARPER, differs, motion_blur
from tracker.detect.sticks import CLEAR, SIZES, Stick, are_markers, is_clear, judge_pair
from tracker.dot_paths import NOWHERE
from tracker.follow.followed_dots import DotState
from tracker.follow.follower import Follower
from tracker.follow.marker import Marker, markers_on
from tracker.follow.motion_model import STALE
from tracker.follow.redetect import place_of
from tracker.follow.rotation_axis import STANDS_PX
from tracker.frames.frame import REPORT_EVERY, Frame, FrameSource
from tracker.hypotheses import FRAMES, Search, share_read
from tracker.innovation import SURE
from tracker.rows import HIDDEN, SEEN


@dataclass(frozen=True, slots=True)
class Start(Frozen):
    """Start of the tracking.

    ``markers`` are two of one stick, two of the other (none where a stick has no dots), found in ``frame``; ``moving``
    is the index of the stick that moves, None where it is not known yet; ``doubtful``: the markers are so faint that
    only their motion distinguishes them from the background. ``first``, the first frame, is stored for sticks without
    dots. ``choice`` is the choice among several couples of sticks; ``unlike`` are reasons, by the name of a stick, why
    two given dots do not look as if they were on one stick. ``earlier`` is the start at the same markers in a picture
    before ``frame``, while both sticks were at rest.
    """

    markers: list[Marker]
    frame: int
    moving: int | None
    kinds: tuple[str, str] = ("dot", "dot")
    doubtful: bool = False
    first: Frame | None = None
    hints: MarkerHints | None = None
    choice: Choice | None = None
    unlike: Mapping[str, str] = field(default_factory=dict)
    earlier: Start | None = None

    @property
    def first_frame(self) -> int:
        """The first frame in which the markers are known."""
        return self.frame if self.earlier is None else self.earlier.frame

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
    dots, tags = _Dots(source, progress), TagsSeen()
    last = -1
    for frame in decoded(source):
        if frame.index > LOOKED_AT[-1] and not dots.undecided:
            break
        settled, later = dots.followed(frame), False
        if not settled and frame.index in LOOKED_AT and frame.luma is not None:
            last, luma = frame.index, frame.luma.copy()
            progress("looking for the markers", last, LOOKED_AT[-1])
            later = dots.searched
            settled = not later and dots.settled_by(last, luma)
            if dots.leave_it_to_tags:
                tags.take(luma)
        if (tags.pictures > 1 and tags.pair[1]) if dots.leave_it_to_tags else settled:
            break
        if later:
            # The frames after it decide on its dots: they are looked for once no tags are known.
            dots.settled_by(last, luma)
    else:
        dots.end()
    progress("looking for the markers", LOOKED_AT[-1], LOOKED_AT[-1])
    if last < 0:
        raise InputError("holds no frame that can be decoded", where=source.name)
    return _decided(dots, tags, source, last)


def _decided(dots: _Dots, tags: TagsSeen, source: FrameSource, last: int) -> Start:
    """Return the start by what was seen up to the frame ``last``."""
    where = f"{source.name}, frames 0 to {last}"
    family, numbers = tags.pair
    if dots.leave_it_to_tags and numbers:
        return _start_at_tags(family, numbers, where=where)
    if (dots.are_none or dots.in_tags) and (fault := tags.fault()):
        what, value, do = fault
        raise NoResultError(what, where=where, value=value, limit="a tag of its own number on each stick", do=do)
    if dots.start is None:
        raise _no_dots(motion_blur(source, 0, last), where=where)
    return dots.with_earlier(dots.start)


def _no_dots(blur: str | None, *, where: str) -> NoResultError:
    """Return the error that no four markers were found; ``blur`` says how blurred the pictures are, or is empty."""
    return NoResultError(
        "four markers, two dots on each of two sticks, were not found",
        where=where,
        value=blur or None,
        limit=f"round dots of 3 to {HUGE_PX:g} px radius, dark on a light stick or light on a dark one, none more "
        f"than {SIZES:g} times as large as another; or a tag on each stick",
        do=f"{SHARPER}, or " * bool(blur) + "pick them with 'torsight markers' and name its file with --markers, "
        "choose dots that differ from the stick in a black-and-white picture, or light the sticks better",
    )


def _in_tag(luma: NDArray[np.uint8], marker: Marker) -> bool:
    """Return whether a marker is a module, or a few, of a tag that is seen upright or mirrored."""
    (x, y), reach = place_of(marker.record[0]), math.ceil(most_modules() * 2.0 * marker.record[0]["shape"]["radius"])
    left, top = max(round(x) - reach, 0), max(round(y) - reach, 0)
    part = luma[top : round(y) + reach, left : round(x) + reach]
    ways = ((part, x - left), (part[:, ::-1], part.shape[1] - 1 - (x - left)))
    return any(
        tag.holds(across, y - top) for seen, across in ways for found in usual_tags(seen).values() for tag in found
    )


class _Dots:
    """The best ``start`` at dots of the pictures so far, None without one.

    Dots of one picture may be the wrong ones: while the light comes on, while something else is before the camera, or
    where one stick lies over a dot of the other. Wrong dots are lost in the frames that follow, their base is not at
    rest, or nothing moves. So later pictures are tried, until the sticks of one are certain or are read in most of the
    frames after it; otherwise the picture counts whose sticks are right and are read in the largest share of them. The
    first picture is tried alone, the later ones together, as the film is read once more.
    """

    def __init__(self, source: FrameSource, progress: Progress) -> None:
        self.start: Start | None = None
        self.in_tags = False
        self._source, self._progress = source, progress
        self._read, self._score = -1.0, -math.inf
        self._asked: list[tuple[int, Search]] = []
        self.undecided: list[tuple[int, Search]] = []
        # Dots that are at rest from the first picture to the film's end are not followed again.
        self._resting = np.zeros(0, complex)

    @property
    def searched(self) -> bool:
        """Whether the dots of a picture were examined: the dots of all later ones are only judged together."""
        return bool(self._asked)

    @property
    def leave_it_to_tags(self) -> bool:
        """Whether tags count more than the dots so far: four modules of tags may look like dots on sticks."""
        return self.are_none or self.in_tags or (self.start is not None and self.start.doubtful)

    @property
    def are_none(self) -> bool:
        """Whether no dots are markers, or those taken are certain to be none, such as modules and corners of tags."""
        return self.start is None or (self.start.choice is not None and self.start.choice.sure < 1.0 - SURE)

    def settled_by(self, index: int, luma: NDArray[np.uint8]) -> bool:
        """Search a picture; return whether no later one is needed."""
        if self._asked and not differs(luma, self._asked[-1][1].luma):
            return False
        dots = [dot for dot in find_and_refuse(luma)[0] if is_clear(dot)]
        # Dots that failed where they are fail again, and so do those that were followed to where they are: their motion
        # from this picture on is part of a record that was examined already.
        at = np.array([complex(dot.x_px, dot.y_px) for dot in dots])
        before = [one.places_after(count) for start, one in self._asked for count in (0, index - start)]
        if len(dots) < 4 or any(all(_is_at(dot, places) for dot in dots) for places in before):
            return False
        at_rest = np.array([bool((np.abs(one - self._resting) < STANDS_PX).any()) for one in at])
        search = Search(luma, dots, at_rest=at_rest)
        alone = not self._asked
        self._asked.append((index, search))
        if not alone:
            self.undecided.append((index, search))
            return False
        for later in decoded(self._source):
            self._tell(later)
            if later.index > index and search.add(later):
                break
        else:
            self._resting = search.resting()
        return self._decide(index, search) or self._take(index, luma, *self._tracked(index, search))

    def with_earlier(self, start: Start) -> Start:
        """Return a start with that at the same sticks in an earlier picture, from which they could not be followed.

        A stick that starts abruptly is lost where it was at rest. If a base dot is hidden in the picture of the start,
        by a hand, two other dots may have been taken for the base: then the earlier picture decides.
        """
        found = dict(self._asked)
        if start.choice is None or start.frame not in found:
            return start
        seen, taken = found[start.frame].places_after(0), start.choice.taken
        for index, search in self._asked:
            for couple in search.shown if index < start.frame else ():
                same = couple.placed_as(taken)
                if same is None:
                    continue
                before = Start(markers_on(search.luma, same.base, same.moving), index, 1)
                if same.base.shared_dots(taken.base) == 2:
                    return replace(start, earlier=before)
                if not all(_is_at(dot, seen) for dot in (same.base.inner, same.base.outer)):
                    return replace(before, moving=None, choice=replace(start.choice, taken=same))
                break
        return start

    def followed(self, frame: Frame) -> bool:
        """Follow the dots of all pictures into a frame; return whether the sticks of one are found."""
        if self.undecided:
            self._tell(frame)
        settled = [one for one in self.undecided if one[1].add(frame)]
        self.undecided = [one for one in self.undecided if one not in settled]
        return any(self._decide(*one) for one in settled)

    def _tell(self, frame: Frame) -> None:
        # Most films are decided before the first report.
        if frame.index and frame.index % REPORT_EVERY == 0:
            self._progress("telling the markers by their motion", frame.index, self._source.frame_count)

    def end(self) -> None:
        """Decide what the film leaves open."""
        for one in self.undecided:
            if self._decide(*one):
                break

    def _decide(self, index: int, search: Search) -> bool:
        """Take the sticks of a picture if they are the best; return whether no other ones are needed."""
        return self._take(index, search.luma, *search.result())

    def _tracked(self, index: int, search: Search) -> tuple[list[Couple], float]:
        """Return the couples of a picture whose sticks can be tracked, and the share of frames in which the first is.

        A dot that moves too far between two frames to be followed alone is found again together with its stick, whose
        length is known. Couples that the picture alone makes probable are tracked until one stick has turned, and for
        as many frames after that as its motion is judged by; a couple that is lost for longer is none.
        """
        tried = [_Tracked(search.luma, index, couple) for couple in search.shown if couple.probability > 1.0 - SURE]
        for frame in decoded(self._source):
            if not tried or frame.index > LOOKED_AT[-1] or any(one.turned > FRAMES for one in tried):
                break
            self._tell(frame)
            if frame.index > index:
                tried = [one for one in tried if one.follow(frame)]
        read = {id(one): one.read(self._source.size_px) for one in tried if one.turned > STALE}
        found = [one.couple for one in tried if 2.0 * read.get(id(one), 0.0) > 1.0]
        weighed = likeliest([(math.log(one.probability), one) for one in found], none=math.log(1.0 - SURE))
        return weighed, max(read.values(), default=0.0)

    def _take(self, index: int, luma: NDArray[np.uint8], weighed: Sequence[Couple], read: float) -> bool:
        """Take the first couple of a picture if it is the best so far; return whether no other one is needed."""
        if not weighed or not are_markers((weighed[0].base, weighed[0].moving)):
            return False
        score, choice = min(weighed[0].base.score, weighed[0].moving.score), Choice.of(weighed)
        if score > CLEAR:
            # Expected share of the frames in which the right sticks are read.
            if choice.sure * read <= self._read:
                return False
            self._read = choice.sure * read
        elif self._read >= 0.0 or score <= self._score:
            return False
        self._score = score
        markers = markers_on(luma, weighed[0].base, weighed[0].moving)
        self.start = Start(markers, index, None, doubtful=score <= CLEAR, choice=choice)
        self.in_tags = all(_in_tag(luma, marker) for marker in markers)
        # A couple that is certain remains so where light, focus or a hand hides it afterwards.
        return score > CLEAR and read > 0.0 and (weighed[0].probability > SURE or 2.0 * self._read >= 1.0)


class _Tracked:
    """A ``couple`` of one picture that is tracked; base and moving stick are exchanged where the motion says so.

    ``turned`` counts the frames since one stick has turned.
    """

    def __init__(self, luma: NDArray[np.uint8], index: int, couple: Couple) -> None:
        self.couple, self.turned, self._lost = couple, 0, 0
        self._follower = Start(markers_on(luma, couple.base, couple.moving), index, None).follower()
        self._places = [np.ravel([couple.base.places_px, couple.moving.places_px]).view(complex)]

    def follow(self, frame: Frame) -> bool:
        """Follow the sticks into the next frame; return whether they may still be found."""
        row = self._follower.step(frame)
        seen, at = row["state"] == SEEN, row["position_px"].copy().view(complex).ravel()
        self._places.append(np.where(seen, at, NOWHERE))
        moving = self._follower.moving
        self._lost = 0 if seen.all() or (moving is not None and seen.reshape(2, 2)[moving].all()) else self._lost + 1
        self.turned += moving is not None
        return self._lost <= STALE

    def read(self, size_px: tuple[int, int]) -> float:
        """Return the share of frames in which the sticks are read, as ones that turn about an axis."""
        places = np.array(self._places)
        if self._follower.moving == 0:
            self.couple = replace(self.couple, base=self.couple.moving, moving=self.couple.base)
            places = places[:, [2, 3, 0, 1]]
        return share_read(self.couple, places, size_px)


def _is_at(dot: Dot, places: Places) -> bool:
    """Return whether a dot is at one of some positions, within its radius."""
    return bool((np.abs(complex(dot.x_px, dot.y_px) - places) < dot.radius_px).any())


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
    assert frame.luma is not None  # noqa: S101 - for the type checker: such frames are passed over
    sticks = given_dots(frame, hints, sticks=(0, 1))
    judged = {name: judge_pair(frame.luma, one.inner, one.outer) for name, one in zip(STICKS, sticks, strict=True)}
    unlike = {name: why for name, why in judged.items() if isinstance(why, str)}
    if len(unlike) == 2:
        _check_paired(frame.luma, *sticks, where=hints.where)
    start = Start(markers_on(frame.luma, *sticks), frame.index, 1, hints=hints)
    # Part of a dot, or two dots that touch, are fitted somehow, and then not read.
    hidden = (start.follower().step(frame)["state"].reshape(2, 2) == HIDDEN).any(axis=1)
    again = {
        name: "they are not read as round dots where they were given"
        for name, not_read in zip(STICKS, hidden, strict=True)
        if not_read
    }
    return replace(start, unlike={**again, **unlike})


def _check_paired(luma: Luma, base: Stick, moving: Stick, *, where: str) -> None:
    """Raise an error where dots that were given for both sticks look like two sticks if they are paired otherwise."""
    one, two = (base.inner, base.outer), (moving.inner, moving.outer)
    for end, name in enumerate(("inner", "outer")):
        pairs = (one[0], two[end]), (one[1], two[1 - end])
        if not any(isinstance(judge_pair(luma, *pair), str) for pair in pairs):
            raise NoResultError(
                "the two dots given for a stick are on different sticks",
                where=where,
                value=f"the inner dot of base and the {name} one of moving look like two dots of one stick, and so do "
                "the other two",
                limit="two dots of one stick for base, and two of the other for moving",
                do="exchange the outer positions of base and moving in the marker file"
                if end
                else "give the first position of moving as the second one of base, and the reverse",
            )


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
