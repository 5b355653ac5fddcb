"""Logs that are slower than the film: errors at the wire's corners in the merged table, and in the angle.

Run: python benchmarks/actuator/slow_logs.py [--seeds 3] [--uneven 0.0] [--half-and-twice]

Half-cycles of a known wire (ramps, holds, natural cooling; four rows a second) are logged every 0.25 to 10 s with noise
of 0.02 to 0.07 °C and put back on the rows by straight lines, as a merged table has them. Columns: rms and largest
error of the temperature in mK, on the lines and as they are prepared; and rms error of the plain model's angle, in
degrees, driven by the table (a record) and by the log alone (a later record), against the same wire without noise. The
tops are held for up to 15 s, or (second table) not at all. With ``--uneven`` every reading comes early or late by up to
this share of the interval. ``--half-and-twice`` prints both tables with half and with twice the longest hold of a top
that the conditioning assumes.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).parents[2]))

from benchmarks.half_and_twice import half_and_twice
from torsight.actuator import ActuatorModel, reference_spec
from torsight.actuator.fitted import FittedModel
from torsight.actuator.record import slow_log
from torsight.actuator.record.conditioning import condition
from torsight.core.records import SyncedTable, TemperatureLog
from torsight.core.series import rms
from torsight.core.units import DEG

Array = NDArray[np.float64]
ROW_S = 0.25
EVERY = 5
"""Steps of the wire per row: a heating that is not held ends between two rows."""
START_DEG = 177.6


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--uneven", type=float, default=0.0)
    parser.add_argument("--half-and-twice", action="store_true")
    options = parser.parse_args()
    if not options.half_and_twice:
        tables(options.seeds, options.uneven)
        return
    for factor in half_and_twice("_LONGEST_HOLD_S", slow_log):
        print(f"the longest hold × {factor:g}")
        tables(options.seeds, options.uneven)


def tables(seeds: int, uneven: float) -> None:
    """Print the tables of tops that are held and of tops that are not."""
    for longest_s in (15.0, 0.0):
        print(f"tops held for up to {longest_s:.0f} s\ninterval        lines          prepared   record  later")
        for interval_s in (0.25, 0.5, 1.0, 2.0, 3.0, 5.0, 10.0):
            found = np.array([measured(interval_s, longest_s, seed, uneven) for seed in range(seeds)])
            rms, worst = np.sqrt(np.mean(found**2, axis=0)), found.max(axis=0)
            columns = "   ".join(f"{rms[i]:6.1f} {worst[i + 1]:6.0f}" for i in (0, 2))
            print(f"{interval_s:6.2f} s   {columns}   {rms[4]:6.2f} {rms[5]:6.2f}", flush=True)


def measured(interval_s: float, longest_s: float, seed: int, uneven: float) -> list[float]:
    """Return the errors of one log."""
    rng = np.random.default_rng(seed)
    fine_s, fine = programme(rng, longest_s)
    time_s, wires = fine_s[::EVERY], [wire[::EVERY] for wire in fine]
    noise_c = float(rng.uniform(0.02, 0.07))
    log_s = np.arange(rng.uniform(0.0, interval_s), time_s[-1], interval_s)
    if uneven > 0.0:
        log_s = np.sort(log_s + uneven * interval_s * rng.uniform(-1.0, 1.0, len(log_s)))
    read = [np.round(np.interp(log_s, fine_s, c) + noise_c * rng.standard_normal(len(log_s)), 2) for c in fine]
    lines = [np.interp(time_s, log_s, c) for c in read]
    errors = (lines[0] - wires[0], condition(time_s, lines[0]).temp_c - wires[0])
    model = ActuatorModel(reference_spec())
    fitted = FittedModel(model, model.nominal())
    true = angle_deg(model, fine_s, fine)[::EVERY]
    record = angle_deg(model, time_s, lines) - true
    later = fitted.predict(TemperatureLog(log_s, *read), start_angle_rad=START_DEG * DEG).angle_rad / DEG
    later -= np.interp(log_s, time_s, true)
    figures = [1e3 * value for error in errors for value in (rms(error), float(np.max(np.abs(error))))]
    return [*figures, rms(record), rms(later)]


def angle_deg(model: ActuatorModel, time_s: Array, temps_c: list[Array]) -> Array:
    """Return the model's angle, driven by a table."""
    still = np.full(len(time_s), START_DEG * DEG)
    drive = model.prepare(SyncedTable(time_s, still, np.full(len(time_s), 1e-3), temps_c[0], temps_c[1]))
    return np.interp(time_s, drive.time_s, model.simulate(drive).angle_rad / DEG)


def programme(rng: np.random.Generator, longest_s: float) -> tuple[Array, list[Array]]:
    """Return times and both wires' temperatures: four half-cycles, each heated at its own rate, held and let cool."""
    time_s = np.arange(0.0, 1600.0, ROW_S / EVERY)
    wires = [np.full(len(time_s), 23.0), np.full(len(time_s), 23.0)]
    for number in range(4):
        begin_s, rate, top_c = 400.0 * number + 20.0, rng.uniform(0.2, 0.8), rng.uniform(60.0, 78.0)
        up_s = (top_c - 23.0) / rate
        cool_s = begin_s + up_s + rng.uniform(0.0, 1.0) * longest_s
        heated = 23.0 + rate * np.clip(time_s - begin_s, 0.0, up_s)
        gone = 23.0 + (top_c - 23.0) * np.exp(-np.maximum(time_s - cool_s, 0.0) / rng.uniform(25.0, 45.0))
        own = np.where(time_s < cool_s, heated, gone)
        within = (time_s >= 400.0 * number) & (time_s < 400.0 * (number + 1))
        wires[number % 2][within] = own[within]
    return time_s, wires


if __name__ == "__main__":
    main()
