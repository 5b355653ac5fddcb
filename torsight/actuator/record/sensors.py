"""The readings of both sensors as logged, and the temperatures of the wires for slow sensors."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np

from torsight.actuator.record.conditioning import Readings
from torsight.actuator.record.smoother import Smoothed
from torsight.core.parallel.threads import in_parallel
from torsight.core.units import Floats, Ints

Pair = tuple[Floats, Floats]

LAG_GRID_S: Final = (0.0, 0.7, 1.5, 2.5, 3.7, 5.2, 7.0, 9.2, 12.0, 16.0, 21.0, 28.0, 38.0, 52.0, 70.0)
"""Time constants for which the wires' temperatures are estimated; between them they are interpolated. For 3 s the error
is then 14.09 mK, that of a direct estimate 14.08 mK (benchmarks/actuator/log_constants.py, --seeds 10)."""

_COUNTS: Final = 0.0625
"""Weight of the evidence that a log gives for a time constant: with it, the evidence for the true one is less than that
for the best by as much as of an estimate with one Gaussian error (benchmarks/actuator/log_lags.py)."""


class Added(NamedTuple):
    """Errors (n,) of both springs' temperatures.

    They are as uncertain as the temperatures in their rows, or as the tops of their half-cycles, which begin in the
    rows ``begins`` (k,) and whose highest readings lie in the rows ``tops`` (k,).
    """

    error_c: Pair
    begins: Ints | None = None
    tops: Ints | None = None


@dataclass(frozen=True, eq=False)
class Sensors:
    """The readings as logged, for effects that need them.

    ``time_s`` (m,) are the log's times, ``readings`` those of both springs; ``rows`` (n,) are the rows that the whole
    drive keeps, ``driven_c`` both conditioned temperatures (n,) there and ``sigma_c`` (n,) their standard deviation. A
    reversal of a temperature counts as a turn from ``least_turn_c`` on. ``without_lag`` is the log evidence of both
    readings for sensors without a lag. ``errors`` were added to the conditioned temperatures.
    """

    time_s: Floats
    readings: tuple[Readings, Readings]
    rows: Ints
    driven_c: Pair
    sigma_c: Floats
    least_turn_c: float
    without_lag: tuple[float, float]
    errors: Sequence[Added] = ()
    _known: dict[float, tuple[Smoothed, Smoothed]] = field(default_factory=dict)
    _last: dict[tuple[int, float], tuple[Floats, Floats]] = field(default_factory=dict)

    def get_ready(self) -> None:
        """Estimate the wires' temperatures for all time constants."""
        in_parallel(LAG_GRID_S, self._wires)

    def lag_correction(self, spring: int, lag_s: float) -> Floats:
        """Return the difference (n,) of a wire's from its sensor's temperature at the kept rows, for a time constant.

        Errors that were added to the conditioned temperatures grow as the smoother's own do.
        """
        if (spring, lag_s) not in self._last:
            # Kept are those beside which other values change, and a few of a step of the lag.
            if len(self._last) >= 16:
                self._last.clear()
            self._last[spring, lag_s] = self._behind(spring, lag_s)
        off_c, sigma_c = self._last[spring, lag_s]
        return off_c + sum(
            one.error_c[spring] * (self._growth(spring, off_c, sigma_c, one) - 1.0) for one in self.errors
        )

    def _growth(self, spring: int, off_c: Floats, sigma_c: Floats, added: Added) -> Floats:
        """Return the factor (n,) by which a correction with the sigmas ``sigma_c`` (n,) magnifies added errors."""
        own_c = self.sigma_c
        if added.begins is not None and added.tops is not None:
            # The wire's top lies before that of a slow sensor.
            wire_c, ends = self.driven_c[spring] + off_c, [*added.begins[1:], len(off_c)]
            rows = [begin + int(np.argmax(wire_c[begin:end])) for begin, end in zip(added.begins, ends, strict=True)]
            lengths = np.diff([*added.begins, len(off_c)])
            sigma_c, own_c = np.repeat(sigma_c[rows], lengths), np.repeat(own_c[added.tops], lengths)
        return np.divide(sigma_c, own_c, out=np.ones(len(off_c)), where=own_c > 0.0)

    def log_evidence(self, lag_a_s: float, lag_b_s: float) -> float:
        r"""Return the log-likelihood ratio of the readings for the sensors' time constants, against no lag.

        A log with sharp corners was not read by a slow sensor. But a log with rounded corners may be that of a fast
        sensor on a wire whose own temperature has rounded corners. With even odds for both, and all roundings of the
        wire equally likely on the grid of time constants,
        :math:`p(T_m | τ) ∝ L(τ) + \overline{L(ρ)}_{ρ > τ}`, where L is the likelihood for a sharp wire.
        """
        return sum(
            float(np.interp(lag_s, LAG_GRID_S, self._evidence[spring]))
            for spring, lag_s in enumerate((lag_a_s, lag_b_s))
        )

    @cached_property
    def _evidence(self) -> tuple[Floats, Floats]:
        """The log-likelihood ratios of both sensors' readings for every time constant of the grid."""
        found = []
        for spring in range(2):
            sharp = _COUNTS * np.array([self._log_evidence(spring, lag_s) for lag_s in LAG_GRID_S])
            # The mean likelihood of all longer time constants.
            longer = np.logaddexp.accumulate(sharp[::-1])[::-1][1:] - np.log(np.arange(len(sharp) - 1, 0, -1))
            either = np.append(np.logaddexp(sharp[:-1], longer) - np.log(2.0), sharp[-1])
            found.append(either - either[0])
        return found[0], found[1]

    def _log_evidence(self, spring: int, lag_s: float) -> float:
        return self._wires(lag_s)[spring].log_evidence if lag_s > 0.0 else self.without_lag[spring]

    def _behind(self, spring: int, lag_s: float) -> tuple[Floats, Floats]:
        """Return the difference for a time constant, and the standard deviation (n,) of the wire's temperature.

        The wire's temperature is interpolated between the neighbours on the grid before its tops are sought: those at
        the neighbours lie elsewhere, and would be interpolated to lower ones.
        """
        low = min(max(bisect_right(LAG_GRID_S, lag_s) - 1, 0), len(LAG_GRID_S) - 2)
        shorter_s, longer_s = LAG_GRID_S[low : low + 2]
        share = (lag_s - shorter_s) / (longer_s - shorter_s)
        longer = self._wires(longer_s)[spring]
        if low == 0:
            # Without a lag the sensor's temperature is the wire's, also where the conditioning did more than smooth.
            off_c, sigma_c = self._at_rows(spring, longer, longer_s)
            return share * off_c, self.sigma_c + share * (sigma_c - self.sigma_c)
        shorter = self._wires(shorter_s)[spring]
        return self._at_rows(spring, shorter.towards(longer, share), lag_s)

    def _at_rows(self, spring: int, wire: Smoothed, lag_s: float) -> tuple[Floats, Floats]:
        found = self.readings[spring].at(self.time_s[self.rows], wire, lag_s, least_turn_c=self.least_turn_c)
        return found.temp_c - self.driven_c[spring], found.sigma_c

    def _wires(self, lag_s: float) -> tuple[Smoothed, Smoothed]:
        """Return both wires' temperatures at the readings for a time constant of the grid."""
        if lag_s not in self._known:
            a, b = (readings.wire(lag_s) for readings in self.readings)
            self._known[lag_s] = a, b
        return self._known[lag_s]
