"""When the frames of a film are shown: count, rate, and whether the rate varies."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np

from torsight.core.units import Floats

_UNEVEN: Final = 0.2
"""Share of the usual step by which one that counts as irregular differs from it: a lost frame makes a step twice as
long."""


@dataclass(frozen=True, slots=True)
class Timing:
    """What the times of the frames say: how many were decoded, and how long the film is.

    From the first frame to one usual (median) step after the last; usual, shortest and longest step;
    ``irregular_share``: of the steps that differ from the usual one by a fifth, beyond what the container's clock
    rounds. None where a single frame tells nothing.
    """

    frames: int
    duration_s: float
    rate_fps: float | None
    step_s: float | None
    shortest_s: float | None
    longest_s: float | None
    irregular_share: float

    def to_json(self) -> dict[str, Any]:
        """Return the figures for ``track.json``."""
        return asdict(self)


def timing(time_s: Floats, *, tick_s: float = 0.0) -> Timing:
    """Return what the increasing times (n,) of all frames say.

    They are rounded to a clock of steps ``tick_s``: a step between two frames may be off by one of it.
    """
    step = np.diff(time_s)
    if len(step) == 0:
        return Timing(len(time_s), 0.0, None, None, None, None, 0.0)
    usual = float(np.median(step))
    span = float(time_s[-1] - time_s[0])
    return Timing(
        frames=len(time_s),
        duration_s=span + usual,
        rate_fps=len(step) / span if span > 0.0 else None,
        step_s=usual,
        shortest_s=float(step.min()),
        longest_s=float(step.max()),
        irregular_share=float(np.mean(np.abs(step - usual) > _UNEVEN * usual + 1.001 * tick_s)),
    )
