r"""A torque at one place of the turn: a lead wire that catches, a bent shaft, a magnet.

.. math:: τ_b − τ_a − τ_f + (h − m \, \frac{\sin(φ − φ_h)}{w}) \, e^{(\cos(φ − φ_h) − 1) / w^2} = 0

h height (mN·m), m what pulls towards the place from either side (mN·m), φ_h the place (°), w its width (°; in the
formula rad), alike for both directions. Predicted residual:
motion that slows down before the place and hurries on behind it, in either direction; incomplete strokes end elsewhere
there. Source: cogging torque and stray torques of torsion pendulums, e.g. Gillies and Ritter, Rev. Sci. Instrum. 64
(1993) 283.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from torsight.actuator.effects import Effect, Values
from torsight.actuator.ports import Ports
from torsight.core.parameter import Parameter
from torsight.core.units import DEG, MNM


def apply(ports: Ports, values: Values) -> Ports:
    """Add the torque along φ."""
    away_rad, width_rad = ports.phi_grid_rad() - values["local_angle_deg"] * DEG, values["local_width_deg"] * DEG
    pull_mnm = values["local_mnm"] - values["local_pull_mnm"] * np.sin(away_rad) / width_rad
    return ports.with_stray(pull_mnm * np.exp((np.cos(away_rad) - 1.0) / width_rad**2) * MNM)


EFFECT: Final = Effect(
    id="local_torque",
    family="unnamed",
    acts_on="torque",
    title="a torque at one place of the turn",
    parameters=(
        Parameter(name="local_mnm", value=0.05, unit="mN·m", lower=-10.0, upper=10.0, null=0.0),
        Parameter(name="local_pull_mnm", value=0.0, unit="mN·m", lower=-10.0, upper=10.0, null=0.0),
        Parameter(name="local_angle_deg", value=0.0, unit="°", lower=-270.0, upper=270.0),
        Parameter(name="local_width_deg", value=30.0, unit="°", lower=5.0, upper=90.0, sigma=20.0),
    ),
    apply=apply,
    starts=tuple({"local_angle_deg": angle_deg} for angle_deg in (60.0, -60.0, 120.0, -120.0, 180.0)),
    drivers=("angle_deg",),
)
