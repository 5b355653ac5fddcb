"""Weighted least squares with priors and bounds: Levenberg–Marquardt on a projected step.

Minimises  rᵀ W r + Σ ((x_j − μ_j)/s_j)²,  r = y − f(x), within bounds. The weights W (:mod:`.weight`) are in units of
information (one over variance and correlation time), so that the two terms are comparable and the optimum is the most
probable point. Derivatives are one-sided differences; a stepping model has kinks, so the steps are a set share of each
parameter's scale and not the square root of the machine's precision. Where a parameter sits on a kink of the objective,
every step that a one-sided derivative proposes may lead uphill; the parameter is then held and the others are stepped.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final, Protocol, runtime_checkable

import numpy as np
from scipy.optimize import lsq_linear

from torsight.core.units import Flags, Floats
from torsight.discovery.weight import Weight

STEP_SHARE: Final = 0.02
"""Difference step as a share of a parameter's scale."""
_TOLERANCE: Final = 1e-4
"""A step that promises less than this share of the cost, or of one unit of information, ends the search."""
_OFF: Final = 0.03
"""Share of a column by which derivatives may be off: 0.165 of 5.3° per second in a record's lag and its clock."""
TRUSTED: Final = 0.6
"""Share of the predicted decrease above which a step confirms the derivatives."""
_PROMISING: Final = 1.0
"""Predicted decrease, in units of information, from which kinks are sought where no step achieves it ..."""
_KINKED: Final = 3.0
"""... and multiple of the curvature's rise by which the objective rises on either side of a kink."""
_NEAR: Final = 0.1
_FAR: Final = 2.0
"""Path length in parameter scales below which derivatives are kept, and beyond which they are computed anew."""


@dataclass(frozen=True, slots=True, eq=False)
class Space:
    """The parameters of a fit as arrays, all (m,): bounds, scale and prior (infinite deviation: none)."""

    lower: Floats
    upper: Floats
    scale: Floats
    prior_mean: Floats
    prior_sigma: Floats

    def clip(self, x: Floats) -> Floats:
        """Return the nearest point within the bounds."""
        return np.clip(x, self.lower, self.upper)

    def at(self, places: Sequence[int]) -> Space:
        """Return the space of some of the parameters, in the order given."""
        rows = list(places)
        return Space(*(one[rows] for one in (self.lower, self.upper, self.scale, self.prior_mean, self.prior_sigma)))

    def prior_residual(self, x: Floats) -> Floats:
        """Return the distance from the priors in standard deviations."""
        return (x - self.prior_mean) / self.prior_sigma

    def to_means(self, x: Floats) -> Floats:
        """Return the step (m,) from a point to the priors' means, zero where there is no prior."""
        return np.where(np.isfinite(self.prior_sigma), self.prior_mean - x, 0.0)

    @property
    def prior_information(self) -> Floats:
        """One over the priors' variances."""
        return 1.0 / self.prior_sigma**2

    @property
    def least_information(self) -> Floats:
        """Next to no information (m,), with which a value of which neither record nor prior says anything stays."""
        return 1e-9 / self.scale**2


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """An optimum.

    Attributes
    ----------
    x : (m,) float64
        Parameters.
    prediction : (n,) float64
        Model values there.
    jacobian : (n, m) float64
        Derivatives of the prediction there.
    cost : float
        The objective.
    converged : bool
        False where the evaluations ran out first.
    moved : float
        Path length in parameter scales since the derivatives were computed; infinite where they have failed.
    promised : float
        Decrease of the objective that a further step predicts; NaN where it was not computed.
    """

    x: Floats
    prediction: Floats
    jacobian: Floats
    cost: float
    converged: bool
    moved: float = 0.0
    promised: float = np.nan


@runtime_checkable
class AtOnce(Protocol):
    """A function that can be evaluated at several points simultaneously."""

    def many(self, points: Sequence[Floats]) -> list[Floats]:
        """Return the function's values (n,) at points (m,)."""


def jacobian(
    function: Callable[[Floats], Floats], x: Floats, *, at_x: Floats, space: Space, guess: Floats | None = None
) -> Floats:
    """Return one-sided difference derivatives (n, m); ``at_x`` is ``function(x)``; known columns of ``guess`` stay."""
    columns = np.full((len(at_x), len(x)), np.nan) if guess is None else guess.copy()
    steps: dict[int, float] = {}
    for j, scale in enumerate(space.scale):
        if len(columns) and not np.isnan(columns[0, j]):
            continue
        step = STEP_SHARE * scale
        if x[j] + step > space.upper[j]:
            step = -min(step, max(x[j] - space.lower[j], 1e-12 * scale))
        steps[j] = step
    points = [x + step * (np.arange(len(x)) == j) for j, step in steps.items()]
    for (j, step), moved in zip(steps.items(), at_all(function, points), strict=True):
        columns[:, j] = (moved - at_x) / step
    return columns


def sharpened(function: Callable[[Floats], Floats], solution: Solution, *, weight: Weight, space: Space) -> Solution:
    """Return a solution with accurate derivatives along the directions with least information.

    Where parameters compensate each other (a late sensor and a late clock), columns that were computed with steps of
    different sizes, or updated, do not cancel as those of the model do, and their remainder would count as information.
    Along each such direction they are replaced by a central difference over one standard deviation to either side.
    """
    derivative = solution.jacobian.copy()
    scaled = derivative * space.scale
    information, axes = np.linalg.eigh(weight.normal(scaled))
    doubtful = information < (_OFF**2) * information[-1]
    ends = [
        space.clip(solution.x + side * space.scale * axis / np.sqrt(1.0 + max(known, 0.0)))
        for known, axis in zip(information[doubtful], axes.T[doubtful], strict=True)
        for side in (1.0, -1.0)
    ]
    there = at_all(function, ends)
    for after, before, up, down in zip(ends[::2], ends[1::2], there[::2], there[1::2], strict=True):
        way = (after - before) / space.scale
        if way.any():
            missed = up - down - derivative @ (after - before)
            derivative += np.outer(missed, way / (way @ way) / space.scale)
    return replace(solution, jacobian=derivative)


def at_all(function: Callable[[Floats], Floats], points: Sequence[Floats]) -> list[Floats]:
    """Return the function at several points."""
    return function.many(points) if isinstance(function, AtOnce) else [function(point) for point in points]


def objective(residual: Floats, x: Floats, *, weight: Weight, space: Space) -> float:
    """Return the quantity to minimise: information in the residual, and the priors' share."""
    return weight.square(residual) + float(np.sum(space.prior_residual(x) ** 2))


def solve(
    function: Callable[[Floats], Floats],
    start: Floats | Solution,
    *,
    observed: Floats,
    weight: Weight,
    space: Space,
    max_iterations: int = 12,
    guess: Floats | None = None,
    rough: bool = False,
) -> Solution:
    """Find the optimum next to ``start``.

    Parameters
    ----------
    function : callable
        Model values (n,) from parameters (m,).
    start : (m,) array, or Solution
        Start point, moved into the bounds. From a solution of the same function (at other weights) nothing is evaluated
        twice.
    observed : (n,) array
        Measured values; NaN is allowed where the weight is 0.
    weight : Weight
        Information in the residual.
    space : Space
        Bounds, scales and priors.
    max_iterations : int
        Accepted steps at most.
    guess : (n, m) array, optional
        First derivatives, where they are known from a smaller model; NaN columns are computed.
    rough : bool
        Whether the derivatives at the end are left as they are, even where they have failed.
    """
    y = np.where(weight.each > 0.0, observed, 0.0)
    slopes = Slopes(function, space, start, guess=guess)
    cost = objective(y - slopes.at_x, slopes.x, weight=weight, space=space)
    damping, converged = 1e-3, False
    held = np.zeros(len(slopes.x), bool)

    def holds_another(curvature: Floats) -> bool:
        def cost_at(x: Floats) -> float:
            return objective(y - function(x), x, weight=weight, space=space)

        kinked = _kinks(cost_at, slopes.x, cost=cost, curvature=curvature, space=space) & ~held
        held[kinked] = True
        return bool(kinked.any())

    for _ in range(max_iterations):
        slopes.renew()
        residual = y - slopes.at_x
        normal, gradient = normal_equations(slopes.jacobian, residual, slopes.x, weight=weight, space=space)
        _hold(normal, gradient, held, space=space)
        found, most = False, 0.0
        while damping < 1e6:
            step, promised = _step(normal, gradient, slopes.x, damping=damping, space=space)
            most = max(most, promised)
            if promised < _TOLERANCE * max(1.0, 1e-2 * cost):
                break
            trial = space.clip(slopes.x + step)
            at_trial = function(trial)
            trial_cost = objective(y - at_trial, trial, weight=weight, space=space)
            if trial_cost < cost:
                found = True
                break
            damping = max(damping * 8.0, 1e-2)
        if not found:
            if slopes.refresh() or (most > _PROMISING and holds_another(np.diag(normal))):
                damping = 1e-3
                continue
            converged = True
            break
        kept = (cost - trial_cost) / promised
        damping = max(damping * (0.1 if kept > 0.5 else 2.0), 1e-6)
        slopes.move(trial, at_trial, trusted=kept > TRUSTED)
        cost = trial_cost
    if not rough:
        slopes.refresh()
    return Solution(slopes.x, slopes.at_x, slopes.jacobian, cost, converged, slopes.moved)


def looking_ahead(
    function: Callable[[Floats], Floats], solution: Solution, *, observed: Floats, weight: Weight, space: Space
) -> Solution:
    """Return a rough solution with the decrease that an undamped step predicts, by derivatives that have not failed."""
    if solution.converged:
        return replace(solution, promised=0.0)
    slopes = Slopes(function, space, solution)
    slopes.renew()
    y = np.where(weight.each > 0.0, observed, 0.0)
    normal, gradient = normal_equations(slopes.jacobian, y - slopes.at_x, slopes.x, weight=weight, space=space)
    _, promised = _step(normal, gradient, slopes.x, damping=0.0, space=space)
    return replace(solution, jacobian=slopes.jacobian, moved=slopes.moved, promised=promised)


def full_step(solution: Solution, residual: Floats, *, weight: Weight, space: Space) -> Floats:
    """Return the undamped step (m,) from a solution at other weights; zeros of a residual (n,) do not count."""
    normal, gradient = normal_equations(solution.jacobian, residual, solution.x, weight=weight, space=space)
    return _step(normal, gradient, solution.x, damping=0.0, space=space)[0]


class Slopes:
    """The model at a point with its derivatives, by differences or (after a step that went as predicted) by update."""

    def __init__(
        self,
        function: Callable[[Floats], Floats],
        space: Space,
        start: Floats | Solution,
        *,
        guess: Floats | None = None,
    ) -> None:
        self._function = function
        self._space = space
        self.moved = 0.0
        if isinstance(start, Solution):
            self.x, self.at_x, self.jacobian, self.moved = start.x, start.prediction, start.jacobian, start.moved
        else:
            self.x = space.clip(np.asarray(start, np.float64))
            self.at_x = function(self.x)
            self.jacobian = jacobian(function, self.x, at_x=self.at_x, space=space, guess=guess)
            # Derivatives of a smaller model are taken anew as soon as they fail.
            self.moved = 0.0 if guess is None else _NEAR

    def move(self, x: Floats, at_x: Floats, *, trusted: bool) -> None:
        """Move to another point; Broyden's update of derivatives that are ``trusted``; far away they fail."""
        step = (x - self.x) / self._space.scale
        moved = float(np.max(np.abs(step)))
        missed = at_x - self.at_x - self.jacobian @ (x - self.x)
        self.x, self.at_x = x, at_x
        self.moved += moved
        # A value without effect here, such as a law's where the driver never is, cannot cause the linear model's error.
        step[~self.jacobian.any(axis=0)] = 0.0
        if trusted and self.moved < _FAR and step.any():
            self.jacobian = self.jacobian + np.outer(missed, step / (step @ step) / self._space.scale)
        elif self.moved >= _NEAR:
            self.moved = np.inf

    def renew(self) -> None:
        """Compute the derivatives anew if they have failed."""
        if np.isinf(self.moved):
            self.refresh()

    def refresh(self) -> bool:
        """Compute the derivatives anew; return False where those at hand were computed near enough."""
        if self.moved < _NEAR:
            return False
        self.jacobian = jacobian(self._function, self.x, at_x=self.at_x, space=self._space)
        self.moved = 0.0
        return True


def linear_change(columns: Floats, residual: Floats, *, weight: Weight, information: Floats, centre: Floats) -> Floats:
    """Return the coefficients (k,) of columns (n, k) that explain a residual best.

    ``information`` (k,) is one over the variance of each coefficient's prior, ``centre`` (k,) its mean.
    """
    weighted = weight.times(columns)
    side = weighted.T @ residual + information * centre
    return np.asarray(np.linalg.solve(weighted.T @ columns + np.diag(information), side))


def normal_equations(
    derivative: Floats, residual: Floats, x: Floats, *, weight: Weight, space: Space
) -> tuple[Floats, Floats]:
    """Return matrix (m, m) and right-hand side (m,) of the normal equations of a step, with the priors."""
    normal = weight.normal(derivative)
    normal[np.diag_indices_from(normal)] += space.prior_information
    return normal, derivative.T @ weight.times(residual) - space.prior_information * (x - space.prior_mean)


def _kinks(cost_at: Callable[[Floats], float], x: Floats, *, cost: float, curvature: Floats, space: Space) -> Flags:
    """Return the parameters (m,) from which the objective rises on both sides by more than its curvature."""
    found = np.zeros(len(x), bool)
    for j, step in enumerate(STEP_SHARE * space.scale):
        rises = []
        for side in (x[j] - step, x[j] + step):
            moved = x.copy()
            moved[j] = side
            rises.append(cost_at(moved) - cost if space.lower[j] <= side <= space.upper[j] else 0.0)
        found[j] = min(rises) > _KINKED * curvature[j] * step**2
    return found


def _hold(normal: Floats, gradient: Floats, held: Flags, *, space: Space) -> None:
    """Change normal equations so that the parameters ``held`` (m,) keep their values."""
    normal[held, :] = normal[:, held] = 0.0
    normal[held, held] = 1.0 / space.scale[held] ** 2
    gradient[held] = 0.0


def _step(normal: Floats, gradient: Floats, x: Floats, *, damping: float, space: Space) -> tuple[Floats, float]:
    """Return the damped step that stays within the bounds, and the decrease that it predicts."""
    # 1/scale² keeps a direction that the record says nothing about from running away.
    ridge = damping * (np.diag(normal) + 1e-6 / space.scale**2) + 1e-9 / space.scale**2
    matrix = normal + np.diag(ridge)
    step: Floats = np.asarray(np.linalg.solve(matrix, gradient), np.float64)
    if np.any(x + step < space.lower) or np.any(x + step > space.upper):
        # The quadratic within a box, in units of the scales, as a bounded linear least-squares problem.
        root = np.linalg.cholesky(matrix * np.outer(space.scale, space.scale))
        target = np.linalg.solve(root, gradient * space.scale)
        low, high = (space.lower - x) / space.scale, (space.upper - x) / space.scale
        within = lsq_linear(root.T, target, bounds=(low - 1e-12, high + 1e-12), method="bvls", tol=1e-12)
        step = space.clip(x + within.x * space.scale) - x
    promised = float(2.0 * gradient @ step - step @ normal @ step)
    return step, promised
