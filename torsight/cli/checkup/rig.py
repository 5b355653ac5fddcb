"""Check of a temperature log against the actuator that it drives: complete heatings, heating rates, holds."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from torsight.actuator.drive import Drive
from torsight.actuator.spec import ActuatorSpec
from torsight.actuator.springs import Rig
from torsight.actuator.stepping.cycle import stable_cycle
from torsight.core.units import DEG, Floats


@dataclass(frozen=True, slots=True)
class Limits:
    """Temperatures at which a complete, stable cycle of this actuator moves, °C; angles in degrees.

    The temperatures are those at which motion begins while heating, at which the transformation is complete, and at
    which the cooled spring is martensite again, as the model assumes at the start of a half-cycle. The angles are the
    range of motion, and the angle before A is heated (before B is heated it is the negative).
    """

    onset_c: float
    full_c: float
    cooled_c: float
    range_deg: float
    start_deg: float


def limits_of(spec: ActuatorSpec) -> Limits | None:
    """Return the temperatures and angles of an actuator's motion, by the closed forms; None where it never moves."""
    rig = Rig.from_values(spec.values)
    cycle = stable_cycle(rig)
    if math.isnan(cycle.xi_12) or cycle.theta_1_rad - cycle.theta_2_rad < DEG:
        return None
    per_torque_a = rig.stress_per_torque / rig.c_austenite
    per_torque_m = rig.stress_per_torque / rig.c_martensite
    torque_12 = rig.loading_torque(rig.theta_p_rad - cycle.theta_1_rad) + rig.tau_c_nm
    torque_2 = rig.loading_torque(rig.theta_p_rad - cycle.theta_2_rad) + rig.tau_c_nm
    # (13) solved for the temperature at which the transformation has come to ξ12
    way = math.acos(min(1.0, max(-1.0, 2.0 * cycle.xi_12 - 1.0))) / math.pi
    half_turn = 0.5 * rig.theta_p_rad
    return Limits(
        onset_c=rig.a_start_c + way * (rig.a_finish_c - rig.a_start_c) + per_torque_a * torque_12,
        full_c=rig.a_finish_c + per_torque_a * torque_2,
        cooled_c=rig.m_finish_c + per_torque_m * rig.loading_torque(cycle.theta_3_rad),
        range_deg=2.0 * max(cycle.theta_1_rad - half_turn, half_turn - cycle.theta_2_rad) / DEG,
        start_deg=(cycle.theta_1_rad - half_turn) / DEG,
    )


@dataclass(frozen=True, slots=True)
class HalfCycle:
    """One heating and cooling of a spring (``a`` or ``b``) as the log shows it.

    It holds the peak temperature, the lowest temperature after it, and the median heating rate within the range of
    motion.
    """

    spring: str
    peak_c: float
    end_c: float
    rate_c_s: float


def half_cycles_of(drive: Drive, limits: Limits) -> list[HalfCycle]:
    """Return the driven spring's temperatures and rates, half-cycle by half-cycle."""
    found = []
    for spring, rows, temp_c, _ in drive.half_cycles():
        top = int(np.argmax(temp_c))
        moving = (temp_c[:top] > limits.onset_c) & (temp_c[:top] < limits.full_c)
        rate = np.gradient(temp_c, drive.time_s[rows])[:top] if top > 1 else np.zeros(top)
        rising = rate[moving & (rate > 0)] if (moving & (rate > 0)).any() else rate[rate > 0]
        rate_c_s = float(np.median(rising)) if len(rising) else 0.0
        found.append(HalfCycle("ab"[spring], float(temp_c[top]), float(temp_c[top:].min()), rate_c_s))
    return found


def distinct_rates(cycles: Sequence[HalfCycle]) -> list[float]:
    """Return the distinct heating rates, °C/s, to one significant digit."""
    return sorted({float(f"{cycle.rate_c_s:.1g}") for cycle in cycles if cycle.rate_c_s > 0.0})


def steepest_deg_per_c(angle_deg: Floats, temp_c: Floats) -> float:
    """Return the steepest slope of the angle over the temperature, °/°C."""
    step_c = np.diff(temp_c)
    # Where the temperature is constant, a ratio of noise to noise would be the steepest.
    moving = np.abs(step_c) > 1e-3
    if not moving.any():
        return 0.0
    return float(np.nanquantile(np.abs(np.diff(angle_deg)[moving] / step_c[moving]), 0.98))
