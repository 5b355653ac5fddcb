"""A temperature log that another program writes, row by row as it grows, and its clock beside the film's."""

from __future__ import annotations

import io
import math
import os
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from sync.log.column_names import DATE, NEEDED, NOTHING_CHOSEN, ChosenColumns, LogColumn, columns_note, resolve
from sync.log.header import find_columns, is_row_of_numbers, require_all, require_columns, split_line, units_row
from sync.log.wall_clock import RunningTimestamps
from torsight.core.files.storage import is_parquet, read_table

OPTIONAL: Final = ("heat_a", "heat_b")


class LogRow(NamedTuple):
    """One row of a log: time, both temperatures, both switches (NaN where absent), and the line as it was written."""

    numbers: tuple[float, ...]
    text: str


@dataclass(frozen=True, slots=True)
class WatchedLog:
    """The temperature log of a live record, which may appear later than the film, with the user's names of its columns.

    ``offset_s`` is the log's time minus film time; None: estimated from the arrival of rows.
    """

    path: Path
    offset_s: float | None = None
    columns: ChosenColumns = NOTHING_CHOSEN


class LogFollower:
    """Follows a CSV log: an incomplete last line waits, a log that is rotated or truncated is opened again.

    The log need not exist yet. A Parquet table is read completely, as soon as it exists. ``tell`` takes a sentence for
    the user.
    """

    def __init__(self, path: Path, tell: Callable[[str], None], chosen: ChosenColumns = NOTHING_CHOSEN) -> None:
        self.path = path
        self.header = ""
        self.refused = 0
        self._tell = tell
        self._file: int | None = None
        self._identity: tuple[int, int] | None = None
        self._rest = b""
        self._chosen = chosen
        self._columns: Mapping[str, LogColumn] | None = None
        self._delimiter = ","
        self._may_be_units = False
        self._nearest: tuple[int, list[str]] = (-1, [])
        self._timestamps = RunningTimestamps()

    def poll(self) -> list[LogRow]:
        """Return the rows added since the last call; a header that lacks a column is refused."""
        if is_parquet(self.path):
            return self._whole()
        rows: list[LogRow] = []
        if self._file is None and not self._open():
            return rows
        rows += self._read()
        if self._moved():
            rows += self._read()
            self.close()
            self._tell(f"the log {self.path.name} was rotated; going on with the new one")
            if self._open():
                rows += self._read()
        return rows

    def _whole(self) -> list[LogRow]:
        """Return the rows of a table that does not grow, once it exists."""
        if self.header or not self.path.exists():
            return []
        table = read_table(self.path)
        header = table.head(0).to_csv(index=False).strip()
        if not self._is_header(header):
            self._refuse([str(name) for name in table.columns])
        self._may_be_units = False
        lines = table.to_csv(index=False, header=False).splitlines()
        return [row for line in lines if (row := self._row(line)) is not None]

    def _open(self) -> bool:
        try:
            self._file = os.open(self.path, os.O_RDONLY)
        except OSError:
            return False
        state = os.fstat(self._file)
        self._identity = (state.st_dev, state.st_ino)
        self._rest = b""
        return True

    def close(self) -> None:
        """Close the file."""
        if self._file is not None:
            os.close(self._file)
        self._file, self._identity = None, None

    def _moved(self) -> bool:
        """Return whether the path is now another file, or the file is shorter than the part already read."""
        try:
            state = self.path.stat()
        except OSError:
            # The old log has gone, the new one does not exist yet.
            return False
        if (state.st_dev, state.st_ino) != self._identity:
            return True
        return self._file is not None and state.st_size < os.lseek(self._file, 0, os.SEEK_CUR)

    def _read(self) -> list[LogRow]:
        rows: list[LogRow] = []
        while self._file is not None and (block := os.read(self._file, io.DEFAULT_BUFFER_SIZE)):
            *lines, self._rest = (self._rest + block).split(b"\n")
            rows += [row for line in lines if (row := self._row(line.decode("utf-8", "replace"))) is not None]
        return rows

    def _row(self, line: str) -> LogRow | None:
        text = line.strip("\r\n").lstrip("\ufeff")
        if not text.strip():
            return None
        if self._columns is None:
            self._look_for_header(text)
            return None
        fields = split_line(text, self._delimiter)
        if self._may_be_units:
            self._may_be_units = False
            if self._take_units(fields, text):
                return None
        try:
            return LogRow(self._numbers(fields), text)
        except (ValueError, IndexError):
            pass
        if not text.startswith("#") and not self._is_header(text):
            self.refused += 1
            if self.refused == 1:
                self._tell(f"the log has a line that is no row of numbers: {text[:60]!r}; such lines are left out")
        return None

    def _look_for_header(self, text: str) -> None:
        """Read the header, or skip a line before it; a row of numbers before any header means that there is none."""
        if not self._is_header(text):
            _, names, columns = find_columns(text, self._chosen)
            if len(columns) > self._nearest[0]:
                self._nearest = len(columns), names
            if len(names) >= 2 and is_row_of_numbers(text):
                self._refuse(self._nearest[1])

    def _refuse(self, names: Sequence[str]) -> None:
        """Refuse a header with these names."""
        require_all(names, resolve(names, self._chosen), self._chosen, where=str(self.path))

    def _is_header(self, text: str) -> bool:
        """Take the columns of a line if it names all required ones; return whether it does."""
        delimiter, _, found = find_columns(text, self._chosen)
        if any(role not in found for role in self._chosen.required):
            return False
        columns = require_columns(found, where=str(self.path))
        if self._columns is None and (note := columns_note(columns)) is not None:
            self._tell(note)
        self.header = self.header or text
        self._delimiter, self._columns, self._may_be_units = delimiter, columns, True
        self._set_timestamps(columns)
        return True

    def _take_units(self, fields: Sequence[str], text: str) -> bool:
        """Take a row of units below the header; return whether the row is one."""
        units = units_row(fields, self._columns or {})
        if units is None:
            return False
        self._columns = require_columns(units, where=str(self.path))
        self._set_timestamps(self._columns)
        if "\n" not in self.header:
            self.header = f"{self.header}\n{text}"
        return True

    def _set_timestamps(self, columns: Mapping[str, LogColumn]) -> None:
        unit = columns["time"].unit
        self._timestamps = RunningTimestamps(1.0 if unit is None else unit.factor)

    def _numbers(self, fields: Sequence[str]) -> tuple[float, ...]:
        assert self._columns is not None  # noqa: S101 - for the type checker: rows come after the header
        timestamp = self._plain(fields[self._columns["time"].index])
        if DATE in self._columns:
            timestamp = f"{fields[self._columns[DATE].index]} {timestamp}"
        return (self._timestamps.seconds(timestamp), *(self._number(fields, role) for role in (*NEEDED[1:], *OPTIONAL)))

    def _number(self, fields: Sequence[str], role: str) -> float:
        column = (self._columns or {}).get(role)
        if column is None:
            return np.nan
        text = self._plain(fields[column.index])
        if not text:
            return np.nan
        value = float(text)
        return value if column.unit is None else value * column.unit.factor + column.unit.offset

    def _plain(self, field: str) -> str:
        """Return a field with a decimal point; where commas separate the fields, a comma is no decimal sign."""
        return field if self._delimiter == "," else field.replace(",", ".")


class LogClock:
    """Conversion from the log's clock to the film's while both run; ``offset_s`` is log's minus film's time if known.

    A row cannot arrive before it was written: the largest difference between a row's timestamp and the film's time at
    its arrival is the offset, to within the shortest delay. Rows that exist at the start give no information; they are
    taken to be on the film's clock until a row arrives.
    """

    def __init__(self, offset_s: float | None) -> None:
        self.offset_s = 0.0 if offset_s is None else offset_s
        self._fixed = offset_s is not None
        self._heard = False
        self._waiting: deque[tuple[float, ...]] = deque()

    def rows(self, rows: list[tuple[float, ...]], *, now_s: float | None) -> None:
        """Take rows that arrived at film time ``now_s``; None: they existed before."""
        self._waiting.extend(row for row in rows if math.isfinite(row[0]))
        if self._fixed or now_s is None or not rows:
            return
        newest = rows[-1][0] - now_s
        self.offset_s = newest if not self._heard else max(self.offset_s, newest)
        self._heard = True

    def due(self, now_s: float) -> list[tuple[float, tuple[float, ...]]]:
        """Return the rows that are due, with their times on the film's clock."""
        found = []
        while self._waiting and self._waiting[0][0] - self.offset_s <= now_s + 1e-9:
            row = self._waiting.popleft()
            found.append((row[0] - self.offset_s, row))
        return found
