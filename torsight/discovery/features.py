"""Features of a closure: smooth functions of one driver each, alone and with the direction of motion.

A continuous driver gets hat functions at the quantiles of its values; a counting one (few different values, or time) a
line and a curve that levels off. All are made from numbers that are kept (:class:`Basis`), so that the same features
can be made from another record.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

DIRECTION: Final = "direction"
_TREND: Final = ("time_s", "cycle")
_KNOTS: Final = 10


@dataclass(frozen=True, slots=True)
class Basis:
    """How one driver becomes features.

    Attributes
    ----------
    driver : str
        Its name.
    knots : tuple of float
        Knots of the hat functions; start and span for a trend; empty for the direction itself.
    signed : bool
        Whether the features are multiplied by the direction of motion.
    """

    driver: str
    knots: tuple[float, ...]
    signed: bool = False

    def columns(self, drivers: Mapping[str, Array]) -> Array:
        """Return the features (n, k)."""
        values = drivers[self.driver]
        if not self.knots:
            made = values[:, None]
        elif self.driver in _TREND:
            place = (values - self.knots[0]) / self.knots[1]
            made = np.column_stack([place, 1.0 - np.exp(-3.0 * place)])
        else:
            made = _hats(values, np.array(self.knots))
        return np.asarray(made * drivers[DIRECTION][:, None] if self.signed else made, np.float64)

    def to_json(self) -> dict[str, object]:
        """Return the numbers that make the same features again."""
        return {"driver": self.driver, "knots": list(self.knots), "signed": self.signed}


def bases_of(drivers: Mapping[str, Array], weight: Array) -> dict[str, tuple[Basis, ...]]:
    """Return the bases of every driver that varies; ``weight`` (n,) says what a sample is worth."""
    found: dict[str, tuple[Basis, ...]] = {}
    counted = weight > 0.0
    for name, values in drivers.items():
        if name == DIRECTION:
            found[name] = (Basis(name, ()),)
            continue
        used = values[counted]
        span = float(np.ptp(used)) if len(used) else 0.0
        if span <= 1e-9 * max(1.0, float(np.max(np.abs(used), initial=0.0))):
            continue
        knots = (float(used.min()), span) if name in _TREND else _quantiles(used, weight[counted])
        bases = [Basis(name, knots)]
        if DIRECTION in drivers:
            bases.append(Basis(name, knots, signed=True))
        found[name] = tuple(bases)
    return found


def _quantiles(values: Array, weight: Array) -> tuple[float, ...]:
    order = np.argsort(values, kind="stable")
    share = np.cumsum(weight[order]) / weight.sum()
    places = np.searchsorted(share, np.linspace(0.02, 0.98, _KNOTS))
    picked = np.unique(values[order][np.minimum(places, len(values) - 1)])
    least = 0.02 * (picked[-1] - picked[0])
    kept = [float(picked[0])]
    for knot in picked[1:]:
        if knot - kept[-1] > least:
            kept.append(float(knot))
    return tuple(kept)


def _hats(values: Array, knots: Array) -> Array:
    """Return piecewise linear functions that are one at their knot and zero at the others, held beyond the ends."""
    if len(knots) < 2:
        return np.zeros((len(values), 0))
    inside = np.clip(values, knots[0], knots[-1])
    return np.column_stack([np.interp(inside, knots, row) for row in np.eye(len(knots))])
