"""The paper's closed forms (21) to (29) for one heating and cooling of one spring, and the angles of a fitted cycle.

The closed forms hold for a transformation that is complete on heating and starts from a home state; the stepping kernel
must give the same results and is tested against them. All angles are those of the active spring, all torques in N·m.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from torsight.actuator.drive import Drive
from torsight.actuator.simulation import Simulation
from torsight.actuator.springs import Rig
from torsight.core.errors import require_kind
from torsight.core.units import DEG


@dataclass(frozen=True, slots=True)
class ClosedForm:
    """One heating and one cooling of the active spring.

    θ_1 to θ_3 are the angles before heating, after it, and after cooling; case ``"a"`` is that of an actuator that
    moves back while cooling, else ``"b"``. ξ_12 and ξ_23 are the martensite fractions at which sticking ends on heating
    and on cooling (NaN: never), and θ_L is the recoverable angle.
    """

    theta_1_rad: float
    theta_2_rad: float
    theta_3_rad: float
    case: str
    xi_12: float
    xi_23: float
    theta_l_rad: float


def critical_angle(rig: Rig) -> float:
    """Return β_cr = θ_P/2 − τ_c/(2 K_S) (29), rad."""
    return 0.5 * rig.theta_p_rad - 0.5 * rig.tau_c_nm / rig.k_stress_induced


def home_torque(rig: Rig, theta_1_rad: float) -> float:
    """Return τ1 of (21): the torque on the loading curve, or that held by the other spring and friction if smaller."""
    passive = rig.loading_torque(rig.theta_p_rad - theta_1_rad)
    return min(rig.loading_torque(theta_1_rad), passive + rig.tau_c_nm)


def wound_angle(rig: Rig, theta_rad: float, torque_nm: float) -> float:
    """Return θ_max, rad, from which elastic unwinding with K_M leads to the given angle and torque."""
    excess = rig.loading_torque(theta_rad) - torque_nm
    if excess <= 0.0:
        return theta_rad
    # Below the critical angle loading and unloading are the same line, so that θ_max is at least the critical angle.
    start = max(theta_rad, rig.theta_cr_rad)
    excess = rig.loading_torque(start) - (torque_nm + rig.k_martensite * (start - theta_rad))
    return start + max(0.0, excess) / (rig.k_martensite - rig.k_stress_induced)


def sticking_end(rig: Rig, *, theta_l_rad: float, xi_start: float, torque_change_nm: float) -> float:
    """Return the root ξ of K(ξ) (ξ_start − ξ) θ_L = torque change, as in (21) and (24); NaN without one in [0, 1].

    The torque change is positive while heating (ξ falls) and negative while cooling (ξ grows).
    """
    if torque_change_nm == 0.0:
        return xi_start
    slope = rig.k_martensite - rig.k_austenite
    a = -slope * theta_l_rad
    b = (slope * xi_start - rig.k_austenite) * theta_l_rad
    c = rig.k_austenite * xi_start * theta_l_rad - torque_change_nm
    root = b * b - 4.0 * a * c
    if root < 0.0 or theta_l_rad <= 0.0:
        return math.nan
    roots = [(-b + sign * math.sqrt(root)) / (2.0 * a) for sign in (1.0, -1.0)] if a != 0.0 else [-c / b]
    inside = [xi for xi in roots if -1e-12 <= xi <= 1.0 + 1e-12 and (xi - xi_start) * torque_change_nm <= 0.0]
    return min(inside, key=lambda xi: abs(xi - xi_start)) if inside else math.nan


def heated_angle(rig: Rig, *, theta_1_rad: float, theta_l_rad: float, xi_12: float, xi: float) -> float:
    """Return θ^A, rad, at the fraction ``xi`` while the actuator slides on heating (23)."""
    stiffness = rig.stiffness(xi)
    return theta_1_rad + stiffness / (stiffness + rig.k_stress_induced) * (xi - xi_12) * theta_l_rad


def stop_angle(rig: Rig, theta_2_rad: float) -> float:
    """Return θ_3 (28), or θ_2 where the actuator does not move back (29), rad."""
    if theta_2_rad >= critical_angle(rig):
        return theta_2_rad
    return (rig.k_stress_induced * (rig.theta_p_rad - theta_2_rad) + rig.k_martensite * theta_2_rad - rig.tau_c_nm) / (
        rig.k_stress_induced + rig.k_martensite
    )


def _require_rig(rig: object) -> None:
    require_kind(rig, Rig, where="closed forms, rig", do="Rig.from_values(read_actuator(path).values) is one")


def half_cycle(rig: Rig, theta_1_rad: float) -> ClosedForm:
    """Return the closed forms for a complete heating and cooling that starts from home at ``theta_1_rad``."""
    _require_rig(rig)
    torque_1 = home_torque(rig, theta_1_rad)
    torque_12 = rig.loading_torque(rig.theta_p_rad - theta_1_rad) + rig.tau_c_nm
    theta_l = rig.recoverable_angle(wound_angle(rig, theta_1_rad, torque_1))
    xi_12 = sticking_end(rig, theta_l_rad=theta_l, xi_start=1.0, torque_change_nm=torque_12 - torque_1)
    beta = critical_angle(rig)
    if math.isnan(xi_12):
        return ClosedForm(theta_1_rad, theta_1_rad, theta_1_rad, "b", math.nan, math.nan, theta_l)
    theta_2 = heated_angle(rig, theta_1_rad=theta_1_rad, theta_l_rad=theta_l, xi_12=xi_12, xi=0.0)
    xi_23 = sticking_end(rig, theta_l_rad=theta_l, xi_start=0.0, torque_change_nm=-2.0 * rig.tau_c_nm)
    return ClosedForm(
        theta_1_rad=theta_1_rad,
        theta_2_rad=theta_2,
        theta_3_rad=stop_angle(rig, theta_2),
        case="a" if theta_2 < beta else "b",
        xi_12=xi_12,
        xi_23=xi_23,
        theta_l_rad=theta_l,
    )


def stable_cycle(rig: Rig, *, max_cycles: int = 400) -> ClosedForm:
    """Return the half-cycle of the stable cycle, in which the next half-cycle of the other spring is identical.

    The chain of half-cycles contracts, so iterating it from mid-stroke finds the fixed point.
    """
    _require_rig(rig)
    theta_1 = 0.75 * rig.theta_p_rad
    found = half_cycle(rig, theta_1)
    for _ in range(max_cycles):
        following = rig.theta_p_rad - found.theta_3_rad
        if abs(following - theta_1) < 1e-13 * rig.theta_p_rad:
            break
        theta_1 = following
        found = half_cycle(rig, theta_1)
    return found


@dataclass(frozen=True, slots=True)
class Cycle:
    """The half-cycle of the largest stroke in a record, in angles of its driven spring, ``"a"`` or ``"b"``; degrees.

    θ_1 to θ_3 are the angles before heating, at the extremum, and after cooling, β_cr is the critical angle (29). Case
    ``"a"``: θ_2 is below it, and the actuator moves back while it cools; else ``"b"``. ``stable_deg`` are θ_1 to θ_3 of
    the closed forms' stable cycle of complete heatings.
    """

    theta_1_deg: float
    theta_2_deg: float
    theta_3_deg: float
    beta_cr_deg: float
    case: str
    spring: str
    stable_deg: tuple[float, float, float]

    def to_json(self) -> dict[str, Any]:
        """Return the keys of ``fit.json``."""
        return {
            "case": self.case,
            "theta_1_deg": self.theta_1_deg,
            "theta_2_deg": self.theta_2_deg,
            "theta_3_deg": self.theta_3_deg,
            "beta_cr_deg": self.beta_cr_deg,
            "cycle_spring": self.spring,
            "stable_cycle": dict(zip(("theta_1_deg", "theta_2_deg", "theta_3_deg"), self.stable_deg, strict=True)),
        }


def fitted_cycle(drive: Drive, simulation: Simulation, values: Mapping[str, float]) -> Cycle:
    """Return the angles of the half-cycle with the largest stroke.

    Of equal strokes (within 2 % of the largest) the last is taken, which is nearest to the stable cycle.
    """
    rig = Rig.from_values(values)
    found = []
    for spring, rows, _, _ in drive.half_cycles():
        phi = simulation.phi_rad[rows]
        if len(phi):
            theta = 0.5 * rig.theta_p_rad + (phi if spring == 0 else -phi)
            found.append((float(theta[0] - theta.min()), float(theta[0]), float(theta.min()), float(theta[-1]), spring))
    largest = max(item[0] for item in found)
    _, theta_1, theta_2, theta_3, spring = [item for item in found if item[0] >= 0.98 * largest][-1]
    beta = critical_angle(rig)
    stable = stable_cycle(rig)
    angles = np.array([stable.theta_1_rad, stable.theta_2_rad, stable.theta_3_rad]) / DEG
    return Cycle(
        theta_1_deg=theta_1 / DEG,
        theta_2_deg=theta_2 / DEG,
        theta_3_deg=theta_3 / DEG,
        beta_cr_deg=beta / DEG,
        case="a" if theta_2 < beta else "b",
        spring="ab"[spring],
        stable_deg=(float(angles[0]), float(angles[1]), float(angles[2])),
    )
