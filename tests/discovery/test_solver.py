"""The solver against closed forms and another library."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import least_squares, lsq_linear

from torsight.discovery.inference.solver import Space, jacobian, sharpened, solve
from torsight.discovery.weight import Weight


def _space(m: int, *, lower: float = -np.inf, upper: float = np.inf, sigma: float = np.inf) -> Space:
    return Space(
        lower=np.full(m, lower),
        upper=np.full(m, upper),
        scale=np.ones(m),
        prior_mean=np.zeros(m),
        prior_sigma=np.full(m, sigma),
    )


def test_linear_with_priors_is_the_normal_equations_solution() -> None:
    rng = np.random.default_rng(1)
    columns = rng.standard_normal((60, 4))
    y = columns @ np.array([1.0, -2.0, 0.5, 3.0]) + 0.1 * rng.standard_normal(60)
    weight = rng.uniform(0.5, 2.0, 60)
    found = solve(lambda x: columns @ x, np.zeros(4), observed=y, weight=Weight.of(weight), space=_space(4, sigma=0.7))
    matrix = columns.T @ (columns * weight[:, None]) + np.eye(4) / 0.49
    expected = np.linalg.solve(matrix, columns.T @ (weight * y))
    assert found.converged
    # The search ends where a step promises less than 1e-4 units of information.
    assert np.allclose(found.x, expected, atol=1e-2 / np.sqrt(np.linalg.eigvalsh(matrix)[0]))


def test_bounds_agree_with_another_solver() -> None:
    rng = np.random.default_rng(2)
    columns = rng.standard_normal((80, 5))
    y = 20.0 * columns @ np.array([2.0, -2.0, 0.2, 0.0, -0.1])
    found = solve(
        lambda x: columns @ x,
        np.zeros(5),
        observed=y,
        weight=Weight.of(np.ones(80)),
        space=_space(5, lower=-1.0, upper=1.0),
    )
    expected = lsq_linear(columns, y, bounds=(-1.0, 1.0)).x
    assert np.allclose(found.x, expected, atol=2e-2)


def test_nonlinear_agrees_with_another_solver() -> None:
    t = np.linspace(0.0, 4.0, 100)
    rng = np.random.default_rng(3)
    y = 2.0 * np.exp(-0.7 * t) + 0.3 + 0.01 * rng.standard_normal(100)

    def model(x: np.ndarray) -> np.ndarray:
        return np.asarray(x[0] * np.exp(-x[1] * t) + x[2])

    found = solve(
        model, np.ones(3), observed=y, weight=Weight.of(np.full(100, 1e4)), space=_space(3), max_iterations=40
    )
    expected = least_squares(lambda x: (model(x) - y) * 100.0, np.ones(3))
    assert found.cost == pytest.approx(2.0 * expected.cost, abs=0.05)
    sigma = np.sqrt(np.diag(np.linalg.inv(expected.jac.T @ expected.jac)))
    assert np.all(np.abs(found.x - expected.x) < 0.2 * sigma)


def test_a_known_solution_is_gone_on_from_without_evaluations() -> None:
    columns = np.eye(3)
    calls = 0

    def model(x: np.ndarray) -> np.ndarray:
        nonlocal calls
        calls += 1
        return columns @ x

    first = solve(model, np.zeros(3), observed=np.arange(3.0), weight=Weight.of(np.ones(3)), space=_space(3))
    calls = 0
    again = solve(model, first, observed=np.arange(3.0), weight=Weight.of(np.full(3, 2.0)), space=_space(3))
    assert calls == 0
    assert np.allclose(again.x, first.x)


def test_derivatives_at_an_upper_bound_point_inwards() -> None:
    space = _space(1, upper=1.0)
    seen: list[float] = []

    def model(x: np.ndarray) -> np.ndarray:
        seen.append(float(x[0]))
        return 3.0 * x

    derivative = jacobian(model, np.ones(1), at_x=np.full(1, 3.0), space=space)
    assert max(seen) <= 1.0
    assert derivative[0, 0] == pytest.approx(3.0)


def test_samples_without_weight_may_be_nan() -> None:
    y = np.array([1.0, np.nan, 3.0])
    found = solve(
        lambda x: np.full(3, x[0]),
        np.zeros(1),
        observed=y,
        weight=Weight.of(np.array([1.0, 0.0, 1.0])),
        space=_space(1),
    )
    assert found.x[0] == pytest.approx(2.0, abs=1e-2)


def test_a_value_on_a_kink_does_not_hold_up_the_others() -> None:
    def model(x: np.ndarray) -> np.ndarray:
        # What moves the first sample down is worth most, and nothing does: it turns where the second value is 1.
        return np.array([10.0 * abs(x[1] - 1.0) + x[0], x[0], x[0]])

    y = np.array([-3.0, 2.0, 2.0])
    found = solve(model, np.array([0.0, 1.0]), observed=y, weight=Weight.of(np.ones(3)), space=_space(2, sigma=10.0))
    # With the second value on its kink the first one is the mean, drawn to zero by its prior.
    assert found.x == pytest.approx([1.0 / 3.01, 1.0], abs=1e-3)


def test_what_two_parameters_share_is_known_as_their_priors_have_it() -> None:
    # A model with kinks of the sum of two parameters; derivatives are taken by steps of unlike lengths.
    places = np.linspace(0.0, 1.0, 400)

    def model(x: np.ndarray) -> np.ndarray:
        return np.asarray(0.05 * np.abs(np.mod(places + x[0] + x[1], 0.02) - 0.01) + 3.0 * (x[0] + x[1]))

    space = Space(
        lower=np.full(2, -9.0),
        upper=np.full(2, 9.0),
        scale=np.array([0.4, 0.03]),
        prior_mean=np.zeros(2),
        prior_sigma=np.array([0.4, 1.0]),
    )
    weight = Weight.of(np.full(400, 1e5))
    found = solve(model, np.array([0.1, 0.1]), observed=model(np.array([0.1, 0.2])), weight=weight, space=space)

    def spread(derivative: np.ndarray) -> float:
        information = derivative.T @ (1e5 * derivative) + np.diag(space.prior_information)
        return float(np.sqrt(np.linalg.inv(information)[0, 0]))

    # Of the sum nothing is left open: of the first both priors together, 0.4 and 1.0.
    expected = 0.4 / np.hypot(0.4, 1.0)
    assert spread(found.jacobian) < 0.3 * expected
    better = sharpened(model, found, weight=weight, space=space)
    assert spread(better.jacobian) == pytest.approx(expected, rel=0.02)


def test_the_factor_of_the_information_is_that_of_the_normal_equations_and_real_where_these_are_not():
    rng = np.random.default_rng(2)
    columns, shared, each = rng.normal(size=(60, 3)), rng.normal(size=(60, 2)), rng.uniform(0.5, 2.0, 60)
    weight, prior = Weight(each, shared), np.array([1e-6, 0.1, 2.0])
    factor = weight.factor(columns, prior)
    np.testing.assert_allclose(factor.T @ factor, weight.normal(columns) + np.diag(prior), rtol=1e-12)
    # Values that act as shared errors of great size: what is left is the prior, and the information of the errors.
    mix = rng.normal(size=(3, 3))
    hidden = Weight(each, 1e9 * columns @ mix)
    factor = hidden.factor(1e6 * columns, prior)
    left = np.diag(prior) + 1e-6 * np.linalg.inv(mix @ mix.T)
    np.testing.assert_allclose(factor.T @ factor, left, rtol=1e-4, atol=1e-9)
    assert np.linalg.eigvalsh(hidden.normal(1e6 * columns) + np.diag(prior))[0] < 0.0
