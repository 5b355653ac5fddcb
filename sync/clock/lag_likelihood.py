"""Estimation of the sensor's lag from the roundness of the changepoints in the log.

A changepoint cannot be sharper than the sensor's lag allows: its roundness is an upper limit of the lag. It equals the
lag where the power was cut abruptly, which is how these springs are driven. This case has most of the weight; the rest
is spread evenly over smaller lags, because the changepoint may have been rounded by another cause.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.special import softmax

from sync.clock.clock_priors import PRIORS
from sync.clock.gaussian_mixture import NEGLIGIBLE_LOG
from sync.signals.changepoints import MAX_LAG_S, Changepoint
from sync.signals.even_signal import WINDOW_S
from torsight.core.series import robust_sigma
from torsight.core.units import Floats

SHORT_LAG_S: Final = 0.1 * WINDOW_S
"""Lag below which signals that are smoothed over the window show no effect."""


@dataclass(frozen=True, slots=True, eq=False)
class LagMixture:
    """The distribution of the sensor's lag: lags ``grid_s`` (n,) with the logarithms of their weights.

    ``value_s`` and ``sigma_s`` are the roundness of the log's changepoints, None without a measurable one; ``split`` is
    the share of the lag in a second stage.
    """

    value_s: float | None
    sigma_s: float | None
    grid_s: Floats
    log_weight: Floats
    split: float = 0.0


def lag_mixture(changepoints: Sequence[Changepoint]) -> LagMixture:
    """Return the distribution of the lag from all changepoints of a log."""
    # A lag at the end of the grid is a bound, not a value.
    usable = [one for one in changepoints if one.lag_s < 0.9 * MAX_LAG_S and one.lag_sigma_s < 2.0]
    if not usable:
        some = np.arange(0.25, MAX_LAG_S, 0.5)
        weight = np.concatenate([[PRIORS.no_lag], np.full(len(some), (1.0 - PRIORS.no_lag) / len(some))])
        return LagMixture(None, None, np.concatenate([[0.0], some]), np.log(weight))
    value, sigma = _pooled(usable)
    sigma = float(np.sqrt(sigma**2 + (PRIORS.lag_model * value) ** 2 + 0.02**2))
    grid = np.unique(
        np.concatenate([np.linspace(0.0, value, 30), np.linspace(max(value - 4 * sigma, 0.0), value + 4 * sigma, 33)])
    )
    width = np.gradient(grid) if len(grid) > 1 else np.ones(1)
    peak = np.exp(-0.5 * ((grid - value) / sigma) ** 2) * width
    below = np.where(grid <= value + 1e-12, width, 0.0)
    weight = PRIORS.lag_is_roundness * peak / peak.sum() + (1.0 - PRIORS.lag_is_roundness) * below / max(
        float(below.sum()), 1e-12
    )
    return LagMixture(value, sigma, grid, np.log(np.maximum(weight, 1e-12)))


def weighed_lags(options: Mapping[float, Sequence[Changepoint]]) -> LagMixture:
    """Return the mixture of lags in one stage and in two, weighted by their likelihood of the changepoints.

    ``options`` holds the changepoints of a log as fitted with each share of a second stage.
    """
    mixture = {split: lag_mixture(changepoints) for split, changepoints in options.items()}
    fits = {split: sum(changepoint.log_fit for changepoint in changepoints) for split, changepoints in options.items()}
    best = max(fits, key=lambda split: fits[split])
    chosen = mixture[best]
    if chosen.value_s is None:
        return chosen
    likely = [
        split for split in fits if fits[split] > fits[best] - NEGLIGIBLE_LOG and mixture[split].value_s is not None
    ]
    total = float(np.log(sum(np.exp(fits[split] - fits[best]) for split in likely)))
    weights = [mixture[split].log_weight + fits[split] - fits[best] - total for split in likely]
    grid = np.concatenate([mixture[split].grid_s for split in likely])
    return replace(chosen, grid_s=grid, log_weight=np.concatenate(weights), split=best)


def _pooled(changepoints: Sequence[Changepoint]) -> tuple[float, float]:
    """Return the common lag of all changepoints and its sigma, from their likelihoods, without outliers."""
    lag_s = np.array([one.lag_s for one in changepoints])
    middle, typical = float(np.median(lag_s)), float(np.median([one.lag_sigma_s for one in changepoints]))
    spread = robust_sigma(lag_s - middle)
    reach = 4.0 * max(typical, spread, 0.02)
    grid = np.linspace(max(0.0, middle - reach), middle + reach, 201)
    total = np.zeros(len(grid))
    for one in changepoints:
        if abs(one.lag_s - middle) > reach:
            continue
        inside = (grid >= one.lags_s[0]) & (grid <= one.lags_s[-1])
        outside = -0.5 * ((grid - one.lag_s) / max(one.lag_sigma_s, 1e-6)) ** 2
        known = np.interp(grid, one.lags_s, one.lag_log_likelihood) - float(one.lag_log_likelihood.max())
        total += np.maximum(np.where(inside, known, outside), -30.0)
    # Changepoints whose scatter exceeds their own sigmas count less.
    scale = max(1.0, spread / max(typical, 1e-9)) ** 2
    weight = softmax(total / scale)
    value = float(grid[int(np.argmax(weight))])
    return value, float(np.sqrt(weight @ (grid - value) ** 2))
