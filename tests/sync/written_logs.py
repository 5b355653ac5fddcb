"""Logs written to a file, column by column, for the tests of reading them."""

from pathlib import Path

import numpy as np
import pandas as pd


def ramp(rows=400, step_s=0.25, rate=0.2):
    time_s = np.arange(rows) * step_s
    return time_s, 25.0 + rate * time_s, 24.0 + 0.1 * rate * time_s


def written(folder: Path, time_s, temp_a, temp_b, *, sep=",", decimal=".", newline="\n", bom=False, extra=None) -> Path:
    columns = {"time_s": time_s, "temp_a_c": temp_a, "temp_b_c": temp_b} | (extra or {})
    text = pd.DataFrame(columns).to_csv(index=False, sep=sep, decimal=decimal, lineterminator="\n")
    path = folder / "temps.csv"
    path.write_bytes((b"\xef\xbb\xbf" if bom else b"") + text.replace("\n", newline).encode())
    return path


def kinds(reading):
    return {repair.kind: repair.count for repair in reading.repairs}
