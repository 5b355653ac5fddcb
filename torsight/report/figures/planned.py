"""Figure of the proposed experiment: the programme, and the angle that each explanation predicts under it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
import pandas as pd

from torsight.core.files.results import column
from torsight.core.words.wording import effect_name, number
from torsight.report.figures.motion import ANGLE, TIME, Figure, temperature_panel
from torsight.report.plots.panels import Axis, Panel

_SOURCE: Final = "next_experiment.csv"


def programme(table: pd.DataFrame) -> Figure | None:
    """Draw the programme's temperatures, the rivals' angles, and the differences of the rivals from the first one."""
    rivals = [name for name in table.columns if name.endswith("_deg")]
    if len(table) < 2 or not rivals:
        return None
    time_s = column(table, "time_s")
    angles = [column(table, name) for name in rivals]
    words = [" with ".join(effect_name(one) for one in name.removesuffix("_deg").split("+")) for name in rivals]
    above = Axis.along("", time_s, clock="programme")
    heat = temperature_panel(table, above, height=190)
    motion = Panel(above, Axis.around(ANGLE, *angles), height=190)
    for place, (angle, name) in enumerate(zip(angles, words, strict=True)):
        motion.line(time_s, angle, f"rival-{min(place, 3)}", label=name)
    panels = [heat, motion]
    if len(angles) > 1:
        apart = [angle - angles[0] for angle in angles[1:]]
        label = f"less {words[0]} (°)"
        left = Panel(Axis.along(TIME, time_s, clock="programme"), Axis.around(label, *apart), height=200)
        left.rule(0.0, "zero", upright=False)
        for place, (difference, name) in enumerate(zip(apart, words[1:], strict=True), start=1):
            left.line(time_s, difference, f"rival-{min(place, 3)}", label=f"{name} less {words[0]}, before any refit")
        panels.append(left)
    title = "The programme, and what each explanation predicts"
    shown = "The proposed programme and what each explanation predicts under it"
    return Figure("next_experiment", title, "", tuple(panels), shown, _SOURCE)


def segments(content: Mapping[str, Any]) -> list[tuple[str, ...]]:
    """Return the programme's segments as rows: spring, what, from, to, rate, hold, duration."""
    rows: list[tuple[str, ...]] = []
    for item in content.get("segments") or []:
        if not isinstance(item, Mapping):
            continue
        rate, hold = item.get("rate_c_per_s"), item.get("hold_s")
        done = str(item.get("spring", "")).upper(), str(item.get("action", ""))
        temps = number(item.get("from_c")), number(item.get("to_c"))
        pace = "by itself" if rate is None else number(rate), "" if not hold else number(hold)
        rows.append((*done, *temps, *pace, number(item.get("duration_s"), 4)))
    return rows


def worth(content: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return the worth of the programme as rows: separation, that of a plain repeat, separation needed, duration."""
    rows = []
    for key, label in (
        ("separation_sigmas", "this programme keeps them apart by"),
        ("repeat_separation_sigmas", "a repeat of this record would by"),
    ):
        if content.get(key) is not None:
            rows.append((label, f"{number(content[key])} standard deviations"))
    needed = content.get("needed_gain")
    if needed is not None:
        rows.append(("needed", f"{number(float(np.sqrt(needed)))} standard deviations"))
    if content.get("duration_s") is not None:
        rows.append(("lasts", f"{content['duration_s'] / 60.0:.0f} min"))
    return rows
