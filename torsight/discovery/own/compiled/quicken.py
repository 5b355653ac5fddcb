"""A model in plain Python, compiled where numba can do so, where it saves time, and where the results agree."""

from __future__ import annotations

import time
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from torsight.discovery.own.follow import anew, shortest_s
from torsight.discovery.own.model.evaluate import WORTH_S, CompiledPredict, Failure, Model, Predict, call, place_of
from torsight.discovery.own.model.ode import Ode, Solver
from torsight.discovery.own.model.problem import ModelProblem


def quickened(problem: ModelProblem) -> ModelProblem:
    """Return a problem with its model compiled; unchanged where that fails, saves no time or changes the results."""
    evaluator, start = problem.evaluator, {p.name: p.value for p in problem.parameters}
    at_start = evaluator(problem.given(start, ()), {})
    if evaluator.seconds < WORTH_S * evaluator.calls or any(one.failure is not None for one in at_start):
        return problem
    quick, why_not = _compiled(problem.model.predict)
    if quick is None:
        return _with_reason(problem, why_not)
    model = replace(problem.model, predict=quick)
    everything = {p.name: p.value for one in problem.candidates for p in one.parameters}
    names = [one.id for one in problem.candidates]
    asked = [*problem.given(start, ()), *problem.given({**start, **everything}, names)]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # numba's, about a compilation that is discarded then
        # Over short stretches: where small errors grow, two integrators diverge over a whole record.
        short_s = shortest_s(problem)
        usable, why_not = _gives_the_same(anew(problem.model, short_s), anew(model, short_s), asked)
    if not usable:
        return _with_reason(problem, why_not)
    evaluator.change(model)
    return replace(problem, model=model)


def _with_reason(problem: ModelProblem, why_not: str) -> ModelProblem:
    """Return a problem whose model stays plain, with a note of the reason where the user can change something."""
    if not why_not:
        return problem
    each_ms = 1e3 * problem.evaluator.seconds / problem.evaluator.calls
    note = (
        f"the model ({place_of(problem.model.predict)}) was not compiled and takes {each_ms:.2g} ms a call: {why_not}; "
        "numbers, arrays, math, numpy and functions of your own that work on them alone can be compiled"
    )
    return replace(problem, warnings=(*problem.warnings, note))


def is_compiled(predict: Predict) -> bool:
    """Return whether a model is compiled already: it then releases the interpreter's lock, so that threads suffice."""
    return isinstance(predict, CompiledPredict) or (isinstance(predict, Ode) and predict.stepper is not None)


def _compiled(predict: Predict) -> tuple[Predict | None, str]:
    """Return the model compiled, or None with the reason; the reason is empty where the model is not to be compiled."""
    from torsight.discovery.own.compiled.functions import CannotCompileError, compiled

    try:
        if not isinstance(predict, Ode):
            return CompiledPredict(predict, compiled(predict, inner=False)), ""
        wanted = predict.stepper is None and predict.solver.method == Solver.method
        return (predict.compiled(), "") if wanted else (None, "")
    except CannotCompileError as error:
        return None, str(error)


def _gives_the_same(plain: Model, quick: Model, asked: Sequence[Mapping[str, float]]) -> tuple[bool, str]:
    """Return whether the compiled model gives the same results in less time, and the reason if it does not.

    The reason is empty unless the compiled model fails or gives other results. ``asked`` holds values for each record
    in turn, once or several times.
    """
    if isinstance(quick.predict, CompiledPredict):
        quick = replace(quick, predict=quick.predict.alone)
    for k, values in enumerate(asked):
        record = k % len(plain.records)
        one, other = call(plain, record, values, {}), call(quick, record, values, {})
        if one.outputs is None:
            return False, ""
        if other.outputs is None:
            return False, "" if other.failure is None else _why(other.failure)
        spread = np.nanstd(np.column_stack([plain.records[record][name] for name in plain.outputs]), axis=0)
        # Where a model is stable, two integrators with a tolerance of 1e-7 differ by 1e-6 of the spread.
        if np.any(np.abs(one.outputs - other.outputs) > 1e-4 * spread):
            return False, "compiled it gives other results, as where it uses a variable that changes between calls"
        begun = time.thread_time()
        call(quick, record, values, {})
        if time.thread_time() - begun > one.seconds:
            return False, ""
    return True, ""


def _why(failure: Failure) -> str:
    """Return why a compiled model fails where the plain one does not: it cannot be compiled, or it raises an error."""
    from numba.core import errors

    from torsight.discovery.own.compiled.functions import reason_in

    numba = not failure.kind or hasattr(errors, failure.kind)
    return f"{'numba says' if numba else 'compiled it fails'}: {reason_in(failure.message)}"
