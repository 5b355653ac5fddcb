"""Figures of the measurement: the angle and its standard deviation, events, both clocks, the markers' paths."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from torsight.core.files.results import column
from torsight.core.series import runs
from torsight.core.tracks import MARKERS
from torsight.report.figures.motion import ANGLE, TIME, Figure, temperature_panel
from torsight.report.figures.residuals import slope
from torsight.report.plots.panels import Axis, Panel


def angle_and_sigma(angle: pd.DataFrame, events: Sequence[Mapping[str, Any]]) -> Figure | None:
    """Draw the measured angle and its sigma over time, lost stretches shaded, the tracker's events marked."""
    time_s, degrees = column(angle, "time_s"), column(angle, "angle_deg")
    sigma, valid = column(angle, "angle_sigma_deg"), column(angle, "valid") > 0.5
    if not (np.isfinite(degrees[valid]).any() and np.isfinite(sigma[valid]).any()):
        return None
    motion = Panel(Axis.along("", time_s), Axis.around(ANGLE, degrees[valid]), height=210)
    # One frame in a thousand may be worse: it is drawn at the upper edge.
    top = float(np.nanquantile(sigma[valid], 0.999)) * 1.25
    spread = Panel(Axis.along(TIME, time_s), Axis("sigma (°)", 0.0, top if top > 0 else 1.0), height=170)
    for plot, label in ((motion, "angle not measured"), (spread, "")):
        for begin, end in runs(~valid):
            plot.band(time_s[begin], time_s[end - 1], "lost", label=label)
    motion.line(time_s, np.where(valid, degrees, np.nan), "ink", label="measured angle")
    for event in events:
        at_s = event.get("time_s")
        if isinstance(at_s, (int, float)) and np.isfinite(at_s):
            motion.rule(float(at_s), "event", tip=f"{event.get('kind', '')}: {event.get('text', '')}", label="event")
    spread.line(time_s, np.where(valid, np.minimum(sigma, top), np.nan), "ink", label="sigma of the angle")
    words = "The measured angle and its standard deviation over time"
    return Figure("angle_sigma", "The angle and its standard deviation", "", (motion, spread), words, "angle.csv")


def both_clocks(merged: pd.DataFrame) -> Figure | None:
    """Draw temperatures and speed of the motion on one clock: every motion must fall into a heating or cooling."""
    time_s, angle = column(merged, "time_s"), column(merged, "angle_deg")
    known = np.isfinite(angle)
    if known.sum() < 10 or not np.isfinite([column(merged, f"temp_{spring}_c") for spring in "ab"]).any():
        return None
    window_s = max(2.0, float(np.ptp(time_s)) / 300.0)  # three pixels of the plot
    speed = np.abs(slope(time_s[known], angle[known], window_s=window_s))
    heat = temperature_panel(merged, Axis.along("", time_s), height=170, source=", by its own log")
    motion = Panel(Axis.along(TIME, time_s), Axis.around("speed (°/s)", [0.0], speed), height=160)
    motion.line(time_s[known], speed, "ink", label="speed of the motion, by the film")
    words = "Temperatures by the log and speed of the motion by the film, on the film's clock"
    caption = "Every motion must fall where a spring is heated or cools through its transformation."
    return Figure("both_clocks", "Log and film on one clock", caption, (heat, motion), words, "merged.csv")


def marker_paths(markers: pd.DataFrame) -> Figure | None:
    """Draw the paths of the four markers in the picture, and the sticks in the first and the last frame."""
    found = {name: (column(markers, f"{name}_x_px"), column(markers, f"{name}_y_px")) for name in MARKERS}
    every_x, every_y = (np.concatenate([path[k] for path in found.values()]) for k in (0, 1))
    if not (np.isfinite(every_x) & np.isfinite(every_y)).any():
        return None
    centre = [(np.nanmin(one) + np.nanmax(one)) / 2.0 for one in (every_x, every_y)]
    half = 0.56 * max(np.nanmax(every_x) - np.nanmin(every_x), np.nanmax(every_y) - np.nanmin(every_y), 10.0)
    plot = Panel(
        Axis("x (px)", centre[0] - half, centre[0] + half),
        Axis("y (px), down", centre[1] + half, centre[1] - half),
        width=420,
        height=420,
        square=True,
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
                plot.points(*ends, f"{stick} {kind}", radius=4.0)
    plot.key("ink stick first", "first frame")
    plot.key("ink stick last", "last frame")
    words = "Paths of the four markers in the picture"
    return Figure("markers", "Where the markers went", "", (plot,), words, "markers.csv")
