"""The actuator's discovery: from a merged record and its characterised values to a report."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import hypot, sqrt
from typing import Any, Final, cast

import numpy as np

from torsight.actuator.doubt import Alternative, Doubt, principal_axes
from torsight.actuator.effects import Effect, load_effects
from torsight.actuator.fit_result import notes_of_drive, require_motion, taken_as_exact
from torsight.actuator.fitted import FittedModel, fitted_model
from torsight.actuator.model import ActuatorModel
from torsight.actuator.spec import ActuatorSpec
from torsight.core.parallel.threads import one_thread
from torsight.core.parameter import Estimate, Parameter
from torsight.core.progress import Progress, silent
from torsight.core.records import SyncedTable
from torsight.core.series import rms, share_explained
from torsight.core.units import DEG, Floats, Ints
from torsight.core.words.wording import CONTRADICTED_SIGMAS, contradicted, unexplained
from torsight.discovery.actuator.curves import curve_columns
from torsight.discovery.actuator.law_tables import Acting, measured_laws
from torsight.discovery.actuator_problem import ActuatorProblem
from torsight.discovery.design.next_experiment import NEEDED_GAIN, NextExperiment, next_experiment
from torsight.discovery.inference.engine import Findings, law_shares
from torsight.discovery.inference.explanation import Explanation, covariance, estimates, predictive_covariance
from torsight.discovery.inference.fitting import less
from torsight.discovery.inference.laplace import residual_of
from torsight.discovery.inference.likelihood import MOTION, REST
from torsight.discovery.inference.noise import Stretches, reading_noise
from torsight.discovery.inference.validate import HeldOut
from torsight.discovery.inference.verdict import Decision
from torsight.discovery.interface import Problem
from torsight.discovery.own.find import find_missing
from torsight.discovery.report import DiscoveryReport, Errors, FoundEffect, Pull

_DRAWS: Final = 2000
"""Number of draws of a value that follows from others: fifty of them lie beyond each end of its 95 % interval."""
_SETS_LISTED: Final = 12
"""Number of sets of effects whose probabilities are listed in ``discovery.json``, the likeliest first: a choice."""


@one_thread()
def discover(
    table: SyncedTable,
    spec: ActuatorSpec,
    *,
    seed: int = 0,
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
        Seed of every random draw: the same table, spec and seed give the same report.
    progress : Progress
        Called with the name of each step and how much of the step is done.
    where : str
        Name of the record in messages.

    Raises
    ------
    InputError, NoResultError
        When the record cannot drive the model.
    """
    model = ActuatorModel(spec)
    drive = model.prepare(table, where=where)
    require_motion(model, drive, where=where)
    problem = ActuatorProblem(drive, spec, seed=seed)
    findings = find_missing(problem, seed=seed, progress=progress).found
    return _report(problem, findings, seed=seed, progress=progress)


def _report(problem: ActuatorProblem, findings: Findings, *, seed: int, progress: Progress) -> DiscoveryReport:
    base, chosen = findings.field.plain, findings.decision.chosen
    before, after = errors_of(problem, base, findings.before), errors_of(problem, chosen, findings.after)
    account = {"found_by": "discovery", **after.to_json()}
    others = [(model_of(problem, other), part) for other, part in findings.decision.shared]
    reading_deg = single_reading_deg(problem, chosen, findings.field.stretches)
    left = left_deg(findings, problem, chosen)
    doubt = doubt_of(chosen.fit.parameters, predictive_covariance(chosen), left, others, reading_deg=reading_deg)
    model = replace(model_of(problem, chosen), account=account, doubt=doubt)
    blocks = () if findings.before is None else tuple(label for label, _ in findings.before.folds)
    floor = noise_floor(problem, chosen, findings.field.stretches)
    laws = [Acting("", problem, item) for item in chosen.laws]
    return DiscoveryReport(
        **decided(problem, findings, records=[problem], laws=laws, seed=seed),
        before=before,
        after=after,
        held_out=blocks,
        noise_floor_deg=min(floor, before.rmse_train_deg, after.rmse_train_deg),
        next_experiment=_next(problem, findings, progress=progress),
        curves=curve_columns(problem, base.fit, model, blocks),
        model=model,
    )


def decided(
    problem: Problem,
    findings: Findings,
    *,
    records: Sequence[ActuatorProblem],
    laws: Sequence[Acting],
    seed: int,
    effect_of: Callable[[str], str] = str,
) -> dict[str, Any]:
    """Return the members of a report that follow from the decision, on one record or on several.

    The first of the ``records`` gives the rig's exact values; ``laws`` are the measured ones on the records on which
    they act; ``effect_of`` maps a candidate to its effect where that has another id.
    """
    record = records[0]
    field, decision = findings.field, findings.decision
    base, chosen = field.plain, decision.chosen
    fixed = fixed_values(record)
    pulls, plain_pulls = pulls_of(problem, chosen), pulls_of(problem, base)
    names = {law: effect_of(name) for law, (name, _) in decision.named.items()}
    return {
        "verdict": findings.verdict,
        "effects": found_effects(findings, seed=seed, effect_of=effect_of),
        "alternatives": tuple(tuple(effect_of(name) for name in rival.members) for rival in decision.rivals),
        "drivers": findings.drivers,
        "parameters": estimates(chosen) | fixed,
        "plain_parameters": estimates(base) | fixed,
        "pulls": pulls,
        "plain_pulls": plain_pulls,
        "notes": (
            *notes_of(findings, len(records), *(characterised(record.spec, one) for one in (pulls, plain_pulls))),
            *((taken_as_exact(record.spec.exact),) if chosen.members and record.spec.exact else ()),
            *dict.fromkeys(note for one in records for note in notes_of_drive(one.drive)),
        ),
        "evidence": evidence_of(findings),
        "covariance": covariance(chosen),
        "laws": measured_laws(laws, chosen, law_shares(field, chosen), names),
    }


def _next(problem: ActuatorProblem, findings: Findings, *, progress: Progress) -> NextExperiment | None:
    """Return the experiment that would distinguish the rivals; None where the answer is not ambiguous."""
    decision = findings.decision
    if findings.verdict != "ambiguous":
        return None
    rivals = (decision.chosen, *decision.rivals)
    return next_experiment(problem, findings.field, rivals, needed_gain=NEEDED_GAIN, progress=progress)


def _problem(explanation: Explanation) -> ActuatorProblem:
    """Return the problem with an explanation's laws among its candidates."""
    return cast("ActuatorProblem", explanation.fitter.problem)


def model_of(problem: ActuatorProblem, chosen: Explanation) -> FittedModel:
    """Return the extended model with the springs' state at the end of the record."""
    own = _problem(chosen)
    return fitted_model(own.model(chosen.fit.effects), chosen.fit.values, problem.drive, history=own.history)


def doubt_of(
    parameters: Sequence[Parameter],
    spread: Floats,
    left_deg: tuple[float, float],
    others: Sequence[tuple[FittedModel, float]],
    *,
    reading_deg: float,
) -> Doubt:
    """Return the uncertainty of the extended model: of its values, its residual, and other explanations.

    ``spread`` (m, m) is the free parameters' covariance, ``left_deg`` the residual in motion and at rest, root mean
    square; ``others`` are further explanations, each with its part of the probability; ``reading_deg`` is the noise of
    a single reading.
    """
    return Doubt(
        names=tuple(p.name for p in parameters),
        covariance=spread,
        residual_deg=left_deg[0],
        rest_residual_deg=left_deg[1],
        alternatives=tuple(
            Alternative(tuple(other.model.effects), other.values, other.model.laws, part) for other, part in others
        ),
        reading_deg=reading_deg,
    )


def left_deg(findings: Findings, problem: ActuatorProblem, own: Explanation) -> tuple[float, float]:
    """Return what a prediction lacks in motion and at rest, degrees: the discrepancy on held-out half-cycles.

    Laws of time hold for no later time: what they explain in the last record, ``problem``, with the chosen explanation
    as one of this record, ``own``, is added.

    The noise of readings and temperatures, and the uncertainty of the values in fits to the other half-cycles, are not
    part of the discrepancy: a prediction adds its own. Where no half-cycle was held out, it is the discrepancy of the
    fit, which is never less than the resolution.
    """
    of_time_deg = _of_time_deg(problem, own)
    chosen, held_out = findings.decision.chosen, findings.after
    if held_out is None:
        sizes = chosen.likelihood.discrepancy(chosen.residual)
    else:
        sizes = replace(chosen.held_out_likelihood, least=0.0).discrepancy(np.nan_to_num(held_out.residual))
    return hypot(float(sizes[MOTION]), of_time_deg), hypot(float(sizes[REST]), of_time_deg)


def _of_time_deg(problem: ActuatorProblem, chosen: Explanation) -> float:
    """Return the contribution of laws of time to the angle, root mean square over the record, degrees.

    Such laws hold for no later time: their contribution is missing in a prediction.
    """
    names = {name for item in chosen.laws if item.law.says_when for name in item.form.names}
    if not names:
        return 0.0
    own, effects, values = _problem(chosen), chosen.fit.effects, chosen.fit.values
    without = {name: 0.0 if name in names else value for name, value in values.items()}
    change = own.simulate(values, effects).angle_rad - own.simulate(without, effects).angle_rad
    return rms(change[problem.drive.known]) / DEG


def fixed_values(problem: ActuatorProblem) -> dict[str, Estimate]:
    """Return the values that are taken as exact."""
    return {
        p.name: Estimate(value=p.value, sigma=0.0, ci95=(p.value, p.value), unit=p.unit, fixed=True)
        for p in problem.model().all_parameters
        if p.fixed
    }


def noise_floor(problem: ActuatorProblem, chosen: Explanation, stretches: Stretches) -> float:
    """Return the root mean square due to the inputs, degrees: noise of the reading, and residual noise of temperatures.

    A film's uncertainties are meant to be large enough; the residual of a fit may be smaller.
    """
    noise = _problem(chosen).input_noise(chosen.fit.values, chosen.fit.effects)
    over_time = np.interp(problem.drive.time_s, problem.time_s, noise)
    return float(np.hypot(_row_noise_deg(problem, chosen, stretches), rms(over_time)))


def single_reading_deg(problem: ActuatorProblem, chosen: Explanation, stretches: Stretches) -> float:
    """Return the standard deviation of a single reading of the angle; rows of a drive are means of several."""
    return _row_noise_deg(problem, chosen, stretches) * sqrt(problem.drive.readings_of_a_row)


def _row_noise_deg(problem: ActuatorProblem, chosen: Explanation, stretches: Stretches) -> float:
    """Return the reading noise of a row, degrees: the given one, else one that is estimated from the record."""
    drive = problem.drive
    given = drive.angle_sigma_rad[np.isfinite(drive.angle_rad)] / DEG
    # A sigma of half a turn or more means that whole turns are uncertain: that is no noise of a reading.
    certain = given[given < 180.0]
    reading = rms(certain) if len(certain) else 0.0
    if reading == 0.0:
        residual = residual_of(problem, chosen.fit.solution.prediction)
        reading = reading_noise(problem, stretches, residual)
    return reading


def errors_of(problem: ActuatorProblem, explanation: Explanation, held_out: HeldOut | None) -> Errors:
    """Return the errors over every row of the record; for the held-out ones each block is predicted from the others."""
    drive, effects = problem.drive, explanation.fit.effects
    own = _problem(explanation)
    observed = drive.angle_rad / DEG
    good = drive.measured
    # In radians, as a fit computes it: both give the same number to the last digit.
    train = rms((drive.angle_rad - own.simulate(explanation.fit.values, effects).angle_rad)[good]) / DEG
    if held_out is None:
        return Errors(train, float("nan"), float("nan"))
    predicted = np.empty(len(drive))
    for label, values in held_out.folds:
        rows = drive.cycles.half == label
        predicted[rows] = own.simulate(values, effects).angle_rad[rows] / DEG
    error = (observed - predicted)[good]
    each = _by_half_cycle(error, drive.cycles.half[good], [label for label, _ in held_out.folds])
    return Errors(train, rms(error), share_explained(observed[good], predicted[good]), each)


def _by_half_cycle(error: Floats, half: Ints, labels: Sequence[int]) -> tuple[float, ...]:
    """Return the root mean square of the errors in each half-cycle."""
    found = [error[half == label] for label in labels]
    return tuple(rms(each) if len(each) else float("nan") for each in found)


def pulls_of(problem: Problem, explanation: Explanation) -> tuple[Pull, ...]:
    """Return the shifts by a fit of the values that are known beforehand."""
    values = explanation.fit.values
    return tuple(Pull(p.name, p.value, values[p.name], p.sigma) for p in problem.parameters if p.sigma is not None)


def contradiction(pulls: Sequence[Pull]) -> str:
    """Return a sentence that names the characterised values that a fit has pulled too far, empty if there are none."""
    return contradicted([pull.to_json() for pull in pulls])


def characterised(spec: ActuatorSpec, pulls: tuple[Pull, ...]) -> tuple[Pull, ...]:
    """Return the pulls of values that the actuator file gives."""
    return tuple(pull for pull in pulls if pull.name in spec.values)


def found_effects(findings: Findings, *, seed: int, effect_of: Callable[[str], str] = str) -> tuple[FoundEffect, ...]:
    """Return the named members of the chosen set; ``effect_of`` maps a candidate to an effect with another id."""
    decision, field = findings.decision, findings.field
    chosen = decision.chosen
    found = []
    for member, (name, where) in decision.named.items():
        effect = load_effects()[effect_of(name)]
        part = field.explanations.get(less(chosen.members, member))
        found.append(
            FoundEffect(
                id=effect.id,
                family=effect.family,
                title=effect.title,
                parameters=own_parameters(effect, where.fitter.candidates[name].parameters, where, seed=seed),
                probability=_probability(decision, {member, name}),
                gain=float("nan") if part is None else chosen.log_evidence - part.log_evidence,
            )
        )
    return tuple(sorted(found, key=lambda item: -item.gain))


def _probability(decision: Decision, members: set[str]) -> float:
    """Return the probability that one of these members is missing: that of all sets that contain one."""
    return min(1.0, sum(weight for held, weight in decision.probability.items() if members & set(held)))


def own_parameters(
    effect: Effect, parameters: Sequence[Parameter], where: Explanation, *, seed: int
) -> dict[str, Estimate]:
    """Return an effect's parameters from the set in which it was fitted, and the values derived from them."""
    spread, x, known = covariance(where), where.fit.solution.x, estimates(where)
    names = [p.name for p in where.fit.parameters]
    draws = _drawn(x, spread, np.random.default_rng(seed))
    own = {p.name: known[p.name] for p in parameters}
    columns = {p.name: draws[:, names.index(p.name)] for p in parameters}
    for item in effect.derived:
        value = item.value(where.fit.values)
        drawn = np.array([item.value({key: float(c[i]) for key, c in columns.items()}) for i in range(_DRAWS)])
        own[item.name] = _derived(value, drawn, item.unit, item.period)
    return own


def _drawn(mean: Floats, spread: Floats, rng: np.random.Generator) -> Floats:
    """Return draws (k, m) of a normal distribution."""
    size, share, directions = principal_axes(spread)
    unit = rng.standard_normal((_DRAWS, len(mean)))
    return np.asarray(mean + (unit * np.sqrt(np.maximum(share, 0.0))) @ directions.T * size)


def _derived(value: float, drawn: Floats, unit: str, period: float | None) -> Estimate:
    off = drawn - value
    if period is not None:
        off = (off + 0.5 * period) % period - 0.5 * period
    low, high = np.quantile(off, [0.025, 0.975])
    return Estimate(value, float(np.std(off)), (value + float(min(low, 0.0)), value + float(max(high, 0.0))), unit)


def evidence_of(findings: Findings) -> dict[str, Any]:
    """Return the basis of the answer: probabilities, residuals in noise floors, and the gain of every member alone."""
    field, decision = findings.field, findings.decision
    single = {one.members[0]: one for one in field.explanations.values() if len(one.members) == 1}
    ranked = sorted(decision.probability.items(), key=lambda item: (-item[1], item[0]))
    return {
        "probability_missing": decision.missing,
        "over_floor_before": decision.over_floor_before,
        "over_floor_after": decision.over_floor,
        "best_set": list(decision.chosen.members),
        "sets": [{"members": list(members), "probability": weight} for members, weight in ranked[:_SETS_LISTED]],
        "gains": {name: one.log_evidence - field.base.log_evidence for name, one in single.items()},
    }


def notes_of(
    findings: Findings, records: int, pulls: tuple[Pull, ...], plain_pulls: tuple[Pull, ...]
) -> tuple[str, ...]:
    """Return notes to the user, from the answer on a number of records and the pulls of characterised values."""
    notes = []
    if findings.before is None:
        notes.append(
            "The record holds one half-cycle only: nothing could be held out, so the answer rests on the evidence "
            "alone; record at least two half-cycles, better two rates and an incomplete heating"
        )
    if against := contradiction(pulls):
        notes.append(against)
    if doubt := unexplained(findings.decision.over_floor, records=records):
        notes.append(doubt)
    if findings.decision.chosen.members:
        pulled = [pull for pull in plain_pulls if abs(pull.sigmas) > CONTRADICTED_SIGMAS]
        if pulled:
            listed = ", ".join(f"{p.name} by {p.sigmas:+.1f} σ" for p in pulled)
            notes.append(f"Without the effect the fit had pulled {listed}")
    return tuple(notes)
