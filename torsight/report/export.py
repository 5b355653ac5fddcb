"""Every figure of the report beside it: as an SVG that stands alone, with its numbers as CSV."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Final

from torsight.core.storage import write_table, write_text
from torsight.report.figures import Figure

FOLDER: Final = "figures"


def write_figures(folder: Path, figures: Iterable[Figure], style: str) -> None:
    """Write ``figures/NAME.svg``, and ``figures/NAME.csv`` for numbers that stand in no other table.

    Files of figures that the page no longer shows are removed.
    """
    target = folder / FOLDER
    standing = f"<style>{plain_style(style)}</style>"
    written = set()
    for figure in figures:
        text = re.sub(r"(<svg[^>]*>)", rf"\1{standing}", figure.svg, count=1)
        write_text(target / f"{figure.name}.svg", text + "\n")
        written.add(f"{figure.name}.svg")
        if figure.data is not None:
            write_table(target / f"{figure.name}.csv", figure.data)
            written.add(f"{figure.name}.csv")
    for path in target.glob("*") if target.is_dir() else ():
        if path.suffix in {".svg", ".csv"} and path.name not in written and not path.name.startswith("."):
            path.unlink(missing_ok=True)


def plain_style(style: str) -> str:
    """Return a style sheet with its light colours put in for their names: not every program knows CSS variables."""
    colours = dict(re.findall(r"--([a-z-]+):\s*([^;]+);", style[: style.index("}")]))
    rules = style[style.index("}") + 1 :]
    return re.sub(r"var\(--([a-z-]+)\)", lambda found: colours[found.group(1)], rules)


def data_link(figure: Figure) -> str:
    """Return where a figure's numbers are, relative to the page; empty where they are not kept."""
    return f"{FOLDER}/{figure.name}.csv" if figure.data is not None else figure.source
