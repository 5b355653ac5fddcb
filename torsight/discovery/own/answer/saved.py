"""An extended model of one's own, to predict other records: in memory, and as ``model.json``."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from torsight.core.errors import ConfigError, InputError
from torsight.core.files.provenance import file_hash
from torsight.core.files.storage import read_json, write_json
from torsight.core.law import LawForm
from torsight.core.parameter import Parameter
from torsight.core.series import FEWEST, rms
from torsight.core.units import Floats
from torsight.discovery.inference.explanation import Explanation
from torsight.discovery.inference.fitting import space_of
from torsight.discovery.inference.solver import jacobian, solve
from torsight.discovery.own.answer.laws import beyond
from torsight.discovery.own.answer.own_prediction import PredictedOutputs
from torsight.discovery.own.model.declare import RESERVED, name_in
from torsight.discovery.own.model.evaluate import Called, Model, Predict, call
from torsight.discovery.own.model.model_file import Declared, declared_in, declared_of
from torsight.discovery.own.model.ode import START_ERROR, Ode
from torsight.discovery.own.model.problem import ModelProblem
from torsight.discovery.own.model.values import Curve
from torsight.discovery.own.own_records import Record, Table, column_of, read_records, time_column, time_of
from torsight.discovery.weight import Weight

KIND: Final = "own model"
"""Value of ``kind`` that distinguishes the ``model.json`` of a model of one's own from the actuator's."""


@dataclass(frozen=True, slots=True, eq=False)
class LawOn:
    """A law of the extended model: its form; output and driver of a law that is added to an output."""

    form: LawForm
    output: str | None = None
    driver: str = ""
    time_like: bool = False

    def to_json(self) -> dict[str, Any]:
        """Return the law's entry in ``model.json``, without the values of its parameters."""
        added = {"output": self.output, "driver": self.driver, "time_like": self.time_like}
        return {**self.form.to_json(), **added}

    @classmethod
    def from_json(cls, one: Mapping[str, Any]) -> LawOn:
        """Return a law from its entry in ``model.json``."""
        nodes, basis = np.array(one["nodes"], np.float64), np.array(one["basis"], np.float64)
        form = LawForm(str(one["id"]), nodes, basis, str(one["unit"]), float(one["scale"]), prior=True)
        output = None if one["output"] is None else str(one["output"])
        return cls(form, output, str(one["driver"]), bool(one["time_like"]))

    def steep(self, values: Mapping[str, float]) -> float:
        """Return the law's root mean square slope."""
        return rms(np.diff(self.form.values(values)) / np.diff(self.form.nodes))

    def further(self, values: Mapping[str, float], asked: tuple[float, float]) -> list[Curve]:
        """Return the law with possible continuations, up and down, beyond each end past which it is called."""
        nodes, curve = self.form.nodes, self.form.values(values)
        far = 10.0 * (nodes[-1] - nodes[0])  # the model may then call it still farther outside
        ends = [(0, nodes[0] - far, curve[0])] if asked[0] < nodes[0] else []
        ends += [(len(nodes), nodes[-1] + far, curve[-1])] if asked[1] > nodes[-1] else []
        rise = self.steep(values) * far
        return [
            Curve(np.insert(nodes, place, end), np.insert(curve, place, value + side * rise))
            for place, end, value in ends
            for side in (1.0, -1.0)
        ]


@dataclass(frozen=True, eq=False)
class SavedModel:
    """An extended model with its values.

    ``effects`` are those that are on, ``initial`` the parameters that every record has for itself. ``values`` are the
    fitted ones, initial states those of the first record, the forms' parameters of the ``laws`` that are on among them;
    ``names`` and ``covariance`` (m, m) are those of the uncertain ones. ``noise`` is the error of each output on
    held-out blocks, root mean square; ``ports`` are the names of the declared laws.
    """

    declared: Declared
    effects: tuple[str, ...]
    initial: tuple[str, ...]
    values: Mapping[str, float]
    names: tuple[str, ...]
    covariance: Floats
    noise: tuple[float, ...]
    ports: tuple[str, ...]
    laws: tuple[LawOn, ...] = ()

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs."""
        return self.declared.outputs

    @classmethod
    def of(
        cls, problem: ModelProblem, chosen: Explanation, *, covariance: Floats, noise: tuple[float, ...]
    ) -> SavedModel:
        """Return the model with a fit's values."""
        values, effects = chosen.fit.values, chosen.effects
        own = {p.name: values.get(p.name, values.get(name_in(p.name, 0), p.value)) for p in problem.declared}
        for one in problem.candidates:
            own |= one.own(values) if one.id in effects else one.null_point()
        own |= {name: values[name] for item in chosen.laws for name in item.form.names}
        laws = tuple(
            LawOn(item.form, None if item.law.id in problem.nodes else item.law.port, item.law.driver,
                  item.law.time_like)
            for item in chosen.laws
        )  # fmt: skip
        fitted = list(values)
        kept = [i for i, name in enumerate(fitted) if name in own]
        return cls(
            declared=declared_in(problem),
            effects=effects,
            initial=problem.initial,
            values=own,
            names=tuple(fitted[i] for i in kept),
            covariance=covariance[np.ix_(kept, kept)],
            noise=noise,
            ports=problem.model.laws,
            laws=laws,
        )

    def predict(self, record: Table, *, initial: Mapping[str, float] | None = None) -> PredictedOutputs:
        """Return time, outputs and their standard deviations for a record; see ``Findings.predict``.

        Raises InputError when the record cannot be read, or the model fails on it.
        """
        (own,) = read_records(record)
        begun, given = self._begun(initial or {})
        model = Model(begun, (own,), self.outputs, self.ports)
        values, taken = self._with_initial(model, own, given)

        def at(x: Floats) -> Floats:
            return self._called(model, {**values, **dict(zip(self.names, x.tolist(), strict=True))}).ravel()

        done = self._done(model, values, self._curves(values))
        middle = self._with_added(model, values, done)
        parameters = [self._parameter(name, values[name]) for name in self.names]
        slopes = np.zeros((middle.size, 0))
        if parameters:
            x = np.array([values[name] for name in self.names])
            slopes = jacobian(at, x, at_x=middle.ravel(), space=space_of(parameters))
        spread = np.einsum("ij,jk,ik->i", slopes, self.covariance, slopes).reshape(middle.shape)
        spread += self._beyond(model, values, done)
        time = self.declared.time
        made = {(time or time_column(own) or "row"): time_of(own, time)}
        for k, name in enumerate(self.outputs):
            made[name] = middle[:, k]
            made[f"{name}_sigma"] = np.sqrt(np.maximum(spread[:, k], 0.0) + self.noise[k] ** 2)
        notes = [*beyond([done], self._curves(values)), *self._without_restart(own), *taken]
        return PredictedOutputs(made, self.outputs, own.label_, tuple(notes))

    def _without_restart(self, record: Record) -> list[str]:
        """Return a warning where states that should begin anew cannot, because the record does not hold them."""
        ode, length_s = self.declared.predict, self._restart_s
        lacking = [name for name in ode.measured if name not in record] if isinstance(ode, Ode) else []
        if length_s is None or not lacking:
            return []
        note = (
            f"small errors grow in this model, and the record holds no {', '.join(lacking)} that could begin anew "
            f"every {length_s:.3g} s: after a few times this long the prediction is only one of the possible courses"
        )
        return [note]

    def _beyond(self, model: Model, values: Mapping[str, float], done: Called) -> Floats:
        """Return the variance (rows, outputs) that laws have where they were never measured.

        There a law may rise or fall as steeply as it does within its nodes. A law over time holds for the record in
        which it was measured: in another record its mean square is a variance.
        """
        middle = self._with_added(model, values, done)
        found, curves = np.zeros(middle.shape), self._curves(values)
        for law in self.laws:
            if law.output is None:
                for further in law.further(values, done.asked[law.form.id]):
                    other = self._done(model, values, {**curves, law.form.id: further})
                    found += 0.5 * (self._with_added(model, values, other) - middle) ** 2
            elif law.time_like:
                found[:, self.outputs.index(law.output)] += float(np.mean(law.form.values(values) ** 2))
            else:
                at, nodes = column_of(model.records[0], law.driver), law.form.nodes
                beyond_by = at - np.clip(at, nodes[0], nodes[-1])
                found[:, self.outputs.index(law.output)] += (law.steep(values) * beyond_by) ** 2
        return found

    def _parameter(self, name: str, value: float) -> Parameter:
        declared = [*self.declared.every_parameter, *(p for law in self.laws for p in law.form.parameters)]
        found = next((p for p in declared if p.name == name), None)
        return Parameter(name, value, "") if found is None else found.at(value)

    def _curves(self, values: Mapping[str, float]) -> dict[str, Curve]:
        return {law.form.id: Curve(law.form.nodes, law.form.values(values)) for law in self.laws if law.output is None}

    def _done(self, model: Model, values: Mapping[str, float], curves: Mapping[str, Curve]) -> Called:
        numbers = {name: value for name, value in values.items() if RESERVED not in name}
        done = call(model, 0, numbers, curves)
        if done.failure is not None:
            raise done.failure.error("predict")
        return done

    def _called(self, model: Model, values: Mapping[str, float]) -> Floats:
        return self._with_added(model, values, self._done(model, values, self._curves(values)))

    def _with_added(self, model: Model, values: Mapping[str, float], done: Called) -> Floats:
        """Return the outputs of a call (rows, outputs) with the laws that are added to them."""
        if done.outputs is None:
            raise InputError("the model gives nothing", where=model.records[0].label_)
        outputs = done.outputs.copy()
        for law in self.laws:
            if law.output is not None and not law.time_like:
                at = column_of(model.records[0], law.driver)
                outputs[:, self.outputs.index(law.output)] += np.interp(at, law.form.nodes, law.form.values(values))
        return outputs

    def _begun(self, initial: Mapping[str, float]) -> tuple[Predict, dict[str, float]]:
        """Return the function with states that begin at given values, and the remaining initial values, by parameter.

        A state that otherwise begins at the first reading of its column is given by its own name.
        """
        ode = self.declared.predict
        if not isinstance(ode, Ode):
            return ode, dict(initial)
        states = {name: initial[name] for name in ode.begun_by_readings(self.declared.parameters) if name in initial}
        exact = [START_ERROR.format(name) for name in states]
        rest = {name: value for name, value in initial.items() if name not in states}
        begun = replace(ode, initial={**ode.initial, **states})
        return begun, {**rest, **{name: 0.0 for name in exact if name in self.initial}}

    def _with_initial(
        self, model: Model, record: Record, given: Mapping[str, float]
    ) -> tuple[dict[str, float], tuple[str, ...]]:
        """Return the values with the initial states of a record, and a warning where these are unknown.

        Initial states are given, or fitted to the record's beginning, or those of the first record of the fit.
        """
        unknown = [name for name in given if name not in self.initial]
        if unknown:
            ode = self.declared.predict
            states = ode.begun_by_readings(self.declared.parameters) if isinstance(ode, Ode) else ()
            errors = [START_ERROR.format(name) for name in states]
            known = [*states, *(name for name in self.initial if name not in errors)]
            raise ConfigError(
                f"'{unknown[0]}' is no initial state", where="initial", limit=", ".join(known) or "there is none"
            )
        values = {**self.values, **given}
        free = [self._parameter(name, values[name]) for name in self.initial if name not in given]
        free = [p for p in free if not p.fixed]
        if not free:
            return values, ()
        note = (
            f"how the record begins is not known ({', '.join(p.name for p in free)}), and it holds no "
            f"{', '.join(self.outputs)} to fit that to: the first record's values are used, and sigma does not include "
            f"their error; give them (--initial {free[0].name}=…, in Python initial={{…}})"
        )
        if any(name not in record for name in self.outputs):
            return values, (note,)
        # Later rows contain less and less information about initial states, and are to be predicted.
        rows = min(record.rows_, max(FEWEST, round(0.1 * record.rows_)))
        observed = np.column_stack([record[name] for name in self.outputs])
        each = np.where(np.isfinite(observed), 1.0 / np.array(self.noise) ** 2, 0.0)
        each[rows:] = 0.0
        if not each.any():
            return values, (note,)

        def at(x: Floats) -> Floats:
            own = dict(zip([p.name for p in free], x.tolist(), strict=True))
            return self._called(model, {**values, **own}).ravel()

        start = np.array([p.value for p in free])
        found = solve(
            at, start, observed=observed.ravel(), weight=Weight.of(each.ravel()), space=space_of(free), rough=True
        )
        return {**values, **dict(zip([p.name for p in free], found.x.tolist(), strict=True))}, ()

    def to_json(self) -> dict[str, Any]:
        """Return the content of ``model.json``, without name and hash of the model file, which holds the function."""
        return {
            "kind": KIND,
            "outputs": list(self.outputs),
            "effects": list(self.effects),
            "initial": list(self.initial),
            "values": dict(self.values),
            "names": list(self.names),
            "covariance": self.covariance.tolist(),
            "noise": dict(zip(self.outputs, self.noise, strict=True)),
            "ports": list(self.ports),
            "laws": [law.to_json() for law in self.laws],
            "restart_s": self._restart_s,
        }

    @property
    def _restart_s(self) -> float | None:
        """Time in seconds after which measured states begin anew; None where they never do."""
        ode = self.declared.predict
        return ode.solver.restart_s if isinstance(ode, Ode) and math.isfinite(ode.solver.restart_s) else None

    @classmethod
    def from_json(cls, content: Mapping[str, Any], declared: Declared, *, where: str) -> SavedModel:
        """Return a model from the content of ``model.json`` and the declarations of its model file."""
        try:
            outputs, effects, initial, names, ports = (
                tuple(str(name) for name in content[key]) for key in ("outputs", "effects", "initial", "names", "ports")
            )
            if isinstance(declared.predict, Ode) and content.get("restart_s") is not None:
                declared = replace(declared, predict=declared.predict.begun_anew(float(content["restart_s"])))
            values = {str(name): float(value) for name, value in content["values"].items()}
            noise = {name: float(content["noise"][name]) for name in outputs}
            made = cls(
                _with_start_errors(declared, values, noise),
                effects,
                initial,
                values=values,
                names=names,
                covariance=np.array(content["covariance"], np.float64).reshape(len(names), len(names)),
                noise=tuple(noise.values()),
                ports=ports,
                laws=tuple(LawOn.from_json(one) for one in content["laws"]),
            )
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise InputError(
                f"is damaged ({type(error).__name__}: {error})", where=where, do="run 'torsight missing' again"
            ) from error
        known = {name for name in made.values if RESERVED not in name}
        if {p.name for p in made.declared.every_parameter} != known or outputs != declared.outputs:
            do = "run 'torsight missing' again with this model file"
            raise InputError("belongs to another model: parameters or outputs differ", where=where, do=do)
        return made


def _with_start_errors(declared: Declared, values: Mapping[str, float], noise: Mapping[str, float]) -> Declared:
    """Return a model file's declarations with the errors of the readings at which states begin, as in the fit."""
    if not isinstance(declared.predict, Ode):
        return declared
    names = {p.name for p in declared.parameters}
    errors = declared.predict.start_errors(declared.parameters, tuple(noise), noise)
    added = [p for p in errors if p.name in values and p.name not in names]
    return replace(declared, parameters=(*declared.parameters, *added))


def write_model(path: Path, model: SavedModel, *, model_file: Path) -> None:
    """Write ``model.json``, with the relative path and the hash of the model file, which holds the function."""
    beside = os.path.relpath(model_file.resolve(), path.parent.resolve())
    write_json(path, {**model.to_json(), "model_file": beside, "sha256": file_hash(model_file)})


def is_own_model(path: Path) -> bool:
    """Return whether a ``model.json`` is that of a model of one's own."""
    return read_json(path).get("kind") == KIND


def read_model(path: Path, record: Path) -> SavedModel:
    """Read ``model.json`` and run the model file that it names, for a record that is to be predicted.

    Raises
    ------
    InputError
        When either file is missing or damaged, or the model file has changed since.
    """
    content = read_json(path)
    file = path.parent / str(content.get("model_file"))
    if file_hash(file) != content.get("sha256"):
        do = f"run 'torsight missing' again, or put back the file that belongs to {path}"
        raise InputError("has changed since the values were fitted", where=str(file), do=do)
    return SavedModel.from_json(content, declared_of(file, record), where=str(path))
