"""The paper's figures on the reference rig, and its numbers beside ours.

The tables of the paper are lost; the reference rig was chosen to satisfy every number in its text. Figures 9 to 12 are
drawn from logs that the model makes with the scatter that the paper reports, and are characterised like measured ones.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from torsight.actuator.characterisation import Characterisation, blocked_force, characterise
from torsight.actuator.closed_form import stable_cycle
from torsight.actuator.drive import Drive
from torsight.actuator.figures import (
    Line,
    characterisation_figures,
    draw,
    stiffness_figure,
    strain_figure,
    torque_figure,
)
from torsight.actuator.model import ActuatorModel, Simulation
from torsight.actuator.phase import HEATING_LAWS
from torsight.actuator.spec import REFERENCE_VALUES, ActuatorSpec, reference_spec
from torsight.actuator.spring_tests import LARGE_RANGE_DEG, Block, ForceAngle, Recovery, SpringTests
from torsight.actuator.springs import Rig
from torsight.core.records import TemperatureLog
from torsight.core.storage import write_json, write_table
from torsight.core.units import DEG, MM, MNM, MPA

Array = NDArray[np.float64]

SCATTER: Final[Mapping[str, float]] = {
    "recovery_deg": 9.5752, "small_n": 0.0105, "large_n": 0.0113, "heating_n": 0.0227, "cooling_n": 0.0125,
}  # fmt: skip
"""Root mean square errors that the paper reports for figures 9 to 12."""
CASE_B_TAU_C_MNM: Final = 2.6
"""A friction at which the reference rig is in case (b)."""
_ROOM_C: Final = 23.0
_HOT_C: Final = 76.0
_STEP_S: Final = 0.25
_BLOCK_DEG: Final = 85.0
_LEVER_MM: Final = 26.4
_WARMING: Final = 0.1


@dataclass(frozen=True, slots=True, eq=False)
class Played:
    """One cycle of the paper's programme on the reference rig."""

    drive: Drive
    simulation: Simulation
    log: TemperatureLog


def paper_log() -> TemperatureLog:
    """Return ten minutes of heating and five of natural cooling of A, then of B; the other spring warms a little."""
    time_s = np.arange(0.0, 900.0, _STEP_S)
    rise = np.clip(time_s / 500.0, 0.0, 1.0)
    own = np.where(
        time_s < 600.0,
        _ROOM_C + (_HOT_C - _ROOM_C) * rise,
        _ROOM_C + (_HOT_C - _ROOM_C) * np.exp(-(time_s - 600.0) / 45.0),
    )
    other = np.empty_like(own)
    other[0] = _ROOM_C
    for k in range(1, len(own)):
        drive = _ROOM_C + _WARMING * (own[k] - _ROOM_C)
        other[k] = other[k - 1] + (drive - other[k - 1]) * _STEP_S / 60.0
    on, off = time_s < 600.0, np.zeros(len(time_s), np.bool_)
    return TemperatureLog(
        time_s=np.concatenate([time_s, 900.0 + time_s]),
        temp_a_c=np.concatenate([own, other]),
        temp_b_c=np.concatenate([other, own]),
        heat_a=np.concatenate([on, off]),
        heat_b=np.concatenate([off, on]),
    )


def play(values: Mapping[str, float]) -> Played:
    """Return the paper's programme on a rig that starts from its own stable cycle."""
    spec = ActuatorSpec(values, source="reference rig")
    model = ActuatorModel(spec)
    rig = Rig.from_values(values)
    log = paper_log()
    start = stable_cycle(rig).theta_1_rad - 0.5 * rig.theta_p_rad
    drive = model.prepare_log(log, start_angle_rad=start)
    return Played(drive, model.simulate(drive), log)


def spring_logs(*, seed: int = 0, rows: int = 1200) -> SpringTests:
    """Return logs of the four tests of the reference rig's spring, with the paper's scatter."""
    rng = np.random.default_rng(seed)
    values = dict(REFERENCE_VALUES)
    temp = np.linspace(_ROOM_C, 66.0, rows)
    window = {"start_c": values["A_s_c"], "finish_c": values["A_f_c"], "influence": 1.0}
    share = HEATING_LAWS["liang_rogers"](temp, 0.0, xi_0=1.0, **window)
    recoveries = tuple(
        Recovery(temp, size * share + SCATTER["recovery_deg"] * rng.standard_normal(rows), size, f"recovery {size:g}°")
        for size in (118.0, 138.0)
    )
    geometry = {name: values[name] for name in ("wire_diameter_mm", "mean_diameter_mm", "active_coils")}
    nothing = Block(temp, temp, _BLOCK_DEG, "block test")
    bare = SpringTests(
        geometry, _LEVER_MM * MM, recoveries, (), nothing,
        {"theta_p_deg": values["theta_p_deg"]}, {"tau_c_mnm": values["tau_c_mnm"]},
    )  # fmt: skip
    forces = []
    for large, top, name in ((False, 60.0, "small_n"), (True, 460.0, "large_n")):
        angle = np.linspace(2.0, top, rows)
        critical = values["theta_cr_deg"]
        load = values["E_M_gpa"] * np.minimum(angle, critical) + values["E_S_gpa"] * np.maximum(0.0, angle - critical)
        force = bare.force_per_deg_gpa * load + SCATTER[name] * rng.standard_normal(rows)
        low, high = LARGE_RANGE_DEG if large else (2.0, top)
        forces.append(ForceAngle(angle, force, large, low, high, name))
    return SpringTests(
        geometry,
        bare.lever_m,
        recoveries,
        tuple(forces),
        _block_log(bare, values, rng, rows),
        bare.assembly,
        bare.friction,
    )


def _block_log(tests: SpringTests, values: Mapping[str, float], rng: np.random.Generator, rows: int) -> Block:
    up = np.linspace(_ROOM_C, 95.0, rows)
    stiffness = tests.force_per_deg_gpa * _BLOCK_DEG
    parts = []
    for cooling, name, key in ((False, "heating_n", "C_A_mpa_per_k"), (True, "cooling_n", "C_M_mpa_per_k")):
        temp = up[::-1] if cooling else up
        force = stiffness * blocked_force(tests, {**values, "k_per_mpa": 1.0 / values[key]}, temp, cooling=cooling)
        parts.append(force + SCATTER[name] * rng.standard_normal(rows))
    return Block(np.concatenate([up, up[::-1]]), np.concatenate(parts), _BLOCK_DEG, "block test")


def make_paper(out: Path, *, seed: int = 0) -> dict[str, Any]:
    """Draw figures 4, 5, 7, 9 to 12 and 15 to 17 into a folder, with ``paper.json``; return its content."""
    spec = reference_spec()
    rig = Rig.from_values(spec.values)
    case_a = play(spec.values)
    case_b = play({**spec.values, "tau_c_mnm": CASE_B_TAU_C_MNM})
    found = characterise(spring_logs(seed=seed))
    figures = [
        strain_figure(out / "figure_04_strain.png", rig, active_coils=spec.values["active_coils"]),
        stiffness_figure(out / "figure_05_stiffness.png", rig),
        torque_figure(
            out / "figure_07_motion.png", {"case (a)": _torques(case_a, rig), "case (b)": _torques(case_b, rig)}, rig
        ),
        *characterisation_figures(out, found),
        *_cycle_figures(out, case_a),
    ]
    content = {"numbers": _numbers(case_a, found, rig), "figures": [path.name for path in figures]}
    write_json(out / "paper.json", content)
    write_table(
        out / "cycle.csv",
        {
            "time_s": case_a.drive.time_s,
            "angle_deg": case_a.simulation.angle_rad / DEG,
            "temp_a_c": case_a.log.temp_a_c,
            "temp_b_c": case_a.log.temp_b_c,
            "torque_a_mnm": case_a.simulation.torque_a_nm / MNM,
            "torque_b_mnm": case_a.simulation.torque_b_nm / MNM,
            "xi_a": case_a.simulation.xi_a,
            "xi_b": case_a.simulation.xi_b,
        },
    )
    return content


def _torques(played: Played, rig: Rig) -> tuple[Array, Array, Array]:
    """Return θ^A and both torques while A is driven."""
    rows = played.drive.cycles.half == 0
    simulation = played.simulation
    theta = simulation.phi_rad[rows] + 0.5 * rig.theta_p_rad
    return theta, simulation.torque_a_nm[rows], simulation.torque_b_nm[rows]


def _cycle_figures(out: Path, played: Played) -> list[Path]:
    minutes = played.drive.time_s / 60.0
    angle = played.simulation.angle_rad / DEG
    first = played.drive.cycles.half == 0
    temp = played.log.temp_a_c[first]
    top = int(np.argmax(temp))
    heating, cooling = slice(None, top + 1), slice(top, None)
    return [
        draw(
            out / "figure_15_angle.png", [Line(minutes, angle, "")], x_label="time (min)", y_label="angle φ (°)",
            title="Figure 15: angle in one cycle",
        ),
        draw(
            out / "figure_16_temperature.png",
            [Line(minutes, played.log.temp_a_c, "spring A"), Line(minutes, played.log.temp_b_c, "spring B")],
            x_label="time (min)", y_label="temperature (°C)", title="Figure 16: temperatures",
        ),
        draw(
            out / "figure_17_angle_temperature.png",
            [
                Line(temp[heating], angle[first][heating], "A heated"),
                Line(temp[cooling], angle[first][cooling], "A cooled", "--"),
            ],
            x_label="temperature of A (°C)", y_label="angle φ (°)", title="Figure 17: angle against temperature",
        ),
    ]  # fmt: skip


def _numbers(played: Played, found: Characterisation, rig: Rig) -> dict[str, dict[str, float | str | None]]:
    """Return the paper's numbers beside ours."""
    angle = played.simulation.angle_rad / DEG
    first = played.drive.cycles.half == 0
    reached = np.flatnonzero(angle[first] <= angle[first].min() + 1e-6)
    cycle = stable_cycle(rig)
    steps = found.steps

    def entry(paper: float | None, ours: float, unit: str) -> dict[str, float | str | None]:
        return {"paper": paper, "ours": float(ours), "unit": unit}

    return {
        "range": entry(466.0, np.ptp(angle), "°"),
        "temperature_of_the_extremum": entry(70.0, played.log.temp_a_c[first][reached[0]], "°C"),
        "theta_1": entry(None, cycle.theta_1_rad / DEG, "°"),
        "theta_2": entry(None, cycle.theta_2_rad / DEG, "°"),
        "theta_3": entry(None, cycle.theta_3_rad / DEG, "°"),
        "largest_stress": entry(None, rig.stress_per_torque * played.simulation.torque_a_nm.max() / MPA, "MPa"),
        "A_s_liang_rogers": entry(36.0, steps["free_recovery"].estimates["A_s_c"].value, "°C"),
        "A_f_liang_rogers": entry(54.0, steps["free_recovery"].estimates["A_f_c"].value, "°C"),
        "A_s_tanaka": entry(42.0, steps["free_recovery_tanaka"].estimates["A_s_c"].value, "°C"),
        "A_f_tanaka": entry(60.0, steps["free_recovery_tanaka"].estimates["A_f_c"].value, "°C"),
        "figure_9_rmse_liang_rogers": entry(9.5752, steps["free_recovery"].rmse, "°"),
        "figure_9_rmse_tanaka": entry(14.8436, steps["free_recovery_tanaka"].rmse, "°"),
        "figure_10_11_rmse": entry(0.0113, steps["force_angle"].rmse, "N"),
        "figure_12a_rmse": entry(0.0227, steps["block_heating"].rmse, "N"),
        "figure_12a_r2": entry(0.9392, steps["block_heating"].r2["heating"], ""),
        "figure_12b_rmse": entry(0.0125, steps["block_cooling"].rmse, "N"),
        "figure_12b_r2": entry(0.9850, steps["block_cooling"].r2["cooling"], ""),
    }
