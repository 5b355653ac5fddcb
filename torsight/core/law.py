r"""A law: a smooth function of one variable at one port of a model, represented by values on nodes.

The part that a model lacks need not have a known parametric form. A law is a function with a Gaussian prior of zero
mean, represented by its values :math:`f` on nodes of its variable. The prior is a bank of kernels :math:`s^2 K_j`: a
few usual forms (a constant, a slope, a wave once per turn) and smooth functions of several lengths. Kernel and size
:math:`s` are selected by marginal likelihood, which penalises a law for its flexibility (Rasmussen and Williams,
Gaussian Processes for Machine Learning (2006), ch. 5).
"""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from torsight.core.parameter import Parameter
from torsight.core.series import rms, usual_step
from torsight.core.units import Flags, Floats

TIME = "time_s"
"""The driver for the record's own time."""
KEPT = 1e-5
"""Share of a kernel's largest eigenvalue below which a direction of the law is left out: a third of a per cent of its
size."""
LENGTHS = (0.5, 0.25, 0.12, 0.06)
"""Lengths of a law's smooth functions as shares of its range, each half the one before."""


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
    """A law that a model may lack: its port, its driver, the spring (``a``, ``b``, ``both`` or empty) and its prior.

    The ``id``, unique among laws and effects of a problem, begins the names of its parameters; ``unit`` is that of its
    values, ``title`` a few plain words (``"friction over the angle"``). ``nodes`` (k,) are increasing values of the
    driver, ``scale`` is a size of the law that matters, in ``unit``: it sets the steps of derivatives, and the middle
    of the tried sizes. ``kernels`` are the bank of the prior, which a law has beyond ``covered``, the range of the
    driver that the record covers.

    ``time_like``: the driver only counts time or cycles; such a law shows when something changed, not why, and does not
    hold for later times. The drift of a clock over time is its own cause, and no such law.
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
        """Whether this is a law of time, which shows when something differs, not why: a reference, no explanation."""
        return self.time_like and self.driver == TIME

    def free(self) -> LawForm:
        """Return the law with its values on the nodes as parameters."""
        return LawForm(self.id, self.nodes, np.eye(len(self.nodes)), self.unit, self.scale, prior=False)

    @property
    def reached(self) -> Flags:
        """Mask (k,) of the nodes that the record informs: those within the covered range or next to it."""
        low, high = self.covered
        following, before = np.append(self.nodes[1:], np.inf), np.append(-np.inf, self.nodes[:-1])
        return np.asarray((following > low) & (before < high))

    def form(self, kernel: Kernel, size: float) -> LawForm:
        """Return the law under one kernel of one size as independent coefficients with standard deviation one.

        The first coefficients are those of the nodes that the record reaches. The conditional covariance of the other
        nodes has its own coefficients, which the record does not determine, so that beyond the record a law is as
        uncertain as its prior.
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
    """Return B (k, r) with B Bᵀ = ``covariance``, and the inverse of Bᵀ on its span, without negligible directions."""
    share, directions = np.linalg.eigh(covariance)
    kept = np.flatnonzero(share > KEPT * largest)[::-1]
    root = np.sqrt(share[kept])
    return directions[:, kept] * root, directions[:, kept] / root


@functools.cache
def _names(law: str, count: int) -> tuple[str, ...]:
    return tuple(f"{law}@{i:02d}" for i in range(count))


@dataclass(frozen=True, slots=True, eq=False)
class LawForm:
    """A law in terms of parameters: its values on the nodes (k,) are ``basis`` (k, r) @ parameters, in its unit.

    With a ``prior`` the parameters are standard normal; without one they are the values on the nodes.
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

    def values(self, of: Mapping[str, float]) -> Floats:
        """Return the law's values on its nodes (k,), from a model's values, among them those of its parameters."""
        return np.asarray(self.basis @ np.array([of[name] for name in self.names], np.float64))

    def to_json(self) -> dict[str, Any]:
        """Return the form's entry in ``model.json``."""
        lists = {"nodes": self.nodes.tolist(), "basis": self.basis.tolist()}
        return {"id": self.id, **lists, "unit": self.unit, "scale": self.scale}


def smooth_between(nodes: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Return a smooth curve through values on nodes (k,) as points and values for linear interpolation.

    The curve is a natural cubic spline: lines between the nodes themselves would cut a wave of five nodes a period by a
    sixth. The spline oscillates where the curve bends within a gap, so that the nodes must lie closer than that.
    """
    if len(nodes) < 2:
        return nodes, values
    places, spline = _spline(np.asarray(nodes, np.float64).tobytes())
    return places, spline @ values


@functools.lru_cache(maxsize=256)
def _spline(nodes: bytes) -> tuple[Floats, Floats]:
    """Return points (m,) between nodes, and the matrix (m, k) from the nodes' values to the spline's values there.

    Eight points per gap between nodes reduce the error of linear interpolation to a sixty-fourth.
    """
    # Imported here: commands without a law need neither it nor scipy.optimize, which it imports.
    from scipy.interpolate import CubicSpline

    at, finer = np.frombuffer(nodes), 8
    gaps = np.arange(finer * (len(at) - 1) + 1) / finer
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
    """Return the covariance (k, k) of a straight line that is zero in the middle of the nodes."""
    return outer(nodes - 0.5 * (nodes[0] + nodes[-1]))


def smooth_kernels(nodes: Floats, *, shares: Sequence[float] = LENGTHS, line: bool = False) -> tuple[Kernel, ...]:
    """Return smooth kernels whose lengths are shares of the nodes' range; ``line`` adds a slope to each.

    A few distant nodes beyond the record do not extend this range. Lengths below the distance of two nodes are omitted.
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
