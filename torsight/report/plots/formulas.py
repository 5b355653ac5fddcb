"""Symbols and equations on the page: ``E_A_gpa`` of the files is E with the index A."""

from __future__ import annotations

import ast
import io
import re
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import matplotlib as mpl
from markupsafe import Markup, escape
from matplotlib.font_manager import FontProperties
from matplotlib.mathtext import math_to_image

from torsight.actuator.quantities import in_symbols, plain_symbol, quantity
from torsight.report.plots.still import bare, picture_data


def symbol(name: str) -> Markup:
    """Return a quantity's symbol as HTML, or its name in words without the unit where it has none."""
    letters, _, index = quantity(name).symbol.partition("_")
    if not letters:
        return escape(plain_symbol(name))
    return Markup("<i>{}</i>").format(letters) + (Markup("<sub>{}</sub>").format(index) if index else "")


def titled(name: str) -> Markup:
    """Return a quantity's title with its symbol as HTML, or its name in words where it has none."""
    found = quantity(name)
    return Markup("{} {}").format(found.title, symbol(name)) if found.symbol and found.title else symbol(name)


def with_symbols(words: str) -> Markup:
    """Return a sentence as HTML, with symbols in place of the files' names."""
    return Markup(in_symbols(escape(words), symbol))  # noqa: S704 - escaped before


@cache
def equation(effect: str) -> tuple[str, ...]:
    """Return the equations of an effect as its file states them (LaTeX); none where the effect is not installed."""
    found = find_spec(f"torsight.actuator.effects.{effect}") if effect.isidentifier() else None
    if found is None or found.origin is None:
        return ()
    text = ast.get_docstring(ast.parse(Path(found.origin).read_text(encoding="utf-8"))) or ""
    block = re.search(r"^\.\. math::[ \t]*(.*(?:\n(?:[ \t]+.*)?)*)", text, flags=re.MULTILINE)
    parts = re.split(r",?\s*\\q?quad\b", " ".join(block.group(1).split())) if block else []
    return tuple(part.strip() for part in parts if part.strip())


@cache
def equation_picture(latex: str) -> str:
    """Return an equation as an SVG, black on nothing; empty where matplotlib cannot set it."""
    # The same salt as for the plots: the same equation makes the same bytes.
    with mpl.rc_context({"svg.hashsalt": "torsight", "svg.fonttype": "path", "savefig.transparent": True}):
        buffer = io.BytesIO()
        try:
            math_to_image(f"${latex}$", buffer, prop=FontProperties(size=13), format="svg")
        except ValueError:
            # A user's own effect may use commands that mathtext does not know; the page then shows the source.
            return ""
    return bare(buffer.getvalue().decode())


def equation_pictures(effect: str) -> list[tuple[str, str]]:
    """Return an effect's equations as LaTeX and as data URLs of their pictures (empty where one cannot be set)."""
    parts = [(latex, equation_picture(latex)) for latex in equation(effect)]
    return [(latex, picture_data(svg) if svg else "") for latex, svg in parts]
