r"""A torque that is neither spring nor friction: lead wires, an unbalanced disk, a magnet.

.. math:: τ_b − τ_a − τ_f + b + s \sin φ + c \cos φ = 0

b constant part, s and c the parts once per turn (mN·m), alike for both directions. Predicted residual: both ends of the
stroke move the same way; a gravity torque bends the stroke over the angle. Source: stray torques of torsion
pendulums, e.g. Gillies and Ritter, Rev. Sci. Instrum. 64 (1993) 283.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from torsight.actuator.effects import Effect, Values
from torsight.actuator.ports import Ports
from torsight.core.parameter import Parameter
from torsight.core.units import MNM


def apply(ports: Ports, values: Values) -> Ports:
    """Add the torque along φ."""
    phi_rad = ports.phi_grid_rad()
    sine, cosine = values["stray_sine_mnm"] * np.sin(phi_rad), values["stray_cosine_mnm"] * np.cos(phi_rad)
    return ports.with_stray((values["stray_mnm"] + sine + cosine) * MNM)


EFFECT: Final = Effect(
    id="stray_torque",
    family="unnamed",
    acts_on="torque",
    title="a stray torque",
    parameters=tuple(
        Parameter(name=name, value=0.1 if name == "stray_mnm" else 0.0, unit="mN·m", lower=-10.0, upper=10.0, null=0.0)
        for name in ("stray_mnm", "stray_sine_mnm", "stray_cosine_mnm")
    ),
    apply=apply,
    starts=({"stray_mnm": -0.1}, {"stray_mnm": 0.0, "stray_sine_mnm": 0.1}),
    drivers=("angle_deg", "direction"),
)
