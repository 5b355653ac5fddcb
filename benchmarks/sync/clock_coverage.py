"""Coverage and width of the 95 % intervals of offset and drift.

Offsets within ±600 s, drifts within ±200 ppm, a fifth of the log's rows lost, one restart of its clock in a rest or on
a ramp. The pairs of ``--kind slow``, ``fast``, ``stairs`` and ``one_rate`` come from the tests' own generator, with and
without a lag of the sensor; any other kind is an effect hidden in the synthetic rig (``rig_pairs.py``). ``--led`` uses
a shared LED instead of the motion. A seed that ``--out`` already holds is not run again. Seeds from 10000 on are for
the report only.

Run: python benchmarks/sync/clock_coverage.py --kind slow --seeds 200 --out slow.jsonl
     python benchmarks/sync/clock_coverage.py --report slow.jsonl fast.jsonl
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import pandas as pd

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "sync"), str(Path(__file__).parent)]

from made_up_pairs import Rig, make_pair, programme, records  # noqa: E402 - needs the path above
from rig_pairs import HIDDEN, rig_pair  # noqa: E402 - needs the path above

from sync import LightEvents, LogReading, find_clock, read_temperature_log  # noqa: E402 - needs the path above
from torsight.core.errors import NoResultError  # noqa: E402 - needs the path above

KINDS = ("slow", "fast", "stairs", "one_rate")


def pair_of(kind: str, seed: int, lag_s: float, offset_s: float, drift_ppm: float) -> Any:
    """Make one pair: the paper's pace at 4 Hz, a tenth of it at 30 frames and 66 rows a second, one rate, or a rig.

    On ``stairs`` temperatures are held on the way up, and motions are late behind them.
    """
    common = {"offset_s": offset_s, "drift_ppm": drift_ppm, "lost_share": 0.2}
    if kind in HIDDEN:
        return rig_pair(seed, kind, offset_s=offset_s, drift_ppm=drift_ppm)
    if kind == "slow":
        return make_pair(seed, rig=Rig(lag_s=lag_s, threshold_scatter_c=0.02), **common)
    if kind == "fast":
        rig = Rig(lag_s=0.3 * lag_s, cooling_s=8.0, threshold_scatter_c=0.02, temp_noise_c=0.05, angle_noise_deg=0.1)
        cycles = programme(seed, rates=(1.2, 3.0), hold=(1.0, 5.0), rest_s=40.0, half_cycles=6)
        return make_pair(seed, rig=rig, cycles=cycles, film_fps=30.0, log_step_s=0.015, **common)
    if kind == "stairs":
        cycles = [
            replace(one, rate_c_s=rate, peak_c=76.0, hold_s=60.0, steps_c=(44.0, 50.0, 56.0, 62.0, 68.0))
            for one, rate in zip(programme(seed, half_cycles=4), (0.5, 0.3, 0.4, 0.6), strict=True)
        ]
        return make_pair(seed, rig=Rig(lag_s=lag_s, late_s=2.0), cycles=cycles, **common)
    cycles = programme(seed, rates=(0.12, 0.121), incomplete=False)
    return make_pair(seed, rig=Rig(lag_s=lag_s), cycles=cycles, **common)


def restarted(pair: Any, rng: np.random.Generator, folder: Path) -> Path:
    """Write the log with one restart of its clock somewhere, after which its timestamps begin at zero."""
    half_cycle = int(rng.integers(1, len(pair.switch_true_s)))
    begin_s, off_s = pair.switch_true_s[half_cycle]
    in_rest = bool(rng.random() < 0.5)
    film_s = begin_s - 0.1 * (off_s - begin_s) if in_rest else begin_s + 0.3 * (off_s - begin_s)
    at_s = film_s * (1.0 + pair.drift_ppm * 1e-6) + pair.offset_s
    away_s = float(rng.choice([0.0, rng.uniform(0.0, 20.0)]))
    keep = (pair.log_s < at_s) | (pair.log_s > at_s + away_s)
    timestamp = pair.log_s[keep].copy()
    behind = timestamp > at_s
    if behind.any():
        timestamp[behind] -= timestamp[behind][0]
    columns: dict[str, Any] = {"time_s": timestamp, "temp_a_c": pair.temp_a_c[keep], "temp_b_c": pair.temp_b_c[keep]}
    columns |= {"heat_a": pair.heat_a[keep].astype(int), "heat_b": pair.heat_b[keep].astype(int)}
    path = folder / "temps.csv"
    pd.DataFrame(columns).to_csv(path, index=False)
    return path


def led_of(pair: Any) -> LightEvents:
    """Return the first frames that show each change of an LED."""
    time_s = np.sort(pair.switch_true_s.ravel())
    on = np.isin(time_s, pair.switch_true_s[:, 0])
    inside = (time_s > pair.film_s[1]) & (time_s < pair.film_s[-1])
    return LightEvents(pair.film_s[np.searchsorted(pair.film_s, time_s[inside])], on[inside])


def study(kind: str, seed: int, *, led: bool, restart: bool, folder: Path) -> dict[str, Any]:
    """Estimate the clock of one pair and hold it against the truth."""
    rng = np.random.default_rng([seed, 3])
    offset_s, drift_ppm = float(rng.uniform(-600, 600)), float(rng.uniform(-200, 200))
    lag_s = float(rng.choice([0.0, rng.uniform(0.0, 10.0)]))
    pair = pair_of(kind, seed, lag_s, offset_s, drift_ppm)
    angles, log = records(pair)
    reading = read_temperature_log(restarted(pair, rng, folder)) if restart else LogReading(log)
    row: dict[str, Any] = {"kind": kind, "led": led, "restart": restart, "seed": seed, "lag_s": lag_s}
    row["frame_s"] = float(np.median(np.diff(pair.film_s)))
    row["middle_s"] = 0.5 * float(pair.film_s[-1])
    try:
        clock = find_clock(angles, reading, light=led_of(pair) if led else None).clock
    except NoResultError as error:
        return row | {"failed": str(error)}
    return row | {
        "offset_error_s": clock.offset_s - offset_s,
        "offset_ci95_s": [end - offset_s for end in clock.offset_ci95_s],
        "drift_error_ppm": clock.drift_ppm - drift_ppm,
        "drift_ci95_ppm": [end - drift_ppm for end in clock.drift_ci95_ppm],
    }


def told(row: Mapping[str, Any]) -> str:
    """Return one line about a pair; intervals as they lie around the truth."""
    if "failed" in row:
        return f"{row['kind']} {row['seed']}: {row['failed']}"
    low, high = row["offset_ci95_s"]
    drift_low, drift_high = row["drift_ci95_ppm"]
    return (
        f"{row['kind']} {row['seed']}: {row['offset_error_s']:+.3f} s [{low:+.3f}, {high:+.3f}]"
        f"{'' if low <= 0.0 <= high else ' MISSED'}, {row['drift_error_ppm']:+.1f} ppm "
        f"[{drift_low:+.1f}, {drift_high:+.1f}]{'' if drift_low <= 0.0 <= drift_high else ' MISSED'}"
    )


def summary(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return coverage, widths and errors of pairs of one kind."""
    good = [row for row in rows if "failed" not in row]
    low, high = np.array([row["offset_ci95_s"] for row in good]).T
    drift_low, drift_high = np.array([row["drift_ci95_ppm"] for row in good]).T
    error_s = np.array([row["offset_error_s"] for row in good])
    # At the middle of the film, where the evidence is: at its beginning the drift's error comes in.
    middle = error_s + np.array([row["drift_error_ppm"] * 1e-6 * row["middle_s"] for row in good])
    frames = middle / np.array([row["frame_s"] for row in good])
    return (
        f"{rows[0]['kind']}{' LED' if rows[0]['led'] else ''}: {len(rows)} pairs, {len(rows) - len(good)} without "
        f"an answer; offset held in {100 * np.mean((low <= 0) & (high >= 0)):.1f} %, drift in "
        f"{100 * np.mean((drift_low <= 0) & (drift_high >= 0)):.1f} %; median width {np.median(high - low):.3f} s, "
        f"{np.median(drift_high - drift_low):.0f} ppm; error median {np.median(error_s):+.4f} s, half within "
        f"{np.median(np.abs(error_s)):.4f} s, 95 % within {np.quantile(np.abs(error_s), 0.95):.3f} s; at the film's "
        f"middle mean {np.mean(frames):+.3f} ± {np.std(frames) / np.sqrt(len(frames)):.3f} frames"
    )


def main() -> None:
    """Run seeds that are not in the file yet, or report on files."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kind", choices=(*KINDS, *HIDDEN, "hidden"), default="slow")
    parser.add_argument("--seeds", type=int, default=200)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--no-restart", action="store_true")
    parser.add_argument("--led", action="store_true")
    parser.add_argument("--out", type=Path, default=Path("clock_coverage.jsonl"))
    parser.add_argument("--report", type=Path, nargs="+")
    options = parser.parse_args()
    if options.report:
        lines = [line for path in options.report for line in path.read_text(encoding="utf-8").splitlines()]
        groups: dict[tuple[Any, ...], list[dict[str, Any]]] = {}
        for row in map(json.loads, lines):
            groups.setdefault((row["kind"], row["led"]), []).append(row)
        for rows in groups.values():
            print(summary(rows))
        return
    done = set()
    if options.out.exists():
        done = {(row["kind"], row["seed"]) for row in map(json.loads, options.out.read_text("utf-8").splitlines())}
    kinds = tuple(HIDDEN) if options.kind == "hidden" else (options.kind,)
    with tempfile.TemporaryDirectory() as name, options.out.open("a", encoding="utf-8") as out:
        for seed in range(options.first, options.first + options.seeds):
            kind = kinds[seed % len(kinds)]
            if (kind, seed) in done:
                continue
            row = study(kind, seed, led=options.led, restart=not options.no_restart, folder=Path(name))
            out.write(json.dumps(row) + "\n")
            out.flush()
            print(told(row), flush=True)


if __name__ == "__main__":
    main()
