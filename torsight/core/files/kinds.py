"""Kinds of input files, recognised by their content: a file in place of another one is named, not its first key."""

from __future__ import annotations

import contextlib
import re
import tomllib
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Final, NamedTuple, TypeVar

from torsight.core.errors import TorsightError

_Error = TypeVar("_Error", bound=TorsightError)


class Kind(NamedTuple):
    """A kind of file: its name with the article, the keys or columns that distinguish it, and where one comes from."""

    name: str
    signs: tuple[str, ...]
    source: str


TOML_KINDS: Final[Mapping[str, Kind]] = {
    "experiment": Kind(
        "an experiment file", ("video", "angle", "temperature"), "'torsight init' writes one to fill in"
    ),
    "actuator": Kind("an actuator file", ("geometry", "material"), "'torsight init' writes one to fill in"),
    "camera": Kind("a camera file", ("intrinsics", "pose", "right"), "'torsight calibrate' makes one"),
    "markers": Kind("a marker file", ("base", "moving", "base_id", "moving_id"), "'torsight markers' makes one"),
    "board": Kind("a board file", ("columns", "rows", "square_mm", "board"), "'torsight board' makes one"),
    "tests": Kind("a file of spring tests", ("free_recovery", "force_angle"), "write one as the manual shows"),
    "scene": Kind("a scene", ("protocol", "motion", "rig", "effects"), "write one as fixtures/scenes/paper.toml"),
}
"""Kinds of TOML files, each recognised by any of its tables or keys."""

TABLE_KINDS: Final[Mapping[str, Kind]] = {
    "merged": Kind(
        "a merged table",
        ("time_s", "angle_deg", "angle_sigma_deg", "temp_a_c", "temp_b_c"),
        "'torsight sync' makes one of angle.csv and the temperature log",
    ),
    "angle": Kind(
        "a table of angles",
        ("frame", "time_s", "angle_deg", "angle_sigma_deg", "valid"),
        "'torsight track' makes one, angle.csv",
    ),
    "log": Kind("a temperature log", ("time_s", "temp_a_c", "temp_b_c"), "name the log that was recorded"),
}
"""Kinds of tables, each recognised by all of its columns."""


_EXPORT: Final = "export it as CSV"
_ANOTHER: Final = "name the file that belongs here"
_BINARY: Final[Mapping[re.Pattern[bytes], Kind]] = {
    re.compile(rb"\x1f\x8b"): Kind("a compressed file", (), "unpack it"),
    re.compile(rb"PK\x03\x04"): Kind("an archive or a spreadsheet's own format", (), _EXPORT),
    re.compile(rb"\xd0\xcf\x11\xe0"): Kind("an old spreadsheet's own format", (), _EXPORT),
    re.compile(rb"PAR1"): Kind("Parquet; its name must end in .parquet", (), "rename it"),
    re.compile(rb"%PDF"): Kind("a document", (), _EXPORT),
    re.compile(rb"\x89PNG|\xff\xd8\xff"): Kind("a picture", (), _ANOTHER),
    re.compile(rb"....ftyp|RIFF....AVI |\x1a\x45\xdf\xa3", re.DOTALL): Kind("a film", (), _ANOTHER),
}
"""First bytes of files that are no text."""


def binary_kind(content: bytes) -> Kind | None:
    """Return the kind of a file that is no text, by its first bytes; None where they are of no known kind."""
    return next((kind for beginning, kind in _BINARY.items() if beginning.match(content)), None)


def toml_kind(content: Collection[str]) -> str | None:
    """Return the key in :data:`TOML_KINDS` of a TOML file with these tables and keys; None where it is not clear."""
    return next((kind for kind, one in TOML_KINDS.items() if not set(one.signs).isdisjoint(content)), None)


def table_kind(columns: Collection[str], wanted: Kind | None = None) -> Kind | None:
    """Return the kind of a table with these columns; None where it is not clear.

    A table with a column that distinguishes the ``wanted`` kind from the other one is of this kind, but not complete.
    """
    held = set(columns)
    found = next((one for one in TABLE_KINDS.values() if set(one.signs) <= held), None)
    if found is None or wanted is None or (set(wanted.signs) - set(found.signs)).isdisjoint(held):
        return found
    return None


def kind_of(text: str) -> Kind | None:
    """Return the kind of a text file, by its content; None where it is not clear."""
    found = table_kind([name.strip() for name in re.split("[,;\t]", text.partition("\n")[0])])
    if found is not None:
        return found
    with contextlib.suppress(ValueError, RecursionError):
        kind = toml_kind(tomllib.loads(text))
        return None if kind is None else TOML_KINDS[kind]
    return None


def other_kind(error: type[_Error], found: Kind, wanted: Kind, *, where: str | Path) -> _Error:
    """Return the error for a file of one kind that is given in place of another."""
    return error(f"is {found.name}", where=str(where), limit=wanted.name, do=wanted.source)
