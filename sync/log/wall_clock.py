"""Conversion of timestamps to seconds: numbers, dates with a time of day, or a time of day alone.

Only differences of timestamps count, so that whether ``05/06/2024`` is in May or in June matters only if a log passes
midnight: then the reading with the shorter steps is right, because the other one jumps by a month.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from torsight.core.errors import InputError
from torsight.core.units import Floats

if TYPE_CHECKING:
    import pandas as pd

_CLOCK: Final = r"(\d{1,4}):(\d{2}):(\d{2})(?:[.,:](\d{1,9}))?(?:\s*([AaPp])\.?[Mm]\.?)?"
"""Hours, minutes, seconds, fraction; some loggers separate milliseconds from seconds by a third colon."""
_DATE: Final = r"(\d{1,4})([./-])(\d{1,2})[./-](\d{1,4})"
_TIMESTAMP: Final = re.compile(rf"^(?P<date>\d{{1,2}}[./-]\d{{1,2}}[./-]\d{{2,4}}[T,;\s]+)?{_CLOCK}$")
_MONTH_NAMES: Final = ("%d-%b-%Y %H:%M:%S", "%d-%b-%Y %H:%M:%S.%f", "%d %b %Y %H:%M:%S", "%b %d, %Y %H:%M:%S")
_DAY_S: Final = timedelta(days=1).total_seconds()


@dataclass(frozen=True, slots=True)
class Timestamps:
    """Timestamps in seconds (n,), NaN where a field is no timestamp; dates count from the first one.

    For dates ``zero`` is the instant (ISO 8601) of second 0, and ``note`` states the reading of ambiguous dates.
    ``numeric``: the fields are numbers, in the unit of the column.
    """

    time_s: Floats
    zero: str | None = None
    numeric: bool = False
    note: str | None = None


class RunningTimestamps:
    """Incremental conversion of the timestamps of a growing log, with the same results as :func:`read_timestamps`.

    Of dates only the first instant and the time of day are used: midnight is where the time of day falls.
    """

    def __init__(self, factor: float = 1.0) -> None:
        self._factor = factor
        self._zero: datetime | None = None
        self._began_s: float | None = None
        self._last_s = -np.inf
        self._days = 0

    def seconds(self, text: str) -> float:
        """Return the seconds of the next timestamp.

        Raises
        ------
        ValueError
            When the text is no timestamp.
        """
        try:
            return float(text) * self._factor
        except ValueError:
            found = _TIMESTAMP.match(text)
        if found is None:
            timestamp = datetime.fromisoformat(text)
            self._zero = self._zero or timestamp
            return (timestamp - self._zero).total_seconds()
        hours, minutes, seconds, fraction, half = found.groups()[-5:]
        hour = int(hours) if half is None else int(hours) % 12 + 12 * (half.lower() == "p")
        time_s = 3600.0 * hour + 60.0 * int(minutes) + int(seconds) + float(f"0.{fraction or 0}")
        self._days += time_s < self._last_s - 0.5 * _DAY_S
        self._last_s = time_s
        if found["date"] and self._began_s is None:
            self._began_s = time_s
        return self._days * _DAY_S + time_s - (self._began_s or 0.0)


def read_timestamps(column: pd.Series[Any], *, where: str, first_line: int) -> Timestamps:
    """Read a column of timestamps (numbers, dates or text), whose row 0 is on ``first_line`` of the file."""
    import pandas as pd

    if pd.api.types.is_numeric_dtype(column):
        return Timestamps(column.to_numpy(np.float64), numeric=True)
    if pd.api.types.is_datetime64_any_dtype(column):
        return _since_first(pd.to_datetime(column, utc=True))
    # A column has the form of most of its fields; the others are damaged.
    text = column.astype("string").str.strip()
    given = int(text.notna().sum())
    numbers = pd.to_numeric(text.str.replace(r"(?<=\d),(?=\d)", ".", regex=True), errors="coerce")
    if numbers.notna().sum() > 0.5 * given:
        return Timestamps(numbers.to_numpy(np.float64, na_value=np.nan), numeric=True)
    dates = pd.to_datetime(text, errors="coerce", utc=True, format="ISO8601")
    if dates.notna().sum() > 0.5 * given:
        return _since_first(dates)
    for read in (_clock_timestamps, _date_timestamps, _named_months):
        timestamps = read(text)
        if timestamps is not None and np.isfinite(timestamps.time_s).sum() > 0.5 * given:
            return timestamps
    wrong = int(np.flatnonzero((numbers.isna() & dates.isna() & text.notna()).to_numpy())[0]) if given else 0
    raise InputError(
        "is neither a number nor a date with a time",
        where=f"{where}, line {wrong + first_line}",
        value=repr(column.iloc[wrong]),
        limit="12.345, 2024-05-01T10:00:00.345, 05/31/2024 10:00:00.345 or 10:00:00.345",
        do="export the timestamps in one of these forms",
    )


def _since_first(dates: pd.Series[Any]) -> Timestamps:
    first = dates.dropna().iloc[0]
    seconds = (dates - first).dt.total_seconds().to_numpy(np.float64, na_value=np.nan)
    return Timestamps(seconds, zero=str(first.isoformat()))


def _clock_timestamps(text: pd.Series[Any]) -> Timestamps | None:
    """Read times of day, or of a stop watch: hours, minutes, seconds; a new day begins where they fall."""
    fields = text.str.extract(f"^{_CLOCK}$")
    seconds = _seconds_of_day(fields)
    known = np.flatnonzero(np.isfinite(seconds))
    if len(known) == 0:
        return None
    fallen = np.diff(seconds[known]) < -0.5 * _DAY_S
    seconds[known] += _DAY_S * np.concatenate([[0.0], np.cumsum(fallen)])
    return Timestamps(seconds)


def _date_timestamps(text: pd.Series[Any]) -> Timestamps | None:
    """Read dates with a time of day, with the parts of the date in any possible order."""
    import pandas as pd

    fields = text.str.extract(f"^{_DATE}[T,;\\s]+{_CLOCK}$")
    clock_s = _seconds_of_day(fields.iloc[:, 4:])
    numbers = [_numbers(fields.iloc[:, index]) for index in (0, 2, 3)]
    known = np.isfinite(clock_s) & np.all(np.isfinite(numbers), axis=0)
    if not known.any():
        return None
    first, second, third = (values[known].astype(np.int64) for values in numbers)
    points = str(fields.iloc[int(np.flatnonzero(known)[0]), 1]) == "."
    orders = {"year, month, day": (first, second, third)}
    if first.max() < 1000:
        orders = {"day, month, year": (third, second, first)}
        if not points:
            orders["month, day, year"] = (third, first, second)
    found = {}
    for name, (year, month, day) in orders.items():
        parts = {"year": np.where(year < 100, year + 2000, year), "month": month, "day": day}
        dates = pd.to_datetime(pd.DataFrame(parts), errors="coerce")
        if not dates.isna().any():
            since_s = (dates - dates.iloc[0]).dt.total_seconds().to_numpy() + clock_s[known] - clock_s[known][0]
            found[name] = (np.datetime64(dates.iloc[0], "D"), since_s)
    if not found:
        return None
    name = min(found, key=lambda one: float(np.abs(np.diff(found[one][1], prepend=0.0)).max()))
    first_day, since_s = found[name]
    time_s = np.full(len(text), np.nan)
    time_s[known] = since_s
    zero = first_day + np.timedelta64(round(clock_s[known][0] * 1e6), "us")
    note = f"dates read as {name}" if len(found) > 1 else None
    return Timestamps(time_s, zero=str(zero), note=note)


def _named_months(text: pd.Series[Any]) -> Timestamps | None:
    import pandas as pd

    for form in _MONTH_NAMES:
        dates = pd.to_datetime(text, errors="coerce", utc=True, format=form)
        if dates.notna().mean() > 0.5:
            return _since_first(dates)
    return None


def _seconds_of_day(fields: pd.DataFrame) -> Floats:
    """Return seconds from columns of hours, minutes, seconds, digits of the fraction, and a or p; NaN where unknown."""
    hours, minutes, seconds = (_numbers(fields.iloc[:, index]) for index in range(3))
    fraction = _numbers("0." + fields.iloc[:, 3].astype("string").fillna("0"))
    half = fields.iloc[:, 4].astype("string").str.lower()
    hours = np.where(half.notna().to_numpy(), hours % 12 + 12.0 * (half == "p").fillna(value=False).to_numpy(), hours)
    wrong = (minutes > 59) | (seconds > 60)
    return np.where(wrong, np.nan, hours * 3600.0 + minutes * 60.0 + seconds + fraction)


def _numbers(column: Any) -> Floats:
    import pandas as pd

    return np.asarray(pd.to_numeric(column, errors="coerce").to_numpy(np.float64, na_value=np.nan))
