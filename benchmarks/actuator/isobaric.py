"""The phase laws on measured loops of another lab: strain against temperature under four constant stresses.

``python benchmarks/actuator/isobaric.py FOLDER [FIGURE.png]``: FOLDER holds ``7 MPa.txt`` … ``200 MPa.txt`` (columns
°C, strain, MPa), a wire that is cooled and heated again under each stress.

Strain stands in place of the angle: ε = ε_0 + α (T − 20 °C) + σ/E(ξ) + ξ H(σ), with ξ by (13) and (14) or by Tanaka's
law, 1/E(ξ) between both states' compliances, and the transformation strain H(σ) = H_0 + (H_1 − H_0)(1 − exp(−σ/σ_H)).
All values are fitted to three stresses at once and the fourth loop is predicted, each in its turn; then all four
together give the transformation temperatures and the influence of stress with their intervals.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from torsight.actuator.characterising.characterised import Line, draw
from torsight.actuator.characterising.curve_fit import CurveFit, fit_curve
from torsight.actuator.stepping.phase import SHARE_DONE
from torsight.core.parameter import Parameter
from torsight.core.series import rms, share_explained
from torsight.core.units import GPA, MPA

Array = NDArray[np.float64]

STRESSES_MPA = (7, 50, 150, 200)
_WARM_C = 20.0


@dataclass(frozen=True, slots=True, eq=False)
class Loop:
    """One loop: °C, strain in %, the constant stress in Pa, and the row at which cooling turns into heating."""

    temp_c: Array
    strain_percent: Array
    stress_pa: float
    turn: int


def read_loop(path: Path) -> Loop:
    """Read one file."""
    temp, strain, stress = np.loadtxt(path).T
    return Loop(temp, 100.0 * strain, float(np.mean(stress)) * MPA, int(np.argmin(temp)))


def fraction(loop: Loop, values: Mapping[str, float], *, law: str) -> Array:
    """Return ξ along a loop: cooled from austenite, and heated from what fraction was reached."""
    start_c = {of: values[f"{of}_s_c"] + loop.stress_pa / (values[f"C_{of}_mpa_per_k"] * MPA) for of in ("M", "A")}
    coolest = np.minimum.accumulate(loop.temp_c[: loop.turn + 1])
    warmest = np.maximum.accumulate(loop.temp_c[loop.turn + 1 :])
    cooling = SHARE_DONE[law]((start_c["M"] - coolest) / values["M_width_c"])
    heating = cooling[-1] * (1.0 - SHARE_DONE[law]((warmest - start_c["A"]) / values["A_width_c"]))
    return np.concatenate([cooling, heating])


def strain(loop: Loop, values: Mapping[str, float], *, law: str) -> Array:
    """Return the modelled strain in %."""
    xi = fraction(loop, values, law=law)
    softer = 1.0 / values["E_M_gpa"] - 1.0 / values["E_A_gpa"]
    compliance = (1.0 / values["E_A_gpa"] + xi * softer) / GPA
    rise = 1.0 - np.exp(-loop.stress_pa / (values["sigma_h_mpa"] * MPA))
    full = values["H_0_percent"] + (values["H_1_percent"] - values["H_0_percent"]) * rise
    thermal = values["alpha_percent_per_k"] * (loop.temp_c - _WARM_C)
    return np.asarray(values["strain_0_percent"] + thermal + 100.0 * loop.stress_pa * compliance + xi * full)


def fit_loops(loops: Sequence[Loop], *, law: str) -> CurveFit:
    """Fit all values to loops at once."""
    ends = np.cumsum([0, *(len(loop.temp_c) for loop in loops)])
    largest = max(float(np.ptp(loop.strain_percent)) for loop in loops)
    coolest = [_at_half(loop, slice(None, loop.turn + 1)) for loop in loops]
    warmest = [_at_half(loop, slice(loop.turn, None)) for loop in loops]
    guess = (
        Parameter("M_s_c", min(coolest) + 5.0, "°C", lower=-150.0, upper=100.0),
        Parameter("M_width_c", 15.0, "°C", lower=1.0, upper=120.0),
        Parameter("A_s_c", min(warmest) - 5.0, "°C", lower=-150.0, upper=100.0),
        Parameter("A_width_c", 15.0, "°C", lower=1.0, upper=120.0),
        Parameter("C_M_mpa_per_k", 8.0, "MPa/K", lower=1.0, upper=100.0),
        Parameter("C_A_mpa_per_k", 8.0, "MPa/K", lower=1.0, upper=100.0),
        Parameter("H_0_percent", 0.3, "%", lower=0.0, upper=5.0),
        Parameter("H_1_percent", largest, "%", lower=0.1, upper=12.0),
        Parameter("sigma_h_mpa", 80.0, "MPa", lower=5.0, upper=1000.0),
        Parameter("E_A_gpa", 60.0, "GPa", lower=5.0, upper=300.0, sigma=20.0),
        Parameter("E_M_gpa", 30.0, "GPa", lower=5.0, upper=300.0, sigma=15.0),
        Parameter("strain_0_percent", 0.05, "%"),
        # Thermal expansion of NiTi: 6.6e-6 (martensite) to 11e-6 per kelvin (austenite).
        Parameter("alpha_percent_per_k", 9e-4, "%/K", sigma=2e-4),
    )
    return fit_curve(
        lambda values: np.concatenate([strain(loop, values, law=law) for loop in loops]),
        guess,
        np.concatenate([loop.strain_percent for loop in loops]),
        parts=[slice(a, b) for a, b in pairwise(ends.tolist())],
        what=f"loops, {law}",
    )


def _at_half(loop: Loop, part: slice) -> float:
    """Return the temperature at which half of the strain is passed."""
    values = loop.strain_percent[part]
    middle = 0.5 * (float(values.min()) + float(values.max()))
    return float(loop.temp_c[part][int(np.argmin(np.abs(values - middle)))])


def left_out(loops: Mapping[int, Loop], *, law: str) -> dict[str, dict[str, float]]:
    """Return, for every stress, the error of its loop as predicted from the three others."""
    table = {}
    for stress, loop in loops.items():
        found = fit_loops([other for mpa, other in loops.items() if mpa != stress], law=law)
        predicted = strain(loop, found.values, law=law)
        error = loop.strain_percent - predicted
        table[f"{stress} MPa"] = {
            "rmse_percent": rms(error),
            "of_its_range": rms(error) / float(np.ptp(loop.strain_percent)),
            "r2": share_explained(loop.strain_percent, predicted),
            "cooling_off_c": _at_half(loop, slice(None, loop.turn + 1))
            - _at_half(_like(loop, predicted), slice(None, loop.turn + 1)),
            "heating_off_c": _at_half(loop, slice(loop.turn, None))
            - _at_half(_like(loop, predicted), slice(loop.turn, None)),
            "rmse_of_the_fit_percent": found.rmse,
        }
    return table


def _like(loop: Loop, percent: Array) -> Loop:
    return Loop(loop.temp_c, percent, loop.stress_pa, loop.turn)


def main() -> None:
    """Print the errors of prediction for both laws, and the values from all four stresses."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("figure", type=Path, nargs="?", metavar="FIGURE.png")
    given = parser.parse_args()
    loops = {stress: read_loop(given.folder / f"{stress} MPa.txt") for stress in STRESSES_MPA}
    table: dict[str, object] = {}
    for law in ("liang_rogers", "tanaka"):
        found = fit_loops(list(loops.values()), law=law)
        table[law] = {
            "all_four": {
                "rmse_percent": found.rmse,
                "r2": found.r2,
                "values": {name: estimate.to_json() for name, estimate in found.estimates.items()},
            },
            "left_out": left_out(loops, law=law),
        }
    print(json.dumps(table, indent=2, ensure_ascii=False))
    if given.figure is not None:
        lines = []
        for number, (stress, loop) in enumerate(loops.items()):
            found = fit_loops([other for mpa, other in loops.items() if mpa != stress], law="liang_rogers")
            lines.append(Line(loop.temp_c, loop.strain_percent, f"{stress} MPa, measured", f"C{number}."))
            lines.append(
                Line(loop.temp_c, strain(loop, found.values, law="liang_rogers"), "from the other three", f"C{number}-")
            )
        panels = {"Each loop from the other three": lines}
        draw(given.figure, panels, x_label="temperature (°C)", y_label="strain (%)")


if __name__ == "__main__":
    main()
