"""Laws at ports of one's own: a function of one variable, measured through the model, jointly with its parameters.

A law is on where its id is among the effects; its values on nodes, lines between them, are then parameters like any
other (``friction@00``, ``friction@01``, …), so that a law is searched, held out and predicted as every candidate is.
Its range is the one in which the plain model asks for it, and its fit begins at the linear estimate.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from torsight.core.errors import InputError
from torsight.core.parameter import Parameter
from torsight.core.wording import number
from torsight.discovery.contenders import Contender, Field
from torsight.discovery.fitting import Fit, Fitter, space_of
from torsight.discovery.interface import Candidate, Problem
from torsight.discovery.intervals import curvature_spread
from torsight.discovery.own.declare import LawPort, node_name
from torsight.discovery.own.evaluate import Evaluator
from torsight.discovery.own.problem import ModelProblem, nodes_of
from torsight.discovery.solver import linear_change

Array = NDArray[np.float64]

_STEP: Final = 1e-3
"""Share of the measured spread by which a law's values may move the prediction while its columns are worked out."""
_ROUGH: Final = 1e-3
"""Share of the columns' own information with which the first estimate is held near zero: neighbours that only together
are known share what they explain."""
_WIDE: Final = 3.0
"""Width of the prior around the first estimate, in sizes of the law: what the model's own parameters could do as well
(an offset, a slope) stays where the estimate left it, and everything that the record tells is free."""
_COVERED: Final = 0.02
"""Share of the median information about a node below which the record did not reach it."""


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredCurve:
    """A law as it was measured: id, driver, units; nodes, values, sigma (k,); whether the record reached a node.

    ``chosen`` says whether it belongs to the answer, ``gain`` by how much it alone lowers −2 log L.
    """

    id: str
    driver: str
    unit: str
    driver_unit: str
    nodes: Array
    values: Array
    sigma: Array
    covered: NDArray[np.bool_]
    gain: float
    chosen: bool

    @property
    def csv_name(self) -> str:
        """Name of the file with its numbers."""
        return f"law_{self.id}_{self.driver}.csv"

    def table(self) -> dict[str, NDArray[np.generic]]:
        """Return the columns of its file."""
        return {
            "driver": self.nodes,
            "value": self.values,
            "sigma": self.sigma,
            "covered": self.covered.astype(np.int64),
        }

    def to_json(self) -> dict[str, Any]:
        """Return the entry of ``laws`` in ``discovery.json``."""
        return {
            "effect": self.id,
            "port": self.id,
            "driver": self.driver,
            "unit": self.unit,
            "file": self.csv_name,
            "gain": self.gain,
        }

    def told(self) -> str:
        """Return one sentence."""
        known = np.flatnonzero(self.covered)
        if not len(known):
            return f"a law of {self.driver} that the record does not reach"
        low, high = known[np.argmin(self.values[known])], known[np.argmax(self.values[known])]
        unit = f" {self.unit}" if self.unit else ""
        return (
            f"a law of {self.driver}, from {number(self.values[low])}{unit} at {number(self.nodes[low])} to "
            f"{number(self.values[high])}{unit} at {number(self.nodes[high])}"
        )


def with_laws(problem: ModelProblem, fitter: Fitter, base: Fit) -> tuple[ModelProblem, tuple[Candidate, ...]]:
    """Return a problem whose laws have their nodes, and the laws as candidates that begin where they may end.

    Raises
    ------
    InputError
        When the model never asks for a law.
    """
    called = problem.evaluator(problem.given(base.values, ()), {})
    nodes = {}
    for port in problem.ports:
        asked = [one.asked[port.name] for one in called if port.name in one.asked]
        low, high = min((a for a, _ in asked), default=np.inf), max((b for _, b in asked), default=-np.inf)
        if not low < high:
            raise InputError(
                f"the model never asks for the law '{port.name}', or always at one place",
                where="predict",
                do=f"call p.{port.name}({port.driver}) in it",
            )
        nodes[port.name] = nodes_of(port, low, high)
    model = replace(problem.model, laws=nodes)
    evaluator = Evaluator(model)
    evaluator.take_over(problem.evaluator)
    made = replace(problem, model=model, evaluator=evaluator)
    return made, tuple(_candidate(made, port, fitter, base) for port in problem.ports)


def _candidate(problem: ModelProblem, port: LawPort, fitter: Fitter, base: Fit) -> Candidate:
    names = [node_name(port.name, i) for i in range(port.nodes)]
    values, scale = _estimate(problem, port, names, fitter, base)
    smallest = 1e-3 * scale
    parameters = tuple(
        Parameter(
            name,
            float(value) if abs(value) > smallest else smallest,
            port.unit,
            sigma=_WIDE * scale,
            null=0.0,
        )
        for name, value in zip(names, values, strict=True)
    )
    return Candidate(port.name, f"law of {port.driver}", parameters, scales=dict.fromkeys(names, scale))


def _estimate(problem: ModelProblem, port: LawPort, names: list[str], fitter: Fitter, base: Fit) -> tuple[Array, float]:
    """Return the law's values by linear least squares beside the base parameters, and their size."""
    weight = fitter.weight
    plain = base.solution.prediction
    left = np.where(weight > 0.0, problem.observed - plain, 0.0)

    def columns(step: float) -> Array:
        points = [{**base.values, **{name: step * (name == own) for name in names}} for own in names]
        return np.column_stack([one - plain for one in problem.predict_many(points, (port.name,))]) / step

    first = columns(1e-6)
    reach = float(np.max(np.abs(first))) or 1.0
    made = columns(_STEP * float(np.nanstd(problem.observed)) / reach)
    space = space_of(base.parameters)
    information = made.T**2 @ weight
    held = np.concatenate([space.prior_information + 1e-9 / space.scale**2, _ROUGH * information + 1e-12])
    own = len(base.parameters)
    back = np.where(np.isfinite(space.prior_sigma), space.prior_mean - base.solution.x, 0.0)
    centre = np.concatenate([back, np.zeros(len(names))])
    both = np.column_stack([base.solution.jacobian, made])
    found = linear_change(both, left, weight=weight, information=held, centre=centre)[own:]
    return found, float(np.sqrt(np.mean(found**2))) or 1.0


def measured_curves(problem: Problem, field: Field, chosen: Contender) -> tuple[MeasuredCurve, ...]:
    """Return the laws of the answer, then those that were tried alone, the strongest first."""
    if not isinstance(problem, ModelProblem) or not problem.ports:
        return ()
    made = []
    for port in problem.ports:
        alone = field.contenders.get((port.name,))
        source = chosen if port.name in chosen.effects else alone
        if source is not None:
            gain = field.base.cost - alone.cost if alone is not None else float("nan")
            made.append(_curve(problem, port, field, source, gain=gain, chosen=source is chosen))
    return tuple(sorted(made, key=lambda law: (not law.chosen, -law.gain)))


def _curve(
    problem: ModelProblem, port: LawPort, field: Field, source: Contender, *, gain: float, chosen: bool
) -> MeasuredCurve:
    places = [i for i, p in enumerate(source.fit.parameters) if p.name.startswith(f"{port.name}@")]
    spread: Mapping[int, float] = dict(enumerate(np.sqrt(np.diag(curvature_spread(field, source))).tolist()))
    information = (source.fit.solution.jacobian[:, places] ** 2).T @ field.fitter.weight
    return MeasuredCurve(
        id=port.name,
        driver=port.driver,
        unit=port.unit,
        driver_unit=port.driver_unit,
        nodes=problem.model.laws[port.name],
        values=source.fit.solution.x[places],
        sigma=np.array([spread[i] for i in places]),
        covered=information > _COVERED * float(np.median(information)),
        gain=gain,
        chosen=chosen,
    )
