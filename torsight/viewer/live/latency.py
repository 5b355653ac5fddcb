"""Latency statistics in memory that does not grow."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

_BIN_S: Final = 1e-4
_BINS: Final = 20_000


class Latency:
    """Counts durations in bins of 0.1 ms up to two seconds."""

    def __init__(self) -> None:
        self._count = np.zeros(_BINS, np.int64)
        self._most_s = 0.0

    def add(self, duration_s: float) -> None:
        """Count one duration."""
        self._count[min(int(duration_s / _BIN_S), _BINS - 1)] += 1
        self._most_s = max(self._most_s, duration_s)

    def percentile_ms(self, percent: float) -> float:
        """Return the duration that this share does not exceed, ms; NaN where nothing was counted."""
        total = int(self._count.sum())
        if total == 0:
            return float("nan")
        place = int(np.searchsorted(np.cumsum(self._count), percent / 100.0 * total))
        return min((place + 1) * _BIN_S, max(self._most_s, _BIN_S)) * 1e3

    def to_json(self) -> dict[str, Any]:
        """Return count, median, 99 % and the longest."""
        return {
            "frames": int(self._count.sum()),
            "median_ms": self.percentile_ms(50.0),
            "p99_ms": self.percentile_ms(99.0),
            "longest_ms": self._most_s * 1e3,
        }
