"""``sync.json``: the clock, what it rests on, and what was repaired in the log."""

from __future__ import annotations

from typing import Any

import numpy as np

from sync.log.repairs import LogReading
from torsight.core.records import ClockMap, SyncedTable


def sync_content(clock: ClockMap, reading: LogReading, table: SyncedTable, *, max_gap_s: float) -> dict[str, Any]:
    """Return the content of ``sync.json``."""
    known = np.isfinite(table.temp_a_c) & np.isfinite(table.temp_b_c)
    return {
        "offset_s": {"value": clock.offset_s, "ci95": list(clock.offset_ci95_s)},
        "drift_ppm": {"value": clock.drift_ppm, "ci95": list(clock.drift_ci95_ppm)},
        "method": clock.method,
        "notes": [*reading.notes, *clock.notes],
        "interpolation": "linear between the log's stamps; switches and further columns hold the last row",
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
