"""``torsight simulate`` against the slow second implementation of the tests, on rigs and programmes drawn at random.

``python benchmarks/actuator/simulate_agreement.py OUT.jsonl [FIRST] [SEEDS]``

A seed draws geometry, moduli, transformation temperatures, stress influences, critical angle, pre-deformation, friction
(cases a and b), room temperature (some above M_f, some above A_s), the start angle (from mid-stroke to its end), the
log's rate, and a chain of full and partial heatings with holds and reheats. The log goes through the command as a file:
clean, with switches and without, and once more with noise of 0.1 °C. Without switches a reheat of a spring that had
cooled to the room is a new half-cycle, where the drawn programme has one. One line per seed is appended to OUT.jsonl.
"""

from __future__ import annotations

import json
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w
from seeds import lines_of

from torsight.actuator.spec import ActuatorSpec
from torsight.actuator.springs import Rig
from torsight.actuator.stepping.cycle import critical_angle, stable_cycle
from torsight.cli.simulate import simulate
from torsight.core.files.storage import read_table, write_table
from torsight.core.units import DEG, GPA, MM, MNM, MPA

sys.path.insert(0, str(Path(__file__).parents[2] / "tests" / "actuator"))
from actuator_oracle import Oracle, Values


def draw_rig(rng: np.random.Generator) -> dict[str, float]:
    """Return the public values of a rig in physical order."""
    e_m = rng.uniform(12.0, 32.0)
    a_s = rng.uniform(20.0, 55.0)
    a_f = a_s + rng.uniform(5.0, 25.0)
    m_s = a_s + rng.uniform(0.0, 0.7) * (a_f - a_s)
    return {
        "wire_diameter_mm": rng.uniform(0.3, 0.9),
        "wire_length_mm": rng.uniform(40.0, 120.0),
        "E_A_gpa": e_m * rng.uniform(1.8, 3.5),
        "E_M_gpa": e_m,
        "E_S_gpa": e_m * rng.uniform(0.12, 0.45),
        "A_s_c": a_s,
        "A_f_c": a_f,
        "M_s_c": m_s,
        "M_f_c": min(m_s, a_s) - rng.uniform(4.0, 16.0),
        "C_A_mpa_per_k": rng.uniform(15.0, 50.0),
        "C_M_mpa_per_k": rng.uniform(15.0, 50.0),
        "theta_cr_deg": rng.uniform(90.0, 260.0),
        "theta_p_deg": rng.uniform(700.0, 1500.0),
        "tau_c_mnm": 0.0,
    }


def with_friction(values: dict[str, float], rng: np.random.Generator) -> dict[str, float]:
    """Return the values with a friction that is a share of what the wound spring makes at mid-stroke."""
    rig = Rig.from_values(values)
    share = rng.choice([0.03, 0.1, 0.25, 0.6]) * rng.uniform(0.7, 1.4)
    return {**values, "tau_c_mnm": share * rig.loading_torque(0.5 * rig.theta_p_rad) / MNM}


def spring_temperature(
    rng: np.random.Generator, values: dict[str, float], shift_c: float, room_c: float, step_s: float, *, full: bool
) -> np.ndarray:
    """Return one half-cycle of the driven spring: ramps, holds, now and then a reheat, then natural cooling."""
    low, high = values["A_s_c"] + shift_c, values["A_f_c"] + 2.5 * shift_c
    peak = high + 8.0 if full else rng.uniform(low + 2.0, high)
    points = [(peak, rng.uniform(0.2, 1.5))]
    if rng.random() < 0.3:
        points = [(rng.uniform(low, peak), 0.8), (max(room_c, low - 12.0), 1.0), *points]
    parts, now = [], room_c
    for target, rate in points:
        count = max(2, int(abs(target - now) / rate / step_s))
        parts.append(np.linspace(now, target, count, endpoint=False))
        now = target
    parts.append(np.full(int(20.0 / step_s), now))
    time_s = np.arange(0.0, 240.0, step_s)
    parts.append(room_c + (now - room_c) * np.exp(-time_s / rng.uniform(15.0, 40.0)))
    return np.concatenate(parts)


def one(seed: int) -> dict[str, Any]:
    """Return the largest differences of a seed, in degrees."""
    rng = np.random.default_rng([seed, 27])
    values = with_friction(draw_rig(rng), rng)
    rig = Rig.from_values(values)
    room_c = float(
        rng.choice([rng.uniform(15.0, 25.0), values["M_f_c"] + 3.0, values["A_s_c"] + 2.0], p=[0.6, 0.2, 0.2])
    )
    step_s = float(rng.choice([1.0, 0.5, 0.25]))
    home = stable_cycle(rig).theta_1_rad - 0.5 * rig.theta_p_rad
    start_rad = home * float(rng.choice([1.0, rng.uniform(-0.3, 1.0)]))
    shift_c = rig.stress_per_torque * rig.loading_torque(0.5 * rig.theta_p_rad) / rig.c_austenite
    springs = [number % 2 for number in range(int(rng.integers(2, 5)))]
    temps = [spring_temperature(rng, values, shift_c, room_c, step_s, full=bool(rng.random() < 0.6)) for _ in springs]
    oracle = Oracle(
        Values(
            d_m=values["wire_diameter_mm"] * MM, length_m=values["wire_length_mm"] * MM, e_a=values["E_A_gpa"] * GPA,
            e_m=values["E_M_gpa"] * GPA, e_s=values["E_S_gpa"] * GPA, a_s=values["A_s_c"], a_f=values["A_f_c"],
            m_s=values["M_s_c"], m_f=values["M_f_c"], c_a=values["C_A_mpa_per_k"] * MPA,
            c_m=values["C_M_mpa_per_k"] * MPA, theta_cr=values["theta_cr_deg"] * DEG,
            theta_p=values["theta_p_deg"] * DEG, tau_c=values["tau_c_mnm"] * MNM,
        ),
        start_rad + 0.5 * rig.theta_p_rad,
    )  # fmt: skip
    expected = (
        np.concatenate([oracle.run(spring, own.tolist()) for spring, own in zip(springs, temps, strict=True)]) / DEG
    )
    columns = _columns(springs, temps, room_c, step_s)
    noise = 0.1 * np.random.default_rng([seed, 28]).standard_normal((2, len(expected)))
    noisy = {**columns, "temp_a_c": columns["temp_a_c"] + noise[0], "temp_b_c": columns["temp_b_c"] + noise[1]}
    bare = {name: columns[name] for name in ("time_s", "temp_a_c", "temp_b_c")}
    found = {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "actuator.toml").write_text(tomli_w.dumps(ActuatorSpec(values).to_tables()))
        for kind, log in (("switches", columns), ("bare", bare), ("noisy", noisy)):
            write_table(folder / "temps.csv", log)
            simulate(folder / "actuator.toml", folder / "temps.csv", start_angle=start_rad / DEG, out=folder / "a.csv")
            angle = read_table(folder / "a.csv", required=("angle_deg",))["angle_deg"].to_numpy(np.float64)
            found[f"{kind}_worst_deg"] = float(np.max(np.abs(angle - expected)))
            found[f"{kind}_rms_deg"] = float(np.sqrt(np.mean((angle - expected) ** 2)))
    case = "a" if stable_cycle(rig).theta_2_rad < critical_angle(rig) else "b"
    return {
        "seed": seed, "case": case, "rows": len(expected), "range_deg": float(np.ptp(expected)), "room_c": room_c,
        "room_above_M_f": room_c > values["M_f_c"], "room_above_A_s": room_c > values["A_s_c"], **found,
    }  # fmt: skip


def _columns(springs: list[int], temps: list[np.ndarray], room_c: float, step_s: float) -> dict[str, np.ndarray]:
    count = sum(map(len, temps))
    own = [np.full(count, room_c), np.full(count, room_c)]
    heat = [np.zeros(count, np.int64), np.zeros(count, np.int64)]
    place = 0
    for spring, temp in zip(springs, temps, strict=True):
        own[spring][place : place + len(temp)] = temp
        heat[spring][place : place + len(temp) - int(240.0 / step_s)] = 1
        place += len(temp)
    return {
        "time_s": step_s * np.arange(count), "temp_a_c": own[0], "temp_b_c": own[1], "heat_a": heat[0],
        "heat_b": heat[1],
    }  # fmt: skip


def main() -> None:
    """Compare the seeds that are not in the file yet and print quantiles over all that were asked for."""
    known = lines_of(one, about=__doc__, usual=40)
    table = {
        name: {f"{100 * q:g} %": float(np.quantile([line[name] for line in known], q)) for q in (0.5, 0.9, 1.0)}
        for name in known[0]
        if name.endswith("_deg")
    }
    print(json.dumps({"rigs": len(known), "case_b": sum(line["case"] == "b" for line in known), **table}, indent=2))


if __name__ == "__main__":
    main()
