"""A model that is a sum of known columns: linear drives, calibration lines, loops drawn by splines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from torsight.core.parameter import Parameter
from torsight.discovery.interface import Candidate

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class LinearProblem:
    """A :class:`torsight.discovery.interface.Problem` whose model is Σ parameter · column.

    Attributes
    ----------
    columns : mapping of str to (n,) array
        Column of every parameter, of the base model and of the candidates.
    parameters, candidates, time_s, observed, sigma, valid, block, rest, drivers, resolution
        As in the protocol.
    """

    columns: Mapping[str, Array]
    parameters: tuple[Parameter, ...]
    candidates: tuple[Candidate, ...]
    time_s: Array
    observed: Array
    sigma: Array
    valid: NDArray[np.bool_]
    block: NDArray[np.int64]
    rest: NDArray[np.bool_]
    drivers: Mapping[str, Array] = field(default_factory=dict)
    resolution: float = 0.0

    def predict(self, values: Mapping[str, float], effects: Sequence[str]) -> Array:
        """Return Σ value · column over the base and the named effects."""
        names = [p.name for p in self.parameters]
        names += [p.name for c in self.candidates if c.id in effects for p in c.parameters]
        total = np.zeros(len(self.observed))
        for name in names:
            total += values[name] * self.columns[name]
        return total

    def input_noise(self, values: Mapping[str, float], effects: Sequence[str]) -> Array:
        """Return zeros: the columns are known."""
        del values, effects
        return np.zeros(len(self.observed))


def linear_problem(
    observed: Array,
    base: Mapping[str, Array],
    candidates: Mapping[str, Mapping[str, Array]],
    *,
    time_s: Array,
    block: NDArray[np.int64],
    drivers: Mapping[str, Array],
    sigma: float,
    resolution: float = 0.0,
    families: Mapping[str, str] | None = None,
) -> LinearProblem:
    """Build a linear problem from its columns.

    Parameters
    ----------
    observed : (n,) array
        Measured values; NaN where a sample does not count.
    base : mapping
        Parameter name to column (n,).
    candidates : mapping
        Effect id to its columns by parameter name; all vanish at zero.
    time_s, block, drivers
        As in the protocol.
    sigma, resolution : float
        Reading noise, and the size of a difference that nobody would miss, in units of ``observed``.
    families : mapping, optional
        Effect id to its family.
    """
    measured = observed[np.isfinite(observed)]
    size = float(np.std(measured)) if len(measured) else 1.0

    def parameter(name: str, column: Array, *, null: float | None) -> Parameter:
        typical = float(np.sqrt(np.mean(column**2)))
        scale = 0.1 * size / typical if typical > 0.0 else 1.0
        return Parameter(name, scale if null is not None else 0.0, "", null=null)

    effects = tuple(
        Candidate(
            name,
            (families or {}).get(name, ""),
            tuple(parameter(key, column, null=0.0) for key, column in columns.items()),
        )
        for name, columns in candidates.items()
    )
    return LinearProblem(
        columns={**base, **{key: column for columns in candidates.values() for key, column in columns.items()}},
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
