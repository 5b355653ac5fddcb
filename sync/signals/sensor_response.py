"""What a sensor with a first-order lag, in one stage or in two, shows of a ramp and of a decay."""

from __future__ import annotations

import math

import numpy as np

from torsight.core.units import Floats


def lagged_ramp(x_s: Floats, lag_s: float, split: float = 0.0) -> Floats:
    """Return what a sensor with a lag in one stage, or in two, shows of ``max(x, 0)``."""
    x = np.maximum(x_s, 0.0)
    if lag_s <= 0.0:
        return x
    late = np.zeros_like(x)
    for weight, stage_s in _stages(lag_s, split):
        late += weight * stage_s * np.exp(-x / stage_s)
    return np.asarray(x - lag_s + late)


def lagged_decay(x_s: Floats, decay_s: float, lag_s: float, split: float = 0.0) -> Floats:
    """Return what a sensor with a lag in one stage, or in two, shows of ``1 - exp(-x / decay)`` from x = 0 on."""
    x = np.maximum(x_s, 0.0)
    if lag_s <= 0.0:
        return np.asarray(1.0 - np.exp(-x / decay_s))
    left = np.zeros_like(x)
    for weight, stage_s in _stages(lag_s, split):
        # Where both times are equal the fraction has a limit; a thousandth beside it will do.
        own_s = 1.002 * stage_s if math.isclose(stage_s, decay_s, rel_tol=1e-3) else stage_s
        left += weight / (decay_s - own_s) * (decay_s * np.exp(-x / decay_s) - own_s * np.exp(-x / own_s))
    return np.asarray(1.0 - left)


def _stages(lag_s: float, split: float) -> list[tuple[float, float]]:
    """Return two first-order lags in a row as a weighted sum of both: weights and times, the weights adding up to 1."""
    if split <= 0.0:
        return [(1.0, lag_s)]
    first_s, second_s = (1.0 - split) * lag_s, split * lag_s
    return [(first_s / (first_s - second_s), first_s), (-second_s / (first_s - second_s), second_s)]
