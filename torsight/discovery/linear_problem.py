"""A model that is a sum of known columns: linear drives, calibration lines, loops represented by splines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final, Self

import numpy as np

from torsight.core.errors import InputError
from torsight.core.law import Kernel, Law, LawForm, slope, smooth_kernels
from torsight.core.parameter import Parameter
from torsight.core.series import rms
from torsight.core.units import Floats, Ints
from torsight.discovery.interface import Candidate, GivenProblem


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class LinearProblem(GivenProblem):
    """A :class:`torsight.discovery.interface.Problem` whose model is Σ parameter · column.

    Attributes
    ----------
    columns : mapping of str to (n,) array
        Column of every parameter, of the plain model and of the candidates.
    """

    columns: Mapping[str, Floats]

    @cached_property
    def laws(self) -> tuple[Law, ...]:
        """Laws that are added to the output, one over each driver."""
        size = float(np.std(self.observed[self.valid])) if self.valid.any() else 1.0
        found = (law_over(name, driver[self.valid], size) for name, driver in self.drivers.items())
        return tuple(law for law in found if law is not None)

    def with_laws(self, forms: Sequence[LawForm]) -> Self:
        """Return the problem with these forms of laws among its candidates, and their columns."""
        columns = dict(self.columns)
        for form in forms:
            at_rows = np.column_stack([np.interp(self.drivers[form.id], form.nodes, one) for one in form.basis.T])
            columns |= dict(zip(form.names, at_rows.T, strict=True))
        return replace(super().with_laws(forms), columns=columns)

    def predict(self, values: Mapping[str, float], effects: Sequence[str]) -> Floats:
        """Return Σ value · column over the base and the named effects."""
        names = [p.name for p in self.parameters]
        names += [p.name for c in self.candidates if c.id in effects for p in c.parameters]
        total = np.zeros(len(self.observed))
        for name in names:
            total += values[name] * self.columns[name]
        return total


_NODES: Final = 25
"""Nodes of a law: a wave needs five nodes per period, so that five periods fit into a driver's range."""
LAW_SHARE: Final = 0.03
"""Size of a law that matters, as a share of the output's size."""
_TIME_LIKE: Final = ("time_s", "cycle")


def law_over(name: str, driver: Floats, size: float) -> Law | None:
    """Return the law over a driver that is added to an output of this size; None where the driver does not change."""
    places = np.unique(driver)
    if len(places) < 2:
        return None
    nodes = places if len(places) < _NODES else np.linspace(float(places[0]), float(places[-1]), _NODES)
    smooth = smooth_kernels(nodes, line=True) if len(nodes) > 2 else ()
    kernels = (Kernel("slope", slope(nodes), smooth=False), *smooth)
    scale = LAW_SHARE * size
    return Law(name, "output", name, "", f"the output over {name}", nodes, scale, kernels, time_like=name in _TIME_LIKE)


def linear_problem(
    observed: Floats,
    base: Mapping[str, Floats],
    candidates: Mapping[str, Mapping[str, Floats]],
    *,
    time_s: Floats,
    block: Ints,
    drivers: Mapping[str, Floats],
    sigma: float,
    resolution: float = 0.0,
) -> LinearProblem:
    """Build a linear problem from its columns.

    Parameters
    ----------
    observed : (n,) array
        Measured values; NaN where a sample does not count.
    base : mapping
        Parameter name to column (n,).
    candidates : mapping
        Effect id to its columns by parameter name; an effect vanishes where its parameters are zero.
    time_s, block, drivers
        As in :class:`torsight.discovery.interface.Problem`.
    sigma, resolution : float
        Reading noise, and the size of a difference that does not matter, in units of ``observed``.
    """
    columns = {**base, **{key: own for some in candidates.values() for key, own in some.items()}}
    for name, own in {**columns, **drivers, "time_s": time_s, "block": block}.items():
        if np.shape(own) != np.shape(observed):
            raise InputError(
                "has another length than the measured values",
                where=f"linear_problem, '{name}'",
                value=np.shape(own),
                limit=str(np.shape(observed)),
                do="give one value per sample",
            )
    measured = observed[np.isfinite(observed)]
    size = float(np.std(measured)) if len(measured) else 1.0

    def parameter(name: str, column: Floats, *, null: float | None) -> Parameter:
        typical = rms(column)
        scale = 0.1 * size / typical if typical > 0.0 else 1.0
        return Parameter(name, scale if null is not None else 0.0, "", null=null)

    effects = tuple(
        Candidate(name, "", tuple(parameter(key, column, null=0.0) for key, column in own.items()))
        for name, own in candidates.items()
    )
    return LinearProblem(
        columns=columns,
        parameters=tuple(parameter(name, column, null=None) for name, column in base.items()),
        candidates=effects,
        time_s=time_s,
        observed=observed,
        sigma=np.full(len(observed), sigma),
        valid=np.isfinite(observed),
        block=block,
        rest=np.zeros(len(observed), bool),
        drivers=drivers,
        resolution=resolution,
    )
