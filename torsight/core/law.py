r"""A law: a smooth function of one variable at one place of a model, as values on nodes.

What a model lacks need not have a form that anybody has written down. A law has none: it is a function with a Gaussian
prior of zero mean, known by its values :math:`f` on nodes of its variable. Its prior is a bank of kernels
:math:`s^2 K_j`: a few usual forms (a constant, a slope, a wave once per turn) and smooth functions of several lengths;
which kernel and which size :math:`s` a record asks for is found by marginal likelihood, so that a law costs what its
flexibility is worth (Rasmussen and Williams, Gaussian Processes for Machine Learning (2006), ch. 5).
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from torsight.core.parameter import Parameter
from torsight.core.series import rms, usual_step
from torsight.core.units import Flags, Floats

TIME = "time_s"
"""The driver that is the record's own time."""
KEPT = 1e-5
"""Share of a kernel's largest eigenvalue below which a direction of the law is left out: a third of a per cent of its
size."""
_FEWEST = 4
"""Through fewer nodes a curve is no better known than lines are."""
_FINER = 8
"""Places per gap between nodes: of what lines between the nodes are off by, a sixty-fourth is left."""


@dataclass(frozen=True, slots=True, eq=False)
class Kernel:
    """One member of a law's prior, named in a few plain words (``"slope"``, ``"smooth, 120 °"``).

    ``matrix`` (k, k) is the covariance of the law's values on its nodes at size one; it need not have full rank.
    ``smooth`` is true for a free function of some length, false for a usual form.
    """

    name: str
    matrix: Floats
    smooth: bool


@dataclass(frozen=True, slots=True, eq=False)
class Law:
    """A place and a variable at which a model may lack a law.

    Attributes
    ----------
    id : str
        Unique among laws and effects of a problem; begins the names of its parameters.
    port, driver, spring : str
        Where it acts, on what it depends, and for which spring (``a``, ``b``, ``both``; empty where there is none).
    unit : str
        Of its values.
    title : str
        A few plain words (``"friction over the angle"``).
    nodes : (k,) float64
        Values of the driver, rising.
    scale : float
        A size of the law that matters, in ``unit``: steps of derivatives, and the middle of the sizes that are tried.
    kernels : tuple of Kernel
        The bank of its prior.
    time_like : bool
        True where the driver only counts time or cycles: such a law says when something changed and not why, and holds
        for no later time. The course of a clock over time is its own cause, and no such law.
    covered : (float, float)
        Range of the driver that the record covers; beyond it a law is what its prior says.
    """

    id: str
    port: str
    driver: str
    unit: str
    title: str
    nodes: Floats
    scale: float
    kernels: tuple[Kernel, ...]
    spring: str = ""
    time_like: bool = False
    covered: tuple[float, float] = (-np.inf, np.inf)

    @property
    def says_when(self) -> bool:
        """Whether it is a law of time that says when something differs and not why: a reference, no explanation."""
        return self.time_like and self.driver == TIME

    def free(self) -> LawForm:
        """Return the law with its values on the nodes as parameters."""
        return LawForm(self.id, self.nodes, np.eye(len(self.nodes)), self.unit, self.scale, prior=False)

    @property
    def reached(self) -> Flags:
        """Nodes (k,) that the record says something of: those beside the covered range or in it."""
        low, high = self.covered
        following, before = np.append(self.nodes[1:], np.inf), np.append(-np.inf, self.nodes[:-1])
        return np.asarray((following > low) & (before < high))

    def form(self, kernel: Kernel, size: float) -> LawForm:
        """Return the law under one kernel of one size: independent coefficients with standard deviation one.

        First those of the nodes that the record reaches. What they leave open of the others has coefficients of its
        own: the record says nothing of them, so that beyond it a law is as uncertain as its prior.
        """
        reached = self.reached
        known, across = kernel.matrix[np.ix_(reached, reached)], kernel.matrix[np.ix_(~reached, reached)]
        largest = float(np.linalg.norm(kernel.matrix, 2))
        own, inverse = _root(known, largest)
        beyond = across @ inverse
        left, _ = _root(kernel.matrix[np.ix_(~reached, ~reached)] - beyond @ beyond.T, largest)
        basis = np.zeros((len(self.nodes), own.shape[1] + left.shape[1]))
        basis[np.ix_(reached, np.arange(own.shape[1]))] = own
        basis[~reached] = np.hstack([beyond, left])
        return LawForm(self.id, self.nodes, basis * size, self.unit, self.scale, prior=True)


def _root(covariance: Floats, largest: float) -> tuple[Floats, Floats]:
    """Return B (k, r) with B Bᵀ a covariance, and Bᵀ's inverse on its span, without directions of next to no size."""
    share, directions = np.linalg.eigh(covariance)
    kept = np.flatnonzero(share > KEPT * largest)[::-1]
    root = np.sqrt(share[kept])
    return directions[:, kept] * root, directions[:, kept] / root


@functools.cache
def _names(law: str, count: int) -> tuple[str, ...]:
    return tuple(f"{law}@{i:02d}" for i in range(count))


@dataclass(frozen=True, slots=True, eq=False)
class LawForm:
    """A law as parameters: its values on the nodes are ``basis`` times them.

    Attributes
    ----------
    id : str
        Of the law.
    nodes : (k,) float64
        Values of the driver, rising.
    basis : (k, r) float64
        Values on the nodes per parameter, in ``unit``.
    unit : str
        Of the law's values.
    scale : float
        Of the law, in ``unit``.
    prior : bool
        Whether the parameters have a standard normal prior; without one they are the values on the nodes.
    """

    id: str
    nodes: Floats
    basis: Floats
    unit: str
    scale: float
    prior: bool

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return _names(self.id, self.basis.shape[1])

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The parameters; zero is the null of each."""
        unit, sigma = ("", 1.0) if self.prior else (self.unit, None)
        return tuple(Parameter(name=name, value=0.0, unit=unit, sigma=sigma, null=0.0) for name in self.names)

    def values(self, parameters: Sequence[float] | Floats) -> Floats:
        """Return the law's values on its nodes (k,)."""
        return np.asarray(self.basis @ np.asarray(parameters, np.float64))

    def at(self, driver: Floats, parameters: Sequence[float] | Floats) -> Floats:
        """Return the law by lines between its nodes; beyond them the outermost value holds."""
        return np.interp(driver, self.nodes, self.values(parameters))

    def to_json(self) -> dict[str, Any]:
        """Return the form as it stands in ``model.json``."""
        return {
            "id": self.id,
            "nodes": self.nodes.tolist(),
            "basis": self.basis.tolist(),
            "unit": self.unit,
            "scale": self.scale,
        }


def smooth_between(nodes: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Return places and values of a smooth curve through values on nodes (k,): between the places lines do.

    A natural cubic spline: lines between the nodes themselves would cut a wave of five nodes a period by a sixth. It
    swings where the curve bends within a gap, so nodes have to lie closer than that.
    """
    if len(nodes) < _FEWEST:
        return nodes, values
    places, spline = _spline(np.asarray(nodes, np.float64).tobytes())
    return places, spline @ values


@functools.lru_cache(maxsize=256)
def _spline(nodes: bytes) -> tuple[Floats, Floats]:
    """Return places (m,) between nodes, and the matrix (m, k) from the nodes' values to theirs."""
    # Commands that have no law would import it, too, and scipy.optimize with it.
    from scipy.interpolate import CubicSpline

    at = np.frombuffer(nodes)
    gaps = np.arange(_FINER * (len(at) - 1) + 1) / _FINER
    places = np.interp(gaps, np.arange(len(at)), at)
    return places, np.asarray(CubicSpline(at, np.eye(len(at)), bc_type="natural")(places))


def squared_exponential(nodes: Floats, length: float) -> Floats:
    """Return the covariance (k, k) of a smooth function with this length, standard deviation one."""
    off = (nodes[:, None] - nodes[None, :]) / length
    return np.asarray(np.exp(-0.5 * off**2))


def outer(values: Floats) -> Floats:
    """Return the covariance (k, k) of a function known up to its size, root mean square one over the nodes."""
    unit = values / max(rms(values), 1e-300)
    return np.outer(unit, unit)


def slope(nodes: Floats) -> Floats:
    """Return the covariance (k, k) of a straight line through zero in the middle of the nodes."""
    return outer(nodes - 0.5 * (nodes[0] + nodes[-1]))


def smooth_kernels(
    nodes: Floats, *, shares: Sequence[float] = (0.5, 0.25, 0.12, 0.06), line: bool = False
) -> tuple[Kernel, ...]:
    """Return smooth kernels whose lengths are shares of the nodes' range; with ``line`` each has a slope beside it.

    A few nodes that lie far off, beyond the record, do not make the range longer.
    """
    spacing = usual_step(nodes)
    span = spacing * (len(nodes) - 1)
    beside = slope(nodes) if line else np.zeros((len(nodes), len(nodes)))
    lengths = [share * span for share in shares if share * span >= spacing]
    return tuple(
        Kernel(f"smooth over {length:.3g}", beside + squared_exponential(nodes, length), smooth=True)
        for length in lengths
    )


def usual_kernels(forms: Sequence[tuple[str, Floats]]) -> tuple[Kernel, ...]:
    """Return kernels of usual forms, each known up to its size."""
    return tuple(Kernel(name, outer(values), smooth=False) for name, values in forms)
