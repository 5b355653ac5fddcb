"""Both sensors' readings as logged, for effects that go back to them: in, a log; out, the wires behind slow sensors."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Final

import numpy as np

from torsight.actuator.record.conditioning import Readings
from torsight.actuator.record.turns import at_places, turns_of
from torsight.core.units import Floats, Ints

Pair = tuple[Floats, Floats]

_LAG_GRID_S: Final = (0.0, 0.7, 1.5, 2.5, 3.7, 5.2, 7.0, 9.2, 12.0, 16.0, 21.0, 28.0, 38.0, 52.0, 70.0)
"""Time constants for which wires behind their sensors are found; what lies between is on a line. Between 2.5 and 3.7 s
they err by 14.35 mK then, and by 14.26 mK as found for 3 s itself (benchmarks/actuator/log_constants.py)."""


@dataclass(frozen=True, eq=False)
class Sensors:
    """The temperatures as logged, for effects that must go back to them.

    Attributes
    ----------
    time_s : (m,) float64
        Times of the log.
    temps_c : two (m,) float64
        Both temperatures, gaps bridged.
    rows : (n,) int64
        Rows of the log that the drive keeps (all that it keeps, where some of a drive's rows are taken).
    driven_c : two (n,) float64
        Both temperatures there, conditioned.
    sigma_c : (n,) float64
        One standard deviation of the driven spring's.
    least_turn_c : float
        By how much a temperature goes back where it turns.
    error_c : two (n,) float64, optional
        By how much the conditioned temperatures are taken to be off: wires behind slow sensors are then off as many
        standard deviations of their own.
    """

    time_s: Floats
    temps_c: Pair
    rows: Ints
    driven_c: Pair
    sigma_c: Floats
    least_turn_c: float
    error_c: Pair | None = None
    _known: dict[float, tuple[Pair, Pair]] = field(default_factory=dict)
    _right: Sensors | None = None

    @cached_property
    def _readings(self) -> tuple[Readings, Readings]:
        a, b = (Readings.of(self.time_s, temp) for temp in self.temps_c)
        return a, b

    def lag_correction(self, lag_s: float) -> tuple[float, Pair, Pair]:
        """Return what the wires' temperatures differ from the sensors' by at the kept rows, with this time constant.

        Made for constants on a grid, once each: the two neighbours, and the share of the way from the first to the
        second.
        """
        place = float(np.interp(lag_s, _LAG_GRID_S, np.arange(len(_LAG_GRID_S))))
        low = min(int(place), len(_LAG_GRID_S) - 2)
        share = (lag_s - _LAG_GRID_S[low]) / (_LAG_GRID_S[low + 1] - _LAG_GRID_S[low])
        return share, self._at(_LAG_GRID_S[low]), self._at(_LAG_GRID_S[low + 1])

    def off_by(self, error_c: Pair) -> Sensors:
        """Return them with the conditioned temperatures off by an error (n,) each."""
        return replace(self, error_c=error_c, _right=self._right or self)

    def _at(self, lag_s: float) -> Pair:
        """Return what the wires' temperatures differ from the conditioned ones by, errors of both included."""
        (a, b), (doubt_a, doubt_b) = (self._right or self).behind(lag_s)
        if self.error_c is None:
            return a, b
        return a + (doubt_a - 1.0) * self.error_c[0], b + (doubt_b - 1.0) * self.error_c[1]

    def behind(self, lag_s: float) -> tuple[Pair, Pair]:
        """Return by how much the wires are hotter (n,), and how many times as doubtful as the conditioned ones."""
        if lag_s not in self._known:
            n = len(self.rows)
            hotter, doubt = [np.zeros(n), np.zeros(n)], [np.ones(n), np.ones(n)]
            if lag_s > 0.0:
                for k, (readings, driven_c) in enumerate(zip(self._readings, self.driven_c, strict=True)):
                    wire = readings.behind(self.time_s, lag_s)
                    hotter[k] = self._kept(wire.temp_c) - driven_c
                    np.divide(wire.sigma_c[self.rows], self.sigma_c, out=doubt[k], where=self.sigma_c > 0.0)
            self._known[lag_s] = (hotter[0], hotter[1]), (doubt[0], doubt[1])
        return self._known[lag_s]

    def _kept(self, wire_c: Floats) -> Floats:
        """Return a wire's temperature (m,) at the kept rows, its turns among them."""
        return at_places(wire_c, turns_of(wire_c, self.least_turn_c), self.rows.astype(float))
