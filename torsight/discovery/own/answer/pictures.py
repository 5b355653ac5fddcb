"""Pictures of the findings (matplotlib): measured and both models, residuals, gains, laws."""

from __future__ import annotations

import base64
import io
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from torsight.core.units import Floats
from torsight.core.words.colours import LIGHT
from torsight.discovery.own.model.problem import ModelProblem

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from torsight.discovery.own.answer.findings import Findings


def _thinning(rows: int) -> slice:
    """Return the rows that a picture shows: 4000 to 8000 of many, several for a pixel of its width."""
    return slice(None, None, max(1, rows // 4000))


@dataclass(frozen=True, slots=True, eq=False)
class Series:
    """One output of one record: time, measured, the plain and the extended model."""

    title: str
    unit: str
    time: Floats
    measured: Floats
    before: Floats
    after: Floats

    @property
    def thinned(self) -> Series:
        """The series with no more rows than a picture shows."""
        rows = _thinning(len(self.time))
        columns = (self.time, self.measured, self.before, self.after)
        return Series(self.title, self.unit, *(one[rows] for one in columns))


def series_of(found: Findings) -> list[Series]:
    """Return the measured and modelled series of every record and output."""
    problem, base, chosen = found.problem, found.field.base, found.decision.chosen
    fits = (base.fit.solution.prediction, chosen.fit.solution.prediction)
    if not isinstance(problem, ModelProblem):
        known = np.where(problem.valid, problem.observed, np.nan)
        return [Series("record", "", problem.time_s, known, *fits)]
    measured = problem.measured()
    before, after = (problem.layout.native(one) for one in fits)
    return [
        Series(
            f"{record.label_}" if len(problem.model.outputs) == 1 else f"{record.label_}, {name}",
            name,
            time,
            measured[r][:, k],
            before[r][:, k],
            after[r][:, k],
        )
        for r, (record, time) in enumerate(zip(problem.model.records, problem.times(), strict=True))
        for k, name in enumerate(problem.model.outputs)
    ]


def table_of(found: Findings) -> dict[str, NDArray[Any]]:
    """Return the columns of ``curves.csv``; see ``Findings.curves``."""
    problem, series = found.problem, series_of(found)
    if not isinstance(problem, ModelProblem):
        (one,) = series
        return {"time_s": one.time, "observed": one.measured, "plain": one.before, "extended": one.after}
    labels = [np.full(record.rows_, record.label_) for record in problem.model.records]
    made: dict[str, NDArray[Any]] = {"record": np.concatenate(labels), "time_s": np.concatenate(problem.times())}
    outputs = problem.model.outputs
    for k, output in enumerate(outputs):
        own = series[k :: len(outputs)]
        made[output] = np.concatenate([one.measured for one in own])
        made[f"{output}_plain"] = np.concatenate([one.before for one in own])
        made[f"{output}_extended"] = np.concatenate([one.after for one in own])
    return made


def _figure(rows: int, columns: int, *, height: float) -> tuple[Figure, Any]:
    """Return an empty figure and its axes, drawn without a screen whatever backend the caller uses."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure as Empty

    figure = Empty(figsize=(9.0, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure, figure.subplots(rows, columns, squeeze=False)


def overview(found: Findings) -> Figure:
    """Return measured, models and residuals of the first six records or outputs, and what each candidate explains."""
    shown = series_of(found)[:6]
    gains = bool(found.ranked(1))
    figure, axes = _figure(len(shown) + gains, 2, height=2.4 * (len(shown) + gains) + 0.6)
    for row, one in zip(axes, shown, strict=False):
        draw_motion(row[0], one)
        draw_residual(row[1], one)
    axes[0][0].legend(loc="best", fontsize="small", frameon=False)
    if gains:
        draw_gains(axes[-1][0], found)
        draw_by_driver(axes[-1][1], found)
    return figure


def draw_motion(axis: Any, one: Series) -> None:
    """Draw what was measured and both models over time."""
    one = one.thinned
    axis.plot(one.time, one.measured, ".", ms=2, color=LIGHT["measured"], label="measured")
    axis.plot(one.time, one.before, "--", lw=1, color=LIGHT["before"], label="model")
    axis.plot(one.time, one.after, "-", lw=1, color=LIGHT["after"], label="extended model")
    axis.set(title=one.title, xlabel="time", ylabel=one.unit)


def draw_residual(axis: Any, one: Series) -> None:
    """Draw the residuals of both models over time."""
    one = one.thinned
    axis.axhline(0.0, lw=0.5, color=LIGHT["muted"])
    axis.plot(one.time, one.measured - one.before, "--", lw=0.8, color=LIGHT["before"])
    axis.plot(one.time, one.measured - one.after, "-", lw=0.8, color=LIGHT["after"])
    axis.set(title="measured less model", xlabel="time", ylabel=one.unit)


def draw_gains(axis: Any, found: Findings) -> None:
    """Draw the gain of each candidate and law alone, and the gain that one more member must have."""
    base = found.field.base.log_evidence
    ranked = [(one.members[0], max(one.log_evidence - base, 0.0)) for one in found.ranked(1)][::-1]
    named = {*found.effects, *found.decision.chosen.members}
    colours = [LIGHT["after"] if name in named else LIGHT["muted"] for name, _ in ranked]
    axis.barh([name for name, _ in ranked], [gain for _, gain in ranked], color=colours)
    axis.axvline(found.price, lw=1, ls=":", color=LIGHT["before"], label="what one more must gain")
    axis.set_xscale("symlog", linthresh=1.0)
    axis.set(title="what each alone explains", xlabel="gain in log evidence")
    axis.legend(loc="lower right", fontsize="small", frameon=False)


def draw_by_driver(axis: Any, found: Findings) -> None:
    """Draw the residuals over the strongest driver of the measured laws, else over the first driver."""
    problem = found.problem
    names = [name for name, _ in found.drivers if name in problem.drivers] or list(problem.drivers)
    if not names:
        axis.set_axis_off()
        return
    values = problem.drivers[names[0]][problem.valid]
    for fit, key in ((found.field.base, "before"), (found.decision.chosen, "after")):
        left, rows = (problem.observed - fit.fit.solution.prediction)[problem.valid], _thinning(len(values))
        axis.plot(values[rows], left[rows], ".", ms=2, color=LIGHT[key])
    axis.set(title=f"measured less model over {names[0]}", xlabel=names[0])


def as_image(figure: Figure) -> str:
    """Return a figure as a data URL (PNG)."""
    stream = io.BytesIO()
    figure.savefig(stream, format="png", metadata={"Software": None})
    return f"data:image/png;base64,{base64.b64encode(stream.getvalue()).decode('ascii')}"
