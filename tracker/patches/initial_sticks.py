"""Initialisation of sticks of all kinds: from the first frame, or from the first frames that show their tags."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from torsight.core.errors import NoResultError
from torsight.core.progress import Progress
from torsight.core.tracks import MARKERS
from torsight.core.units import Floats
from torsight.core.words.wording import listed
from tracker.detect.fiducials import UNMIRROR, USUAL, TagsSeen, find_tags, in_words, numbered
from tracker.detect.given_positions import LOOKED_AT, given_dots, looked_at
from tracker.detect.marker_file import STICKS, MarkerHints
from tracker.detect.sticks import edges_beside_line
from tracker.follow.followed_dots import DotState
from tracker.follow.follower import Stick
from tracker.follow.judgement import to_strip
from tracker.follow.marker import markers_on
from tracker.frames.frame import Frame, FrameSource
from tracker.patches.align import Patch, cut_out
from tracker.patches.tag_stick import TagStick
from tracker.patches.texture import TurnedSearch, round_spot, spacing_px, texture_look, texture_patch
from tracker.patches.texture_stick import TextureStick
from tracker.patches.warps import Point

_SMALLEST_PX, _LARGEST_PX = 8.0, 15.0
"""Radii of the patch around a point without a dot: the largest for which there is room, at least the smallest. In a
large picture, whose points move further and whose details are larger, it grows with the moving stick."""
_OF_LENGTH: Final = 1.0 / 6.0
"""Largest radius of a patch over the length of the moving stick: that of the textured films of
benchmarks/tracking/table.py. The same film gets the same patches at any size of its picture."""
_STRUCTURE: Final = 2.0
"""Blur, in steps of a patch, before the structure is computed: noise of two grey levels then has gradients of 0.1
levels per px."""
_SLOPE: Final = 0.6
"""Smallest gradient (rms, grey levels per step of a patch) along the weakest direction: six times that of noise. Real
texture has 2 to 10, the straight edge of a pipe in a film in H.264 0.3 to 0.5. Below it in all directions there is no
texture."""


def sticks_of(first: Frame | None, hints: MarkerHints) -> tuple[Stick, Stick]:
    """Return both sticks, ready for the first frame.

    Raises
    ------
    NoResultError
        When a position that was given shows no dot or no texture.
    """
    base, moving = (_stick(first, hints, stick) for stick in (0, 1))
    return base, moving


def _stick(first: Frame | None, hints: MarkerHints, stick: int) -> Stick:
    kind, number = hints.kinds[stick], hints.ids[stick]
    if kind == "tag" and number is not None:
        return TagStick(hints.family, number)
    assert first is not None  # noqa: S101 - for the type checker: kept wherever a stick has no tag
    if kind == "dot":
        assert first.luma is not None  # noqa: S101 - for the type checker: a first frame has a picture
        return DotState(markers_on(first.luma, *given_dots(first, hints, sticks=(stick,))), still=stick == 0)
    return _texture_stick(first, hints, stick)


def _texture_stick(first: Frame, hints: MarkerHints, stick: int) -> TextureStick:
    assert first.luma is not None  # noqa: S101 - for the type checker: a first frame has a picture
    indices = (2 * stick, 2 * stick + 1)
    wheres = [f"{hints.where}, {MARKERS[index].replace('_', ', ')} marker" for index in indices]
    given = _points(hints, stick)
    room = _room(first.luma, hints, stick)
    found = [_patch_at(first.luma, room, at, where=where) for at, where in zip(given, wheres, strict=True)]
    ((x1, y1), one), ((x2, y2), two) = found
    points, patches, offset_px = [(x1, y1), (x2, y2)], [one, two], (x2 - x1, y2 - y1)
    window_px = min(one.half_px, two.half_px)
    if math.hypot(*offset_px) < window_px and not (one.turns or two.turns):
        raise NoResultError(
            "shows the same round spot as the stick's inner marker",
            where=wheres[1],
            value=f"[{given[1][0]:g}, {given[1][1]:g}]",
            limit="two places on a stick, between which it turns",
            do="choose a second spot, or a corner",
        )
    looks = [texture_look(first.luma, x, y, window_px=window_px, blur=1.0) for x, y in points]
    search = TurnedSearch((looks[0], looks[1]), window_px=window_px, offset_px=offset_px, still=stick == 0)
    half_px = min(edges_beside_line(first.luma, *points, window_px=window_px), default=window_px)
    return TextureStick(patches, points, search, still=stick == 0, half_px=half_px)


@dataclass(frozen=True, slots=True)
class _Room:
    """Room for the patches of a stick: largest radius, and the other stick's points and edges; None for a tag's.

    Around these points the picture is known to show the other stick up to ``known_px``.
    """

    largest_px: float
    known_px: float
    other: tuple[Point, Point] | None
    edges_px: list[float]


def _room(luma: NDArray[np.uint8], hints: MarkerHints, stick: int) -> _Room:
    own, other = (_points(hints, one) for one in (stick, 1 - stick))
    scale = _scale(hints)
    room_px = min([scale * _LARGEST_PX, 0.5 * math.dist(*own), *_edges_px(luma, *own, scale=scale)])
    # The place of a tag is not known yet.
    alone = math.isnan(other[0][0])
    return _Room(
        largest_px=max(_LARGEST_PX, room_px),
        known_px=_known_px(scale),
        other=None if alone else other,
        edges_px=[] if alone else _edges_px(luma, *other, scale=scale),
    )


def _points(hints: MarkerHints, stick: int) -> tuple[Point, Point]:
    one, two = ((float(x), float(y)) for x, y in hints.position_px[2 * stick : 2 * stick + 2])
    return one, two


def _patch_at(luma: NDArray[np.uint8], room: _Room, point: Point, *, where: str) -> tuple[Point, Patch]:
    """Return the patch around a point of a stick, and the point: of a round spot the middle, which is what is seen."""
    window_px = _window_px(luma, room, point, where=where)
    middle = round_spot(luma, *point, window_px=window_px)
    if middle is not None:
        point, window_px = middle, _window_px(luma, room, middle, where=where)
    patch = texture_patch(luma, *point, window_px=window_px, freedom=6 if middle is None else 2)
    _check_texture(luma, *point, patch.half_px, where=where)
    return point, patch


def _window_px(luma: NDArray[np.uint8], room: _Room, point: Point, *, where: str) -> float:
    """Return the radius of the largest patch around a point for which there is room: it shows its own stick alone."""
    (x, y), (height, width), edges_px = point, luma.shape, room.edges_px
    apart_px = math.inf
    if room.other is not None:
        # Without edges no bar is known to join the other points.
        apart_px = to_strip(point, *room.other, 0.0) if edges_px else min(math.dist(point, at) for at in room.other)
    width_px = min(edges_px, default=room.known_px)
    if apart_px - width_px < _SMALLEST_PX - 2.0:
        other = "the line through the other stick's markers" if edges_px else "a marker of the other stick"
        raise NoResultError(
            "lies on the other stick, or too close to it",
            where=where,
            value=f"[{x:g}, {y:g}], {apart_px:.0f} px from {other}",
            limit=f"{width_px + _SMALLEST_PX - 2.0:.0f} px or more in the first frame",
            do="choose a point further out, or start filming with the sticks apart",
        )
    window_px: float = min(room.largest_px, x - 2.0, y - 2.0, width - 3.0 - x, height - 3.0 - y, apart_px - width_px)
    if window_px < _SMALLEST_PX - 2.0:
        raise NoResultError(
            "lies too close to the border of the picture",
            where=where,
            value=f"[{x:g}, {y:g}]",
            limit=f"{_SMALLEST_PX:g} px of room",
        )
    return window_px


def _scale(hints: MarkerHints) -> float:
    """Return how many times the moving stick is as long as one with the usual patches, at least 1."""
    base_px, moving_px = np.hypot(*(hints.position_px[1::2] - hints.position_px[::2]).T).tolist()
    # The place of a tag is not known yet.
    length_px: float = base_px if math.isnan(moving_px) else moving_px
    return max(1.0, _OF_LENGTH * length_px / _LARGEST_PX)


def _known_px(scale: float) -> float:
    """Return how far around a point the picture is known to show its own stick, px."""
    return max(_LARGEST_PX, scale * _SMALLEST_PX)


def _edges_px(luma: NDArray[np.uint8], one: Point, two: Point, *, scale: float) -> list[float]:
    """Return the distances, px, of a stick's edges from the line between two of its points, as far as they are seen.

    They are looked for in the picture reduced by ``scale``, in which they are as sharp as in a small one.
    """
    small = cv2.resize(luma, None, fx=1.0 / scale, fy=1.0 / scale, interpolation=cv2.INTER_AREA)
    ends = [((x + 0.5) / scale - 0.5, (y + 0.5) / scale - 0.5) for x, y in (one, two)]
    found = edges_beside_line(np.asarray(small, np.uint8), *ends, window_px=_known_px(scale) / scale)
    return [scale * edge for edge in found]


def _check_texture(luma: NDArray[np.uint8], x: float, y: float, window_px: float, *, where: str) -> None:
    """Raise an error for a point around which the texture does not determine the position."""
    weakest, strongest = np.sqrt(_structure(luma, x, y, window_px) / (math.pi * window_px**2)).tolist()
    slope = _SLOPE / spacing_px(window_px)
    if strongest < slope:
        raise NoResultError(
            "has no texture around it that could be followed",
            where=where,
            value=f"slope of {strongest:.2f} grey levels per px",
            limit=f"{slope:.2g} or more within {window_px:.0f} px",
            do="choose a point with clear structure",
        )
    if weakest < slope:
        raise NoResultError(
            "lies on an edge or a line, along which the patch around it looks the same",
            where=where,
            value=f"slope of {weakest:.2f} grey levels per px along it",
            limit=f"{slope:.2g} or more in every direction within {window_px:.0f} px",
            do="choose a corner, a crossing or a blot",
        )


def _structure(luma: NDArray[np.uint8], x: float, y: float, window_px: float) -> Floats:
    """Return the eigenvalues (2,), ascending, of the structure tensor: sums of squared gradients, grey levels²."""
    half = int(window_px)
    cx, cy = round(x), round(y)
    blur_px = _STRUCTURE * spacing_px(window_px)
    margin = half + round(3.0 * blur_px)
    part = cut_out(luma, cx, cy, margin).astype(np.float32)
    soft = np.asarray(cv2.GaussianBlur(part, (0, 0), blur_px), dtype=np.float64)
    v, u = np.mgrid[-margin : margin + 1, -margin : margin + 1]
    inside = np.hypot(u, v) <= half
    down, right = (np.asarray(axis)[inside] for axis in np.gradient(soft))
    tensor = np.array([[right @ right, right @ down], [right @ down, down @ down]])
    return np.maximum(np.linalg.eigvalsh(tensor), 0.0)


def look_for_tags(source: FrameSource, hints: MarkerHints, *, progress: Progress) -> None:
    """Check that every tag that was named is seen in one of the first frames; the error names the likely cause.

    That is another family or other numbers that are seen instead, two tags of one number, or a mirrored picture.
    """
    missing = {number: stick for stick, number in zip(STICKS, hints.ids, strict=True) if number is not None}
    named, others, seen = dict(missing), list[int](), TagsSeen()
    last, picture = 0, np.zeros((1, 1), np.uint8)
    for last, luma in looked_at(source, progress, what="the tags"):
        found = find_tags(luma, hints.family)
        for number, stick in named.items():
            places = [tag.corners_px.mean(axis=0) for tag in found if tag.number == number]
            if len(places) > 1:
                raise NoResultError(
                    f"tag {number} of the {stick} stick is seen {len(places)} times",
                    where=f"{source.name}, frame {last}",
                    value=", ".join(f"[{x:.0f}, {y:.0f}]" for x, y in places),
                    limit="one tag of each number",
                    do="put tags of different numbers on the sticks; 'torsight board --tags' prints such a pair",
                )
            if places:
                missing.pop(number, None)
        if not missing:
            break
        others += [tag.number for tag in found if tag.number not in named]
        picture = luma.copy()
        seen.take(picture)
    progress("looking for the tags", LOOKED_AT[-1], LOOKED_AT[-1])
    if missing:
        mirrored = [tag.number for tag in find_tags(picture[:, ::-1], hints.family) if tag.number in missing]
        words = listed([f"tag {number} of the {stick} stick" for number, stick in missing.items()])
        what = f"{words} ({hints.family}) {'was' if len(missing) == 1 else 'were'} not found"
        known = sorted(set(named) - set(missing))
        raise _not_found(what, hints.family, mirrored, known, others, seen, where=f"{source.name}, frames 0 to {last}")


def _not_found(
    what: str,
    family: str,
    mirrored: list[int],
    known: list[int],
    others: list[int],
    seen: TagsSeen,
    *,
    where: str,
) -> NoResultError:
    """Return the error for tags that are not found, with the likely cause.

    ``mirrored`` are those seen in the picture turned over, ``known`` those that were named and found, ``others`` other
    numbers of their family.
    """
    # Turned over, a tag may by chance be one of a family with few modules.
    if mirrored and not known and not seen.is_rarer_than(family):
        value = f"{in_words(mirrored)} in the picture turned over"
        return NoResultError(f"{what}: the picture is mirrored", where=where, value=value, do=UNMIRROR)
    if others:
        value = f"of this family {in_words(others)}"
        return NoResultError(what, where=where, value=value, do="correct base_id and moving_id")
    if seen.single and not known:
        other, numbers = seen.single[0]
        do = f'set family = "{other}" and the numbers that are seen'
        return NoResultError(f"{what}, but tags of another family", where=where, value=numbered(other, numbers), do=do)
    return NoResultError(
        what,
        where=where,
        value=f"of this family {in_words(known)}"
        if known
        else f"no tag of {family} nor of {len(set(USUAL) - {family})} {'other ' * (family in USUAL)}usual families",
        limit="tags of this family that lie flat, sharp, whole in the picture, with a white border of a module around, "
        "and modules of 4 px and more",
        do="move the camera closer or print them larger, light them evenly, and keep hands out of the picture",
    )
