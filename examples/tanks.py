"""A nonlinear model of one's own, from a table to its missing effect: two tanks, the upper of which can overflow.

A pump fills the upper tank, which drains into the lower one; the level of the lower one is measured. The model knows no
overflow; candidates are an overflow into the lower tank, a leak, and a drift of the sensor.

Run: python examples/tanks.py, or: torsight missing examples/tanks.py record.csv --out results
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from torsight.discovery import Findings, Reading, candidate, find_missing, model_problem, parameter

Array = NDArray[np.float64]
TRUE = {"gain": 0.042, "upper": 0.055, "lower": 0.06, "spill": 0.3, "rim_cm": 10.0}
STEP_S, NOISE_CM = 4.0, 0.03

output = "level_cm"
initial = ("upper_0_cm", "lower_0_cm")
sigma = NOISE_CM
parameters = [
    parameter("gain", 0.05, lower=0.0, upper=1.0),
    parameter("upper", 0.05, lower=0.001, upper=1.0),
    parameter("lower", 0.05, lower=0.001, upper=1.0),
    parameter("upper_0_cm", 5.0, unit="cm", lower=0.0, upper=20.0),
    parameter("lower_0_cm", 5.0, unit="cm", lower=0.0, upper=20.0),
]
candidates = [
    candidate(
        "overflow",
        parameter("spill", 0.1, unit="1/s", lower=0.0, upper=1.0, null=0.0),
        parameter("rim_cm", 8.0, unit="cm", lower=4.0, upper=14.0),
    ),
    candidate("leak", parameter("leak", 0.001, unit="1/s", lower=0.0, upper=0.05, null=0.0)),
    candidate("sensor_drift", parameter("drift_cm", 0.1, unit="cm", lower=-5.0, upper=5.0, null=0.0)),
]


def predict(p: Any, record: Any) -> Array:
    """Return the lower level: the midpoint rule, one step per sample; the pump's voltage is held between samples."""
    above, below, out = p.upper_0_cm, p.lower_0_cm, []
    drift = p.drift_cm * record.time_s / record.time_s[-1]
    for volt in record.pump_v.tolist():
        out.append(below)
        up, down = _rates(p, volt, above, below)
        up, down = _rates(p, volt, above + 0.5 * STEP_S * up, below + 0.5 * STEP_S * down)
        above, below = max(above + STEP_S * up, 0.0), max(below + STEP_S * down, 0.0)
    return np.array(out) + drift


def _rates(p: Any, volt: float, above: float, below: float) -> tuple[float, float]:
    through, away = p.upper * max(above, 0.0) ** 0.5, p.lower * max(below, 0.0) ** 0.5
    spilled = p.spill * max(above - p.rim_cm, 0.0)
    return p.gain * volt - through - spilled - p.leak * above, through + spilled - away


def record_of(*, seed: int = 3, rows: int = 480) -> dict[str, Array]:
    """Return a simulated record, by SciPy's integrator with short steps."""
    rng = np.random.default_rng(seed)
    time = STEP_S * np.arange(rows)
    pump = np.repeat(rng.uniform(0.5, 5.5, rows // 16 + 1), 16)[:rows]

    def rhs(t: float, x: Array) -> list[float]:
        above, below = max(x[0], 0.0), max(x[1], 0.0)
        through = TRUE["upper"] * np.sqrt(above)
        spilled = TRUE["spill"] * max(above - TRUE["rim_cm"], 0.0)
        pumped = TRUE["gain"] * pump[min(int(t / STEP_S), rows - 1)]
        return [pumped - through - spilled, through + spilled - TRUE["lower"] * np.sqrt(below)]

    levels = solve_ivp(rhs, (0.0, time[-1]), [4.0, 3.0], t_eval=time, max_step=1.0, rtol=1e-6).y
    return {"time_s": time, "pump_v": pump, "level_cm": levels[1] + rng.normal(0.0, NOISE_CM, rows)}


def main() -> Findings:
    """Print the missing effect, and the error of the prediction of a later record."""
    reading = Reading(sigma=sigma)
    problem = model_problem(
        predict, record_of(), parameters, candidates, output=output, initial=initial, reading=reading
    )
    found = find_missing(problem)
    print(found)
    later = record_of(seed=8)
    off = found.predict(later)["level_cm"] - later["level_cm"]
    print(f"A later record is predicted to {np.sqrt(np.mean(off**2)):.3f} cm")
    return found


if __name__ == "__main__":
    main()
