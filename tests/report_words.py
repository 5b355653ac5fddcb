"""What a report says, without its plots: they take most of the time, and tests of words do without."""

from __future__ import annotations

from pathlib import Path

from torsight.core.files.results import read_results
from torsight.report.figures.motion import Figure
from torsight.report.write import contents, page


def words_of(folder: Path) -> str:
    """Return the page of a run's folder as text, every figure by its title, caption and legend alone."""
    return page(contents(read_results(folder)))


def figures_of(folder: Path) -> dict[str, Figure]:
    """Return the figures of a run's folder by their names, not drawn yet."""
    return {figure.name: figure for some in contents(read_results(folder))["figures"].values() for figure in some}
