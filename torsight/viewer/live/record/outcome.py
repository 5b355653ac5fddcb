"""How a live record went, in numbers."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

from torsight.core.tracks import StickAngles
from torsight.core.units import DEG


@dataclass(slots=True)
class Outcome:
    """How a live record went.

    Of its frames some are ``measured``, some ``dropped`` because too many waited; pictures that the source itself
    ``missed`` have no frames, and entries that the viewer did not take in time are ``left_out``. Of the angle there is
    the range, of the model the last estimate of ``tau_c_mnm`` and how many half-cycles have begun as far as it has
    looked. Latencies, ms, are those from a frame to its angle recorded, and to its angle logged for the viewers;
    ``served_first`` is whether the system let the measuring threads run before others.
    """

    frames: int = 0
    measured: int = 0
    dropped: int = 0
    missed: int = 0
    left_out: int = 0
    log_rows: int = 0
    low_deg: float = math.inf
    high_deg: float = -math.inf
    friction: dict[str, Any] | None = None
    half_cycles: int = 0
    latency: dict[str, Any] = field(default_factory=dict)
    latency_logged: dict[str, Any] = field(default_factory=dict)
    served_first: bool = False

    def settle(self, angles: StickAngles) -> None:
        """Take the finished record's angles: they are known before the moving stick showed, too."""
        known_deg = angles.angle_rad[angles.valid] / DEG
        self.measured = len(known_deg)
        if len(known_deg):
            self.low_deg, self.high_deg = float(known_deg.min()), float(known_deg.max())

    def count(self, angle_rad: float, *, dropped: bool, missed: int) -> None:
        """Count one frame; its angle is NaN where it is not known."""
        self.frames += 1
        self.dropped += dropped
        self.missed += missed
        if math.isfinite(angle_rad):
            degrees = angle_rad / DEG
            self.measured += 1
            self.low_deg, self.high_deg = min(self.low_deg, degrees), max(self.high_deg, degrees)
