"""How much the best of all candidates gains where nothing is missing.

The more candidates are tried, the more the luckiest gains on noise alone. The threshold is a quantile of that gain:
noise of the record's own sizes and correlation is drawn, and each candidate takes from it what its directions (its
effect at every start, and the derivatives there, less what the fitted parameters can imitate) allow. Everything is
linear in the noise, so thousands of draws cost little and no refit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from scipy.signal import lfilter

from torsight.core.progress import Progress, silent
from torsight.discovery.fitting import Fit, Fitter, space_of
from torsight.discovery.noise import Scales, Stretches
from torsight.discovery.solver import Array, jacobian

LEAST_GAIN: Final = 20.0
"""No gain below this is believed, whatever the draws say: the noise of a real rig is never quite that of a formula."""
_DRAWS: Final = 400


def gain_threshold(
    fitter: Fitter,
    fit: Fit,
    *,
    stretches: Stretches,
    scales: Scales,
    seed: int,
    level: float = 0.99,
    progress: Progress = silent,
) -> float:
    """Return the gain that the best of all further candidates exceeds by chance with probability 1 − ``level``.

    ``progress`` is told after every candidate.
    """
    picture = LinearPicture(fitter, fit)
    bases = [basis for basis in picture.directions(progress) if basis.shape[1]]
    if not bases:
        return LEAST_GAIN
    root = picture.root
    rng = np.random.default_rng(seed)
    best = np.zeros(_DRAWS)
    for first in range(0, _DRAWS, 50):
        count = min(50, _DRAWS - first)
        noise = np.stack([_draw(rng, stretches, scales, len(root)) for _ in range(count)], axis=1) * root[:, None]
        noise = np.vstack([noise, rng.standard_normal((len(fit.parameters), count))])
        gains = np.array([np.sum((basis.T @ noise) ** 2, axis=0) for basis in bases])
        best[first : first + count] = gains.max(axis=0)
    return max(LEAST_GAIN, float(np.quantile(best, level)))


class LinearPicture:
    """What adding an effect to a fitted set promises, linear in everything but the effect's own size at its start.

    One that is missing promises nothing only if the fit can imitate it. Below the weighted samples stand the priors,
    one row each: to move a value explains samples and costs its prior.
    """

    def __init__(self, fitter: Fitter, fit: Fit) -> None:
        self._fitter = fitter
        self._fit = fit
        self.root = np.sqrt(fitter.weight)
        space = space_of(fit.parameters)
        rows = np.vstack([fit.solution.jacobian * self.root[:, None], np.diag(1.0 / space.prior_sigma)])
        # Orthonormal directions (n + m, k) that the fit's own parameters can make.
        self._known = _orthonormal(rows, rank_from=1e-9)
        off = -space.prior_residual(fit.solution.x)
        residual = np.concatenate([np.nan_to_num(fitter.residual(fit)) * self.root, off])
        self._residual = residual - self._known @ (self._known.T @ residual)

    def gain(self, name: str, starts: Sequence[Mapping[str, float]]) -> float:
        """Return the gain that an effect promises, the best over its starting points."""
        bases = [self._basis(name, start) for start in starts]
        return max((float(np.sum((basis.T @ self._residual) ** 2)) for basis in bases), default=0.0)

    def directions(self, progress: Progress) -> list[Array]:
        """Return, for every further candidate and start, the directions in which it can move the prediction."""
        fitter = self._fitter
        candidates = [candidate for candidate in fitter.problem.candidates if candidate.id not in self._fit.effects]
        found, residual = [], fitter.residual(self._fit)
        for count, candidate in enumerate(candidates):
            progress("what chance gains", count, len(candidates))
            starts = candidate.starting_points(fitter.problem.time_s, residual)
            found += [self._basis(candidate.id, start) for start in starts]
        return found

    def _basis(self, name: str, start: Mapping[str, float]) -> Array:
        """Return orthonormal directions in which an effect can move the prediction and the fit cannot."""
        effects = self._fitter.ordered((*self._fit.effects, name))
        columns = _effect_columns(self._fitter, self._fit, effects, start) * self.root[:, None]
        columns = np.vstack([columns, np.zeros((len(self._fit.parameters), columns.shape[1]))])
        columns -= self._known @ (self._known.T @ columns)
        return _orthonormal(columns, rank_from=1e-3)


def _effect_columns(fitter: Fitter, fit: Fit, effects: tuple[str, ...], start: Mapping[str, float]) -> Array:
    """Return the effect at a start point and its derivatives there, (n, 1 + parameters)."""
    names = tuple(start)
    chosen = {p.name: p for p in fitter.parameters(effects)}
    scales = {key: scale for effect in effects for key, scale in fitter.candidates[effect].scales.items()}
    space = space_of([chosen[name] for name in names], scales=scales)

    def model(x: Array) -> Array:
        values = {**fit.values, **dict(zip(names, x.tolist(), strict=True))}
        return fitter.problem.predict(values, effects)

    x = space.clip(np.array([start[name] for name in names], np.float64))
    at_x = model(x)
    return np.column_stack([at_x - fit.solution.prediction, jacobian(model, x, at_x=at_x, space=space)])


def _orthonormal(columns: Array, *, rank_from: float) -> Array:
    norms = np.linalg.norm(columns, axis=0)
    columns = columns[:, norms > 1e-12 * max(1.0, norms.max(initial=0.0))]
    if not columns.shape[1]:
        return np.zeros((len(columns), 0))
    left, singular, _ = np.linalg.svd(columns / np.linalg.norm(columns, axis=0), full_matrices=False)
    return np.asarray(left[:, singular > rank_from * singular[0]])


def _draw(rng: np.random.Generator, stretches: Stretches, scales: Scales, size: int) -> Array:
    """Return noise of the record's kind: one level per rest, a first-order process per stretch of motion."""
    noise = np.zeros(size)
    tau = max(scales.correlation_samples, 1.0)
    phi = (tau - 1.0) / (tau + 1.0)
    for a, b, rest in zip(stretches.start, stretches.stop, stretches.rest, strict=True):
        if rest:
            noise[a:b] = scales.rest * rng.standard_normal()
        else:
            white = rng.standard_normal(b - a)
            white[1:] *= np.sqrt(1.0 - phi * phi)
            noise[a:b] = scales.motion * lfilter([1.0], [1.0, -phi], white)
    return noise
