"""The paper's programme and spring tests, simulated on the reference rig."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from torsight.actuator.characterising.characterisation import blocked_force
from torsight.actuator.characterising.spring_tests import LARGE_RANGE_DEG, Block, ForceAngle, Recovery, SpringTests
from torsight.actuator.drive import Drive
from torsight.actuator.model import ActuatorModel
from torsight.actuator.simulation import Simulation
from torsight.actuator.spec import REFERENCE_VALUES, ActuatorSpec
from torsight.actuator.springs import Rig
from torsight.actuator.stepping.closed_form import stable_cycle
from torsight.actuator.stepping.phase import SHARE_DONE
from torsight.core.records import TemperatureLog
from torsight.core.units import MM

SCATTER: Final[Mapping[str, float]] = {
    "recovery_deg": 9.5752, "small_n": 0.0105, "large_n": 0.0113, "heating_n": 0.0227, "cooling_n": 0.0125,
}  # fmt: skip
"""Root mean square errors that the paper reports for figures 9 to 12."""
_ROOM_C: Final = 23.0
_HOT_C: Final = 76.0
_STEP_S: Final = 0.25
"""Room, reference of the heating and time between rows, choices: the stroke ends close to 70 °C, as in the paper."""
_AT_ITS_GOAL_S, _OFF_S, _END_S = 500.0, 600.0, 900.0
"""Ten minutes of heating and five of natural cooling, as in the paper; the time at which the temperature reaches its
reference is a choice."""
_BLOCK_DEG: Final = 85.0
_LEVER_MM: Final = 26.4
"""Pre-deformation in the block test and length of the lever, as in the paper."""
_WARMING: Final = 0.1
"""Share of the driven spring's heating by which the other spring warms up (as figure 16 shows): a choice. Half and
twice this share change no motion, since 23 °C + 0.2 · 53 °C is still below A_s."""


@dataclass(frozen=True, slots=True, eq=False)
class Played:
    """One cycle of the paper's programme on a rig."""

    rig: Rig
    drive: Drive
    simulation: Simulation
    log: TemperatureLog


def _log() -> TemperatureLog:
    """Return the log of A and then of B; the other spring warms up a little."""
    time_s = np.arange(0.0, _END_S, _STEP_S)
    rise = np.clip(time_s / _AT_ITS_GOAL_S, 0.0, 1.0)
    on, off = time_s < _OFF_S, np.zeros(len(time_s), np.bool_)
    own = np.where(
        on, _ROOM_C + (_HOT_C - _ROOM_C) * rise, _ROOM_C + (_HOT_C - _ROOM_C) * np.exp(-(time_s - _OFF_S) / 45.0)
    )
    other = np.empty_like(own)
    other[0] = _ROOM_C
    for k in range(1, len(own)):
        drive = _ROOM_C + _WARMING * (own[k] - _ROOM_C)
        other[k] = other[k - 1] + (drive - other[k - 1]) * _STEP_S / 60.0
    return TemperatureLog(
        time_s=np.concatenate([time_s, _END_S + time_s]),
        temp_a_c=np.concatenate([own, other]),
        temp_b_c=np.concatenate([other, own]),
        heat_a=np.concatenate([on, off]),
        heat_b=np.concatenate([off, on]),
    )


def play(values: Mapping[str, float]) -> Played:
    """Simulate the paper's programme on a rig that starts from its own stable cycle."""
    model, rig, log = ActuatorModel(ActuatorSpec(values, source="reference rig")), Rig.from_values(values), _log()
    start = stable_cycle(rig).theta_1_rad - 0.5 * rig.theta_p_rad
    drive = model.prepare_log(log, start_angle_rad=start)
    return Played(rig, drive, model.simulate(drive), log)


def spring_logs(*, seed: int = 0) -> SpringTests:
    """Return logs of the four tests of the reference rig's spring, with the paper's scatter."""
    rng, rows = np.random.default_rng(seed), 1200
    values = dict(REFERENCE_VALUES)
    temp = np.linspace(_ROOM_C, 66.0, rows)
    share = 1.0 - SHARE_DONE["liang_rogers"]((temp - values["A_s_c"]) / (values["A_f_c"] - values["A_s_c"]))
    recoveries = tuple(
        Recovery(temp, size * share + SCATTER["recovery_deg"] * rng.standard_normal(rows), size, f"recovery {size:g}°")
        for size in (118.0, 138.0)
    )
    geometry = {name: values[name] for name in ("wire_diameter_mm", "mean_diameter_mm", "active_coils")}
    assembly, friction = ({name: values[name]} for name in ("theta_p_deg", "tau_c_mnm"))
    nothing = Block(temp, temp, _BLOCK_DEG, "block test")
    bare = SpringTests(geometry, _LEVER_MM * MM, recoveries, (), nothing, assembly, friction)
    forces = []
    for large, top, name in 2 * ((False, 60.0, "small_n"), (True, 460.0, "large_n")):
        angle = np.linspace(2.0, top, rows)
        critical = values["theta_cr_deg"]
        load = values["E_M_gpa"] * np.minimum(angle, critical) + values["E_S_gpa"] * np.maximum(0.0, angle - critical)
        force = bare.force_per_deg_gpa * load + SCATTER[name] * rng.standard_normal(rows)
        low, high = LARGE_RANGE_DEG if large else (2.0, top)
        forces.append(ForceAngle(angle, force, large, low, high, name))
    return replace(bare, forces=tuple(forces), block=_block_log(bare, values, rng, rows))


def _block_log(tests: SpringTests, values: Mapping[str, float], rng: np.random.Generator, rows: int) -> Block:
    up = np.linspace(_ROOM_C, 95.0, rows)
    stiffness = tests.force_per_deg_gpa * _BLOCK_DEG
    parts = []
    for cooling, name, key in ((False, "heating_n", "C_A_mpa_per_k"), (True, "cooling_n", "C_M_mpa_per_k")):
        temp = up[::-1] if cooling else up
        force = stiffness * blocked_force(tests, {**values, "k_per_mpa": 1.0 / values[key]}, temp, cooling=cooling)
        parts.append(force + SCATTER[name] * rng.standard_normal(rows))
    return Block(np.concatenate([up, up[::-1]]), np.concatenate(parts), _BLOCK_DEG, "block test")
