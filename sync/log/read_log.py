"""Temperature logs as instruments write them, repaired into one strictly increasing record with a list of repairs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from sync.log.column_names import chosen_columns
from sync.log.log_table import NEEDED_NAMES, LogTable, read_log_table
from sync.log.outliers import RANGE_C, clean_channel, in_range
from sync.log.repairs import LogReading, Repair
from sync.log.restart_gaps import SHORTEST_STRETCH_S, join_blocks
from sync.log.timestamps import OrderedTimestamps, longest_gap_s, order_timestamps
from torsight.core.errors import InputError
from torsight.core.files.paths import AnyPath
from torsight.core.records import TemperatureLog
from torsight.core.series import usual_step
from torsight.core.units import Flags, Floats, Ints
from torsight.core.words.plausible import require_timestamps, require_units
from torsight.core.words.wording import counted

if TYPE_CHECKING:
    import pandas as pd

_SWITCHES: Final = ("heat_a", "heat_b")
_MIN_ROWS: Final = 3
"""Least number of rows, with two steps of time: with one a usual step cannot be distinguished from a gap."""


def read_temperature_log(
    path: AnyPath, *, columns: Mapping[str, str] | None = None, units: Mapping[str, str] | None = None
) -> LogReading:
    """Read ``TEMPS.csv`` (or Parquet), or a log as an instrument writes it, and repair it where possible.

    Parameters
    ----------
    path : str or Path
        The log; its header may be on any line.
    columns : mapping of str to str, optional
        Names of the columns by role: ``time, a, b, heat_a, heat_b, current_a, current_b`` and, where the date is in a
        separate column, ``date``: ``{"time": "Time", "a": "Temp A (°C)", "b": "Temp B (°C)"}``.
        Columns that are not named have the contract's name, or an unambiguous one.
    units : mapping of str to str, optional
        Units that the header does not state, by the same keys: ``{"time": "ms", "a": "°F"}``.

    Returns
    -------
    LogReading
        Time in seconds as stamped (from the first timestamp where the timestamps are dates), temperatures in °C with
        NaN where no reading can be trusted, the heating switches where there are any, and all other columns.

    Raises
    ------
    ConfigError
        For an unknown key of ``columns`` or ``units``, or a unit of another quantity.
    InputError
        When the file cannot be read, lacks a column, has a column in a unit that contradicts its role, is ambiguous in
        its numbers, or has too few rows; the message names line and column.
    """
    path = Path(path)
    table = read_log_table(path, chosen_columns(columns, units))
    frame, first_line, repairs, spelled = table.frame, table.first_line, list(table.repairs), table.spelled
    time_column = f"{path}, column {spelled['time_s']}"
    timestamp_s = frame["time_s"].to_numpy(np.float64)
    ordered = order_timestamps(timestamp_s, first_line=first_line)
    repairs += ordered.repairs
    if np.count_nonzero(np.isfinite(timestamp_s)) >= _MIN_ROWS:
        _require_order(ordered, len(frame), where=time_column)
    if len(ordered.row) < _MIN_ROWS:
        raise InputError(
            "has too few rows with a time",
            where=time_column,
            value=str(len(ordered.row)),
            limit=f"at least {_MIN_ROWS}",
            do="record it again",
        )
    if float(np.ptp(ordered.time_s)) == 0.0 and not ordered.block[-1]:
        raise InputError(
            "holds one and the same time in every row",
            where=time_column,
            value=f"{ordered.time_s[0]:g}",
            do="record it again, with a clock that runs",
        )
    unread = {"time_s", *_no_switches(table, path=path, repairs=repairs)}
    series = {str(name): frame[name] for name in frame.columns if name not in unread}
    timestamps, numbers, texts = _distinct(ordered, series, first_line=first_line, repairs=repairs)
    readings = [in_range(numbers[name]) for name in NEEDED_NAMES[1:]]
    time_s, restarts = join_blocks(timestamps.time_s, timestamps.block, readings)
    temperatures: dict[str, Floats] = {}
    for name in NEEDED_NAMES[1:]:
        where = f"{path}, column {spelled[name]}"
        read = np.isfinite(numbers[name])
        if np.count_nonzero(np.isfinite(in_range(numbers[name]))) <= 0.5 * np.count_nonzero(read):
            first = frame[name].dropna()
            raise _no_temperature(numbers[name], text=None if first.empty else str(first.iloc[0]), where=where)
        temperatures[name], found = clean_channel(time_s, numbers[name], name=name)
        repairs += found
        if not np.isfinite(temperatures[name]).any():
            raise _no_temperature(numbers[name], text=None, where=where)
    called = {spelled[name]: temp_c for name, temp_c in temperatures.items()}
    require_units(time_s, called, where=str(path), time_name=spelled["time_s"])
    switches = _read_switches(numbers, repairs)
    extra: dict[str, NDArray[np.generic]] = {
        name: values for name, values in numbers.items() if name not in (*NEEDED_NAMES, *_SWITCHES)
    }
    a_c, b_c = temperatures.values()
    log = TemperatureLog(time_s, a_c, b_c, switches.get("heat_a"), switches.get("heat_b"), extra | texts)
    repairs += _gaps(time_s)
    coarse_s = usual_step(ordered.time_s) if any(repair.kind == "coarse_stamp" for repair in repairs) else 0.0
    return LogReading(
        log=log,
        repairs=tuple(repairs),
        restarts=restarts,
        zero=table.zero,
        coarse_s=coarse_s,
        columns=table.columns,
        notes=table.notes,
    )


def _require_order(ordered: OrderedTimestamps, rows: int, *, where: str) -> None:
    """Refuse times that are no seconds, or so disordered that every restart of the clock would be a guess."""
    require_timestamps(ordered.time_s, where=where)
    restarts = int(ordered.block[-1])
    covered_s = float(np.diff(ordered.time_s)[np.diff(ordered.block) == 0].sum())
    if restarts * SHORTEST_STRETCH_S > covered_s or len(ordered.row) < 0.5 * rows:
        raise InputError(
            "is out of order",
            where=where,
            value=f"{len(ordered.row)} of {rows} rows in order"
            + f", {restarts} steps back in {covered_s:.3g} s" * (restarts > 0),
            limit=f"half of the rows or more, and one restart of the clock every {SHORTEST_STRETCH_S:g} s",
            do="sort the log by time",
        )


def _no_temperature(values: Floats, *, text: str | None, where: str) -> InputError:
    """Return the error for a column with these readings (n,); ``text`` is its first field."""
    known = values[np.isfinite(values)]
    middle = f"{np.sort(known)[len(known) // 2]:.4g} in the middle" if len(known) else "no number"
    if not len(known) and text is not None:
        middle = f"no number but {text!r}"
    return InputError(
        "holds no temperature of a spring",
        where=where,
        value=middle,
        limit=f"{RANGE_C[0]:g} to {RANGE_C[1]:g} °C",
        do="give °C, not in kelvin or tenths, or say the unit where the header does not: "
        '--units "a=K,b=K", [temperature] units; both temperatures are needed',
    )


def _distinct(
    ordered: OrderedTimestamps, columns: dict[str, pd.Series[Any]], *, first_line: int, repairs: list[Repair]
) -> tuple[OrderedTimestamps, dict[str, Floats], dict[str, NDArray[np.generic]]]:
    """Return distinct timestamps, and the columns of numbers and of texts in the order of these timestamps."""
    import pandas as pd

    numbers: dict[str, Floats] = {}
    texts: dict[str, NDArray[np.generic]] = {}
    for name, column in columns.items():
        if pd.api.types.is_numeric_dtype(column):
            numbers[name] = column.to_numpy(np.float64, na_value=np.nan)[ordered.row]
            continue
        values = pd.to_numeric(column, errors="coerce").to_numpy(np.float64, na_value=np.nan)
        if name in (*NEEDED_NAMES, *_SWITCHES):
            values = np.where(np.isfinite(values), values, _words(column))
            numbers[name] = values[ordered.row]
        else:
            texts[name] = column.astype("object").to_numpy()[ordered.row]
    same = np.concatenate([[False], (np.diff(ordered.time_s) == 0) & (np.diff(ordered.block) == 0)])
    count = int(np.count_nonzero(same))
    if count == 0:
        return ordered, numbers, texts
    group, first = np.cumsum(~same) - 1, np.flatnonzero(~same)
    # Timestamps that are coarser than the rows repeat in half of them or more, rows that were written twice are few.
    if count > 0.5 * 0.5 * len(same):
        text = f"{count} timestamps repeat (coarse clock); rows spread evenly between them"
        repairs.append(Repair("coarse_stamp", count, text))
        return _spread(ordered, group, first), numbers, texts
    line = int(ordered.row[np.flatnonzero(same)[0]]) + first_line
    text = f"{counted(count, 'row')} with the timestamp of another, the first on line {line}; replaced by their mean"
    repairs.append(Repair("repeated_stamp", count, text))
    averaged = {name: np.asarray(_known(values).groupby(group).mean(), np.float64) for name, values in numbers.items()}
    kept = replace(ordered, row=ordered.row[first], time_s=ordered.time_s[first], block=ordered.block[first])
    return kept, averaged, {name: values[first] for name, values in texts.items()}


def _known(values: Floats) -> pd.Series[float]:
    import pandas as pd

    return pd.Series(np.where(np.isfinite(values), values, np.nan))


def _words(column: pd.Series[Any]) -> Floats:
    """Return switches that are written as words as 0 and 1; NaN for all other fields."""
    words = {"true": 1.0, "on": 1.0, "yes": 1.0, "false": 0.0, "off": 0.0, "no": 0.0}
    lowered = column.astype("string").str.strip().str.lower()
    return np.asarray(lowered.map(words).to_numpy(np.float64, na_value=np.nan))


def _spread(ordered: OrderedTimestamps, group: Ints, first: Ints) -> OrderedTimestamps:
    """Return timestamps spread evenly up to the next one; ``group`` (n,) numbers the sets, which begin at ``first``.

    A log begins and ends anywhere between two timestamps: the rows of its first and last set are as far apart as those
    of the others, and the first ones end at the next timestamp.
    """
    size = np.bincount(group)
    timestamp = ordered.time_s[first]
    usual = usual_step(timestamp)
    width = np.append(np.diff(timestamp), usual)
    # Before a gap or a restart the rows of one timestamp do not extend to the next timestamp.
    width = np.where((width > 0) & (width < 3 * usual), width, usual)
    step = width / size
    begin = timestamp.copy()
    if len(size) > 2:
        inner = float(np.median(step[1:-1]))
        step[[0, -1]] = np.minimum(step[[0, -1]], inner)
        begin[0] += width[0] - step[0] * size[0]
    rank = np.arange(len(group)) - first[group]
    return replace(ordered, time_s=begin[group] + step[group] * rank)


def _no_switches(table: LogTable, *, path: Path, repairs: list[Repair]) -> list[str]:
    """Return the columns whose names look like a switch's but which hold other numbers than 0 and 1.

    Raises InputError for such a number where the user or the contract says that the column is a switch.
    """
    import pandas as pd

    others: list[str] = []
    for name in (one for one in _SWITCHES if one in table.columns):
        state = pd.to_numeric(table.frame[name], errors="coerce").to_numpy(np.float64, na_value=np.nan)
        wrong = np.flatnonzero(np.isfinite(state) & ~np.isin(state, (0.0, 1.0)))
        if not len(wrong):
            continue
        column, line, value = table.columns[name], int(wrong[0]) + table.first_line, f"{state[wrong[0]]:g}"
        if not column.guessed:
            where = f"{path}, line {line}, column {column.name}"
            raise InputError("is no switch", where=where, value=value, limit="0 or 1", do="write 1 where it is on")
        others.append(name)
        text = f"'{column.name}' is no heating switch: {value} on line {line} is neither 0 nor 1; not used"
        repairs.append(Repair("no_switch", len(wrong), text))
    return others


def _read_switches(numbers: Mapping[str, Floats], repairs: list[Repair]) -> dict[str, Flags]:
    """Return the switches that the log has; a column without any readable state is reported and left out."""
    switches: dict[str, Flags] = {}
    for name in _SWITCHES:
        if name not in numbers:
            continue
        unread = int(np.count_nonzero(~np.isfinite(numbers[name])))
        none = unread == len(numbers[name])
        if unread:
            some = f"{counted(unread, 'field')} without 0, 1, on or off; taken as the one before"
            text = f"{name}: {'no field is 0, 1, on or off; left out' if none else some}"
            repairs.append(Repair("no_switch", unread, text))
        if none:
            continue
        # An empty field continues the last known state.
        switches[name] = _known(numbers[name]).ffill().to_numpy() > 0.5
        if not unread and switches[name].all():
            text = f"{name} is 1 in every row: a switch that never changes says nothing about the time"
            repairs.append(Repair("idle_switch", len(switches[name]), text))
    return switches


def _gaps(time_s: Floats) -> list[Repair]:
    step = np.diff(time_s)
    long = np.flatnonzero(step > longest_gap_s(time_s))
    if not len(long):
        return []
    text = f"without rows, the longest {step.max():.4g} s, the first at {time_s[long[0]]:g} s"
    return [Repair("gap", len(long), f"{counted(len(long), 'gap')} {text}")]
