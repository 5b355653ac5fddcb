"""How a live record stands, in words."""

from __future__ import annotations

import math
from collections.abc import Mapping

from torsight.core.words.wording import estimate, number
from torsight.viewer.live.record.outcome import Outcome


def standing(
    outcome: Outcome,
    *,
    angle_deg: float,
    model_deg: tuple[float, float],
    temperatures: Mapping[str, float],
    latency_ms: float,
    trouble: str,
) -> str:
    """Return how things stand, in Markdown.

    The last angle of camera and model, measured less modelled, and the springs' temperatures, °C; NaN where not known.
    ``trouble`` is why the model says nothing, else empty.
    """
    plain_deg, residual_deg = model_deg
    lost = f", {outcome.missed} lost by the source" if outcome.missed else ""
    rows = [
        ("Angle", degrees(angle_deg) or "not known yet"),
        ("Temperatures", "  ".join(f"{name} {value:.1f} °C" for name, value in temperatures.items()) or "none yet"),
        ("Range of motion", degrees(outcome.high_deg - outcome.low_deg) or "none yet"),
        ("Frames", f"{outcome.frames}, {outcome.measured} measured, {outcome.dropped} dropped{lost}"),
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
    """Return an angle in words, with a minus sign that is one; empty where it is not known."""
    return f"{angle_deg:.1f}°".replace("-", "−") if math.isfinite(angle_deg) else ""
