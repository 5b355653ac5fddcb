"""Angle and temperatures on one clock, and the content of ``sync.json``.

Temperatures are interpolated linearly between the two timestamps around a frame's instant. Nothing is averaged: a mean
over neighbouring rows rounds the corners of the temperature, where an incomplete transformation ends, and noise is
better removed before a model is driven, with the same filter for measurement and simulation. Where a frame coincides
with a timestamp the reading is unchanged. Switches and the log's other columns have the value of the last row at or
before the instant; further columns of the angles stay at their frames; where both have one name, the log's gets
``_log`` at its end. Where the readings around are further apart than the longest gap the temperature is empty. Where
the film lacks frames for longer than the log lacks readings, the log's rows are added without an angle, because the
temperature there, such as the top of a heating, drives the actuator whether it is filmed or not.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from sync.log.repairs import LogReading
from sync.log.timestamps import longest_gap_s
from torsight.core.errors import InputError, require_kind
from torsight.core.files.kinds import TABLE_KINDS
from torsight.core.records import ClockMap, SyncedTable, TemperatureLog, clock_sigma_s
from torsight.core.series import usual_step
from torsight.core.tracks import StickAngles
from torsight.core.units import Flags, Floats, Ints

_OWN_NAMES: Final = (*TABLE_KINDS["merged"].signs, "heat_a", "heat_b")


def merge(angles: StickAngles, log: TemperatureLog, clock: ClockMap, *, max_gap_s: float | None = None) -> SyncedTable:
    """Return the table of angles with temperatures, switches and further columns at the film's instants.

    Parameters
    ----------
    angles : StickAngles
        Angle on the film's clock; its rows, sigma and NaN are carried over.
    log : TemperatureLog
        Readings on the logging clock; NaN readings are bridged like missing rows.
    clock : ClockMap
        Map from film time to temperature time.
    max_gap_s : float, optional
        Longest distance between the two readings around an instant, s.

    Returns
    -------
    SyncedTable
        One row per frame, film clock, and the log's rows in gaps of the film; no temperature outside the log and in
        longer gaps of it, no angle where there is no frame.
    """
    require_kind(angles, StickAngles, where="merge, angles", do="read_angles(path) gives one")
    require_kind(log, TemperatureLog, where="merge, log", do="read_temperature_log(path).log is one")
    require_kind(clock, ClockMap, where="merge, clock", do="find_clock(angles, reading).clock is one")
    time_s, frames = _film_instants(angles.time_s, clock.to_film_time(log.time_s))
    angle, sigma = np.full((2, len(time_s)), np.nan)
    angle[frames] = np.where(angles.valid, angles.angle_rad, np.nan)
    sigma[frames] = np.where(angles.valid, angles.sigma_rad, np.nan)
    instant_s = clock.to_temperature_time(time_s)
    gap_s = longest_gap_s(log.time_s) if max_gap_s is None else max_gap_s
    last = np.searchsorted(log.time_s, instant_s, side="right") - 1
    covered = (last >= 0) & (instant_s <= log.time_s[-1])
    row = np.maximum(last, 0)
    filmed = np.isin(np.arange(len(time_s)), frames)
    at_frame = np.maximum(np.cumsum(filmed) - 1, 0)
    extra = {name: _held(values, at_frame, filmed) for name, values in angles.extra.items()}
    extra |= {
        f"{name}_log" if name in extra else name: _held(values, row, covered) for name, values in log.extra.items()
    }
    return SyncedTable(
        time_s=time_s,
        angle_rad=angle,
        angle_sigma_rad=sigma,
        temp_a_c=at_instants(log.time_s, log.temp_a_c, instant_s, max_gap_s=gap_s),
        temp_b_c=at_instants(log.time_s, log.temp_b_c, instant_s, max_gap_s=gap_s),
        heat_a=None if log.heat_a is None else log.heat_a[row] & covered,
        heat_b=None if log.heat_b is None else log.heat_b[row] & covered,
        extra={name: values for name, values in extra.items() if name not in _OWN_NAMES},
        clock_sigma_s=clock_sigma_s(clock.method, clock.within_s),
    )


def _film_instants(film_s: Floats, log_s: Floats) -> tuple[Floats, Ints]:
    """Return the film's instants and the log's rows where frames are missing, and the indices (n,) of the frames."""
    if len(film_s) < 3 or len(log_s) < 2:
        return film_s, np.arange(len(film_s))
    # A frame is missing where frames are more than one and a half steps apart; a row within half a step is at a frame.
    step_s = usual_step(film_s)
    gaps = np.append(np.diff(film_s), 0.0) > max(1.5 * step_s, usual_step(log_s))
    after = np.searchsorted(film_s, log_s, side="right") - 1
    within = (after >= 0) & gaps[after]
    nearest_s = np.minimum(log_s - film_s[after], film_s[np.minimum(after + 1, len(film_s) - 1)] - log_s)
    added_s = log_s[within & (nearest_s > 0.5 * step_s)]
    time_s = np.sort(np.concatenate([film_s, added_s]))
    return time_s, np.searchsorted(time_s, film_s)


def require_overlap(
    table: SyncedTable, angles: StickAngles, log: TemperatureLog, clock: ClockMap, *, where: str
) -> None:
    """Refuse a table without any row that has both temperatures."""
    if np.any(np.isfinite(table.temp_a_c) & np.isfinite(table.temp_b_c)):
        return
    begin, end = clock.to_temperature_time(angles.time_s[[0, -1]])
    raise InputError(
        "film and log do not overlap",
        where=where,
        value=f"the film lies at {begin:.6g} to {end:.6g} s of the log's clock",
        limit=f"the log's {log.time_s[0]:.6g} to {log.time_s[-1]:.6g} s",
        do="check the offset and that both files belong to one experiment",
    )


def at_instants(time_s: Floats, value: Floats, instant_s: Floats, *, max_gap_s: float) -> Floats:
    """Return values at instants, linearly interpolated; NaN outside and in gaps longer than ``max_gap_s``."""
    known = np.isfinite(value)
    at_s, there = time_s[known], value[known]
    if len(at_s) == 0:
        return np.full(len(instant_s), np.nan)
    right = np.minimum(np.searchsorted(at_s, instant_s), len(at_s) - 1)
    bridged = (at_s[right] - at_s[np.maximum(right - 1, 0)] <= max_gap_s) | (at_s[right] == instant_s)
    return np.where(bridged, np.interp(instant_s, at_s, there, left=np.nan, right=np.nan), np.nan)


def _held(values: NDArray[np.generic], row: Ints, covered: Flags) -> NDArray[np.generic]:
    taken = values[row]
    if np.issubdtype(taken.dtype, np.floating):
        return np.where(covered, taken, np.nan)
    if covered.all():
        return taken
    blank: NDArray[np.object_] = np.full(len(taken), None, dtype=object)
    return np.where(covered, taken.astype(object), blank)


def sync_content(clock: ClockMap, reading: LogReading, table: SyncedTable, *, max_gap_s: float) -> dict[str, Any]:
    """Return the content of ``sync.json``."""
    known = np.isfinite(table.temp_a_c) & np.isfinite(table.temp_b_c)
    return {
        "offset_s": {
            "value": clock.offset_s,
            "ci95": list(clock.offset_ci95_s),
            "ci95_at_first_frame": list(clock.within_s),
        },
        "drift_ppm": {"value": clock.drift_ppm, "ci95": list(clock.drift_ci95_ppm)},
        "method": clock.method,
        "notes": [*reading.notes, *clock.notes],
        "interpolation": "linear between the log's timestamps; switches and further columns hold the last row",
        "max_gap_s": max_gap_s,
        "rows": len(table),
        "rows_without_temperature": int(np.count_nonzero(~known)),
        "log": {
            "rows": len(reading.log),
            "zero": reading.zero,
            "columns": {role: column.to_json() for role, column in reading.columns.items()},
            "repairs": [repair.to_json() for repair in reading.repairs],
            "restarts": [restart.to_json() for restart in reading.restarts],
        },
    }
