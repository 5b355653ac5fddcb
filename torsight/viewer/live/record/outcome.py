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

    Attributes
    ----------
    frames, measured : int
        Frames so far, and those with an angle.
    dropped : int
        Frames whose pictures were given up because too many waited.
    missed : int
        Pictures that the source itself lost; they have no frames.
    left_out : int
        Entries that the viewer did not take in time.
    log_rows : int
        Rows of the temperature log.
    low_deg, high_deg : float
        Range of the angle.
    friction : dict or None
        Last estimate of ``tau_c_mnm``, in the form of the JSON outputs.
    half_cycles : int
        How many half-cycles have begun, as far as the model has looked.
    latency, latency_logged : dict
        From a frame to its angle recorded, and to its angle logged for the viewers, ms.
    served_first : bool
        Whether the system let the measuring threads run before others.
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
