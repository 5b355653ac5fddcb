"""Figures of a model of one's own: before and after for each record and output, residuals over drivers, laws."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from torsight.core.parameter import estimates_to_json
from torsight.core.series import rms
from torsight.core.units import Floats
from torsight.core.words.wording import capital
from torsight.discovery.own.answer.findings import Findings
from torsight.discovery.own.answer.laws import MeasuredCurve
from torsight.discovery.own.answer.pictures import Series, series_of
from torsight.report.figures.evidence import candidates, errors, pulls
from torsight.report.figures.law_plots import law_panel, with_unit
from torsight.report.figures.motion import CURVES, Figure, models
from torsight.report.figures.residuals import over_variable, pairs_of_bars, shade_floor
from torsight.report.plots.panels import Axis, Panel
from torsight.report.sections.parameter_table import Prior


def is_ours(name: str) -> bool:
    """Return whether a figure's file belongs to this report, so that it may be removed with an earlier answer."""
    return name in {"candidates", "pulls"} or re.fullmatch(r"(before_after|residual|law|unseen)_.+", name) is not None


def figures_of(found: Findings) -> dict[str, list[Figure]]:
    """Return the figures by section; a section without figures is absent."""
    answer = found.to_json()
    floors = answer["noise_floor"]
    several = len(found.problem.laws) + len(found.problem.candidates) > 1
    made: dict[str, list[Figure | None]] = {
        "hero": [
            before_and_after(one, k, floor=floors.get(one.unit) if np.isfinite(floors.get(one.unit, np.nan)) else None)
            for k, one in enumerate(series_of(found), start=1)
        ],
        "laws": [law_drawn(law) for law in found.laws if law.chosen],
        "candidates": [candidates(answer)] if several else [],
        "unseen": [unseen_blocks(found, output) for output in range(len(found.outputs))],
        "pulls": [pulled(found)],
        "against": [
            residual_over(found, output, name, values)
            for output in range(len(found.outputs))
            for name, values in found.problem.drivers.items()
        ],
    }
    kept = {section: [one for one in some if one is not None] for section, some in made.items()}
    return {section: some for section, some in kept.items() if some}


def before_and_after(one: Series, count: int, *, floor: float | None) -> Figure:
    """Draw one output of one record: measured and both models above, both residuals below."""
    before, after = one.measured - one.before, one.measured - one.after
    quantity = one.unit or "observed"
    motion = Panel(
        Axis.along("", one.time, clock=one.title),
        Axis.around(quantity, one.measured, one.before, one.after),
        height=225,
    )
    models(motion, one.time, one.measured, one.before, one.after, ordered=True)
    left = Panel(
        Axis.along("time", one.time, clock=one.title), Axis.around("measured − model", before, after), height=245
    )
    shade_floor(left, floor, unit="")
    errors(left, one.time, before, after, alike=np.array_equal(one.before, one.after))
    title = f"Measured and modelled: {one.title}"
    words = f"{one.title}: measured, both models, and what either leaves"
    return Figure(f"before_after_{count}", title, "", (motion, left), words, CURVES)


def law_drawn(law: MeasuredCurve) -> Figure:
    """Draw a measured law with its 95 % interval; the range of the driver that the record covers is shaded."""
    named = "No candidate has this form." if law.effect is None else f"The candidate is {law.effect}."
    across, gives = with_unit(law.driver, law.driver_unit), with_unit(law.id, law.unit)
    return Figure(
        law.csv_name.removesuffix(".csv"),
        f"The law {law.id} over {law.driver}",
        f"{capital(law.sentence)}. {named}",
        (law_panel(law.table(), across=across, gives=gives),),
        source=law.csv_name,
    )


def unseen_blocks(found: Findings, output: int) -> Figure | None:
    """Draw the error of one output on every block, predicted from the others, before and after."""
    if found.before is None or found.after is None:
        return None
    rows, scale = found.rows_of(output)
    quantity, block = found.outputs[output], found.problem.block[rows]
    labels = np.unique(block)
    levels = [
        [scale * rms(side.residual[rows][block == label]) for label in labels] for side in (found.before, found.after)
    ]
    names = [str(label + 1) for label in labels]
    plot = pairs_of_bars("block", "rms error", names, list(zip(*levels, strict=True)), height=220.0, unit="")
    data: dict[str, list[Any]] = {"block": names, "before": levels[0], "after": levels[1]}
    title = f"{quantity}: error on held-out blocks"
    caption = "Each was held out of the fit once, and predicted by it."
    return Figure(f"unseen_{_plain(quantity)}", title, caption, (plot,), title, data=data)


def pulled(found: Findings) -> Figure | None:
    """Draw the distance of either fit from values that were measured beforehand, in their standard deviations."""
    known = {p.name: Prior(p.value, p.sigma) for p in found.problem.parameters}
    plain, after = estimates_to_json(found.plain_parameters), estimates_to_json(found.parameters)
    return pulls(known, plain, after, extended=bool(found.decision.chosen.members))


def _plain(name: str) -> str:
    """Return a name in the form used in file names."""
    return re.sub(r"\W+", "_", name).strip("_")


def residual_over(found: Findings, output: int, name: str, values: Floats) -> Figure | None:
    """Draw the residuals of both models over one variable on which an effect may depend."""
    quantity = found.outputs[output]
    rows, scale = found.rows_of(output)
    before, after = (scale * one.residual[rows] for one in (found.field.base, found.decision.chosen))
    everywhere = {"all": np.ones(len(before), bool)}
    made = over_variable(values[rows], before, after, everywhere, label=name, residual=f"measured − model ({quantity})")
    if made is None:
        return None
    plot, means = made
    data = {"residual": means["residual"], name: means["place"], "mean": means["mean"]}
    place = _plain(f"{quantity}_{name}" if len(found.outputs) > 1 else name)
    words = f"What both models leave of {quantity} over {name}"
    return Figure(f"residual_{place}", f"{quantity} against {name}", "", (plot,), words, data=data)
