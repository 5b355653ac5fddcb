"""Checks for values in another unit than their column's, which no rig could have.

Every function raises an :class:`~torsight.core.errors.InputError` that names the column, the finding and the expected
unit.
"""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime, timedelta
from typing import Final

import numpy as np

from torsight.core.errors import InputError
from torsight.core.units import DEG, Floats

LATEST_S: Final = 1e11
"""Largest timestamp in seconds: milliseconds of the calendar have 13 digits."""
FINEST_S: Final = datetime.resolution / timedelta(seconds=1)
"""Shortest interval of rows: that of the calendar's times, a microsecond; no camera and no logger is faster."""
MOST_ROWS_APART_S: Final = 1e8
"""Longest duration: no record lasts for three years."""
MOST_TURNED_DEG: Final = 1e6
"""Largest angle, 2,800 turns: springs are wound by one and a half."""
_SLOWEST_HALF_S: Final = 7200.0
"""Longest time for half of a heating, which takes minutes; a record in milliseconds seems a thousand times longer."""
SHORTEST_S: Final = _SLOWEST_HALF_S / 3600.0
"""Shortest record: what lasts no longer, and would be half of a heating, is in hours."""
SPRING_C: Final = (-273.15, 250.0)
"""Range of a spring's temperature: absolute zero to the limit of readings of a working instrument (sync.log.outliers);
a room in kelvin has 290."""
HEATED_C: Final = 12.0
"""Smallest rise that moves a spring: the reference rig's transformation takes 18 °C on heating, 14 °C on cooling."""
_AT_REST_C: Final = (-100.0, 55.0)
"""Range of a spring's temperature at rest: °C of a room that are taken for kelvin are converted to −250 °C; in °F a
room has 60 and more, in kelvin 290."""
_SECONDS: Final = "give times in seconds, not in milliseconds, minutes or days, or state a log's unit: --units time=ms"


def require_timestamps(time_s: Floats, *, where: str) -> None:
    """Refuse timestamps (n,) whose size or steps are implausible for seconds; ``where`` names file and column."""
    if len(time_s) < 2:
        return
    largest = float(np.abs(time_s).max())
    if largest > LATEST_S:
        raise InputError("is no time in seconds", where=where, value=f"{largest:g}", limit=f"{LATEST_S:g}", do=_SECONDS)
    step_s = float(np.median(np.abs(np.diff(time_s))))
    if 0.0 < step_s < FINEST_S:
        raise InputError("has rows too close together", where=where, value=f"{step_s:g} s", limit="1 µs", do=_SECONDS)
    span_s = float(np.ptp(time_s))
    if span_s > MOST_ROWS_APART_S:
        raise InputError("lasts too long", where=where, value=f"{span_s:g} s", limit="three years", do=_SECONDS)


def require_turns(angle_rad: Floats, time_s: Floats, *, where: str) -> None:
    """Refuse angles (n,), rad, that are folded into one turn; NaN where an angle, or its whole turn, is not known.

    A disk whose angles span at most one turn does not turn by more than half a turn between two successive rows.
    """
    known = angle_rad[np.isfinite(angle_rad)]
    steps = np.nan_to_num(np.abs(np.diff(angle_rad)))
    if len(known) < 2 or np.ptp(known) > 2.0 * np.pi or (most := float(np.max(steps))) <= np.pi:
        return
    raise InputError(
        "the angle seems to be folded into one turn",
        where=f"{where}, column angle_deg, after {time_s[int(np.argmax(steps))]:g} s",
        value=f"a step of {most / DEG:.0f}°",
        limit="180° from one row to the next",
        do="count the turns on: numpy.unwrap(angle_deg, period=360)",
    )


def require_units(time_s: Floats, temps_c: Mapping[str, Floats], *, where: str, time_name: str = "time_s") -> None:
    """Refuse a log of heated springs whose times are not seconds, or whose temperatures are not °C.

    A spring's wire is thin: its temperature changes by half its range within minutes, never within hours, and the wire
    is cold before it is heated. Logs without a heating pass: the stages that need a heating refuse them. ``time_s``
    (n,) increases, ``temps_c`` holds temperatures (n,) by column; NaN where not known. ``time_name`` is the column of
    times.
    """
    in_time = f"{where}, column {time_name}"
    require_timestamps(time_s, where=in_time)
    for name, temp_c in temps_c.items():
        known = np.isfinite(temp_c)
        if known.sum() < 3 or np.ptp(temp_c[known]) < HEATED_C:
            continue
        _require_cold(temp_c[known], where=f"{where}, column {name}")
        _require_pace(time_s[known], temp_c[known], where=in_time)


def _require_cold(temp_c: Floats, *, where: str) -> None:
    coldest = float(temp_c.min())
    if coldest < _AT_REST_C[0]:
        raise InputError(
            "is colder than any rig",
            where=where,
            value=f"{coldest:.1f} °C",
            limit=f"{_AT_REST_C[0]:g} °C or more",
            do="say in which unit the temperatures are: °C under a header that says kelvin comes out so",
        )
    if coldest > _AT_REST_C[1]:
        raise InputError(
            "never is as cold as a room",
            where=where,
            value=f"{coldest:.1f} °C at least",
            limit=f"below {_AT_REST_C[1]:g} °C at rest",
            do="give temperatures in °C, not in °F or kelvin, and begin the record with cold springs",
        )


def _require_pace(time_s: Floats, temp_c: Floats, *, where: str) -> None:
    # Imported where it is needed: it takes a third of a second.
    import pandas as pd

    span_s = float(time_s[-1] - time_s[0])
    if span_s < SHORTEST_S:
        raise InputError(
            "is too short for a heating",
            where=where,
            value=f"{span_s:g} s for {np.ptp(temp_c):.0f} °C",
            limit=f"{SHORTEST_S:g} s or more",
            do=_SECONDS,
        )
    # Over the longest time for half of a heating, ending at each row.
    within = pd.Series(temp_c, pd.to_timedelta(time_s - time_s[0], unit="s")).rolling(
        f"{_SLOWEST_HALF_S:g}s", closed="both"
    )
    most_c = float((within.max() - within.min()).max())
    if most_c < 0.5 * np.ptp(temp_c):
        raise InputError(
            "runs too slowly for springs that are heated",
            where=where,
            value=f"a change of {most_c:.3g} °C at most in {_SLOWEST_HALF_S:g} s",
            limit=f"half of {np.ptp(temp_c):.0f} °C",
            do=_SECONDS,
        )
