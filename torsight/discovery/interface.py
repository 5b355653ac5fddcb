"""What the engine asks of a model: nothing of its physics, only these few things.

A *problem* is one record of measurements together with a model of it. The model has base parameters, some of them
known beforehand with an error (their priors), and *candidates*: effects that the model may lack, each with parameters
of its own and a null value at which it vanishes. The record falls into *blocks* (half-cycles, cycles, runs) that can be
held out whole, and into stretches of motion and of rest.

Anything that offers :class:`Problem` can be handed to :func:`torsight.discovery.find_missing`, the one way to the
engine: the torsion actuator (:mod:`torsight.discovery.actuator_problem`), a function and a table
(:mod:`torsight.discovery.own`), a model that is linear in its parameters (:mod:`torsight.discovery.linear_problem`). A
class of one's own derives from :class:`OptionalMembers`, has :class:`NeededMembers`, and leaves out of the rest what it
has nothing to say of.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar, Final, Protocol, Self, TypeVar

import numpy as np

from torsight.core.law import Law, LawForm
from torsight.core.parallel.processes import in_copies
from torsight.core.parallel.threads import in_parallel, with_help
from torsight.core.parameter import Parameter
from torsight.core.progress import Progress, silent
from torsight.core.units import Flags, Floats, Ints

_T = TypeVar("_T")
_R = TypeVar("_R")
Propose = Callable[[Floats, Floats], tuple[Mapping[str, float], ...]]

OVER_GIVEN: Final = 3.0
"""Times a noise that was given from which a residual that no law explains means that something is missing: three
standard deviations ..."""
OVER_ESTIMATED: Final = 10.0
"""... and times one that was estimated from the scatter of neighbours: noise that is correlated over ten samples
scatters about three times less than its size."""


@dataclass(frozen=True, slots=True)
class Candidate:
    """One effect that the model may lack.

    Attributes
    ----------
    id : str
        Name under which it is reported.
    family : str
        Where it acts (``"temperature"``, ``"friction"``, ...); for the report.
    parameters : tuple of Parameter
        Its parameters with bounds; ``null`` of at least one is the value at which the effect vanishes. Names are
        unique over all candidates and base parameters of the problem.
    starts : tuple of mapping
        Further points from which its fit starts, beside the parameters' own values (parameter name to value).
    scales : mapping
        Changes of parameters that matter, where neither a prior nor the distance from the null says it (parameter
        name to size).
    propose : callable or None
        From times and a residual (measured less model; NaN where not measured) to more such points.
    laws : tuple of str
        Ids of the problem's laws of which it is a usual form.
    jumps : bool
        Whether the predictions jump when its parameters change, so that derivatives see hardly anything of it: the
        parameters, which are positive or zero, are then found by trials, too.
    any_form : bool
        Whether these laws carry its name whatever their form: it is what they are, and not one form of it.
    """

    id: str
    family: str
    parameters: tuple[Parameter, ...]
    starts: tuple[Mapping[str, float], ...] = ()
    propose: Propose | None = None
    scales: Mapping[str, float] = field(default_factory=dict)
    laws: tuple[str, ...] = ()
    jumps: bool = False
    any_form: bool = False

    def starting_points(
        self, time_s: Floats | None = None, residual: Floats | None = None
    ) -> tuple[dict[str, float], ...]:
        """Return the points from which the fit starts, each complete; those made for a residual where it is given."""
        own = {parameter.name: parameter.value for parameter in self.parameters}
        points: list[Mapping[str, float]] = [own, *self.starts]
        if self.propose is not None and time_s is not None and residual is not None:
            points = list(self.propose(time_s, residual)) or points
        return tuple({**own, **point} for point in points)

    def own(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return the effect's own parameters out of a set's values."""
        return {p.name: values[p.name] for p in self.parameters}

    def null_point(self) -> dict[str, float]:
        """Return the parameters with the effect switched off."""
        return {p.name: p.value if p.null is None else p.null for p in self.parameters}


def known_of(problem: object, names: Sequence[str]) -> dict[str, Any]:
    """Return those members of a problem among so many that were given or worked out already."""
    return {name: vars(problem)[name] for name in names if name in vars(problem)}


class NeededMembers(Protocol):
    """What every problem says of itself: a record and a model of it."""

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
        """Standard deviation of the reading noise (n,); zeros where it is to be measured from the residual."""

    @property
    def valid(self) -> Flags:
        """Samples that count (n,)."""

    @property
    def block(self) -> Ints:
        """Which block a sample belongs to (n,), from 0."""

    def predict(self, values: Mapping[str, float], effects: Sequence[str]) -> Floats:
        """Return the model's values (n,) with the effects named switched on.

        ``values`` holds every base parameter and every parameter of these effects. Must depend on its arguments alone.
        """


class OptionalMembers(Protocol):
    """What a problem may leave out, with what then holds.

    ``in_copies`` says that fits may run in copies of the process, two at a time: nothing is lost that predictions leave
    behind, and the problem can be pickled. Others run in threads, of which Python's lock lets one run at a time.
    """

    in_copies: ClassVar[bool] = False

    @cached_property
    def resolution(self) -> float:
        """Size of a difference, in units of ``observed``, below which nobody would miss an effect."""
        return 0.0

    @cached_property
    def laws(self) -> tuple[Law, ...]:
        """Places and variables at which the model may lack a law; a problem that has some has ``with_laws``, too."""
        return ()

    @cached_property
    def forms(self) -> tuple[LawForm, ...]:
        """Measured laws that are candidates, too."""
        return ()

    @cached_property
    def once(self) -> tuple[str, ...]:
        """Base parameters that only some blocks can tell, such as what came before the record."""
        return ()

    @cached_property
    def opening_blocks(self) -> tuple[int, ...]:
        """Blocks that a record opens with, where what came before it is not known.

        How far the model is off there says nothing of the others.
        """
        return ()

    @cached_property
    def elsewhere(self) -> tuple[Mapping[str, float], ...]:
        """Other values of base parameters (name to value) from which every fit is tried once more.

        For models whose answer has kinks, where a fit may sit in the wrong valley.
        """
        return ()

    @cached_property
    def sigma_known(self: NeededMembers) -> bool:
        """Whether the reading noise was given, and not measured from the scatter of neighbours."""
        return bool(np.any(self.sigma))

    @cached_property
    def over_floor(self: Problem) -> float:
        """Noise floors that are left from which something is missing although nothing that is offered explains it."""
        return OVER_GIVEN if self.sigma_known else OVER_ESTIMATED

    @cached_property
    def rest(self: NeededMembers) -> Flags:
        """Where what is measured stands still (n,): such a stretch carries one piece of information."""
        return np.zeros(len(self.observed), bool)

    @cached_property
    def share(self: NeededMembers) -> Floats:
        """How much of a sample every sample in motion counts as (n,).

        Less than one where samples lie closer than usual along what their residual is correlated over.
        """
        return np.ones(len(self.observed))

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
        """Return the law's values on its nodes (k,) at which it does what an effect does that is a usual form of it.

        None where that is not known: the law is then measured from nothing.
        """
        del effect, law, values
        return None

    def predict_many(
        self: NeededMembers, values: Sequence[Mapping[str, float]], effects: Sequence[str]
    ) -> list[Floats]:
        """Return ``predict`` at several points, half of them in a second thread where one is idle."""
        return with_help(values, lambda one: self.predict(one, effects))

    def get_ready(self) -> None:
        """Work out what many fits need: what a copy of the process works out for itself is lost with it."""
        return

    def at_once(
        self, work: Sequence[_T], function: Callable[[_T], _R], *, step: str = "", progress: Progress = silent
    ) -> list[_R]:
        """Return ``function`` of each item in order, several of them worked out at the same time."""
        if self.in_copies:
            self.get_ready()
            return in_copies(work, function, known=(self, progress), step=step, progress=progress)
        return in_parallel(work, function, step=step, progress=progress)

    def input_noise(self: NeededMembers, values: Mapping[str, float], effects: Sequence[str]) -> Floats:
        """Return the standard deviation (n,) of the prediction that noise on the model's inputs causes."""
        del values, effects
        return np.zeros(len(self.observed))

    def shared_errors(self: NeededMembers, values: Mapping[str, float], effects: Sequence[str]) -> Floats:
        """Return what one standard deviation of every independent error of the inputs does to the prediction (n, k).

        For errors that many samples share; ``input_noise`` is what the others do.
        """
        del values, effects
        return np.zeros((len(self.observed), 0))

    def also_seen(self: NeededMembers, values: Mapping[str, float], effects: Sequence[str]) -> float:
        """Return the log-likelihood, up to a constant, of what was measured beside the samples."""
        del values, effects
        return 0.0


class Problem(NeededMembers, OptionalMembers, Protocol):
    """A record and a model of it, as the engine sees them."""


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class GivenProblem(OptionalMembers):
    """A problem whose record, parameters and candidates are given and not worked out; members as of :class:`Problem`.

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
