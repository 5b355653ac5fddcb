"""Least-squares fits of a few unknowns, with their covariance."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from torsight.core.units import Floats


def least_squares(residuals: Callable[[Floats], Floats], start: Floats) -> tuple[Floats, Floats, float]:
    """Minimise a sum of squares by SciPy's Levenberg-Marquardt method, with derivatives by differences.

    ``start`` (p,) are the start values. Returns the values (p,), their covariance (p, p) as the inverse of JᵀJ, which
    is valid for residuals in units of their sigmas, and χ².
    """
    # Imported where it is needed: it takes a tenth of a second, which every command would pay.
    from scipy import optimize

    found = optimize.least_squares(residuals, start, method="lm", x_scale="jac")
    jacobian = np.asarray(found.jac, np.float64)
    return found.x, np.asarray(np.linalg.pinv(jacobian.T @ jacobian), np.float64), 2.0 * float(found.cost)


def jacobian_of(residuals: Callable[[Floats], Floats], values: Floats) -> Floats:
    """Return the Jacobian (m, p) of residuals (m,) at values (p,) by one-sided differences.

    With steps of a millionth of a value the second derivative contributes no more than rounding.
    """
    error = residuals(values)
    columns = []
    for index, value in enumerate(values):
        step = np.zeros_like(values)
        step[index] = 1e-6 * max(abs(value), 1e-2)
        columns.append((residuals(values + step) - error) / step[index])
    return np.stack(columns, axis=1)
