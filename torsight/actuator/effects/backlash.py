r"""Play between the disk and the stick.

.. math:: ψ_i = \min(\max(ψ_{i-1}, \, φ_i − w/2), \, φ_i + w/2)

φ angle of the disk, ψ of the stick, w the play (°): the stick follows the disk once half the play is taken up on either
side. Predicted residual: a step of w at every change of direction. Source: Tao and Kokotovic, Adaptive Control of
Systems with Actuator Nonlinearities (1996).
"""

from __future__ import annotations

import numpy as np

from torsight.actuator.effects import Effect, Parameter, Ports, Values
from torsight.core.compiled import compiled
from torsight.core.units import DEG, Floats


@compiled
def follow(angle_rad: Floats, half_rad: float) -> Floats:
    """Return the angle of a stick that follows a disk through a play of ``2 * half_rad``, centred at the start."""
    out = np.empty_like(angle_rad)
    follower = angle_rad[0]
    for i in range(angle_rad.size):
        follower = min(max(follower, angle_rad[i] - half_rad), angle_rad[i] + half_rad)
        out[i] = follower
    return out


def apply(ports: Ports, values: Values) -> Ports:
    """Let the reading follow the disk's angle through the play."""
    half_rad = 0.5 * values["play_deg"] * DEG
    return ports.with_reading(lambda phi_rad, _time_s: follow(phi_rad, half_rad))


EFFECT = Effect(
    id="backlash",
    family="mechanics",
    acts_on="reading",
    title="play between disk and stick",
    parameters=(Parameter("play_deg", 1.0, "°", 0.0, 60.0, null=0.0, symbol="w", title="play"),),
    apply=apply,
    starts=({"play_deg": 4.0},),
)
