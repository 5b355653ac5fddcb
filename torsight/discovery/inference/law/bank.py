r"""The bank of a law's prior, and the linear model that gives the evidence of all its members together.

The kernels of a law in several sizes are the members of its bank: half of the prior is on smooth functions, half is
shared by the usual forms.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import logsumexp

from torsight.core.law import KEPT, Law, LawForm
from torsight.core.units import Floats
from torsight.discovery.inference.solver import Space
from torsight.discovery.weight import Weight

Member = tuple[int, int]
"""A member of a bank: the indices of its kernel and of its size."""
SIZES: Final = (0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0)
"""Sizes that are tried, in scales of the law: three decades in steps of a half."""


@dataclass(frozen=True, eq=False)
class Bank:
    """A law's kernels at size one, and the logarithm of the prior of each kernel in every size.

    Half of the prior is on smooth kernels, half on usual forms; either half is shared equally by kernels and sizes.
    """

    law: Law
    units: tuple[LawForm, ...]
    log_prior: Floats

    @classmethod
    @functools.lru_cache(maxsize=64)
    def of(cls, law: Law) -> Bank:
        """Return the bank of a law."""
        smooth = np.array([kernel.smooth for kernel in law.kernels])
        of_kind = np.where(smooth, smooth.sum(), (~smooth).sum())
        kinds = 2 if 0 < smooth.sum() < len(smooth) else 1
        return cls(law, tuple(law.form(kernel, 1.0) for kernel in law.kernels), -np.log(kinds * of_kind * len(SIZES)))

    @functools.cached_property
    def _inverses(self) -> list[Floats]:
        """The matrices that give the coefficients of a curve on the nodes in each kernel at size one."""
        return [np.asarray(np.linalg.pinv(unit.basis), np.float64) for unit in self.units]

    def beside(self, evidence: Floats, place: Member) -> float:
        """Return the evidence of the family less that of its measured member alone.

        Other members count for no more than that one: a step to a member of which derivatives promise more has failed.
        """
        return float(self.log_prior[place[0]] + logsumexp(np.minimum(evidence, evidence[place])) - evidence[place])

    def within(self, form: LawForm) -> Bank:
        """Return the bank for the coefficients of a form: kernels outside of the form's span have prior zero.

        A kernel counts as within the span if it deviates by no more than a form may deviate from its own kernel.
        """
        inverse, units, log_prior = np.linalg.pinv(form.basis), [], []
        for unit, prior in zip(self.units, self.log_prior, strict=True):
            inner = inverse @ unit.basis
            off = np.linalg.norm(unit.basis - form.basis @ inner, 2) / np.linalg.norm(unit.basis, 2)
            units.append(replace(unit, basis=inner))
            log_prior.append(prior if off**2 <= KEPT else -np.inf)
        return Bank(self.law, tuple(units), np.array(log_prior))

    def size(self, place: Member) -> float:
        """Return the size of a member in the law's unit."""
        return float(SIZES[place[1]] * self.law.scale)

    def form(self, place: Member) -> LawForm:
        """Return the form of a member."""
        unit = self.units[place[0]]
        return replace(unit, basis=unit.basis * self.size(place))

    def coefficients(self, place: Member, curve: Floats) -> Floats:
        """Return the coefficients of a member's form at which it is nearest to a curve (k,)."""
        return np.asarray(self._inverses[place[0]] @ curve / self.size(place))

    def nearest(self, place: Member, curve: Floats) -> Floats:
        """Return the curve (k,) nearest to a given one that a member can represent."""
        return np.asarray(self.units[place[0]].basis @ (self._inverses[place[0]] @ curve))

    def cost(self, place: Member, curve: Floats) -> float:
        """Return the cost of a curve (k,) under a member's prior: minus twice the logarithm of its density."""
        return float(np.sum(self.coefficients(place, curve) ** 2))


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """The linear model at a point: its posterior under every kernel and size of the bank.

    ``evidence`` and ``occam`` are (kernels, sizes); ``place`` is the best member.
    """

    bank: Bank
    evidence: Floats
    occam: Floats
    place: Member
    _values: Callable[[Member], Floats]
    _parameters: Callable[[Floats], Floats]

    def constant(self, place: Member) -> float:
        """Return the share of a member's evidence that its law's values do not change: Occam factor and prior."""
        return float(self.occam[place] + self.bank.log_prior[place[0]])

    def mean_of(self, place: Member) -> Floats:
        """Return the posterior mean of the parameters and of the law's values under a member."""
        values = self._values(place)
        return np.concatenate([self._parameters(values), values])

    @classmethod
    def of(
        cls,
        derivative: Floats,
        residual: Floats,
        weight: Weight,
        *,
        u: Floats,
        space: Space,
        information: Floats,
        bank: Bank,
    ) -> Picture:
        r"""Compute the evidence of every member.

        With the parameters integrated out the law's values on the nodes have the information S and the side g. Under a
        kernel whose values are B z, z independent with standard deviation c, :math:`B^\top S B = Q Λ Q^\top` serves all
        sizes c: they gain :math:`\sum c^2 (Q^\top B^\top g)^2 / (1 + c^2 Λ)` for :math:`\sum \log (1 + c^2 Λ)`.
        """
        n = len(information)
        normal = weight.normal(derivative)
        # Where the law would be off and the parameters at their priors' means (those without a prior: where they are).
        origin = u.copy()
        held = np.isfinite(space.prior_sigma)
        origin[held] = u[held] - space.prior_mean[held]
        origin[:n][~held[:n]] = 0.0
        there = residual + derivative @ origin
        side = derivative.T @ weight.times(there)
        root = np.linalg.cholesky(normal[:n, :n] + np.diag(information))
        half = solve_triangular(root, np.column_stack([normal[:n, n:], side[:n]]), lower=True)
        across, own = half[:, :-1], half[:, -1]
        left, pull = normal[n:, n:] - across.T @ across, side[n:] - across.T @ own
        base = -float(np.sum(np.log(np.diag(root))))
        plain = base - 0.5 * (weight.square(there) - float(own @ own))
        square = (np.array(SIZES) * bank.law.scale)[:, None] ** 2
        occam, gain, turned = [], [], []
        for unit in bank.units:
            share, axes = np.linalg.eigh(unit.basis.T @ left @ unit.basis)
            along = axes.T @ (unit.basis.T @ pull)
            spread = 1.0 + square * np.maximum(share, 0.0)
            occam.append(-0.5 * np.sum(np.log(spread), axis=1))
            gain.append(0.5 * np.sum(square * along**2 / spread, axis=1))
            turned.append((axes, along, spread))
        evidence = plain + bank.log_prior[:, None] + np.array(gain) + np.array(occam)
        kernel, size = (int(i) for i in np.unravel_index(np.argmax(evidence), evidence.shape))

        def values_of(place: Member) -> Floats:
            axes, along, spread = turned[place[0]]
            mean = square[place[1]] * along / spread[place[1]]
            return np.asarray(bank.units[place[0]].basis @ (axes @ mean))

        def parameters_at(values: Floats) -> Floats:
            x = solve_triangular(root.T, own - across @ values, lower=False)
            return np.asarray(u[:n] + x - origin[:n], np.float64)

        return cls(bank, evidence, base + np.array(occam), (kernel, size), values_of, parameters_at)
