"""The four markers in the first frames: as a person gives them, or found without help."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from torsight.core.errors import InputError, NoResultError
from torsight.core.progress import Progress, silent
from torsight.core.tracks import MARKERS
from tracker.detect import HUGE_PX, Dot, dot_near, find_dots, find_large_dots
from tracker.follow.follower import Follower
from tracker.follow.marker import Marker
from tracker.hints import MarkerHints
from tracker.source import Frame, FrameSource
from tracker.sticks import Stick, choose_sticks, clearness, half_width

if TYPE_CHECKING:
    from tracker.patches.follow import StickFollower

_CLEAR: Final = 2.0
"""Score from which a pair of dots is taken at first sight."""
_LEAST: Final = 1.2
"""Score below which two pairs of dots are taken for texture: 80 % explained at a step of 50 grey levels."""
_CLEARER: Final = 2.0
"""Two other dots that stand out by this factor more than the markers do are what a stick's markers should be."""
LOOKED_AT: Final = (0, 1, 2, 4, 8, 15, 30, 45, 60, 90, 120, 180, 240, 300, 450, 600, 900)
"""Frames in which markers are looked for until they are seen."""
SNAP_PX: Final = 12.0
"""A given position is of the dot whose centre is this near, or under it."""


@dataclass(frozen=True, slots=True)
class Start:
    """Where following begins.

    Attributes
    ----------
    markers : list of Marker
        Two of one stick, two of the other; none where a stick has no dots.
    frame : int
        Frame in which they were found.
    moving : int or None
        Which stick moves; None where motion has yet to tell.
    kinds : (str, str)
        Of both sticks, see :class:`tracker.hints.MarkerHints`.
    doubtful : bool
        True where the markers are so faint that only their motion can tell them from background.
    first : Frame or None
        The first frame, for sticks without dots.
    hints : MarkerHints or None
        What was told of the markers.
    """

    markers: list[Marker]
    frame: int
    moving: int | None
    kinds: tuple[str, str] = ("dot", "dot")
    doubtful: bool = False
    first: Frame | None = None
    hints: MarkerHints | None = None

    @property
    def kind(self) -> str:
        """The kind of both sticks, or both kinds in words."""
        return "dot" if self.hints is None else self.hints.kind

    def follower(self, *, motion_tells: bool = False) -> Follower | StickFollower:
        """Return what follows the markers from here.

        ``motion_tells``: leave open which stick moves even where it was told.
        """
        moving = None if motion_tells else self.moving
        if self.hints is None or self.kinds == ("dot", "dot"):
            return Follower(self.markers, moving=moving)
        from tracker.patches.begin import sticks_of
        from tracker.patches.follow import StickFollower

        return StickFollower(sticks_of(self.first, self.hints), moving=moving)


def find_start(source: FrameSource, hints: MarkerHints | None, *, progress: Progress = silent) -> Start:
    """Return the markers in the first frame in which they can be seen; ``progress`` is told before every look.

    Raises
    ------
    ConfigError
        When a given marker lies outside the picture.
    InputError
        When the source holds no frame.
    NoResultError
        When there is no dot at a given position, or no four markers are found.
    """
    if hints is not None:
        hints.check_inside(source.size_px)
        if hints.kinds == ("dot", "dot"):
            return _given(source, hints)
        return _other_kinds(source, hints, progress)
    return _found_by_itself(source, progress)


def _found_by_itself(source: FrameSource, progress: Progress) -> Start:
    """Return the four dots that stand out in one of the first frames."""
    best: tuple[float, int, NDArray[np.uint8], tuple[Stick, Stick]] | None = None
    count = 0
    for frame in _decoded(source):
        count += 1
        if frame.index > LOOKED_AT[-1]:
            break
        if frame.index not in LOOKED_AT or frame.luma is None:
            continue
        progress("looking for the markers", frame.index, LOOKED_AT[-1])
        found = sticks_in(frame.luma)
        if found is None:
            continue
        score = min(found[0].score, found[1].score)
        if are_markers(found) and (best is None or score > best[0]):
            best = (score, frame.index, frame.luma.copy(), found)
        if score > _CLEAR:
            break
    progress("looking for the markers", LOOKED_AT[-1], LOOKED_AT[-1])
    if best is None:
        if count == 0:
            raise InputError("holds no frame that can be decoded", where=str(getattr(source, "name", "film")))
        raise NoResultError(
            "four markers, two dots on each of two sticks, were not found",
            where=f"{getattr(source, 'name', 'film')}, frames 0 to {min(count - 1, LOOKED_AT[-1])}",
            limit=f"round dots of 3 to {HUGE_PX:g} px radius, dark on a light stick or light on a dark one, those "
            "of one stick no more than 3 times as large as those of the other",
            do="pick them with 'torsight markers' and name its file with --markers, or light the sticks better",
        )
    score, index, luma, sticks = best
    markers = [marker for stick in sticks for marker in _on_stick(luma, stick)]
    return Start(markers, index, None, doubtful=score <= _CLEAR)


def sticks_in(luma: NDArray[np.uint8], *, dots: Sequence[Dot] | None = None) -> tuple[Stick, Stick] | None:
    """Return the sticks in a picture; None also where two dots of no stick stand out far more than theirs.

    ``dots`` are those of :func:`tracker.detect.find_dots`, where they were found already.
    """
    dots = find_dots(luma) if dots is None else dots
    found = choose_sticks(luma, dots)
    if found is not None and min(stick.score for stick in found) > _CLEAR:
        return found
    dots = find_large_dots(luma, dots)
    found = choose_sticks(luma, dots)
    if found is None or min(stick.score for stick in found) > _CLEAR:
        return found
    chosen = [dot for stick in found for dot in (stick.inner, stick.outer)]
    limit = _CLEARER * min(clearness(dot) for dot in chosen)
    clearer = [dot for dot in dots if clearness(dot) > limit and not any(dot is other for other in chosen)]
    return None if len(clearer) >= 2 else found


def are_markers(sticks: tuple[Stick, Stick]) -> bool:
    """Return whether two pairs of dots stand out enough to be taken for the markers."""
    return min(stick.score for stick in sticks) > _LEAST


def first_frame(source: FrameSource) -> Frame:
    """Return the first frame that was decoded whole: given positions are positions in it.

    Raises
    ------
    InputError
        When there is none.
    """
    frame = next(_decoded(source), None)
    if frame is None:
        raise InputError("holds no frame that can be decoded", where=str(getattr(source, "name", "film")))
    return frame


def _given(source: FrameSource, hints: MarkerHints) -> Start:
    frame = first_frame(source)
    return Start(given_dots(frame, hints, sticks=(0, 1)), frame.index, 1, hints=hints)


def _other_kinds(source: FrameSource, hints: MarkerHints, progress: Progress) -> Start:
    """Return the start of sticks of which at least one has no dots, after a look at whether they are there."""
    from tracker.patches.begin import look_for_tags, sticks_of

    first = first_frame(source)
    assert first.luma is not None  # noqa: S101 - for the type checker: such frames are passed over
    # The frame's picture is only lent.
    first = replace(first, luma=first.luma.copy())
    sticks_of(first, hints)
    if "tag" in hints.kinds:
        look_for_tags((frame for frame in _decoded(source)), hints, name=source.name, progress=progress)
    return Start([], first.index, 1, hints.kinds, first=first, hints=hints)


def given_dots(frame: Frame, hints: MarkerHints, *, sticks: Sequence[int]) -> list[Marker]:
    """Return the markers, two of each stick, next to the positions that were given.

    Raises
    ------
    NoResultError
        When there is no dot at a position, or two positions are of one dot.
    """
    assert frame.luma is not None  # noqa: S101 - for the type checker: such frames are passed over
    dots: dict[str, Dot] = {}
    for index in (2 * stick + end for stick in sticks for end in (0, 1)):
        name, (x, y) = MARKERS[index], hints.position_px[index].tolist()
        dot = dot_near(frame.luma, x, y, reach_px=SNAP_PX)
        if dot is None:
            raise NoResultError(
                "there is no round dot next to this position",
                where=f"{hints.where}, {name.replace('_', ', ')} marker",
                value=f"[{x:g}, {y:g}]",
                limit=f"a dot of 3 to {HUGE_PX:g} px radius within {SNAP_PX:g} px, in frame {frame.index}",
                do='mend the position, or set kind = "texture" for a point without a dot',
            )
        for other, before in dots.items():
            if math.hypot(before.x_px - dot.x_px, before.y_px - dot.y_px) < 0.5 * dot.radius_px:
                raise NoResultError(
                    f"is next to the same dot as {other}",
                    where=f"{hints.where}, {name.replace('_', ', ')} marker",
                    value=f"[{x:g}, {y:g}]",
                    do="give one position on each dot",
                )
        dots[name] = dot
    found = list(dots.values())
    pairs = zip(found[::2], found[1::2], strict=True)
    return [marker for one, two in pairs for marker in _on_stick(frame.luma, Stick(one, two, 0.0))]


def _decoded(source: FrameSource) -> Iterator[Frame]:
    return (frame for frame in source if frame.luma is not None and not frame.damaged)


def _on_stick(luma: NDArray[np.uint8], stick: Stick) -> list[Marker]:
    strip_px = half_width(luma, stick)
    return [_marker(luma, dot, strip_px) for dot in (stick.inner, stick.outer)]


def _marker(luma: NDArray[np.uint8], dot: Dot, strip_px: float) -> Marker:
    marker = Marker(dot.fit.shape, strip_px=strip_px)
    reading = marker.read(luma, dot.x_px, dot.y_px)
    if reading is None:
        raise NoResultError(
            "a marker lies at the border of the picture",
            value=f"[{dot.x_px:.0f}, {dot.y_px:.0f}]",
            do="keep the sticks inside the picture",
        )
    marker.begin(reading)
    return marker
