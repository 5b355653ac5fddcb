"""A temperature log for simulation and prediction: each of its rows gets a result, in its order and on its clock."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np

from sync.log.column_names import chosen_columns
from sync.log.log_table import NEEDED_NAMES, read_log_table
from torsight.core.errors import InputError
from torsight.core.files.paths import AnyPath
from torsight.core.files.storage import first_row, number_column
from torsight.core.files.tables import require_increasing, switches_and_extra
from torsight.core.records import TemperatureLog
from torsight.core.units import Floats
from torsight.core.words.plausible import SPRING_C, require_units

_HARMLESS: Final = ("preamble", "units", "encoding", "decimal_comma", "blank_row", "arrival", "times")
"""Repairs to the text of a log that leave the content of every row unchanged."""


def read_log(
    path: AnyPath,
    *,
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    tell: Callable[[str], None] = lambda _words: None,
) -> TemperatureLog:
    """Read ``TEMPS.csv``: ``time_s, temp_a_c, temp_b_c``, optionally ``heat_a, heat_b``; others are kept.

    Parameters
    ----------
    path : str or Path
        The log, as an instrument writes it: its header may be on any line.
    columns, units : mapping of str to str, optional
        Names of its columns, and units that its header does not state; see :func:`sync.read_temperature_log`.
    tell : callable
        Called with every note for the user: columns that were guessed or converted.

    Raises
    ------
    ConfigError
        For an unknown key of ``columns`` or ``units``.
    InputError
        When a column is missing, a field is no number, times do not increase, or a temperature is out of range.
    """
    path = Path(path)
    table = read_log_table(path, chosen_columns(columns, units))
    for repair in table.repairs:
        if repair.kind not in _HARMLESS:
            do = "mend them: every row of the log gets a result"
            raise InputError("has rows for which there can be no result", where=str(path), value=repair.text, do=do)
    written = table.frame.notna().any(axis=1).to_numpy()
    frame, lines = table.frame[written], (np.flatnonzero(written) + table.first_line).tolist()
    time_s, spelled = frame["time_s"].to_numpy(np.float64), table.spelled
    require_increasing(time_s, path=path, column=spelled["time_s"], lines=lines)
    if len(time_s) < 2:
        raise InputError("has one row only", where=str(path), limit="2 rows or more", do="record it again")
    numbers = {
        name: _require_range(
            np.asarray(number_column(frame, name, where=str(path), called=spelled[name], lines=lines), np.float64),
            where=path,
            column=spelled[name],
            lines=lines,
        )
        for name in NEEDED_NAMES[1:]
    }
    called = {spelled[name]: temp_c for name, temp_c in numbers.items()}
    require_units(time_s, called, where=str(path), time_name=spelled["time_s"])
    for note in table.notes:
        tell(note)
    a_c, b_c = numbers.values()
    return TemperatureLog(
        time_s, a_c, b_c, **switches_and_extra(frame, known=NEEDED_NAMES, where=str(path), lines=lines)
    )


def _require_range(values: Floats, *, where: Path, column: str, lines: Sequence[int]) -> Floats:
    outside = (values < SPRING_C[0]) | (values > SPRING_C[1])
    for row, place in first_row(outside, where=where, column=column, lines=lines):
        raise InputError(
            "is no temperature of a spring in °C",
            where=place,
            value=f"{values[row]:g}",
            limit=f"{SPRING_C[0]:g} to {SPRING_C[1]:g}",
            do="give °C, or say the unit: --units \"a=K,b=K\"; 'torsight sync' takes single spikes out",
        )
    return values
