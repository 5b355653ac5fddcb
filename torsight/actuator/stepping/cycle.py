"""Angles of the fitted cycle: θ_1, θ_2, θ_3, the critical angle and the case, with the paper's names."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from torsight.actuator.drive import Drive
from torsight.actuator.simulation import Simulation
from torsight.actuator.springs import Rig
from torsight.actuator.stepping.closed_form import critical_angle, stable_cycle
from torsight.core.units import DEG


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
