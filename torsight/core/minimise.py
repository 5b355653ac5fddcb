"""Least-squares fits of a few unknowns, with their covariance."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from torsight.core.lazy import scipy_extension
from torsight.core.units import Floats


def least_squares(residuals: Callable[[Floats], Floats], start: Floats) -> tuple[Floats, Floats, float]:
    """Minimise a sum of squares by the Levenberg-Marquardt method of SciPy's MINPACK, with derivatives by differences.

    ``start`` (p,) are the start values. Returns the values (p,), their covariance (p, p) as the inverse of JᵀJ, which
    is valid for residuals in units of their sigmas, and χ².
    """

    def slopes(values: Floats) -> Floats:
        return jacobian_of(residuals, values)

    found = _minimum(residuals, slopes, start)
    jacobian, error = slopes(found), residuals(found)
    return found, np.asarray(np.linalg.pinv(jacobian.T @ jacobian), np.float64), float(error @ error)


def _minimum(residuals: Callable[[Floats], Floats], slopes: Callable[[Floats], Floats], start: Floats) -> Floats:
    """Return the values (p,) at the minimum."""
    try:
        lmder = scipy_extension("scipy.optimize._minpack")._lmder  # noqa: SLF001
    except (ImportError, AttributeError):
        # SciPy's public function calls the same, and loads the rest of scipy.optimize.
        from scipy.optimize import leastsq

        return np.asarray(leastsq(residuals, start, Dfun=slopes)[0], np.float64)
    # As leastsq calls it: the least changes of the sum of squares and of the values, no limit for the gradient, the
    # most evaluations, the first step, and its scale.
    least = math.sqrt(np.finfo(np.float64).eps)
    limits = (least, least, 0.0, 100 * (len(start) + 1), 100.0, None)
    return np.asarray(lmder(residuals, slopes, start.copy(), (), True, False, *limits)[0], np.float64)


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
