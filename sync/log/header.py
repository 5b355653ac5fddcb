"""The header of a log: its line, the delimiter of its fields, and which columns are used."""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from sync.log.column_names import ARRIVED, NEEDED, ChosenColumns, LogColumn, missing_column, resolve, with_unit
from sync.log.column_units import unit_of
from sync.log.repairs import Repair
from torsight.core.errors import InputError
from torsight.core.frozen import Frozen

_DELIMITERS: Final = (",", ";", "\t", "|")
BLANKS: Final = " "
"""Delimiter of columns that only blanks separate."""
_ARROW: Final = re.compile(r"^(\d{1,2}:\d{2}:\d{2}\.\d{1,6}) -> ")
"""Prefix that a serial monitor writes before every received line."""
_PLAIN_ROW: Final = re.compile(r"[-+\d.,;:|\sTZeE/]*")
_NUMBER: Final = re.compile(r"[-+]?\d+")


@dataclass(frozen=True, slots=True)
class Header(Frozen):
    """The header line of a log: its index, the delimiter of its fields, its names, and the columns that are used."""

    line: int
    delimiter: str
    names: tuple[str, ...]
    columns: Mapping[str, LogColumn]


def is_row_of_numbers(line: str) -> bool:
    """Return whether a line consists of numbers, dates and delimiters alone."""
    return _PLAIN_ROW.fullmatch(line) is not None and any(character.isdigit() for character in line)


def find_header(lines: Sequence[str], chosen: ChosenColumns, *, path: Path) -> Header:
    """Return the first line that names all needed columns, or raise the error of the line that names most of them."""
    best = (-1, 0)
    looked_at: set[str] = set()
    for index, line in enumerate(lines):
        # A line that differs from an earlier one only in its numbers is a row of the table: it names no other columns.
        words = _NUMBER.sub("0", line)
        if words in looked_at:
            continue
        looked_at.add(words)
        count = _count(find_columns(line, chosen, lines[index + 1 : index + 3])[2], chosen)
        best = max(best, (count, index), key=lambda one: one[0])
        if count == len(chosen.required):
            break
    index = best[1]
    delimiter, names, columns = find_columns(lines[index], chosen, lines[index + 1 : index + 3])
    found = require_all(names, columns, chosen, where=f"{path}, line {index + 1}")
    return Header(index, delimiter, _distinct_names(names), found)


def _distinct_names(names: Sequence[str]) -> tuple[str, ...]:
    """Return distinct names: a column without a name, or with the name of another, is named by its index."""
    named = [name or f"column_{index + 1}" for index, name in enumerate(names)]
    return tuple(
        name if named.index(name) == index else f"{name} (column {index + 1})" for index, name in enumerate(named)
    )


def without_arrows(lines: list[str], repairs: list[Repair]) -> list[str]:
    """Return lines with the times that a serial monitor wrote before each line as a column."""
    found = [_ARROW.match(line) for line in lines]
    stamped = sum(one is not None for one in found)
    if stamped <= len(lines) // 2:
        return lines
    text = f"{stamped} lines begin with the time at which a serial monitor got them"
    repairs.append(Repair("arrival", stamped, text))
    counts = Counter(one for line in lines for one in _DELIMITERS if one in line)
    delimiter = max(_DELIMITERS, key=lambda one: counts[one])
    made = []
    for line, match in zip(lines, found, strict=True):
        rest = line if match is None else line[match.end() :]
        numbers = _PLAIN_ROW.fullmatch(rest) is not None
        timestamp = "" if match is None else match[1]
        made.append(f"{timestamp if numbers else ARRIVED}{delimiter}{rest}")
    return made


def split_line(line: str, delimiter: str) -> list[str]:
    """Return the fields of a line, without blanks and quotes around them."""
    if delimiter == BLANKS:
        fields = line.split()
    else:
        fields = fields_of(line, delimiter) if '"' in line else line.split(delimiter)
    return [field.strip().strip('"').strip() for field in fields]


def header_names(line: str, delimiter: str) -> list[str]:
    """Return the names of a header line, without a comment sign before the first one."""
    names = split_line(
        line.strip().lstrip("\ufeff").lstrip("#%").strip(" ") if line[:1] in "#%\ufeff" else line, delimiter
    )
    while len(names) > len(NEEDED) and not names[-1]:
        names.pop()
    return names


def find_columns(
    line: str, chosen: ChosenColumns, rows: Sequence[str] | None = None
) -> tuple[str, list[str], dict[str, LogColumn | InputError]]:
    """Return the delimiter with which a line names most of the needed columns, the names, and the columns.

    Blanks count as delimiter only if they separate the rows below the line, if known, into the same number of fields:
    otherwise they may be those of a sentence, or of names that contain blanks.
    """
    best: tuple[str, list[str], dict[str, LogColumn | InputError]] = (",", [line], {})
    for delimiter in (*_DELIMITERS, BLANKS):
        if delimiter not in line:
            continue
        names = header_names(line, delimiter)
        if delimiter == BLANKS and rows is not None and all(len(row.split()) != len(names) for row in rows):
            continue
        columns = resolve(names, chosen)
        if _count(columns, chosen) > _count(best[2], chosen):
            best = (delimiter, names, columns)
    if not best[2]:
        delimiter = max(_DELIMITERS, key=line.count)
        best = (delimiter, header_names(line, delimiter), {})
    return best


def _count(columns: Mapping[str, object], chosen: ChosenColumns) -> int:
    return sum(role in columns for role in chosen.required)


def units_row(fields: Sequence[str], columns: Mapping[str, LogColumn]) -> dict[str, LogColumn | InputError] | None:
    """Return the columns with the units of a row below the header; None where this row contains no units."""
    units = {role: unit_of(fields[column.index]) for role, column in columns.items() if column.index < len(fields)}
    if any(re.search(r"\d", field) for field in fields) or not any(units.values()):
        return None
    return {
        role: column if (unit := units.get(role)) is None else with_unit(column, unit, role)
        for role, column in columns.items()
    }


def require_columns(columns: Mapping[str, LogColumn | InputError], *, where: str) -> dict[str, LogColumn]:
    """Return the columns, or raise the first error among them."""
    for column in columns.values():
        if isinstance(column, InputError):
            raise InputError(column.what, where=where, value=column.value, limit=column.limit, do=column.do)
    return {role: column for role, column in columns.items() if isinstance(column, LogColumn)}


def require_all(
    names: Sequence[str], columns: Mapping[str, LogColumn | InputError], chosen: ChosenColumns, *, where: str
) -> dict[str, LogColumn]:
    """Return the columns, or raise the first error among them or that of the first required column that is missing."""
    found = require_columns(columns, where=where)
    for role in chosen.required:
        if role not in found:
            raise missing_column(names, chosen, role, where=where)
    return found


def fields_of(line: str, delimiter: str) -> list[str]:
    """Return the fields of a row that contains quotes."""
    try:
        return next(csv.reader([line], delimiter=delimiter))
    except csv.Error:  # a field beyond the reader's limit
        return line.split(delimiter)
