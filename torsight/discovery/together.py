"""The discovery on several records of one rig: one answer, with its errors on each of the records."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import isnan
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from torsight.actuator.fit_result import require_motion
from torsight.actuator.model import ActuatorModel
from torsight.actuator.spec import ActuatorSpec
from torsight.core.errors import ConfigError, require_kind
from torsight.core.law import TIME
from torsight.core.parallel.threads import one_thread
from torsight.core.parameter import Estimate, estimates_to_json
from torsight.core.progress import Progress, silent
from torsight.core.records import SyncedTable
from torsight.core.series import rms
from torsight.core.units import DEG, Floats
from torsight.discovery.actuator.curves import curve_columns
from torsight.discovery.actuator.law_tables import Acting
from torsight.discovery.actuator.several import SeveralRecords
from torsight.discovery.actuator_problem import ActuatorProblem
from torsight.discovery.design.next_experiment import NEEDED_GAIN, NextExperiment, next_experiment
from torsight.discovery.discover import (
    decided,
    doubt_of,
    errors_of,
    left_deg,
    model_of,
    noise_floor,
    single_reading_deg,
)
from torsight.discovery.inference.engine import Findings
from torsight.discovery.inference.explanation import Explanation, Field, predictive_covariance
from torsight.discovery.inference.fitting import Fit, Fitter
from torsight.discovery.inference.noise import Stretches
from torsight.discovery.inference.validate import HeldOut, held_out_by_refit
from torsight.discovery.own.find import find_missing
from torsight.discovery.report import DiscoveryReport, Errors


@dataclass(frozen=True, slots=True, eq=False)
class RecordAnswer:
    """The joint answer on one record, with the record's own values under the names that a single record has for them.

    ``before`` and ``after`` are the errors of the plain and of the extended model on this record, held out by
    half-cycle; ``unseen_…_deg`` are the root mean square errors where rig and effects were fitted to the other records
    alone (values that only this record determines, its start, zero, clocks and events, stay as fitted to all records).
    ``noise_floor_deg`` is the residual that no model can remove. ``curves`` holds the columns (n,) of ``curves.csv``.
    """

    file: str
    before: Errors
    after: Errors
    unseen_before_deg: float
    unseen_after_deg: float
    noise_floor_deg: float
    parameters: Mapping[str, Estimate]
    curves: Mapping[str, NDArray[np.generic]]

    def to_json(self) -> dict[str, Any]:
        """Return the record's entry in ``discovery.json``."""
        return {
            "file": self.file,
            "before": {**self.before.to_json(), "rmse_other_records_deg": self.unseen_before_deg},
            "after": {**self.after.to_json(), "rmse_other_records_deg": self.unseen_after_deg},
            "noise_floor_deg": self.noise_floor_deg,
            "parameters": estimates_to_json(self.parameters),
        }


@dataclass(frozen=True, eq=False, repr=False)
class JointReport(DiscoveryReport):
    """The answer for several records together.

    Attributes
    ----------
    records : tuple of RecordAnswer
        The answer on each record, in their order. ``curves`` of the report are those of the first record; ``model``
        continues from the end of the last.
    """

    records: tuple[RecordAnswer, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """Return the content of ``discovery.json``."""
        return {**DiscoveryReport.to_json(self), "records": [record.to_json() for record in self.records]}


@one_thread()
def discover_together(
    tables: Sequence[SyncedTable],
    spec: ActuatorSpec,
    *,
    names: Sequence[str] | None = None,
    seed: int = 0,
    progress: Progress = silent,
) -> JointReport:
    """Find what the quasi-static model lacks on several records of one rig together.

    Parameters
    ----------
    tables : sequence of SyncedTable
        Two records or more, in the order in which they were made: the springs' cycles are counted across them.
    spec : ActuatorSpec
        Characterised values of the one actuator, with their uncertainties.
    names : sequence of str, optional
        Names of the records in messages and in the answer.
    seed : int
        Seed of every random draw.
    progress : Progress
        Called with the name of each step and how much of the step is done.

    Raises
    ------
    ConfigError
        When there are fewer than two records, or two are the same table.
    InputError, NoResultError
        When a record cannot drive the model.
    """
    require_kind(tables, Sequence, where="discover_together, tables", do="give the records as a list")
    labels = tuple(names or (f"record {k + 1}" for k in range(len(tables))))
    _require_different(tables, labels)
    model, drives = ActuatorModel(spec), []
    for table, name in zip(tables, labels, strict=True):
        drive = model.prepare(table, where=name)
        require_motion(model, drive, where=name)
        drives.append(drive)
    problem = SeveralRecords.of(drives, spec, seed=seed)
    findings = find_missing(problem, seed=seed, progress=progress).found
    return _report(problem, findings, labels, seed=seed, progress=progress)


def _require_different(tables: Sequence[SyncedTable], names: Sequence[str]) -> None:
    """Refuse a single record, and the same record twice: it would count as two independent measurements."""
    if len(tables) < 2:
        raise ConfigError("needs two records or more", where="discovery of several records", value=len(tables))
    for k, table in enumerate(tables):
        for other, name in zip(tables[:k], names[:k], strict=True):
            if len(table) == len(other) and np.array_equal(table.angle_rad, other.angle_rad, equal_nan=True):
                raise ConfigError(
                    "holds the same angles as another record",
                    where=names[k],
                    value=name,
                    do="give every record once: the same one twice would count as two independent measurements",
                )


def single(joint: Explanation, record: int) -> Explanation:
    """Return a joint explanation as one of a single record: with the record's rows, effects and values."""
    several = cast("SeveralRecords", joint.fitter.problem)
    part, rows = several.parts[record], several.rows_of(record)
    effects = several.effects_of(record, joint.fit.effects)
    fitter = Fitter(part, joint.fitter.weight.at(rows))
    parameters = fitter.parameters(effects)
    places = _places(several, joint.fit, record, [p.name for p in parameters])
    solution = joint.fit.solution
    own = replace(
        solution,
        x=solution.x[places],
        prediction=solution.prediction[rows],
        jacobian=solution.jacobian[rows][:, places],
    )
    fit, likelihood = Fit(effects, parameters, own), joint.likelihood.at(rows)
    laws = tuple(several.own_law(measured, record) for measured in joint.laws)
    return Explanation(fitter, fit, laws, likelihood, joint.log_evidence)


def _places(problem: SeveralRecords, fit: Fit, record: int, names: Sequence[str]) -> list[int]:
    """Return the indices of a record's parameters among those of a joint fit."""
    joint = [p.name for p in fit.parameters]
    return [joint.index(problem.joint_name(record, name)) for name in names]


def _own_held_out(problem: SeveralRecords, joint: HeldOut, record: int) -> HeldOut:
    """Return a record's part of a joint prediction of held-out half-cycles, numbered as in the record."""
    first = problem.opening_blocks[record]
    halves = range(first, first + len(problem.parts[record].drive.cycles.springs))
    rows = problem.rows_of(record)
    residual = joint.residual[rows]
    folds = tuple(
        (label - first, problem.values_of(record, values)) for label, values in joint.folds if label in halves
    )
    rms = float(np.sqrt(np.nanmean(residual**2)))
    return HeldOut(residual, rms, folds, joint.unsure[rows])


def _report(
    problem: SeveralRecords, findings: Findings, names: Sequence[str], *, seed: int, progress: Progress
) -> JointReport:
    decision, last = findings.decision, len(problem.parts) - 1
    base, chosen = findings.field.plain, decision.chosen
    acting = [
        Acting(name, problem.parts[k], problem.own_law(item, k))
        for item in chosen.laws
        for k, name in enumerate(names if item.law.driver == TIME else [""])
    ]
    shared = decided(problem, findings, records=problem.parts, laws=acting, seed=seed, effect_of=problem.effect_of)
    records = _records(problem, findings, shared["parameters"], names, progress=progress)
    before, after = _pooled(problem, [one.before for one in records]), _pooled(problem, [one.after for one in records])
    floor = _mean_square(problem, [one.noise_floor_deg for one in records])
    account = {"found_by": "discovery", "records": list(names), **after.to_json()}
    view = single(chosen, last)
    model = model_of(problem.parts[last], view)
    others = [(model_of(problem.parts[last], single(one, last)), part) for one, part in decision.shared]
    places = _places(problem, chosen.fit, last, [p.name for p in view.fit.parameters])
    doubt = doubt_of(
        view.fit.parameters,
        predictive_covariance(chosen)[np.ix_(places, places)],
        left_deg(findings, problem.parts[last], view),
        others,
        reading_deg=single_reading_deg(problem.parts[last], view, Stretches.of(problem.parts[last])),
    )
    return JointReport(
        **shared,
        before=before,
        after=after,
        held_out=tuple(label for label, _ in base.held_out.folds),
        noise_floor_deg=min(floor, before.rmse_train_deg, after.rmse_train_deg),
        next_experiment=_next(problem, findings, progress=progress),
        curves=records[0].curves,
        model=replace(model, account=account, doubt=doubt),
        records=records,
    )


def _records(
    problem: SeveralRecords,
    findings: Findings,
    parameters: Mapping[str, Estimate],
    names: Sequence[str],
    *,
    progress: Progress,
) -> tuple[RecordAnswer, ...]:
    """Return the joint answer on every record."""
    base, chosen = findings.field.plain, findings.decision.chosen
    unseen = [_without(problem, one, progress=progress) for one in (base, chosen)]
    found = []
    for k, (part, name) in enumerate(zip(problem.parts, names, strict=True)):
        plain, best = single(base, k), single(chosen, k)
        plain_held_out, held_out = (_own_held_out(problem, one.held_out, k) for one in (base, chosen))
        before, after = errors_of(part, plain, plain_held_out), errors_of(part, best, held_out)
        own = {p.name: parameters[problem.joint_name(k, p.name)] for p in best.fit.parameters if p.name in problem.own}
        floor = noise_floor(part, best, Stretches.of(part))
        curves = curve_columns(part, plain.fit, model_of(part, best), [label for label, _ in plain_held_out.folds])
        found.append(
            RecordAnswer(
                file=name,
                before=before,
                after=after,
                unseen_before_deg=_unseen(problem, plain, k, unseen[0]),
                unseen_after_deg=_unseen(problem, best, k, unseen[1]),
                noise_floor_deg=min(floor, before.rmse_train_deg, after.rmse_train_deg),
                parameters=own,
                curves=curves,
            )
        )
    return tuple(found)


def _without(problem: SeveralRecords, one: Explanation, *, progress: Progress) -> dict[int, Mapping[str, float]]:
    """Return the values that are fitted without each record."""
    return dict(held_out_by_refit(one.fitter, one.fit, block=problem.record, progress=progress).folds)


def _unseen(problem: SeveralRecords, view: Explanation, record: int, folds: Mapping[int, Mapping[str, float]]) -> float:
    """Return the error on a record, over all of its rows, with values that were fitted without it."""
    part = cast("ActuatorProblem", view.fitter.problem)
    predicted = part.simulate(problem.values_of(record, folds[record]), view.fit.effects).angle_rad
    return rms((part.drive.angle_rad - predicted)[part.drive.measured] / DEG)


def _rows(problem: SeveralRecords) -> Floats:
    """Return the number of measured rows of each record (records,)."""
    return np.array([float(np.sum(p.drive.measured)) for p in problem.parts])


def _mean_square(problem: SeveralRecords, each: Sequence[float]) -> float:
    """Return the root mean square over all rows from those of the records."""
    return float(np.sqrt(np.average(np.square(each), weights=_rows(problem))))


def _pooled(problem: SeveralRecords, each: Sequence[Errors]) -> Errors:
    """Return the errors over all rows from those of the records; variances are about each record's own mean."""
    rows = _rows(problem)
    held_out = _mean_square(problem, [one.rmse_held_out_deg for one in each])
    # 1 − R² of each is its sum of squares over its total: totals follow from both.
    square = rows * np.array([one.rmse_held_out_deg for one in each]) ** 2
    left = np.array([1.0 - one.r2_held_out for one in each])
    total = np.divide(square, left, out=np.zeros_like(square), where=left > 0.0)
    r2 = 1.0 - float(square.sum()) / float(total.sum()) if total.sum() > 0.0 and not isnan(held_out) else float("nan")
    halves = tuple(error for one in each for error in one.by_half_cycle_deg)
    return Errors(_mean_square(problem, [one.rmse_train_deg for one in each]), held_out, r2, halves)


def _next(problem: SeveralRecords, findings: Findings, *, progress: Progress) -> NextExperiment | None:
    """Return the experiment that would distinguish the rivals, planned for the rig as in the last record."""
    decision, last = findings.decision, len(problem.parts) - 1
    if findings.verdict != "ambiguous":
        return None
    part = problem.parts[last]
    views = [single(one, last) for one in (decision.chosen, *decision.rivals)]
    field = Field(views[0].likelihood, Stretches.of(part), {(): single(findings.field.base, last)})
    return next_experiment(part, field, views, needed_gain=NEEDED_GAIN, progress=progress)


__all__ = ["JointReport", "RecordAnswer", "discover_together", "single"]
