"""The readings of both sensors as logged, and the temperatures of the wires for slow sensors."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass, field
from functools import cached_property
from typing import Final

import numpy as np

from torsight.actuator.record.conditioning import Readings
from torsight.actuator.record.turns import at_places, turns_of
from torsight.core.parallel.threads import with_help
from torsight.core.units import Floats, Ints

Pair = tuple[Floats, Floats]

_LAG_GRID_S: Final = (0.0, 0.7, 1.5, 2.5, 3.7, 5.2, 7.0, 9.2, 12.0, 16.0, 21.0, 28.0, 38.0, 52.0, 70.0)
"""Time constants for which the wires' temperatures are estimated; between them they are interpolated. For 3 s the error
is then 14.35 mK, that of a direct estimate 14.26 mK (benchmarks/actuator/log_constants.py)."""


@dataclass(frozen=True, eq=False)
class Sensors:
    """The temperatures as logged, for effects that need them.

    ``time_s`` (m,) and both ``temps_c`` (m,) are the log's, gaps bridged; ``rows`` (n,) are those of its rows that the
    whole drive keeps, ``driven_c`` both conditioned temperatures (n,) there. A reversal of a temperature counts as a
    turn from ``least_turn_c`` on.
    """

    time_s: Floats
    temps_c: Pair
    rows: Ints
    driven_c: Pair
    least_turn_c: float
    _known: dict[float, Pair] = field(default_factory=dict)

    @cached_property
    def _readings(self) -> tuple[Readings, Readings]:
        a, b = (Readings.of(self.time_s, temp) for temp in self.temps_c)
        return a, b

    def get_ready(self) -> None:
        """Compute the corrections of :meth:`lag_correction` for all time constants."""
        missing = [lag_s for lag_s in _LAG_GRID_S if lag_s not in self._known]
        # The readings are computed before two threads use them.
        if missing and self._readings:
            with_help(missing, self._at)

    def lag_correction(self, lag_s: float) -> tuple[float, Pair, Pair]:
        """Return the differences of the wires' from the sensors' temperatures at the kept rows, for a time constant.

        They are computed and cached for a grid of time constants. Returned are the weight of the upper of the two
        neighbouring grid points, and the differences at the lower and at the upper one.
        """
        low = min(max(bisect_right(_LAG_GRID_S, lag_s) - 1, 0), len(_LAG_GRID_S) - 2)
        share = (lag_s - _LAG_GRID_S[low]) / (_LAG_GRID_S[low + 1] - _LAG_GRID_S[low])
        return share, self._at(_LAG_GRID_S[low]), self._at(_LAG_GRID_S[low + 1])

    def _at(self, lag_s: float) -> Pair:
        if lag_s not in self._known:
            none = np.zeros(len(self.rows))
            a, b = (
                self._kept(readings.behind(self.time_s, lag_s).temp_c) - driven_c if lag_s > 0.0 else none
                for readings, driven_c in zip(self._readings, self.driven_c, strict=True)
            )
            self._known[lag_s] = (a, b)
        return self._known[lag_s]

    def _kept(self, wire_c: Floats) -> Floats:
        """Return a wire's temperature (m,) at the kept rows, with its turns at their full height."""
        return at_places(wire_c, turns_of(wire_c, self.least_turn_c), self.rows.astype(float))
