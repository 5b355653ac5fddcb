"""How well a fitted set's values are known.

Three things make a value uncertain: what the residual is worth (:mod:`.noise`), a model that is a little wrong in
every block in another way, and one that is a little wrong in all of them in the same way. The first is the curvature of
the objective, the second shows when whole blocks are left out (the jackknife), the third shows nowhere: it is taken to
be a smooth error of some resolutions of the problem, one for each direction of motion, that is fitted along.
"""

from __future__ import annotations

import numpy as np

from torsight.discovery.common import freed
from torsight.discovery.contenders import Contender, Field
from torsight.discovery.fitting import space_of
from torsight.discovery.noise import pieces
from torsight.discovery.solver import Array
from torsight.discovery.validate import block_labels


def covariance(field: Field, contender: Contender) -> Array:
    """Return the parameters' covariance (m, m), inflated for the residual's correlation.

    The weights already count pieces of information and not samples; what is added is the set's own residual where it
    is larger than the one that the weights come from. A model that is a little wrong moves its values from block to
    block by more than noise would: what leaving out whole blocks does to a value (the jackknife) is added to its
    variance. An error that all blocks share is fitted along, and by how far a value moves then is added, too.
    """
    found, moved = _curvature_and_common(field, contender)
    plain = np.diag(found)
    widened = np.sqrt((plain + np.diag(_between_blocks(field, contender)) + moved**2) / plain)
    return np.asarray(found * np.outer(widened, widened))


def joint_covariance(field: Field, contender: Contender) -> Array:
    """Return the parameters' covariance (m, m) as predictions need it.

    Blocks that are left out move several values together, along valleys in which the model predicts the same: here that
    counts as it is. :func:`covariance`, which widens each value's own interval, would make such a valley a wide plain.
    """
    found, _ = _curvature_and_common(field, contender)
    return found + _between_blocks(field, contender)


def _curvature_and_common(field: Field, contender: Contender) -> tuple[Array, Array]:
    """Return the covariance (m, m) with an error that all blocks share fitted along, and how far values move then."""
    fit, weight = contender.fit, field.fitter.weight
    residual = np.where(weight > 0.0, field.fitter.problem.observed - fit.solution.prediction, 0.0)
    inflation = max(1.0, float(weight @ residual**2) / max(1.0, pieces(field.stretches, field.scales)))
    picture, own = freed(field, contender), len(fit.parameters)
    information = picture.columns.T @ (picture.columns * weight[:, None]) / inflation + np.diag(picture.information)
    return np.asarray(np.linalg.inv(information)[:own, :own]), picture.moved[:own]


def curvature_spread(field: Field, contender: Contender) -> Array:
    """Return the covariance (m, m) by the objective's curvature alone."""
    space, derivative = space_of(contender.fit.parameters), contender.fit.solution.jacobian
    information = derivative.T @ (derivative * field.fitter.weight[:, None])
    information[np.diag_indices_from(information)] += space.prior_information + 1e-12 / space.scale**2
    return np.asarray(np.linalg.inv(information))


def _between_blocks(field: Field, contender: Contender) -> Array:
    """Return the jackknife's covariance (m, m) of the values over the blocks; zeros where there is one block only."""
    names = [p.name for p in contender.fit.parameters]
    if len(block_labels(field.fitter.problem)) < 2:
        return np.zeros((len(names), len(names)))
    values = np.array([[fold[name] for name in names] for _, fold in contender.held_out.folds])
    off = values - values.mean(axis=0)
    return np.asarray((len(values) - 1) / len(values) * off.T @ off)
