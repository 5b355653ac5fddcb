"""What a fitted model says of a later temperature log."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from torsight.actuator.drive import Drive
from torsight.actuator.simulation import Simulation
from torsight.core.units import DEG, Floats, Ints
from torsight.core.words.shown import Shown, draw_series, share, span


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Prediction(Shown):
    """Angles for the instants of a temperature log.

    Attributes
    ----------
    angle_rad : (n,) float64
        As a camera would read it; NaN where the log has no temperature for too long.
    drive : Drive
        The log, conditioned; with rows between its instants where these are far apart.
    simulation : Simulation
        Everything else that the model says, at the log's instants.
    rows : (n,) int64
        Which of the drive's rows the log's instants are.
    """

    angle_rad: Floats
    drive: Drive
    simulation: Simulation
    rows: Ints

    def facts(self) -> dict[str, str]:
        """Return rows, time and angle."""
        return {
            "rows": str(len(self.angle_rad)),
            "time": span(self.simulation.time_s, "s"),
            "angle": f"{span(self.angle_rad / DEG, '°')} in {share(np.isfinite(self.angle_rad))} of the rows",
        }

    def _columns(self) -> dict[str, Any]:
        return {**dict(self.simulation.to_frame()), "angle_deg": self.angle_rad / DEG}

    def _draw(self, axes: Any) -> None:
        draw_series(axes, self.simulation.time_s, {"angle": self.angle_rad / DEG}, label="angle, °")
