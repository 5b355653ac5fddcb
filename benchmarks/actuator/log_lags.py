"""Evidence of a log for its sensor's time constant: what the true one is short of, and how clearly others are refuted.

Run: python benchmarks/actuator/log_lags.py [--logs 96]

Logs of wires with random heatings (ramps, steps with holds, one fast ramp; natural cooling) are read every 0.25 or
0.5 s with noise of 0.02 to 0.4 °C, some rounded to 0.1 or 0.25 °C; half of them behind a sensor with a time constant of
0.7 to 8 s, and a third from wires whose own corners are rounded, as by a controller, over 2 to 10 s. Columns, for once,
half and twice the weight of the evidence (``sensors._COUNTS``): how much less evidence the true time constant has than
the best one (mean, 95 % quantile; an estimate with one Gaussian error has 0.5 and 1.9), and the evidence against 1.5
and 3 s where the sensor has no lag (median, and the quarter in which it is weakest).
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

sys.path.insert(0, str(Path(__file__).parents[2]))

from benchmarks.actuator.log_constants import FINE_S, behind
from benchmarks.half_and_twice import half_and_twice
from torsight.actuator.record import sensors
from torsight.actuator.record.conditioning import Readings
from torsight.actuator.record.sensors import Sensors

Array = NDArray[np.float64]
ROOM_C = 23.0


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--logs", type=int, default=96)
    options = parser.parse_args()
    logs = [logged(seed) for seed in range(options.logs)]
    found = [(of_log(time_s, read), lag_s) for time_s, read, lag_s in logs]
    print("weight   true lag short by   95 %   against 1.5 s  weakest   against 3 s  weakest")
    line("once", found)
    for factor in half_and_twice("_COUNTS", sensors):
        line("twice" if factor > 1.0 else "half", found)


def line(title: str, found: list[tuple[Sensors, float]]) -> None:
    """Print the figures over all logs."""
    short, against = [], []
    for one, lag_s in found:
        course = evidence(one, np.arange(0.0, 40.0, 0.1))
        if lag_s > 0.0:
            short.append(course.max() - evidence(one, np.array([lag_s]))[0])
        else:
            against.append(-evidence(one, np.array([1.5, 3.0])))
    middle, weakest = np.median(against, axis=0), np.quantile(against, 0.25, axis=0)
    print(
        f"{title:6s} {np.mean(short):19.2f} {np.quantile(short, 0.95):6.2f} {middle[0]:15.1f} {weakest[0]:8.1f} "
        f"{middle[1]:13.1f} {weakest[1]:8.1f}",
        flush=True,
    )


def of_log(time_s: Array, read: Array) -> Sensors:
    """Return the sensors of a record in which both springs have the same log."""
    readings, none = Readings.of_rows(time_s, read), np.zeros(0, np.int64)
    nothing, sharp = np.zeros(0), readings.smooth(0.0).log_evidence
    return Sensors(time_s, (readings, readings), none, (nothing, nothing), nothing, 0.1, (sharp, sharp))


def evidence(one: Sensors, lags_s: Array) -> Array:
    """Return the evidence of one log for time constants, with the present weight."""
    vars(one).pop("_evidence", None)
    return np.array([one.log_evidence(lag_s, 0.0) for lag_s in lags_s])


def logged(seed: int) -> tuple[Array, Array, float]:
    """Return times and readings of a random log, and the sensor's time constant."""
    draw = np.random.default_rng([2026, seed])
    pieces = [np.full(round(draw.uniform(20.0, 60.0) / FINE_S), ROOM_C)]
    for _ in range(3):
        pieces += list(heated(draw, float(pieces[-1][-1])))
    wire = np.concatenate(pieces)
    if seed % 3 == 0:
        # A moving mean, twice: the rounding of a reference that a controller follows, and of no first-order lag.
        over = round(draw.uniform(2.0, 10.0) / FINE_S)
        for _ in range(2):
            wire = uniform_filter1d(wire, over, mode="nearest")
    lag_s = float(np.exp(draw.uniform(np.log(0.7), np.log(8.0)))) if seed % 2 else 0.0
    noise_c = np.exp(draw.uniform(np.log(0.02), np.log(0.4)))
    digit_c, every = draw.choice([0.01, 0.01, 0.1, 0.25]), int(draw.choice([25, 50]))
    read = behind(wire, lag_s)[int(draw.integers(every)) :: every]
    read = np.round((read + noise_c * draw.standard_normal(len(read))) / digit_c) * digit_c
    return np.arange(len(read)) * every * FINE_S, read, lag_s


def heated(draw: np.random.Generator, from_c: float) -> tuple[Array, Array, Array]:
    """Return a heating in one to five steps, its hold, and the natural cooling."""
    rate_c_s, rises = (
        np.exp(draw.uniform(np.log(0.2), np.log(6.0))),
        np.sort(draw.uniform(35.0, 78.0, draw.integers(1, 6))),
    )
    steps = []
    for top_c in rises:
        steps += [np.linspace(from_c, top_c, max(2, round((top_c - from_c) / rate_c_s / FINE_S)))]
        steps += [np.full(round(draw.uniform(5.0, 30.0) / FINE_S), top_c)]
        from_c = top_c
    cooling_s = draw.uniform(30.0, 70.0)
    after_s = np.arange(0.0, 4.0 * cooling_s, FINE_S)
    return np.concatenate(steps[:-1]), steps[-1], ROOM_C + (from_c - ROOM_C) * np.exp(-after_s / cooling_s)


if __name__ == "__main__":
    main()
