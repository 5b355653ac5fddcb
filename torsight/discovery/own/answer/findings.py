"""Findings on a model of one's own: a summary, intervals, predictions, pictures, a file."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from torsight.core.errors import ConfigError, InputError
from torsight.core.parameter import Estimate
from torsight.core.series import rms
from torsight.core.units import Ints
from torsight.core.words.shown import Shown
from torsight.discovery.inference import engine
from torsight.discovery.inference.explanation import Explanation, Field, estimates, predictive_covariance
from torsight.discovery.inference.fitting import EffectSet, less
from torsight.discovery.inference.validate import HeldOut
from torsight.discovery.inference.verdict import Decision
from torsight.discovery.interface import Problem
from torsight.discovery.own.answer import pictures, words
from torsight.discovery.own.answer.laws import MeasuredCurve, measured_curves
from torsight.discovery.own.answer.own_prediction import PredictedOutputs
from torsight.discovery.own.answer.saved import SavedModel
from torsight.discovery.own.model.declare import LawPort
from torsight.discovery.own.model.problem import ModelProblem
from torsight.discovery.own.own_records import Table
from torsight.discovery.settings import Settings

if TYPE_CHECKING:
    from matplotlib.figure import Figure


_BETTER: Final = 0.95
"""Share of the chosen set's error on held-out blocks below which a larger set predicts better."""


@dataclass(frozen=True, slots=True)
class Errors:
    """Root mean square errors of one output in its unit; NaN where nothing could be held out."""

    rmse_train: float
    rmse_held_out: float
    r2_held_out: float

    @property
    def known(self) -> float:
        """Error on held-out blocks, else on the ones that were fitted."""
        return self.rmse_train if math.isnan(self.rmse_held_out) else self.rmse_held_out


@dataclass(frozen=True, slots=True)
class FittedSet:
    """One of the sets compared: effects and laws, gain in log evidence, probability, errors in the engine's unit."""

    effects: tuple[str, ...]
    gain: float
    probability: float
    rmse_train: float
    rmse_held_out: float


@dataclass(frozen=True, eq=False, repr=False)
class Findings(Shown):
    """What a model lacks.

    ``print`` gives a summary, as does a notebook; :meth:`predict` predicts other records, :meth:`overview` draws, and
    :meth:`to_json` holds all numbers.

    Attributes
    ----------
    problem : Problem
        The problem that was searched.
    found : torsight.discovery.inference.engine.Findings
        The engine's answer.
    warnings : tuple of str
        Warnings and notes to the user.
    failures : tuple of str
        The first calls in which the model raised an error or gave no numbers, each with its traceback.
    failed, calls : int
        Number of calls that failed, and of all calls.
    settings : Settings
        Probabilities and budgets of the decision.
    """

    problem: Problem
    found: engine.Findings
    warnings: tuple[str, ...] = ()
    failures: tuple[str, ...] = ()
    failed: int = 0
    calls: int = 0
    settings: Settings = field(default_factory=Settings)

    @property
    def verdict(self) -> engine.Verdict:
        """``none``, ``identified``, ``ambiguous`` or ``unknown``.

        Where the residual is far above the noise, the verdict is ``unknown`` even if an effect has been named.
        """
        named = self.found.verdict == "identified"
        return "unknown" if named and self.decision.over_floor > self.problem.over_floor else self.found.verdict

    @property
    def effects(self) -> tuple[str, ...]:
        """Ids of the effects that are missing, strongest first; laws without a name are in :attr:`laws`."""
        named = sorted(self.decision.named.items(), key=lambda item: -self.gain_of(item[0]))
        return tuple(name for _, (name, _) in named)

    @property
    def forms_taken(self) -> tuple[str, ...]:
        """Effects of the answer whose form was not compared with a free law in the same place."""
        found = []
        for member, (name, _) in self.decision.named.items():
            others = less(self.decision.chosen.members, member)
            laws = self.field.base.fitter.candidates[name].laws
            if not any(tuple(sorted((*others, law))) in self.field.explanations for law in laws):
                found.append(name)
        return tuple(found)

    @property
    def drivers_offered(self) -> tuple[str, ...]:
        """Variables on which a law was offered to depend."""
        return tuple(dict.fromkeys(law.driver for law in self.problem.laws))

    @property
    def alternatives(self) -> tuple[tuple[str, ...], ...]:
        """Other sets of effects and laws, by their ids, that explain the record about as well as the answer."""
        return tuple(one.members for one in self.decision.rivals)

    @property
    def field(self) -> Field:
        """All explanations that were fitted."""
        return self.found.field

    @property
    def decision(self) -> Decision:
        """The chosen explanation, the names that its members carry, and the probabilities of all sets."""
        return self.found.decision

    @property
    def before(self) -> HeldOut | None:
        """Prediction of held-out blocks by the plain model."""
        return self.found.before

    @property
    def after(self) -> HeldOut | None:
        """Prediction of held-out blocks by the extended model."""
        return self.found.after

    @property
    def drivers(self) -> tuple[tuple[str, float], ...]:
        """Variables on which the measured laws depend, each with its share, strongest first."""
        return self.found.drivers

    @property
    def values(self) -> dict[str, float]:
        """Fitted parameters of the extended model."""
        return self.decision.chosen.fit.values

    @cached_property
    def parameters(self) -> dict[str, Estimate]:
        """Parameters of the extended model with standard deviation and 95 % interval; laws are in :attr:`laws`.

        Those of an effect that gave a law its name are from the fit with the effect in the law's place.
        """
        found = self._estimates(self.decision.chosen)
        for name, where in self.decision.named.values():
            if where is not self.decision.chosen:
                own = {p.name for p in where.fitter.candidates[name].parameters}
                found |= {key: one for key, one in self._estimates(where).items() if key in own}
        return found

    @cached_property
    def plain_parameters(self) -> dict[str, Estimate]:
        """Parameters of the plain model with standard deviation and 95 % interval."""
        return self._estimates(self.field.base)

    @cached_property
    def laws(self) -> tuple[MeasuredCurve, ...]:
        """Laws that were measured: those of the answer, then declared ones that were tried alone."""
        ports = self.ports
        held = {item.law.id for item in self.decision.chosen.laws}
        alone = [self.field.explanations[(p.name,)] for p in ports if (p.name,) in self.field.explanations]
        alone = [one for one in alone if one.members[0] not in held]
        gains = {name: self.gain_of(name) for name in held}
        gains |= {one.members[0]: one.log_evidence - self.field.base.log_evidence for one in alone}
        names = {member: name for member, (name, _) in self.decision.named.items() if member in held}
        return measured_curves(self.decision.chosen, alone, gains, names, ports)

    @property
    def ports(self) -> tuple[LawPort, ...]:
        """Laws as declared."""
        return self.problem.ports if isinstance(self.problem, ModelProblem) else ()

    def _estimates(self, one: Explanation) -> dict[str, Estimate]:
        coefficients = {name for item in one.laws for name in item.form.names}
        return {name: value for name, value in estimates(one).items() if name not in coefficients}

    def gain_of(self, name: str) -> float:
        """Return the log evidence that is lost without one of the answer's effects or laws."""
        without = self.field.explanations.get(less(self.decision.chosen.members, name))
        return math.nan if without is None else self.decision.chosen.log_evidence - without.log_evidence

    def ranked(self, size: int) -> list[Explanation]:
        """Return the fitted sets of ``size`` effects and laws, the one with the greatest evidence first."""
        found = [one for one in self.field.explanations.values() if len(one.members) == size]
        return sorted(found, key=lambda one: (-one.log_evidence, one.members))

    @property
    def price(self) -> float:
        """Gain in log evidence that one more effect or law costs."""
        problem = self.field.base.fitter.problem
        return self.settings.price(len(problem.candidates) + len(problem.laws))

    @cached_property
    def errors(self) -> dict[str, tuple[Errors, Errors]]:
        """Errors of the plain and the extended model for every output, in its unit."""
        fits = ((self.field.base, self.before), (self.decision.chosen, self.after))
        found = {}
        for k, name in enumerate(self.outputs):
            plain, extended = (self._errors_of(one, held_out, k) for one, held_out in fits)
            found[name] = (plain, extended)
        return found

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs."""
        return self.problem.model.outputs if isinstance(self.problem, ModelProblem) else ("observed",)

    def _errors_of(self, one: Explanation, held_out: HeldOut | None, output: int) -> Errors:
        rows, scale = self.rows_of(output)
        train = scale * rms(one.residual[rows])
        if held_out is None:
            return Errors(train, math.nan, math.nan)
        missed, observed = rms(held_out.residual[rows]), self.problem.observed[rows]
        return Errors(train, scale * missed, 1.0 - missed**2 / max(float(np.var(observed)), 1e-300))

    def rows_of(self, output: int) -> tuple[Ints, float]:
        """Return the valid rows (k,) of an output in the problem, and the output's unit per unit of the engine."""
        rows, scale = np.arange(len(self.problem.observed)), 1.0
        if isinstance(self.problem, ModelProblem):
            layout = self.problem.layout
            rows = np.concatenate([rows[place] for _, k, place in layout.places if k == output])
            scale = float(layout.scale[output])
        return rows[self.problem.valid[rows]], scale

    @cached_property
    def best_fits(self) -> tuple[FittedSet, ...]:
        """The plain model, the chosen set and the best sets of each size, five of single members, two of others."""
        listed = [one for size in self._sizes for one in self.ranked(size)[: 5 if size == 1 else 2]]
        if all(one.members != self.decision.chosen.members for one in listed):
            listed.append(self.decision.chosen)
        return tuple(self._fitted(one) for one in listed)

    @property
    def _sizes(self) -> list[int]:
        return sorted({len(members) for members in self.field.explanations})

    def _fitted(self, one: Explanation) -> FittedSet:
        # Each held-out block costs a fit: it is made for sets that bear on the answer; others show what is known.
        known = "held_out" in one.__dict__ or one.members in self._bearing
        unseen = one.held_out.rms if self.before is not None and known else math.nan
        gain = one.log_evidence - self.field.base.log_evidence
        weight = self.decision.probability[tuple(sorted(one.members))]
        return FittedSet(one.members, gain, weight, rms(one.residual[self.problem.valid]), unseen)

    @cached_property
    def _bearing(self) -> tuple[EffectSet, ...]:
        """The answer, the best set that is larger by one, and for ``unknown`` the best of every size."""
        sizes = [len(self.decision.chosen.members) + 1] if self.verdict != "unknown" else self._sizes
        return (self.decision.chosen.members, *(one.members for k in sizes for one in self.ranked(k)[:1]))

    @cached_property
    def predicts_better(self) -> tuple[FittedSet, ...]:
        """Sets with more effects than the answer that predict held-out blocks clearly better, the best first."""
        own = self._fitted(self.decision.chosen)
        larger = [one for one in self.best_fits if len(one.effects) > len(own.effects)]
        found = [one for one in larger if one.rmse_held_out < _BETTER * own.rmse_held_out]
        return tuple(sorted(found, key=lambda one: one.rmse_held_out))

    def facts(self) -> dict[str, str]:
        """Return what is missing, the errors, and what was found of each effect and law."""
        return words.facts(self)

    def summary(self) -> str:
        """Return the answer as text of a few lines."""
        return words.summary(self)

    def __str__(self) -> str:
        return self.summary()

    def __repr__(self) -> str:
        effects = ", ".join(self.effects)
        return f"Findings({self.verdict}{': ' if effects else ''}{effects})"

    def _repr_html_(self) -> str:
        return words.html(self)

    def _columns(self) -> dict[str, Any]:
        return dict(self.curves())

    def _draw(self, axes: Any) -> None:
        pictures.draw_motion(axes, pictures.series_of(self)[0])
        axes.legend(loc="best", fontsize="small", frameon=False)

    def overview(self) -> Figure:
        """Return a figure (matplotlib): measured and both models, residuals, and what each candidate explains.

        :meth:`plot` draws the first of its panels, measured and both models of the first output, into axes.
        """
        return pictures.overview(self)

    def model(self, effects: Iterable[str] | None = None) -> SavedModel:
        """Return the extended model, ready to predict other records and to be saved.

        Parameters
        ----------
        effects : ids, optional
            One of :attr:`alternatives`, or another set that was fitted, to be used instead of the answer.

        Raises
        ------
        ConfigError
            When this set was not fitted.
        InputError
            When the problem was not made by ``model_problem``.
        """
        problem = self.problem
        if not isinstance(problem, ModelProblem):
            do = "make the problem with model_problem(…), whose predict takes any record"
            raise InputError("cannot predict another record", where=type(problem).__name__, do=do)
        chosen, unseen = self.decision.chosen, self.after
        if effects is not None:
            chosen = self._fitted_with(effects)
            unseen = None if self.before is None else chosen.held_out
        noise = tuple(self._errors_of(chosen, unseen, k).known for k in range(len(self.outputs)))
        return SavedModel.of(problem, chosen, covariance=predictive_covariance(chosen), noise=noise)

    def _fitted_with(self, effects: Iterable[str]) -> Explanation:
        """Return the fit with these effects and laws, in any order."""
        wanted = tuple(sorted(effects))
        found = self.field.explanations.get(wanted)
        if found is None:
            raise ConfigError(
                "this set of effects and laws was not fitted",
                where="effects",
                value=" and ".join(wanted) or "none",
                limit=", or ".join(" and ".join(one.effects) or "none" for one in self.best_fits),
                do="give one of alternatives or best_fits",
            )
        return found

    def predict(
        self, record: Table, *, initial: Mapping[str, float] | None = None, effects: Iterable[str] | None = None
    ) -> PredictedOutputs:
        """Return the extended model's outputs for another record, with their standard deviations.

        Parameters
        ----------
        record : table
            Inputs of the other record: a DataFrame, a mapping of arrays, or a path.
        initial : mapping, optional
            Initial states: values of the parameters that every record has for itself. By default they are fitted to
            the outputs in the record where it has those, else taken from the first record of the fit.
        effects : ids, optional
            One of :attr:`alternatives`, or another set that was fitted, to be used instead of the answer. A planned
            record that two sets predict differently can distinguish them.

        Returns
        -------
        PredictedOutputs
            Time, then ``<output>`` and ``<output>_sigma`` for each output, (rows,) each, by name.
        """
        return self.model(effects).predict(record, initial=initial)

    def curves(self) -> dict[str, NDArray[Any]]:
        """Return a table: for every row of every record the time, and each output as measured, plain and extended."""
        return pictures.table_of(self)

    def to_json(self) -> dict[str, Any]:
        """Return the content of ``discovery.json``."""
        return words.to_json(self)
