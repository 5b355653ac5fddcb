"""Response of a sensor with a first-order lag, in one stage or in two, to a ramp and to a decay."""

from __future__ import annotations

import numpy as np

from torsight.core.units import Floats


def lagged_ramp(x_s: Floats, lag_s: Floats | float, split: float) -> Floats:
    """Return the response of a sensor with a lag in one stage, or in two, to ``max(x, 0)``; lags broadcast with x."""
    x = np.maximum(x_s, 0.0)
    late = sum(weight * stage_s * np.exp(-x / stage_s) for weight, stage_s in _stages(lag_s, split))
    return np.asarray(x - lag_s + late)


def lagged_decay(x_s: Floats, decay_s: float, lag_s: Floats | float, split: float) -> Floats:
    """Return the response of a sensor with a lag in one stage, or in two, to ``1 - exp(-x / decay)`` from x = 0 on."""
    x = np.maximum(x_s, 0.0)
    left, plain = np.zeros(()), decay_s * np.exp(-x / decay_s)
    for weight, stage_s in _stages(lag_s, split):
        # For equal time constants the fraction has a limit, approximated a thousandth beside it.
        own_s = np.where(np.abs(stage_s - decay_s) <= 1e-3 * decay_s, 1.002 * stage_s, stage_s)
        left = left + weight / (decay_s - own_s) * (plain - own_s * np.exp(-x / own_s))
    return np.asarray(1.0 - left)


def _stages(lag_s: Floats | float, split: float) -> list[tuple[float, Floats]]:
    """Return two first-order lags in series as a weighted sum of both: weights, which add up to 1, and times."""
    # Lags are divisors: a lag of 0 is replaced by the smallest number that changes no sum.
    whole_s = np.maximum(lag_s, np.finfo(np.float64).eps)
    if split <= 0.0:
        return [(1.0, whole_s)]
    first, second = 1.0 - split, split
    return [(first / (first - second), first * whole_s), (-second / (first - second), second * whole_s)]
