r"""What a residual is worth: a Gaussian likelihood whose noise is inferred and whose neighbours are correlated.

.. math:: \log L = -\tfrac12 \sum_i c_i \left( \frac{r_i^2}{s^2 + n_i^2} + \log (s^2 + n_i^2) \right)

r residual, n_i what the inputs account for (reading noise, noise of the temperatures), s the size of the discrepancy
that is left, each at its most probable value: one for motion, one for rests, and one for the blocks that a record opens
with, where what came before it is not known. Neighbouring residuals are not
independent: in motion a sample counts as :math:`c = 1/τ` pieces of information, τ the residual's integrated
correlation time in samples; a rest of m samples as one piece, so each as 1/m. The power c of a likelihood keeps
intervals and evidence honest where the correlation's form is not known (composite likelihood; Varin, Reid and Firth,
Statistica Sinica 21 (2011) 5). The discrepancy's size is a part of the likelihood and not a set weight: what leaves
half as much explains as much more as the number of pieces of information says (Kennedy and O'Hagan, J. R. Statist. Soc.
B 63 (2001) 425).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from torsight.discovery.inference.noise import Stretches

Array = NDArray[np.float64]
MOTION: Final = 0
REST: Final = 1
OPENING: Final = 2
_SIZES: Final = 28
"""Bisections of the size's logarithm over thirteen decades: to a part in ten thousand."""


@dataclass(frozen=True, slots=True, eq=False)
class Likelihood:
    """A record's likelihood as a function of a residual.

    Attributes
    ----------
    count : (n,) float64
        Pieces of information that a sample counts as; zero where it does not count.
    floor : (n,) float64
        Standard deviation that the inputs account for.
    kind : (n,) int8
        :data:`MOTION`, :data:`REST` or :data:`OPENING`: which discrepancy a sample shares.
    correlation_samples : float
        Integrated correlation time of the residual in motion.
    least : float
        Least size of the discrepancy: no model is right to better than a difference that nobody would miss.
    """

    count: Array
    floor: Array
    kind: NDArray[np.int8]
    correlation_samples: float
    least: float = 0.0

    @classmethod
    def of(cls, stretches: Stretches, floor: Array, correlation_samples: float, *, least: float = 0.0) -> Likelihood:
        """Return the likelihood of a record cut into stretches, for a correlation time of the residual in motion."""
        count, kind = np.zeros(len(floor)), np.zeros(len(floor), np.int8)
        for start, stop, at_rest, opening in zip(
            stretches.start, stretches.stop, stretches.rest, stretches.opening, strict=True
        ):
            length = stop - start
            count[start:stop] = 1.0 / (length if at_rest else min(max(correlation_samples, 1.0), length))
            kind[start:stop] = OPENING if opening else REST if at_rest else MOTION
        return cls(count, floor, kind, correlation_samples, least)

    def variance(self, residual: Array) -> Array:
        """Return the variance (n,) of every sample with the discrepancy's most probable size."""
        return np.asarray(self.floor**2 + 1e-30 + self.discrepancy(residual)[self.kind] ** 2)

    def discrepancy(self, residual: Array) -> Array:
        """Return the discrepancy's most probable sizes (3,): in motion, at rest, and in opening blocks."""
        sizes = np.zeros(3)
        for kind in (MOTION, REST, OPENING):
            rows = (self.kind == kind) & (self.count > 0.0)
            if rows.any():
                square = self.floor[rows] ** 2 + 1e-30
                sizes[kind] = _discrepancy(residual[rows] ** 2, square, self.count[rows])
        return np.maximum(np.sqrt(sizes), self.least)

    def log(self, residual: Array) -> float:
        """Return the logarithm of the likelihood, up to a constant."""
        rows = self.count > 0.0
        variance = self.variance(residual)[rows]
        return -0.5 * float(self.count[rows] @ (residual[rows] ** 2 / variance + np.log(variance)))

    def promise(self, residual: Array) -> float:
        """Return by how much the logarithm would grow if nothing but what the inputs account for were left."""
        rows = self.count > 0.0
        count, variance = self.count[rows], self.variance(residual)[rows]
        beyond = float(count @ (residual[rows] ** 2 / variance)) - float(np.sum(count))
        least = self.floor[rows] ** 2 + self.least**2 + 1e-30
        return 0.5 * max(0.0, beyond) + 0.5 * float(count @ np.log(variance / least))

    def weight(self, residual: Array) -> Array:
        """Return the information per sample (n,), zero where it does not count."""
        return np.where(self.count > 0.0, self.count / self.variance(residual), 0.0)


def _discrepancy(square: Array, floor: Array, count: Array) -> float:
    """Return s² at the maximum of the likelihood, zero where the floor accounts for the residual."""

    def rises(extra: float) -> bool:
        variance = floor + extra
        return float(count @ ((square - variance) / variance**2)) > 0.0

    if not rises(0.0):
        return 0.0
    low, high = 1e-9 * float(np.mean(floor)), float(np.max(square)) + 1e-30
    for _ in range(_SIZES):
        middle = float(np.sqrt(low * high))
        low, high = (middle, high) if rises(middle) else (low, middle)
    return float(np.sqrt(low * high))
