"""Logs that are too slow for the pulses of a heater: error of later records, and coverage of their intervals.

Run: python benchmarks/actuator/pulsed_heaters.py [--seeds 4]

Wires of one time constant are heated along ramps by a heater that is switched on and off every 0.6 to 3 s (duty from a
controller that looks once a pulse), and cool by themselves: 50 rows a second, without noise, drive the model to the
true angle. Logs of 2 to 20 readings a second, with noise and a last digit of 0.1 °C, predict it. Rows: readings a
second; the same without pulses; four a second with half and twice the stretch over which a scatter is measured.
Columns: rms error of the angle in motion, its median standard deviation, share of the instants in motion within 95 %.
"""

from __future__ import annotations

import argparse
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray

from torsight.actuator import ActuatorModel, reference_spec
from torsight.actuator.doubt import Doubt
from torsight.actuator.fitted import FittedModel
from torsight.actuator.record import conditioning, ripple
from torsight.core.parameter import REACH
from torsight.core.records import TemperatureLog
from torsight.core.series import rms
from torsight.core.units import DEG
from torsight.discovery.prediction import predict_with_sigma

Array = NDArray[np.float64]
STEP_S = 0.02
ROOM_C = 23.0
START_DEG = 177.6
LEFT_DEG = 0.1
"""What the model leaves; its values are known."""


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=4)
    options = parser.parse_args()
    print("readings a second       rms °   sigma °   within")
    for rate_hz in (2.0, 4.0, 10.0, 20.0):
        show(f"{rate_hz:.0f}", [measured(seed, rate_hz) for seed in range(options.seeds)])
        with patch.object(conditioning, "ripple_peaks", lambda time_s, *_: np.zeros(len(time_s))):
            show(f"{rate_hz:.0f}, as noise", [measured(seed, rate_hz) for seed in range(options.seeds)])
    show("4, no pulses", [measured(seed, 4.0, pulsed=False) for seed in range(options.seeds)])
    for factor in (0.5, 2.0):
        with patch.object(ripple, "OVER_S", factor * ripple.OVER_S):
            show(f"4, stretch × {factor}", [measured(seed, 4.0) for seed in range(options.seeds)])


def show(name: str, found: list[tuple[Array, Array]]) -> None:
    """Print one row."""
    error, sigma = (np.concatenate(parts) for parts in zip(*found, strict=True))
    within = np.mean(np.abs(error) <= REACH * sigma)
    print(f"{name:20s}   {rms(error):6.2f}    {np.median(sigma):6.2f}   {100 * within:5.0f} %", flush=True)


def measured(seed: int, rate_hz: float, *, pulsed: bool = True) -> tuple[Array, Array]:
    """Return the angle's error and its standard deviation (n,) at the instants of a log in motion, degrees."""
    rng = np.random.default_rng(seed)
    time_s, wires = programme(rng, pulsed=pulsed)
    model = ActuatorModel(reference_spec())
    fitted = FittedModel(model, model.nominal(), doubt=Doubt((), np.zeros((0, 0)), LEFT_DEG))
    true = fitted.predict(TemperatureLog(time_s, *wires), start_angle_rad=START_DEG * DEG).angle_rad / DEG
    log_s = np.arange(rng.uniform(0.0, 1.0 / rate_hz), time_s[-1], 1.0 / rate_hz)
    noise = (0.05 * rng.standard_normal(len(log_s)) for _ in wires)
    read = [np.round((np.interp(log_s, time_s, c) + n) / 0.1) * 0.1 for c, n in zip(wires, noise, strict=True)]
    later = predict_with_sigma(fitted, TemperatureLog(log_s, *read), start_angle_rad=START_DEG * DEG)
    at_log = np.interp(log_s, time_s, true)
    moving = np.abs(np.gradient(at_log, log_s)) > 0.05
    return (later.angle_rad / DEG - at_log)[moving], (later.sigma_rad / DEG)[moving]


def programme(rng: np.random.Generator, *, pulsed: bool) -> tuple[Array, list[Array]]:
    """Return rows and both wires' temperatures: four half-cycles, each heated at its own rate, held and let cool."""
    time_s = np.arange(0.0, 1600.0, STEP_S)
    wires = [np.full(len(time_s), ROOM_C), np.full(len(time_s), ROOM_C)]
    for number in range(4):
        rate, top_c, tau_s, hold_s = (
            rng.uniform(0.2, 0.6),
            rng.uniform(58.0, 80.0),
            rng.uniform(30, 50),
            rng.uniform(2, 15),
        )
        every = round(rng.uniform(0.6, 3.0) / STEP_S) if pulsed else 1
        full_c_s = 1.5 * (rate + (top_c - ROOM_C) / tau_s)
        begin, own, temp_c, duty = round((400.0 * number + 20.0) / STEP_S), wires[number % 2], ROOM_C, 0.0
        last = begin + round(((top_c - ROOM_C) / rate + hold_s) / STEP_S)
        for k in range(begin, round(400.0 * (number + 1) / STEP_S)):
            if k < last and (k - begin) % every == 0:
                wanted_c = min(ROOM_C + rate * (k - begin + every) * STEP_S, top_c)
                lost_c_s = (temp_c - ROOM_C) / tau_s
                duty = float(np.clip(((wanted_c - temp_c) / (every * STEP_S) + lost_c_s) / full_c_s, 0.0, 1.0))
            on = (k - begin) % every < duty * every if pulsed else duty
            temp_c += STEP_S * (full_c_s * on * (k < last) - (temp_c - ROOM_C) / tau_s)
            own[k] = temp_c
    return time_s, wires


if __name__ == "__main__":
    main()
