"""One torsion spring: strain from winding, torsional stiffness, and the martensite's loading curve.

Symbols as in the paper (Smart Mater. Struct. 24 (2015) 105005): wire diameter d, wire length of the active coils
L_s, strain per radian C1 = d / (2 L_s) (7), stress per torque C2 = 32 / (π d³) (11), stiffness K = E C1 / C2
(16, 17), critical angle θ_cr, total winding θ_P (18), friction torque τ_c.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from torsight.core.units import DEG, GPA, MM, MNM, MPA, Floats


@dataclass(frozen=True, slots=True)
class Rig:
    """The values of one rig in SI units, with the constants that follow from them.

    Attributes
    ----------
    wire_diameter_m, wire_length_m : float
        d and L_s.
    k_austenite, k_martensite, k_stress_induced : float
        K_A, K_M, K_S in N·m/rad.
    a_start_c, a_finish_c, m_start_c, m_finish_c : float
        Transformation temperatures without stress, °C.
    c_austenite, c_martensite : float
        Stress influence C_A, C_M in Pa/K.
    theta_cr_rad, theta_p_rad : float
        Critical angle and total winding.
    tau_c_nm : float
        Coulomb friction torque.
    stress_per_torque : float
        C2 in 1/m³.
    """

    wire_diameter_m: float
    wire_length_m: float
    k_austenite: float
    k_martensite: float
    k_stress_induced: float
    a_start_c: float
    a_finish_c: float
    m_start_c: float
    m_finish_c: float
    c_austenite: float
    c_martensite: float
    theta_cr_rad: float
    theta_p_rad: float
    tau_c_nm: float
    stress_per_torque: float

    @classmethod
    def from_values(cls, values: Mapping[str, float]) -> Rig:
        """Convert public values (``E_A_gpa``, ``theta_cr_deg``, …) of spring A and the rig to SI units."""
        diameter_m = values["wire_diameter_mm"] * MM
        length_m = wire_length_mm(values) * MM
        stress = stress_per_torque(diameter_m)
        stiffness = strain_per_angle(diameter_m, length_m) / stress * GPA
        return cls(
            wire_diameter_m=diameter_m,
            wire_length_m=length_m,
            k_austenite=stiffness * values["E_A_gpa"],
            k_martensite=stiffness * values["E_M_gpa"],
            k_stress_induced=stiffness * values["E_S_gpa"],
            a_start_c=values["A_s_c"],
            a_finish_c=values["A_f_c"],
            m_start_c=values["M_s_c"],
            m_finish_c=values["M_f_c"],
            c_austenite=values["C_A_mpa_per_k"] * MPA,
            c_martensite=values["C_M_mpa_per_k"] * MPA,
            theta_cr_rad=values["theta_cr_deg"] * DEG,
            theta_p_rad=values["theta_p_deg"] * DEG,
            tau_c_nm=values["tau_c_mnm"] * MNM,
            stress_per_torque=stress,
        )

    def stiffness(self, xi: float) -> float:
        """Return K(ξ) = K_A + ξ (K_M − K_A) (16), N·m/rad."""
        return self.k_austenite + xi * (self.k_martensite - self.k_austenite)

    def loading_torque(self, theta_rad: float) -> float:
        """Return the torque of cold martensite being wound: K_M up to the critical angle, K_S beyond it, N·m."""
        if theta_rad <= self.theta_cr_rad:
            return self.k_martensite * theta_rad
        return self.k_martensite * self.theta_cr_rad + self.k_stress_induced * (theta_rad - self.theta_cr_rad)

    def recoverable_angle(self, theta_max_rad: float) -> float:
        """Return θ_L, the torque-free angle that winding to ``theta_max_rad`` leaves, rad."""
        share = 1.0 - self.k_stress_induced / self.k_martensite
        return max(0.0, theta_max_rad - self.theta_cr_rad) * share


SPRING_B: Final = "spring_b_"
"""Prefix of the names of values that hold for spring B alone."""


LENGTH_KEYS: Final = frozenset(("wire_length_mm", "mean_diameter_mm", "active_coils"))
"""Keys that determine the length of a wire: the length itself, or mean diameter and number of coils."""


def own_of_b(values: Mapping[str, float]) -> dict[str, float]:
    """Return the values that hold for spring B alone, by their names without the prefix."""
    return {name.removeprefix(SPRING_B): value for name, value in values.items() if name.startswith(SPRING_B)}


def common(values: Mapping[str, float]) -> dict[str, float]:
    """Return the values that do not hold for spring B alone."""
    return {name: value for name, value in values.items() if not name.startswith(SPRING_B)}


def values_of_b(values: Mapping[str, float]) -> dict[str, float]:
    """Return the values of spring B: its own values where given, else the common ones.

    A wire's length given in one of the two ways replaces the common one given in the other way.
    """
    own = own_of_b(values)
    coils = LENGTH_KEYS - {"wire_length_mm"}
    replaced = coils if "wire_length_mm" in own else LENGTH_KEYS - coils if coils & own.keys() else frozenset()
    return {**{name: value for name, value in values.items() if name not in replaced}, **own}


def wire_length_mm(values: Mapping[str, float]) -> float:
    """Return L_s as given, or as N0 π D0 (2), mm."""
    if "wire_length_mm" in values:
        return values["wire_length_mm"]
    return values["active_coils"] * math.pi * values["mean_diameter_mm"]


def strain_per_angle(wire_diameter_m: float, wire_length_m: float) -> float:
    """Return C1 = d / (2 L_s) (7), 1/rad."""
    return wire_diameter_m / (2.0 * wire_length_m)


def stress_per_torque(wire_diameter_m: float) -> float:
    """Return C2 = 32 / (π d³) (11), 1/m³."""
    return 32.0 / (math.pi * wire_diameter_m**3)


def torsional_stiffness(rig: Rig, theta_rad: Floats, *, xi: float) -> Floats:
    """Return the stiffness of figure 5: K(ξ) up to the critical angle (16), K_S beyond it (17), N·m/rad."""
    return np.where(theta_rad <= rig.theta_cr_rad, rig.stiffness(xi), rig.k_stress_induced)


def strain_ratio(
    theta_rad: Floats, *, wire_diameter_m: float, wire_length_m: float, active_coils: float, compression_m: float
) -> Floats:
    """Return γ / ε of figure 4 for an axial pre-compression L_δ.

    Shear strain γ = (N0 + θ/2π) π d L_δ / L_s² (4), Wahl factor one; normal strain ε = C1 θ (7), from winding alone:
    the strain from shaping is annealed away. The ratio falls with θ, so that the model has bending strain only.
    """
    coils = active_coils + theta_rad / (2.0 * math.pi)
    shear = coils * math.pi * wire_diameter_m * compression_m / wire_length_m**2
    return shear / (strain_per_angle(wire_diameter_m, wire_length_m) * theta_rad)
