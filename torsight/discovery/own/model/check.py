"""Checks of a problem before the search: for mistakes that would give a wrong answer without an error."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from torsight.core.errors import InputError
from torsight.core.units import Floats
from torsight.discovery.interface import Candidate, NeededMembers, OptionalMembers, Problem
from torsight.discovery.own.model.declare import check_declarations
from torsight.discovery.own.model.evaluate import place_of
from torsight.discovery.own.model.ode import EQUAL
from torsight.discovery.own.model.problem import ModelProblem
from torsight.discovery.own.reading_error import laws_called_with

_ROWS: Final = ("time_s", "observed", "sigma", "valid", "block", "rest")
_NEEDED, _OPTIONAL = (tuple(name for name in vars(one) if name[0] != "_") for one in (NeededMembers, OptionalMembers))


def check_problem(problem: Problem) -> tuple[str, ...]:
    """Refuse a problem that cannot be searched; return warnings about one that can."""
    needed, further = ([name for name in some if not hasattr(problem, name)] for some in (_NEEDED, _OPTIONAL))
    missing = needed or further  # optional members have defaults that are computed from the needed ones
    if len(needed) == len(_NEEDED) or isinstance(problem, type):
        raise InputError("is no problem", where="find_missing", value=repr(problem), do="make it with model_problem(…)")
    if missing:
        do = "add what is missing, derive the class from OptionalMembers, or make the problem with model_problem(…)"
        raise InputError(f"lacks {', '.join(missing)}", where=type(problem).__name__, do=do)
    where = type(problem).__name__
    _check_rows(problem, where)
    if isinstance(problem, ModelProblem):
        return (*problem.warnings, *_check_model(problem))
    check_declarations(problem.parameters, problem.candidates, ())
    start = {p.name: p.value for p in problem.parameters}
    _numbers(problem, problem.predict(start, ()), where)
    return ()


def _check_rows(problem: Problem, where: str) -> None:
    n = len(problem.observed)
    for name in _ROWS:
        if np.shape(getattr(problem, name)) != (n,):
            raise InputError(
                "has a wrong shape", where=f"{where}.{name}", value=np.shape(getattr(problem, name)), limit=f"({n},)"
            )
    for name, values in problem.drivers.items():
        if np.shape(values) != (n,) or not np.isfinite(values).all():
            raise InputError(
                "is not known in every row",
                where=f"{where}.drivers['{name}']",
                value=np.shape(values),
                limit=f"({n},), all finite",
            )
    if not np.any(problem.valid):
        raise InputError("no sample counts", where=f"{where}.valid", do="record it again")
    if not np.isfinite(problem.observed[problem.valid]).all():
        raise InputError("is not known where it counts", where=f"{where}.observed", do="set valid to False there")
    if not np.all(problem.sigma >= 0.0):
        raise InputError(
            "is no noise", where=f"{where}.sigma", value=np.min(problem.sigma), limit="0 or more", do="correct it"
        )
    if problem.resolution < 0.0 or not np.isfinite(problem.resolution):
        raise InputError("is no size", where=f"{where}.resolution", value=problem.resolution, limit="0 or more")


def _numbers(problem: Problem, prediction: Any, where: str) -> None:
    values = np.asarray(prediction, np.float64)
    if values.shape != problem.observed.shape:
        raise InputError(
            "gives a wrong shape", where=f"{where}.predict", value=values.shape, limit=str(problem.observed.shape)
        )
    bad = np.flatnonzero(~np.isfinite(values) & problem.valid)
    if len(bad):
        raise InputError(
            "is not a number", where=f"{where}.predict, row {bad[0] + 1}", value=values[bad[0]], do="correct it"
        )


def _check_model(problem: ModelProblem) -> list[str]:
    """Call a model at its start, and with every effect on and at its null; return warnings."""
    start, place = {p.name: p.value for p in problem.parameters}, place_of(problem.model.predict)
    before = [{name: values.copy() for name, values in record.items()} for record in problem.model.records]
    plain = problem.outputs(start, (), where=place)
    _check_unchanged(problem, before)
    least = np.asarray(EQUAL * np.nanstd(np.concatenate(problem.measured()), axis=0))
    notes = []
    for one in problem.candidates:
        notes += _check_candidate(problem, one, start, plain, least)
    _check_unchanged(problem, before)
    check_same(problem, start, plain)
    _check_laws(problem, start)
    notes += _unused(problem, start, plain, least)
    return notes


def check_same(problem: ModelProblem, values: dict[str, float], before: list[Floats]) -> None:
    """Refuse a model that gives different outputs when it is called again with the same values."""
    problem.evaluator.forget()
    again = problem.outputs(values, (), where=place_of(problem.model.predict))
    if any(np.any(a != b) for a, b in zip(before, again, strict=True)):
        apart = max(float(np.max(np.abs(a - b))) for a, b in zip(before, again, strict=True))
        raise InputError(
            "gives different outputs for the same values",
            where=place_of(problem.model.predict),
            value=f"a difference of {apart:.3g}",
            limit="the same outputs",
            do="draw no random numbers in it (or from a generator that the call itself makes with a fixed seed), and "
            "keep nothing from one call to the next",
        )


def _check_unchanged(problem: ModelProblem, before: Sequence[Mapping[str, Floats]]) -> None:
    for record, columns in zip(problem.model.records, before, strict=True):
        for name, values in columns.items():
            if not np.array_equal(record[name], values, equal_nan=True):
                raise InputError(
                    f"changes its record: column '{name}' holds other values after the call",
                    where=place_of(problem.model.predict),
                    do=f"work on a copy: record['{name}'].copy()",
                )


def _check_laws(problem: ModelProblem, start: dict[str, float]) -> None:
    """Refuse a model that calls a law with an output's reading of the same row: the law would explain the noise."""
    for name in problem.model.outputs:
        for law in laws_called_with(problem, start, name):
            raise InputError(
                f"calls the law '{law}' with '{name}' as it was read in the same row: such a law explains the noise, "
                "and any missing effect with it",
                where=place_of(problem.model.predict),
                do="call it with what the model computes, with a row before, or with another sensor's column",
            )


def _check_candidate(
    problem: ModelProblem, one: Candidate, start: dict[str, float], plain: list[Floats], least: Floats
) -> list[str]:
    where = f"candidate '{one.id}'"
    laws = [law.id for law in problem.laws]
    unknown = [name for name in one.laws if name not in laws]
    if unknown:
        do = "name one of these, or leave laws out"
        raise InputError("is no law", where=f"{where}, laws", value=unknown[0], limit=", ".join(laws) or "none", do=do)
    own = {p.name: p.value for p in one.parameters}
    on = problem.outputs({**start, **own}, (one.id,), where=f"{where} at its start")
    notes = []
    if not _apart(on, plain, least) and not one.starts:
        at = ", ".join(f"{p.name} {p.value:g}" for p in one.parameters)
        notes.append(
            f"{where} changes nothing at its start ({at}): it is only found if another start shows it; does predict "
            "use it?"
        )
    null = one.null_point()
    for p in one.parameters:
        if p.null is not None:
            continue
        moved = {**null, p.name: _moved(p.value, p.lower, p.upper)}
        if _apart(problem.outputs({**start, **moved}, (one.id,), where=where), plain, least):
            nulls = ", ".join(f"{q.name}={q.null:g}" for q in one.parameters if q.null is not None)
            raise InputError(
                f"does not vanish at its null values: with {nulls} the model still depends on '{p.name}'",
                where=where,
                do=f"give '{p.name}' a null value of its own, or correct predict",
            )
    return notes


def _moved(value: float, lower: float, upper: float) -> float:
    """Return a value moved by 0.3 of its range, to see whether the prediction depends on it."""
    step = 0.3 * (upper - lower if np.isfinite(upper - lower) else abs(value) or 1.0)
    return value + step if value + step <= upper else value - step


def _apart(one: list[Floats], other: list[Floats], least: Floats) -> bool:
    return any(bool(np.any(np.abs(a - b) > least)) for a, b in zip(one, other, strict=True))


def _unused(problem: ModelProblem, start: dict[str, float], plain: list[Floats], least: Floats) -> list[str]:
    """Return a warning for every base parameter that does not change the outputs."""
    notes = []
    for p in problem.parameters:
        moved = {**start, p.name: _moved(p.value, p.lower, p.upper)}
        called = problem.evaluator(problem.given(moved, ()), {})
        outputs = [one.outputs for one in called if one.outputs is not None]
        if len(outputs) == len(plain) and not _apart(outputs, plain, least):
            notes.append(f"'{p.name}' changes nothing in what predict gives: is it used?")
    return notes
