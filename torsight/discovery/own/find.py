"""From a problem to findings: checks, starts, the engine's search, and warnings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from torsight.core.parallel.threads import one_thread
from torsight.core.progress import Progress, silent
from torsight.core.series import rms, scatter
from torsight.core.units import Floats
from torsight.discovery.inference import engine
from torsight.discovery.inference.explanation import Explanation
from torsight.discovery.inference.fitting import Fit
from torsight.discovery.inference.search import Search
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

_MOST_TRACES: Final = 20
"""Failures of which the traceback is kept."""
_MISJUDGED: Final = 1.5
"""Ratio of the noise that is found to the one that was given, either way, that is reported: with it an interval of 95 %
holds 81 %, or 99.7 %."""
_ROWS: Final = 64
"""Rows from which that ratio is known to a tenth, one over the root of twice their number."""


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
        Record and model: of ``model_problem``, ``linear_problem``, or a class of one's own.
    settings : Settings, optional
        How to decide.
    seed : int
        Kept with the answer; nothing here is drawn.
    processes : bool, optional
        Call a model of ``model_problem`` in processes, or in none. Without it, where that pays, it is compiled if numba
        can do that, else called in processes.
    progress : Progress
        Told how far the work is.

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
        here = processes is None and is_compiled(asked.model.predict)
        with problem.evaluator.processes(wanted=False if here else processes):
            try:
                made = _search(asked, settings=settings, seed=seed, progress=loud, notes=notes)
            except np.linalg.LinAlgError as error:
                # A model that gives nothing from some call on leaves nothing to solve for: its own error is the cause.
                if not problem.evaluator.failures:
                    raise
                raise problem.evaluator.failures[-1].error("predict") from error
        printed = stream.note(elsewhere=problem.evaluator.printed)
        return replace(made, warnings=_added(list(made.warnings), printed))


@dataclass(frozen=True, slots=True, eq=False)
class KnownFit:
    """The fit of a set of effects, and whether one more from its optimum gains nothing that matters."""

    explanation: Explanation
    settled: bool


def fit_known(problem: Problem, members: Sequence[str], *, progress: Progress) -> KnownFit:
    """Fit a model with effects, by their ids, that are known to belong to it: a discovery without a choice.

    The plain model comes first, then one effect after the other, each time with all that came before.
    """
    check_problem(problem)
    search, steps = Search(problem, settings=Settings(), progress=progress), 1 + len(members)
    progress("fit", 0, steps)
    found = search.plain()
    for number, name in enumerate(members, 1):
        progress("fit", number, steps)
        found = _proposed_at_means(search, search.with_effect(found, name), name)
    progress("fit", steps, steps)
    return KnownFit(found, search.has_settled(found))


def _proposed_at_means(search: Search, found: Explanation, name: str) -> Explanation:
    """Return a fit, or a better one from where an effect is seen in what the priors' means leave.

    The plain fit may have made up for an event in the record, so that its residual shows it at another time.
    """
    fitter, effects = found.fitter, found.fit.effects
    candidate, means = fitter.candidates[name], fitter.nominal
    if candidate.propose is None:
        return found
    points = candidate.starting_points(fitter.problem.time_s, fitter.residual(means))
    scouted = fitter.fit(effects, [{**found.fit.values, **means.values, **point} for point in points])
    return max(found, search.fit_from(scouted.values, effects), key=lambda one: one.log_posterior)


def _added(notes: list[str], one: str | None) -> tuple[str, ...]:
    return tuple(notes if one is None else [*notes, one])


def _search(
    problem: ModelProblem, *, settings: Settings | None, seed: int, progress: Progress, notes: list[str]
) -> Findings:
    declared, evaluator = problem, problem.evaluator
    progress("starts", 0, None)
    prepared = prepare(problem)
    problem, notes = prepared.problem, [*notes, *prepared.warnings]
    # Points that were only looked at may lie outside of what the model can do.
    looked, before = len(evaluator.failures), evaluator.failed
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
    # What the findings show of other sets is predicted while the processes are there.
    _ = findings.best_fits, findings.parameters, findings.laws
    failures, failed = evaluator.failures[looked:], evaluator.failed - before
    if failures:
        notes.append(
            f"in {failed} of {evaluator.calls} calls the model gave no numbers, and the search kept away from there; "
            f"first: {failures[0].sentence()}"
        )
    # A model may keep something from call to call that shows only after many of them.
    check_same(problem, start, begun)
    traces = tuple(f"{one.sentence()}\n{one.trace}" for one in failures[:_MOST_TRACES])
    return replace(findings, warnings=tuple(notes), failures=traces, failed=failed, calls=evaluator.calls)


def _at_answer(problem: ModelProblem, found: engine.Findings) -> tuple[list[Called], dict[str, Curve]]:
    """Return the calls of the answer, and its declared laws as the model called them."""
    chosen = found.decision.chosen
    extended, values = problem.with_laws([one.form for one in chosen.laws]), chosen.fit.values
    curves = extended.curves(values, chosen.members)
    return problem.evaluator(extended.given(values, chosen.members), curves), curves


def _noise_given(problem: ModelProblem, found: engine.Findings) -> list[str]:
    """Return a warning for every output whose given noise is not that of its readings.

    What neighbouring rows of the residual differ by is noise, whatever else is missing; and noise is part of what is
    left, whatever else is.
    """
    if not problem.sigma_known:
        return []
    left = np.full(len(problem.observed), np.nan)
    left[problem.valid] = (found.decision.chosen.residual / np.where(problem.valid, problem.sigma, 1.0))[problem.valid]
    notes = []
    for k, output in enumerate(problem.model.outputs):
        pieces = [left[place][np.isfinite(left[place])] for _, own, place in problem.layout.places if own == k]
        rows = np.concatenate(pieces)
        if len(rows) < _ROWS:
            continue
        between, whole = scatter(*pieces), rms(rows)
        if between > _MISJUDGED:
            notes.append(
                f"neighbouring rows of what is left of '{output}' scatter by {between:.2g} times the sigma that was "
                "given: it is too small, or something fast is missing; without sigma it is measured"
            )
        elif whole < 1.0 / _MISJUDGED:
            notes.append(
                f"what is left of '{output}' is {whole:.2g} times the sigma that was given: it is too large, and hides "
                "what is smaller; without sigma it is measured"
            )
    return notes


def _held_is_better(problem: ModelProblem, found: engine.Findings, price: float) -> list[str]:
    """Return a note for every input of an ``ode`` that stands and jumps, and explains the record better when held.

    Better by more than a member of an answer has to gain (``price``), in log evidence.
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
                f"'{name}' stands still and jumps between rows, where the model draws lines; with values that hold "
                f"until the next row {(held.cost / lines.cost) ** 0.5:.2g} times as much is left: if it is a command "
                f"or a switch, say ode(…, inputs={{'{name}': 'held'}})"
            )
    return notes


def _stands_and_jumps(column: Floats) -> bool:
    """Return whether a column has a jump from one row to the next with the same value twice on either side."""
    change = np.diff(column) != 0.0
    return bool(np.any(~change[:-2] & change[1:-1] & ~change[2:]))


def _at_bounds(found: engine.Findings) -> list[str]:
    """Return a warning for every value of a named effect that ends at one of its bounds."""
    chosen = found.decision.chosen
    named = [p for effect in chosen.effects for p in chosen.fitter.candidates[effect].parameters]
    return [
        f"'{p.name}' ends at its bound {chosen.fit.values[p.name]:.4g}: where that is no limit of the rig itself, "
        "widen it; where it is far from what the rig can have, the form is another one"
        for p in named
        if chosen.fit.values[p.name] in (p.lower, p.upper)
    ]


def _missed(declared: ModelProblem, found: engine.Findings) -> list[str]:
    """Return a warning for every named effect whose fit from its declared start alone ends far above the answer."""
    chosen, base = found.decision.chosen, found.field.base
    at = chosen.fit.solution
    # The weights have been taken anew since it was fitted.
    cost = chosen.fitter.known(chosen.fit.effects, at.x, at.prediction, at.jacobian).cost
    notes = []
    for name in chosen.effects:
        candidate = next(one for one in declared.candidates if one.id == name)
        if len(chosen.fitter.candidates[name].starts) == len(candidate.starts):
            continue
        own = {p.name: p.value for p in candidate.parameters}
        # Beside other effects all else is where it belongs: what is asked is whether this one finds its place.
        around = chosen.fit.values if len(chosen.members) > 1 else base.fit.values
        alone: Fit = chosen.fitter.fit(chosen.fit.effects, [{**around, **own}], keep=1)
        if cost < MUCH_BETTER * alone.cost:
            given = ", ".join(f"{key} {value:.4g}" for key, value in own.items())
            ended = ", ".join(f"{key} {alone.values[key]:.4g}" for key in own)
            ends = "does not leave it" if given == ended else f"ends elsewhere ({ended})"
            notes.append(
                f"the fit of '{name}' from its declared start ({given}) {ends} and leaves "
                f"{(alone.cost / cost) ** 0.5:.3g} times more: another start was needed, so look whether "
                "the fitted values make sense"
            )
    return notes
