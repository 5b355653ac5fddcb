"""All pairs of many dots, computed together: those similar enough for one stick, and their scores."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from torsight.core.units import Floats, Ints
from tracker.appearance.dot_fit import Dot
from tracker.detect.sticks import CLEAR, CLEARER, LIKE, SIZES, least_length
from tracker.innovation import SIGMAS, SURE

CLEARNESS: Final = 0.5 * SIGMAS**2 / math.log(CLEARER)
"""Exponent that turns a pair's score into a likelihood: a score lower by ``CLEARER``, the factor that separates markers
from texture, is as unlikely as three standard deviations."""


class Pairs:
    """Pairs of dots that may lie on one stick, judged by the dots alone; ``ends`` (p, 2) are the dots' indices."""

    def __init__(self, dots: Sequence[Dot]) -> None:
        self._x, self._y, self.radius_px, self._step, self._light, self._clear, sign = (
            np.array([(d.x_px, d.y_px, d.radius_px, d.step, d.light, d.explained**4, d.contrast) for d in dots])
            .reshape(-1, 7)
            .T
        )
        one, two = np.triu_indices(len(dots), 1)
        distance, needed = (
            self._length(np.stack([one, two], axis=1)),
            least_length(self.radius_px[one], self.radius_px[two]),
        )
        alike = (np.sign(sign[one]) == np.sign(sign[two])) & (distance >= needed)
        for what, limit in ((self.radius_px, SIZES), (self._step, SIZES), (self._light, LIKE)):
            alike &= np.abs(np.log(what[one] / what[two])) < math.log(limit)
        self.ends: Ints = np.stack([one[alike], two[alike]], axis=1)

    def _length(self, ends: Ints) -> Floats:
        (ax, bx), (ay, by) = (np.moveaxis(at[ends], -1, 0) for at in (self._x, self._y))
        return np.asarray(np.hypot(ax - bx, ay - by))

    def score_of(self, ends: Ints) -> Floats:
        """Return the scores (p,) of pairs (p, 2) as sticks, judged by their dots alone."""
        one, two = ends.T
        step = np.minimum(self._step[one], self._step[two])
        likeness = np.exp(
            -sum(np.abs(np.log(what[one] / what[two])) for what in (self.radius_px, self._step, self._light))
        )
        return np.asarray(likeness * self._clear[one] * self._clear[two] * np.sqrt(step))

    def score_by_chance(self, pair: Ints) -> float:
        """Return the score of a pair (2,) of which only the clearer dot is a marker, and the other one is texture."""
        clearest = (self._clear[pair] ** 2).max() * math.sqrt(self._step[pair].min())
        return math.sqrt(CLEAR * max(CLEAR, clearest))

    def unlike(self, ends: Ints, other: Ints) -> Floats:
        """Return χ² (p,) of the differences of pairs (p, 2) from one other (2,) or as many: step, light, length."""
        made = np.zeros(len(ends))
        for what in (self._step, self._light):
            made += (SIGMAS * np.log(what[ends].sum(axis=-1) / what[other].sum(axis=-1)) / math.log(LIKE)) ** 2
        length = self._length(ends) / self._length(other)
        # Sticks made each in its own way, a dark disc and a white stick, are improbable, not impossible.
        own_way = -2.0 * np.logaddexp(-0.5 * made, math.log(1.0 - SURE))
        return np.asarray(own_way + (SIGMAS * np.log(length) / math.log(SIZES)) ** 2)
