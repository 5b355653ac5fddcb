"""A model of one's own as a problem for the engine: a function, a table, a list of parameters.

Everything else has a default and a check. ``predict(p, record)`` gives the model's outputs for one record, a value per
row; ``p`` holds parameters and laws by name. Parameters of effects that are off have their null values, so that the
function needs no case for effects.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from torsight.core.errors import InputError
from torsight.core.law import Law
from torsight.core.parameter import Parameter
from torsight.core.units import Floats
from torsight.core.words.wording import counted
from torsight.discovery.interface import OVER_ESTIMATED, OVER_GIVEN, Candidate, GivenProblem
from torsight.discovery.own.model import given
from torsight.discovery.own.model import layout as lay
from torsight.discovery.own.model.declare import (
    LawPort,
    candidates_of,
    check_declarations,
    name_in,
    parameters_of,
    per_record,
)
from torsight.discovery.own.model.evaluate import Called, Evaluator, Model, Predict
from torsight.discovery.own.model.law_ports import added_laws, nodes_of, port_law
from torsight.discovery.own.model.layout import Layout, Reading
from torsight.discovery.own.model.ode import Ode
from torsight.discovery.own.model.signals import drivers_of, rest_of
from torsight.discovery.own.model.values import Curve
from torsight.discovery.own.own_records import Table, read_records, time_column, time_of


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class ModelProblem(GivenProblem):
    """A :class:`torsight.discovery.interface.Problem` around a function; made by :func:`model_problem`.

    Attributes
    ----------
    model : Model
        The function and the records.
    declared : tuple of Parameter
        Parameters as declared, fixed ones and initial states among them.
    initial : tuple of str
        Parameters that every record has for itself.
    ports : tuple of LawPort
        Laws as declared.
    layout : Layout
        Place of records and outputs in the engine's series.
    once, elsewhere
        As in the protocol.
    nodes, law_scales : mapping of str to (k,) float64, mapping of str to float
        Nodes of each declared law by its name, and the law's scale.
    sigma_known : bool
        Whether the noise was given for every output, and not estimated.
    alike : bool
        False where a value that all records share would have to differ between them: the residual is then not noise.
    warnings : tuple of str
        Warnings and notes to the user.
    """

    model: Model
    declared: tuple[Parameter, ...]
    initial: tuple[str, ...]
    ports: tuple[LawPort, ...]
    layout: Layout
    evaluator: Evaluator
    nodes: Mapping[str, Floats] = field(default_factory=dict)
    law_scales: Mapping[str, float] = field(default_factory=dict)
    once: tuple[str, ...] = ()
    elsewhere: tuple[Mapping[str, float], ...] = ()
    sigma_known: bool = False
    alike: bool = True
    time_name: str | None = None
    warnings: tuple[str, ...] = ()

    def __repr__(self) -> str:
        rows = f"{counted(sum(self.layout.rows), 'row')} in {counted(len(self.layout.rows), 'record')}"
        offered = ", ".join([*(one.id for one in self.candidates), *(one.name for one in self.ports)]) or "none"
        values = counted(len(self.declared), "parameter")
        return f"ModelProblem({', '.join(self.layout.outputs)}: {rows}, {values}, candidates: {offered})"

    @cached_property
    def over_floor(self) -> float:
        """Ratio of residual to noise floor above which an effect is missing, even if no candidate explains it."""
        return OVER_GIVEN if self.sigma_known or not self.alike else OVER_ESTIMATED

    def predict(self, values: Mapping[str, float], effects: Sequence[str]) -> Floats:
        """Return the outputs (n,) as the engine sees them; :attr:`far` where the model fails."""
        return self.predict_many([values], effects)[0]

    def predict_many(self, values: Sequence[Mapping[str, float]], effects: Sequence[str]) -> list[Floats]:
        """Return the outputs (n,) at several points, computed in parallel where the model is called in processes."""
        asked = [(self.given(one, effects), self.curves(one, effects)) for one in values]
        found = self.evaluator.many(asked)
        return [self._stacked(called) + self._added(one, effects) for called, one in zip(found, values, strict=True)]

    @cached_property
    def laws(self) -> tuple[Law, ...]:
        """Laws that may be missing: the declared ones, and those that are added to outputs over the other drivers."""
        ports = tuple(port_law(one, self.nodes[one.name], self.law_scales.get(one.name, 1.0)) for one in self.ports)
        return (*ports, *(law for law, _ in self.added.values()))

    @cached_property
    def added(self) -> Mapping[str, tuple[Law, int]]:
        """Laws that are added to an output, by their ids, with the number of the output."""
        free = {name: values for name, values in self.drivers.items() if name not in {p.driver for p in self.ports}}
        return added_laws(self.layout, free, np.where(self.valid, self.observed, np.nan))

    def _added(self, values: Mapping[str, float], effects: Sequence[str]) -> Floats | float:
        """Return the sum (n,) of the laws that are added to the outputs, in the engine's units."""
        on = [form for form in self.forms if form.id in effects and form.id in self.added]
        if not on:
            return 0.0
        total = np.zeros(len(self.observed))
        for form in on:
            law, output = self.added[form.id]
            curve = np.interp(self.drivers[law.driver], form.nodes, form.values(values))
            for _, k, place in self.layout.places:
                if k == output:
                    total[place] += curve[place] / self.layout.scale[k]
        return total

    def _stacked(self, called: Sequence[Called]) -> Floats:
        if any(one.failure is not None for one in called):
            return self.far
        return self.layout.stack([one.outputs for one in called if one.outputs is not None], between=0.0)

    @cached_property
    def far(self) -> Floats:
        """Prediction (n,) in place of a call that gives no numbers: a thousand spreads off, where no fit goes."""
        spread = float(np.nanstd(self.observed)) or 1.0
        return np.where(np.isfinite(self.observed), self.observed + 1e3 * spread, 0.0)

    def given(self, values: Mapping[str, float], effects: Sequence[str]) -> list[dict[str, float]]:
        """Return the parameters that ``predict`` gets for every record, with null values for effects that are off."""
        switched: dict[str, float] = {}
        forms = {form.id for form in self.forms}
        for one in self.candidates:
            if one.id not in forms:
                switched |= one.own(values) if one.id in effects else one.null_point()
        made = []
        for record in range(len(self.model.records)):
            own = {p.name: self._value(p, values, record) for p in self.declared}
            made.append({**own, **switched})
        return made

    def curves(self, values: Mapping[str, float], effects: Sequence[str]) -> dict[str, Curve]:
        """Return the declared laws that are on."""
        return {
            form.id: Curve(form.nodes, form.values(values))
            for form in self.forms
            if form.id in self.nodes and form.id in effects
        }

    def _value(self, one: Parameter, values: Mapping[str, float], record: int) -> float:
        if one.fixed:
            return one.value
        if one.name in values:
            return float(values[one.name])
        return float(values[name_in(one.name, record)])

    def outputs(self, values: Mapping[str, float], effects: Sequence[str], *, where: str = "predict") -> list[Floats]:
        """Return the model's outputs (rows, outputs) for every record, in their own units.

        Raises InputError if the model fails; the error's place is ``where``, or the line that failed.
        """
        called = self.evaluator(self.given(values, effects), self.curves(values, effects))
        for one in called:
            if one.failure is not None:
                raise one.failure.error(where)
        return [one.outputs for one in called if one.outputs is not None]

    def measured(self) -> list[Floats]:
        """Return the measured outputs (rows, outputs) of every record."""
        return lay.observed_of(self.model.records, self.model.outputs)

    def times(self) -> list[Floats]:
        """Return the time (rows,) of every record."""
        return [time_of(record, self.time_name) for record in self.model.records]


def model_problem(
    predict: Predict,
    observed: Table | Sequence[Table],
    parameters: Parameter | Sequence[Parameter] | Mapping[str, float],
    candidates: Candidate | LawPort | Sequence[Candidate | LawPort] = (),
    *,
    output: str | Sequence[str],
    initial: str | Sequence[str] = (),
    drivers: str | Sequence[str] | None = None,
    reading: Reading = Reading(),  # noqa: B008 - it cannot be changed
) -> ModelProblem:
    """Make the engine's problem from a model of one's own.

    Parameters
    ----------
    predict : callable
        ``predict(p, record)`` gives the output (rows,), or several outputs as a mapping by name or a tuple.
    observed : table or sequence of tables
        The measured outputs and the inputs: a DataFrame, a mapping of arrays, or a path; several records of one rig.
    parameters : sequence of Parameter, or mapping of name to start
        Parameters that the fit may change (:func:`~torsight.discovery.own.model.declare.parameter`).
    candidates : sequence of Candidate or LawPort
        What the model may lack: effects (:func:`~torsight.discovery.own.model.declare.candidate`), and ports at which a
        function of one variable may be missing (:func:`~torsight.discovery.own.model.declare.law`).
    output : str or sequence of str
        Columns of the table that ``predict`` computes.
    initial : sequence of str
        Initial states: each record has its own value, which no other block needs to determine.
    drivers : sequence of str, optional
        Columns on which a missing effect without a name may depend; without it every column but the outputs, and
        time.
    reading : Reading, optional
        How the records are read: noise, blocks, rests, time.

    Raises
    ------
    InputError
        When something is declared twice, out of bounds, missing or of a wrong shape: before any fit.
    """
    given.function(predict, "predict")
    given.one_of(reading, Reading, "reading", do="give reading=Reading(sigma=…, blocks=…)")
    outputs, initial = given.names(output, "output"), given.names(initial, "initial")
    drivers = None if drivers is None else given.names(drivers, "drivers")
    may_lack, named = candidates_of(candidates, "candidates"), parameters_of(parameters)
    ports = tuple(one for one in may_lack if isinstance(one, LawPort))
    offered = tuple(one for one in may_lack if isinstance(one, Candidate))
    _known(initial, [p.name for p in named if not p.fixed], what="initial")
    if not outputs:
        raise InputError("no output is named", where="output", do="name the column that predict gives")
    records = read_records(observed)
    if (reading.time or time_column(records[0])) in outputs:
        raise InputError("is the time", where="output", value=", ".join(outputs), do="name what predict gives")
    measured, times = lay.observed_of(records, outputs), [time_of(record, reading.time) for record in records]
    noise = lay.Noise.of(reading.sigma, records, outputs, measured)
    errors = _start_errors(predict, named, outputs, noise)
    declared, initial = (*named, *errors), (*initial, *(p.name for p in errors))
    check_declarations(declared, offered, ports)
    layout = Layout.of(
        records, outputs, measured, lay.resolutions(reading.resolution, records, outputs, measured, noise)
    )
    stacked = layout.stack(measured)
    labels = lay.blocks_of(reading.blocks, records, times)
    block = np.asarray(layout.spread([own.astype(np.float64) for own in labels]), np.int64)
    at_rest, about_rest = rest_of(reading.rest, records, outputs, measured, noise.between)
    found, about_drivers = drivers_of(drivers, records, outputs, times, reading=reading)
    model = Model(predict, records, outputs, tuple(one.name for one in ports))
    free, count = tuple(p for p in declared if not p.fixed), len(records)
    # One output without a given noise: the engine measures it from the residual, which holds less of the motion.
    left_open = len(outputs) == 1 and not noise.given
    sigma = layout.stack([own / layout.scale for own in noise.sigma], between=0.0, scaled=False)
    return ModelProblem(
        model=model,
        declared=declared,
        initial=initial,
        ports=ports,
        layout=layout,
        evaluator=Evaluator(model),
        parameters=per_record(free, initial, count),
        candidates=offered,
        time_s=lay.engine_time(times, len(outputs)),
        observed=stacked,
        sigma=np.zeros(len(stacked)) if left_open else sigma,
        valid=np.isfinite(stacked),
        block=block,
        rest=layout.spread([own.astype(np.float64) for own in at_rest]) > 0.5,
        drivers={name: layout.spread(own) for name, own in found.items()},
        resolution=layout.resolution,
        nodes={one.name: nodes_of(one) for one in ports},
        once=tuple(p.name for p in per_record([p for p in free if p.name in initial], initial, count)),
        sigma_known=noise.given,
        time_name=reading.time,
        warnings=(*about_rest, *lay.check_blocks(block, np.isfinite(stacked)), *about_drivers),
    )


def _start_errors(
    predict: Predict, declared: Sequence[Parameter], outputs: Sequence[str], noise: lay.Noise
) -> tuple[Parameter, ...]:
    """Return the errors of the first readings of an ODE's measured states, each of the size of that output's noise."""
    if not isinstance(predict, Ode):
        return ()
    return predict.start_errors(declared, outputs, dict(zip(outputs, noise.usual.tolist(), strict=True)))


def _known(names: Sequence[str], among: Sequence[str], *, what: str) -> None:
    for name in names:
        if name not in among:
            raise InputError(
                f"'{name}' is no parameter of the model that is free",
                where=what,
                limit=", ".join(among),
                do="declare it with parameter(name, start), or leave it out",
            )
