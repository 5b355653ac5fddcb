"""Effect of halving and doubling each constant of log reading and clock search, with known clock and temperature.

Pairs of film and log of the tests' own generator (``clock_coverage.py``) are synchronised with each constant changed in
turn; the log's clock restarts once in half of them. The columns are those of ``prior_sensitivity.py``: by how much
offsets move, in their own standard deviations, how much wider intervals get, in how many pairs they hold the truth;
then how many pairs have no answer. Constants of log reading are judged by logs with spikes, readings that stand still,
rows lost and timestamps repeated: share of the damaged readings that stay, share of the sound ones that go, and rms
error, in °C, of the temperature that the merged table gets from the log.

Run: python benchmarks/sync/constants.py --seeds 6 [--only WORD]
"""

from __future__ import annotations

import argparse
import importlib
import os
import pkgutil
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import pandas as pd

sys.path.insert(0, str(Path(__file__).parents[2]))
sys.path.insert(0, str(Path(__file__).parent))

from clock_coverage import led_of, pair_of, records, restarted
from prior_sensitivity import Answer, compared

import sync
from benchmarks.half_and_twice import half_and_twice
from sync import LogReading, find_clock, read_temperature_log
from sync.log.timestamps import longest_gap_s
from sync.merge.merged_table import at_instants
from torsight.core.errors import NoResultError

CLOCK = {
    "log.restart_gaps": ("_WINDOW_S", "LONGEST_GAP_S"),
    "clock.gaussian_mixture": ("MOST_HYPOTHESES", "NEGLIGIBLE_LOG"),
    "clock.led_likelihood": ("_GRID",),
    "clock.offset_search": ("ALIKE",),
    "clock.threshold_crossings": ("WHOLE_STROKE",),
    "clock.threshold_likelihood": ("_RATE_POWERS", "_VALLEY"),
    "signals.changepoints": ("MAX_LAG_S", "_POINTS"),
    "signals.even_signal": ("WINDOW_S",),
    "signals.heating_segments": ("_HEATING_SHARE", "_HELD_SHARE", "LATEST_S"),
    "signals.strokes": ("_MIN_STROKE_RAD", "_WINDOW_S", "_PAUSE_SHARE", "_LONGEST_PAUSE_S", "_NOISE_PER_STEP"),
}
LOG = {
    "log.outliers": ("_SPIKE_FLOOR_C", "_LONGEST_S"),
    "log.timestamps": ("BRIDGED_S", "_CLOCK_SET_S"),
}
MODULES = [
    importlib.import_module(found.name) for found in pkgutil.walk_packages(sync.__path__, "sync.") if not found.ispkg
]


def changed(module: str, name: str) -> Iterator[float]:
    """Give 0.5 and 2 while a constant of a module of sync is so many times its value wherever it is used."""
    return half_and_twice(name, importlib.import_module(f"sync.{module}"), *MODULES)


def clocks(pairs: Sequence[Any], folder: Path, *, led: bool) -> list[Answer | None]:
    """Return error and interval of the offset of every pair, s from the truth; None where there is no answer."""
    found: list[Answer | None] = []
    for number, pair in enumerate(pairs):
        angles, log = records(pair)
        reading = LogReading(log)
        if number % 2:
            reading = read_temperature_log(restarted(pair, np.random.default_rng([number, 4]), folder))
        try:
            clock = find_clock(angles, reading, light=led_of(pair) if led else None).clock
        except NoResultError:
            found.append(None)
            continue
        low, high = clock.offset_ci95_s
        found.append((clock.offset_s - pair.offset_s, low - pair.offset_s, high - pair.offset_s))
    return found


def damaged(pair: Any, seed: int, folder: Path) -> tuple[Path, dict[str, Any]]:
    """Write a pair's log with damages; return its path and, for each temperature, what is sound and which rows are.

    A third of the logs is read to 0.5 °C, a third has timestamps in whole seconds, and each has a pause of half a
    minute.
    """
    rng = np.random.default_rng([seed, 6])
    keep = ~((pair.log_s > pair.log_s[len(pair.log_s) // 3]) & (pair.log_s < pair.log_s[len(pair.log_s) // 3] + 30.0))
    time_s = pair.log_s[keep]
    columns: dict[str, Any] = {"time_s": np.floor(time_s) if seed % 3 == 1 else time_s}
    truth: dict[str, Any] = {"time_s": time_s}
    for name in ("temp_a_c", "temp_b_c"):
        clean = getattr(pair, name)[keep]
        read = np.round(2.0 * clean) / 2.0 if seed % 3 == 2 else clean.copy()
        wrong = np.zeros(len(read), np.bool_)
        places = rng.integers(20, len(read) - 120, 24)
        for number, place in enumerate(places.tolist()):
            if number < 16:
                read[place] += rng.choice([-1.0, 1.0]) * rng.choice([1.5, 3.0, 10.0, 40.0])
                wrong[place] = True
            else:
                count = int(rng.choice([6, 20, 60]))
                read[place : place + count] = read[place]
                wrong[place + 1 : place + count] = True
        columns[name] = np.round(read, 2)
        truth[name] = (clean, wrong)
    path = folder / "damaged.csv"
    pd.DataFrame(columns).to_csv(path, index=False)
    return path, truth


def cleaned(pairs: Sequence[Any], folder: Path) -> str:
    """Return what reading a damaged log leaves of its damages, and takes of what is sound."""
    kept, gone, square = [], [], []
    for seed, pair in enumerate(pairs):
        path, truth = damaged(pair, seed, folder)
        log = read_temperature_log(path).log
        film_s = np.arange(truth["time_s"][0] + 1.0, truth["time_s"][-1] - 1.0, 0.1)
        for name in ("temp_a_c", "temp_b_c"):
            clean, wrong = truth[name]
            seen = getattr(log, name)
            merged = at_instants(log.time_s, seen, film_s, max_gap_s=longest_gap_s(log.time_s))
            square.append(np.nanmean((merged - np.interp(film_s, truth["time_s"], clean)) ** 2))
            # Rows are one for one where none was dropped or put together.
            if len(seen) == len(wrong):
                kept.append(np.mean(np.isfinite(seen[wrong])))
                gone.append(np.mean(~np.isfinite(seen[~wrong])))
    return f"stay {np.mean(kept):6.2%} go {np.mean(gone):7.3%} rms {np.sqrt(np.mean(square)):6.3f} °C"


def line(usual: Sequence[Answer | None], other: Sequence[Answer | None]) -> str:
    """Return the comparison over the pairs that both have an answer to."""
    both = [(one, two) for one, two in zip(usual, other, strict=True) if one is not None and two is not None]
    return f"{compared([one for one, _ in both], [two for _, two in both])} none {other.count(None):2d}"


def main() -> None:
    """Print one row per constant and factor."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=6)
    parser.add_argument("--only", default="", help="constants whose name holds this")
    options = parser.parse_args()
    pairs = []
    for seed in range(options.seeds):
        rng = np.random.default_rng([seed, 5])
        kind, lag_s = ("slow", "fast", "stairs")[seed // 2 % 3], float(rng.choice([0.0, rng.uniform(0.0, 10.0)]))
        pairs.append(pair_of(kind, seed, lag_s, float(rng.uniform(-600, 600)), float(rng.uniform(-200, 200))))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        print(f"as it is: {cleaned(pairs, folder)}", flush=True)
        for module, names in LOG.items():
            for constant in (one for one in names if options.only in one):
                for factor in changed(module, constant):
                    print(f"{module + ' ' + constant:38s} x{factor:<3g} {cleaned(pairs, folder)}", flush=True)
        usual = {led: clocks(pairs, folder, led=led) for led in (False, True)}
        for led, word in ((False, "motion"), (True, "LED")):
            print(f"as it is, {word}: {line(usual[led], usual[led])}", flush=True)
        for module, names in CLOCK.items():
            led = "led" in module
            for constant in (one for one in names if options.only in one):
                for factor in changed(module, constant):
                    other = clocks(pairs, folder, led=led)
                    print(f"{module + ' ' + constant:38s} x{factor:<3g} {line(usual[led], other)}", flush=True)


if __name__ == "__main__":
    main()
