"""Quantities as the paper writes them: ``E_A_gpa`` of the files is E with the index A, in GPa."""

from __future__ import annotations

import ast
import re
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Final

from markupsafe import Markup, escape

from torsight.core.wording import effect_name
from torsight.report.still import bare

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


def symbol(name: str) -> Markup:
    """Return a quantity's symbol as HTML, or its name in words without the unit where the paper has none."""
    letters, _, index = SYMBOLS.get(name, "").partition("_")
    if not letters:
        return escape(plain_symbol(name))
    return Markup("<i>{}</i>").format(letters) + (Markup("<sub>{}</sub>").format(index) if index else "")


def with_symbols(words: str) -> Markup:
    """Return a sentence as HTML, with symbols in place of the files' names."""
    pattern = r"\b(" + "|".join(sorted(SYMBOLS, key=len, reverse=True)) + r")\b"
    return Markup(re.sub(pattern, lambda found: symbol(found.group()), escape(words)))  # noqa: S704 - escaped before


@cache
def equation(effect: str) -> tuple[str, ...]:
    """Return the equations of an effect as its file states them (LaTeX); none where the effect is not here."""
    for package in ("torsight.actuator.effects", "torsight.actuator.nameless"):
        found = find_spec(f"{package}.{effect}") if effect.isidentifier() else None
        if found is not None and found.origin is not None:
            text = ast.get_docstring(ast.parse(Path(found.origin).read_text(encoding="utf-8"))) or ""
            block = re.search(r"^\.\. math::[ \t]*(.*(?:\n(?:[ \t]+.*)?)*)", text, flags=re.MULTILINE)
            parts = re.split(r",?\s*\\q?quad\b", " ".join(block.group(1).split())) if block else []
            return tuple(part.strip() for part in parts if part.strip())
    return ()


@cache
def equation_picture(latex: str) -> str:
    """Return an equation as an SVG, black on nothing; empty where matplotlib cannot set it."""
    import io

    import matplotlib as mpl
    from matplotlib.font_manager import FontProperties
    from matplotlib.mathtext import math_to_image

    # The same salt as for the plots: the same equation makes the same bytes.
    with mpl.rc_context({"svg.hashsalt": "torsight", "svg.fonttype": "path", "savefig.transparent": True}):
        buffer = io.BytesIO()
        try:
            math_to_image(f"${latex}$", buffer, prop=FontProperties(size=13), format="svg")
        except ValueError:
            # Someone's own effect may use what mathtext does not know; the page shows the source then.
            return ""
    return bare(buffer.getvalue().decode())
