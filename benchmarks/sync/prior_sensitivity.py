"""Effect of halving and doubling each prior of the clock on offsets whose truth is known.

Pairs of film and log of the tests' own generator (``clock_coverage.py``: the paper's pace and a tenth of it) are
synchronised once with the priors as they are and once with each of them halved and doubled. A row says by how much the
estimated offsets move, in their own standard deviations, how much wider or narrower the intervals get, and in how many
pairs the interval holds the truth.

Run: python benchmarks/sync/prior_sensitivity.py --seeds 10
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import fields
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from clock_coverage import led_of, pair_of, records

from sync import LogReading, find_clock
from sync.clock.clock_priors import PRIORS, Priors

Answer = tuple[float, float, float]


@contextmanager
def changed(name: str, factor: float) -> Iterator[None]:
    """Multiply one prior; a share stays below one."""
    was = getattr(PRIORS, name)
    most = 0.95 if name in ("lag_is_roundness", "crossing_temper", "stop_complete", "stop_astray", "no_lag") else np.inf
    value = tuple(min(factor * part, most) for part in was) if isinstance(was, tuple) else min(factor * was, most)
    object.__setattr__(PRIORS, name, value)
    try:
        yield
    finally:
        object.__setattr__(PRIORS, name, was)


def answers(pairs: Sequence[Any], *, led: bool) -> list[Answer]:
    """Return error and interval of the offset of every pair, s from the truth."""
    found = []
    for pair in pairs:
        angles, log = records(pair)
        clock = find_clock(angles, LogReading(log), light=led_of(pair) if led else None).clock
        low, high = clock.offset_ci95_s
        found.append((clock.offset_s - pair.offset_s, low - pair.offset_s, high - pair.offset_s))
    return found


def compared(usual: Sequence[Answer], other: Sequence[Answer]) -> str:
    """Return how far the offsets moved, how the widths changed, and how many intervals hold the truth."""
    before, after = np.array(usual), np.array(other)
    width, wider = before[:, 2] - before[:, 1], after[:, 2] - after[:, 1]
    moved = np.abs(after[:, 0] - before[:, 0]) / (width / 4.0)
    held = int(np.count_nonzero((after[:, 1] <= 0.0) & (after[:, 2] >= 0.0)))
    return (
        f"moved {np.median(moved):5.2f} (most {moved.max():5.2f}) width x{np.median(wider / width):5.2f} held {held:3d}"
    )


def main() -> None:
    """Print one row per prior and factor."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--first", type=int, default=0)
    options = parser.parse_args()
    pairs = []
    for seed in range(options.first, options.first + options.seeds):
        rng = np.random.default_rng([seed, 5])
        kind, lag_s = ("slow", "fast")[seed % 2], float(rng.choice([0.0, rng.uniform(0.0, 10.0)]))
        pairs.append(pair_of(kind, seed, lag_s, float(rng.uniform(-600, 600)), float(rng.uniform(-200, 200))))
    usual = {led: answers(pairs, led=led) for led in (False, True)}
    print(
        f"{len(pairs)} pairs; as they are: {compared(usual[False], usual[False])}; LED {compared(*[usual[True]] * 2)}"
    )
    for field in fields(Priors):
        led = "led" in field.name
        for factor in (0.5, 2.0):
            with changed(field.name, factor):
                other = answers(pairs, led=led)
            print(f"{field.name:22s} x{factor:<3g} {compared(usual[led], other)}", flush=True)


if __name__ == "__main__":
    main()
