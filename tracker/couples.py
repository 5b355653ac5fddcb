"""Couples of dots as base and moving stick, their probabilities, and the choice among them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tracker.appearance.dot_fit import Dot
from tracker.detect.sticks import Stick
from tracker.follow.judgement import MOVED_RAD
from tracker.follow.rotation_axis import turned
from tracker.innovation import SURE


@dataclass(frozen=True, slots=True)
class Couple:
    """Two pairs of dots as base and moving stick, inner markers first, with their probability among all couples."""

    base: Stick
    moving: Stick
    probability: float

    @property
    def dots(self) -> tuple[Dot, Dot, Dot, Dot]:
        """The dots of base and moving stick."""
        return self.base.inner, self.base.outer, self.moving.inner, self.moving.outer

    def swaps(self, other: Couple) -> bool:
        """Return whether both couples have the same sticks, with base and moving stick exchanged."""
        return self.base.is_of(other.moving) and self.moving.is_of(other.base)

    def placed_as(self, other: Couple) -> Couple | None:
        """Return this couple with its sticks in the order of those of another picture.

        None unless the moving stick is at the same place in both pictures, and the bases share a dot.
        """
        for one in (self, replace(self, base=self.moving, moving=self.base)):
            moving, base = one.moving.placed_as(other.moving), one.base.placed_as(other.base)
            if moving is not None and (base is not None or one.base.shared_dots(other.base)):
                return replace(one, base=base or one.base, moving=moving)
        return None

    @property
    def _angle_rad(self) -> float:
        return self.moving.direction_rad - self.base.direction_rad

    def apart_rad(self, other: Couple) -> float:
        """Return the difference between the angles of two couples in the picture in which they were found, rad.

        It holds for the whole film if both have the same moving stick, or one moving stick carries the other.
        """
        return turned(self._angle_rad, other._angle_rad)

    def to_json(self) -> dict[str, Any]:
        """Return the entry of ``track.json``, with positions as in a marker file."""
        sticks = {name: stick.places_px for name, stick in (("base", self.base), ("moving", self.moving))}
        return {**sticks, "probability": self.probability}


@dataclass(frozen=True, slots=True)
class Choice:
    """The couple chosen, and the uncertainty by the others.

    ``rivals`` are couples with another angle that neither picture nor motion rules out. ``sure`` is the probability
    that the couple chosen has the right angle: which of two sticks is the base follows from the film later, and couples
    whose angles differ by less than ``MOVED_RAD`` are equivalent. ``spread_rad2`` is the variance of the angle by all
    other couples, weighted by their probabilities.
    """

    taken: Couple
    rivals: tuple[Couple, ...]
    sure: float
    spread_rad2: float

    @classmethod
    def of(cls, couples: Sequence[Couple]) -> Choice:
        """Return the choice among couples with their probabilities, the most probable first."""
        taken, others = couples[0], [one for one in couples[1:] if not one.swaps(couples[0])]
        apart = [one.apart_rad(taken) for one in others]
        unlike = {id(one): one for one, rad in zip(others, apart, strict=True) if rad > MOVED_RAD}
        return cls(
            taken,
            tuple(one for one in unlike.values() if one.probability > 1.0 - SURE),
            sum(one.probability for one in couples if id(one) not in unlike),
            # If no couple is right, the angle is uniformly distributed over a turn.
            sum(one.probability * rad**2 for one, rad in zip(others, apart, strict=True))
            + (1.0 - sum(one.probability for one in couples)) * math.pi**2 / 3.0,
        )


def likeliest(found: list[tuple[float, Couple]], *, none: float = -math.inf) -> list[Couple]:
    """Return couples with their probabilities, the most probable first, from their log likelihoods.

    ``none`` is the log likelihood that no couple is right.
    """
    if not found:
        return []
    score = np.array([one for one, _ in found])
    most = max(float(score.max()), none)
    chance = np.exp(score - most)
    chance /= chance.sum() + math.exp(none - most)
    order = np.argsort(-chance, kind="stable").tolist()
    return [replace(found[index][1], probability=float(chance[index])) for index in order]
