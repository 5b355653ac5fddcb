"""Measured laws: one plot for each, in the report and as a picture beside its numbers."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Final

from numpy.typing import NDArray

from torsight.core.files.storage import write_bytes, write_table
from torsight.core.parameter import REACH
from torsight.core.series import runs
from torsight.core.words.wording import capital, effect_name, variable_name
from torsight.discovery.measured_law import DRIVER_UNITS, GIVES, MeasuredLaw
from torsight.report.figures.motion import Figure
from torsight.report.plots.panels import Axis, Panel
from torsight.report.plots.still import png

_OWN_FILES: Final = re.compile(rf"law_({'|'.join(GIVES)})_[a-z0-9_]+\.(csv|png)")


def law_figure(law: MeasuredLaw) -> Figure:
    """Draw one law as a curve with its 95 % interval; the range of the driver that the record covers is shaded."""
    panel = _panel(law)
    title = f"{capital(law.gives)} against {variable_name(law.driver)}"
    about = "" if law.spring == "both" else f" Spring {law.spring.upper()}."
    named = (
        "No known effect has this form." if law.effect is None else f"The named effect is {effect_name(law.effect)}."
    )
    said = f"{capital(law.sentence).rstrip('.')}. " if law.sentence else ""
    caption = f"{said}{named}{about}".strip()
    return Figure(law.csv_name.removesuffix(".csv"), title, caption, (panel,), source=law.csv_name)


def _panel(law: MeasuredLaw) -> Panel:
    across = with_unit(variable_name(law.driver).removeprefix("the "), DRIVER_UNITS.get(law.driver))
    return law_panel(law.table(), across=across, gives=with_unit(law.gives, law.unit), counts=law.driver == "spring")


def with_unit(words: str, unit: str | None) -> str:
    """Return an axis' label: words, and the unit where there is one."""
    return f"{words} ({unit})" if unit else words


def law_panel(table: Mapping[str, NDArray[Any]], *, across: str, gives: str, counts: bool = False) -> Panel:
    """Return the plot of a law's table over its driver; ``counts``: the driver is spring A or B."""
    x, value, sigma, covered = table.values()
    low, high = value - REACH * sigma, value + REACH * sigma
    panel = Panel(
        Axis.around(across, x, margin=0.3 if counts else 0.0),
        Axis.around(gives, low, high),
        height=300.0,
        x_names=[(0.0, "A"), (1.0, "B")] if counts else None,
    )
    for begin, end in [] if counts else runs(covered > 0):
        panel.band(x[begin], x[end - 1], "covered", label="the record reached this")
    panel.rule(0.0, "zero", upright=False)
    if counts:
        for at, bottom, top in zip(x, low, high, strict=True):
            panel.line([at, at], [bottom, top], "after interval")
        panel.points(x, value, "after", label="measured law, with its 95 % interval", radius=4.5)
        return panel
    panel.ribbon(x, low, high, "after ribbon", label="95 %")
    panel.line(x, value, "after", label="measured law")
    return panel


def write_laws(folder: Path, laws: Iterable[MeasuredLaw]) -> None:
    """Write every law as ``law_<port>_<driver>.csv`` and as a picture; those of an earlier answer are removed."""
    kept = set()
    for law in laws:
        picture = folder / law.csv_name.replace(".csv", ".png")
        write_table(folder / law.csv_name, law.table())
        write_bytes(picture, png([_panel(law)]))
        kept |= {law.csv_name, picture.name}
    for path in folder.glob("law_*"):
        if path.name not in kept and _OWN_FILES.fullmatch(path.name):
            path.unlink()
