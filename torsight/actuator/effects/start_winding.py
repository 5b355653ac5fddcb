r"""The angle that a spring recovers in its first half-cycle differs from that of the home rule.

.. math:: θ_{L,1}^{A} = θ_L(θ_{max}^{A}) − δ_A, \qquad θ_{L,1}^{B} = θ_L(θ_{max}^{B}) − δ_B

θ_{L,1} recoverable angle of a spring in its first half-cycle, δ_A and δ_B its reduction against the home rule (°); from
its second half-cycle on a spring has been wound within the record. It is no effect of the rig: the record does not show
the winding before its start, and effects that change with time would compensate for an error of this winding. So
discovery always fits δ_A and δ_B beside the characterised values and never names this effect. Source: the paper,
section 4.2 (home position).
"""

from __future__ import annotations

import numpy as np

from torsight.actuator.effects import Effect, Parameter, Ports, Values
from torsight.core.units import DEG


def apply(ports: Ports, values: Values) -> Ports:
    """Subtract the angle from the recoverable angle in the first half-cycle of each spring."""
    loss = np.zeros(ports.half_cycle.shape) + ports.theta_l_loss_rad
    driven = ports.drive.cycles.springs
    for spring, name in ((0, "start_loss_a_deg"), (1, "start_loss_b_deg")):
        if spring in driven:
            loss[driven.index(spring)] += values[name] * DEG
    return ports.changed(theta_l_loss_rad=loss)


EFFECT = Effect(
    id="start_winding",
    family="start",
    acts_on="phase",
    title="recoverable angles at the start of the record",
    parameters=tuple(
        Parameter(
            name=f"start_loss_{spring}_deg",
            value=0.0,
            unit="°",
            lower=-60.0,
            upper=60.0,
            # The angle changes by 9° on the paper's rig where the torque at which a spring stopped differs by a quarter
            # of the friction torque: 0.25 τ_c / (K_M − K_S) (1 − K_S/K_M).
            sigma=10.0,
            null=0.0,
            symbol=f"δ_{spring.upper()}",
            title=f"recoverable angle that spring {spring.upper()} lacks at first",
        )
        for spring in "ab"
    ),
    apply=apply,
)
