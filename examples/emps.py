"""The missing part of a linear drive's model: the discovery engine on measured data unrelated to springs.

The EMPS benchmark (Janot, Gautier and Brunot, 2019) is a screw-driven carriage. Its reference model says
force = M a + Fv v + Fc sign(v) + offset, which leaves a relative error of 4.08 %. This script finds what is missing,
and both models then predict a second record that was not fitted. Finally the friction over speed is measured as a
curve, without an assumed form.

Run: python examples/emps.py ../shared/data/emps
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.io import loadmat
from scipy.signal import butter, decimate, filtfilt

from torsight.discovery import (
    Findings,
    LinearProblem,
    Reading,
    find_missing,
    law,
    linear_problem,
    model_problem,
    parameter,
)
from torsight.discovery.inference.explanation import Explanation

Array = NDArray[np.float64]
RATE_HZ = 1000.0
BASE = ("mass_kg", "viscous_n_s_per_m", "coulomb_n", "offset_n")
CANDIDATES = {
    "friction_by_direction": ("viscous_asymmetry_n_s_per_m",),
    "quadratic_drag": ("drag_n_s2_per_m2",),
    "stribeck": ("stribeck_n",),
    "spring": ("stiffness_n_per_m",),
    "friction_by_position": ("coulomb_slope_n_per_m",),
    "cogging": ("cogging_sine_n", "cogging_cosine_n"),
    "coulomb_drift": ("coulomb_drift_n",),
    "viscous_drift": ("viscous_drift_n_s_per_m",),
}


@dataclass(frozen=True)
class Drive:
    """One record: force in N and the columns of every parameter at 100 Hz, time in s, stroke number."""

    time_s: Array
    force_n: Array
    columns: Mapping[str, Array]
    stroke: NDArray[np.int64]


def read_drive(path: Path) -> Drive:
    """Read a record: speed and acceleration from the position, filtered both ways; 100 samples a second."""
    content = {name: values.ravel() for name, values in loadmat(path).items() if not name.startswith("__")}
    low_pass = butter(4, 150.0 / (0.5 * RATE_HZ))
    position = filtfilt(*low_pass, content["qm"])
    speed = np.gradient(position, 1.0 / RATE_HZ)
    sign = np.sign(speed)
    share = np.linspace(0.0, 1.0, len(speed))
    pitch_m = 0.05
    full = {
        "mass_kg": np.gradient(speed, 1.0 / RATE_HZ),
        "viscous_n_s_per_m": speed,
        "coulomb_n": sign,
        "offset_n": np.ones_like(speed),
        "viscous_asymmetry_n_s_per_m": np.abs(speed),
        "drag_n_s2_per_m2": speed * np.abs(speed),
        "stribeck_n": sign * np.exp(-np.abs(speed) / 0.02),
        "stiffness_n_per_m": position,
        "coulomb_slope_n_per_m": sign * position,
        "cogging_sine_n": np.sin(2.0 * np.pi * position / pitch_m),
        "cogging_cosine_n": np.cos(2.0 * np.pi * position / pitch_m),
        "coulomb_drift_n": sign * share,
        "viscous_drift_n_s_per_m": speed * share,
        "force": float(content["gtau"][0]) * content["vir"],
        "reference": content["qg"],
    }
    slow = {name: decimate(column[50:-50], 10, ftype="fir", zero_phase=True) for name, column in full.items()}
    turns = np.abs(np.diff(np.sign(np.gradient(slow["reference"])))) > 1.0
    return Drive(
        time_s=content["t"][50:-50:10],
        force_n=slow["force"],
        columns={name: slow[name] for name in (*BASE, *(key for keys in CANDIDATES.values() for key in keys))},
        stroke=np.concatenate([[0], np.cumsum(turns)]),
    )


def problem_of(drive: Drive) -> LinearProblem:
    """Return the record as a problem for the engine; whole strokes are held out."""
    columns = drive.columns
    return linear_problem(
        drive.force_n,
        {name: columns[name] for name in BASE},
        {effect: {name: columns[name] for name in names} for effect, names in CANDIDATES.items()},
        time_s=drive.time_s,
        block=np.minimum(drive.stroke, drive.stroke.max()),
        drivers={"speed": columns["viscous_n_s_per_m"], "direction": columns["coulomb_n"]},
        sigma=0.0,
    )


def relative_error(drive: Drive, explanation: Explanation) -> float:
    """Return the norm of the error over the norm of the force, as the benchmark does."""
    problem = problem_of(drive).with_laws([item.form for item in explanation.laws])
    predicted = problem.predict(explanation.fit.values, explanation.members)
    return float(np.linalg.norm(drive.force_n - predicted) / np.linalg.norm(drive.force_n))


def discover_drive(folder: Path) -> tuple[Findings, Drive, Drive]:
    """Return the findings on the first record, and both records."""
    record, later = read_drive(folder / "DATA_EMPS.mat"), read_drive(folder / "DATA_EMPS_PULSES.mat")
    return find_missing(problem_of(record)), record, later


def table_of(drive: Drive) -> dict[str, Array]:
    """Return a record as a table for a model of one's own."""
    columns = drive.columns
    return {
        "time_s": drive.time_s,
        "force_n": drive.force_n,
        "acceleration": columns["mass_kg"],
        "speed": columns["viscous_n_s_per_m"],
        "direction": columns["coulomb_n"],
        "stroke": drive.stroke.astype(np.float64),
    }


def drive_force(p: Any, record: Any) -> Array:
    """Return the reference model's force plus a law of speed for the remaining friction."""
    plain = p.mass_kg * record.acceleration + p.viscous_n_s_per_m * record.speed + p.coulomb_n * record.direction
    return plain + p.offset_n + p.friction_n(record.speed)


def measure_friction(drive: Drive) -> Findings:
    """Return the findings where only a port and its driver are offered, no form."""
    starts = {"mass_kg": 90.0, "viscous_n_s_per_m": 200.0, "coulomb_n": 20.0, "offset_n": 0.0}
    problem = model_problem(
        drive_force,
        table_of(drive),
        [parameter(name, start) for name, start in starts.items()],
        [law("friction_n", driver="speed", unit="N", driver_unit="m/s")],
        output="force_n",
        drivers=[],
        reading=Reading(blocks="stroke"),
    )
    return find_missing(problem)


def main(folder: Path) -> None:
    """Print the missing effects and the relative errors of the models without and with them."""
    findings, record, later = discover_drive(folder)
    field, chosen = findings.field, findings.decision.chosen
    single = next(one for one in findings.ranked(1) if one.effects)
    print("Plain model      ", ", ".join(f"{name} {value:.4g}" for name, value in field.base.fit.values.items()))
    print(f"Verdict           {findings.verdict}: {', '.join(chosen.members) or 'nothing'}")
    for title, one in (("base", field.base), (single.members[0], single), ("all that is told", chosen)):
        errors = f"{100 * relative_error(record, one):.2f} %, second record {100 * relative_error(later, one):.2f} %"
        print(f"Relative error    {errors} ({title})")
    measured = measure_friction(record)
    print(measured)
    for title, one in (("first", record), ("second", later)):
        left = one.force_n - measured.predict(table_of(one))["force_n"]
        print(
            f"With the law      {100 * np.linalg.norm(left) / np.linalg.norm(one.force_n):.2f} % on the {title} record"
        )
    for curve in measured.laws:
        for speed, force, sigma in zip(curve.nodes, curve.values, curve.sigma, strict=True):
            print(f"  {speed:7.3f} m/s  {force:6.2f} ± {sigma:.2f} N")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "../shared/data/emps"))
