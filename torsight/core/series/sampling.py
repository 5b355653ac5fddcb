"""How densely a series is sampled, between which ends it lies, and fewer samples of it."""

from __future__ import annotations

import numpy as np

from torsight.core.units import Floats


def usual_step(times: Floats) -> float:
    """Return the median of the steps forward between neighbours (n,); 0 where there is none."""
    step = np.diff(times)
    step = step[step > 0.0]
    return float(np.median(step)) if len(step) else 0.0


def extent(values: Floats) -> tuple[float, float]:
    """Return between what values lie: 99 % of those that are known, so that a wrong one in 200 does not widen it.

    Half and twice that share move the ends by what the slowest motion passes in as many samples.
    """
    low, high = np.nanquantile(values, [0.005, 0.995])
    return float(low), float(high)


def block_means(values: Floats, every: int) -> Floats:
    """Return the means (n // every, …) of so many samples (n, …) that follow each other; a rest is left out."""
    if every < 2:
        return values
    whole = len(values) // every * every
    return np.asarray(values[:whole].reshape(-1, every, *values.shape[1:]).mean(axis=1))
