"""What is read off a series of samples: where a condition holds, and how much its readings scatter."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

_NORMAL_MEDIAN: Final = 0.6745
"""Median of the absolute value of a standard normal variable."""
_THIRD_DIFFERENCE: Final = 20.0
"""Variance of the third difference of white noise of variance one: 1 + 9 + 9 + 1."""


def runs(flag: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return begin and end (exclusive) of every run of true flags."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flag, [False]]).astype(np.int8)))
    return [(begin, end) for begin, end in edges.reshape(-1, 2).tolist()]


def scatter(*pieces: NDArray[np.float64], stride: int = 1) -> float:
    """Return the standard deviation of one reading of evenly sampled pieces, one of them longer than three strides.

    Third differences, of samples that are ``stride`` apart, leave almost nothing of a slow trend, and their median is
    blind to the odd glitch.
    """
    third = np.concatenate([_third_difference(piece, stride) for piece in pieces])
    return float(np.median(np.abs(third))) / _NORMAL_MEDIAN / float(np.sqrt(_THIRD_DIFFERENCE))


def _third_difference(piece: NDArray[np.float64], stride: int) -> NDArray[np.float64]:
    count = max(0, len(piece) - 3 * stride)
    first, second, third, fourth = (piece[k * stride : k * stride + count] for k in range(4))
    return fourth - 3.0 * third + 3.0 * second - first
