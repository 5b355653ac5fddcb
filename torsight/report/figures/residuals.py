"""Figures of the residual: over time, against possible drivers of a missing effect, by direction and half-cycle."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
import pandas as pd

from sync.signals.even_signal import WINDOW_S
from torsight.core.files.results import column
from torsight.core.series import rms
from torsight.core.units import Flags, Floats
from torsight.core.words.wording import number
from torsight.report.figures.motion import CURVES, RESIDUAL, TIME, Figure, is_driven, shade_held_out
from torsight.report.plots.panels import Axis, Panel


def is_plain(curves: pd.DataFrame) -> bool:
    """Return whether the curves are only those of the plain model, because nothing was added to it."""
    before, after = column(curves, "residual_before_deg"), column(curves, "residual_after_deg")
    return not np.isfinite(after).any() or np.array_equal(before, after, equal_nan=True)


def shade_floor(plot: Panel, floor: float | None, *, unit: str = "°") -> None:
    """Shade the noise floor, where it is known."""
    if floor:
        plot.band(-floor, floor, "floor", label=f"± noise floor {number(floor, 2)}{unit}", upright=False)


def residual_left(curves: pd.DataFrame, floor_deg: float | None) -> Figure | None:
    """Draw the residual of the extended model on its own scale, with the noise floor; None for a plain model."""
    time_s, after = column(curves, "time_s"), column(curves, "residual_after_deg")
    if is_plain(curves):
        return None
    reach = [-(floor_deg or 0.0), floor_deg or 0.0]
    plot = Panel(Axis.along(TIME, time_s), Axis.around(RESIDUAL, after, reach), height=220)
    shade_held_out(plot, curves)
    plot.line(time_s, after, "after", label="after: extended model")
    shade_floor(plot, floor_deg)
    words = "What is left after the extension, on its own scale"
    return Figure("residual_left", "What is left", "The error after, on its own scale.", (plot,), words, CURVES)


LABELS: Final = {
    "angle_deg": "angle (°)",
    "temp_active_c": "temperature of the driven spring (°C)",
    "temp_passive_c": "temperature of the other spring (°C)",
    "temp_rate_c_s": "rate of the driven spring's temperature (°C/s)",
    "angle_rate_deg_s": "rate of the angle (°/s)",
}
"""Drivers against which the residual is drawn, with their labels."""


def driver_columns(curves: pd.DataFrame) -> dict[str, Floats]:
    """Return the variables that a missing effect may depend on, as curves over the record.

    Rates are slopes over two seconds of the model's angle and of the conditioned temperature: the rates of the measured
    angle and temperature would be noise.
    """
    temp_a, temp_b = column(curves, "temp_a_c"), column(curves, "temp_b_c")
    is_a = is_driven(curves, "a")
    active, passive = np.where(is_a, temp_a, temp_b), np.where(is_a, temp_b, temp_a)
    smooth = column(curves, "extended_deg")
    smooth = smooth if np.isfinite(smooth).any() else column(curves, "plain_deg")
    time_s = column(curves, "time_s")
    # A slope may not cross from one driven spring to the other.
    apart = np.diff(is_a, prepend=is_a[:1])
    return {
        "angle_deg": column(curves, "angle_deg"),
        "temp_active_c": active,
        "temp_passive_c": passive,
        "temp_rate_c_s": slope(time_s, active, window_s=WINDOW_S, apart=apart),
        "angle_rate_deg_s": slope(time_s, smooth, window_s=WINDOW_S),
    }


def slope(time_s: Floats, values: Floats, *, window_s: float, apart: Flags | None = None) -> Floats:
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


def residual_against(curves: pd.DataFrame, variable: str, values: Floats) -> Figure | None:
    """Draw both models' residuals against one variable, with the mean of every part of the motion in 25 bins."""
    before, after = column(curves, "residual_before_deg"), column(curves, "residual_after_deg")
    made = over_variable(values, before, after, branches(curves), label=LABELS[variable], residual=RESIDUAL)
    if made is None:
        return None
    plot, means = made
    title = f"Against {LABELS[variable].split(' (')[0]}"
    words = f"Residual before and after against {LABELS[variable]}"
    data = {"residual": means["residual"], "branch": means["branch"]}
    data |= {variable: means["place"], "mean_deg": means["mean"]}
    return Figure(f"residual_{variable}", title, "", (plot,), words, data=data)


def over_variable(
    values: Floats, before: Floats, after: Floats, parts: Mapping[str, Flags], *, label: str, residual: str
) -> tuple[Panel, dict[str, list[Any]]] | None:
    """Return both residuals over a variable (n,) with the mean of every part of the motion; None if it is constant.

    ``label`` and ``residual`` name the two axes.
    """
    known = np.isfinite(values)
    if known.sum() < 10 or np.ptp(values[known]) <= 0:
        return None
    # A single outlier would compress the range of all others.
    low, high = np.quantile(values[known], [0.001, 0.999])
    inside = known & (values >= low) & (values <= high)
    plot = Panel(
        Axis.around(label, values[inside]), Axis.around(residual, before[inside], after[inside]), width=370, height=240
    )
    for left, kind in ((before, "before"), (after, "after")):
        good = inside & np.isfinite(left)
        if good.any():
            plot.points(values[good], left[good], f"{kind} faint", label=kind)
    data: dict[str, list[Any]] = {"residual": [], "branch": [], "place": [], "mean": []}
    for left, kind in ((before, "before"), (after, "after")):
        for name, branch in parts.items():
            good = inside & branch & np.isfinite(left)
            if good.sum() > 2:
                centre, mean = bin_means(values[good], left[good])
                plot.line(centre, mean, f"{kind} mean")
                kept = np.isfinite(mean)
                data["residual"] += [kind] * int(kept.sum())
                data["branch"] += [name] * int(kept.sum())
                data["place"] += centre[kept].tolist()
                data["mean"] += mean[kept].tolist()
    return plot, data


def branches(curves: pd.DataFrame) -> dict[str, Flags]:
    """Return the samples of each part of the motion, by its name: one spring, heating or cooling.

    The two springs' parts mirror each other, and heating and cooling often differ in sign: a mean over all parts would
    cancel their residuals.
    """
    keys = [name for name in ("active", "direction") if name in curves.columns]
    if not keys:
        return {"all": np.ones(len(curves), dtype=bool)}
    number_of = curves.groupby(keys, sort=False).ngroup().to_numpy()
    moving = np.ones(len(curves), dtype=bool)
    if "direction" in curves.columns:
        moving = (curves["direction"].astype(str) != "rest").to_numpy()
    found: dict[str, Flags] = {}
    for one in range(int(number_of.max(initial=-1)) + 1):
        rows = number_of == one
        name = " ".join(str(part) for part in curves[keys].iloc[int(np.argmax(rows))])
        found[name] = np.asarray(moving & rows)
    return {name: branch for name, branch in found.items() if branch.any()}


def bin_means(x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """Return centre and mean of evenly spaced bins; NaN where a bin holds too few of the samples."""
    bins = 25
    count, edges = np.histogram(x, bins)
    total, _ = np.histogram(x, bins, weights=y)
    enough = count > 0.05 * len(x) / bins  # a twentieth of a bin's samples if all bins were filled evenly
    mean = np.where(enough & (count > 0), total / np.maximum(count, 1), np.nan)
    return (edges[:-1] + edges[1:]) / 2.0, mean


def by_group(curves: pd.DataFrame, by: str, *, width: float, height: float) -> Figure | None:
    """Draw the rms of both residuals by ``direction`` or by ``half_cycle``; held-out half-cycles are shaded."""
    if by not in curves.columns:
        return None
    words = by.replace("_", "-")
    keys = list(dict.fromkeys(curves[by].dropna().tolist()))
    names = [str(int(key) + 1) if by == "half_cycle" else str(key) for key in keys]
    before, after = column(curves, "residual_before_deg"), column(curves, "residual_after_deg")
    groups = [(curves[by] == key).to_numpy() for key in keys]
    levels = [(_rms(before[group]), _rms(after[group])) for group in groups]
    unseen_rows = column(curves, "held_out") > 0.5
    unseen = [by == "half_cycle" and bool(unseen_rows[g].any() and not unseen_rows.all()) for g in groups]
    if not np.isfinite(levels).any():
        return None
    plot = pairs_of_bars(words, "rms residual (°)", names, levels, unseen=unseen, width=width, height=height)
    before_deg, after_deg = map(list, zip(*levels, strict=True))
    data: dict[str, list[Any]] = {by: names, "before_deg": before_deg, "after_deg": after_deg}
    return Figure(f"residual_{by}", f"By {words}", "", (plot,), data=data)


def pairs_of_bars(
    words: str,
    label: str,
    names: Sequence[str],
    levels: Sequence[tuple[float, float]],
    *,
    unseen: Sequence[bool] = (),
    width: float = 860.0,
    height: float,
    unit: str = "°",
) -> Panel:
    """Return a before and an after bar per name; a level that is not finite is left out."""
    top = float(np.nanmax([*np.ravel(levels), 1e-9]))
    plot = Panel(
        Axis(words, -0.6, len(names) - 0.4),
        Axis(label, 0.0, 1.08 * top),
        width=width,
        height=height,
        x_names=[(float(place), name) for place, name in enumerate(names)],
    )
    for place, pair in enumerate(levels):
        if any(unseen[place : place + 1]):
            plot.band(place - 0.48, place + 0.48, "held", label="held-out half-cycle")
        for offset, level, kind in zip((-0.36, 0.02), pair, ("before", "after"), strict=True):
            if np.isfinite(level):
                ends = (place + offset, place + offset + 0.34)
                plot.box(ends, (0.0, level), kind, tip=f"{kind} {level:.3g}{unit}", label=kind)
    return plot


def _rms(values: Floats) -> float:
    values = values[np.isfinite(values)]
    return rms(values) if len(values) else float("nan")
