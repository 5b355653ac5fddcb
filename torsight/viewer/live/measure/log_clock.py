"""The log's clock beside the film's, while both run."""

from __future__ import annotations

import math
from collections import deque


class LogClock:
    """From the log's clock to the film's while both run; ``offset_s`` is log's less film's time where it is known.

    A row cannot arrive before it was written: the largest difference between a row's stamp and the film's time at its
    arrival is the offset, to within the shortest delay. Rows that lie there at the start say nothing; they are taken to
    be of the film's clock until a row arrives.
    """

    def __init__(self, offset_s: float | None) -> None:
        self.offset_s = 0.0 if offset_s is None else offset_s
        self._fixed = offset_s is not None
        self._heard = False
        self._waiting: deque[tuple[float, ...]] = deque()

    def rows(self, rows: list[tuple[float, ...]], *, now_s: float | None) -> None:
        """Take rows that arrived at film time ``now_s``; None: they were there before."""
        self._waiting.extend(row for row in rows if math.isfinite(row[0]))
        if self._fixed or now_s is None or not rows:
            return
        newest = rows[-1][0] - now_s
        self.offset_s = newest if not self._heard else max(self.offset_s, newest)
        self._heard = True

    def due(self, now_s: float) -> list[tuple[float, tuple[float, ...]]]:
        """Return the rows whose time has come, with their times on the film's clock."""
        found = []
        while self._waiting and self._waiting[0][0] - self.offset_s <= now_s + 1e-9:
            row = self._waiting.popleft()
            found.append((row[0] - self.offset_s, row))
        return found
