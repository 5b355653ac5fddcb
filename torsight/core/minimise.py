"""A least-squares solver for a few unknowns, without the start-up time of a large library."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np

from torsight.core.units import Floats

_STEPS: Final = 60
"""Largest number of steps: a fit that still gains then creeps along a direction that no residual determines."""


def least_squares(
    residuals: Callable[[Floats], Floats], start: Floats, *, enough: float = 1e-20
) -> tuple[Floats, Floats, float]:
    """Minimise a sum of squares (Levenberg-Marquardt, derivatives by differences).

    ``start`` (p,) are the start values, ``enough`` is the gain of a step in χ² below which the iteration ends. Returns
    the values (p,), their covariance (p, p) as the inverse of JᵀJ, which is valid for residuals in units of their
    sigmas, and χ².
    """
    values, error = start.copy(), residuals(start)
    # Start value 0.001, changed by factors of ten, as in Press and others, Numerical Recipes (3rd edition), 15.5.2.
    damping = 1e-3
    for _ in range(_STEPS):
        jacobian = jacobian_of(residuals, values, error)
        normal, gradient = jacobian.T @ jacobian, jacobian.T @ error
        scale = np.diag(np.maximum(np.diag(normal), 1e-300))
        for _ in range(10):
            step = np.linalg.solve(normal + damping * scale, gradient)
            trial = residuals(values - step)
            if trial @ trial <= error @ error:
                break
            damping *= 10.0
        else:
            break
        gain = float(error @ error - trial @ trial)
        values, error, damping = values - step, trial, max(damping / 10.0, 1e-12)
        if gain <= 1e-12 * float(error @ error) + enough:
            break
    jacobian = jacobian_of(residuals, values, error)
    return values, np.asarray(np.linalg.pinv(jacobian.T @ jacobian), np.float64), float(error @ error)


def jacobian_of(residuals: Callable[[Floats], Floats], values: Floats, error: Floats | None = None) -> Floats:
    """Return the Jacobian (m, p) of residuals (m,) at values (p,) by one-sided differences.

    ``error`` (m,) are the residuals at the values, if known. With steps of a millionth of a value the second derivative
    contributes no more than rounding.
    """
    error = residuals(values) if error is None else error
    columns = []
    for index, value in enumerate(values):
        step = np.zeros_like(values)
        step[index] = 1e-6 * max(abs(value), 1e-2)
        columns.append((residuals(values + step) - error) / step[index])
    return np.stack(columns, axis=1)
