"""Effect of halving and doubling each constant of a log's preparation: errors of temperature and angle.

Run: python benchmarks/actuator/log_constants.py [--only WORD] [--seeds 3]

Logs of known wires (ramps, holds, natural cooling, a controlled top that overshoots; fast and slow; read every 0.1 to 1
second with noise of 0.02 to 0.25 °C; some behind a sensor with a lag of 3 s) are conditioned, and drive the plain model
of the reference rig. Columns: rms error of the temperature in mK, and of the slope in mK/s; rms of errors over their
sigmas; bias of the peaks, mK; rms error of the model's angle, in thousandths of a degree, against the same wire
without noise. Behind a lag the angle is not compared, because the model describes a lag as an effect. The last line is
of the two wires with a lag: interpolated between two time constants of the grid of fits (LAG_GRID_S), and for their
own.
"""

from __future__ import annotations

import argparse
import importlib
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).parents[2]))

from benchmarks.half_and_twice import half_and_twice
from torsight.actuator import ActuatorModel, reference_spec
from torsight.actuator.record.conditioning import Readings, condition
from torsight.actuator.record.sensors import LAG_GRID_S
from torsight.core.records import SyncedTable
from torsight.core.series import rms

Array = NDArray[np.float64]
FINE_S = 0.01
CONSTANTS = {
    "conditioning": ("_BLOCK_S",),
    "smoother": ("_DEGREES", "_ALIKE_S", "_ROUNDS", "_AVERAGED_S"),
    "holds": ("LEAST_HOLD_S", "_LEAST_ROWS", "_REJECTED"),
    "log_noise": ("_MAX_STRIDE_S",),
}  # fmt: skip


@dataclass(frozen=True)
class Wire:
    """What a wire does and how it is read."""

    rate_c_s: float
    peak_c: float
    hold_s: float
    overshoot_c: float
    interval_s: float
    noise_c: float
    lag_s: float = 0.0


WIRES = (
    Wire(0.11, 80.0, 0.0, 0.0, 0.25, 0.05),
    Wire(0.11, 62.0, 12.0, 0.0, 0.25, 0.1),
    Wire(0.5, 80.0, 15.0, 1.5, 0.1, 0.1),
    Wire(1.5, 76.0, 0.0, 0.0, 0.1, 0.25),
    Wire(0.3, 66.0, 30.0, 0.0, 1.0, 0.02),
    Wire(0.5, 70.0, 8.0, 0.0, 0.5, 0.25),
    Wire(0.11, 80.0, 0.0, 0.0, 0.25, 0.05, lag_s=3.0),
    Wire(0.5, 70.0, 20.0, 0.0, 0.1, 0.1, lag_s=3.0),
)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", default="", help="constants whose name holds this")
    parser.add_argument("--seeds", type=int, default=3)
    options = parser.parse_args()
    print(f"{'constant':36s}       mK     mK/s     pull   top mK     mdeg")
    line("as it is", options.seeds)
    for module_name, names in CONSTANTS.items():
        module = importlib.import_module(f"torsight.actuator.record.{module_name}")
        for name in names:
            if options.only not in name:
                continue
            for factor in half_and_twice(name, module):
                line(f"{module_name} {name} × {factor:g}", options.seeds)
    between, own = np.sqrt(
        np.mean([lagged(wire, seed) for wire in WIRES[-2:] for seed in range(options.seeds)], axis=0)
    )
    print(f"{'between time constants, and for its own':36s} {between:7.2f} {own:7.2f} mK")


def line(title: str, seeds: int) -> None:
    """Print the figures over all logs."""
    figures = np.array([found for wire in WIRES for seed in range(seeds) for found in measured(wire, seed)])
    square = np.sqrt(np.nanmean(figures**2, axis=0))
    print(
        f"{title:36s} {square[0]:7.2f} {square[1]:7.2f} {square[2]:6.3f} {square[3]:7.2f} {square[4]:8.2f}", flush=True
    )


def measured(wire: Wire, seed: int) -> Iterator[tuple[float, float, float, float, float]]:
    """Give the rms errors of one log."""
    time_s, temp_c, read = logged(wire, seed)
    found = Readings.of(time_s, read).behind(time_s, wire.lag_s) if wire.lag_s else condition(time_s, read)
    error = found.temp_c - temp_c
    slope = found.rate_c_s - np.gradient(true_wire(wire)[1], FINE_S)[:: round(wire.interval_s / FINE_S)]
    pull = float(np.sqrt(np.mean((error / np.maximum(found.sigma_c, 1e-3)) ** 2)))
    top = float(found.temp_c.max() - temp_c.max())
    angle = np.nan if wire.lag_s else angle_error_deg(time_s, temp_c, read)
    yield 1e3 * rms(error), 1e3 * rms(slope), pull, 1e3 * top, 1e3 * angle


def logged(wire: Wire, seed: int) -> tuple[Array, Array, Array]:
    """Return times, the wire's temperatures and what is read of them."""
    fine_s, fine_c = true_wire(wire)
    every = round(wire.interval_s / FINE_S)
    time_s, temp_c = fine_s[::every], fine_c[::every]
    noise = wire.noise_c * np.random.default_rng(seed).standard_normal(len(time_s))
    return time_s, temp_c, np.round(behind(fine_c, wire.lag_s)[::every] + noise, 2)


def lagged(wire: Wire, seed: int) -> tuple[float, float]:
    """Return the mean square error behind a lag, from its neighbours on the grid and from itself, mK²."""
    time_s, temp_c, read = logged(wire, seed)
    above = next(lag_s for lag_s in LAG_GRID_S if lag_s > wire.lag_s)
    below = max(lag_s for lag_s in LAG_GRID_S if lag_s <= wire.lag_s)
    readings = Readings.of(time_s, read)
    share = (wire.lag_s - below) / (above - below)
    between = readings.at(time_s, readings.wire(below).towards(readings.wire(above), share), wire.lag_s).temp_c
    own = readings.behind(time_s, wire.lag_s).temp_c
    return 1e6 * rms(between - temp_c) ** 2, 1e6 * rms(own - temp_c) ** 2


def true_wire(wire: Wire) -> tuple[Array, Array]:
    """Return fine times and the wire's temperature: a heating with what its top does, and a natural cooling."""
    room_c, begin_s = 23.0, 40.0
    top_s = begin_s + (wire.peak_c - room_c) / wire.rate_c_s
    time_s = np.arange(0.0, top_s + wire.hold_s + 300.0, FINE_S)
    rise = room_c + wire.rate_c_s * np.clip(time_s - begin_s, 0.0, top_s - begin_s)
    after = time_s - top_s
    held = wire.peak_c + wire.overshoot_c * np.exp(-after / 4.0) * np.sin(after / 2.0)
    cold = room_c + (wire.peak_c - room_c) * np.exp(-np.maximum(after - wire.hold_s, 0.0) / 45.0)
    return time_s, np.where(after < 0.0, rise, np.where(after < wire.hold_s, held, cold))


def behind(temp_c: Array, lag_s: float) -> Array:
    """Return what a sensor with a lag reads, step by step."""
    if lag_s == 0.0:
        return temp_c
    keep, read = np.exp(-FINE_S / lag_s), temp_c.copy()
    for k in range(1, len(read)):
        read[k] = temp_c[k] + (read[k - 1] - temp_c[k]) * keep
    return read


def angle_error_deg(time_s: Array, temp_c: Array, read_c: Array) -> float:
    """Return the rms difference of the angles that the plain model makes of the log and of the wire itself."""
    model = ActuatorModel(reference_spec())
    angles = []
    for temp in (temp_c, read_c):
        still = np.full(len(time_s), 23.0)
        table = SyncedTable(time_s, np.full(len(time_s), 3.0), np.full(len(time_s), 1e-3), temp, still)
        drive = model.prepare(table)
        angles.append(np.interp(time_s, drive.time_s, model.simulate(drive, model.nominal()).angle_rad))
    return float(np.degrees(rms(angles[1] - angles[0])))


if __name__ == "__main__":
    main()
