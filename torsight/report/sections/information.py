r"""Effect of a further measurement on the interval of a value, from the covariance of a fit alone.

A fit adds the record's information to what was characterised before, :math:`P^{-1} = I + S`, with :math:`P` the
covariance of the fitted values, :math:`S` diagonal with :math:`1/σ^2` of the characterised ones, and :math:`I` the
record's own information. A record :math:`k` times as long holds :math:`k I`; a value characterised :math:`m` times as
well has :math:`m^2/σ^2`. The interval after a measurement that has not been made follows from these known matrices,
with all correlations, for a linear model and independent noise.
Source: e.g. Pukelsheim, Optimal Design of Experiments (2006), ch. 3.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from torsight.core.units import Floats

TIMES: Final = (2, 3, 4, 6, 8, 16)
"""Lengths of the whole record that are tried, in lengths of this record."""
SHARPER: Final = (2.0, 3.0, 4.0)
"""Factors by which the uncertainty of one characterised value may be reduced."""


@dataclass(frozen=True, slots=True)
class Measure:
    """A further measurement, and the width of an interval after it, relative to today's width.

    ``factor`` is the factor by which the value of this ``name`` is characterised better, or, without a name, by which
    the record is longer.
    """

    name: str
    factor: float
    ratio: float

    @property
    def halves(self) -> bool:
        """Whether the ratio is printed as half."""
        return round(self.ratio, 2) <= 0.5


def best_measures(
    target: str, names: Sequence[str], covariance: Floats, prior_sigma: Sequence[float | None]
) -> tuple[Measure, Measure | None]:
    """Return the longer record and the best single characterisation that narrow the interval of one of the ``names``.

    These are the shortest record, and the least demanding characterisation, that halve the interval; where none of
    those tried halves it, the one that narrows it most. The characterisation is None where no value was characterised
    with an uncertainty (all of the prior's sigmas are None).
    """
    place = list(names).index(target)
    size = np.sqrt(np.diag(covariance))
    size = np.where(size > 0.0, size, 1.0)
    prior = np.array([0.0 if sigma is None else (s / sigma) ** 2 for sigma, s in zip(prior_sigma, size, strict=True)])
    own = _record_information(covariance / np.outer(size, size), prior)

    def ratio(times: float, known: Floats) -> float:
        now, then = (
            np.linalg.pinv(information) for information in (own + np.diag(prior), times * own + np.diag(known))
        )
        return float(np.sqrt(then[place, place] / now[place, place]))

    longer = _first([Measure("", float(times), ratio(times, prior)) for times in TIMES])
    tried = []
    for other in np.flatnonzero(prior).tolist():
        steps = [np.where(np.arange(len(prior)) == other, prior * m**2, prior) for m in SHARPER]
        tried.append(_first([Measure(names[other], m, ratio(1.0, s)) for m, s in zip(SHARPER, steps, strict=True)]))
    return longer, min(tried, key=lambda one: (0.5 if one.halves else one.ratio, one.factor, one.ratio), default=None)


def _first(measures: Sequence[Measure]) -> Measure:
    """Return the least measure that halves the interval, or the one that narrows it most."""
    return next((one for one in measures if one.halves), measures[-1])


def _record_information(correlation: Floats, prior: Floats) -> Floats:
    """Return the record's own information matrix; it is zero along directions that the priors already determine."""
    values, axes = np.linalg.eigh(np.linalg.pinv(correlation) - np.diag(prior))
    return np.asarray((axes * np.maximum(values, 0.0)) @ axes.T)
