"""The interface between the engine and a model; the engine needs no physics of the model, only these members.

A *problem* is one record of measurements together with a model of it. The model has base parameters, some of them
known beforehand with an error (their priors), and *candidates*: effects that the model may lack, each with parameters
of its own and a null value at which it vanishes. The record is divided into *blocks* (half-cycles, cycles, runs) that
can be held out whole, and into stretches of motion and of rest.

Anything that implements :class:`Problem` can be passed to :func:`torsight.discovery.find_missing`, the entry to the
engine: the torsion actuator (:mod:`torsight.discovery.actuator_problem`), a function and a table
(:mod:`torsight.discovery.own`), a model that is linear in its parameters (:mod:`torsight.discovery.linear_problem`). A
class of one's own derives from :class:`OptionalMembers`, defines the members of :class:`NeededMembers`, and overrides
only those other members whose defaults do not fit.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar, Final, Protocol, Self, TypeVar

import numpy as np

from torsight.core.law import Law, LawForm
from torsight.core.parallel.processes import in_copies
from torsight.core.parallel.threads import in_parallel
from torsight.core.parameter import Parameter
from torsight.core.progress import Progress, silent
from torsight.core.units import Flags, Floats, Ints

_T = TypeVar("_T")
_R = TypeVar("_R")

OVER_GIVEN: Final = 3.0
"""Ratio of a residual that no law explains to a given noise from which something is missing: three standard deviations
..."""
OVER_ESTIMATED: Final = math.sqrt(10.0) * OVER_GIVEN
"""... and its ratio to a noise that was estimated from the scatter of neighbours: noise that is correlated over ten
samples scatters by the root of ten less than its size."""


@dataclass(frozen=True, slots=True)
class Candidate:
    """One effect that the model may lack.

    Attributes
    ----------
    id : str
        Name of the effect in reports.
    family : str
        Where the effect acts (``"temperature"``, ``"friction"``, ...); for the report.
    parameters : tuple of Parameter
        The effect's parameters with bounds; ``null`` of at least one is the value at which the effect vanishes. Names
        are unique over all candidates and base parameters of the problem.
    starts : tuple of mapping
        Further points from which the effect's fit starts, beside the parameters' own values (parameter name to value).
    scales : mapping
        Changes of parameters that matter, where neither a prior nor the distance from the null gives them (parameter
        name to size).
    event : str or None
        Name of the parameter that is a time, where the effect is an event that happens once in the record, between that
        parameter's bounds; the event's size is the parameter with a null.
    laws : tuple of str
        Ids of the problem's laws of which the effect is a usual form.
    jumps : bool
        Whether the predictions jump when the effect's parameters change, so that derivatives hardly show the effect:
        the parameters, which are positive or zero, are then also searched without derivatives.
    any_form : bool
        Whether these laws carry the effect's name whatever their form: the effect is not one particular form of them.
    """

    id: str
    family: str
    parameters: tuple[Parameter, ...]
    starts: tuple[Mapping[str, float], ...] = ()
    event: str | None = None
    scales: Mapping[str, float] = field(default_factory=dict)
    laws: tuple[str, ...] = ()
    jumps: bool = False
    any_form: bool = False

    def starting_points(self) -> tuple[dict[str, float], ...]:
        """Return the points from which the fit starts, each complete."""
        own = {parameter.name: parameter.value for parameter in self.parameters}
        return tuple({**own, **point} for point in ({}, *self.starts))

    def own(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return the effect's own parameters out of a set's values."""
        return {p.name: values[p.name] for p in self.parameters}

    def null_point(self) -> dict[str, float]:
        """Return the parameters with the effect switched off."""
        return {p.name: p.value if p.null is None else p.null for p in self.parameters}


def known_of(problem: object, names: Sequence[str]) -> dict[str, Any]:
    """Return the named members of a problem as far as they were given or have been computed already."""
    return {name: vars(problem)[name] for name in names if name in vars(problem)}


class NeededMembers(Protocol):
    """Members that every problem has: a record and a model of it."""

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The plain model's free parameters; ``sigma`` is the standard deviation of the prior around ``value``."""

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """Effects that the model may lack."""

    @property
    def time_s(self) -> Floats:
        """Time of the samples (n,), or another coordinate along which neighbours are correlated."""

    @property
    def observed(self) -> Floats:
        """Measured values (n,)."""

    @property
    def sigma(self) -> Floats:
        """Standard deviation of the reading noise (n,); zeros where it is to be estimated from the residual."""

    @property
    def valid(self) -> Flags:
        """Samples that count (n,)."""

    @property
    def block(self) -> Ints:
        """Number of the block of every sample (n,), from 0."""

    def predict(self, values: Mapping[str, float], effects: Sequence[str]) -> Floats:
        """Return the model's values (n,) with the effects named switched on.

        ``values`` holds every base parameter and every parameter of these effects. The result must depend on the
        arguments alone.
        """


class OptionalMembers(Protocol):
    """Members that a problem may leave out, with their defaults.

    ``in_copies``: whether fits may run in copies of the process, two at a time. This needs a problem that can be
    pickled and whose predictions keep nothing that later ones need. Other problems run in threads, one at a time
    because of Python's lock.
    """

    in_copies: ClassVar[bool] = False

    @cached_property
    def resolution(self) -> float:
        """Size of a difference, in units of ``observed``, below which an effect does not matter."""
        return 0.0

    @cached_property
    def laws(self) -> tuple[Law, ...]:
        """Laws that the model may lack; a problem that has laws also has ``with_laws``."""
        return ()

    @cached_property
    def forms(self) -> tuple[LawForm, ...]:
        """Measured laws that are candidates, too."""
        return ()

    @cached_property
    def once(self) -> tuple[str, ...]:
        """Base parameters that only some blocks determine, such as the state before the record."""
        return ()

    @cached_property
    def opening_blocks(self) -> tuple[int, ...]:
        """First block of each record, where the state before the record is not known.

        The model's discrepancy there says nothing about that in other blocks.
        """
        return ()

    @cached_property
    def elsewhere(self) -> tuple[Mapping[str, float], ...]:
        """Other values of base parameters (name to value) from which every fit is tried once more.

        For models whose predictions have kinks, so that a fit may end in a wrong minimum.
        """
        return ()

    @cached_property
    def sigma_known(self: NeededMembers) -> bool:
        """Whether the reading noise was given, and not estimated from the scatter of neighbours."""
        return bool(np.any(self.sigma))

    @cached_property
    def over_floor(self: Problem) -> float:
        """Ratio of residual to noise floor above which an effect is missing, even if no candidate explains it."""
        return OVER_GIVEN if self.sigma_known else OVER_ESTIMATED

    @cached_property
    def rest(self: NeededMembers) -> Flags:
        """Where the measured values stand still (n,): such a stretch counts as one sample."""
        return np.zeros(len(self.observed), bool)

    @cached_property
    def share(self: NeededMembers) -> Floats:
        """Weight of every sample in motion (n,), in samples.

        Less than one where samples lie closer than usual along the coordinate over which residuals are correlated.
        """
        return np.ones(len(self.observed))

    @cached_property
    def input_alike_s(self: NeededMembers) -> Floats:
        """Integrated correlation time (n,) of the errors of ``input_noise``, in seconds."""
        return np.zeros(len(self.observed))

    @cached_property
    def drivers(self) -> Mapping[str, Floats]:
        """Variables (n,) that an effect without a name may depend on."""
        return {}

    def with_laws(self, forms: Sequence[LawForm]) -> Self:
        """Return the problem with these forms of laws among its candidates, each under its law's id."""
        if forms:
            raise NotImplementedError(f"{type(self).__name__} has laws, but no with_laws")
        return self

    def curve_of(self, effect: str, law: Law, values: Mapping[str, float]) -> Floats | None:
        """Return the values (k,) on a law's nodes with which it acts as an effect does that is a usual form of it.

        None where they are not known: the law's measurement then starts from zero.
        """
        del effect, law, values
        return None

    def predict_many(
        self: NeededMembers, values: Sequence[Mapping[str, float]], effects: Sequence[str]
    ) -> list[Floats]:
        """Return ``predict`` at several points."""
        return [self.predict(one, effects) for one in values]

    def get_ready(self) -> None:
        """Compute members that a search's fits need: those computed in a copy of the process are lost with the copy."""
        return

    def at_once(
        self, work: Sequence[_T], function: Callable[[_T], _R], *, step: str = "", progress: Progress = silent
    ) -> list[_R]:
        """Return ``function`` of each item in order, several of them computed at the same time."""
        if self.in_copies:
            return in_copies(work, function, known=(self, progress), step=step, progress=progress)
        return in_parallel(work, function, step=step, progress=progress)

    def input_noise(self: NeededMembers, values: Mapping[str, float], effects: Sequence[str]) -> Floats:
        """Return the standard deviation (n,) of the prediction that noise on the model's inputs causes."""
        del values, effects
        return np.zeros(len(self.observed))

    def shared_errors(self: NeededMembers, values: Mapping[str, float], effects: Sequence[str]) -> Floats:
        """Return the change (n, k) of the prediction by one standard deviation of each shared error of the inputs.

        These errors are independent of each other, but each acts on many samples; ``input_noise`` holds the others.
        """
        del values, effects
        return np.zeros((len(self.observed), 0))

    def also_seen(self: NeededMembers, values: Mapping[str, float], effects: Sequence[str]) -> float:
        """Return the log-likelihood, up to a constant, of measurements beside the samples."""
        del values, effects
        return 0.0


class Problem(NeededMembers, OptionalMembers, Protocol):
    """A record and a model of it, as the engine sees them."""


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class GivenProblem(OptionalMembers):
    """A problem whose record, parameters and candidates are given, not computed; members as in :class:`Problem`.

    Measured laws become candidates under their laws' ids.
    """

    parameters: tuple[Parameter, ...]
    candidates: tuple[Candidate, ...]
    time_s: Floats
    observed: Floats
    sigma: Floats
    valid: Flags
    block: Ints
    rest: Flags
    drivers: Mapping[str, Floats] = field(default_factory=dict)
    resolution: float = 0.0
    forms: tuple[LawForm, ...] = ()

    def with_laws(self, forms: Sequence[LawForm]) -> Self:
        """Return the problem with these forms of laws among its candidates, in place of those that it had."""
        known = {form.id for form in self.forms}
        own = tuple(one for one in self.candidates if one.id not in known)
        made = tuple(Candidate(form.id, "law", form.parameters) for form in forms)
        return replace(self, candidates=(*own, *made), forms=tuple(forms))
