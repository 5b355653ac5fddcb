r"""Information in samples whose errors are partly shared.

A residual is :math:`r = e + J a`: errors e of each sample alone, with information w (one over variance and correlation
time), and independent errors a of the inputs, with standard deviation one, that each act on many samples; the columns
of J are their effects on the samples. The error of the top temperature of an incomplete heating is of this kind: it
stays in the angle until the next heating. With a integrated out the objective is

.. math:: r^\top W r = \min_a \sum_i w_i (r - J a)_i^2 + a^\top a, \qquad
          W = \operatorname{diag}(w) - w J (1 + J^\top w J)^{-1} J^\top w

(nuisance parameters of a linear model; e.g. Rasmussen and Williams (2006), section 2.7).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
import scipy.linalg

from torsight.core.units import Flags, Floats

NOTHING: Final = 1e-6
"""Share of a change's sum of squares up to which the values that are fitted already make the same change: their
derivatives are known to about a thousandth."""


@dataclass(frozen=True, eq=False)
class Weight:
    """Information in a residual.

    ``each`` (n,) is the information per sample beside the shared errors, zero where a sample does not count; ``shared``
    (n, k) is the change of the samples by one standard deviation of every shared error.
    """

    each: Floats
    shared: Floats

    @classmethod
    def of(cls, each: Floats) -> Weight:
        """Return the weight of samples that share no error."""
        return cls(each, np.zeros((len(each), 0)))

    @cached_property
    def _weighted(self) -> Floats:
        return self.shared * self.each[:, None]

    @cached_property
    def _information(self) -> Floats:
        """Information (k, k) about the shared errors, from the samples and from the errors' priors."""
        return np.asarray(np.eye(self.shared.shape[1]) + self.shared.T @ self._weighted)

    @property
    def alone(self) -> bool:
        """Whether no error is shared."""
        return not self.shared.size

    @property
    def log_determinant(self) -> float:
        """Logarithm of the determinant of 1 + Jᵀ w J: the cost of the freedom of the shared errors."""
        return 0.0 if self.alone else float(np.linalg.slogdet(self._information)[1])

    def errors(self, residual: Floats) -> Floats:
        """Return the most probable shared errors (k,) in a residual, in their standard deviations."""
        return (
            np.zeros(0) if self.alone else np.asarray(np.linalg.solve(self._information, self._weighted.T @ residual))
        )

    def square(self, residual: Floats) -> float:
        """Return the objective of a residual."""
        plain = float(self.each @ residual**2)
        return plain if self.alone else plain - float((self._weighted.T @ residual) @ self.errors(residual))

    def times(self, columns: Floats) -> Floats:
        """Return W times a column (n,), or columns (n, m)."""
        plain: Floats = (columns.T * self.each).T
        return plain if self.alone else np.asarray(plain - self._weighted @ self.errors(columns))

    def normal(self, columns: Floats) -> Floats:
        """Return Cᵀ W C (m, m) of columns C (n, m)."""
        scaled = columns * np.sqrt(self.each)[:, None]
        plain = np.asarray(scaled.T @ scaled)
        if self.alone:
            return plain
        across = self._weighted.T @ columns
        return np.asarray(plain - across.T @ np.linalg.solve(self._information, across))

    def factor(self, columns: Floats, prior: Floats) -> Floats:
        """Return R (m, m), upper triangular, with Rᵀ R = Cᵀ W C + diag(prior), for columns C (n, m) and prior (m,) > 0.

        From the triangular factor of all errors and values together, without the difference of :meth:`normal`, whose
        rounding can exceed what is left for a value of which the samples say little.
        """
        own = self.shared.shape[1]
        rows = np.hstack([self.shared, columns]) * np.sqrt(self.each)[:, None]
        priors = np.diag(np.concatenate([np.ones(own), np.sqrt(prior)]))
        (triangle,) = scipy.linalg.qr(np.vstack([rows, priors]), mode="r", overwrite_a=True)
        return np.asarray(triangle[own : own + len(prior), own:])

    def only(self, rows: Flags) -> Weight:
        """Return the weight with only these rows (n,) counted."""
        return Weight(np.where(rows, self.each, 0.0), self.shared)

    def at(self, rows: slice) -> Weight:
        """Return the weight of a part of the record."""
        return Weight(self.each[rows], self.shared[rows])
