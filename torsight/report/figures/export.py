"""Files of the report's figures: each as a self-contained SVG, with its numbers as CSV."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Final

from torsight.core.files.storage import write_table, write_text
from torsight.report.figures.motion import Figure
from torsight.report.figures.residuals import LABELS

FOLDER: Final = "figures"
NAMES: Final = frozenset(
    {"before_after", "candidates", "unseen_half_cycles", "next_experiment", "pulls", "angle_time", "temperatures"}
    | {"angle_temperature_a", "angle_temperature_b", "angle_sigma", "both_clocks", "markers", "residual_left"}
    | {f"residual_{name}" for name in (*LABELS, "direction", "half_cycle")}
)
"""Names of all figures that a report may hold, except the laws; only files with these names are ever removed."""


def write_figures(
    folder: Path,
    figures: Iterable[Figure],
    pictures: Mapping[str, str],
    *,
    ours: Callable[[str], bool] = NAMES.__contains__,
) -> None:
    """Write ``figures/NAME.svg``, and ``figures/NAME.csv`` for numbers that no other table holds.

    ``pictures`` holds each figure's SVG by its name. Files of figures that an earlier page showed and this page does
    not are removed where ``ours`` is true for their names; other files are kept.
    """
    target = folder / FOLDER
    written = set()
    for figure in figures:
        write_text(target / f"{figure.name}.svg", pictures[figure.name] + "\n")
        written.add(f"{figure.name}.svg")
        if figure.data is not None:
            write_table(target / f"{figure.name}.csv", figure.data)
            written.add(f"{figure.name}.csv")
    for path in [*target.glob("*.svg"), *target.glob("*.csv")]:
        if path.name not in written and ours(path.stem):
            path.unlink(missing_ok=True)


def data_link(figure: Figure) -> str:
    """Return the path of a figure's numbers, relative to the page; empty where they are not written."""
    return f"{FOLDER}/{figure.name}.csv" if figure.data is not None else figure.source
