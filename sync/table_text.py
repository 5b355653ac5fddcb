"""Delimited text as instruments and spreadsheets write it: delimiter, decimal sign, preamble, broken rows.

A decimal comma is read as one only where nothing else is possible: the fields are not parted by commas, and at least
one number has other than three digits behind its comma (``1,234`` alone might be a thousand and more).
"""

from __future__ import annotations

import csv
import io
import re
import warnings
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

from sync.repairs import Repair
from torsight.core.errors import InputError
from torsight.core.paths import missing_file, require_ordinary

if TYPE_CHECKING:
    import pandas as pd

_DELIMITERS: Final = (",", ";", "\t", "|")
_COMMA_NUMBER: Final = re.compile(r"(?<![\d.,:])[-+]?\d+,\d+(?![\d.,])")
_SURE_COMMA: Final = re.compile(r"(?<![\d.,:])[-+]?\d+,(?:\d{1,2}|\d{4,})(?![\d.,])")
_DECIMAL_COMMA: Final = re.compile(r"(?<=\d),(?=\d)")
_QUOTED_NUMBER: Final = re.compile(r'"\s*([-+]?\d+),(\d+)\s*"')
_BOTH_SIGNS: Final = re.compile(r"\d\.\d{3},\d|\d,\d{3}\.\d")
_PREAMBLE_LINES: Final = 60
_NO_TEXT: Final = {
    b"\x1f\x8b": "a compressed file",
    b"PK\x03\x04": "an archive or a spreadsheet's own format",
    b"\xd0\xcf\x11\xe0": "an old spreadsheet's own format",
    b"PAR1": "Parquet; its name must end in .parquet",
    b"%PDF": "a document",
    b"\x89PNG": "a picture",
}
"""What a file that is no text begins with."""


@dataclass(frozen=True, slots=True)
class TextTable:
    """A table as read: text or numbers per column, and the line of the file on which each row stands."""

    frame: pd.DataFrame
    first_line: int
    repairs: tuple[Repair, ...]


def read_text_table(path: Path, *, required: Sequence[str], numeric: Sequence[str] = ()) -> TextTable:
    """Read delimited text whose header names the ``required`` columns.

    The decimal sign is that of the ``required`` and the ``numeric`` columns: what stands in others, as a note or a
    version, says nothing about it.

    Raises
    ------
    InputError
        When the file is missing, empty, binary, without a required column, or ambiguous in its decimal sign.
    """
    import pandas as pd

    text, repairs = _decode(path)
    lines = text.splitlines()
    header, delimiter = _find_header(lines, required, path=path)
    names = [name.strip().strip('"').strip() for name in lines[header].split(delimiter)]
    names = [name or f"column_{index + 1}" for index, name in enumerate(names)]
    if len(set(names)) != len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise InputError("two columns have one name", where=f"{path}, line {header + 1}", value=repr(twice))
    if header:
        repairs.append(Repair("preamble", header, f"{header} lines before the header were passed over"))
    body = _whole_rows(lines[header + 1 :], len(names), delimiter, path=path, first_line=header + 2, repairs=repairs)
    joined = "\n".join(body)
    columns = [names.index(name) for name in names if name in (*required, *numeric)]
    decimal = _decimal(body, delimiter, columns, path=path, first_line=header + 2, repairs=repairs)
    if delimiter == "," and decimal == ",":
        joined, decimal = _QUOTED_NUMBER.sub(r"\1.\2", joined), "."
    if not joined.strip():
        raise InputError("has a header but no rows", where=str(path), do="record it again")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", pd.errors.ParserWarning)
            frame = pd.read_csv(
                io.StringIO(joined),
                sep=delimiter,
                decimal=decimal,
                header=None,
                names=names,
                index_col=False,
                skip_blank_lines=False,
                skipinitialspace=True,
                low_memory=False,
                na_values=[
                    "****",
                    "---",
                    "--",
                    "-",
                    "?",
                    "Inf",
                    "-Inf",
                    "inf",
                    "-inf",
                    "OVERLOAD",
                    "ERR",
                    "Err",
                    "Error",
                    "OL",
                ],
            )
    except (pd.errors.ParserError, pd.errors.ParserWarning, ValueError, OverflowError) as error:
        raise InputError(
            f"is not a readable table ({str(error).strip()})",
            where=str(path),
            do="look for a quotation mark that is not closed",
        ) from error
    if decimal == ",":
        _with_points(frame, columns)
    return TextTable(frame=frame, first_line=header + 2, repairs=tuple(repairs))


def _decode(path: Path) -> tuple[str, list[Repair]]:
    if not path.exists():
        raise missing_file(path)
    require_ordinary(path)
    try:
        raw = path.read_bytes()
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror or error})", where=str(path)) from error
    if not raw.strip(b"\0 \r\n\t"):
        raise InputError("is empty", where=str(path), do="record it again, with a header row")
    for beginning, kind in _NO_TEXT.items():
        if raw.startswith(beginning):
            raise InputError("is not text", where=str(path), value=kind, do="export it as CSV")
    repairs: list[Repair] = []
    if raw[:2] in (b"\xff\xfe", b"\xfe\xff"):
        repairs.append(Repair("encoding", 1, "the file is UTF-16; read as such"))
        return raw.decode("utf-16", errors="replace"), repairs
    zeros = raw.count(b"\0")
    if zeros:
        # A logger that lost its power leaves a tail of zero bytes.
        repairs.append(Repair("zero_bytes", zeros, f"{zeros} zero bytes were taken out"))
        raw = raw.replace(b"\0", b"")
    try:
        return raw.decode("utf-8-sig"), repairs
    except UnicodeDecodeError as error:
        if error.start == len(raw) - 1:
            raise InputError("is not text", where=f"{path}, byte {error.start}", do="export it as CSV") from error
        repairs.append(Repair("encoding", 1, f"the file is not UTF-8 (byte {error.start}); read as Latin-1"))
        return raw.decode("latin-1"), repairs


def _find_header(lines: Sequence[str], required: Sequence[str], *, path: Path) -> tuple[int, str]:
    """Return the header's line and the delimiter: the first line that, split, names all required columns."""
    best: tuple[int, int, str] = (-1, 0, ",")
    for index, line in enumerate(lines[:_PREAMBLE_LINES]):
        for delimiter in _DELIMITERS:
            names = {name.strip().strip('"').strip() for name in line.split(delimiter)}
            found = sum(name in names for name in required)
            if found == len(required):
                return index, delimiter
            if found > best[0]:
                best = (found, index, delimiter)
    line, delimiter = lines[best[1]], best[2]
    names_here = [name.strip().strip('"').strip() for name in line.split(delimiter)]
    missing = next(name for name in required if name not in names_here)
    raise InputError(
        f"has no column '{missing}'",
        where=f"{path}, line {best[1] + 1}",
        value=", ".join(names_here[:12])[:200],
        do="add the column, or rename the one that holds it",
    )


def _whole_rows(
    lines: Sequence[str], columns: int, delimiter: str, *, path: Path, first_line: int, repairs: list[Repair]
) -> list[str]:
    """Blank the rows with too many fields or none; rows with too few keep what they have."""
    body = list(lines)
    while body and not body[-1].strip():
        body.pop()
    blank_row = delimiter * (columns - 1)
    found: dict[str, list[int]] = {"malformed_row": [], "short_row": [], "blank_row": []}
    for index, line in enumerate(body):
        kind = _fault(line, columns, delimiter)
        if kind == "":
            continue
        if kind == "trailing":
            body[index] = line.rstrip()[:-1]
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
            limit=f"{columns} fields parted by {delimiter!r}",
            do="decimal commas need ';' between the fields, or quotes",
        )
    for kind, told in (
        ("malformed_row", "rows with too many fields were dropped"),
        ("short_row", "rows with too few fields were read as far as they go"),
        ("blank_row", "blank rows were passed over"),
    ):
        rows = found[kind]
        if rows:
            repairs.append(Repair(kind, len(rows), f"{len(rows)} {told}, the first on line {rows[0] + first_line}"))
    return body


def _fault(line: str, columns: int, delimiter: str) -> str:
    """Return what is wrong with a row; empty where nothing is."""
    if not line.strip():
        return "blank_row"
    fields = len(_split(line, delimiter)) if '"' in line else line.count(delimiter) + 1
    if fields == columns:
        return ""
    if fields == columns + 1 and line.rstrip().endswith(delimiter):
        return "trailing"
    return "malformed_row" if fields > columns else "short_row"


def _decimal(
    body: Sequence[str],
    delimiter: str,
    columns: Sequence[int],
    *,
    path: Path,
    first_line: int,
    repairs: list[Repair],
) -> str:
    """Return the decimal sign of some columns, refusing what can be read in two ways."""
    numbers = _with_comma(body, delimiter, columns)
    signs = ((line, _COMMA_NUMBER.search(text) or _BOTH_SIGNS.search(text)) for line, text in numbers.items())
    line, first = next(((line, match) for line, match in signs if match is not None), (0, None))
    if first is None:
        return "."
    whole = "\n".join(numbers.values())
    if _BOTH_SIGNS.search(whole) or not _SURE_COMMA.search(whole):
        raise InputError(
            "has numbers whose comma can be a decimal sign or a thousands sign",
            where=f"{path}, line {line + first_line}",
            value=first.group(0),
            limit="'.' as decimal sign, no thousands sign",
            do="export it with '.' as decimal sign",
        )
    count = sum(1 for _ in _COMMA_NUMBER.finditer(whole))
    repairs.append(Repair("decimal_comma", count, f"{count} decimal commas were read as decimal points"))
    return ","


def _with_points(frame: pd.DataFrame, columns: Sequence[int]) -> None:
    """Write decimal points in columns that stayed text: some of their rows have commas, others points."""
    import pandas as pd

    for index in columns:
        column = frame.iloc[:, index]
        if not pd.api.types.is_numeric_dtype(column):
            frame[frame.columns[index]] = column.astype("string").str.replace(_DECIMAL_COMMA, ".", regex=True)


def _with_comma(body: Sequence[str], delimiter: str, columns: Sequence[int]) -> dict[int, str]:
    """Return, by row, what stands in some columns, where a comma stands within a field."""
    rows: Iterable[list[str]] = ()
    if delimiter != ",":
        rows = (line.split(delimiter) if "," in line else [] for line in body)
    elif any('"' in line for line in body):
        # Between commas a comma within a number stands in quotes.
        rows = (_split(line, delimiter) if '"' in line else [] for line in body)
    texts = (" ".join(row[index].strip(' "') for index in columns if index < len(row)) for row in rows)
    return {number: text for number, text in enumerate(texts) if "," in text}


def _split(line: str, delimiter: str) -> list[str]:
    """Return the fields of a row in which there are quotes."""
    try:
        return next(csv.reader([line], delimiter=delimiter))
    except csv.Error:  # a field beyond the reader's limit
        return line.split(delimiter)
