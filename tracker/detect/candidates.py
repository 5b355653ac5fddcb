"""Account of automatic detection in one picture: all candidates, those accepted, and why the others were rejected."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from torsight.core.units import Floats
from torsight.core.words.wording import listed
from tracker.appearance.dot_fit import Dot
from tracker.detect.dots import HUGE_PX, Refused, find_and_refuse
from tracker.detect.fiducials import TagsSeen
from tracker.detect.sticks import MOST, Stick, are_markers, choose_sticks, clearest, judge_pair, pairs_in, sticks_in


@dataclass(frozen=True, slots=True)
class Candidate:
    """A position that was considered as a marker; pixel centres at whole numbers, y down.

    ``number`` counts from 1 in the order of the list; ``is_dot``: it was fitted as a dot; ``reason``: why it was
    rejected, empty where it was accepted.
    """

    number: int
    x_px: float
    y_px: float
    radius_px: float
    is_dot: bool
    taken: bool
    reason: str


@dataclass(frozen=True, slots=True, eq=False)
class Sighting:
    """Result of automatic detection in one picture.

    ``candidates`` are first the markers, then other dots, then positions that look like a dot at coarse resolution,
    ``MOST`` at most. ``sticks_px`` (2, 2, 2) are the markers on one stick and on the other, inner marker first, or
    None; one picture does not show which stick moves. ``reason``: why no markers were found, or empty.
    """

    candidates: tuple[Candidate, ...]
    sticks_px: Floats | None
    reason: str


def look(luma: NDArray[np.uint8], *, taken: tuple[Stick, Stick] | None = None) -> Sighting:
    """Search for markers in one picture (h, w), with an account of every decision.

    ``taken`` are the sticks that were chosen by their motion, if they are known.
    """
    dots, refused = find_and_refuse(luma)
    sticks = taken or sticks_in(luma, dots=dots)
    found = sticks if sticks is not None and are_markers(sticks) else None
    markers = [] if found is None else [dot for stick in found for dot in (stick.inner, stick.outer)]
    others = [dot for dot in clearest(dots) if not any(_same(dot, marker) for marker in markers)]
    paired = pairs_in(luma, dots)
    told = [(dot, True, True, "") for dot in markers]
    told += [(dot, True, False, _why(luma, dot, dots, paired, found)) for dot in others]
    places: list[tuple[Dot | Refused, bool, bool, str]] = [*told]
    if found is None:  # positions without a dot matter only if the markers may be among them
        places += [(at, False, False, at.reason) for at in _apart(refused, dots)]
    candidates = tuple(
        Candidate(number, at.x_px, at.y_px, at.radius_px, is_dot, taken_for_one, reason)
        for number, (at, is_dot, taken_for_one, reason) in enumerate(places[:MOST], 1)
    )
    if found is None:
        tags = TagsSeen()
        tags.take(luma)
        family, numbers = tags.pair
        reason = f"tags of {family} are seen, numbers {listed([str(number) for number in numbers])}" if numbers else ""
        if not numbers and (fault := tags.fault()):
            reason = f"{fault[0]}: {fault[1]}"
        return Sighting(candidates, None, reason or _why_none(luma, dots, paired, sticks))
    return Sighting(candidates, np.array([stick.places_px for stick in found]), "")


def _same(one: Dot, two: Dot) -> bool:
    return abs(one.x_px - two.x_px) + abs(one.y_px - two.y_px) < one.radius_px


def _apart(refused: Iterable[Refused], dots: Sequence[Dot]) -> list[Refused]:
    """Return the rejected positions that lie on no dot and on no better position: those are listed already."""
    kept: list[Refused] = []
    for place in refused:
        before: list[Dot | Refused] = [*dots, *kept]
        if all(np.hypot(place.x_px - one.x_px, place.y_px - one.y_px) > one.radius_px for one in before):
            kept.append(place)
    return kept


def _why(
    luma: NDArray[np.uint8],
    dot: Dot,
    dots: Sequence[Dot],
    paired: Sequence[Stick],
    found: tuple[Stick, Stick] | None,
) -> str:
    """Return in words why a dot was not taken for a marker."""
    if any(dot is pair.inner or dot is pair.outer for pair in paired):
        if found is not None:
            return (
                "a dot that may lie on a stick, but the dots taken stand out more, match better, or move as sticks do"
            )
        return "a dot that may lie on a stick, but no second stick goes with it"
    others = [other for other in dots if other is not dot]
    if not others:
        return "a dot, but there is no second one to make a stick"
    nearest = min(others, key=lambda other: float(np.hypot(other.x_px - dot.x_px, other.y_px - dot.y_px)))
    fault = judge_pair(luma, dot, nearest)
    place = f"[{nearest.x_px:.0f}, {nearest.y_px:.0f}]"
    return f"a dot on no stick with another; with the nearest one, at {place}: {fault}"


def _why_none(
    luma: NDArray[np.uint8],
    dots: Sequence[Dot],
    paired: Sequence[Stick],
    sticks: tuple[Stick, Stick] | None,
) -> str:
    """Return in words why no markers were found."""
    count = len(dots)
    if count < 4:
        return f"{count} of at least 4 dots found; dots up to {HUGE_PX:g} px in radius are looked for"
    if sticks is not None:
        return f"the clearest four of {count} dots are so faint that they may be texture"
    if len(paired) < 2:
        return f"{count} dots found, but {len(paired)} of at least 2 pairs lie on a stick with nothing between them"
    if choose_sticks(luma, dots):
        return f"two pairs were found, but other ones of the {count} dots stand out twice as clearly"
    return f"{len(paired)} pairs of dots found, but no two of them are like the sticks of one rig"
