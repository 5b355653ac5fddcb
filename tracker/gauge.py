"""Whether a reading is of the marker itself, judged by how well the marker has fitted so far."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

from tracker.linear import Reading
from tracker.rules import ALWAYS, GAUGE_RATE, LEAST_STEP, LIGHT_RATE, NEVER

_START_SPREAD: Final = 0.15


@dataclass(slots=True)
class Gauge:
    """Running account of one marker's light, step and fit.

    ``residual`` and ``patch`` are kept as logarithms of their share of the step, with the mean deviation.
    """

    light: float
    step: float
    residual: float
    residual_spread: float
    patch: float
    patch_spread: float

    @classmethod
    def start(cls, reading: Reading) -> Gauge:
        """Begin with the first reading, which is known to be of the marker."""
        return cls(
            light=reading.light,
            step=abs(reading.step),
            residual=_share(reading.residual, reading.step),
            residual_spread=_START_SPREAD,
            patch=_share(reading.patch, reading.step),
            patch_spread=2.0 * _START_SPREAD,
        )

    def judge(self, reading: Reading | None, *, slack: float = 0.0) -> str:
        """Return ``""`` where the reading is good, else why it is not: hidden, or outside the picture.

        ``slack`` is a share of the step by which the residual may be larger than usual, for smear that is not yet
        known.
        """
        if reading is None:
            return "outside"
        step = abs(reading.step)
        if step < LEAST_STEP or not reading.converged:
            return "hidden"
        if not 0.45 < reading.contrast < 1.8 or step < 0.2 * self.step:
            return "hidden"
        share, patch = reading.residual / step, reading.patch / step
        if share > NEVER:
            return "hidden"
        limit = math.exp(self.residual + max(5.0 * self.residual_spread, 0.35)) + slack
        patch_limit = math.exp(self.patch + max(5.0 * self.patch_spread, 0.7)) + slack
        if share > max(limit, ALWAYS) or patch > max(patch_limit, ALWAYS):
            return "hidden"
        return ""

    def learn_light(self, reading: Reading) -> None:
        """Take in how bright a good reading is."""
        self.light += LIGHT_RATE * (reading.light - self.light)
        self.step += LIGHT_RATE * (abs(reading.step) - self.step)

    def learn(self, reading: Reading) -> None:
        """Take in a good reading."""
        self.learn_light(reading)
        step = abs(reading.step)
        off = _share(reading.residual, step) - self.residual
        self.residual += GAUGE_RATE * off
        self.residual_spread += GAUGE_RATE * (abs(off) - self.residual_spread)
        off = _share(reading.patch, step) - self.patch
        self.patch += GAUGE_RATE * off
        self.patch_spread += GAUGE_RATE * (abs(off) - self.patch_spread)

    def to_state(self) -> list[Any]:
        """Return what :meth:`from_state` restores exactly."""
        return [self.light, self.step, self.residual, self.residual_spread, self.patch, self.patch_spread]

    @classmethod
    def from_state(cls, state: list[Any]) -> Gauge:
        """Restore a gauge."""
        return cls(*(float(value) for value in state))


def _share(value: float, step: float) -> float:
    return math.log(max(value, 1e-3) / max(abs(step), 1.0))
