"""Logs of the four spring tests, made sample by sample with formulas of their own and the paper's noise."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import brentq

from torsight.core.files.storage import write_table


@dataclass(frozen=True)
class Spring:
    """True values; the reference rig by default."""

    d: float = 0.5e-3
    length: float = 64.1e-3
    lever: float = 26.4e-3
    e_a: float = 60.0
    e_m: float = 20.0
    e_s: float = 5.0
    a_s: float = 36.0
    a_f: float = 54.0
    m_s: float = 42.0
    m_f: float = 28.0
    c_a: float = 32.0
    c_m: float = 32.0
    theta_cr: float = 180.0

    @property
    def newton_per_gpa_deg(self) -> float:
        second_moment = math.pi * self.d**4 / 64.0
        # A wire in bending: torque = E I θ / L (twice the round bar's I over d/2 is π d³/32).
        return 1e9 * second_moment * math.radians(1.0) / self.length / self.lever


# RMSE of the paper's figures 9, 10, 11, 12a, 12b.
NOISE = {"recovery": 9.5752, "small": 0.0105, "large": 0.0113, "heating": 0.0227, "cooling": 0.0125}
BLOCK_DEG = 85.0


def heating_fraction(spring: Spring, temp: float, stress_mpa: float) -> float:
    u = (temp - spring.a_s - stress_mpa / spring.c_a) / (spring.a_f - spring.a_s)
    return 1.0 if u <= 0 else 0.0 if u >= 1 else 0.5 * (math.cos(math.pi * u) + 1.0)


def cooling_fraction(spring: Spring, temp: float, stress_mpa: float) -> float:
    u = (temp - spring.m_f - stress_mpa / spring.c_m) / (spring.m_s - spring.m_f)
    return 0.0 if u >= 1 else 1.0 if u <= 0 else 0.5 * (math.cos(math.pi * u) + 1.0)


def blocked(spring: Spring, temp: float, law) -> float:
    """Force of the blocked spring: bracketed in the force."""
    stress_per_newton = 32.0 / (math.pi * spring.d**3) * spring.lever * 1e-6

    def balance(force: float) -> float:
        xi = law(spring, temp, stress_per_newton * force)
        modulus = spring.e_a + xi * (spring.e_m - spring.e_a)
        return spring.newton_per_gpa_deg * modulus * BLOCK_DEG * (1.0 - xi) - force

    return brentq(balance, 0.0, 1.01 * spring.newton_per_gpa_deg * spring.e_a * BLOCK_DEG, xtol=1e-12)


def write_bench(
    folder: Path, *, spring: Spring | None = None, rng: np.random.Generator | None = None, rows: int = 1200
) -> Path:
    """Write all logs and TESTS.toml; without a generator there is no noise."""
    spring = spring or Spring()
    folder.mkdir(parents=True, exist_ok=True)

    def noisy(values, name):
        values = np.asarray(values, float)
        return values if rng is None else values + NOISE[name] * rng.standard_normal(len(values))

    temps = np.linspace(24.0, 66.0, rows)
    for size in (118.0, 138.0):
        angle = [-size * heating_fraction(spring, temp, 0.0) for temp in temps]
        write_table(folder / f"recovery_{size:.0f}.csv", {"temp_c": temps, "angle_deg": noisy(angle, "recovery")})
    scale = spring.newton_per_gpa_deg
    small = np.linspace(2.0, 60.0, rows)
    write_table(folder / "small.csv", {"angle_deg": -small, "force_n": noisy(scale * spring.e_m * small, "small")})
    large = np.linspace(0.0, 460.0, 4 * rows)
    force = scale * np.where(
        large < spring.theta_cr,
        spring.e_m * large,
        spring.e_m * spring.theta_cr + spring.e_s * (large - spring.theta_cr),
    )
    # Beyond 400° the coils touch.
    force = force + 0.002 * np.maximum(0.0, large - 400.0)
    write_table(folder / "large.csv", {"angle_deg": -large, "force_n": noisy(force, "large")})
    up, down = np.linspace(24.0, 95.0, rows), np.linspace(95.0, 24.0, rows)
    heating = noisy([blocked(spring, temp, heating_fraction) for temp in up], "heating")
    cooling = noisy([blocked(spring, temp, cooling_fraction) for temp in down], "cooling")
    write_table(
        folder / "block.csv", {"temp_c": np.concatenate([up, down]), "force_n": np.concatenate([heating, cooling])}
    )
    path = folder / "tests.toml"
    path.write_text(
        f"""[spring]
wire_diameter_mm = {spring.d * 1e3}
wire_length_mm = {spring.length * 1e3}
lever_mm = {spring.lever * 1e3}
[[free_recovery]]
file = "recovery_118.csv"
pre_deformation_deg = -118.0
[[free_recovery]]
file = "recovery_138.csv"
pre_deformation_deg = -138.0
[[force_angle]]
file = "small.csv"
range = "small"
[[force_angle]]
file = "large.csv"
range = "large"
[block]
file = "block.csv"
pre_deformation_deg = -{BLOCK_DEG}
[assembly]
theta_p_deg = 1080.0
[friction]
tau_c_mnm = 0.8
"""
    )
    return path


def true_values(spring: Spring) -> dict[str, float]:
    return {
        "E_A_gpa": spring.e_a, "E_M_gpa": spring.e_m, "E_S_gpa": spring.e_s, "A_s_c": spring.a_s, "A_f_c": spring.a_f,
        "M_s_c": spring.m_s, "M_f_c": spring.m_f, "C_A_mpa_per_k": spring.c_a, "C_M_mpa_per_k": spring.c_m,
        "theta_cr_deg": spring.theta_cr,
    }  # fmt: skip
