r"""The likelihood of a residual: Gaussian, with inferred noise and correlated neighbours.

.. math:: \log L = -\tfrac12 \sum_i c_i \left( \frac{(r - J a)_i^2}{s^2 + n_i^2} + \log (s^2 + n_i^2) \right)
          - \tfrac12 a^\top a - \tfrac12 \log \det (1 + J^\top w J)

r residual, n_i the noise of the inputs in each sample alone (reading noise, noise of the temperatures), J a the
contribution of errors of the inputs that many samples share (:mod:`.weight`), s the size of the model's discrepancy,
each at its most probable value: one s for motion, one for rests, and one for the opening blocks, where the state before
the record is not known. Neighbouring residuals are not independent: in motion a sample counts as :math:`c = 1/τ` pieces
of information, τ the integrated correlation time, in samples, of the residual in units of each sample's standard
deviation (samples that lie closer than usual share that); a rest of m samples counts as one piece, so each sample as
1/m. Errors that the inputs' noise causes have a correlation time of their own: where they are a part f of a sample's
variance and that time is longer than τ, 1/c is the mean of both, weighted with f and 1 − f. The power c of a likelihood
keeps intervals and evidence honest where the correlation's form is not known (composite likelihood; Varin, Reid and
Firth, Statistica Sinica 21 (2011) 5). The discrepancy's size is a part of the likelihood and not a fixed weight: the
gain of a model with half the residual grows with the number of pieces of information (Kennedy and O'Hagan, J. R.
Statist. Soc. B 63 (2001) 425).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from torsight.core.compiled import compiled, inlined
from torsight.core.units import Flags, Floats
from torsight.discovery.inference.noise import Stretches
from torsight.discovery.weight import Weight

MOTION, REST, OPENING, INTERRUPTED = range(4)
"""Kinds of samples, each with a discrepancy of its own; that of interrupted rests is the least one."""
_SIZE: Final = 1e-4
"""Relative accuracy of a discrepancy's variance."""
_ROUNDS: Final = 8
"""Largest number of alternations between shared errors and discrepancy; three or four suffice."""
_SETTLED: Final = 1e-3
"""Change of the shared errors, in their standard deviations, below which another round changes nothing."""


@dataclass(frozen=True, eq=False)
class Likelihood:
    """A record's likelihood as a function of a residual.

    Attributes
    ----------
    count : (n,) float64
        Pieces of information that a sample counts as; zero where it does not count.
    floor : (n,) float64
        Standard deviation of the inputs' noise in a sample alone.
    kind : (n,) int8
        :data:`MOTION`, :data:`REST` or :data:`OPENING`: which discrepancy a sample shares. It is the least for rests
        that are :data:`INTERRUPTED`: they have one level, a shared error, and only the reading moves between them.
    correlation_samples : float
        Integrated correlation time of the residual in motion.
    least : float
        Smallest size of the discrepancy: no model is more exact than a difference that does not matter.
    shared : (n, k) float64
        Change of the samples by one standard deviation of every error of the inputs that many samples share.
    levels : (n, m) float64, optional
        The same for the discrepancies of levels that interrupted rests share.
    """

    count: Floats
    floor: Floats
    kind: NDArray[np.int8]
    correlation_samples: float
    least: float
    shared: Floats
    levels: Floats | None = None

    @classmethod
    def of(
        cls,
        stretches: Stretches,
        floor: Floats,
        correlation_samples: float,
        *,
        count: Floats | None = None,
        least: float = 0.0,
        shared: Floats | None = None,
        levels: Floats | None = None,
    ) -> Likelihood:
        """Return the likelihood of a record cut into stretches, for a correlation time of the residual in motion.

        ``count`` (n,) are the pieces of information per sample where the correlation time alone does not give them.
        """
        kind = np.full(len(floor), MOTION, np.int8)
        for start, stop, at_rest, opening in zip(
            stretches.start, stretches.stop, stretches.rest, stretches.opening, strict=True
        ):
            kind[start:stop] = OPENING if opening else REST if at_rest else MOTION
        shared = np.zeros((len(floor), 0)) if shared is None else shared
        if levels is not None:
            kind[levels.any(axis=1)] = INTERRUPTED
        count = stretches.counts(correlation_samples) if count is None else count
        return cls(count, floor, kind, correlation_samples, least, shared, levels)

    def at(self, rows: slice) -> Likelihood:
        """Return the likelihood of a part of the record."""
        return replace(
            self,
            count=self.count[rows],
            floor=self.floor[rows],
            kind=self.kind[rows],
            shared=self.shared[rows],
            levels=None if self.levels is None else self.levels[rows],
        )

    @cached_property
    def _all_shared(self) -> Floats:
        return self.shared if self.levels is None else np.hstack([self.shared, self.levels])

    @property
    def noise(self) -> Floats:
        """Standard deviation (n,) of the inputs' noise, shared errors and others."""
        return np.asarray(np.sqrt(self.floor**2 + np.sum(self.shared**2, axis=1)))

    def variance(self, residual: Floats) -> Floats:
        """Return the variance (n,) of every sample: noise, shared errors and the most probable discrepancy."""
        return np.asarray(self.own_variance(residual) + np.sum(self._all_shared**2, axis=1))

    def own_variance(self, residual: Floats) -> Floats:
        """Return the variance (n,) of every sample without its shared errors."""
        return self._variance(self.left(residual))

    def left(self, residual: Floats) -> Floats:
        """Return a residual less the contribution of its most probable shared errors (n,)."""
        return np.asarray(residual - self._all_shared @ self.weight(residual).errors(residual))

    def in_scales(self, residual: Floats) -> Floats:
        """Return :meth:`left` in units of every sample's standard deviation (n,)."""
        left = self.left(residual)
        return np.asarray(left / np.sqrt(self._variance(left)))

    def accounts_for(self, residual: Floats) -> bool:
        """Return whether a residual, except at rest, is no larger than the inputs' noise and the least discrepancy."""
        rows = (self.kind != REST) & (self.count > 0.0)
        scaled = self.left(residual)[rows] ** 2 / (self.floor[rows] ** 2 + self.least**2 + 1e-30)
        return bool(rows.any() and self.count[rows] @ scaled <= np.sum(self.count[rows]))

    def over_floor(self, residual: Floats) -> float:
        """Return the root mean square of a residual, in noise floors; no floor is below half of the least discrepancy.

        A residual of the size of the least discrepancy does not matter, however exact the record is; one of two floors
        does.
        """
        noise = max(float(self.count @ self.noise**2), float(np.sum(self.count)) * (0.5 * self.least) ** 2, 1e-30)
        return float(np.sqrt(float(self.count @ residual**2) / noise))

    def discrepancy(self, residual: Floats) -> Floats:
        """Return the discrepancy's most probable sizes (4,): in motion, at rest, in opening blocks, and the least."""
        return self._discrepancy(self.left(residual))

    def _variance(self, left: Floats) -> Floats:
        return np.asarray(self.floor**2 + 1e-30 + self._discrepancy(left)[self.kind] ** 2)

    @cached_property
    def _kinds(self) -> list[tuple[int, Flags, Floats, Floats]]:
        """Every kind that has samples, with the mask (n,) of these samples, their squared floors and their counts."""
        each = ((kind, (self.kind == kind) & (self.count > 0.0)) for kind in (MOTION, REST, OPENING))
        return [(kind, rows, self.floor[rows] ** 2 + 1e-30, self.count[rows]) for kind, rows in each if rows.any()]

    def _discrepancy(self, left: Floats) -> Floats:
        """Return the sizes (4,) for a residual without its shared errors."""
        sizes = np.zeros(4)
        with np.errstate(over="ignore"):
            square = left**2
        for kind, rows, floor, count in self._kinds:
            sizes[kind] = discrepancy(square[rows], floor, count, self.least**2)
        return np.sqrt(np.maximum(sizes, self.least**2))

    def log(self, residual: Floats) -> float:
        """Return the logarithm of the likelihood, up to a constant."""
        return self.log_at(self.weight(residual), residual)

    def log_at(self, weight: Weight, residual: Floats) -> float:
        """Return the logarithm of the likelihood where the residual's own weight is known."""
        rows = self.count > 0.0
        if not (weight.each[rows] > 0.0).all():
            return -np.inf
        spread = float(self.count[rows] @ np.log(self.count[rows] / weight.each[rows]))
        return -0.5 * (weight.square(residual) + spread + weight.log_determinant)

    def promise(self, residual: Floats) -> float:
        """Return the growth of the logarithm if the residual fell to the noise of the inputs.

        It is the sum of the growths in motion, at rest, in opening blocks, and by the shared errors, each at least
        zero: a part that is below its noise already does not reduce the gain of the others.
        """
        weight = self.weight(residual)
        errors = weight.errors(residual)
        left = residual - self._all_shared @ errors
        gain = max(0.0, float(errors @ errors) - len(errors))
        for kind in (MOTION, REST, OPENING, INTERRUPTED):
            rows = (self.kind == kind) & (self.count > 0.0)
            count, each = self.count[rows], weight.each[rows]
            least = self.floor[rows] ** 2 + self.least**2 + 1e-30
            gain += max(0.0, float(each @ left[rows] ** 2 - np.sum(count)))
            gain += float(count @ np.log(count / each / least))
        return 0.5 * gain

    def weight(self, residual: Floats) -> Weight:
        """Return the information in a residual, with discrepancy and shared errors at their most probable values."""
        shared = self._all_shared
        errors = np.zeros(shared.shape[1])
        for _ in range(_ROUNDS):
            each = np.where(self.count > 0.0, self.count / self._variance(residual - shared @ errors), 0.0)
            weight = Weight(each, shared)
            before, errors = errors, weight.errors(residual)
            if np.max(np.abs(errors - before), initial=0.0) <= _SETTLED:
                break
        return weight


@inlined
def _scored(size: float, square: Floats, floor: Floats, count: Floats) -> float:
    """Return the next value of s² in Fisher's scoring; it exceeds ``size`` where the likelihood rises with s²."""
    above = whole = 0.0
    for i in range(square.size):
        weight = count[i] / (floor[i] + size) ** 2
        above += weight * (square[i] - floor[i])
        whole += weight
    return above / whole


@compiled
def discrepancy(square: Floats, floor: Floats, count: Floats, least: float) -> float:
    """Return the discrepancy s² at the maximum of the likelihood, or the least where that is less.

    ``square`` (n,) are the residuals' squares, ``floor`` the variances of the inputs' noise, ``count`` the pieces of
    information of every sample. Fisher's scoring, s² ← Σ w (r² − n²) / Σ w with w = c / (n² + s²)², is kept within a
    bracket of the maximum; a step out of the bracket is replaced by its geometric middle.
    """
    # Means and extremes by loops: numba's own take half a second to compile.
    high, mean = 0.0, 0.0
    for i in range(len(square)):
        high, mean = max(high, square[i]), mean + floor[i] / len(floor)
    low = max(least, 1e-9 * mean)
    if not _scored(low, square, floor, count) > low:
        return least
    # The residual of a model that diverges has no finite square: no size of the noise explains it.
    if not high < np.inf:
        return np.inf
    # Where the size is that of the largest residual, every sample asks for less.
    high += 1e-30
    size = np.sqrt(low * high)
    while high > low * (1.0 + _SIZE):
        found = _scored(size, square, floor, count)
        if found > size:
            low = size
        else:
            high = size
        if abs(found - size) <= _SIZE * size:
            return float(found)
        size = found if low < found < high else np.sqrt(low * high)
    return float(size)
