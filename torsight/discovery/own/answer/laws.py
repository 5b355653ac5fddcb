"""Laws of one's own models: functions of one variable that the engine measures through the model.

Where no range is declared, a law spans the arguments with which the plain model calls it, and its driver's column.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from torsight.core.errors import InputError
from torsight.core.law import LawForm
from torsight.core.series import rms
from torsight.core.units import Flags, Floats
from torsight.core.words.colours import LIGHT
from torsight.core.words.shown import Shown
from torsight.core.words.wording import number
from torsight.discovery.inference.explanation import Explanation, covariance, on_nodes
from torsight.discovery.inference.fitting import AtPoint, EffectSet, Fit
from torsight.discovery.inference.law.measure import Measured, measure_law
from torsight.discovery.interface import Candidate, Problem
from torsight.discovery.linear_problem import LAW_SHARE
from torsight.discovery.measured_law import law_columns
from torsight.discovery.own.model.declare import MOST_NODES
from torsight.discovery.own.model.evaluate import Called
from torsight.discovery.own.model.law_ports import nodes_of, port_law
from torsight.discovery.own.model.problem import ModelProblem
from torsight.discovery.own.model.values import Curve
from torsight.discovery.settings import Settings
from torsight.discovery.weight import NOTHING

_FORM_SHARE: Final = Settings().form_share
"""Share of a candidate's sum of squares that a law must explain for the candidate to be a form of that law."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class MeasuredCurve(Shown):
    """A law as it was measured: id, driver, units; nodes, values, sigma (k,); whether the record reached a node.

    ``effect`` is the candidate whose name it carries, if any; ``chosen`` says whether it belongs to the answer,
    ``gain`` by how much the log evidence falls without it, or rises with it alone.
    """

    id: str
    effect: str | None
    driver: str
    unit: str
    driver_unit: str
    nodes: Floats
    values: Floats
    sigma: Floats
    covered: Flags
    gain: float
    chosen: bool

    @property
    def csv_name(self) -> str:
        """Name of the file that holds the law's curve."""
        return f"law_{self.id.replace('(', '_').replace(')', '')}.csv"

    def table(self) -> dict[str, NDArray[np.generic]]:
        """Return the columns of the law's file."""
        return law_columns(self.nodes, self.values, self.sigma, self.covered)

    def to_json(self) -> dict[str, Any]:
        """Return the entry of ``laws`` in ``discovery.json``."""
        return {
            "effect": self.effect,
            "port": self.id,
            "law": self.id,
            "driver": self.driver,
            "unit": self.unit,
            "file": self.csv_name,
            "gain": self.gain,
        }

    def facts(self) -> dict[str, str]:
        """Return the law's range, and the effect whose name the law carries."""
        return {self.id: self.sentence} | ({} if self.effect is None else {"effect": self.effect})

    def _columns(self) -> dict[str, NDArray[np.generic]]:
        return self.table()

    def _draw(self, axes: Any) -> None:
        known = self.covered
        axes.axhline(0.0, lw=0.5, color=LIGHT["muted"])
        low, high = self.values - 2 * self.sigma, self.values + 2 * self.sigma
        axes.fill_between(self.nodes[known], low[known], high[known], alpha=0.25)
        axes.plot(self.nodes[known], self.values[known], "-", color=LIGHT["after"])
        axes.set(title=self.id, xlabel=f"{self.driver} {self.driver_unit}".strip(), ylabel=self.unit)

    @property
    def sentence(self) -> str:
        """The law in one sentence: its smallest and largest value, and where it has them."""
        known = np.flatnonzero(self.covered)
        if not len(known):
            return f"a law of {self.driver} that the record does not reach"
        low, high = known[np.argmin(self.values[known])], known[np.argmax(self.values[known])]
        unit = f" {self.unit}" if self.unit else ""
        return (
            f"a law of {self.driver}, from {number(self.values[low])}{unit} at {number(self.nodes[low])} to "
            f"{number(self.values[high])}{unit} at {number(self.nodes[high])}"
        )


def with_nodes(problem: ModelProblem, values: Mapping[str, float]) -> ModelProblem:
    """Return a problem whose declared laws have nodes and scales, computed at the plain model's ``values``."""
    called = problem.evaluator(problem.given(values, ()), {})
    nodes = {}
    for port in problem.ports:
        asked = [one.asked[port.name] for one in called if port.name in one.asked]
        low, high = min((a for a, _ in asked), default=np.inf), max((b for _, b in asked), default=-np.inf)
        if not low < high:
            raise InputError(
                f"the model never calls the law '{port.name}', or always with the same value",
                where="predict",
                do=f"call p.{port.name}({port.driver}) in it",
            )
        # With other parameter values the model may call the law over the column's whole range.
        columns = [record[port.driver] for record in problem.model.records if port.driver in record]
        low, high = (
            float(end([limit, *(nan_end(column) for column in columns)]))
            for end, nan_end, limit in ((min, np.nanmin, low), (max, np.nanmax, high))
        )
        nodes[port.name] = nodes_of(port, low, high)
    made = replace(problem, nodes=nodes)
    return replace(made, law_scales={port.name: _scale(made, port.name, values) for port in problem.ports})


def widened(problem: ModelProblem, called: Sequence[Called], curves: Mapping[str, Curve]) -> ModelProblem:
    """Return a problem whose laws span all arguments in these calls of the model; declared ends remain.

    The plain model may be far from the record: its range is then too narrow for the extended model.
    """
    ports = {port.name: port for port in problem.ports}
    found = {
        name: nodes_of(ports[name], min(low, float(nodes[0])), max(high, float(nodes[-1])))
        for name, (low, high, nodes) in _far(called, curves).items()
        if np.isfinite(high - low)
    }
    changed = any(not np.array_equal(nodes, problem.nodes[name]) for name, nodes in found.items())
    return replace(problem, nodes={**problem.nodes, **found}) if changed else problem


def beyond(called: Sequence[Called], curves: Mapping[str, Curve]) -> list[str]:
    """Return a warning for every law that is on and is called with values far outside its nodes."""
    return [
        f"the law '{name}' is called with values from {low:.4g} to {high:.4g}, and has nodes from {nodes[0]:.4g} to "
        f"{nodes[-1]:.4g}, beyond which the outermost value holds: give it low=… and high=…"
        for name, (low, high, nodes) in _far(called, curves).items()
    ]


def bend_within(problem: ModelProblem, chosen: Explanation, price: float) -> list[str]:
    """Return a note for every declared law of an answer that would explain more with nodes between its nodes.

    Laws that were added to an output are left out of this comparison, because they may make up for missing nodes.
    ``price`` is the gain in log evidence that pays for one more law.
    """
    notes, ports = [], {port.name: port for port in problem.ports}
    declared = [item for item in chosen.laws if item.law.id in ports]
    for item in declared:
        name, nodes = item.law.id, item.law.nodes
        count = 2 * len(nodes) - 1
        if count > MOST_NODES:
            continue
        finer = port_law(ports[name], np.linspace(nodes[0], nodes[-1], count), item.law.scale)
        others = [one.form for one in declared if one is not item]
        beside = (*chosen.effects, *(form.id for form in others))
        rest, under = problem.with_laws(others), chosen.likelihood
        coarse, fine = (
            measure_law(rest, law, chosen.fit.values, effects=beside, likelihood=under).log_evidence
            for law in (item.law, finer)
        )
        if fine > coarse + price:
            notes.append(
                f"the law '{name}' bends between its {len(nodes)} nodes, and what it misses there may pass for "
                f"something else: with nodes={count} it explains more (log evidence +{number(fine - coarse)})"
            )
    return notes


def _far(called: Sequence[Called], curves: Mapping[str, Curve]) -> dict[str, tuple[float, float, Floats]]:
    """Return the smallest and largest argument, and the nodes, of the laws that are called far outside their nodes."""
    found = {}
    for name, curve in curves.items():
        low, high = min(one.asked[name][0] for one in called), max(one.asked[name][1] for one in called)
        first, last = float(curve.nodes[0]), float(curve.nodes[-1])
        near = 0.5 * float(curve.nodes[1] - first)  # which the outermost node still represents
        if low < first - near or high > last + near:
            found[name] = (low, high, curve.nodes)
    return found


def _scale(problem: ModelProblem, name: str, values: Mapping[str, float]) -> float:
    """Return the size of a law at which, as a constant or a slope, it changes the outputs by a share that matters."""
    form = next(law for law in problem.laws if law.id == name).free()
    with_law, valid = problem.with_laws((form,)), problem.valid
    plain, spread = problem.predict(values, ()), float(np.std(problem.observed[valid]))

    def response(step: float) -> float:
        shapes = (np.ones(len(form.nodes)), np.linspace(-1.0, 1.0, len(form.nodes)))
        points = [{**values, **dict(zip(form.names, (step * shape).tolist(), strict=True))} for shape in shapes]
        moved = with_law.predict_many(points, (name,))
        return max(rms((one - plain)[valid]) for one in moved) / step

    first = response(1e-6)
    if first <= 0.0:
        raise InputError(f"the law '{name}' changes nothing", where="predict", do="add what it returns to the model")
    # The difference that gives the scale moves the prediction by a thousandth of the measured spread.
    return LAW_SHARE * spread / (response(1e-3 * spread / first) or first)


def usual_forms(problem: ModelProblem, base: Fit, candidates: Sequence[Candidate]) -> tuple[Candidate, ...]:
    """Return the candidates, each with the laws of which it is a usual form, where none are declared for it.

    A candidate is a form of a law if the law can reproduce nearly all of the candidate's effect, at its most promising
    start, that the base model's own parameters cannot reproduce.
    """
    valid = problem.valid
    own = base.solution.jacobian[valid]
    own = own / np.maximum(np.linalg.norm(own, axis=0), 1e-300)
    columns = {}
    for law in problem.laws:
        form = law.free()
        moved = _columns(problem.with_laws((form,)), form, base.values, np.zeros(len(form.nodes)), (law.id,))
        columns[law.id] = np.column_stack([own, moved[valid]])
    made = []
    for one in candidates:
        start = (*one.starts, *one.starting_points())[0]
        own_values = one.own({**{p.name: p.value for p in one.parameters}, **start})
        at_start = problem.predict({**base.values, **own_values}, (one.id,))
        change = (at_start - base.solution.prediction)[valid]
        beyond = _left(own, change)
        found = [
            name
            for name, both in columns.items()
            if beyond > 0.0 and _left(both, change) <= (1.0 - _FORM_SHARE) * beyond
        ]
        small = beyond <= NOTHING * float(change @ change)
        made.append(one if one.laws or small or not found else replace(one, laws=tuple(found)))
    return tuple(made)


def _left(columns: Floats, values: Floats) -> float:
    """Return the residual sum of squares of a least-squares fit of columns (n, k) to values (n,)."""
    left = values - columns @ np.linalg.lstsq(columns, values)[0]
    return float(left @ left)


def _columns(
    problem: Problem, free: LawForm, others: Mapping[str, float], values: Floats, effects: EffectSet
) -> Floats:
    """Return the change (n, k) of the prediction per law scale by a law's value on each of its k nodes.

    ``free`` is the law with its ``values`` (k,) on the nodes as parameters, and among the problem's laws; ``others``
    are the values of all other parameters.
    """
    at = AtPoint(problem, (*others, *free.names), effects)
    middle = np.concatenate([list(others.values()), values])
    moved = at.many([middle + free.scale * (np.arange(len(middle)) == len(others) + i) for i in range(len(values))])
    return np.column_stack(moved) - at(middle)[:, None]


def measured_curves(
    chosen: Explanation, alone: list[Explanation], gains: Mapping[str, float], names: Mapping[str, str], ports: Any
) -> tuple[MeasuredCurve, ...]:
    """Return the laws of the answer, then declared ones that were tried alone, the strongest first.

    ``gains`` holds the gain of every law, ``names`` the candidate whose name a law carries, both by the law's id.
    """
    units = {port.name: port.driver_unit for port in ports}
    pairs = [(one, item) for one in (chosen, *alone) for item in one.laws]
    made = [
        _curve(one, item, names.get(item.law.id), units.get(item.law.id, ""), gains[item.law.id], chosen=one is chosen)
        for one, item in pairs
    ]
    return tuple(sorted(made, key=lambda law: (not law.chosen, -law.gain)))


def _curve(
    one: Explanation, item: Measured, effect: str | None, driver_unit: str, gain: float, *, chosen: bool
) -> MeasuredCurve:
    form, information = item.form, _information(one, item)
    values, spread = on_nodes(one, form, covariance(one))
    return MeasuredCurve(
        id=form.id,
        effect=effect,
        driver=item.law.driver,
        unit=item.law.unit,
        driver_unit=driver_unit,
        nodes=form.nodes,
        values=values,
        sigma=np.sqrt(np.maximum(np.diag(spread), 0.0)),
        covered=information > NOTHING * float(np.max(information)),
        gain=gain,
        chosen=chosen,
    )


def _information(one: Explanation, item: Measured) -> Floats:
    """Return the record's information about a law's value on each node, all others fixed (k,), as a sum of weights."""
    free, form, problem = item.law.free(), item.form, one.fitter.problem
    made = problem.with_laws((*(other for other in problem.forms if other.id != form.id), free))
    others = {name: value for name, value in one.fit.values.items() if name not in form.names}
    columns = _columns(made, free, others, form.values(one.fit.values), one.fit.effects) / form.scale
    return np.asarray((columns**2).T @ one.fitter.weight.each)
