"""Declarations of a model of one's own: parameters, candidates, and laws at ports of the model."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

from torsight.core.errors import InputError
from torsight.core.parameter import Parameter
from torsight.discovery.interface import Candidate
from torsight.discovery.own.model import given

MOST_NODES: Final = 100
"""Largest number of nodes of a law: each costs calls of the model."""
_MODEL: Final = "the model"
RESERVED: Final = "@"
"""Separates a name from the number of a record or of a node."""


def parameter(
    name: str,
    start: float,
    *,
    unit: str = "",
    lower: float = -math.inf,
    upper: float = math.inf,
    sigma: float | None = None,
    null: float | None = None,
    fixed: bool = False,
) -> Parameter:
    """Declare a parameter.

    Parameters
    ----------
    name : str
        Name by which ``predict`` reads the value (``p.name`` or ``p["name"]``); by custom it ends in the unit.
    start : float
        Start of the fit; with ``sigma`` the value that was measured beforehand.
    unit : str
        Unit, for the report.
    lower, upper : float
        Bounds.
    sigma : float, optional
        Standard deviation of the value that was measured beforehand; without it the parameter has no prior.
    null : float, optional
        For a parameter of a candidate: the value at which the effect vanishes.
    fixed : bool
        For a parameter of the model: its value is known exactly.
    """
    where = f"parameter '{given.name(name, 'parameter, name')}'"
    return Parameter(
        name,
        given.number(start, f"{where}, start"),
        given.text(unit, f"{where}, unit"),
        given.number(lower, f"{where}, lower", finite=False),
        given.number(upper, f"{where}, upper", finite=False),
        None if sigma is None else given.number(sigma, f"{where}, sigma", positive=True),
        None if null is None else given.number(null, f"{where}, null"),
        given.one_of(fixed, bool, f"{where}, fixed", do="give True or False"),
    )


def candidate(
    name: str,
    *parameters: Parameter | Sequence[Parameter],
    family: str = "",
    starts: Mapping[str, float] | Sequence[Mapping[str, float]] = (),
    laws: str | Sequence[str] = (),
) -> Candidate:
    """Declare an effect that the model may lack.

    ``predict`` contains the effect already, and the effect vanishes where its parameters have their null values. At
    least one parameter has a ``null``.

    Parameters
    ----------
    name : str
        Name of the effect in the report.
    *parameters : Parameter
        The effect's own parameters.
    family : str
        Where the effect acts, for the report.
    starts : sequence of mapping
        Further points from which the effect's fit starts (parameter name to value); others are sought within the
        bounds.
    laws : sequence of str
        Laws of which the effect is a usual form: such a law carries the effect's name where it explains no more than
        the effect. A law's name, or ``output(driver)`` for a law over a driver that is added to an output.
    """
    where = f"candidate '{given.text(name, 'candidate, name')}'"
    do = "declare it with parameter(name, start, null=…)"
    own = [one for some in parameters for one in given.several(some, Parameter, where, do=do)]
    points = given.several(starts, Mapping, f"{where}, starts", do="give points such as {'size': 2.0}")
    known = {p.name: p for p in own}
    for point in points:
        for key, value in point.items():
            at = given.number(value, f"{where}, starts, {key}")
            if key not in known or not known[key].lower <= at <= known[key].upper:
                limit = f"{known[key].lower:g} to {known[key].upper:g}" if key in known else ", ".join(known)
                raise InputError("a start cannot be used", where=where, value=f"{key} {value}", limit=limit)
    forms = given.names(laws, f"{where}, laws")
    return Candidate(name, given.text(family, f"{where}, family"), tuple(own), points, laws=forms)


@dataclass(frozen=True, slots=True)
class LawPort:
    """A port at which a function of one variable enters a model; see :func:`law`."""

    name: str
    driver: str
    unit: str
    driver_unit: str
    low: float | None
    high: float | None
    nodes: int


def law(
    name: str,
    *,
    driver: str,
    unit: str = "",
    driver_unit: str = "",
    low: float | None = None,
    high: float | None = None,
    nodes: int = 20,
) -> LawPort:
    """Declare a port: ``predict`` gets a function of this name, which is measured from the record.

    ``p.friction(velocity)`` is 0 where the law is off, else the measured function; any number or array may be given.

    Parameters
    ----------
    name : str
        Name of the law; ``predict`` calls ``p.name(values)``.
    driver : str
        The variable on which the law depends, for the report.
    unit, driver_unit : str
        Units of the law's value, and of its variable.
    low, high : float, optional
        Range of the variable; by default that with which the model calls the law, and that of the driver's column.
    nodes : int
        Number of nodes, each with a value of its own; the law is linear between them.
    """
    where = f"law '{given.name(name, 'law, name')}'"
    units = {key: given.text(one, f"{where}, {key}") for key, one in (("unit", unit), ("driver_unit", driver_unit))}
    ends = [None if end is None else given.number(end, f"{where}, low and high") for end in (low, high)]
    if ends[0] is not None and ends[1] is not None and not ends[0] < ends[1]:
        raise InputError("its range is empty", where=where, value=f"{low} to {high}", do="give low below high")
    count = given.number(nodes, f"{where}, nodes")
    if not count.is_integer() or not 2 <= count <= MOST_NODES:
        limit = f"a whole number from 2 to {MOST_NODES}: each costs calls of the model"
        raise InputError("has no such number of nodes", where=where, value=repr(nodes), limit=limit, do="give another")
    return LawPort(name, given.text(driver, f"{where}, driver"), **units, low=ends[0], high=ends[1], nodes=int(count))


def parameters_of(declared: Parameter | Iterable[Parameter] | Mapping[str, float]) -> tuple[Parameter, ...]:
    """Return the declared parameters, also from a mapping of name to start."""
    if isinstance(declared, Mapping):
        return tuple(parameter(name, value) for name, value in declared.items())
    return given.several(declared, Parameter, "parameters", do="declare each with parameter(name, start, …)")


def candidates_of(
    declared: Candidate | LawPort | Iterable[Candidate | LawPort], where: str
) -> tuple[Candidate | LawPort, ...]:
    """Return effects and laws that a model may lack."""
    do = "declare each with candidate(name, parameter(…)), or law(name, driver=…)"
    return given.several(declared, (Candidate, LawPort), where, do=do)


def check_declarations(
    parameters: Sequence[Parameter], candidates: Sequence[Candidate], laws: Sequence[LawPort]
) -> None:
    """Refuse invalid declarations: a name twice, a start outside its bounds, an effect that cannot be switched off."""
    if all(one.fixed for one in parameters):
        raise InputError("has no free parameter", where=_MODEL, do="give the parameters that the fit may change")
    known = [one.id for one in candidates] + [one.name for one in laws]
    own_names = {one.name for one in parameters} | {p.name for one in candidates for p in one.parameters}
    for name in known:
        law_of_a_parameter = name in own_names and any(name == one.name for one in laws)
        if not name or known.count(name) > 1 or law_of_a_parameter or RESERVED in name:
            limit = f"a name of its own, without '{RESERVED}'"
            do = "give it another name"
            raise InputError(f"'{name}' cannot be the name of a candidate or law", where=_MODEL, limit=limit, do=do)
    owners: dict[str, str] = {}
    sources: list[tuple[str, Sequence[Parameter]]] = [(_MODEL, parameters)]
    sources += [(f"candidate '{one.id}'", one.parameters) for one in candidates]
    for owner, own in sources:
        for one in own:
            if one.name in owners:
                raise InputError(
                    f"two parameters are called '{one.name}'",
                    where=" and ".join(dict.fromkeys((owners[one.name], owner))),
                    do="give one of them another name",
                )
            owners[one.name] = owner
            _check_parameter(one, where=f"{owner}, {one.name}")
    for one_candidate in candidates:
        _check_candidate(one_candidate)


def _check_parameter(one: Parameter, *, where: str) -> None:
    if not one.name or RESERVED in one.name:
        raise InputError("is no name for a parameter", where=where, value=repr(one.name), limit=f"no '{RESERVED}'")
    if not one.lower < one.upper and not one.fixed:
        do = "give fixed=True for a value that is known exactly, or wider bounds"
        raise InputError("bounds leave no room", where=where, value=f"{one.lower:g} to {one.upper:g}", do=do)
    for what, value in (("start", one.value), ("null value", one.null)):
        if value is not None and not (one.lower <= value <= one.upper and math.isfinite(value)):
            do = f"change the {what} or the bounds"
            limit = f"{one.lower:g} to {one.upper:g}"
            raise InputError(f"its {what} lies outside its bounds", where=where, value=f"{value:g}", limit=limit, do=do)


def _check_candidate(one: Candidate) -> None:
    here = f"candidate '{one.id}'"
    if not one.parameters:
        raise InputError("has no parameter", where=here, do="give the parameter that is its size")
    if all(p.null is None for p in one.parameters):
        do = "give null=… (often 0) to the parameter with which the effect vanishes"
        raise InputError("no parameter has a null value: the effect cannot be switched off", where=here, do=do)
    if all(p.null is None or p.null == p.value for p in one.parameters) and not one.starts:
        raise InputError(
            "starts at its null value, where nothing shows what it does",
            where=here,
            value=", ".join(f"{p.name} {p.value:g}" for p in one.parameters),
            do="let one parameter start where the effect would be seen",
        )
    fixed = [p.name for p in one.parameters if p.fixed]
    if fixed:
        raise InputError(
            f"'{fixed[0]}' is fixed", where=here, do="declare it among the model's parameters, or write it into predict"
        )


def per_record(parameters: Iterable[Parameter], initial: Sequence[str], count: int) -> tuple[Parameter, ...]:
    """Return the parameters, with one parameter per record in place of each initial state."""
    made: list[Parameter] = []
    for one in parameters:
        if one.name in initial and count > 1:
            made += [replace(one, name=name_in(one.name, k)) for k in range(count)]
        else:
            made.append(one)
    return tuple(made)


def name_in(name: str, record: int) -> str:
    """Return the name of an initial state in one record; the name counts the records from 1."""
    return f"{name}{RESERVED}{record + 1}"
