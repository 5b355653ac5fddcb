"""Quantities as the paper writes them, by the names of the files: ``E_A_gpa`` is E_A, in GPa."""

from __future__ import annotations

import re
from typing import Final

from torsight.core.words.wording import effect_name

SYMBOLS: Final = {
    "E_A_gpa": "E_A",
    "E_M_gpa": "E_M",
    "E_S_gpa": "E_S",
    "A_s_c": "A_s",
    "A_f_c": "A_f",
    "M_s_c": "M_s",
    "M_f_c": "M_f",
    "C_A_mpa_per_k": "C_A",
    "C_M_mpa_per_k": "C_M",
    "theta_cr_deg": "θ_cr",
    "theta_p_deg": "θ_P",
    "theta_1_deg": "θ_1",
    "theta_2_deg": "θ_2",
    "theta_3_deg": "θ_3",
    "beta_cr_deg": "β_cr",
    "tau_c_mnm": "τ_c",
    "wire_diameter_mm": "d",
    "wire_length_mm": "L",
    "mean_diameter_mm": "D",
    "active_coils": "n",
}
"""Symbols of the paper by the names of the files; an underscore stands before an index."""

_SUFFIXES: Final = re.compile(
    r"_(deg_per_hour|mnm_per_rad3|mnm_per_rad|mnm_s_per_rad|mpa_per_k|deg_per_s|c_per_s|gpa|mpa|mnm|deg|rad|ppm|mm|px|s|c)$"
)
"""Units that the names of quantities end in."""


def plain_symbol(name: str) -> str:
    """Return a quantity's symbol where only plain letters can stand, or its name in words without the unit."""
    return SYMBOLS.get(name) or effect_name(_SUFFIXES.sub("", name))
