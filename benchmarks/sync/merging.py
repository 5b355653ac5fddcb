"""Time and memory of a two-hour record at 66 rows a second, beside plain pandas on the same files.

Each way runs in a process of its own: reading both files, ``torsight sync`` with a given offset, with the offset from
the motion, and what a script of a few lines would do (``merge_asof`` with the nearest row: no mending, no gaps, no
clock). Times are CPU seconds as ratios to the script; memory is the largest resident set of the process.

Run: python benchmarks/sync/merging.py
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import pandas as pd

ROOT = Path(__file__).parents[2]
SCRIPT = """
import sys
import pandas as pd
angle, temps = pd.read_csv(sys.argv[1]), pd.read_csv(sys.argv[2])
temps["time_s"] -= 12.5
pd.merge_asof(angle, temps, on="time_s", direction="nearest").to_csv(sys.argv[3], index=False)
"""


def write_record(folder: Path, *, hours: float, rate_hz: float) -> None:
    """Write angles and a log: ten minutes of heating and five of cooling, A and B in turn."""
    rng = np.random.default_rng(0)
    time_s = np.arange(0.0, 3600.0 * hours, 1.0 / rate_hz)
    number, phase_s = np.divmod(time_s, 900.0)
    rate_c_s = 0.08 + 0.01 * (number % 3)
    hot_c = 24.0 + rate_c_s * np.minimum(phase_s, 600.0)
    temp_c = np.where(phase_s < 600.0, hot_c, 24.0 + (hot_c - 24.0) * np.exp(-(phase_s - 600.0) / 60.0))
    drives_b = number % 2 == 1
    temps = {name: np.where(drives_b == (name == "b"), temp_c, 24.0) for name in "ab"}
    up = np.clip((temp_c - 45.0) / 18.0, 0.0, 1.0)
    back = np.where(phase_s < 600.0, 0.0, np.clip((52.0 - temp_c) / 5.0, 0.0, 1.0))
    stroke_deg = 410.0 * (1.0 - np.cos(np.pi * up)) / 2.0
    reached_deg = 410.0 * (1.0 - np.cos(np.pi * np.clip((24.0 + rate_c_s * 600.0 - 45.0) / 18.0, 0.0, 1.0))) / 2.0
    way_deg = np.where(phase_s < 600.0, stroke_deg, reached_deg - 55.0 * back)
    angle_deg = np.where(drives_b, -177.0 + way_deg, 177.0 - way_deg) + 0.05 * rng.standard_normal(len(time_s))
    frames = {"frame": np.arange(len(time_s)), "time_s": time_s.round(6), "angle_deg": angle_deg.round(6)}
    pd.DataFrame(frames | {"angle_sigma_deg": 0.05, "valid": 1}).to_csv(folder / "angle.csv", index=False)
    columns = {f"temp_{n}_c": (c + 0.03 * rng.standard_normal(len(c))).round(2) for n, c in temps.items()}
    heat = {f"heat_{n}": ((drives_b == (n == "b")) & (phase_s < 600.0)).astype(int) for n in "ab"}
    pd.DataFrame({"time_s": (time_s + 12.5).round(6)} | columns | heat).to_csv(folder / "temps.csv", index=False)


def measured(command: Sequence[str]) -> tuple[float, float]:
    """Return CPU seconds and MiB of one process."""
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    _, status, usage = os.wait4(process.pid, 0)
    if status != 0:
        message = process.stderr.read().decode() if process.stderr else ""
        raise SystemExit(f"{command[:4]} failed: {message}")
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024.0


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--hours", type=float, default=2.0)
    parser.add_argument("--rate-hz", type=float, default=66.0)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_record(folder, hours=options.hours, rate_hz=options.rate_hz)
        size_mib = sum((folder / f).stat().st_size for f in ("angle.csv", "temps.csv")) / 2**20
        print(f"{options.hours * 3600.0 * options.rate_hz:.0f} frames and rows, {size_mib:.0f} MiB of CSV")
        angle, temps = str(folder / "angle.csv"), str(folder / "temps.csv")
        torsight = [sys.executable, "-m", "torsight.cli.main", "sync", "--angle", angle, "--temperature", temps]
        ways = {
            "plain pandas, merge_asof": [sys.executable, "-c", SCRIPT, angle, temps, str(folder / "plain.csv")],
            "torsight sync, offset given": [*torsight, "--offset", "12.5", "--drift-ppm", "0", "--out", name + "/a"],
            "torsight sync, offset found": [*torsight, "--out", name + "/b"],
        }
        first: float | None = None
        for way, command in ways.items():
            seconds, mib = measured(command)
            first = seconds if first is None else first
            print(f"{way:30s} {seconds:6.1f} s CPU, {seconds / first:4.1f} x, {mib:5.0f} MiB")


if __name__ == "__main__":
    main()
