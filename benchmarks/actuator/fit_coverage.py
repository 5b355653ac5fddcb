"""Coverage of the fit's intervals: records of the synthetic rig, which has an integrator of its own.

``python benchmarks/actuator/fit_coverage.py OUT.jsonl [FIRST] [SEEDS]``

A seed draws the rig's true values around the declared ones (which are the fit's priors), the protocol (full and partial
heatings, holds, one spring twice, the pace), the rate of the record (4 to 66 Hz), the noise of temperature (0.1 to
0.3 °C) and angle. One line per seed is appended to OUT.jsonl; seeds that the file already holds are skipped, so that an
interrupted run can be continued; the table of all seeds in the file is printed at the end. Seeds from 10,000 on are for
the report.
"""

from __future__ import annotations

import json
import time
from typing import Any

import numpy as np
from seeds import lines_of

from torsight.actuator import fit_model
from torsight.actuator.model import ActuatorModel
from torsight.actuator.spec import ActuatorSpec
from torsight.synthetic.experiment import make_record
from torsight.synthetic.scene import scene_from


def content_of(seed: int) -> tuple[dict[str, Any], dict[str, float]]:
    """Return the scene of a seed, and rate (Hz) and angle noise (°) of its record."""
    rng = np.random.default_rng([seed, 6])
    pace = float(np.exp(rng.uniform(np.log(0.25), np.log(1.0))))
    halves = []
    for number in range(int(rng.integers(3, 7))):
        heat_s = float(rng.uniform(250.0, 600.0))
        full = float(rng.uniform(78.0, 90.0))
        part = float(rng.uniform(54.0, 66.0))
        spring = "b" if halves and halves[-1]["spring"] == "a" else "a"
        half: dict[str, Any] = {"spring": spring, "heat_s": heat_s, "cool_s": float(rng.uniform(200, 320))}
        kind = "full" if number < 2 else str(rng.choice(["full", "partial", "hold", "again"]))
        if kind == "hold":
            half["points"] = [[0.3 * heat_s, part], [0.5 * heat_s, part], [0.9 * heat_s, full]]
        else:
            half |= {"peak_c": part if kind == "partial" else full, "ramp_s": heat_s * float(rng.uniform(0.5, 0.95))}
        if kind == "again" and halves[-1]["spring"] != halves[-2]["spring"]:
            half["spring"] = halves[-1]["spring"]
        halves.append(half)
    content = {
        "seed": seed,
        "protocol": {"time_factor": pace, "half_cycle": halves},
        "sensor": {"noise_c": float(rng.uniform(0.1, 0.3)), "quantum_c": 0.01},
    }
    rate_hz = float(rng.choice([4.0, 10.0, 25.0, 66.0]))
    return content, {"rate_hz": rate_hz, "sigma_deg": float(rng.uniform(0.03, 0.3))}


def one(seed: int) -> dict[str, Any]:
    """Return what a seed's fit says and whether each interval holds."""
    content, record = content_of(seed)
    scene = scene_from(content, seed=seed)
    made = make_record(scene, rate_hz=record["rate_hz"], sigma_deg=record["sigma_deg"])
    model = ActuatorModel(ActuatorSpec(scene.declared.flat(), dict(scene.declared.uncertainty)))
    start = time.thread_time()
    drive = model.prepare(made.table)
    prepared = time.thread_time()
    result = fit_model(model, drive)
    ended = time.thread_time()
    true = scene.values.public
    values = {}
    for name in scene.declared.uncertainty:
        estimate = result.estimates[name]
        low, high = estimate.ci95
        prior = scene.declared.uncertainty[name]
        values[name] = {
            "inside": bool(low <= true[name] <= high),
            "sigmas": (estimate.value - true[name]) / estimate.sigma,
            "posterior_over_prior": estimate.sigma / prior,
            "error": estimate.value - true[name],
        }
    return {
        "seed": seed,
        **record,
        "noise_c": content["sensor"]["noise_c"],
        "pace": content["protocol"]["time_factor"],
        "rows": len(made.table.time_s),
        "rmse_deg": result.rmse_deg,
        "correlation_rows": result.correlation_rows,
        "variance_ratio": result.variance_ratio,
        "tau_c_relative": result.values["tau_c_mnm"] / true["tau_c_mnm"] - 1.0,
        "converged": result.converged,
        "prepare_s": prepared - start,
        "fit_s": ended - prepared,
        "values": values,
    }


def table(lines: list[dict[str, Any]]) -> dict[str, Any]:
    """Return coverage, error in sigmas and gain over the prior of every value."""
    names = list(lines[0]["values"])
    rows = {}
    for name in names:
        entries = [line["values"][name] for line in lines]
        rows[name] = {
            "coverage": float(np.mean([entry["inside"] for entry in entries])),
            "rms_in_sigmas": float(np.sqrt(np.mean([entry["sigmas"] ** 2 for entry in entries]))),
            "mean_in_sigmas": float(np.mean([entry["sigmas"] for entry in entries])),
            "posterior_over_prior": float(np.median([entry["posterior_over_prior"] for entry in entries])),
        }
    relative = np.abs([line["tau_c_relative"] for line in lines])
    return {
        "records": len(lines),
        "converged": sum(line["converged"] for line in lines),
        "rmse_deg_median": float(np.median([line["rmse_deg"] for line in lines])),
        "tau_c_error_percent": {
            "median": 100.0 * float(np.median(relative)),
            "worst": 100.0 * float(relative.max()),
        },
        "fit_s": {
            "median": float(np.median([line["fit_s"] for line in lines])),
            "worst": float(max(line["fit_s"] for line in lines)),
        },
        "prepare_s_worst": float(max(line["prepare_s"] for line in lines)),
        "values": rows,
    }


def main() -> None:
    """Fit the seeds that are not in the file yet and print the table."""
    print(json.dumps(table(lines_of(one, about=__doc__)), indent=2))


if __name__ == "__main__":
    main()
