"""The record and the free parameters of a fit as a least-squares problem in scaled form."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from torsight.actuator.drive import Drive
from torsight.actuator.model import ActuatorModel
from torsight.actuator.record.weights import row_sigma
from torsight.core.parameter import Parameter

Array = NDArray[np.float64]

_STEP: Final = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class ScaledParameters:
    """Free parameters in scaled form: value = centre + scale · u.

    Attributes
    ----------
    parameters : tuple of Parameter
        Their values are the centre, and with a ``sigma`` a prior.
    scale : (p,) float64
        A change of each that matters.
    """

    parameters: tuple[Parameter, ...]
    scale: Array

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the free parameters."""
        return tuple(parameter.name for parameter in self.parameters)

    @property
    def _centre(self) -> Array:
        return np.array([parameter.value for parameter in self.parameters])

    def values(self, u: Array) -> dict[str, float]:
        """Return the free parameters by name, in their own units."""
        return dict(zip(self.names, (self._centre + self.scale * u).tolist(), strict=True))

    def scaled(self, values: Mapping[str, float]) -> Array:
        """Return the scaled form of a start; parameters that it does not name stay at their own value."""
        given = np.array([values.get(parameter.name, parameter.value) for parameter in self.parameters])
        return (given - self._centre) / self.scale

    def bounds(self) -> tuple[Array, Array]:
        """Return the bounds in scaled form."""
        lower, upper = np.array([(p.lower, p.upper) for p in self.parameters]).T
        return (lower - self._centre) / self.scale, (upper - self._centre) / self.scale

    def prior(self) -> Array:
        """Return, per parameter, how much one scaled unit is worth to the prior (0 without one)."""
        sigma = [math.inf if p.sigma is None else p.sigma for p in self.parameters]
        return np.asarray(self.scale / np.array(sigma), np.float64)


@dataclass(frozen=True, slots=True, eq=False)
class Problem(ScaledParameters):
    """The record and the free parameters.

    Attributes
    ----------
    model : ActuatorModel
        What is fitted.
    drive : Drive
        The record.
    counted : (n,) bool
        Rows that count.
    noisy : tuple of Drive
        The record with temperatures that are off by what may be left of their noise.
    """

    model: ActuatorModel
    drive: Drive
    counted: NDArray[np.bool_]
    noisy: tuple[Drive, ...]

    def row_sigma(self, u: Array) -> Array:
        """Return every row's standard deviation at these values."""
        values = self.values(u)
        angle = self.model.simulate(self.drive, values).angle_rad
        off = [self.model.simulate(drive, values).angle_rad - angle for drive in self.noisy]
        return row_sigma(self.drive, angle, np.array(off).reshape(-1, len(angle)))

    def misfit(self, u: Array, weight: Array) -> Array:
        """Return weighted residuals of the rows that count, and distances from the priors in their sigmas."""
        angle = self.model.simulate(self.drive, self.values(u)).angle_rad
        residual = ((angle - self.drive.angle_rad) * weight)[self.counted]
        return np.concatenate([residual, self.prior() * u])

    def jacobian(self, u: Array, weight: Array) -> Array:
        """Return the misfit's derivatives, by differences that are large against the stepping's tolerance."""
        here = self.misfit(u, weight)
        columns = [(self.misfit(u + _STEP * unit, weight) - here) / _STEP for unit in np.eye(len(u))]
        return np.stack(columns, axis=1)
