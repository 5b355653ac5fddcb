"""The records of one's own rig: tables with a time, read from files or given as data."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from torsight.core.errors import InputError
from torsight.core.files.storage import read_table
from torsight.core.series import FEWEST
from torsight.core.units import Floats
from torsight.discovery.own.model.values import ByName

if TYPE_CHECKING:
    import pandas as pd

    Table: TypeAlias = "pd.DataFrame | Mapping[str, Any] | str | Path | Record"
else:
    Table = Any


_TIMES: Final = ("time_s", "time", "t_s", "t")
"""Names of a column that is the time where none is named, in order of preference; capitals and text in brackets do not
matter: ``Time (s)``."""


class Record(ByName[Floats]):
    """One record: its columns by name (``record["force_n"]`` or ``record.force_n``), each (n,) float64, read-only.

    Parameters
    ----------
    columns : mapping of str to (n,) array
        Columns of one length; NaN where a value is not known.
    label : str
        Name of the record in messages and reports.
    wrong : mapping of str to (int, str), optional
        Columns of numbers in which a field holds something else: its row, from 0, and its text. They are refused where
        they are asked for, because a record may have columns that nobody needs.
    """

    UNCHANGED = "a record cannot be changed; make a new array in place of '{}'"

    columns_: dict[str, Floats]
    """Columns by name."""
    label_: str
    """Name of the record in messages and reports."""
    wrong_: Mapping[str, tuple[int, str]]
    """Columns that are refused where they are asked for."""

    def __init__(
        self, columns: Mapping[str, Floats], label: str, wrong: Mapping[str, tuple[int, str]] | None = None
    ) -> None:
        copies = {name: np.array(values, np.float64) for name, values in columns.items()}
        for values in copies.values():
            values.setflags(write=False)
        super().__init__({name: values for name, values in copies.items() if not name.startswith("_")})
        self.__dict__.update(_items=copies, columns_=copies, label_=label, wrong_=wrong or {})

    def __reduce__(self) -> tuple[Any, ...]:
        return (Record, (self.columns_, self.label_, self.wrong_))

    @property
    def rows_(self) -> int:
        """Number of rows."""
        return len(next(iter(self.columns_.values())))

    def _missing(self, name: str) -> str:
        if name in self.wrong_:
            row, text = self.wrong_[name]
            where = f"{self.label_}, row {row + 1}, column {name}"
            limit = "a number or an empty field"
            raise InputError("is not a number", where=where, value=repr(text), limit=limit, do="mend that row")
        return f"the record '{self.label_}' has no column '{name}'; it has {', '.join(self)}"


def read_records(observed: Table | Sequence[Table]) -> tuple[Record, ...]:
    """Return records from a table, a mapping of arrays, a path, or several of them."""
    tables: list[Any] = list(observed) if isinstance(observed, (list, tuple)) else [observed]
    if not tables:
        raise InputError("no record is given", where="observed", do="give a table, a mapping of arrays or a path")
    records = tuple(_read(table, number) for number, table in enumerate(tables, start=1))
    labels = [record.label_ for record in records]
    return tuple(
        record
        if labels.count(record.label_) == 1
        else Record(record.columns_, f"{record.label_} ({number})", record.wrong_)
        for number, record in enumerate(records, start=1)
    )


def _read(table: Table, number: int) -> Record:
    if isinstance(table, Record):
        return table
    if isinstance(table, (str, Path)):
        found = read_table(Path(table))
        return _checked({str(name): found[name].to_numpy() for name in found.columns}, Path(table).stem, str(table))
    label = f"record {number}"
    if isinstance(table, Mapping):
        return _checked({str(name): np.asarray(values) for name, values in table.items()}, label, label)
    if hasattr(table, "columns") and hasattr(table, "to_numpy"):
        names = [str(name) for name in table.columns]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise InputError("has a column twice", where=label, value=", ".join(twice), do="remove one of the two")
        return _checked({str(name): table[name].to_numpy() for name in table.columns}, label, label)
    do = "give every column a name: {'time_s': …, 'y': …}"
    limit = "a DataFrame, a mapping of arrays, or a path"
    raise InputError("is no table", where=label, value=type(table).__name__, limit=limit, do=do)


def _checked(columns: Mapping[str, NDArray[Any]], label: str, where: str) -> Record:
    """Return the columns of numbers as a record; columns of text alone (names, remarks) are left out."""
    lengths = {name: np.shape(values) for name, values in columns.items()}
    wrong = [f"{name} {shape}" for name, shape in lengths.items() if len(shape) != 1]
    if wrong or len(set(lengths.values())) > 1:
        listed = ", ".join(wrong or [f"{name} {shape[0]}" for name, shape in lengths.items()])
        do = "give one value per row in each of them; several records are a list of tables"
        raise InputError("columns are not of one length", where=where, value=listed, limit="(n,) each", do=do)
    numbers = {name: values for name, values in columns.items() if np.asarray(values).dtype.kind in "fiub"}
    rows = max((shape[0] for shape in lengths.values()), default=0)
    if columns and not numbers:
        do = "give a row of names, then rows of numbers, separated by commas; remove lines above the names"
        raise InputError("has no column of numbers", where=where, value=", ".join(columns), do=do)
    if not numbers or rows < FEWEST:
        raise InputError(
            "holds too little",
            where=where,
            value=f"{rows} rows, {len(numbers)} columns of numbers",
            limit=f"{FEWEST} rows or more",
            do="record it again",
        )
    texts = {name: _text_among_numbers(values) for name, values in columns.items() if name not in numbers}
    text_at = {name: found for name, found in texts.items() if found is not None}
    return Record({name: np.asarray(values, np.float64) for name, values in numbers.items()}, label, text_at)


def _text_among_numbers(values: NDArray[Any]) -> tuple[int, str] | None:
    """Return row and text of the first field that is no number; None for a column without any number."""
    import pandas as pd

    fields = pd.Series(list(values), dtype=object)
    numbers = pd.to_numeric(fields, errors="coerce")
    rows = np.flatnonzero((numbers.isna() & fields.notna()).to_numpy())
    return (int(rows[0]), str(fields.iloc[rows[0]])) if len(rows) and numbers.notna().any() else None


def time_of(record: Record, name: str | None) -> Floats:
    """Return a record's time: the column named, one of a usual name, or the number of the row."""
    chosen = name or time_column(record)
    if chosen is None:
        return np.arange(float(record.rows_))
    time = column_of(record, chosen)
    if not np.isfinite(time).all():
        row = int(np.flatnonzero(~np.isfinite(time))[0])
        raise InputError("time is not known", where=f"{record.label_}, row {row + 1}, column {chosen}", do="fill it")
    back = np.flatnonzero(np.diff(time) < 0.0)
    if len(back) or time[-1] <= time[0]:
        row = int(back[0]) + 1 if len(back) else 0
        raise InputError(
            "time runs backwards" if len(back) else "time stands still",
            where=f"{record.label_}, row {row + 1}, column {chosen}",
            value=f"{time[row]:g} s",
            do="sort the rows, or give each run as a record of its own",
        )
    return time


def time_column(names: Iterable[str]) -> str | None:
    """Return the name of the column that is the time by its name, None where there is none."""
    plain = {re.sub(r"[(\[].*", "", name).strip().lower(): name for name in names}
    return next((plain[one] for one in _TIMES if one in plain), None)


def column_of(record: Record, name: str) -> Floats:
    """Return a column; the error for one that is missing lists those that there are."""
    if name not in record:
        do = "give its name as in the table; columns that hold words and no numbers are left out"
        raise InputError(f"has no column '{name}'", where=record.label_, value=", ".join(record), do=do)
    return record[name]
