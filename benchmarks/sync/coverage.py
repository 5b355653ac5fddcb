"""How often the 95 % intervals of offset and drift hold the truth, and how wide they are.

Pairs come from the tests' own generator: offsets within ±600 s, drifts within ±200 ppm, a fifth of the log's rows
lost, one restart of its clock in a rest or on a ramp, with and without a lag of the sensor. ``--light`` uses a shared
light instead of the motion.

Run: python benchmarks/sync/coverage.py --kind slow --seeds 200
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "sync")]

from made_up_pairs import Rig, make_pair, programme, records  # noqa: E402 - needs the path above

from sync import LightEvents, LogReading, find_clock, read_temperature_log  # noqa: E402 - needs the path above

KINDS = ("slow", "fast", "one_rate")


def pair_of(kind: str, seed: int, lag_s: float, offset_s: float, drift_ppm: float) -> Any:
    """Make one pair: the paper's pace at 4 Hz, a tenth of it at 30 frames and 66 rows a second, or one single rate."""
    common = {"offset_s": offset_s, "drift_ppm": drift_ppm, "lost_share": 0.2}
    if kind == "slow":
        return make_pair(seed, rig=Rig(lag_s=lag_s, threshold_scatter_c=0.02), **common)
    if kind == "fast":
        rig = Rig(lag_s=0.3 * lag_s, cooling_s=8.0, threshold_scatter_c=0.02, temp_noise_c=0.05, angle_noise_deg=0.1)
        cycles = programme(seed, rates=(1.2, 3.0), hold=(1.0, 5.0), rest_s=40.0, half_cycles=6)
        return make_pair(seed, rig=rig, cycles=cycles, film_fps=30.0, log_step_s=0.015, **common)
    cycles = programme(seed, rates=(0.12, 0.121), incomplete=False)
    return make_pair(seed, rig=Rig(lag_s=lag_s), cycles=cycles, **common)


def restarted(pair: Any, rng: np.random.Generator, folder: Path) -> Path:
    """Write the log with one restart of its clock somewhere, after which its stamps begin at zero."""
    half_cycle = int(rng.integers(1, len(pair.switch_true_s)))
    begin_s, off_s = pair.switch_true_s[half_cycle]
    in_rest = bool(rng.random() < 0.5)
    film_s = begin_s - 0.1 * (off_s - begin_s) if in_rest else begin_s + 0.3 * (off_s - begin_s)
    at_s = film_s * (1.0 + pair.drift_ppm * 1e-6) + pair.offset_s
    away_s = float(rng.choice([0.0, rng.uniform(0.0, 20.0)]))
    keep = (pair.log_s < at_s) | (pair.log_s > at_s + away_s)
    stamp = pair.log_s[keep].copy()
    behind = stamp > at_s
    if behind.any():
        stamp[behind] -= stamp[behind][0]
    columns: dict[str, Any] = {"time_s": stamp, "temp_a_c": pair.temp_a_c[keep], "temp_b_c": pair.temp_b_c[keep]}
    columns |= {"heat_a": pair.heat_a[keep].astype(int), "heat_b": pair.heat_b[keep].astype(int)}
    path = folder / "temps.csv"
    pd.DataFrame(columns).to_csv(path, index=False)
    return path


def light_of(pair: Any) -> LightEvents:
    """Return the first frames that show each change of a light."""
    time_s = np.sort(pair.switch_true_s.ravel())
    on = np.isin(time_s, pair.switch_true_s[:, 0])
    inside = (time_s > pair.film_s[1]) & (time_s < pair.film_s[-1])
    return LightEvents(pair.film_s[np.searchsorted(pair.film_s, time_s[inside])], on[inside])


def main() -> None:
    """Run the study and print one line per seed and a summary."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kind", choices=KINDS, default="slow")
    parser.add_argument("--seeds", type=int, default=200)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--no-restart", action="store_true")
    parser.add_argument("--light", action="store_true")
    options = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as name:
        for seed in range(options.first, options.first + options.seeds):
            rng = np.random.default_rng([seed, 3])
            offset_s, drift_ppm = float(rng.uniform(-600, 600)), float(rng.uniform(-200, 200))
            lag_s = float(rng.choice([0.0, rng.uniform(0.0, 10.0)]))
            pair = pair_of(options.kind, seed, lag_s, offset_s, drift_ppm)
            angles, log = records(pair)
            reading = LogReading(log) if options.no_restart else read_temperature_log(restarted(pair, rng, Path(name)))
            clock = find_clock(angles, reading, light=light_of(pair) if options.light else None).clock
            low, high = clock.offset_ci95_s
            drift_low, drift_high = clock.drift_ci95_ppm
            error_s = clock.offset_s - offset_s
            held = low <= offset_s <= high
            drift_held = drift_low <= drift_ppm <= drift_high
            rows.append((error_s, held, drift_held, high - low, drift_high - drift_low))
            print(
                f"{seed} lag {lag_s:.1f} s error {error_s:+.3f} s [{low - offset_s:+.3f}, {high - offset_s:+.3f}]"
                f"{'' if rows[-1][1] else ' MISSED'}, drift {clock.drift_ppm - drift_ppm:+.1f} ppm"
                f"{'' if rows[-1][2] else ' MISSED'}",
                flush=True,
            )
    errors, holds, drift_holds, width, drift_width = (np.array(column) for column in zip(*rows, strict=True))
    print(
        f"{options.kind}{' light' if options.light else ''}: {len(rows)} pairs; the interval holds the offset in "
        f"{100 * holds.mean():.1f} %, the drift in {100 * drift_holds.mean():.1f} %; median width "
        f"{np.median(width):.3f} s and {np.median(drift_width):.0f} ppm; error median {np.median(errors):+.4f} s, "
        f"half of them within {np.median(np.abs(errors)):.4f} s, 95 % within {np.quantile(np.abs(errors), 0.95):.3f} s"
    )


if __name__ == "__main__":
    main()
