"""The actuator's discovery: from a merged record and its characterised values to a report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import isnan
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from torsight.actuator.doubt import Alternative, Doubt, principal_axes
from torsight.actuator.effects import load_effects, load_nameless
from torsight.actuator.fit import require_motion
from torsight.actuator.fitted import FittedModel, fitted_model
from torsight.actuator.model import ActuatorModel
from torsight.actuator.spec import ActuatorSpec
from torsight.core.parameter import Estimate
from torsight.core.progress import Progress, silent
from torsight.core.records import SyncedTable
from torsight.core.threads import one_thread
from torsight.core.units import DEG
from torsight.discovery.actuator_problem import ActuatorProblem
from torsight.discovery.closure import actuator_closure
from torsight.discovery.common import mean_square
from torsight.discovery.contenders import Contender
from torsight.discovery.curves import curve_columns, extended_angle
from torsight.discovery.engine import Findings, find_missing
from torsight.discovery.fitting import less
from torsight.discovery.interface import Closure
from torsight.discovery.intervals import covariance, joint_covariance
from torsight.discovery.next_experiment import NextExperiment, next_experiment
from torsight.discovery.noise import reading_noise
from torsight.discovery.report import DiscoveryReport, Errors, FoundEffect, Pull, estimates_of
from torsight.discovery.settings import Settings
from torsight.discovery.validate import HeldOut

Array = NDArray[np.float64]

CONTRADICTED_SIGMAS: Final = 4.0
"""A characterised value that the record moves by more than this is named."""
_DRAWS: Final = 2000


@one_thread()
def discover(
    table: SyncedTable,
    spec: ActuatorSpec,
    *,
    seed: int = 0,
    clock_sigma_s: float | None = None,
    progress: Progress = silent,
    where: str = "record",
) -> DiscoveryReport:
    """Find what the quasi-static model lacks on one record.

    Parameters
    ----------
    table : SyncedTable
        Angle and temperatures on one clock.
    spec : ActuatorSpec
        Characterised values with their uncertainties.
    seed : int
        Of every random draw: the same table, spec and seed give the same report.
    clock_sigma_s : float or None
        Standard deviation of the offset between the two clocks where an event that both saw has told it; None where
        nothing but motion and temperature has.
    progress : Progress
        Told how far the work is.
    where : str
        Name of the record in messages.

    Raises
    ------
    InputError, NoResultError
        When the record cannot drive the model.
    """
    drive = ActuatorModel(spec).prepare(table, where=where)
    require_motion(drive, where=where)
    problem = ActuatorProblem(drive, spec, seed=seed, clock_sigma_s=clock_sigma_s)
    findings = find_missing(problem, seed=seed, progress=progress)
    return _report(problem, findings, seed=seed, progress=progress)


def _report(problem: ActuatorProblem, findings: Findings, *, seed: int, progress: Progress) -> DiscoveryReport:
    field, decision = findings.field, findings.decision
    base, chosen = field.base, decision.chosen
    spread = covariance(field, chosen)
    plain_spread = covariance(field, base)
    parameters = estimates_of(chosen.fit.parameters, chosen.fit.solution.x, np.sqrt(np.diag(spread)))
    plain = estimates_of(base.fit.parameters, base.fit.solution.x, np.sqrt(np.diag(plain_spread)))
    fixed = _fixed(problem)
    before, after = _errors(problem, base, findings.before), _errors(problem, chosen, findings.after)
    model = _model(problem, chosen)
    if findings.closure is not None:
        values, learned = actuator_closure(problem, chosen.fit, findings.closure, field.fitter.weight)
        model = replace(model, values=values, closure=learned)
        after = _learned_errors(problem, model, findings.closure)
    account = {"found_by": "discovery", **after.to_json()}
    model = replace(model, account=account, doubt=_doubt(problem, findings, after))
    pulls, plain_pulls = _pulls(problem, chosen), _pulls(problem, base)
    blocks = () if findings.before is None else tuple(label for label, _ in findings.before.folds)
    return DiscoveryReport(
        verdict=findings.verdict,
        effects=_effects(findings, spread, parameters, seed=seed),
        alternatives=tuple(rival.effects for rival in decision.rivals),
        drivers=findings.drivers,
        before=before,
        after=after,
        held_out=blocks,
        noise_floor_deg=min(_floor(problem, findings), before.rmse_train_deg, after.rmse_train_deg),
        parameters=parameters | fixed,
        plain_parameters=plain | fixed,
        pulls=pulls,
        plain_pulls=plain_pulls,
        next_experiment=_next(problem, findings, progress=progress),
        notes=_notes(findings, *(_characterised(problem, listed) for listed in (pulls, plain_pulls))),
        evidence=_evidence(findings),
        curves=curve_columns(problem, base.fit, model, blocks),
        model=model,
        covariance=spread,
    )


def _next(problem: ActuatorProblem, findings: Findings, *, progress: Progress) -> NextExperiment | None:
    """Return the experiment that would tell rivals apart; None where the answer is not ambiguous."""
    decision = findings.decision
    if findings.verdict != "ambiguous":
        return None
    rivals = (decision.chosen, *decision.rivals)
    needed = Settings().rival_gain
    return next_experiment(problem, findings.field, rivals, needed_gain=needed, progress=progress)


def _model(problem: ActuatorProblem, chosen: Contender) -> FittedModel:
    """Return the extended model with what the record leaves behind."""
    return fitted_model(problem.model(chosen.effects), chosen.fit.values, problem.drive)


def _doubt(problem: ActuatorProblem, findings: Findings, after: Errors) -> Doubt:
    """Return how far the extended model may be wrong: its values, what it leaves, and what else it could be."""
    chosen, rivals = findings.decision.chosen, findings.decision.rivals
    others = (fitted_model(problem.model(rival.effects), rival.fit.values, problem.drive) for rival in rivals)
    return Doubt(
        names=tuple(p.name for p in chosen.fit.parameters),
        covariance=joint_covariance(findings.field, chosen),
        residual_deg=after.rmse_train_deg if isnan(after.rmse_held_out_deg) else after.rmse_held_out_deg,
        alternatives=tuple(Alternative(tuple(other.model.effects), other.values) for other in others),
    )


def _learned_errors(problem: ActuatorProblem, model: FittedModel, closure: Closure) -> Errors:
    """Return the errors with a learned stand-in; each block's from the others, over the time that rows stand for."""
    drive = problem.drive
    good = np.isfinite(drive.angle_rad) & drive.known
    fitted, _ = extended_angle(model, drive)
    train = float(np.sqrt(np.mean((drive.angle_rad - fitted)[good] ** 2))) / DEG
    valid, square = problem.valid, mean_square(problem, closure.residual)
    total = float(np.var(drive.angle_rad[good] / DEG))
    each = _by_half_cycle(closure.residual[valid], problem.block[valid], np.unique(problem.block[valid]).tolist())
    return Errors(train, float(np.sqrt(square)), 1.0 - square / total, each)


def _fixed(problem: ActuatorProblem) -> dict[str, Estimate]:
    return {
        p.name: Estimate(value=p.value, sigma=0.0, ci95=(p.value, p.value), unit=p.unit, fixed=True)
        for p in problem.model().all_parameters
        if p.fixed
    }


def _floor(problem: ActuatorProblem, findings: Findings) -> float:
    """Return the root mean square that the inputs account for: reading noise, and noise left in the temperatures.

    A film's uncertainties are meant to be large enough; what a fit leaves may be less.
    """
    drive, fit = problem.drive, findings.decision.chosen.fit
    measured = np.isfinite(drive.angle_rad)
    given = drive.angle_sigma_rad[measured] / DEG
    reading = float(np.sqrt(np.mean(given[np.isfinite(given)] ** 2))) if np.isfinite(given).any() else 0.0
    if reading == 0.0:
        residual = np.where(problem.valid, problem.observed - fit.solution.prediction, 0.0)
        reading = reading_noise(problem, findings.field.stretches, residual)
    noise = problem.smooth_noise(fit.values, fit.effects)
    over_time = np.interp(drive.time_s, problem.time_s, noise)
    return float(np.hypot(reading, np.sqrt(np.mean(over_time**2))))


def _errors(problem: ActuatorProblem, contender: Contender, held_out: HeldOut | None) -> Errors:
    """Return the errors over every row of the record, blocks predicted from the others for the held-out ones."""
    drive, effects = problem.drive, contender.effects
    observed = drive.angle_rad / DEG
    good = np.isfinite(observed) & drive.known
    fitted = problem.simulate(contender.fit.values, effects).angle_rad / DEG
    train = float(np.sqrt(np.mean((observed - fitted)[good] ** 2)))
    if held_out is None:
        return Errors(train, float("nan"), float("nan"))
    predicted = np.empty(len(drive))
    for label, values in held_out.folds:
        rows = drive.cycles.half == label
        predicted[rows] = problem.simulate(values, effects).angle_rad[rows] / DEG
    error = (observed - predicted)[good]
    total = observed[good] - observed[good].mean()
    each = _by_half_cycle(error, drive.cycles.half[good], [label for label, _ in held_out.folds])
    return Errors(train, float(np.sqrt(np.mean(error**2))), 1.0 - float(error @ error) / float(total @ total), each)


def _by_half_cycle(error: Array, half: NDArray[np.int64], labels: Sequence[int]) -> tuple[float, ...]:
    """Return the root mean square of the errors in each half-cycle."""
    found = [error[half == label] for label in labels]
    return tuple(float(np.sqrt(np.mean(each**2))) if len(each) else float("nan") for each in found)


def _pulls(problem: ActuatorProblem, contender: Contender) -> tuple[Pull, ...]:
    values = contender.fit.values
    return tuple(Pull(p.name, p.value, values[p.name], p.sigma) for p in problem.parameters if p.sigma is not None)


def _characterised(problem: ActuatorProblem, pulls: tuple[Pull, ...]) -> tuple[Pull, ...]:
    """Return the pulls of values that stand in the actuator file."""
    return tuple(pull for pull in pulls if pull.name in problem.spec.values)


def _effects(
    findings: Findings, spread: Array, parameters: Mapping[str, Estimate], *, seed: int
) -> tuple[FoundEffect, ...]:
    decision, field = findings.decision, findings.field
    chosen = decision.chosen
    names = [p.name for p in chosen.fit.parameters]
    rng = np.random.default_rng(seed)
    draws = _drawn(chosen.fit.solution.x, spread, rng)
    found = []
    for name in chosen.effects if chosen.named else ():
        effect = load_effects()[name]
        own = {p.name: parameters[p.name] for p in effect.parameters}
        columns = {p.name: draws[:, names.index(p.name)] for p in effect.parameters}
        for item in effect.derived:
            value = item.value(chosen.fit.values)
            drawn = np.array([item.value({key: float(c[i]) for key, c in columns.items()}) for i in range(_DRAWS)])
            own[item.name] = _derived(value, drawn, item.unit, item.period)
        without = field.contenders.get(less(chosen.effects, name))
        found.append(
            FoundEffect(
                id=name,
                family=effect.family,
                title=effect.title,
                parameters=own,
                probability=sum(weight for held, weight in decision.probability.items() if name in held),
                gain=float("nan") if without is None else without.cost - chosen.cost,
            )
        )
    return tuple(sorted(found, key=lambda item: -item.gain))


def _drawn(mean: Array, spread: Array, rng: np.random.Generator) -> Array:
    """Return draws (k, m) of a normal distribution."""
    size, share, directions = principal_axes(spread)
    unit = rng.standard_normal((_DRAWS, len(mean)))
    return np.asarray(mean + (unit * np.sqrt(np.maximum(share, 0.0))) @ directions.T * size)


def _derived(value: float, drawn: Array, unit: str, period: float | None) -> Estimate:
    off = drawn - value
    if period is not None:
        off = (off + 0.5 * period) % period - 0.5 * period
    low, high = np.quantile(off, [0.025, 0.975])
    return Estimate(value, float(np.std(off)), (value + float(min(low, 0.0)), value + float(max(high, 0.0))), unit)


def _evidence(findings: Findings) -> dict[str, Any]:
    field, decision = findings.field, findings.decision
    return {
        "threshold": decision.threshold,
        "share_explained": decision.share_explained,
        "over_floor_before": decision.excess,
        "over_floor_after": decision.left,
        "best_set": list(decision.best.effects),
        "gains": {contender.effects[0]: field.base.cost - contender.cost for contender in field.of_size(1)},
    }


def _notes(findings: Findings, pulls: tuple[Pull, ...], plain_pulls: tuple[Pull, ...]) -> tuple[str, ...]:
    notes = []
    if findings.before is None:
        notes.append(
            "The record holds one half-cycle only: nothing could be held out, so the answer rests on the gain alone; "
            "record at least two half-cycles, better two rates and an incomplete heating"
        )
    far = [pull for pull in pulls if abs(pull.sigmas) > CONTRADICTED_SIGMAS]
    if far:
        listed = ", ".join(f"{p.name} {p.nominal:g} → {p.value:.4g} ({p.sigmas:+.1f} σ)" for p in far)
        notes.append(f"The record contradicts characterised values: {listed}; check the actuator file")
    chosen = findings.decision.chosen
    if not chosen.named:
        titles = ", ".join(load_nameless()[name].title for name in chosen.effects)
        notes.append(f"What is missing is none of the library's effects; it acts like {titles}, which stands in for it")
    if chosen.effects:
        pulled = [pull for pull in plain_pulls if abs(pull.sigmas) > CONTRADICTED_SIGMAS]
        if pulled:
            listed = ", ".join(f"{p.name} by {p.sigmas:+.1f} σ" for p in pulled)
            notes.append(f"Without the effect the fit had pulled {listed}")
    return tuple(notes)
