"""State of a live record, in numbers and in words."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from torsight.core.tracks import StickAngles
from torsight.core.units import DEG
from torsight.core.words.wording import estimate, fixed, number


@dataclass(slots=True)
class Outcome:
    """Statistics of a live record.

    Some frames are ``measured``, some ``dropped`` because too many waited; pictures that the source itself ``missed``
    have no frames, and entries that the viewer did not take in time are ``left_out``. Further values are the range of
    the angle, the model's last estimate of ``tau_c_mnm`` and the number of half-cycles that it has found. Latencies,
    ms, are the times from a frame to its recorded angle, and to its angle logged for the viewers; ``served_first``: the
    system allowed the measuring threads to run before others.
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

    @property
    def lost(self) -> str:
        """What the source lost, as the end of a list; empty where it lost nothing."""
        return f", {self.missed} lost by the source" if self.missed else ""

    def settle(self, angles: StickAngles) -> None:
        """Take the finished record's angles, which are also known for the frames before the moving stick was."""
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


def standing(
    outcome: Outcome,
    *,
    angle_deg: float,
    model_deg: tuple[float, float],
    temperatures: Mapping[str, float],
    latency_ms: float,
    trouble: str,
    markers: str = "",
) -> str:
    """Return the current state of the measurement, in Markdown.

    The values are the last angle of camera and model, measured minus modelled, and the springs' temperatures, °C; NaN
    where not known. ``trouble`` is the reason why the model has no result, ``markers`` a note that the choice of the
    markers is open; both are empty otherwise.
    """
    plain_deg, residual_deg = model_deg
    open_ = [("Markers", markers)] if markers else []
    rows = [
        ("Angle", degrees(angle_deg) or "not known yet"),
        *open_,
        ("Temperatures", "  ".join(f"{name} {value:.1f} °C" for name, value in temperatures.items()) or "none yet"),
        ("Range of motion", degrees(outcome.high_deg - outcome.low_deg) or "none yet"),
        ("Frames", f"{outcome.frames}, {outcome.measured} measured, {outcome.dropped} dropped{outcome.lost}"),
        ("Latency", f"median {number(latency_ms, 2)} ms"),
    ]
    if math.isfinite(plain_deg):
        rows.append(("Plain model", f"{degrees(plain_deg)}, residual {degrees(residual_deg) or 'not known'}"))
        rows.append(("Half-cycles", f"{outcome.half_cycles}"))
    if outcome.friction is not None:
        rows.append(("Friction torque", f"{estimate(outcome.friction)}, plain model"))
    if trouble:
        rows.append(("Model", trouble))
    return "\n".join(["### Live", "", *(f"- **{name}** {words}" for name, words in rows), ""])


def degrees(angle_deg: float) -> str:
    """Return an angle in words; empty where it is not known."""
    return f"{fixed(angle_deg, 1)}°" if math.isfinite(angle_deg) else ""
