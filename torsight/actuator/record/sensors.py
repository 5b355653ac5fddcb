"""The readings of both sensors as logged, and the temperatures of the wires for slow sensors."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np

from torsight.actuator.record.conditioning import Readings
from torsight.actuator.record.turns import at_places, turns_of
from torsight.core.units import Floats, Ints

Pair = tuple[Floats, Floats]

LAG_GRID_S: Final = (0.0, 0.7, 1.5, 2.5, 3.7, 5.2, 7.0, 9.2, 12.0, 16.0, 21.0, 28.0, 38.0, 52.0, 70.0)
"""Time constants for which the wires' temperatures are estimated; between them they are interpolated. For 3 s the error
is then 14.35 mK, that of a direct estimate 14.26 mK (benchmarks/actuator/log_constants.py)."""


_COUNTS: Final = 0.0625
"""Weight of the evidence that a log gives for a time constant: with it, the evidence for the true one is less than that
for the best by as much as of an estimate with one Gaussian error (benchmarks/actuator/log_lags.py)."""


class Added(NamedTuple):
    """Errors (n,) of both springs' temperatures, as uncertain as the temperatures in the rows ``of_row`` (n,) are."""

    error_c: Pair
    of_row: Ints


class _Wire(NamedTuple):
    """A wire's temperature (n,) less its sensor's, and the factor (n,) by which the correction magnifies noise.

    ``log_evidence`` is that of the readings for the time constant, up to a constant.
    """

    off_c: Floats
    growth: Floats
    log_evidence: float


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
    _known: dict[float, tuple[_Wire, _Wire]] = field(default_factory=dict)

    def get_ready(self) -> None:
        """Compute the corrections of :meth:`lag_correction` for all time constants."""
        for lag_s in LAG_GRID_S:
            self._at(lag_s)

    def lag_correction(self, spring: int, lag_s: float) -> tuple[float, Floats, Floats]:
        """Return the differences of a wire's from its sensor's temperature at the kept rows, for a time constant.

        They are computed and cached for a grid of time constants. Returned are the weight of the upper of the two
        neighbouring grid points, and the differences at the lower and at the upper one.
        """
        low = min(max(bisect_right(LAG_GRID_S, lag_s) - 1, 0), len(LAG_GRID_S) - 2)
        share = (lag_s - LAG_GRID_S[low]) / (LAG_GRID_S[low + 1] - LAG_GRID_S[low])
        return share, self._correction(spring, LAG_GRID_S[low]), self._correction(spring, LAG_GRID_S[low + 1])

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
            sharp = _COUNTS * np.array([self._at(lag_s)[spring].log_evidence for lag_s in LAG_GRID_S])
            # The mean likelihood of all longer time constants.
            longer = np.logaddexp.accumulate(sharp[::-1])[::-1][1:] - np.log(np.arange(len(sharp) - 1, 0, -1))
            either = np.append(np.logaddexp(sharp[:-1], longer) - np.log(2.0), sharp[-1])
            found.append(either - either[0])
        return found[0], found[1]

    def _correction(self, spring: int, lag_s: float) -> Floats:
        """Return the differences at a grid point; errors that were added grow as the smoother's own do."""
        wire = self._at(lag_s)[spring]
        return wire.off_c + sum(one.error_c[spring] * (wire.growth[one.of_row] - 1.0) for one in self.errors)

    def _at(self, lag_s: float) -> tuple[_Wire, _Wire]:
        if lag_s not in self._known:
            none = np.zeros(len(self.rows))
            a, b = (
                self._behind(readings, driven_c, lag_s) if lag_s > 0.0 else _Wire(none, none + 1.0, evidence)
                for readings, driven_c, evidence in zip(self.readings, self.driven_c, self.without_lag, strict=True)
            )
            self._known[lag_s] = (a, b)
        return self._known[lag_s]

    def _behind(self, readings: Readings, driven_c: Floats, lag_s: float) -> _Wire:
        found = readings.behind(self.time_s, lag_s)
        sigma, one = found.sigma_c[self.rows], np.ones(len(self.rows))
        growth = np.divide(sigma, self.sigma_c, out=one, where=self.sigma_c > 0.0)
        # The wire's temperature at the kept rows, with its turns at their full height.
        wire_c = at_places(found.temp_c, turns_of(found.temp_c, self.least_turn_c), self.rows.astype(float))
        return _Wire(wire_c - driven_c, growth, found.log_evidence)
