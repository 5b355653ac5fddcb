"""Conversion of timestamps to seconds: numbers, dates with a time of day, a time of day or a duration alone.

Only differences of timestamps count. So whether ``05/06/2024`` is in May or in June matters only if a log passes
midnight: then the reading with the shorter steps is right, because the other one jumps by a month. The name of a time
zone (``UTC``, ``CEST``) is left out where it is the same in all rows, whatever its offset.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from torsight.core.errors import InputError
from torsight.core.units import Floats
from torsight.core.words.plausible import SHORTEST_S

if TYPE_CHECKING:
    import pandas as pd

_HALF: Final = r"\s*(?P<half>[AaPp])\.?[Mm]\.?"
_SECOND: Final = r"(?P<second>\d{2})(?:[.,:](?P<fraction>\d{1,9}))?"
"""Seconds and fraction; some loggers separate milliseconds from seconds by a third colon."""
_CLOCK: Final = rf"(?P<hour>\d{{1,4}}):(?P<minute>\d{{2}}):{_SECOND}(?:{_HALF})?"
_DATED_CLOCK: Final = rf"(?P<hour>\d{{1,2}}):(?P<minute>\d{{2}})(?::{_SECOND})?(?:{_HALF})?"
"""After a date two numbers are hours and minutes."""
_CLOCKS: Final = (_CLOCK, rf"(?P<hour>\d{{1,2}}):(?P<minute>\d{{2}}){_HALF}", rf"(?P<minute>\d{{1,4}}):{_SECOND}")
"""Times without a date. Two numbers are hours and minutes before AM or PM, and minutes and seconds where there are
fractions or more than 23 of the first."""
_TWO_NUMBERS: Final = re.compile(r"\d+:\d{2}")
_ZONE: Final = r"(?:(?<=\d)(?=Z)|\s+\(?)((?!AM|PM)[A-Z]{1,5}(?:[+-]\d{1,2}(?::?\d{2})?)?|[A-Z][a-z]+/\w+)\)?$"
"""The name of a time zone behind a time, or its offset from a named one: ``UTC+2``."""
_DATE: Final = r"(\d{1,4})([./-])(\d{1,2})[./-](\d{1,4})"
_TIMESTAMP: Final = re.compile(rf"^(?P<date>\d{{1,2}}[./-]\d{{1,2}}[./-]\d{{2,4}}[T,;\s]+)?{_CLOCK}$")
_MONTH_NAMES: Final = (
    *(
        f"{date} {clock}"
        for date in ("%d-%b-%Y", "%d %b %Y", "%b %d, %Y")
        for clock in ("%H:%M:%S", "%H:%M:%S.%f", "%I:%M:%S %p")
    ),
    "%b %d %H:%M:%S %Y",
)
"""Dates with the name of a month; the last one is that of C's ``ctime``, behind the day of the week."""
_WEEKDAY: Final = r"^[A-Z][a-z]{1,8}\.?,?\s+(?=\w)"
_SPREADSHEET_DAYS: Final = (36526.0, 73050.0)
"""The years 2000 to 2099 in days since 1899-12-30, as spreadsheets count dates."""
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
    """Incremental conversion of the timestamps of a growing log.

    For numbers, ISO 8601, and times of day with seconds, with or without a date, the results are those of
    :func:`read_timestamps`, which has all rows and reads more forms. Of dates only the first instant and the
    time of day are used: midnight is where the time of day falls.
    """

    def __init__(self, factor: float = 1.0) -> None:
        self._factor = factor
        self._zero: datetime | None = None
        self._began_s: float | None = None
        self._last_s = -np.inf
        self._days = 0

    def seconds(self, text: str) -> float:
        """Return the seconds of the next timestamp; ValueError where the text is none."""
        try:
            return float(text) * self._factor
        except ValueError:
            text = re.sub(_ZONE, "", text)
            found = _TIMESTAMP.match(text)
        if found is None:
            timestamp = datetime.fromisoformat(text)
            self._zero = self._zero or timestamp
            return (timestamp - self._zero).total_seconds()
        half, hour = found["half"], int(found["hour"])
        hour = hour if half is None else hour % 12 + 12 * (half.lower() == "p")
        second = int(found["second"]) + float(f"0.{found['fraction'] or 0}")
        time_s = 3600.0 * hour + 60.0 * int(found["minute"]) + second
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
    text = _without_zone(column.astype("string").str.strip(), where=where)
    given = int(text.notna().sum())
    numbers = pd.to_numeric(text.str.replace(r"(?<=\d),(?=\d)", ".", regex=True), errors="coerce")
    if numbers.notna().sum() > 0.5 * given:
        return Timestamps(numbers.to_numpy(np.float64, na_value=np.nan), numeric=True)
    dates = pd.to_datetime(text, errors="coerce", utc=True, format="ISO8601")
    if dates.notna().sum() > 0.5 * given:
        return _since_first(dates)
    for read in (_clock_timestamps, _date_timestamps, _named_months, _durations):
        timestamps = read(text)
        if timestamps is not None and np.isfinite(timestamps.time_s).sum() > 0.5 * given:
            return timestamps
    wrong = int(np.flatnonzero((numbers.isna() & dates.isna() & text.notna()).to_numpy())[0]) if given else 0
    what, do = "is neither a number nor a date with a time", "export the timestamps in one of these forms"
    if given and _TWO_NUMBERS.fullmatch(str(text.iloc[wrong])) is not None:
        what, do = "may be hours and minutes or minutes and seconds", "export hours, minutes and seconds"
    raise InputError(
        what,
        where=f"{where}, line {wrong + first_line}",
        value=repr(column.iloc[wrong]),
        limit="12.345, 2024-05-01T10:00:00.345, 05/31/2024 10:00:00.345, 31-May-2024 10:00:00 or 10:00:00.345",
        do=do,
    )


def spreadsheet_dates(numbers: Floats) -> Timestamps | None:
    """Return timestamps from dates as spreadsheets number them, in days; None for other numbers.

    As seconds, numbers of such a range would be a record that is too short for a heating.
    """
    known = numbers[np.isfinite(numbers)]
    low, high = _SPREADSHEET_DAYS
    if not len(known) or known.min() < low or known.max() > high or np.ptp(known) >= SHORTEST_S:
        return None
    zero = np.datetime64("1899-12-30") + np.timedelta64(round(known[0] * _DAY_S * 1e3), "ms")
    note = f"times are read as a spreadsheet's dates, which count days: the first one is {zero}"
    return Timestamps((numbers - known[0]) * _DAY_S, zero=str(zero), note=note)


def _without_zone(text: pd.Series[Any], *, where: str) -> pd.Series[Any]:
    """Return timestamps without the name of a time zone, which must be the same in all rows that have one."""
    zones = text.str.extract(_ZONE, expand=False).dropna().unique()
    if len(zones) == 0:
        return text
    if len(zones) > 1:
        raise InputError(
            "has times in more than one time zone",
            where=where,
            value=", ".join(zones[:3]),
            limit="one time zone",
            do="export the timestamps in UTC",
        )
    return text.str.replace(_ZONE, "", regex=True)


def _since_first(dates: pd.Series[Any]) -> Timestamps:
    first = dates.dropna().iloc[0]
    seconds = (dates - first).dt.total_seconds().to_numpy(np.float64, na_value=np.nan)
    return Timestamps(seconds, zero=str(first.isoformat()))


def _clock_timestamps(text: pd.Series[Any]) -> Timestamps | None:
    """Read times of day, or of a stop watch; a new day begins where they fall, without hours a new hour."""
    for form in _CLOCKS:
        fields = text.str.extract(f"^{form}$")
        seconds = _seconds_of_day(fields)
        known = np.flatnonzero(np.isfinite(seconds))
        clear = (
            "hour" in fields or fields["fraction"].notna().any() or np.max(seconds[known], initial=0.0) >= 24.0 * 60.0
        )
        if clear and len(known) > 0.5 * text.notna().sum():
            # A stop watch may count minutes beyond 59.
            period_s = _DAY_S if "hour" in fields else max(3600.0, 2.0 * float(seconds[known].max()))
            fallen = np.diff(seconds[known]) < -0.5 * period_s
            seconds[known] += period_s * np.concatenate([[0.0], np.cumsum(fallen)])
            return Timestamps(seconds)
    return None


def _date_timestamps(text: pd.Series[Any]) -> Timestamps | None:
    """Read dates with a time of day, with the parts of the date in any possible order."""
    import pandas as pd

    fields = text.str.extract(f"^{_DATE}[T,;\\s]+{_DATED_CLOCK}$")
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
            orders["year, month, day"] = (first, second, third)
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
    others = " or ".join(one for one in found if one != name)
    note = f"dates are read as {name}; {others} is possible, too: check it where the log passes midnight"
    return Timestamps(time_s, zero=str(zero), note=note if others else None)


def _named_months(text: pd.Series[Any]) -> Timestamps | None:
    import pandas as pd

    text = text.str.replace(_WEEKDAY, "", regex=True) if text.str.match(r"^[A-Z][a-z]+\W+[A-Z\d]").any() else text
    for form in _MONTH_NAMES:
        dates = pd.to_datetime(text, errors="coerce", utc=True, format=form)
        if dates.notna().mean() > 0.5:
            return _since_first(dates)
    return None


def _durations(text: pd.Series[Any]) -> Timestamps | None:
    """Read durations with units, as pandas and ISO 8601 write them: ``0 days 00:00:07``, ``PT7.376S``, ``7.376 s``."""
    import pandas as pd

    return Timestamps(_numbers(pd.to_timedelta(text, errors="coerce").dt.total_seconds()))


def _seconds_of_day(fields: pd.DataFrame) -> Floats:
    """Return seconds from texts of hours, minutes, seconds, digits of the fraction, and a or p; NaN where unknown.

    The minute is always needed; a form may have no column for the others.
    """
    import pandas as pd

    zero, none = pd.Series("0", fields.index, dtype="string"), pd.Series(pd.NA, fields.index, dtype="string")
    hours, minutes = _numbers(fields.get("hour", zero)), _numbers(fields["minute"])
    seconds = _numbers(fields.get("second", zero).fillna("0"))
    fraction = _numbers("0." + fields.get("fraction", zero).astype("string").fillna("0"))
    half = fields.get("half", none).astype("string").str.lower()
    hours = np.where(half.notna().to_numpy(), hours % 12 + 12.0 * (half == "p").fillna(value=False).to_numpy(), hours)
    wrong = (minutes > 59) | (seconds > 60)
    return np.where(wrong, np.nan, hours * 3600.0 + minutes * 60.0 + seconds + fraction)


def _numbers(column: Any) -> Floats:
    import pandas as pd

    return np.asarray(pd.to_numeric(column, errors="coerce").to_numpy(np.float64, na_value=np.nan))
