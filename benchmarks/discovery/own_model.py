"""How long a discovery takes on models in plain Python of 6 ms and of 40 ms per call.

    python benchmarks/discovery/own_model.py

Two tanks in a row behind a pump, stepped by a plain loop; the record is made by SciPy's solver. In one the second tank
runs over, which is among the candidates; in the other its pipe narrows with the level, which is not, so that the law at
the port has to say it. Base values are four, candidates four, drivers three and a port. Then a heater in its case, a
right-hand side that SciPy integrates, on two records: it loses heat by radiation, too. The search compiles
these three. Then both pairs of tanks as objects of a class, which numba refuses: they are called in processes. Wanted
on two cores that do nothing else: under 15 s where the search compiles, under a minute where it cannot.
"""

from __future__ import annotations

import argparse
import math
import os
import time
from dataclasses import replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from torsight.discovery import Reading, Solver, candidate, find_missing, law, model_problem, ode, parameter
from torsight.discovery.own.model.problem import ModelProblem
from torsight.discovery.own.model.values import Values
from torsight.discovery.own.own_records import Record

Array = NDArray[np.float64]
_TRUTH: Final = {"pump": 0.09, "out_1": 0.05, "out_2": 0.045, "offset_v": 0.1, "brim": 5.5, "over": 0.5}
_TANKS: Final = ("overflow", "narrow_pipe")
_OBJECTS: Final = " of objects"
_CASES: Final = (*_TANKS, "radiation", *(f"{one}{_OBJECTS}" for one in _TANKS))
_NOISE_V: Final = 0.02


def pump_voltage(time_s: Array) -> Array:
    """Return the pump's voltage (n,): a sum of slow waves, never below zero."""
    return np.maximum(0.0, 2.6 + 1.4 * np.sin(time_s / 55.0) + 1.0 * np.sin(time_s / 23.0 + 1.0))


def record(missing: str, *, rows: int, seed: int = 3) -> dict[str, Array]:
    """Return a record by SciPy's solver: time, what drives, level of the second tank with noise."""
    time_s = np.arange(float(rows))
    true = _TRUTH
    over = true["over"] if missing == "overflow" else 0.0
    narrow = 0.02 if missing == "narrow_pipe" else 0.0

    def rhs(t: float, x: Array) -> list[float]:
        between = true["out_1"] * math.sqrt(max(x[0], 0.0))
        out = true["out_2"] * math.sqrt(max(x[1], 0.0)) + over * max(x[1] - true["brim"], 0.0)
        out -= narrow * math.exp(-((x[1] - 4.0) ** 2))
        return [true["pump"] * float(pump_voltage(np.array([t]))[0]) / 2.0 - between, between - out]

    found = solve_ivp(rhs, (0.0, time_s[-1]), [4.0, 4.0], t_eval=time_s, rtol=1e-8, atol=1e-8, max_step=5.0)
    noise = np.random.default_rng(seed).normal(0.0, _NOISE_V, rows)
    return {
        "time_s": time_s,
        "pump_v": pump_voltage(time_s),
        "room_c": 21.0 + np.sin(time_s / 400.0),
        "valve": np.sin(time_s / 31.0),
        "level_v": found.y[1] + true["offset_v"] + noise,
    }


def levels(p: Any, record: Any) -> Array:
    """Return the level (n,) of the second tank: the midpoint rule, one step per row, the pump as at its middle."""
    time_s, drive = record.time_s.tolist(), record.pump_v.tolist()
    high, low, found = 4.0, 4.0, [4.0]
    for k in range(1, len(time_s)):
        step, voltage = time_s[k] - time_s[k - 1], 0.5 * (drive[k - 1] + drive[k])
        flow = 0.5 * p.pump * voltage * (1.0 - p.weaker * voltage)
        up, down = _rates(p, flow, high, low)
        up, down = _rates(p, flow, high + 0.5 * step * up, low + 0.5 * step * down)
        high, low = high + step * up, low + step * down
        found.append(low)
    return np.array(found) + p.offset_v + p.warm * (record.room_c - 21.0)


def _rates(p: Any, flow: float, high: float, low: float) -> tuple[float, float]:
    between = p.out_1 * math.sqrt(max(high, 0.0))
    out = p.out_2 * math.sqrt(max(low, 0.0)) + p.leak * low + p.over * max(low - p.brim, 0.0) + p.pipe(low)
    return flow - between, between - out


class Tank:
    """A tank by its level."""

    def __init__(self, level: float) -> None:
        self.level = level

    def outflow(self, coefficient: float) -> float:
        """Return what flows out."""
        return coefficient * math.sqrt(max(self.level, 0.0))


def levels_of_objects(p: Any, record: Any) -> Array:
    """Return the same as :func:`levels`, by objects."""
    time_s, drive = record.time_s.tolist(), record.pump_v.tolist()
    tanks, found = {"high": Tank(4.0), "low": Tank(4.0)}, [4.0]
    for k in range(1, len(time_s)):
        step, voltage = time_s[k] - time_s[k - 1], 0.5 * (drive[k - 1] + drive[k])
        flow = 0.5 * p.pump * voltage * (1.0 - p.weaker * voltage)
        before = {name: tank.level for name, tank in tanks.items()}
        for share in (0.5, 1.0):
            low = tanks["low"].level
            between, out = tanks["high"].outflow(p.out_1), tanks["low"].outflow(p.out_2) + p.leak * low
            out += p.over * max(low - p.brim, 0.0) + p.pipe(low)
            tanks["high"].level = before["high"] + share * step * (flow - between)
            tanks["low"].level = before["low"] + share * step * (between - out)
        found.append(tanks["low"].level)
    return np.array(found) + p.offset_v + p.warm * (record.room_c - 21.0)


def problem(missing: str, rows: int, predict: Any = levels) -> ModelProblem:
    """Return the model before the engine."""
    return model_problem(
        predict,
        record(missing, rows=rows),
        [
            parameter("pump", 0.08, lower=0.01, upper=0.5),
            parameter("out_1", 0.06, lower=0.005, upper=0.5),
            parameter("out_2", 0.04, lower=0.005, upper=0.5),
            parameter("offset_v", 0.0, lower=-2.0, upper=2.0),
        ],
        [
            candidate("overflow", parameter("over", 0.2, null=0.0, lower=0.0, upper=5.0),
                      parameter("brim", 5.0, lower=3.0, upper=9.0)),
            candidate("leak", parameter("leak", 0.002, null=0.0, lower=0.0, upper=0.1)),
            candidate("weaker_pump", parameter("weaker", 0.02, null=0.0, lower=-0.1, upper=0.1)),
            candidate("warm_sensor", parameter("warm", 0.02, null=0.0)),
            law("pipe", driver="level"),
        ],
        output="level_v",
        reading=Reading(sigma=_NOISE_V),
    )  # fmt: skip


def heat_lost(hot_c: float, room_c: float, p: Any) -> float:
    """Return the heat in W that a heater loses to the room."""
    return p.loss * (hot_c - room_c) + p.radiation * 1e-9 * ((hot_c + 273.15) ** 4 - (room_c + 273.15) ** 4)


def heater(_t: float, x: Any, u: Any, p: Any) -> tuple[float, float]:
    """Return the rates of change in K/s of the heater's temperature and of its case's."""
    through = p.couple * (x[0] - x[1])
    return (p.power * u.duty - heat_lost(x[0], u.room_c, p) - through) / 50.0, through / 80.0


def heater_problem(rows: int) -> ModelProblem:
    """Return a heater that radiates, on two records."""
    truth = Values({"power": 60.0, "loss": 0.3, "couple": 0.2, "radiation": 2.0, "hot_0": 25.0, "case_0": 22.0})
    model = ode(
        heater,
        states=("hot", "case"),
        output=lambda x, _record, _p: x.hot,
        inputs=("duty", "room_c"),
        initial={"hot": "hot_0", "case": "case_0"},
    )
    records = []
    for seed in (1, 2):
        rng, time_s = np.random.default_rng(seed), 2.0 * np.arange(float(rows))
        duty = np.repeat(rng.uniform(0.0, 1.0, rows // 30 + 1), 30)[:rows]
        inputs = {"time_s": time_s, "duty": duty, "room_c": 20.0 + np.sin(time_s / 300.0)}
        hot_c = replace(model, solver=Solver("DOP853", 1e-9))(truth, Record(inputs, "heater"))
        records.append({**inputs, "temp_c": hot_c + rng.normal(0.0, 0.1, rows)})
    return model_problem(
        model,
        records,
        [
            parameter("power", 40.0, lower=1.0, upper=200.0),
            parameter("loss", 0.5, lower=0.01, upper=5.0),
            parameter("couple", 0.1, lower=0.001, upper=5.0),
            parameter("hot_0", 24.0, lower=0.0, upper=60.0),
            parameter("case_0", 24.0, lower=0.0, upper=60.0),
        ],
        [candidate("radiation", parameter("radiation", 1.0, null=0.0, lower=0.0, upper=20.0))],
        output="temp_c",
        initial=["hot_0", "case_0"],
        reading=Reading(sigma=0.1),
    )


def main() -> None:
    """Print the time and the calls."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rows", type=int, default=1600)
    parser.add_argument("--cases", nargs="+", choices=_CASES, default=list(_CASES))
    given = parser.parse_args()
    print(f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f} at the start")
    for case in given.cases:
        missing, predict = case.removesuffix(_OBJECTS), levels_of_objects if case.endswith(_OBJECTS) else levels
        asked = heater_problem(given.rows) if missing == "radiation" else problem(missing, given.rows, predict)
        began_s, began_cpu_s = time.perf_counter(), time.process_time()
        found = find_missing(asked)
        took_s, cpu_s = time.perf_counter() - began_s, time.process_time() - began_cpu_s
        model_s = found.problem.evaluator.seconds
        print(f"{case}: {took_s:.1f} s; {cpu_s:.1f} s of this process, {found.calls} calls that took {model_s:.1f} s")
        print(f"  {found.verdict}, {', '.join(found.effects) or '-'}")


if __name__ == "__main__":
    main()
