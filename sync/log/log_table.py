"""A log's table with the names and units of the contract, whatever names and units its file has."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from sync.log.column_names import CONTRACT, DATE, NEEDED, ChosenColumns, LogColumn, columns_note, is_converted, resolve
from sync.log.delimited_text import TextTable, read_text_table
from sync.log.header import require_all
from sync.log.wall_clock import Timestamps, read_timestamps, spreadsheet_dates
from torsight.core.errors import InputError
from torsight.core.files.kinds import TABLE_KINDS
from torsight.core.files.storage import is_parquet, read_table, require_table, table_without_rows
from torsight.core.units import Floats

if TYPE_CHECKING:
    import pandas as pd

_ASIDE: Final = " (not used)"
"""Suffix of a column that has a name of the contract but is not the column that the user named for it."""


@dataclass(frozen=True, slots=True)
class LogTable(TextTable):
    """The rows of a log in the order of its file, with the contract's names.

    ``time_s`` is in seconds (NaN where a field is no number), temperatures are in °C; other fields that are no numbers
    are unchanged, and further columns keep their names. ``zero`` is the instant (ISO 8601) of time 0 where the
    timestamps are dates; ``notes`` are sentences for the user on guessed or converted columns and ambiguous dates.
    """

    zero: str | None
    notes: tuple[str, ...]

    @property
    def spelled(self) -> dict[str, str]:
        """The file's own names of the contract's columns that it has."""
        return {CONTRACT[role]: spelling(column) for role, column in self.columns.items() if role in CONTRACT}


def read_log_table(path: Path, chosen: ChosenColumns) -> LogTable:
    """Read a log's table, text or Parquet.

    Raises InputError when the file cannot be read, lacks a column that is needed or named, has a unit in its header
    that the column cannot have, or timestamps that cannot be read.
    """
    require_table(path, TABLE_KINDS["log"])
    table = _parquet(path, chosen) if is_parquet(path) else read_text_table(path, chosen)
    frame, first_line, columns = table.frame, table.first_line, table.columns
    if len(frame) == 0:
        raise table_without_rows(path)
    timestamps = _timestamps(frame, columns, path=path, first_line=first_line)
    named = {role: frame.iloc[:, column.index] for role, column in columns.items() if role not in ("time", DATE)}
    used = {column.index for column in columns.values()}
    content: dict[str, Any] = {CONTRACT["time"]: timestamps.time_s}
    content |= {CONTRACT[role]: _converted(values, columns[role]) for role, values in named.items()}
    for index, name in enumerate(frame.columns):
        if index not in used:
            content[f"{name}{_ASIDE}" if name in content else str(name)] = frame.iloc[:, index]
    import pandas as pd

    notes = [one for one in (columns_note(columns), timestamps.note) if one is not None]
    return LogTable(pd.DataFrame(content), first_line, table.repairs, columns, timestamps.zero, tuple(notes))


def spelling(column: LogColumn) -> str:
    """Return the file's own name of a column."""
    return column.name or "the first column"


def _parquet(path: Path, chosen: ChosenColumns) -> TextTable:
    frame = read_table(path)
    names = [str(name) for name in frame.columns]
    return TextTable(frame, 1, (), require_all(names, resolve(names, chosen), chosen, where=str(path)))


def _timestamps(frame: pd.DataFrame, columns: Mapping[str, LogColumn], *, path: Path, first_line: int) -> Timestamps:
    """Return the timestamps in seconds."""
    column = columns["time"]
    values = frame.iloc[:, column.index]
    if DATE in columns:
        values = frame.iloc[:, columns[DATE].index].astype("string") + " " + values.astype("string")
    timestamps = read_timestamps(values, where=f"{path}, column {spelling(column)}", first_line=first_line)
    if not timestamps.numeric:
        return timestamps
    if not column.name and column.unit is None and _counts_rows(timestamps.time_s):
        # Table libraries write the row's number there.
        raise InputError(
            "has no column 'time_s'",
            where=f"{path}, line {first_line - 1}",
            value="a first column without a name that counts the rows",
            do="give the column of times a name; if these are seconds, say so: --units time=s",
        )
    dates = spreadsheet_dates(timestamps.time_s) if column.unit is None else None
    if dates is not None:
        return dates
    factor = 1.0 if column.unit is None else column.unit.factor
    return replace(timestamps, time_s=timestamps.time_s * factor)


def _counts_rows(timestamps: Floats) -> bool:
    """Return whether numbers count the rows: from 0 or 1, each larger by one than the number before."""
    return bool(np.isfinite(timestamps).all() and (np.diff(timestamps) == 1.0).all() and timestamps[0] in (0.0, 1.0))


def _converted(values: pd.Series[Any], column: LogColumn) -> Any:
    """Return a column in the contract's unit; a field that is no number is unchanged."""
    import pandas as pd

    if column.unit is None or not is_converted(column):
        return values
    numbers = pd.to_numeric(values, errors="coerce").astype(np.float64)
    converted = numbers * column.unit.factor + column.unit.offset
    return converted if pd.api.types.is_numeric_dtype(values) else values.where(numbers.isna(), converted)


NEEDED_NAMES: Final = tuple(CONTRACT[role] for role in NEEDED)
"""The columns that every log must have."""
