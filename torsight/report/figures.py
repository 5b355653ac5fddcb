"""The report's figures: motion, temperatures, residuals, tracking; each one function from tables to SVG text."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from torsight.core.tracks import MARKERS
from torsight.core.wording import number
from torsight.report.svg import Axis, Plot

if TYPE_CHECKING:
    import pandas as pd

TIME: Final = "time (s)"
ANGLE: Final = "angle (°)"
RESIDUAL: Final = "measured − model (°)"
TEMPERATURE: Final = "temperature (°C)"


class Figure(NamedTuple):
    """A figure with the name of its file, what it shows, and what to look for."""

    name: str
    title: str
    caption: str
    svg: str


def column(table: pd.DataFrame, name: str) -> NDArray[np.float64]:
    """Return a column as float64 (NaN throughout where it is absent)."""
    if name not in table.columns:
        return np.full(len(table), np.nan)
    return np.asarray(table[name].to_numpy(dtype=np.float64))


def spans(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return first and last index of every run of true flags."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    return [(int(a), int(b) - 1) for a, b in edges.reshape(-1, 2)]


def shade_held_out(plot: Plot, curves: pd.DataFrame) -> None:
    """Shade the half-cycles that the fit did not see."""
    held = column(curves, "held_out") > 0.5
    if held.all():
        # Every half-cycle was left out in turn: there is nothing to tell apart.
        return
    time_s = column(curves, "time_s")
    for first, last in spans(held):
        plot.band(time_s[first], time_s[last], "held", label="half-cycle that the fit did not see")


def angle_over_time(curves: pd.DataFrame) -> Figure:
    """Angle against time, measured and modelled (the paper's figure 15)."""
    time_s, angle = column(curves, "time_s"), column(curves, "angle_deg")
    plain, extended = column(curves, "plain_deg"), column(curves, "extended_deg")
    plot = Plot(
        Axis(TIME, float(time_s[0]), float(time_s[-1]), ticks=10),
        Axis.around(ANGLE, angle, plain, extended),
        "Angle against time, measured and modelled",
        height=330,
    )
    shade_held_out(plot, curves)
    _models(plot, time_s, angle, plain, extended, ordered=True)
    return Figure(
        "angle_time", "Angle against time", "Positive is counter-clockwise as the film shows it.", plot.render()
    )


def _models(
    plot: Plot,
    x: NDArray[np.float64],
    angle: NDArray[np.float64],
    plain: NDArray[np.float64],
    extended: NDArray[np.float64],
    *,
    ordered: bool,
) -> None:
    alone = not np.isfinite(plain).any()
    plot.line(x, angle, "ink" if alone else "measured", label="measured", ordered=ordered)
    if np.isfinite(plain).any():
        plot.line(x, plain, "before", label="plain model", ordered=ordered)
    if np.isfinite(extended).any() and not np.array_equal(extended, plain, equal_nan=True):
        plot.line(x, extended, "after", label="extended model", ordered=ordered)


def temperatures_over_time(table: pd.DataFrame) -> Figure:
    """Both springs' temperatures against time (the paper's figure 16)."""
    time_s = column(table, "time_s")
    temp_a, temp_b = column(table, "temp_a_c"), column(table, "temp_b_c")
    plot = Plot(
        Axis(TIME, float(time_s[0]), float(time_s[-1]), ticks=10),
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
    )


def angle_over_temperature(curves: pd.DataFrame, spring: str) -> Figure | None:
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
    _models(plot, temp_c, angle, plain, extended, ordered=False)
    return Figure(
        f"angle_temperature_{spring}",
        f"While spring {spring.upper()} is driven",
        "",
        plot.render(),
    )


def residual_over_time(curves: pd.DataFrame) -> Figure:
    """Residual of both models against time, on one scale."""
    time_s = column(curves, "time_s")
    before, after = column(curves, "residual_before_deg"), column(curves, "residual_after_deg")
    plot = Plot(
        Axis(TIME, float(time_s[0]), float(time_s[-1]), ticks=10),
        Axis.around(RESIDUAL, before, after),
        "Residual before and after against time",
        height=270,
    )
    shade_held_out(plot, curves)
    plot.line(time_s, before, "before", label="before: plain model")
    if np.isfinite(after).any():
        plot.line(time_s, after, "after", label="after: extended model")
    return Figure("residual_time", "Residual before and after", "Both on one scale.", plot.render())


def residual_left(curves: pd.DataFrame, floor_deg: float | None) -> Figure | None:
    """Residual of the extended model alone, on its own scale, with the noise floor."""
    time_s, after = column(curves, "time_s"), column(curves, "residual_after_deg")
    if not np.isfinite(after).any():
        return None
    plot = Plot(
        Axis(TIME, float(time_s[0]), float(time_s[-1]), ticks=10),
        Axis.around(RESIDUAL, after, [-(floor_deg or 0.0), floor_deg or 0.0]),
        "What is left after the extension, on its own scale",
        height=220,
    )
    shade_held_out(plot, curves)
    plot.line(time_s, after, "after", label="after: extended model")
    if floor_deg:
        plot.range_y(-floor_deg, floor_deg, "floor", label=f"± noise floor {number(floor_deg, 2)}°")
    return Figure("residual_left", "What is left", "The same residual on its own scale.", plot.render())


LABELS: Final = {
    "angle_deg": "angle (°)",
    "temp_active_c": "temperature of the driven spring (°C)",
    "temp_passive_c": "temperature of the other spring (°C)",
    "temp_rate_c_s": "rate of the driven spring's temperature (°C/s)",
    "angle_rate_deg_s": "rate of the angle (°/s)",
}
"""Drivers that the residual is drawn against, with their labels."""


def driver_columns(curves: pd.DataFrame, *, window_s: float = 2.0) -> dict[str, NDArray[np.float64]]:
    """Return the variables that a missing effect may depend on, as curves over the record.

    Rates are slopes over ``window_s`` of the model's angle and of the temperature as driven: those of the measured
    ones would be noise.
    """
    temp_a, temp_b = column(curves, "temp_a_c"), column(curves, "temp_b_c")
    if "active" in curves.columns:
        is_a = (curves["active"].astype(str).str.lower() == "a").to_numpy()
    else:
        is_a = temp_a >= temp_b
    active, passive = np.where(is_a, temp_a, temp_b), np.where(is_a, temp_b, temp_a)
    smooth = column(curves, "extended_deg")
    smooth = smooth if np.isfinite(smooth).any() else column(curves, "plain_deg")
    time_s = column(curves, "time_s")
    # A slope may not cross from one driven spring to the other.
    apart = np.concatenate([[False], is_a[1:] != is_a[:-1]])
    return {
        "angle_deg": column(curves, "angle_deg"),
        "temp_active_c": active,
        "temp_passive_c": passive,
        "temp_rate_c_s": slope(time_s, active, window_s=window_s, apart=apart),
        "angle_rate_deg_s": slope(time_s, smooth, window_s=window_s),
    }


def slope(
    time_s: NDArray[np.float64],
    values: NDArray[np.float64],
    *,
    window_s: float,
    apart: NDArray[np.bool_] | None = None,
) -> NDArray[np.float64]:
    """Return the slope of ``values`` across a window centred on each sample; NaN across a mark of ``apart``."""
    n = len(time_s)
    first = np.searchsorted(time_s, time_s - window_s / 2.0)
    last = np.minimum(np.searchsorted(time_s, time_s + window_s / 2.0, side="right") - 1, n - 1)
    # Records slower than the window: take the neighbours.
    short = last - first < 2
    first = np.where(short, np.maximum(np.arange(n) - 1, 0), first)
    last = np.where(short, np.minimum(np.arange(n) + 1, n - 1), last)
    step_s = time_s[last] - time_s[first]
    result = (values[last] - values[first]) / np.where(step_s > 0, step_s, np.nan)
    if apart is not None:
        count = np.cumsum(apart)
        result = np.where(count[last] > count[first], np.nan, result)
    return np.asarray(result)


def residual_against(curves: pd.DataFrame, variable: str, values: NDArray[np.float64]) -> Figure | None:
    """Residual of both models against one variable, with the mean of every branch in twenty-five bins."""
    known = np.isfinite(values)
    if known.sum() < 10 or np.ptp(values[known]) <= 0:
        return None
    before, after = column(curves, "residual_before_deg"), column(curves, "residual_after_deg")
    low, high = np.quantile(values[known], [0.001, 0.999])
    inside = known & (values >= low) & (values <= high)
    plot = Plot(
        Axis.around(LABELS[variable], values[inside], ticks=6),
        Axis.around(RESIDUAL, before[inside], after[inside]),
        f"Residual before and after against {LABELS[variable]}",
        width=370,
        height=240,
    )
    for residual, kind, label in ((before, "before", "before"), (after, "after", "after")):
        good = inside & np.isfinite(residual)
        if good.any():
            plot.points(values[good], residual[good], f"{kind} faint", label=label)
    for residual, kind in ((before, "before"), (after, "after")):
        for branch in branches(curves):
            good = inside & branch & np.isfinite(residual)
            if good.sum() > 2:
                plot.line(*bin_means(values[good], residual[good], bins=25), f"{kind} mean")
    return Figure(f"residual_{variable}", f"Against {LABELS[variable].split(' (')[0]}", "", plot.render())


def branches(curves: pd.DataFrame) -> list[NDArray[np.bool_]]:
    """Return the samples of each branch of the motion: one spring, heating or cooling.

    The two springs' branches mirror each other, and heating and cooling often differ in sign: a mean over all of
    them would hide what each shows.
    """
    keys = [name for name in ("active", "direction") if name in curves.columns]
    if not keys:
        return [np.ones(len(curves), dtype=bool)]
    number_of = curves.groupby(keys, sort=False).ngroup().to_numpy()
    moving = np.ones(len(curves), dtype=bool)
    if "direction" in curves.columns:
        moving = (curves["direction"].astype(str) != "rest").to_numpy()
    found = [np.asarray(moving & (number_of == one)) for one in range(int(number_of.max()) + 1)]
    return [branch for branch in found if branch.any()]


def bin_means(
    x: NDArray[np.float64], y: NDArray[np.float64], *, bins: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return centre and mean of evenly spaced bins; NaN where a bin holds too little of the samples to mean much."""
    edges = np.linspace(x.min(), x.max(), bins + 1)
    place = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, bins - 1)
    count = np.bincount(place, minlength=bins)
    total = np.bincount(place, weights=y, minlength=bins)
    enough = count > 0.05 * len(x) / bins
    mean = np.where(enough & (count > 0), total / np.maximum(count, 1), np.nan)
    return (edges[:-1] + edges[1:]) / 2.0, mean


def residual_by_group(curves: pd.DataFrame, by: str, title: str, words: str) -> Figure | None:
    """Root mean square of both residuals for each value of a column, as pairs of bars."""
    if by not in curves.columns:
        return None
    keys = list(dict.fromkeys(curves[by].tolist()))
    before, after = column(curves, "residual_before_deg"), column(curves, "residual_after_deg")
    groups = [(curves[by] == key).to_numpy() for key in keys]
    levels = [[_rms(residual[group]) for residual in (before, after)] for group in groups]
    unseen_rows = column(curves, "held_out") > 0.5
    held = [bool(unseen_rows[group].any() and not unseen_rows.all()) for group in groups]
    top = float(np.nanmax([*np.ravel(levels), 1e-9]))
    plot = Plot(
        Axis(words, -0.6, len(keys) - 0.4),
        Axis("rms residual (°)", 0.0, 1.08 * top, ticks=5),
        title,
        width=860 if by == "half_cycle" else 370,
        height=200 if by == "half_cycle" else 240,
        x_labels=[(float(k), str(int(key) + 1) if by == "half_cycle" else str(key)) for k, key in enumerate(keys)],
    )
    for place, ((level_before, level_after), unseen) in enumerate(zip(levels, held, strict=True)):
        if unseen and by == "half_cycle":
            plot.band(place - 0.48, place + 0.48, "held", label="half-cycle that the fit did not see")
        for offset, level, kind in ((-0.36, level_before, "before"), (0.02, level_after, "after")):
            if np.isfinite(level):
                plot.box((place + offset, place + offset + 0.34), (0.0, level), kind, tip=f"{kind} {level:.2f}°")
                plot.legend(kind, "line", kind)
    return Figure(f"residual_{by}", title, "", plot.render())


def _rms(values: NDArray[np.float64]) -> float:
    values = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(values**2))) if len(values) else float("nan")


def sigma_over_time(angle: pd.DataFrame) -> Figure | None:
    """Draw sigma of the measured angle over time, with the lost stretches shaded."""
    time_s, sigma = column(angle, "time_s"), column(angle, "angle_sigma_deg")
    valid = column(angle, "valid") > 0.5
    if not np.isfinite(sigma[valid]).any():
        return None
    top = float(np.nanquantile(sigma[valid], 0.999)) * 1.25
    plot = Plot(
        Axis(TIME, float(time_s[0]), float(time_s[-1]), ticks=10),
        Axis("sigma of the angle (°)", 0.0, top if top > 0 else 1.0, ticks=4),
        "Standard deviation of the angle over time",
        height=190,
    )
    for first, last in spans(~valid):
        plot.band(time_s[first], time_s[last], "lost", label="angle not measured")
    plot.line(time_s, np.where(valid, np.minimum(sigma, top), np.nan), "ink", label="sigma of the angle")
    return Figure("sigma", "How well the angle was measured", "", plot.render())


def marker_paths(markers: pd.DataFrame) -> Figure | None:
    """Paths of the four markers as the film shows them, and the sticks at the first and the last frame."""
    found = {name: (column(markers, f"{name}_x_px"), column(markers, f"{name}_y_px")) for name in MARKERS}
    every_x, every_y = (np.concatenate([path[k] for path in found.values()]) for k in (0, 1))
    if not (np.isfinite(every_x) & np.isfinite(every_y)).any():
        return None
    centre = [(np.nanmin(one) + np.nanmax(one)) / 2.0 for one in (every_x, every_y)]
    half = 0.56 * max(np.nanmax(every_x) - np.nanmin(every_x), np.nanmax(every_y) - np.nanmin(every_y), 10.0)
    plot = Plot(
        Axis("x (px)", centre[0] - half, centre[0] + half, ticks=5),
        Axis("y (px), down", centre[1] + half, centre[1] - half, ticks=5),
        "Paths of the four markers in the picture",
        width=420,
        height=420,
        legend_rows=2,
        left=62,
    )
    for name, (x, y) in found.items():
        plot.line(x, y, name.split("_")[0], label=f"{name.split('_')[0]} stick", ordered=False)
    for stick in ("base", "moving"):
        inner, outer = found[f"{stick}_inner"], found[f"{stick}_outer"]
        both = np.flatnonzero(np.isfinite(inner[0]) & np.isfinite(outer[0]))
        for index, kind in ((both[:1], "first"), (both[-1:], "last")):
            for k in index:
                ends = [inner[0][k], outer[0][k]], [inner[1][k], outer[1][k]]
                plot.line(*ends, f"{stick} stick {kind}", ordered=False)
                plot.dots(*ends, f"{stick} {kind}")
    plot.legend("ink stick first", "line", "first frame")
    plot.legend("ink stick last", "line", "last frame")
    return Figure("markers", "Where the markers went", "", plot.render())
