"""ArUco and AprilTag tags: their families, and their detection in a picture."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from torsight.core.errors import ConfigError
from torsight.core.units import Flags, Floats, Ints
from torsight.core.words.wording import listed
from tracker.innovation import SURE

Point = tuple[float, float]

_PREFIX: Final = "DICT_"
USUAL: Final = (
    "4X4_50", "5X5_50", "6X6_50", "7X7_50", "APRILTAG_36h11", "APRILTAG_25h9", "APRILTAG_16h5", "ARUCO_ORIGINAL",
    "4X4_1000", "5X5_1000", "6X6_1000", "7X7_1000", "APRILTAG_36h10", "ARUCO_MIP_36h12",
)  # fmt: skip
"""Families that are tried where none is given or the given one is not seen: those printed most often first, and of each
code the smallest family."""

UNMIRROR: Final = (
    "switch mirroring off in the camera's program, or do not film through a mirror; a film that is there already is "
    "flipped back by 'ffmpeg -i FILM -vf hflip NEW'"
)
"""Advice for tags that are seen mirrored."""
MODULE_PX: Final = 8
"""Size to which a module is drawn, and to which OpenCV resamples it for reading, without a margin of 0.13 of it on each
side. At OpenCV's default of 4 px that margin is rounded to zero, and neighbours of a module of 4.5 px in the picture
are included, since corners are found in whole pixels."""


def families() -> tuple[str, ...]:
    """Return the names of the families: those of OpenCV's dictionaries without ``DICT_``, each family once."""
    named: dict[int, str] = {}
    for name in sorted(vars(cv2.aruco), reverse=True):
        if name.startswith(_PREFIX):
            # AprilTag families have two spellings of one number; the one with the small letter comes first here.
            named.setdefault(int(getattr(cv2.aruco, name)), name.removeprefix(_PREFIX))
    return tuple(sorted(named.values()))


@lru_cache(maxsize=32)
def family_of(name: str, *, where: str) -> Any:
    """Return OpenCV's dictionary of a family; an unknown name raises :class:`ConfigError`."""
    number = getattr(cv2.aruco, _PREFIX + name.removeprefix(_PREFIX), None)
    if not isinstance(number, int):
        raise ConfigError(
            "is no family of tags", where=f"{where}, family", value=name, limit=f"one of {', '.join(families())}"
        )
    return cv2.aruco.getPredefinedDictionary(number)


def most_modules() -> int:
    """Return the modules across the largest tags that are usual, with their black border."""
    return 2 + max(int(family_of(name, where="tag").markerSize) for name in USUAL)


def count_of(name: str, *, where: str = "tag") -> int:
    """Return the number of tags of a family."""
    return len(family_of(name, where=where).bytesList)


def check_id(name: str, number: int, *, where: str) -> None:
    """Check that a family has a number; otherwise raise :class:`ConfigError`, which names the range."""
    count = count_of(name, where=where)
    if not 0 <= number < count:
        raise ConfigError("is no tag of this family", where=where, value=number, limit=f"0 to {count - 1} in {name}")


def bits_of(name: str, number: int) -> Flags:
    """Return the modules (n, n) of a tag, True for white, with its black border but without the white margin."""
    dictionary = family_of(name, where="tag")
    modules = int(dictionary.markerSize) + 2
    return np.asarray(cv2.aruco.generateImageMarker(dictionary, number, modules)) > 0


@dataclass(frozen=True, slots=True, eq=False)
class FoundTag:
    """A tag in a picture: its number, and its corners (4, 2) clockwise from the top left one of the upright tag."""

    number: int
    corners_px: Floats

    def holds(self, x_px: float, y_px: float) -> bool:
        """Return whether a position lies in the tag."""
        rim = self.corners_px.astype(np.float32)
        return bool(cv2.pointPolygonTest(rim, (x_px, y_px), measureDist=False) >= 0.0)


def find_tags(luma: NDArray[np.uint8], family: str) -> list[FoundTag]:
    """Return the tags of a family in a picture, by OpenCV's detector."""
    return _found(luma, {family: np.arange(count_of(family))})[family]


def usual_tags(luma: NDArray[np.uint8]) -> dict[str, list[FoundTag]]:
    """Return the tags of every usual family in a picture, in their order."""
    return _found(luma, _usual_codes(luma, _squares(luma))[0])


class TagsSeen:
    """The tags of the usual families in ``pictures`` of one film.

    A square with a black border that is no tag has a code of a family by chance: with a probability of a sixteenth for
    the thousand codes of 16 modules. Letters are such squares, and a page of print has hundreds. So tags of a family
    count only where the other black squares of the picture make a pair by chance improbable.
    """

    def __init__(self) -> None:
        self.pictures = 0
        self._shown: dict[str, Counter[int]] = {family: Counter() for family in USUAL}
        self._twins: dict[str, Counter[int]] = {family: Counter() for family in USUAL}
        self._by_chance = dict.fromkeys(USUAL, 0.0)
        self._last: NDArray[np.uint8] | None = None

    def take(self, luma: NDArray[np.uint8]) -> None:
        """Add the tags of a picture."""
        self.pictures, self._last = self.pictures + 1, luma
        codes, framed = _usual_codes(luma, _squares(luma))
        seen = _found(luma, codes)
        for family, found in seen.items():
            numbers = Counter(tag.number for tag in found)
            self._shown[family].update(number for number, times in numbers.items() if times == 1)
            self._twins[family].update(number for number, times in numbers.items() if times == 2)
            # A square that is a tag of a family with fewer codes is no clutter.
            rarer = [tag for one, tags in seen.items() if _share_of(one) < _share_of(family) for tag in tags]
            others = [at for at in framed[_codes_of(family)[0]] if not any(tag.holds(*at) for tag in (*found, *rarer))]
            self._by_chance[family] = max(self._by_chance[family], _share_of(family) * len(others))

    @property
    def pair(self) -> tuple[str, list[int]]:
        """The first family of which two tags or more are seen, and their numbers; "" and no numbers without one."""
        return next(((family, numbers) for family, numbers in self._seen_of(self._shown) if len(numbers) > 1), ("", []))

    @property
    def single(self) -> list[tuple[str, list[int]]]:
        """The families of which at least one tag is seen, and their numbers."""
        return self._seen_of(self._shown, least=1)

    def is_rarer_than(self, family: str) -> bool:
        """Return whether tags are seen that are less probable by chance than one tag of ``family``."""
        pair, chance = self.pair[0], _share_of(family)
        return bool(pair and _share_of(pair) ** 2 < chance) or any(_share_of(one) < chance for one, _ in self.single)

    def fault(self) -> tuple[str, str, str] | None:
        """Return what is wrong with the tags seen, their numbers, and what to do; None where no tag is seen."""
        twins, single, flipped = self._seen_of(self._twins), self.single, TagsSeen()
        if twins:
            do = "put tags of different numbers on the sticks; 'torsight board --tags' prints such a pair"
            return "two tags have the same number", numbered(*twins[0]), do
        if self._last is not None:
            flipped.take(np.ascontiguousarray(self._last[:, ::-1]))
        mirrored = flipped.single
        # Turned over, a tag may by chance be one of a family with many codes.
        if mirrored and not (single and _share_of(single[0][0]) < _share_of(mirrored[0][0])):
            return "tags are seen mirrored", f"{numbered(*mirrored[0])} in the picture turned over", UNMIRROR
        if single:
            do = "put a tag on each stick, flat, sharp and whole in the picture; 'torsight board --tags' prints a pair"
            return "only one tag is seen", numbered(*single[0]), do
        return None

    def _seen_of(self, counted: Mapping[str, Counter[int]], *, least: int = 2) -> list[tuple[str, list[int]]]:
        """Return the families of which ``least`` tags or more are not there by chance, and the numbers counted.

        With several pictures a tag has to be seen in two: clutter that looks like a tag seldom appears twice.
        """
        pictures, found = min(2, self.pictures), list[tuple[str, list[int]]]()
        for family, shown in counted.items():
            numbers = sorted(number for number, times in shown.items() if times >= pictures)
            # The first term of the Poisson distribution's tail, for a small mean.
            if numbers and self._by_chance[family] ** least / math.factorial(least) < 1.0 - SURE:
                found.append((family, numbers))
        return found


def _found(luma: NDArray[np.uint8], codes: Mapping[str, Ints]) -> dict[str, list[FoundTag]]:
    """Return the tags of a picture by family, among the families and numbers in ``codes``."""
    found: dict[str, list[FoundTag]] = {family: [] for family in codes}
    sought = [family for family, numbers in codes.items() if len(numbers)]
    if not sought:
        return found
    detector = cv2.aruco.ArucoDetector([_part_of(family, codes[family]) for family in sought], _parameters())
    corners, numbers, _, which = detector.detectMarkersMultiDict(np.ascontiguousarray(luma))
    if numbers is not None:
        for place, number, four in zip(np.ravel(which), np.ravel(numbers), corners, strict=True):
            family, corners_px = sought[int(place)], np.asarray(four, dtype=np.float64).reshape(4, 2)
            found[family].append(FoundTag(int(codes[family][int(number)]), corners_px))
    return found


def _usual_codes(
    luma: NDArray[np.uint8], squares: Sequence[NDArray[np.float32]]
) -> tuple[dict[str, Ints], dict[int, list[Point]]]:
    """Return the numbers of each usual family that match a square in a picture, and the squares with a black border.

    OpenCV's own criteria are used. The second result are middles of squares by the number of modules along a side, each
    place once. OpenCV compares each square with one code after the other: for a hundred squares and these 8,500 codes
    this takes 1.5 s. As one product of matrices the comparison is fast; OpenCV's detector then decides among the codes
    that match.
    """
    seen, framed, found = dict[int, NDArray[np.float32]](), dict[int, list[Point]](), dict[str, Ints]()
    for family in USUAL:
        size, codes, most = _codes_of(family)
        if size not in seen:
            read = _modules_of(luma, squares, size)
            inner = read[:, 1:-1, 1:-1]
            seen[size] = np.concatenate([np.rot90(inner, turns, axes=(1, 2)) for turns in range(4)])
            white = (read > 0.0).sum(axis=(1, 2)) - (inner > 0.0).sum(axis=(1, 2))
            allowed = int(size**2 * _parameters().maxErroneousBitsInBorderRate)
            framed[size] = _middles(np.reshape(squares, (-1, 4, 2))[white <= allowed])
        # Codes and squares of ±1: their product is the number of modules, less twice the number that differ.
        like = codes @ seen[size].reshape(-1, size**2).T >= size**2 - 2 * most
        found[family] = np.flatnonzero(like.any(axis=1))
    return found, framed


def _middles(squares: NDArray[np.float32]) -> list[Point]:
    """Return the middles of squares (c, 4, 2) without those that lie in a larger one: a border has two outlines."""
    at = squares.mean(axis=1) @ np.array([1.0, 1.0j])
    side_px = np.abs((squares - np.roll(squares, 1, axis=1)) @ np.array([1.0, 1.0j])).mean(axis=1)
    order = np.argsort(-side_px, kind="stable")
    inside = np.abs(at[order, None] - at[order]) < 0.5 * side_px[order]
    alone = order[~np.tril(inside, -1).any(axis=1)]
    return [(float(one.real), float(one.imag)) for one in at[alone]]


@lru_cache(maxsize=32)
def _share_of(family: str) -> float:
    """Return the share of all patterns of a family's modules that OpenCV reads as one of its codes."""
    size, codes, most = _codes_of(family)
    return 4 * len(codes) * sum(math.comb(size**2, wrong) for wrong in range(most + 1)) / 2.0**size**2


def _squares(luma: NDArray[np.uint8]) -> Sequence[NDArray[np.float32]]:
    """Return the corners (4, 2) of all quadrilaterals that OpenCV finds in a picture, also those inside of others."""
    parameters = _parameters()
    parameters.minMarkerDistanceRate = parameters.minGroupDistance = 0.0
    # With any family: the detector returns every quadrilateral, as a tag or as rejected.
    detector = cv2.aruco.ArucoDetector(_part_of(USUAL[0], np.zeros(1, np.int64)), parameters)
    shown, _, others = detector.detectMarkers(np.ascontiguousarray(luma))
    return [np.asarray(four, np.float32).reshape(4, 2) for four in (*shown, *others)]


def _modules_of(luma: NDArray[np.uint8], squares: Sequence[NDArray[np.float32]], size: int) -> NDArray[np.float32]:
    """Return the modules (c, n + 2, n + 2) of c squares with their border as OpenCV reads them, ±1 for white, black."""
    side = (size + 2) * MODULE_PX
    rim = np.array([[0, 0], [side - 1, 0], [side - 1, side - 1], [0, side - 1]], np.float32)
    margin = int(_parameters().perspectiveRemoveIgnoredMarginPerCell * MODULE_PX)
    seen = np.empty((len(squares), size + 2, size + 2), np.float32)
    for one, four in zip(seen, squares, strict=True):
        flat = cv2.warpPerspective(luma, cv2.getPerspectiveTransform(four, rim), (side, side), flags=cv2.INTER_NEAREST)
        _, white = cv2.threshold(flat, 0.0, 1.0, cv2.THRESH_BINARY | cv2.THRESH_OTSU)
        cells = white.reshape(size + 2, MODULE_PX, size + 2, MODULE_PX)[:, margin:-margin, :, margin:-margin]
        one[...] = np.where(cells.mean(axis=(1, 3)) > 0.5, 1.0, -1.0)
    return seen


@lru_cache(maxsize=32)
def _codes_of(family: str) -> tuple[int, NDArray[np.float32], int]:
    """Return a family's modules along a side, its codes (n, modules) as ±1, and OpenCV's limit of wrong modules."""
    dictionary = family_of(family, where="tag")
    size, (count, number, _) = int(dictionary.markerSize), dictionary.bytesList.shape
    # Bytes of the four orientations in sequence; the last byte of each holds the remaining bits, right-aligned.
    bits = np.unpackbits(np.reshape(dictionary.bytesList, (count, 4, number))[:, 0], axis=1)
    left = size**2 % 8
    bits = np.concatenate([bits[:, : size**2 - left], bits[:, bits.shape[1] - left :]], axis=1)
    most = int(dictionary.maxCorrectionBits * _parameters().errorCorrectionRate)
    return size, np.where(bits > 0, np.float32(1.0), np.float32(-1.0)), most


def _part_of(family: str, numbers: Ints) -> Any:
    """Return OpenCV's dictionary of a subset of a family's tags."""
    dictionary = family_of(family, where="tag")
    part = np.ascontiguousarray(dictionary.bytesList[numbers])
    return cv2.aruco.Dictionary(part, dictionary.markerSize, dictionary.maxCorrectionBits)


def _parameters() -> Any:
    parameters = cv2.aruco.DetectorParameters()
    parameters.perspectiveRemovePixelPerCell = MODULE_PX
    return parameters


def in_words(numbers: Iterable[int]) -> str:
    """Return the numbers of tags for a message, each once."""
    each = sorted(set(numbers))
    return f"{'number' if len(each) == 1 else 'numbers'} {listed([str(number) for number in each])}"


def numbered(family: str, numbers: Iterable[int]) -> str:
    """Return a family and the numbers of its tags for a message."""
    return f"{family}, {in_words(numbers)}"
