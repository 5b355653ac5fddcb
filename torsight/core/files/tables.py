"""The tables of the contract (angle, markers, merged), each to and from its record."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from torsight.core.errors import InputError, require_kind
from torsight.core.files.kinds import TABLE_KINDS
from torsight.core.files.paths import AnyPath
from torsight.core.files.storage import first_row, number_column, read_json, read_table, write_table
from torsight.core.records import SyncedTable, clock_sigma_s, merged_columns
from torsight.core.tracks import MARKERS, StickAngles, angle_columns
from torsight.core.units import DEG, Flags, Floats, Ints
from torsight.core.words.plausible import MOST_TURNED_DEG, require_timestamps, require_units

if TYPE_CHECKING:
    import pandas as pd

MOST_FRAMES: Final = 20_000_000
"""Largest plausible frame number: no film is that long."""
_ANGLE = TABLE_KINDS["angle"].signs
_MERGED = TABLE_KINDS["merged"].signs


def write_angles(path: AnyPath, angles: StickAngles) -> None:
    """Write ``angle.csv``: one row per frame; angle and sigma are empty where not valid."""
    require_kind(angles, StickAngles, where="write_angles, angles", do="read_angles(path) gives one")
    write_table(Path(path), angle_columns(angles))


def frame_numbers(table: pd.DataFrame, *, path: Path) -> Ints:
    """Return the column ``frame`` of a table; numbers that do not increase are refused."""
    frame = table["frame"].to_numpy(np.float64)
    bad = ~((frame >= 0) & (frame <= MOST_FRAMES)) | (frame != np.floor(frame))
    bad[1:] |= ~(frame[1:] > frame[:-1])
    for row, place in first_row(bad, where=path, column="frame"):
        raise InputError(
            "is no frame number in increasing order",
            where=place,
            value=f"{frame[row]:g}",
            limit=f"0, 1, 2 … {MOST_FRAMES} at most",
            do="mend the table, or track the film again",
        )
    return np.asarray(frame, dtype=np.int64)


def switch_column(table: pd.DataFrame, name: str, *, where: str, lines: Sequence[int] | None = None) -> Flags | None:
    """Return a column of zeros and ones as flags; None where the table has no such column.

    An empty field counts as 0. Raises InputError when a field is neither 0 nor 1.
    """
    if name not in table.columns:
        return None
    numbers = np.asarray(number_column(table, name, where=where, lines=lines), dtype=np.float64)
    wrong = ~(np.isnan(numbers) | np.isin(numbers, (0.0, 1.0)))
    for row, place in first_row(wrong, where=where, column=name, lines=lines):
        raise InputError("is no switch", where=place, value=f"{numbers[row]:g}", limit="0 or 1", do="mend that row")
    return np.equal(numbers, 1.0)


def switches_and_extra(
    table: pd.DataFrame, *, known: Sequence[str], where: str, lines: Sequence[int] | None = None
) -> dict[str, Any]:
    """Return a record's columns other than the ``known`` ones: ``heat_a``, ``heat_b`` and the rest as ``extra``."""
    heat = {name: switch_column(table, name, where=where, lines=lines) for name in ("heat_a", "heat_b")}
    rest = {str(name): table[name].to_numpy() for name in table.columns if name not in (*known, *heat)}
    return {**heat, "extra": rest}


def read_angles(path: AnyPath) -> StickAngles:
    """Read ``angle.csv``; unknown columns are kept in ``extra``.

    Raises InputError when a column is missing, frames or times do not increase, or a standard deviation is negative.
    """
    path = Path(path)
    table = read_table(path, required=_ANGLE)
    valid = table["valid"].to_numpy() > 0.5
    certain = switch_column(table, "branch_certain", where=str(path))
    time_s = table["time_s"].to_numpy(np.float64)
    require_increasing(time_s, path=path)
    angle_rad, sigma_rad = _angle_rad(table, path=path)
    return StickAngles(
        frame=frame_numbers(table, path=path),
        time_s=time_s,
        angle_rad=np.where(valid, angle_rad, np.nan),
        sigma_rad=np.where(valid, sigma_rad, np.nan),
        valid=valid & np.isfinite(angle_rad),
        branch_certain=np.ones(len(valid), bool) if certain is None else certain,
        extra={str(name): table[name].to_numpy() for name in table.columns if name not in (*_ANGLE, "branch_certain")},
    )


def require_increasing(
    time_s: Floats, *, path: Path, column: str = "time_s", lines: Sequence[int] | None = None
) -> None:
    """Refuse times that are not finite, do not increase or are no seconds, naming the row.

    ``column`` is the file's own name of the times. ``lines`` are the rows' lines in the file; without them row 0 is on
    line 2.
    """
    bad = ~np.isfinite(time_s)
    bad[1:] |= ~(time_s[1:] > time_s[:-1])
    for row, place in first_row(bad, where=path, column=column, lines=lines):
        before = f" after {time_s[row - 1]:.15g}" if row else ""
        missing = bool(np.isnan(time_s[row]))
        raise InputError(
            "time is missing" if missing else "time does not increase",
            where=place,
            value=f"an empty field{before}" if missing else f"{time_s[row]:.15g}{before}",
            limit="a larger time than in the row before",
            do="fill that field in, or leave the row out" if missing else "sort or mend the table",
        )
    require_timestamps(time_s, where=f"{path}, column {column}")


def _angle_rad(table: pd.DataFrame, *, path: Path) -> tuple[Floats, Floats]:
    """Return a table's angles and their standard deviations, rad; impossible ones are refused."""
    angle_deg, sigma_deg = (table[name].to_numpy(np.float64) for name in ("angle_deg", "angle_sigma_deg"))
    for row, place in first_row(sigma_deg < 0.0, where=path, column="angle_sigma_deg"):
        raise InputError(
            "is no standard deviation",
            where=place,
            value=f"{sigma_deg[row]:g}",
            limit="0° or more, or an empty field",
            do="mend that row",
        )
    for row, place in first_row(np.abs(angle_deg) > MOST_TURNED_DEG, where=path, column="angle_deg"):
        raise InputError(
            "is no angle of a stick",
            where=place,
            value=f"{angle_deg[row]:g}",
            limit=f"{MOST_TURNED_DEG:g}°, either sign",
            do="track the film again",
        )
    return angle_deg * DEG, sigma_deg * DEG


def marker_values(table: pd.DataFrame, *parts: str, names: Sequence[str] = MARKERS) -> Floats:
    """Return columns of ``markers.csv`` by marker and part, such as ``x_px``: (n, k, p), NaN where not valid."""
    values = [[table[f"{name}_{part}"].to_numpy(np.float64) for part in parts] for name in names]
    valid = np.array([table[f"{name}_valid"].to_numpy(np.float64) > 0.5 for name in names])
    return np.where(valid.T[:, :, None], np.transpose(values, (2, 0, 1)), np.nan)


def write_merged(path: AnyPath, table: SyncedTable) -> None:
    """Write ``merged.csv``: angle and temperatures on the film's clock."""
    require_kind(table, SyncedTable, where="write_merged, table", do="read_merged(path) gives one")
    write_table(Path(path), merged_columns(table))


def read_merged(path: AnyPath) -> SyncedTable:
    """Read ``merged.csv``, and the uncertainty of the clocks from ``sync.json`` beside it.

    Unknown columns are kept in ``extra``.

    Raises InputError when a column is missing, the times do not increase, or ``sync.json`` lacks the offset's interval.
    """
    path = Path(path)
    frame = read_table(path, required=_MERGED)
    time_s = frame["time_s"].to_numpy(np.float64)
    require_increasing(time_s, path=path)
    angle_rad, sigma_rad = _angle_rad(frame, path=path)
    temp_a_c, temp_b_c = (frame[name].to_numpy(np.float64) for name in ("temp_a_c", "temp_b_c"))
    require_units(time_s, {"temp_a_c": temp_a_c, "temp_b_c": temp_b_c}, where=str(path))
    rest = switches_and_extra(frame, known=_MERGED, where=str(path))
    rest["clock_sigma_s"] = _clock_sigma_s(path.parent / "sync.json")
    return SyncedTable(time_s, angle_rad, sigma_rad, temp_a_c, temp_b_c, **rest)


def _clock_sigma_s(path: Path) -> float | None:
    """Return the standard deviation of the clocks' offset from ``sync.json``; None where there is none."""
    if not path.is_file():
        return None
    content = read_json(path)
    try:
        offset = content["offset_s"]
        low, high = (float(end) for end in offset.get("ci95_at_first_frame", offset["ci95"]))
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise InputError(
            "'offset_s' has no interval", where=str(path), do="write it again with 'torsight sync', or remove it"
        ) from error
    return clock_sigma_s(str(content.get("method", "")), (low, high))
