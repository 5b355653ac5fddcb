"""How far back a filter of a reading has to be looked for, and over how many rows.

    python benchmarks/discovery/readings.py

``follows_readings`` tells a driver that is a filter of the output as it was read from a cause. It looks at so many rows
before (``_WINDOW``). The systems are those of the tests: the reading of a lagged signal with a hidden effect. Listed
for each window: shares of filters that are seen (short ones, which keep a reading for less than ten rows, and longer
ones), and how many of the innocent drivers are taken for filters; then both for records with fewer and fewer rows.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Final
from unittest import mock

import numpy as np
from numpy.typing import NDArray
from scipy import signal

sys.path.insert(0, str(Path(__file__).parents[2]))

from tests.discovery import test_own_reading_error as cases
from torsight.discovery.own import reading_error

Array = NDArray[np.float64]
_WINDOWS: Final = (2, 4, 6, 8, 12, 16, 24)
_ROWS: Final = (400, 300, 200, 150, 100, 60, 45)


def _filtered(b: Array, a: Array, y: Array) -> Array:
    return np.asarray(signal.lfilter(b, a, y, zi=signal.lfilter_zi(b, a) * y[0])[0])


def _mean(rows: int) -> Callable[[Array], Array]:
    return lambda y: _filtered(np.full(rows, 1.0 / rows), np.ones(1), y)


def _butter(order: int, share: float) -> Callable[[Array], Array]:
    return lambda y: _filtered(*signal.butter(order, share), y)


def _bessel(order: int, share: float) -> Callable[[Array], Array]:
    return lambda y: _filtered(*signal.bessel(order, share, norm="mag"), y)


SHORT: Final = {
    "lag 2": lambda y: cases.lagged(y, 2.0),
    "lag 5": lambda y: cases.lagged(y, 5.0),
    "mean 5": _mean(5),
    "mean 9": _mean(9),
    "Butterworth 2": _butter(2, 0.2),
    "Butterworth 4": _butter(4, 0.2),
    "Bessel 4": _bessel(4, 0.2),
}
LONG: Final = {
    "lag 10": lambda y: cases.lagged(y, 10.0),
    "lag 30": lambda y: cases.lagged(y, 30.0),
    "mean 21": _mean(21),
    "mean 41": _mean(41),
    "Butterworth 2": _butter(2, 0.05),
    "Butterworth 4": _butter(4, 0.05),
    "Bessel 4": _bessel(4, 0.05),
}


def seen(columns: dict[str, Array], predicted: Array, left: Array, rows: int) -> list[bool]:
    """Return of each driver whether it is taken for a filter, over the record's last rows."""
    return [
        reading_error.follows_readings([one[-rows:]], [predicted[-rows:]], [left[-rows:]]) for one in columns.values()
    ]


def table(seeds: int, rows: int) -> tuple[float, float, int, int]:
    """Return the shares of short and long filters that are seen, innocent drivers taken for filters, and all."""
    short, long, taken = [], [], []
    for seed in range(seeds):
        for kind, hidden, lag_rows in cases.SYSTEMS:
            read, predicted, innocent = cases.system(kind, hidden, lag_rows=lag_rows, seed=1000 + seed)
            for found, made in ((short, SHORT), (long, LONG)):
                columns = {name: one(read) for name, one in made.items()}
                # Rounded as a logger writes it: to a tenth of the reading's noise.
                columns |= {f"{name}, rounded": np.round(10.0 * one / cases.NOISE) for name, one in columns.items()}
                found.extend(seen(columns, predicted, read - predicted, rows))
            taken += seen(innocent, predicted, read - predicted, rows)
    return float(np.mean(short)), float(np.mean(long)), sum(taken), len(taken)


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=5)
    given = parser.parse_args()
    print("window   short  long   innocent drivers taken")
    for window in _WINDOWS:
        with mock.patch.object(reading_error, "_WINDOW", window):
            short, long, taken, count = table(given.seeds, cases.ROWS)
        print(f"{window:6d}   {short:5.2f}  {long:5.2f}   {taken} of {count}", flush=True)
    print("rows   short  long   innocent drivers taken")
    for rows in _ROWS:
        short, long, taken, count = table(given.seeds, rows)
        print(f"{rows:4d}   {short:5.2f}  {long:5.2f}   {taken} of {count}", flush=True)


if __name__ == "__main__":
    main()
