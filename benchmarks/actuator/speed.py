"""The compiled kernel against the same rule in plain Python, and the time of a fit.

``python benchmarks/actuator/speed.py``: CPU times of this machine; the ratios travel, the times do not.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from torsight.actuator import fit_model
from torsight.actuator.model import ActuatorModel
from torsight.actuator.spec import reference_spec
from torsight.core.records import SyncedTable, TemperatureLog
from torsight.core.units import DEG

ROWS = 120_000
SPAN_S = 7200.0
PYTHON_ROWS = 3000
_INTERPRETED = "--interpreted"


def two_hours(rows: int) -> TemperatureLog:
    """Return eight half-cycles in two hours."""
    time_s = np.linspace(0.0, SPAN_S, rows)
    temps = [np.full(rows, 23.0), np.full(rows, 23.0)]
    each = SPAN_S / 8.0
    for number in range(8):
        u = time_s - number * each
        inside = (u >= 0.0) & (u < each)
        rise = 23.0 + 55.0 * np.minimum(u / 500.0, 1.0)
        own = np.where(u < 600.0, rise, 23.0 + 55.0 * np.exp(-(np.maximum(u, 600.0) - 600.0) / 45.0))
        temps[number % 2] = np.where(inside, own, temps[number % 2])
    return TemperatureLog(time_s, temps[0], temps[1])


def cpu_s(work: Callable[[], object], times: int) -> float:
    """Return the smallest CPU time of a few runs."""
    spent = []
    for _ in range(times):
        start = time.thread_time()
        work()
        spent.append(time.thread_time() - start)
    return min(spent)


def plain_python(rows: int) -> float:
    """Return the CPU time of the second implementation of the tests, per row."""
    sys.path.insert(0, str(Path(__file__).parents[2] / "tests" / "actuator"))
    from actuator_oracle import Oracle, Values

    log = two_hours(rows)
    each = rows // 8
    oracle = Oracle(Values(), 720.0 * DEG)

    def work() -> None:
        for number in range(8):
            own = (log.temp_a_c, log.temp_b_c)[number % 2][number * each : (number + 1) * each]
            oracle.run(number % 2, own.tolist())

    return cpu_s(work, 1) / rows


def interpreted(rows: int) -> float:
    """Return the CPU time per row of the kernel's own code, not compiled: this script in a Python without numba's."""
    found = subprocess.run(
        [sys.executable, __file__, _INTERPRETED, str(rows)],
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"}, check=True, capture_output=True, text=True,
    )  # fmt: skip
    return float(found.stdout)


def kernel_only(rows: int, times: int) -> float:
    """Return the CPU time of the kernel alone over a log of so many rows."""
    from torsight.actuator.stepping import kernel

    model = ActuatorModel(reference_spec())
    drive = model.prepare_log(two_hours(rows), start_angle_rad=177.6 * DEG)
    taken: list[tuple[object, ...]] = []
    run = kernel.run
    kernel.run = lambda *given: (taken.append(given), run(*given))[1]  # type: ignore[assignment, func-returns-value]
    model.simulate(drive)
    kernel.run = run
    return cpu_s(lambda: run(*taken[0]), times)  # type: ignore[arg-type]


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(_INTERPRETED, type=int, metavar="ROWS", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.interpreted:
        print(kernel_only(given.interpreted, 1) / given.interpreted)
        return
    model = ActuatorModel(reference_spec())
    log = two_hours(ROWS)
    drive = model.prepare_log(log, start_angle_rad=177.6 * DEG)
    model.simulate(drive)
    kernel_s, simulate_s = kernel_only(ROWS, 9), cpu_s(lambda: model.simulate(drive), 9)
    noisy = np.random.default_rng(0).standard_normal(ROWS)
    angle = model.simulate(drive, {"tau_c_mnm": 0.9}).angle_rad + 1e-3 * noisy
    rough = [
        temp + 0.02 * np.random.default_rng(seed).standard_normal(ROWS)
        for seed, temp in ((1, log.temp_a_c), (2, log.temp_b_c))
    ]
    table = SyncedTable(log.time_s, angle, np.full(ROWS, 1e-3), rough[0], rough[1])
    prepare_s = cpu_s(lambda: model.prepare(table), 1)
    prepared = model.prepare(table)
    fit_s = cpu_s(lambda: fit_model(model, prepared), 1)
    loop_s, python_s = interpreted(PYTHON_ROWS) * ROWS, plain_python(PYTHON_ROWS) * ROWS
    print(
        json.dumps(
            {
                "rows": ROWS,
                "kernel_ms": 1e3 * kernel_s,
                "simulate_ms": 1e3 * simulate_s,
                "the_same_loop_in_python_s": loop_s,
                "ratio_to_the_same_loop": loop_s / kernel_s,
                "second_implementation_s": python_s,
                "prepare_two_hours_s": prepare_s,
                "fit_two_hours_s": fit_s,
                "fit_rows": len(prepared),
            },
            indent=2,
        )
    )


if __name__ == "__main__":
    main()
