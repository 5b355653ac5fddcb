"""A temperature log for simulation and prediction: every one of its rows is answered, in its order and clock."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from torsight.core.errors import InputError
from torsight.core.plausible import require_units
from torsight.core.records import TemperatureLog
from torsight.core.storage import number_column, read_table
from torsight.core.tables import require_increasing


def read_log(path: Path) -> TemperatureLog:
    """Read ``TEMPS.csv``: ``time_s, temp_a_c, temp_b_c``, optionally ``heat_a, heat_b``; others are kept.

    Raises
    ------
    InputError
        When a column is missing, a field is no number, times do not increase, or a temperature is none.
    """
    table = read_table(path, required=("time_s", "temp_a_c", "temp_b_c"))
    time_s = table["time_s"].to_numpy(np.float64)
    require_increasing(time_s, path=path)
    if len(time_s) < 2:
        raise InputError("has one row only", where=str(path), limit="2 rows or more", do="record it again")
    temps = {name: table[name].to_numpy(np.float64) for name in ("temp_a_c", "temp_b_c")}
    for name, values in temps.items():
        wrong = np.flatnonzero(np.abs(values + 25.0) > 250.0)
        if len(wrong):
            raise InputError(
                "is no temperature of a spring in °C",
                where=f"{path}, row {wrong[0] + 2}, column {name}",
                value=f"{values[wrong[0]]:g}",
                limit="-275 to 225",
                do="give temperatures in °C; 'torsight sync' takes single spikes out",
            )
    require_units(time_s, temps, where=str(path))
    heat = {
        name: number_column(table, name, where=str(path)).to_numpy(np.float64) > 0.5 if name in table.columns else None
        for name in ("heat_a", "heat_b")
    }
    known = {"time_s", "temp_a_c", "temp_b_c", "heat_a", "heat_b"}
    return TemperatureLog(
        time_s=time_s,
        temp_a_c=temps["temp_a_c"],
        temp_b_c=temps["temp_b_c"],
        heat_a=heat["heat_a"],
        heat_b=heat["heat_b"],
        extra={str(name): table[name].to_numpy() for name in table.columns if name not in known},
    )
