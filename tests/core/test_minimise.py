"""Least squares by SciPy's MINPACK, loaded without the rest of ``scipy.optimize``."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from scipy import optimize

from torsight.core import minimise
from torsight.core.minimise import least_squares


def test_a_straight_line() -> None:
    x = np.linspace(0, 1, 20)
    y = 3.0 * x - 1.0 + np.random.default_rng(0).normal(0, 0.1, 20)
    values, covariance, chi_squared = least_squares(lambda p: (p[0] * x + p[1] - y) / 0.1, np.zeros(2))
    expected, residual, *_ = np.linalg.lstsq(np.stack((x, np.ones(20)), axis=1), y, rcond=None)
    assert values == pytest.approx(expected, abs=1e-7)
    assert chi_squared == pytest.approx(residual[0] / 0.01, rel=1e-9)
    design = np.stack((x, np.ones(20)), axis=1) / 0.1
    assert covariance == pytest.approx(np.linalg.inv(design.T @ design), rel=1e-6)


def test_the_same_as_by_scipy_itself() -> None:
    def rosenbrock(x: np.ndarray) -> np.ndarray:
        return np.array([10.0 * (x[1] - x[0] ** 2), 1.0 - x[0], 0.1 * x[2] - 1e-3, x[2] * x[0]])

    start = np.array([-1.2, 1.0, 3.0])
    values, covariance, chi_squared = least_squares(rosenbrock, start)
    theirs = optimize.least_squares(rosenbrock, start, method="lm")
    assert np.allclose(values, theirs.x, atol=1e-8)
    assert np.isclose(chi_squared, 2.0 * theirs.cost)
    assert np.allclose(covariance, np.linalg.pinv(theirs.jac.T @ theirs.jac), rtol=1e-4, atol=1e-7)
    assert (start == [-1.2, 1.0, 3.0]).all()


def test_it_loads_minpack_alone_and_scipy_still_loads_after_it() -> None:
    code = """
import sys, numpy as np
from torsight.core.minimise import least_squares
least_squares(lambda p: p - 1.0, np.zeros(1))
print("scipy.optimize" in sys.modules)
from scipy.optimize import leastsq
print(leastsq(lambda p: p - 1.0, [0.0])[0])
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "[1.]"]


def test_without_the_extension_scipy_s_public_function_leads_to_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    def residuals(p: np.ndarray) -> np.ndarray:
        return np.array([p[0] - 1.0, 2.0 * p[1] + p[0], p[1] - 0.3])

    own = least_squares(residuals, np.zeros(2))

    def moved(_name: str) -> None:
        raise ModuleNotFoundError("no module named 'scipy.optimize._minpack'")

    monkeypatch.setattr(minimise, "scipy_extension", moved)
    for one, other in zip(own, least_squares(residuals, np.zeros(2)), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12)
