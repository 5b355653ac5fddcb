"""Extremes of a series: where it turns back by more than a threshold."""

from __future__ import annotations

from torsight.core.units import Floats


def extremes(value: Floats, threshold: float, *, stride: int = 1) -> list[int]:
    """Return the indices of extremes that differ from the next by at least the threshold.

    Minima and maxima alternate. The first and the last extreme lie wherever the series begins and ends.

    Parameters
    ----------
    value : (n,) float64
        The series, finite.
    threshold : float
        Least way between two extremes, in the series' unit.
    stride : int
        Look at every stride-th sample only.
    """
    turns = [0]
    low = high = 0
    lowest = highest = float(value[0])
    direction = 0
    for place, sample in enumerate(value[::stride].tolist()):
        index = place * stride
        if sample > highest:
            high, highest = index, sample
        if sample < lowest:
            low, lowest = index, sample
        if direction <= 0 and sample - lowest >= threshold:
            turns.append(low)
            direction, high, highest = 1, index, sample
        elif direction >= 0 and highest - sample >= threshold:
            turns.append(high)
            direction, low, lowest = -1, index, sample
    turns.append(high if direction > 0 else low)
    return turns
