"""The discovery engine, which knows nothing of springs, on a model of one's own.

A carriage on a screw: force = mass · acceleration + viscous · speed + coulomb · sign(speed) + offset. The carriage of
this script also has a friction that changes along the screw, which its model lacks. Each candidate is given by its name
and the columns that it would add; the engine names the missing one, and the improvement of the prediction on held-out
strokes. For a model that is not linear in its parameters see ``torsight.discovery.model_problem``.

Run: python examples/own_model.py
"""

from __future__ import annotations

import numpy as np

from torsight.discovery import Findings, LinearProblem, find_missing, linear_problem

TRUE = {"mass_kg": 95.0, "viscous_n_s_per_m": 200.0, "coulomb_n": 20.0, "offset_n": -3.0, "slope_n_per_m": 60.0}


def carriage(*, seed: int = 4, strokes: int = 8) -> LinearProblem:
    """Return the problem of strokes back and forth at several speeds, with noise."""
    rng = np.random.default_rng(seed)
    share = np.linspace(0.0, 1.0, 150, endpoint=False)
    time_s, position_m, stroke = [], [], []
    start_s = 0.0
    for number in range(strokes):
        length_s = float(rng.uniform(1.0, 3.0))
        way = 0.1 * (1.0 - np.cos(np.pi * share))
        time_s.append(start_s + length_s * share)
        position_m.append(way if number % 2 == 0 else 0.2 - way)
        stroke.append(np.full(len(share), number))
        start_s += length_s
    t, x, block = np.concatenate(time_s), np.concatenate(position_m), np.concatenate(stroke)
    speed = np.gradient(x, t)
    sign = np.sign(speed)
    base = {
        "mass_kg": np.gradient(speed, t),
        "viscous_n_s_per_m": speed,
        "coulomb_n": sign,
        "offset_n": np.ones_like(t),
    }
    candidates = {
        "friction_along_screw": {"slope_n_per_m": sign * (x - 0.1)},
        "quadratic_drag": {"drag_n_s2_per_m2": sign * speed**2},
        "spring": {"stiffness_n_per_m": x - 0.1},
        "drift": {"drift_n_per_s": t - t.mean()},
    }
    columns = base | candidates["friction_along_screw"]
    force_n = sum(TRUE[name] * column for name, column in columns.items()) + rng.normal(0.0, 0.5, len(t))
    drivers = {"position": x, "speed": speed, "direction": sign}
    return linear_problem(force_n, base, candidates, time_s=t, block=block, drivers=drivers, sigma=0.5)


def main() -> Findings:
    """Print what is missing, its size and the error on held-out strokes."""
    findings = find_missing(carriage())
    chosen = findings.decision.chosen
    print(f"{findings.verdict}: {', '.join(chosen.effects) or 'nothing'}")
    for name, value in chosen.fit.values.items():
        print(f"  {name:20s} {value:8.2f}   true {TRUE.get(name, 0.0):8.2f}")
    if findings.before is not None and findings.after is not None:
        print(f"error on held-out strokes {findings.before.rms:.2f} N before, {findings.after.rms:.2f} N after")
    return findings


if __name__ == "__main__":
    main()
