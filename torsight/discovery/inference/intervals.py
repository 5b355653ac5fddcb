"""How well an explanation's values are known.

Two things make a value uncertain: what the residual is worth (:mod:`.likelihood`), which is the curvature of the
posterior, and a model that is a little wrong in every block in another way, which shows when whole blocks are left out
(the jackknife; Efron and Stein, Ann. Statist. 9 (1981) 586).
"""

from __future__ import annotations

import numpy as np

from torsight.discovery.inference.explanation import Explanation
from torsight.discovery.inference.fitting import space_of
from torsight.discovery.inference.solver import Array
from torsight.discovery.inference.validate import block_labels


def covariance(explanation: Explanation) -> Array:
    """Return the parameters' covariance (m, m) with every value's own variance over the blocks added to it."""
    found = curvature_spread(explanation)
    plain = np.diag(found)
    widened = np.sqrt((plain + np.diag(_between_blocks(explanation))) / plain)
    return np.asarray(found * np.outer(widened, widened))


def joint_covariance(explanation: Explanation) -> Array:
    """Return the parameters' covariance (m, m) as predictions need it.

    Blocks that are left out move several values together, along valleys in which the model predicts the same: here that
    counts as it is. :func:`covariance`, which widens each value's own interval, would make such a valley a wide plain.
    """
    return curvature_spread(explanation) + _between_blocks(explanation)


def curvature_spread(explanation: Explanation) -> Array:
    """Return the covariance (m, m) by the posterior's curvature alone."""
    fit, weight = explanation.fit, explanation.fitter.weight
    space, derivative = space_of(fit.parameters), fit.solution.jacobian
    information = derivative.T @ weight.times(derivative)
    information[np.diag_indices_from(information)] += space.prior_information + 1e-12 / space.scale**2
    return np.asarray(np.linalg.inv(information))


def _between_blocks(explanation: Explanation) -> Array:
    """Return the jackknife's covariance (m, m) of the values over the blocks; zeros where there is one block only."""
    names = [p.name for p in explanation.fit.parameters]
    if len(block_labels(explanation.fitter.problem)) < 2:
        return np.zeros((len(names), len(names)))
    values = np.array([[fold[name] for name in names] for _, fold in explanation.held_out.folds])
    off = values - values.mean(axis=0)
    return np.asarray((len(values) - 1) / len(values) * off.T @ off)
