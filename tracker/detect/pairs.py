"""All pairs of many dots at once: which are alike as the markers of one stick, and how clear they are."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from torsight.core.units import Floats, Ints
from tracker.appearance.dot_fit import Dot
from tracker.detect.sticks import CLEARER, LIKE, SIZES, least_length
from tracker.innovation import SIGMAS

CLEARNESS: Final = 0.5 * SIGMAS**2 / math.log(CLEARER)
"""Power of its score by which a pair is likely to be a stick: one that is less clear by a factor that tells markers
from texture is as unlikely as three standard deviations."""


class Pairs:
    """Pairs of dots that may lie on one stick as far as the dots tell; ``ends`` (p, 2) are their numbers."""

    def __init__(self, dots: Sequence[Dot]) -> None:
        self._x, self._y, self.radius_px, self._step, self._light, self._clear, sign = (
            np.array([(d.x_px, d.y_px, d.radius_px, d.step, d.light, d.explained**4, d.contrast) for d in dots])
            .reshape(-1, 7)
            .T
        )
        one, two = np.triu_indices(len(dots), 1)
        distance, needed = self._length(one, two), least_length(self.radius_px[one], self.radius_px[two])
        alike = (np.sign(sign[one]) == np.sign(sign[two])) & (distance >= needed)
        for what, limit in ((self.radius_px, SIZES), (self._step, LIKE), (self._light, LIKE)):
            alike &= np.abs(np.log(what[one] / what[two])) < math.log(limit)
        self.ends: Ints = np.stack([one[alike], two[alike]], axis=1)

    def _length(self, one: Ints, two: Ints) -> Floats:
        return np.asarray(np.hypot(self._x[one] - self._x[two], self._y[one] - self._y[two]))

    def score_of(self, ends: Ints) -> Floats:
        """Return how clearly pairs (p, 2) may be sticks, as far as their dots tell."""
        one, two = ends.T
        step = np.minimum(self._step[one], self._step[two])
        likeness = np.exp(
            -sum(np.abs(np.log(what[one] / what[two])) for what in (self.radius_px, self._step, self._light))
        )
        return np.asarray(likeness * self._clear[one] * self._clear[two] * np.sqrt(step))

    def unlike(self, ends: Ints, other: Ints) -> Floats:
        """Return χ² of pairs (p, 2) and another one (2,) as sticks of one make: step of their dots, light, length."""
        found = np.zeros(len(ends))
        for what, limit in ((self._step, LIKE), (self._light, LIKE)):
            found += (SIGMAS * np.log(what[ends].sum(axis=1) / what[other].sum()) / math.log(limit)) ** 2
        length = self._length(*ends.T) / self._length(*other)
        return found + np.asarray((SIGMAS * np.log(length) / math.log(SIZES)) ** 2)
