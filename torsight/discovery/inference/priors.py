"""Cost of departing from a value that was measured beforehand.

A characterised value may be off by its standard deviation, and now and then it is simply wrong: a mistyped digit, a
test that failed. Its prior is therefore a mixture of a narrow normal distribution and a small share of a wide one,

.. math:: p(z) ∝ (1 − ε) e^{−z²/2} + (ε/s) e^{−z²/(2 s²)}

z distance from the mean in standard deviations. Near the mean the cost is z²; far from it the cost levels off at that
of one wrong value. So an effect gains little if it only explains a single wrong value, but much if it returns several
values together to their measured ones. Source: contaminated normal distribution, Tukey (1960), in Contributions to
Probability and Statistics.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from torsight.core.units import Floats
from torsight.discovery.inference.fitting import Fit, space_of
from torsight.discovery.interface import Problem

_WRONG_SHARE: Final = 0.02
"""Share of declared values that are wrong altogether: 1 to 10 % of data are (Hampel et al., Robust Statistics (1986)
section 1.2c); values that were measured with care, and recorded with their uncertainty, are at the lower end."""
_WRONG_SIGMAS: Final = 10.0
"""Error of such a value in its standard deviations: as of a digit mistaken by one decimal place. A choice."""


def _log_densities(sigmas: Floats | float) -> tuple[Floats, Floats]:
    """Return the logarithms of the narrow and of the wide part of the mixture at a distance, up to one constant."""
    square = np.asarray(sigmas, np.float64) ** 2
    narrow = np.log1p(-_WRONG_SHARE) - 0.5 * square
    return narrow, np.log(_WRONG_SHARE / _WRONG_SIGMAS) - 0.5 * square / _WRONG_SIGMAS**2


def outlier_cost(sigmas: Floats) -> Floats:
    """Return minus twice the logarithm of the density at a distance, relative to that at the mean."""
    return np.asarray(2.0 * (np.logaddexp(*_log_densities(0.0)) - np.logaddexp(*_log_densities(sigmas))))


def outlier_precision(sigmas: Floats) -> Floats:
    """Return the precision of the normal distribution, of the same mean, that replaces the mixture at a distance.

    It is half the slope of :func:`outlier_cost` over the distance, as in iteratively reweighted least squares.
    """
    narrow, wide = _log_densities(sigmas)
    share = np.exp(wide - np.logaddexp(narrow, wide))
    return np.asarray((1.0 - share) + share / _WRONG_SIGMAS**2)


def prior_cost(problem: Problem, fit: Fit) -> float:
    """Return the cost of a fit's distance from all priors; only base values can be simply wrong."""
    return prior_cost_of(space_of(fit.parameters).prior_residual(fit.solution.x), len(problem.parameters))


def prior_cost_of(sigmas: Floats, base: int) -> float:
    """Return the cost of distances in standard deviations, of which the first ``base`` are base values."""
    return float(np.sum(outlier_cost(sigmas[:base])) + np.sum(sigmas[base:] ** 2))
