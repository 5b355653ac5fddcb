"""Statistics of the frames' times: number, rate, and regularity."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np

from torsight.core.units import Floats

_UNEVEN: Final = 0.2
"""Difference from the usual step, as a share of it, above which a step is irregular: a lost frame doubles a step."""


@dataclass(frozen=True, slots=True)
class Timing:
    """Statistics of the frames' times: number of decoded frames, duration, rate, and steps.

    ``duration_s`` is from the first frame to one usual (median) step after the last; ``step_s``, ``shortest_s`` and
    ``longest_s`` are the usual, shortest and longest step; ``irregular_share`` is the share of steps that differ from
    the usual one by a fifth, beyond the rounding of the container's clock. None where there is a single frame.
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
    """Return the statistics of the increasing times (n,) of all frames.

    The times are rounded to multiples of ``tick_s``: a step between two frames may be wrong by one tick.
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
