"""A synthetic record as the files that a measurement leaves: for the tests of the pages and of the examples."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import tomli_w

from torsight.core.files.storage import write_table
from torsight.core.files.tables import write_merged
from torsight.synthetic import Record


def write_record(record: Record, folder: Path, *, offset_s: float) -> None:
    """Write ``merged.csv``, the same apart as ``angle.csv`` and ``temps.csv``, and ``actuator.toml``.

    The log's clock is ahead of the film's by ``offset_s``.
    """
    table = record.table
    write_merged(folder / "merged.csv", table)
    angles = {
        "frame": np.arange(len(table)),
        "time_s": table.time_s,
        "angle_deg": np.rad2deg(table.angle_rad),
        "angle_sigma_deg": np.rad2deg(table.angle_sigma_rad),
        "valid": np.ones(len(table)),
    }
    write_table(folder / "angle.csv", angles)
    temps = {"time_s": table.time_s + offset_s, "temp_a_c": table.temp_a_c, "temp_b_c": table.temp_b_c}
    write_table(folder / "temps.csv", temps)
    (folder / "actuator.toml").write_text(tomli_w.dumps(record.played.scene.declared.to_toml()))
