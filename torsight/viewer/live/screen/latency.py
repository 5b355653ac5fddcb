"""Latency statistics in constant memory."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from torsight.core.progress import AT_ONCE_S

_BIN_S: Final = AT_ONCE_S / 1000
"""Width of a bin: a thousandth of the latency that a person perceives as immediate, 0.1 ms."""
_BINS: Final = round(2.0 / _BIN_S)
CELLS: Final = _BINS + 1
"""Size of the buffer in numbers of 64 bits; the last number is the longest duration in nanoseconds."""


class Latency:
    """Counts durations in bins of 0.1 ms up to two seconds.

    The counts may be in a buffer of :data:`CELLS` whole numbers of 64 bits that another process reads.
    """

    def __init__(self, shared: Any = None) -> None:
        cells = np.zeros(CELLS, np.int64) if shared is None else np.frombuffer(shared, np.int64)
        self._count, self._most_ns = cells[:-1], cells[-1:]

    def add(self, duration_s: float) -> None:
        """Count one duration."""
        self._count[min(max(int(duration_s / _BIN_S), 0), _BINS - 1)] += 1
        self._most_ns[0] = max(int(self._most_ns[0]), round(duration_s * 1e9))

    def percentile_ms(self, percent: float) -> float:
        """Return the duration that this percentage of the latencies does not exceed, ms; NaN where none was counted."""
        total = int(self._count.sum())
        if total == 0:
            return float("nan")
        place = int(np.searchsorted(np.cumsum(self._count), percent / 100.0 * total))
        return min((place + 1) * _BIN_S, max(self._most_s, _BIN_S)) * 1e3

    @property
    def _most_s(self) -> float:
        return float(self._most_ns[0]) * 1e-9

    def to_json(self) -> dict[str, Any]:
        """Return count, median, 99 % and the longest."""
        return {
            "frames": int(self._count.sum()),
            "median_ms": self.percentile_ms(50.0),
            "p99_ms": self.percentile_ms(99.0),
            "longest_ms": self._most_s * 1e3,
        }
