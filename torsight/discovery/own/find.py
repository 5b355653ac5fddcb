"""From a problem to findings: checks, starts, the engine's search, and warnings."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from torsight.core.parallel.threads import one_thread
from torsight.core.parameter import REACH
from torsight.core.progress import Progress, silent
from torsight.core.series import FEWEST, rms, scatter
from torsight.core.units import Floats
from torsight.discovery.inference import engine
from torsight.discovery.inference.explanation import Explanation
from torsight.discovery.inference.fitting import Fit
from torsight.discovery.inference.set_fits import SetFits
from torsight.discovery.interface import Problem
from torsight.discovery.own.answer.findings import Findings
from torsight.discovery.own.answer.laws import bend_within, beyond, widened
from torsight.discovery.own.compiled.quicken import is_compiled, quickened
from torsight.discovery.own.model import given
from torsight.discovery.own.model.check import check_problem, check_same
from torsight.discovery.own.model.evaluate import Called, Evaluator
from torsight.discovery.own.model.ode import Ode
from torsight.discovery.own.model.problem import ModelProblem
from torsight.discovery.own.model.quiet import aloud, heard
from torsight.discovery.own.model.values import Curve
from torsight.discovery.own.prepare import MUCH_BETTER, prepare
from torsight.discovery.settings import Settings

_MISJUDGED: Final = 1.5
"""Ratio of estimated to given noise, or its inverse, from which a warning is given: with it an interval of 95 % holds
81 %, or 99.7 %."""


def find_missing(
    problem: Problem,
    *,
    settings: Settings | None = None,
    seed: int = 0,
    processes: bool | None = None,
    progress: Progress = silent,
) -> Findings:
    """Find what a model lacks.

    Parameters
    ----------
    problem : Problem
        Record and model: made by ``model_problem`` or ``linear_problem``, or an object of a class of your own.
    settings : Settings, optional
        Probabilities and budgets of the decision.
    seed : int
        Not used: the search draws no random numbers.
    processes : bool, optional
        Whether a model of ``model_problem`` is called in processes of its own. By default a slow model is compiled if
        numba can do that, else called in processes.
    progress : Progress
        Called with the name of each step and how much of the step is done.

    Raises
    ------
    InputError
        When the problem cannot be searched: a missing member, a wrong shape, a model that fails; before any fit.
    """
    loud = aloud(progress)
    given.function(progress, "find_missing, progress")
    if settings is not None:
        given.one_of(settings, Settings, "find_missing, settings", do="give settings=Settings(…)")
    if processes is not None:
        given.one_of(processes, bool, "find_missing, processes", do="give True, False or None")
    with heard() as stream, one_thread():
        if not isinstance(problem, ModelProblem):
            notes = list(check_problem(problem))
            found = engine.find_missing(problem, settings=settings, seed=seed, progress=loud)
            return Findings(problem, found, _added(notes, stream.note()), settings=settings or Settings())
        asked = quickened(problem) if processes is None else problem
        notes = list(check_problem(asked))
        in_threads = processes is None and is_compiled(asked.model.predict)
        with problem.evaluator.processes(wanted=False if in_threads else processes):
            try:
                findings = _search(asked, settings=settings, seed=seed, progress=loud, notes=notes)
            except np.linalg.LinAlgError as error:
                # A model that fails from some call on makes the equations singular: the model's own error is the cause.
                if not problem.evaluator.failures:
                    raise
                raise problem.evaluator.failures[-1].error("predict") from error
        printed = stream.note(elsewhere=problem.evaluator.printed)
        return replace(findings, warnings=_added(list(findings.warnings), printed))


def fit_known(problem: Problem, members: Sequence[str], *, progress: Progress) -> tuple[Explanation, bool]:
    """Fit a model with effects that are known to act, given by their ids: a discovery without a choice.

    The plain model is fitted first; then the effects are added one by one, each beside all earlier ones. The second
    result says whether a further fit from the optimum would gain nothing that matters.
    """
    check_problem(problem)
    fits, steps = SetFits(problem, progress=progress), 1 + len(members)
    progress("fit", 0, steps)
    found = fits.plain()
    for number, name in enumerate(members, 1):
        progress("fit", number, steps)
        found = fits.with_effect(found, name)
    progress("fit", steps, steps)
    return found, fits.has_settled(found)


def _added(notes: list[str], one: str | None) -> tuple[str, ...]:
    return tuple(notes if one is None else [*notes, one])


def _search(
    problem: ModelProblem, *, settings: Settings | None, seed: int, progress: Progress, notes: list[str]
) -> Findings:
    declared, evaluator = problem, problem.evaluator
    progress("starts", 0, None)
    problem, warnings = prepare(problem)
    notes = [*notes, *warnings]
    # Only failures from here on count: the points tried in the preparation may lie where the model cannot work.
    looked = len(evaluator.failures)
    start = {p.name: p.value for p in problem.parameters}
    begun = problem.outputs(start, ())
    found = engine.find_missing(problem, settings=settings, seed=seed, progress=progress)
    called, curves = _at_answer(problem, found)
    wider = widened(problem, called, curves)
    if wider is not problem:
        problem = wider
        found = engine.find_missing(problem, settings=settings, seed=seed, progress=progress)
        called, curves = _at_answer(problem, found)
    findings = Findings(problem, found, settings=settings or Settings())
    notes += [*_missed(declared, found), *_at_bounds(found), *_noise_given(problem, found), *beyond(called, curves)]
    notes += _held_is_better(problem, found, findings.price)
    notes += bend_within(problem, found.decision.chosen, findings.price)
    # Computed while the processes exist: the findings show held-out predictions of other sets, too.
    _ = findings.best_fits, findings.parameters, findings.laws
    failures = evaluator.failures[looked:]
    if failures:
        notes.append(
            f"in {len(failures)} of {evaluator.calls} calls the model gave no numbers, and the search kept away from "
            f"there; first: {failures[0].sentence()}"
        )
    # A model may keep a state between calls that changes its results only after many of them.
    check_same(problem, start, begun)
    traces = tuple(f"{one.sentence()}\n{one.trace}" for one in failures[:20])
    return replace(findings, warnings=tuple(notes), failures=traces, failed=len(failures), calls=evaluator.calls)


def _at_answer(problem: ModelProblem, found: engine.Findings) -> tuple[list[Called], dict[str, Curve]]:
    """Return the model's calls with the values of the answer, and the declared laws with which it was called."""
    chosen = found.decision.chosen
    extended, values = problem.with_laws([one.form for one in chosen.laws]), chosen.fit.values
    curves = extended.curves(values, chosen.members)
    return problem.evaluator(extended.given(values, chosen.members), curves), curves


def _noise_given(problem: ModelProblem, found: engine.Findings) -> list[str]:
    """Return a warning for every output whose given noise differs from that of its readings.

    The scatter of neighbouring rows of the residual is noise even where a slow effect is missing: if it is larger than
    given, sigma is too small. The whole residual contains the noise: if it is smaller than given, sigma is too large.
    """
    if not problem.sigma_known:
        return []
    left = np.full(len(problem.observed), np.nan)
    left[problem.valid] = (found.decision.chosen.residual / np.where(problem.valid, problem.sigma, 1.0))[problem.valid]
    notes = []
    for k, output in enumerate(problem.model.outputs):
        pieces = [left[place][np.isfinite(left[place])] for _, own, place in problem.layout.places if own == k]
        rows = np.concatenate(pieces)
        if len(rows) < FEWEST:
            continue
        between, whole = scatter(*pieces), rms(rows)
        # The relative standard deviation of a standard deviation of n values is 1/√(2n).
        by_chance = REACH / math.sqrt(2.0 * len(rows))
        if between > _MISJUDGED * (1.0 + by_chance):
            notes.append(
                f"neighbouring rows of the residual of '{output}' scatter by {between:.2g} times the sigma that was "
                "given: sigma is too small, or a fast effect is missing; without sigma the noise is measured"
            )
        elif whole < (1.0 - by_chance) / _MISJUDGED:
            notes.append(
                f"the residual of '{output}' is {whole:.2g} times the sigma that was given: sigma is too large, and "
                "hides effects that are smaller; without sigma the noise is measured"
            )
    return notes


def _held_is_better(problem: ModelProblem, found: engine.Findings, price: float) -> list[str]:
    """Return a note for every input of an ``ode`` that stands still and jumps, and explains the record better if held.

    The log evidence has to grow by more than ``price``, the gain that a member of an answer needs.
    """
    ode, base = problem.model.predict, found.field.base
    if not isinstance(ode, Ode):
        return []
    fit, notes = base.fit, []
    lines = base.fitter.known(fit.effects, fit.solution.x, fit.solution.prediction, fit.solution.jacobian)
    for name in ode.inputs:
        if name in ode.held or not any(_stands_and_jumps(record[name]) for record in problem.model.records):
            continue
        model = replace(problem.model, predict=ode.holding(name))
        prediction = replace(problem, model=model, evaluator=Evaluator(model)).predict(fit.values, fit.effects)
        held = base.fitter.known(fit.effects, fit.solution.x, prediction, fit.solution.jacobian)
        if lines.cost - held.cost > 2.0 * price:
            notes.append(
                f"'{name}' stands still and jumps between rows, where the model interpolates; with values that hold "
                f"until the next row the residual is {(held.cost / lines.cost) ** 0.5:.2g} times as large: if it is a "
                f"command or a switch, give ode(…, inputs={{'{name}': 'held'}})"
            )
    return notes


def _stands_and_jumps(column: Floats) -> bool:
    """Return whether a column has a jump from one row to the next with the same value twice on either side."""
    change = np.diff(column) != 0.0
    return bool(np.any(~change[:-2] & change[1:-1] & ~change[2:]))


def _at_bounds(found: engine.Findings) -> list[str]:
    """Return a warning for every value of the model or of a named effect that ends at one of its bounds."""
    chosen = found.decision.chosen
    named = [p for effect in chosen.effects for p in chosen.fitter.candidates[effect].parameters]
    return [
        f"'{p.name}' ends at its bound {chosen.fit.values[p.name]:.4g}: if the rig itself has no such limit, widen "
        "the bound; if the rig cannot have such a value, a unit is wrong, or something acts in another form"
        for p in (*chosen.fitter.problem.parameters, *named)
        if chosen.fit.values[p.name] in (p.lower, p.upper)
    ]


def _missed(declared: ModelProblem, found: engine.Findings) -> list[str]:
    """Return a warning for every named effect whose fit from its declared start alone is far worse than the answer."""
    chosen, base = found.decision.chosen, found.field.base
    at = chosen.fit.solution
    # The weights have changed since the answer was fitted.
    cost = chosen.fitter.known(chosen.fit.effects, at.x, at.prediction, at.jacobian).cost
    notes = []
    for name in chosen.effects:
        candidate = next(one for one in declared.candidates if one.id == name)
        if len(chosen.fitter.candidates[name].starts) == len(candidate.starts):
            continue
        own = {p.name: p.value for p in candidate.parameters}
        # Beside other effects all other values start at the answer: the question is whether this effect finds its own.
        around = chosen.fit.values if len(chosen.members) > 1 else base.fit.values
        alone: Fit = chosen.fitter.fit(chosen.fit.effects, [{**around, **own}], keep=1)
        if cost < MUCH_BETTER * alone.cost:
            begun = ", ".join(f"{key} {value:.4g}" for key, value in own.items())
            ended = ", ".join(f"{key} {alone.values[key]:.4g}" for key in own)
            ends = "does not leave it" if begun == ended else f"ends elsewhere ({ended})"
            notes.append(
                f"the fit of '{name}' from its declared start ({begun}) {ends}, with a residual "
                f"{(alone.cost / cost) ** 0.5:.3g} times as large: another start was needed, so check whether "
                "the fitted values make sense"
            )
    return notes
