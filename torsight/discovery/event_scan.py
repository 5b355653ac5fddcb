r"""When an event happened: a scan of a record for the time at which a step explains most of a residual.

At each time of a grid the response c (n,) of the model to an event of unit size there is computed. Beside the values x
that are fitted already, of which the event may have pulled any off, the best size of the event and the decrease of the
objective are those of the linear model,

.. math:: \hat s = \frac{b}{h}, \quad ΔC = \frac{b^2}{h}, \qquad
          h = c^\top W c - a^\top N^{-1} a, \quad b = c^\top W r - a^\top N^{-1} g, \quad a = J^\top W c

with J the derivatives by x, r the residual, W its weights (:mod:`.weight`), N and g the normal equations of x with
their priors. Source: the generalised likelihood ratio for jumps at unknown times, Willsky and Jones, IEEE Trans. Autom.
Control 21 (1976) 108. A residual alone shows an event at the wrong time where x has taken up a part of the step.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np

from torsight.core.units import Floats
from torsight.discovery.weight import NOTHING, Weight

_TIMES: Final = 32
"""Times of the grid over a record: four in each half-cycle of four cycles, so that strokes and rests have one each."""
_KEPT: Final = 3
"""Events of each sign that are returned: the linear model's first is not always the model's own."""


@dataclass(frozen=True, slots=True)
class Event:
    """An event at a time, with the size and the decrease of the objective that the linear model gives it."""

    gain: float
    at: float
    size: float


@dataclass(frozen=True, eq=False)
class EventScan:
    """A fitted set beside which an event is sought.

    Attributes
    ----------
    predict : callable
        Predictions (n,) for pairs of an event's time and size.
    prediction, residual : (n,) arrays
        Prediction without the event, and measured minus prediction (0 where a sample does not count).
    derivative : (n, m) array
        Derivatives J of the prediction by the set's values.
    normal, gradient : (m, m) array, (m,) array
        Normal equations N and g of the set's values, with their priors.
    weight : Weight
        Information in the residual.
    """

    predict: Callable[[Sequence[tuple[float, float]]], Sequence[Floats]]
    prediction: Floats
    residual: Floats
    derivative: Floats
    normal: Floats
    gradient: Floats
    weight: Weight

    def events(self, first: float, last: float, *, size: float, closest: float) -> list[Event]:
        """Return the likeliest events between two times, best first.

        ``size`` is the magnitude at which responses are computed, of either sign; times are resolved to ``closest``.
        """
        times = np.linspace(first, last, _TIMES + 2)[1:-1]
        # Where the response to a step down is minus that to a step up, one scan finds both.
        up, down = (self._responses(times[[_TIMES // 2]], signed) for signed in (size, -size))
        either = bool(up.any()) and bool(np.allclose(up, down))
        found: list[Event] = []
        for signed in (size,) if either else (size, -size):
            at = partial(self._at, size=signed, either=either)
            on_grid = at(times)
            gains = np.array([0.0, *(event.gain for event in on_grid), 0.0])
            peaks = (gains[1:-1] > 0.0) & (gains[1:-1] >= gains[:-2]) & (gains[1:-1] > gains[2:])
            best = sorted((on_grid[i] for i in np.flatnonzero(peaks)), key=lambda event: -event.gain)[:_KEPT]
            found += [_refined(event, at, float(times[1] - times[0]), closest) for event in best]
        return sorted(found, key=lambda event: -event.gain)

    def _responses(self, times: Floats, size: float) -> Floats:
        """Return the responses (n, k) to an event of unit size, and of the size's sign, at some times (k,)."""
        there = np.column_stack(self.predict([(float(at), size) for at in times]))
        return np.asarray((there - self.prediction[:, None]) / size)

    def _at(self, times: Floats, *, size: float, either: bool) -> list[Event]:
        """Return the event at each of some times, of the size's sign or of ``either``; its gain may be zero."""
        response = self._responses(times, size)
        weighted = self.weight.times(response)
        across = self.derivative.T @ weighted
        taken = np.linalg.solve(self.normal, across)
        whole = np.sum(response * weighted, axis=0)
        left = whole - np.sum(across * taken, axis=0)
        slope = weighted.T @ self.residual - taken.T @ self.gradient
        seen = (left > NOTHING * whole) & (either | (slope * size > 0.0))
        left = np.where(seen, left, 1.0)
        return [
            Event(float(s**2 / h) if can else 0.0, float(at), float(s / h) if can else 0.0)
            for at, s, h, can in zip(times, slope, left, seen, strict=True)
        ]


def _refined(event: Event, at: Callable[[Floats], list[Event]], spacing: float, closest: float) -> Event:
    """Return the event with the largest gain around one on a grid of some spacing, its time to ``closest``."""
    while spacing > closest:
        spacing /= 2.0
        event = max(event, *at(np.array([event.at - spacing, event.at + spacing])), key=lambda one: one.gain)
    return event
