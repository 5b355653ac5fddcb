"""Runs of a series: where a condition holds, where a value stays the same."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from torsight.core.units import Flags


def runs(flag: Flags) -> list[tuple[int, int]]:
    """Return begin and end (exclusive) of every run of true flags."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flag, [False]]).astype(np.int8)))
    return [(begin, end) for begin, end in edges.reshape(-1, 2).tolist()]


def constant_runs(value: NDArray[Any]) -> list[tuple[int, int]]:
    """Return begin and end (exclusive) of every run of one value; together they cover the series."""
    edges = np.flatnonzero(value[1:] != value[:-1]) + 1
    return list(pairwise([0, *edges.tolist(), len(value)])) if len(value) else []
