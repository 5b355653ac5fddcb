"""What all figures of the report share, and those of the motion; each one function from tables to SVG text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from torsight.core.series import runs
from torsight.report.svg import Axis, Plot

if TYPE_CHECKING:
    import pandas as pd

TIME: Final = "time (s)"
ANGLE: Final = "angle (°)"
RESIDUAL: Final = "measured − model (°)"
TEMPERATURE: Final = "temperature (°C)"


CURVES: Final = "curves.csv"


class Figure(NamedTuple):
    """A figure with the name of its files, what it shows, and what to look for.

    ``source`` is the table of the run's folder whose columns are drawn; where numbers are drawn that stand in no table
    they are ``data``, column by column.
    """

    name: str
    title: str
    caption: str
    svg: str
    source: str = ""
    data: Mapping[str, Sequence[Any]] | None = None


def column(table: pd.DataFrame, name: str) -> NDArray[np.float64]:
    """Return a column as float64 (NaN throughout where it is absent)."""
    if name not in table.columns:
        return np.full(len(table), np.nan)
    return np.asarray(table[name].to_numpy(dtype=np.float64))


def shade_held_out(plot: Plot, curves: pd.DataFrame) -> None:
    """Shade the half-cycles that the fit did not see."""
    held = column(curves, "held_out") > 0.5
    if held.all():
        # Every half-cycle was left out in turn: there is nothing to tell apart.
        return
    time_s = column(curves, "time_s")
    for begin, end in runs(held):
        plot.band(time_s[begin], time_s[end - 1], "held", label="half-cycle that the fit did not see")


def angle_over_time(curves: pd.DataFrame, *, source: str = CURVES) -> Figure:
    """Angle against time, measured and modelled (the paper's figure 15)."""
    time_s, angle = column(curves, "time_s"), column(curves, "angle_deg")
    plain, extended = column(curves, "plain_deg"), column(curves, "extended_deg")
    plot = Plot(
        Axis.along(TIME, time_s),
        Axis.around(ANGLE, angle, plain, extended),
        "Angle against time, measured and modelled",
        height=330,
    )
    shade_held_out(plot, curves)
    models(plot, time_s, angle, plain, extended, ordered=True)
    return Figure(
        "angle_time", "Angle against time", "Positive is counter-clockwise as the film shows it.", plot.render(), source
    )


def models(
    plot: Plot,
    x: NDArray[np.float64],
    angle: NDArray[np.float64],
    plain: NDArray[np.float64],
    extended: NDArray[np.float64],
    *,
    ordered: bool,
) -> None:
    """Draw the measured curve and the models that there are."""
    alone = not np.isfinite(plain).any()
    plot.line(x, angle, "ink" if alone else "measured", label="measured", ordered=ordered)
    if np.isfinite(plain).any():
        plot.line(x, plain, "before", label="plain model", ordered=ordered)
    if np.isfinite(extended).any() and not np.array_equal(extended, plain, equal_nan=True):
        plot.line(x, extended, "after", label="extended model", ordered=ordered)


def temperatures_over_time(table: pd.DataFrame, *, source: str = CURVES) -> Figure:
    """Both springs' temperatures against time (the paper's figure 16)."""
    time_s = column(table, "time_s")
    temp_a, temp_b = column(table, "temp_a_c"), column(table, "temp_b_c")
    plot = Plot(
        Axis.along(TIME, time_s),
        Axis.around(TEMPERATURE, temp_a, temp_b),
        "Temperatures of both springs against time",
        height=240,
    )
    plot.line(time_s, temp_a, "spring-a", label="spring A")
    plot.line(time_s, temp_b, "spring-b", label="spring B")
    return Figure(
        "temperatures",
        "Temperatures against time",
        "Where one spring is heated, look at how far the other one follows.",
        plot.render(),
        source,
    )


def angle_over_temperature(curves: pd.DataFrame, spring: str, *, source: str = CURVES) -> Figure | None:
    """Angle against the temperature of the spring that is driven (the paper's figure 17); None where it never is."""
    temp_c = column(curves, f"temp_{spring}_c")
    if "active" in curves.columns:
        driven = (curves["active"].astype(str).str.lower() == spring).to_numpy()
    else:
        driven = temp_c >= np.fmax(column(curves, "temp_a_c"), column(curves, "temp_b_c"))
    if driven.sum() < 3:
        return None
    names = ("angle_deg", "plain_deg", "extended_deg")
    angle, plain, extended = (np.where(driven, column(curves, name), np.nan) for name in names)
    plot = Plot(
        Axis.around(f"temperature of spring {spring.upper()} (°C)", temp_c[driven], ticks=6),
        Axis.around(ANGLE, angle, plain, extended),
        f"Angle against the temperature of spring {spring.upper()}",
        width=420,
        height=330,
    )
    models(plot, temp_c, angle, plain, extended, ordered=False)
    return Figure(
        f"angle_temperature_{spring}",
        f"While spring {spring.upper()} is driven",
        "",
        plot.render(),
        source,
    )
