"""The actuator's learned stand-in: made from what the model itself knows, so that it predicts later records too.

The engine's stand-in says which variables count and how the parameters move. Here its weights are fitted again over the
same variables taken from the model's own angle in place of the measured one: a later record has no other.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from torsight.actuator.drive import Drive
from torsight.actuator.model import Simulation
from torsight.core.errors import InputError
from torsight.core.units import DEG
from torsight.discovery.actuator_problem import ActuatorProblem, rest_mask
from torsight.discovery.drivers import actuator_drivers
from torsight.discovery.features import Basis
from torsight.discovery.fitting import Fit, space_of
from torsight.discovery.interface import Closure

Array = NDArray[np.float64]


def actuator_closure(
    problem: ActuatorProblem, fit: Fit, closure: Closure, weight: Array
) -> tuple[dict[str, float], dict[str, Any]]:
    """Return the model's values with the stand-in, and the stand-in as the model file holds it."""
    space = space_of(fit.parameters)
    moved = space.clip(fit.solution.x + np.array([closure.shift[p.name] for p in fit.parameters]))
    values = {p.name: float(value) for p, value in zip(fit.parameters, moved, strict=True)}
    simulation = problem.simulate(values, fit.effects)
    features = _features(closure.bases, problem.drive, simulation)[problem.rows]
    left = np.where(weight > 0.0, problem.observed - simulation.angle_rad[problem.rows] / DEG, 0.0)
    weighted = features * weight[:, None]
    matrix = weighted.T @ features + closure.ridge * np.eye(features.shape[1])
    weights = np.linalg.solve(matrix, weighted.T @ left)
    return values, {
        "bases": [basis.to_json() for basis in closure.bases],
        "weights_deg": weights.tolist(),
        "drivers": [list(item) for item in closure.drivers],
        "held_out_gain": closure.held_out_gain,
        "learned": True,
    }


def correction_rad(closure: Mapping[str, Any], drive: Drive, simulation: Simulation) -> Array:
    """Return what a learned stand-in of a model file adds to a simulated angle (n,), rad.

    Raises
    ------
    InputError
        When the file's stand-in is damaged: a number that is none, an unknown variable, too many or too few weights.
    """
    try:
        bases = tuple(
            Basis(str(item["driver"]), tuple(float(knot) for knot in item["knots"]), bool(item["signed"]))
            for item in closure["bases"]
        )
        weights_deg = np.array(closure["weights_deg"], np.float64)
        features = _features(bases, drive, simulation)
        correction = np.asarray(features @ weights_deg * DEG)
    except (KeyError, TypeError, ValueError, AttributeError, IndexError, OverflowError) as error:
        raise _damaged(f"{type(error).__name__}: {error}") from error
    numbers = [knot for basis in bases for knot in basis.knots] + weights_deg.ravel().tolist()
    if correction.shape != (len(drive),) or not np.isfinite(numbers).all():
        raise _damaged("numbers that are not finite, or weights in rows")
    return correction


def _damaged(detail: str) -> InputError:
    return InputError(f"the model's learned stand-in is damaged ({detail})", where="closure", do="fit the record again")


def _features(bases: tuple[Basis, ...], drive: Drive, simulation: Simulation) -> Array:
    angle_deg = simulation.angle_rad / DEG
    rest = rest_mask(drive.time_s, angle_deg, np.isfinite(angle_deg))
    drivers = actuator_drivers(drive, np.arange(len(drive)), angle_deg, rest)
    return np.column_stack([basis.columns(drivers) for basis in bases])
