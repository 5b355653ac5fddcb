"""One bending test, two instruments: a frame's log of the motion and a meter's log of the specimen's temperature."""

from __future__ import annotations

from datetime import datetime

import numpy as np

from torsight.core.records import TemperatureLog
from torsight.core.tracks import StickAngles

LOADED_S = 200.0


def read_pair(folder):
    """Return the deflection as an angle (1 rad per mm, warming turns it down) and the temperature as spring A's."""
    rows = []
    for line in (folder / "mts_3cycle.txt").read_text(encoding="latin-1").splitlines():
        fields = line.split(",")
        if len(fields) == 6 and fields[0].replace(".", "").isdigit():
            rows.append([float(field) for field in fields[:3]])
    frame = np.array(rows)
    frame = frame[(frame[:, 0] > LOADED_S) & (np.diff(frame[:, 0], prepend=-1.0) > 0)]
    readings = {}
    for line in (folder / "fluke_3cycle.csv").read_text(encoding="latin-1").splitlines():
        fields = line.split(",")
        if len(fields) > 3 and fields[1] in ("Sample", "Max", "Min") and "/" in fields[3]:
            stamp = datetime.strptime(fields[3], "%m/%d/%Y %H:%M:%S.%f")  # noqa: DTZ007 - a wall clock without a zone
            readings[stamp] = float(fields[2])
    stamps = sorted(readings)
    log_s = np.array([(stamp - stamps[0]).total_seconds() for stamp in stamps])
    temp_c = np.array([readings[stamp] for stamp in stamps])
    count = len(frame)
    everywhere = np.ones(count, dtype=bool)
    angles = StickAngles(np.arange(count), frame[:, 0], -frame[:, 2], np.full(count, 3e-3), everywhere, everywhere)
    return angles, TemperatureLog(log_s, temp_c, np.full(len(log_s), 24.0))
