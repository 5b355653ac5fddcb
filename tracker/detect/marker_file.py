"""``MARKERS.toml``: the kinds of the markers, and their positions in the first frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np

from torsight.core.errors import ConfigError
from torsight.core.files.config import get_number, get_text, shown_value
from torsight.core.files.paths import AnyPath
from torsight.core.files.storage import check_keys, read_toml
from torsight.core.frozen import Frozen
from torsight.core.tracks import MARKERS
from torsight.core.units import Floats
from tracker.detect.fiducials import check_id, family_of

STICKS: Final = ("base", "moving")
KEYS: Final = ("base", "moving", "kind", "family", "base_id", "moving_id", "base_mm", "moving_mm")
"""Keys of a marker file."""
KINDS: Final = ("dot", "texture", "tag")
APART_PX: Final = 2.0
"""Distance below which two positions count as the same."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class MarkerHints(Frozen):
    """The user's entries on the markers.

    Attributes
    ----------
    position_px : (4, 2) float64
        Order of :data:`torsight.core.tracks.MARKERS`; pixels of the first frame; NaN for a stick with a tag.
    kinds : (str, str)
        Of the base and of the moving stick, each ``"dot"``, ``"texture"`` or ``"tag"``.
    where : str
        File or table from which the entries come, for messages.
    length_mm : mapping of str to float
        Distances of the markers of ``base`` and ``moving`` that were measured by hand: a check of scale.
    family : str
        Family of the tags; empty without tags.
    ids : (int or None, int or None)
        Numbers of the tags on the base and on the moving stick.
    """

    position_px: Floats
    kinds: tuple[str, str]
    where: str
    length_mm: Mapping[str, float] = field(default_factory=dict)
    family: str = ""
    ids: tuple[int | None, int | None] = (None, None)

    @property
    def kind(self) -> str:
        """The kind of both sticks, or both kinds in words."""
        base, moving = self.kinds
        return base if base == moving else f"{base} and {moving}"

    def __repr__(self) -> str:
        return f"MarkerHints({self.where}, {self.kind})"

    def check_inside(self, size_px: tuple[int, int]) -> None:
        """Check that all markers lie inside the picture.

        Raises
        ------
        ConfigError
            Naming the marker and the size of the picture.
        """
        width, height = size_px
        for name, (x, y) in zip(MARKERS, self.position_px.tolist(), strict=True):
            if not np.isnan(x) and not (0 <= x <= width - 1 and 0 <= y <= height - 1):
                raise ConfigError(
                    "lies outside the picture",
                    where=f"{self.where}, {name.replace('_', ', ')} marker",
                    value=f"[{x:g}, {y:g}]",
                    limit=f"0 to {width - 1} and 0 to {height - 1}",
                    do="give pixel positions in the first frame, x to the right, y down",
                )


def in_second_film(hints: MarkerHints | None) -> MarkerHints | None:
    """Return the entries that hold for a stereo pair's right film: tags only, since positions are of the left film.

    Raises
    ------
    ConfigError
        For sticks that are not found automatically: only two with dots, or two with tags, are.
    """
    if hints is None or set(hints.kinds) == {"dot"}:
        return None
    if set(hints.kinds) == {"tag"}:
        return hints
    raise ConfigError(
        "positions are of the left film, and nothing tells where these markers are in the right one",
        where=f"{hints.where}, kind",
        value=hints.kind,
        limit="dots on both sticks, or tags on both, for two films",
        do="put dots or tags on both sticks, or track the left film alone",
    )


def read_markers(source: AnyPath | Mapping[str, Any]) -> MarkerHints:
    """Read the entries on the markers from a file, or from a table that was read already.

    Raises
    ------
    ConfigError
        For an unknown or missing key, a value that is no pair of positions, an unknown family of tags, or one tag for
        both sticks.
    InputError
        When the file cannot be read.
    """
    content: Mapping[str, Any]
    if not isinstance(source, Mapping):
        content, where = read_toml(Path(source), kind="markers"), str(source)
        # The file may contain the table under its own name, as an experiment does.
        if set(content) == {"markers"} and isinstance(content["markers"], Mapping):
            content = content["markers"]
    else:
        content, where = source, "[markers]"
    check_keys(content, KEYS, where=where)
    kinds = _kinds(content, where)
    # A tag is found automatically: positions that remain from another kind are ignored.
    nowhere = [[np.nan, np.nan]] * 2
    pairs = [nowhere if kind == "tag" else _pair(content, key, where) for key, kind in zip(STICKS, kinds, strict=True)]
    position_px = np.array([*pairs[0], *pairs[1]])
    for one in range(4):
        for two in range(one):
            if np.hypot(*(position_px[one] - position_px[two])) < APART_PX:
                raise ConfigError(
                    "two markers are at one place",
                    where=where,
                    value=f"{MARKERS[two]} and {MARKERS[one]} at {position_px[one].tolist()}",
                    limit="four different positions",
                )
    length_mm = {
        stick: get_number(content, f"{stick}_mm", where=where, lower=1e-3)
        for stick in STICKS
        if f"{stick}_mm" in content
    }
    family, ids = _tags(content, kinds, where)
    return MarkerHints(position_px=position_px, kinds=kinds, where=where, length_mm=length_mm, family=family, ids=ids)


def _kinds(content: Mapping[str, Any], where: str) -> tuple[str, str]:
    """Return the kinds of base and moving stick: one for both, or a table with one for each."""
    value = content.get("kind")
    if not isinstance(value, Mapping):
        kind = get_text(content, "kind", where=where, default="dot", choices=KINDS)
        return kind, kind
    check_keys(value, STICKS, where=f"{where}, kind")
    base, moving = (get_text(value, stick, where=f"{where}, kind", default="dot", choices=KINDS) for stick in STICKS)
    return base, moving


def _tags(content: Mapping[str, Any], kinds: tuple[str, str], where: str) -> tuple[str, tuple[int | None, int | None]]:
    """Return the family and the numbers of the tags; keys of tags without a tag, and equal numbers, are errors."""
    if "tag" not in kinds:
        given = [key for key in ("family", "base_id", "moving_id") if key in content]
        if given:
            raise ConfigError(
                f"'{given[0]}' is of tags, and no stick has one",
                where=where,
                value=repr(content[given[0]]),
                do='set kind = "tag", or take the key away',
            )
        return "", (None, None)
    family = get_text(content, "family", where=where).removeprefix("DICT_")
    family_of(family, where=where)
    ids: list[int | None] = []
    for stick, kind in zip(STICKS, kinds, strict=True):
        if kind != "tag":
            ids.append(None)
            continue
        key = f"{stick}_id"
        if key not in content:
            raise ConfigError(f"has no key '{key}'", where=where, do=f"give the number of the tag on the {stick} stick")
        number = content[key]
        if isinstance(number, bool) or not isinstance(number, int):
            raise ConfigError(f"'{key}' is no number of a tag", where=where, value=repr(number), limit="a whole number")
        check_id(family, number, where=f"{where}, {key}")
        ids.append(number)
    if ids[0] is not None and ids[0] == ids[1]:
        raise ConfigError(
            "both sticks have the tag of one number",
            where=where,
            value=f"base_id = moving_id = {ids[0]}",
            limit="two different numbers",
            do="put tags of different numbers on the sticks; 'torsight board --tags' prints such a pair",
        )
    return family, (ids[0], ids[1])


def _pair(content: Mapping[str, Any], key: str, where: str) -> list[list[float]]:
    value = content.get(key)
    shape_ok = (
        isinstance(value, list)
        and len(value) == 2
        and all(isinstance(point, list) and len(point) == 2 for point in value)
    )
    if not shape_ok or value is None:
        raise ConfigError(
            f"'{key}' is not two positions",
            where=where,
            value=shown_value(content, key),
            limit=f"{key} = [[x, y], [x, y]], inner marker first",
        )
    return [[get_number({key: number}, key, where=where) for number in point] for point in value]
