"""Figures of the answer: before and after in one picture, gains of the candidates, held-out half-cycles, pulls."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
import pandas as pd

from torsight.actuator.quantities import candidate_name, plain_symbol
from torsight.core.files.results import column
from torsight.core.units import Floats
from torsight.core.words.wording import number
from torsight.report.figures.motion import ANGLE, CURVES, RESIDUAL, TIME, Figure, models, shade_held_out
from torsight.report.figures.residuals import is_plain, pairs_of_bars, shade_floor
from torsight.report.plots.panels import Axis, Panel
from torsight.report.sections.parameter_table import Prior, common_reach

_SURELY: Final = math.log(1e6)
"""Logarithm of the largest ratio of probabilities that is told in figures: who reads "a million" needs no more."""


def before_and_after(curves: pd.DataFrame, floor_deg: float | None) -> Figure:
    """Draw the answer in one picture: the motion above, the residuals of both models below."""
    time_s, angle = column(curves, "time_s"), column(curves, "angle_deg")
    plain, extended = column(curves, "plain_deg"), column(curves, "extended_deg")
    before, after = column(curves, "residual_before_deg"), column(curves, "residual_after_deg")
    # Together the two plots are as high as the three numbers beside them, so that the next steps are visible without
    # scrolling in a window of 1280 by 800.
    motion = Panel(Axis.along("", time_s), Axis.around(ANGLE, angle, plain, extended), width=720, height=130.0)
    shade_held_out(motion, curves)
    models(motion, time_s, angle, plain, extended, ordered=True)
    left = Panel(Axis.along(TIME, time_s), Axis.around(RESIDUAL, before, after), width=720, height=172.0)
    shade_held_out(left, curves)
    shade_floor(left, floor_deg)
    errors(left, time_s, before, after, alike=is_plain(curves))
    title = "The motion, and the error of the plain and of the extended model"
    return Figure("before_after", "Before and after", "", (motion, left), title, CURVES)


def errors(left: Panel, time_s: Floats, before: Floats, after: Floats, *, alike: bool) -> None:
    """Draw the residual of either model over time; one curve where both models are the same."""
    left.rule(0.0, "zero", upright=False)
    left.line(time_s, before, "before", label="error" if alike else "error before")
    if not alike:
        left.line(time_s, after, "after", label="error after")


def candidates(discovery: Mapping[str, Any]) -> Figure | None:
    """Draw the gain of every single candidate, as a share of the best one's."""
    evidence = discovery.get("evidence") or {}
    gains = {name: float(gain) for name, gain in (evidence.get("gains") or {}).items() if gain is not None}
    best = max([*gains.values(), 0.0])
    verdict = discovery.get("verdict")
    if best <= 0.0 or verdict in ("none", "unknown"):
        # A share of a negligible gain would look like an explanation.
        return None
    # With eight bars the figure is as high as the others.
    ranked = sorted(gains.items(), key=lambda item: -item[1])[:8]
    named = {str(effect["id"]) for effect in discovery.get("effects") or []}
    rivals = {str(one) for names in discovery.get("alternatives") or [] for one in names}
    places = list(range(len(ranked), 0, -1))
    # At most 48 letters, half the width of the plot, to leave room for the bars.
    words = [textwrap.shorten(candidate_name(name), 48, placeholder=" …") for name, _ in ranked]
    plot = Panel(
        # Beyond 100 %, room for the text beside the longest bar.
        Axis("explained alone (% of the best one's)", 0.0, 140.0),
        Axis("", 0.4, len(ranked) + 0.6),
        width=520,
        height=70.0 + 26.0 * len(ranked),
        x_names=[(float(value), str(value)) for value in (0, 25, 50, 75, 100)],
        y_names=list(zip(map(float, places), words, strict=True)),
    )
    shares = [100.0 * max(gain, 0.0) / best for _, gain in ranked]
    for place, (name, gain), share in zip(places, ranked, shares, strict=True):
        kind = "after" if name in named else ("rival" if name in rivals else "quiet")
        # 16 of the 26 px from one bar to the next, around letters of 12 px.
        plot.box((0.0, share), (place - 0.31, place + 0.31), kind, tip=f"gain {gain:.4g}")
        plot.note(share, place, f"{share:.1f} %".replace("100.0", "100"))
    effects, explained = map(list, zip(*ranked, strict=True))
    data: dict[str, list[Any]] = {"effect": effects, "gain": explained, "percent": shares}
    caption = "Each fitted together with all parameters of the model. " + _far(ranked, named)
    title, shown = "What else could explain it", "What every candidate explains alone"
    return Figure("candidates", title, caption.strip(), (plot,), shown, data=data)


def _far(ranked: list[tuple[str, float]], named: set[str]) -> str:
    """Return a sentence on the second-best candidate, where only one effect was named; else nothing."""
    if len(named) != 1 or len(ranked) < 2 or ranked[0][0] not in named:
        return ""
    behind = ranked[0][1] - ranked[1][1]
    times = number(math.exp(behind), 2) if behind < _SURELY else "over a million"
    return f"Next comes {candidate_name(ranked[1][0])}: alone it makes the record {times} times less probable."


def unseen_half_cycles(discovery: Mapping[str, Any]) -> Figure | None:
    """Draw the error on every half-cycle, predicted from the others, before and after."""
    parts = [(discovery.get(name) or {}).get("by_half_cycle_deg") or [] for name in ("before", "after")]
    held = [int(one) for one in discovery.get("held_out") or []]
    if not held or any(len(part) != len(held) for part in parts):
        return None
    before, after = ([float("nan") if one is None else float(one) for one in part] for part in parts)
    names = [str(label + 1) for label in held]
    title = "Error on held-out half-cycles"
    plot = pairs_of_bars("half-cycle", "rms error (°)", names, list(zip(before, after, strict=True)), height=220.0)
    data: dict[str, list[Any]] = {"half_cycle": names, "before_deg": before, "after_deg": after}
    caption = "Each was held out of the fit once, and predicted by it."
    return Figure("unseen_half_cycles", title, caption, (plot,), data=data)


def pulls(
    known: Mapping[str, Prior], plain: Mapping[str, Any], after: Mapping[str, Any], *, extended: bool
) -> Figure | None:
    """Draw the distance of either fit from the characterised values, in their standard deviations."""
    names = [name for name, prior in known.items() if prior.sigma and name in plain and not plain[name].get("fixed")]
    if not names:
        return None
    fits = [("plain", plain, "before", 0.17 if extended else 0.0)]
    fits += [("extended", after, "after", -0.17)] if extended else []
    found = {(name, kind): known[name].pull(fit.get(name)) for name in names for _, fit, kind, _ in fits}
    reach = common_reach(found.values())
    places = {name: float(len(names) - k) for k, name in enumerate(names)}
    plot = Panel(
        Axis("fitted minus characterised value (σ)", -reach, reach),
        Axis("", 0.4, len(names) + 0.6),
        height=84.0 + 26.0 * len(names),
        y_names=[(place, plain_symbol(name)) for name, place in places.items()],
    )
    for width in (2.0, 1.0):
        plot.band(-width, width, "prior", label="± 1 and ± 2 standard deviations" if width == 1.0 else "")
    for name, place in places.items():
        for label, fit, kind, shift in fits:
            pull = found[name, kind]
            if pull is None:
                continue
            ends = known[name].interval(fit[name])
            if ends is not None:
                shown = np.clip(ends, -reach, reach)
                plot.line(shown, [place + shift] * 2, f"{kind} interval", ordered=False)
            plot.points([pull], [place + shift], kind, label=f"{label} model", radius=4.5)
    data: dict[str, list[Any]] = {"parameter": names}
    for label, fit, kind, _ in fits:
        spreads = [known[name].interval(fit.get(name) or {}) for name in names]
        data[f"{label}_sigmas"] = [found[name, kind] for name in names]
        data[f"{label}_low_sigmas"] = [None if end is None else end[0] for end in spreads]
        data[f"{label}_high_sigmas"] = [None if end is None else end[1] for end in spreads]
    words = "How far either fit pulled the characterised values"
    return Figure("pulls", "Distance of the fit from the characterised values", "", (plot,), words, data=data)
