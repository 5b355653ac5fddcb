"""Delimited text as instruments and spreadsheets write it: delimiter, decimal sign, preamble, broken rows.

A decimal comma is read as one only where nothing else is possible: commas do not separate the fields, and at least
one number cannot be written with a thousands sign (``1,234`` seconds alone might be a thousand and more, a spring of
``23,360`` degrees can only have been 23.36).
"""

from __future__ import annotations

import io
import math
import re
import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from sync.log.column_names import ChosenColumns, LogColumn
from sync.log.header import BLANKS, fields_of, find_header, require_columns, split_line, units_row, without_arrows
from sync.log.repairs import Repair
from torsight.core.errors import InputError
from torsight.core.files.kinds import binary_kind
from torsight.core.files.storage import DECIMAL_COMMA, empty_table, read_bytes, table_without_rows
from torsight.core.frozen import Frozen
from torsight.core.words.wording import counted

if TYPE_CHECKING:
    import pandas as pd

_COMMA_NUMBER: Final = re.compile(r"(?<![\d.,:])[-+]?\d+,\d+(?![\d.,])")
_SURE_COMMA: Final = re.compile(r"(?<![\d.,:])[-+]?(?:\d+,(?:\d{1,2}|\d{4,})|(?:0\d*|\d{4,}),\d{3})(?![\d.,])")
"""A number with a comma where no thousands sign can be: before other than three digits, after a zero or four digits."""
_QUOTED_NUMBER: Final = re.compile(r'"\s*([-+]?\d+),(\d+)\s*"')
_BOTH_SIGNS: Final = re.compile(r"\d\.\d{3},\d|\d,\d{3}\.\d")
_BLANKS: Final = re.compile(r"[ \t]+")
_MARKED: Final = (
    *("****", "---", "--", "-", "?", "Inf", "-Inf", "inf", "-inf"),
    *("OVERLOAD", "ERR", "Err", "Error", "OL"),
)
"""Markers that instruments write in place of a missing reading."""


@dataclass(frozen=True, slots=True)
class TextTable(Frozen):
    """A table as read: text or numbers per column, the line of its first row in the file, and the repairs.

    ``columns`` are the log's columns by role (:mod:`sync.log.column_names`).
    """

    frame: pd.DataFrame
    first_line: int
    repairs: tuple[Repair, ...]
    columns: Mapping[str, LogColumn]


def read_text_table(path: Path, chosen: ChosenColumns) -> TextTable:
    """Read delimited text with a header on any line: the first one that names time and both temperatures.

    The decimal sign is that of the columns that are used: other columns, such as notes or versions, do not determine
    it.

    Raises InputError when the file is missing, empty, binary, without a needed column, or ambiguous in columns or
    decimal sign.
    """
    text, repairs = _decode(path)
    lines = without_arrows(text.splitlines(), repairs)
    header = find_header(lines, chosen, path=path)
    if header.line:
        repairs.append(Repair("preamble", header.line, f"{counted(header.line, 'line')} before the header passed over"))
    first = header.line + 1
    rows = lines[first:]
    if header.delimiter == BLANKS:
        rows = [_BLANKS.sub("\t", line.strip()) for line in rows]
        header = replace(header, delimiter="\t")
    columns = header.columns
    if rows and (units := units_row(split_line(rows[0], header.delimiter), columns)) is not None:
        columns = require_columns(units, where=f"{path}, line {first + 1}")
        first, rows = first + 1, rows[1:]
        repairs.append(Repair("units", 1, f"line {first} was read as units"))
    delimiter = header.delimiter
    labview = labview_header(lines[: header.line], delimiter)
    if labview.units and (units := units_row(labview.units, columns)) is not None:
        columns = require_columns(units, where=f"{path}, Y_Unit_Label")
    body = _whole_rows(rows, len(header.names), delimiter, path=path, first_line=first + 1, repairs=repairs)
    places = [column.index for column in columns.values()]
    decimal = labview.decimal or _decimal(body, delimiter, columns, path=path, first_line=first + 1, repairs=repairs)
    frame = _parsed(body, list(header.names), delimiter, decimal, path=path)
    labview.fill_times(frame, columns["time"].index, repairs)
    if decimal == ",":
        _with_points(frame, places)
    return TextTable(frame=frame, first_line=first + 1, repairs=tuple(repairs), columns=columns)


def _parsed(body: Sequence[str], names: list[str], delimiter: str, decimal: str, *, path: Path) -> pd.DataFrame:
    import pandas as pd

    joined = "\n".join(body)
    if delimiter == "," and decimal == ",":
        joined, decimal = _QUOTED_NUMBER.sub(r"\1.\2", joined), "."
    if not joined.strip():
        raise table_without_rows(path)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", pd.errors.ParserWarning)
            return pd.read_csv(
                io.StringIO(joined),
                sep=delimiter,
                decimal=decimal,
                header=None,
                names=names,
                index_col=False,
                skip_blank_lines=False,
                skipinitialspace=True,
                low_memory=False,
                na_values=list(_MARKED),
            )
    except (pd.errors.ParserError, pd.errors.ParserWarning, ValueError, OverflowError) as error:
        do = "look for a quotation mark that is not closed"
        raise InputError(f"is not a readable table ({str(error).strip()})", where=str(path), do=do) from error


def _decode(path: Path) -> tuple[str, list[Repair]]:
    raw = read_bytes(path)
    if not raw.strip(b"\0 \r\n\t"):
        raise empty_table(path)
    binary = binary_kind(raw)
    if binary is not None:
        raise InputError("is not text", where=str(path), value=binary.name, do=binary.source)
    repairs: list[Repair] = []
    if raw[:2] in (b"\xff\xfe", b"\xfe\xff"):
        repairs.append(Repair("encoding", 1, "the file is UTF-16; read as such"))
        return raw.decode("utf-16", errors="replace"), repairs
    zeros = raw.count(b"\0")
    if zeros > len(raw) // 4:
        # Of the two bytes of a Western character in UTF-16 one is zero: the second one if little-endian.
        order = "utf-16-le" if raw[1::2].count(b"\0") > raw[::2].count(b"\0") else "utf-16-be"
        text = raw.decode(order, errors="replace")
        if "\0" not in text:
            repairs.append(Repair("encoding", 1, "the file is UTF-16 without a byte order mark; read as such"))
            return text, repairs
    if zeros:
        # A logger that lost power leaves a tail of zero bytes.
        repairs.append(Repair("zero_bytes", zeros, f"{counted(zeros, 'zero byte')} taken out"))
        raw = raw.replace(b"\0", b"")
    try:
        return raw.decode("utf-8-sig"), repairs
    except UnicodeDecodeError as error:
        if error.start == len(raw) - 1:
            raise InputError("is not text", where=f"{path}, byte {error.start}", do="export it as CSV") from error
        repairs.append(Repair("encoding", 1, f"the file is not UTF-8 (byte {error.start}); read as Latin-1"))
        return raw.decode("latin-1"), repairs


def _whole_rows(
    lines: Sequence[str], columns: int, delimiter: str, *, path: Path, first_line: int, repairs: list[Repair]
) -> list[str]:
    """Return the rows, blanking those with too many fields or none; rows with too few keep their fields."""
    body = list(lines)
    while body and not body[-1].strip():
        body.pop()
    blank_row = delimiter * (columns - 1)
    found: dict[str, list[int]] = {"malformed_row": [], "short_row": [], "blank_row": []}
    kinds = [_fault(line, columns, delimiter) for line in body]
    # The header may name a column for which the rows have no field, such as LabVIEW's "Comment".
    usual = kinds.count("short_row") > len(body) // 2
    for index, (line, kind) in enumerate(zip(body, kinds, strict=True)):
        if kind == "":
            continue
        if kind == "trailing":
            body[index] = line.rstrip()[:-1]
            continue
        if kind == "short_row" and usual:
            continue
        found[kind].append(index)
        if kind != "short_row":
            body[index] = blank_row
    wrong = found["malformed_row"]
    if len(wrong) > len(body) // 2:
        raise InputError(
            "most rows have more fields than the header",
            where=f"{path}, line {wrong[0] + first_line}",
            value=repr(lines[wrong[0]][:80]),
            limit=f"{columns} fields separated by {delimiter!r}",
            do="decimal commas need ';' between the fields, or quotes",
        )
    for kind, name, words in (
        ("malformed_row", "row", " with too many fields dropped"),
        ("short_row", "row", " with too few fields read as far as possible"),
        ("blank_row", "blank row", " passed over"),
    ):
        rows = found[kind]
        if rows:
            text = f"{counted(len(rows), name)}{words}, the first on line {rows[0] + first_line}"
            repairs.append(Repair(kind, len(rows), text))
    return body


def _fault(line: str, columns: int, delimiter: str) -> str:
    """Return the kind of fault of a row; empty for a sound row."""
    if not line.strip():
        return "blank_row"
    fields = len(fields_of(line, delimiter)) if '"' in line else line.count(delimiter) + 1
    if fields == columns:
        return ""
    if fields == columns + 1 and line.rstrip().endswith(delimiter):
        return "trailing"
    return "malformed_row" if fields > columns else "short_row"


def _decimal(
    body: Sequence[str],
    delimiter: str,
    columns: Mapping[str, LogColumn],
    *,
    path: Path,
    first_line: int,
    repairs: list[Repair],
) -> str:
    """Return the decimal sign of the given columns; ambiguous numbers are refused."""
    numbers = _with_comma(body, delimiter, [column.index for column in columns.values()])
    signs = ((line, _COMMA_NUMBER.search(text) or _BOTH_SIGNS.search(text)) for line, text in numbers.items())
    line, first = next(((line, match) for line, match in signs if match is not None), (0, None))
    if first is None:
        return "."
    whole = "\n".join(numbers.values())
    # No spring has a temperature of a thousand and more.
    readings = "\n".join(_with_comma(body, delimiter, [columns[spring].index for spring in "ab"]).values())
    if _BOTH_SIGNS.search(whole) or not (_SURE_COMMA.search(whole) or _COMMA_NUMBER.search(readings)):
        raise InputError(
            "has numbers whose comma can be a decimal sign or a thousands sign",
            where=f"{path}, line {line + first_line}",
            value=first.group(0),
            limit="'.' as decimal sign, no thousands sign",
            do="export it with '.' as decimal sign",
        )
    count = sum(1 for _ in _COMMA_NUMBER.finditer(whole))
    repairs.append(Repair("decimal_comma", count, f"{counted(count, 'decimal comma')} read as '.'"))
    return ","


def _with_points(frame: pd.DataFrame, columns: Sequence[int]) -> None:
    """Replace decimal commas by points in columns that are still text, in which rows with both signs are mixed."""
    import pandas as pd

    for index in columns:
        column = frame.iloc[:, index]
        if not pd.api.types.is_numeric_dtype(column):
            frame[frame.columns[index]] = column.astype("string").str.replace(DECIMAL_COMMA, ".", regex=True)


def _with_comma(body: Sequence[str], delimiter: str, columns: Sequence[int]) -> dict[int, str]:
    """Return, by row, the text of the given columns, for rows in which one of these fields contains a comma."""
    rows: Iterable[list[str]] = ()
    if delimiter != ",":
        rows = (line.split(delimiter) if "," in line else [] for line in body)
    elif any('"' in line for line in body):
        # Where commas separate the fields, a comma within a number is in quotes.
        rows = (fields_of(line, delimiter) if '"' in line else [] for line in body)
    texts = (" ".join(row[index].strip(' "') for index in columns if index < len(row)) for row in rows)
    return {number: text for number, text in enumerate(texts) if "," in text}


_FIRST_LINE: Final = "LabVIEW Measurement"


@dataclass(frozen=True, slots=True)
class LabviewHeader:
    """Information in the lines before the names of a LabVIEW measurement file (.lvm); empty for a file of another kind.

    With the option "empty time column" such a file has no times; they follow from ``X0`` and ``Delta_X`` of the
    channel's header. Format: NI, "Specification for the LabVIEW Measurement File (.lvm)".

    Decimal sign, units by column (the column of times has none), time of the first row, and step from row to row.
    """

    decimal: str = ""
    units: tuple[str, ...] = ()
    begin_s: float = 0.0
    step_s: float | None = None

    def fill_times(self, frame: pd.DataFrame, place: int, repairs: list[Repair]) -> None:
        """Fill the column of times if it is empty."""
        if self.step_s is not None and not frame.iloc[:, place].notna().any():
            frame.isetitem(place, self.begin_s + self.step_s * np.arange(len(frame), dtype=np.float64))
            text = f"the column of times is empty: they follow from Delta_X, {self.step_s:g} s"
            repairs.append(Repair("times", len(frame), text))


def labview_header(preamble: Sequence[str], delimiter: str) -> LabviewHeader:
    """Return the information in a LabVIEW preamble."""
    if not preamble or not preamble[0].strip().startswith(_FIRST_LINE):
        return LabviewHeader()
    entries: dict[str, list[str]] = {}
    for line in preamble:
        key, *values = split_line(line, delimiter)
        entries[key] = values
    decimal = next(iter(entries.get("Decimal_Separator", [])), "")
    step_s = _number(entries.get("Delta_X"), decimal)
    return LabviewHeader(
        decimal=decimal if decimal in (".", ",") else "",
        units=("", *entries.get("Y_Unit_Label", ())) if any(entries.get("Y_Unit_Label", ())) else (),
        begin_s=_number(entries.get("X0"), decimal) or 0.0,
        step_s=step_s if step_s is not None and step_s > 0.0 else None,
    )


def _number(values: Sequence[str] | None, decimal: str) -> float | None:
    try:
        number = float(values[0].replace(decimal or ".", ".")) if values else math.nan
    except ValueError:
        return None
    return number if math.isfinite(number) else None
