"""The class of all figures of the report, and the figures of the motion, each a function from tables to panels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import pandas as pd

from torsight.core.files.results import column
from torsight.core.series import runs
from torsight.core.units import Flags, Floats
from torsight.report.plots.panels import Axis, Panel, Style, style_of

TIME: Final = "time (s)"
ANGLE: Final = "angle (°)"
RESIDUAL: Final = "measured − model (°)"
TEMPERATURE: Final = "temperature (°C)"
CURVES: Final = "curves.csv"


@dataclass(frozen=True, slots=True, eq=False)
class Figure:
    """A figure: its panels one above the other, what it shows (title), and what to look for (caption).

    ``name`` is the stem of its files and its anchor in the page. ``words`` is the text for people who cannot see the
    figure, by default the title. ``source`` is the table of the run's folder whose columns are drawn, ``data`` holds
    drawn numbers that no table holds, column by column.
    """

    name: str
    title: str
    caption: str
    panels: tuple[Panel, ...]
    words: str = ""
    source: str = ""
    data: Mapping[str, Sequence[Any]] | None = None

    @property
    def height(self) -> float:
        """Height of all panels together, pixels."""
        return sum(panel.height for panel in self.panels)

    @property
    def drawn_height(self) -> float:
        """Height in pixels, with Bokeh's row of tools, 32 px, above panels that share it."""
        return self.height + (32.0 if len(self.panels) > 1 else 0.0)

    @property
    def legend(self) -> list[tuple[str, str, Style]]:
        """Entries of the legend: kind of mark, words, style; each once."""
        found: dict[str, tuple[str, str, Style]] = {}
        for panel in self.panels:
            for mark, label in panel.legend():
                found.setdefault(label, (type(mark).__name__.lower(), label, style_of(mark.kind)))
        return list(found.values())


def shade_held_out(plot: Panel, curves: pd.DataFrame) -> None:
    """Shade the held-out half-cycles."""
    held = column(curves, "held_out") > 0.5
    if held.all():
        # Every half-cycle was held out in turn: there is nothing to distinguish.
        return
    time_s = column(curves, "time_s")
    for begin, end in runs(held):
        plot.band(time_s[begin], time_s[end - 1], "held", label="held-out half-cycle")


def angle_over_time(curves: pd.DataFrame, *, source: str) -> Figure:
    """Draw the angle against time, measured and modelled (the paper's figure 15)."""
    time_s, angle = column(curves, "time_s"), column(curves, "angle_deg")
    plain, extended = column(curves, "plain_deg"), column(curves, "extended_deg")
    plot = Panel(Axis.along(TIME, time_s), Axis.around(ANGLE, angle, plain, extended), height=330)
    shade_held_out(plot, curves)
    models(plot, time_s, angle, plain, extended, ordered=True)
    caption = "Positive is counter-clockwise as the film shows it."
    words = "Angle against time, measured and modelled"
    return Figure("angle_time", "Angle against time", caption, (plot,), words, source)


def models(plot: Panel, x: Floats, angle: Floats, plain: Floats, extended: Floats, *, ordered: bool) -> None:
    """Draw the measured curve and those of the available models."""
    alone = not np.isfinite(plain).any()
    plot.line(x, angle, "ink" if alone else "measured", label="measured", ordered=ordered)
    if np.isfinite(plain).any():
        plot.line(x, plain, "before", label="plain model", ordered=ordered)
    if np.isfinite(extended).any() and not np.array_equal(extended, plain, equal_nan=True):
        plot.line(x, extended, "after", label="extended model", ordered=ordered)


def is_driven(curves: pd.DataFrame, spring: str) -> Flags:
    """Return the mask of the rows in which a spring is driven: from the table, else where it is warmer."""
    if "active" in curves.columns:
        return np.asarray((curves["active"].astype(str).str.lower() == spring).to_numpy())
    temps = [column(curves, f"temp_{one}_c") for one in "ab"]
    return np.asarray(temps["ab".index(spring)] >= np.fmax(*temps))


def temperature_panel(table: pd.DataFrame, along: Axis, *, height: float, source: str = "") -> Panel:
    """Return a panel of both springs' temperatures; the legend names their origin, ``source``."""
    temps = {spring: column(table, f"temp_{spring}_c") for spring in "ab"}
    plot = Panel(along, Axis.around(TEMPERATURE, *temps.values()), height=height)
    for spring, temp_c in temps.items():
        plot.line(column(table, "time_s"), temp_c, f"spring-{spring}", label=f"spring {spring.upper()}{source}")
    return plot


def temperatures_over_time(table: pd.DataFrame, *, source: str) -> Figure:
    """Draw both springs' temperatures against time (the paper's figure 16)."""
    plot = temperature_panel(table, Axis.along(TIME, column(table, "time_s")), height=240)
    caption = "Where one spring is heated, check how much the other one warms up."
    words = "Temperatures of both springs against time"
    return Figure("temperatures", "Temperatures against time", caption, (plot,), words, source)


def angle_over_temperature(curves: pd.DataFrame, spring: str, *, source: str) -> Figure | None:
    """Draw the angle against a driven spring's temperature (the paper's figure 17); None if it is never driven."""
    temp_c = column(curves, f"temp_{spring}_c")
    driven = is_driven(curves, spring)
    if driven.sum() < 3:
        return None
    names = ("angle_deg", "plain_deg", "extended_deg")
    angle, plain, extended = (np.where(driven, column(curves, name), np.nan) for name in names)
    plot = Panel(
        Axis.around(f"temperature of spring {spring.upper()} (°C)", temp_c[driven]),
        Axis.around(ANGLE, angle, plain, extended),
        width=420,
        height=330,
    )
    models(plot, temp_c, angle, plain, extended, ordered=False)
    title = f"While spring {spring.upper()} is driven"
    words = f"Angle against the temperature of spring {spring.upper()}"
    return Figure(f"angle_temperature_{spring}", title, "", (plot,), words, source)
