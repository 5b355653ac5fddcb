"""The friction torque from an angle, a temperature log on another computer's clock, and the characterised values.

Run: python examples/fit_friction.py angle.csv temps.csv actuator.toml
"""

from __future__ import annotations

import sys
from pathlib import Path

from sync import find_clock, merge, read_temperature_log
from torsight.actuator import ActuatorModel, FitResult, fit_model, read_actuator
from torsight.core import ClockMap, read_angles


def fit_record(angle: Path, temperature: Path, actuator: Path) -> tuple[ClockMap, FitResult]:
    """Return the clock that was found and the fit on the merged record."""
    angles = read_angles(angle)
    found = find_clock(angles, read_temperature_log(temperature))
    model = ActuatorModel(read_actuator(actuator))
    drive = model.prepare(merge(angles, found.reading.log, found.clock))
    return found.clock, fit_model(model, drive)


def main(angle: Path, temperature: Path, actuator: Path) -> tuple[ClockMap, FitResult]:
    """Print offset and friction torque with their intervals."""
    clock, result = fit_record(angle, temperature, actuator)
    print(f"offset {clock.offset_s:.2f} s, 95 %: {clock.offset_ci95_s[0]:.2f} to {clock.offset_ci95_s[1]:.2f}")
    for name, estimate in result.estimates.items():
        print(f"{name:15s} {estimate.value:9.3f} ± {estimate.sigma:.3f} {estimate.unit}")
    print(f"error of the plain model {result.rmse_deg:.2f}° rms")
    return clock, result


if __name__ == "__main__":
    main(*(Path(word) for word in sys.argv[1:]))
