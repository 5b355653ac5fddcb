"""A temperature log that another program writes, row by row as it grows."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from datetime import datetime
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from torsight.core.errors import InputError
from torsight.core.storage import is_parquet, read_table

REQUIRED: Final = ("time_s", "temp_a_c", "temp_b_c")
OPTIONAL: Final = ("heat_a", "heat_b")
_SEPARATORS: Final = (";", "\t", ",")
_BLOCK: Final = 1 << 20


class LogRow(NamedTuple):
    """One row of a log: time, both temperatures, both switches (NaN where absent), and the line as it was written."""

    numbers: tuple[float, ...]
    text: str


class LogFollower:
    """Follows a CSV log: a last line without its end waits, a log that is rotated or cut is opened anew.

    A Parquet table is taken whole, as soon as it is there.

    Parameters
    ----------
    path : Path
        The log; it need not be there yet.
    tell : callable
        Takes a sentence on what a person should know.
    """

    def __init__(self, path: Path, tell: Callable[[str], None]) -> None:
        self.path = path
        self.header = ""
        self.refused = 0
        self._tell = tell
        self._file: int | None = None
        self._identity: tuple[int, int] | None = None
        self._rest = b""
        self._columns: list[int] | None = None
        self._separator = ","
        self._zero: datetime | None = None

    def poll(self) -> list[LogRow]:
        """Return the rows that have come since the last call.

        Raises
        ------
        InputError
            When the header lacks a column.
        """
        if is_parquet(self.path):
            return self._whole()
        rows: list[LogRow] = []
        if self._file is None and not self._open():
            return rows
        rows += self._read()
        if self._moved():
            rows += self._read()
            self._close()
            self._tell(f"the log {self.path.name} was rotated; going on with the new one")
            if self._open():
                rows += self._read()
        return rows

    def close(self) -> None:
        """Let go of the file."""
        self._close()

    def _whole(self) -> list[LogRow]:
        """Return the rows of a table that does not grow, once it is there."""
        if self.header or not self.path.exists():
            return []
        table = read_table(self.path, required=REQUIRED)
        self._read_header(",".join(table.columns))
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

    def _close(self) -> None:
        if self._file is not None:
            os.close(self._file)
        self._file, self._identity = None, None

    def _moved(self) -> bool:
        """Return whether the path is another file now, or the file is shorter than what was read of it."""
        try:
            state = self.path.stat()
        except OSError:
            # Between the old log's going and the new one's coming.
            return False
        if (state.st_dev, state.st_ino) != self._identity:
            return True
        return self._file is not None and state.st_size < os.lseek(self._file, 0, os.SEEK_CUR)

    def _read(self) -> list[LogRow]:
        rows: list[LogRow] = []
        while self._file is not None and (block := os.read(self._file, _BLOCK)):
            *lines, self._rest = (self._rest + block).split(b"\n")
            rows += [row for line in lines if (row := self._row(line.decode("utf-8", "replace"))) is not None]
        return rows

    def _row(self, line: str) -> LogRow | None:
        text = line.strip().lstrip("\ufeff")
        if not text or text.startswith("#"):
            return None
        if self._columns is None or "temp_a_c" in text:
            self._read_header(text)
            return None
        fields = text.split(self._separator)
        try:
            time_s = self._time(fields[self._columns[0]])
            others = [self._number(fields, place) for place in self._columns[1:]]
        except (ValueError, IndexError):
            self.refused += 1
            if self.refused == 1:
                self._tell(f"the log has a line that is no row of numbers: {text[:60]!r}; such lines are left out")
            return None
        return LogRow((time_s, *others), text)

    def _read_header(self, text: str) -> None:
        self._separator = next((one for one in _SEPARATORS if one in text), ",")
        names = [name.strip().strip('"') for name in text.split(self._separator)]
        for name in REQUIRED:
            if name not in names:
                raise InputError(
                    f"has no column '{name}'",
                    where=str(self.path),
                    value=", ".join(names[:12]),
                    do="add the column, or name another log with --temperature",
                )
        self.header = self.header or text
        self._columns = [names.index(name) if name in names else -1 for name in (*REQUIRED, *OPTIONAL)]

    def _number(self, fields: Sequence[str], place: int) -> float:
        if place < 0:
            return np.nan
        text = fields[place].strip().strip('"')
        return float(text if self._separator == "," else text.replace(",", ".")) if text else np.nan

    def _time(self, field: str) -> float:
        text = field.strip().strip('"')
        try:
            return float(text if self._separator == "," else text.replace(",", "."))
        except ValueError:
            stamp = datetime.fromisoformat(text)
        if self._zero is None:
            self._zero = stamp
        return (stamp - self._zero).total_seconds()
