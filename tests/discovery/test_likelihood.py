"""The likelihood of a residual with shared errors, against the dense Gaussian that it stands for."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from torsight.discovery.inference.likelihood import Likelihood
from torsight.discovery.weight import Weight

ROWS, SHARED = 60, 3


@pytest.fixture
def drawn() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the noise of every sample, what shared errors do, and a residual drawn from both."""
    rng = np.random.default_rng(11)
    floor, shared = rng.uniform(0.5, 1.5, ROWS), rng.normal(0.0, 1.0, (ROWS, SHARED))
    return floor, shared, floor * rng.standard_normal(ROWS) + shared @ rng.standard_normal(SHARED)


def test_the_objective_is_that_of_the_dense_covariance(drawn: tuple[np.ndarray, np.ndarray, np.ndarray]) -> None:
    floor, shared, residual = drawn
    weight = Weight(1.0 / floor**2, shared)
    inverse = np.linalg.inv(np.diag(floor**2) + shared @ shared.T)
    assert weight.square(residual) == pytest.approx(residual @ inverse @ residual, rel=1e-10)
    assert weight.times(np.eye(ROWS)) == pytest.approx(inverse, abs=1e-10)
    # The posterior mean of the shared errors: their covariance with the residual times its inverse covariance.
    assert weight.errors(residual) == pytest.approx(shared.T @ inverse @ residual, abs=1e-10)


def test_the_likelihood_is_the_density_of_the_dense_gaussian(drawn: tuple[np.ndarray, np.ndarray, np.ndarray]) -> None:
    floor, shared, residual = drawn
    # A discrepancy of which the residual asks for none is the least one.
    residual, least = 0.3 * residual, 0.2
    likelihood = Likelihood(np.ones(ROWS), floor, np.zeros(ROWS, np.int8), 1.0, least, shared)
    assert likelihood.discrepancy(residual)[0] == pytest.approx(least)
    dense = multivariate_normal(np.zeros(ROWS), np.diag(floor**2 + least**2) + shared @ shared.T)
    expected = dense.logpdf(residual) + 0.5 * ROWS * np.log(2.0 * np.pi)
    assert likelihood.log(residual) == pytest.approx(expected, abs=1e-8)


def test_what_many_samples_share_is_no_discrepancy() -> None:
    rng = np.random.default_rng(5)
    shared = np.zeros((400, 1))
    shared[200:] = 1.0
    residual = 0.1 * rng.standard_normal(400) + 2.0 * shared[:, 0]
    floor, kind = np.full(400, 0.1), np.zeros(400, np.int8)
    apart = Likelihood(np.ones(400), floor, kind, 1.0, 0.01, shared)
    alone = Likelihood(np.ones(400), floor, kind, 1.0, 0.01, np.zeros((400, 0)))
    assert apart.discrepancy(residual)[0] < 0.05
    assert alone.discrepancy(residual)[0] == pytest.approx(np.sqrt(2.0), rel=0.05)
    # Half a nat for the logarithm of each sample's standard deviation, 1.4 against 0.1.
    assert apart.log(residual) - alone.log(residual) > 400.0 * np.log(1.4 / 0.11) - 30.0
    assert apart.left(residual)[200:].mean() == pytest.approx(0.0, abs=3.0 * 0.1 / np.sqrt(200))


def test_rows_that_are_cut_off_keep_their_shared_errors(drawn: tuple[np.ndarray, np.ndarray, np.ndarray]) -> None:
    floor, shared, residual = drawn
    weight = Weight(1.0 / floor**2, shared)
    rows = np.arange(ROWS) < 20
    inside = Weight(1.0 / floor[:20] ** 2, shared[:20])
    assert weight.only(rows).square(residual) == pytest.approx(inside.square(residual[:20]))
    assert weight.at(slice(0, 20)).square(residual[:20]) == pytest.approx(inside.square(residual[:20]))


def test_a_model_that_explodes_has_no_likelihood(drawn: tuple[np.ndarray, np.ndarray, np.ndarray]) -> None:
    """The search for the discrepancy's size has no upper end where a residual's square overflows."""
    floor, shared, residual = drawn
    likelihood = Likelihood(np.ones(ROWS), floor, np.zeros(ROWS, np.int8), 1.0, 0.1, shared)
    assert np.isfinite(likelihood.log(residual))
    residual[7] = 1e200
    assert likelihood.log(residual) == -np.inf
