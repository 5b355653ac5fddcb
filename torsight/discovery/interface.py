"""What the engine asks of a model: nothing of its physics, only these few things.

A *problem* is one record of measurements together with a model of it. The model has base parameters, some of them
known beforehand with an error (their priors), and *candidates*: effects that the model may lack, each with parameters
of its own and a null value at which it vanishes. The record falls into *blocks* (half-cycles, cycles, runs) that can be
held out whole, and into stretches of motion and of rest.

Anything that offers :class:`Problem` can be handed to :func:`torsight.discovery.inference.engine.find_missing`: the
torsion actuator (:mod:`torsight.discovery.actuator_problem`), or any model that is linear in its parameters
(:mod:`torsight.discovery.linear_problem`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from torsight.core.law import Law, LawForm
from torsight.core.parameter import Parameter

Propose = Callable[[NDArray[np.float64], NDArray[np.float64]], tuple[Mapping[str, float], ...]]


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
    any_form: bool = False

    def starting_points(
        self, time_s: NDArray[np.float64] | None = None, residual: NDArray[np.float64] | None = None
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


@runtime_checkable
class Problem(Protocol):
    """A record and a model of it, as the engine sees them.

    Attributes
    ----------
    parameters : tuple of Parameter
        The base model's free parameters; ``sigma`` is the standard deviation of the prior around ``value``.
    candidates : tuple of Candidate
        Effects that the model may lack.
    time_s : (n,) float64
        Time of the samples (or another coordinate along which neighbours are correlated).
    observed, sigma : (n,) float64
        Measured values and the standard deviation of their reading noise.
    valid : (n,) bool
        Samples that count.
    block : (n,) int
        Which block a sample belongs to, from 0.
    rest : (n,) bool
        True where what is measured stands still for a while: such a stretch carries one piece of information,
        however many samples it has. All False where there is no such thing.
    drivers : mapping of str to (n,) array
        Variables that an effect without a name may depend on.
    laws : tuple of Law
        Places and variables at which the model may lack a law.
    forms : tuple of LawForm
        Measured laws that are candidates, too.
    resolution : float
        Size of a difference, in units of ``observed``, below which nobody would miss an effect.
    once : tuple of str
        May be left out. Base parameters that only some blocks can tell, such as what came before the record.
    first_halves : tuple of int
        May be left out. Blocks that a record opens with, where what came before it is not known: how far the model is
        off there says nothing of the others.
    elsewhere : tuple of mapping
        May be left out. Other values of base parameters (parameter name to value) from which every fit is tried once
        more: for models whose answer has kinks, where a fit may sit in the wrong valley.
    share : (n,) float64
        May be left out. How much of a sample every sample in motion counts as: less than one where samples lie closer
        than usual along what their residual is correlated over.
    shared_errors : callable
        May be left out. From values and effects to what one standard deviation of every independent error of the inputs
        does to the prediction (n, k), for errors that many samples share; ``input_noise`` is what the others do.
    predict_many : callable
        May be left out. ``predict`` at several points at once (a list of values, the effects): for models that can be
        called in parallel.
    """

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The base model's free parameters."""

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """Effects that the model may lack."""

    @property
    def time_s(self) -> NDArray[np.float64]:
        """Time of the samples."""

    @property
    def observed(self) -> NDArray[np.float64]:
        """Measured values."""

    @property
    def sigma(self) -> NDArray[np.float64]:
        """Reading noise."""

    @property
    def valid(self) -> NDArray[np.bool_]:
        """Samples that count."""

    @property
    def block(self) -> NDArray[np.int64]:
        """Block of each sample."""

    @property
    def rest(self) -> NDArray[np.bool_]:
        """Where what is measured stands still."""

    @property
    def drivers(self) -> Mapping[str, NDArray[np.float64]]:
        """Variables that an effect without a name may depend on."""

    @property
    def resolution(self) -> float:
        """Size below which nobody would miss an effect."""

    @property
    def laws(self) -> tuple[Law, ...]:
        """Places and variables at which the model may lack a law."""

    @property
    def forms(self) -> tuple[LawForm, ...]:
        """Measured laws that are candidates, too."""

    def with_laws(self, forms: Sequence[LawForm]) -> Problem:
        """Return the problem with these forms of laws among its candidates, each under its law's id."""

    def predict(self, values: Mapping[str, float], effects: Sequence[str]) -> NDArray[np.float64]:
        """Return the model's values (n,) with the effects named switched on.

        ``values`` holds every base parameter and every parameter of these effects. Must depend on its arguments alone.
        """

    def input_noise(self, values: Mapping[str, float], effects: Sequence[str]) -> NDArray[np.float64]:
        """Return the standard deviation (n,) of the prediction that noise on the model's inputs causes.

        Zeros where the inputs are known.
        """
