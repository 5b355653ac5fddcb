r"""The recoverable angle falls from cycle to cycle.

.. math:: θ_L(n) = θ_L \, (1 − (1 − p) \, l_n) − p \, l_n θ_{L,0}, \quad l_n = 1 − (1 − r)^{1 + q + … + q^{n−1}}

n number of earlier heatings of the spring, r loss in the first cycle, q loss of each further cycle relative to the
cycle before (1: without limit; less: towards a limit), p share of the loss that is independent of the winding (plastic
strain), θ_{L,0} recoverable angle after winding by two thirds of θ_P. Predicted residual: it changes from cycle to
cycle, not within one; the stroke gets shorter. Later records continue the count. Source: functional fatigue of NiTi,
e.g. Eggeler et al., Mater. Sci. Eng. A 378 (2004) 24.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from torsight.actuator.effects import Effect, Parameter, Ports, Values, share
from torsight.core.units import Floats, Ints


def persistence(name: str, what: str) -> Parameter:
    """Return the parameter q: the change in each cycle relative to the change in the cycle before."""
    title = f"{what} of a cycle as a share of the one before"
    return Parameter(f"{name}_persistence", 1.0, "", 0.0, 1.0, sigma=0.3, symbol="q", title=title)


def settling(cycle: Ints, persistence: float) -> Floats:
    """Return 1 + q + … + q^(n−1) for numbers n (halves,) of earlier cycles."""
    count = cycle.astype(np.float64)
    return count if persistence == 1.0 else np.asarray((1.0 - persistence**count) / (1.0 - persistence), np.float64)


def apply(ports: Ports, values: Values) -> Ports:
    """Scale the recoverable angle of every half-cycle, and subtract the plastic part of the loss."""
    left = (1.0 - values["fatigue_per_cycle"]) ** settling(ports.cycle, values["fatigue_persistence"])
    plastic = values["fatigue_plastic_share"]
    # In a complete cycle a spring is wound to two thirds of θ_P: 718° of the reference rig's 1080° (its θ_1).
    whole_rad = ports.rig.recoverable_angle(2.0 / 3.0 * ports.rig.theta_p_rad)
    return replace(
        ports,
        theta_l_scale=ports.theta_l_scale * (1.0 - (1.0 - plastic) * (1.0 - left)),
        theta_l_loss_rad=ports.theta_l_loss_rad + plastic * (1.0 - left) * whole_rad,
    )


EFFECT = Effect(
    id="fatigue",
    family="material",
    acts_on="phase",
    title="the recoverable angle falls from cycle to cycle",
    parameters=(
        Parameter("fatigue_per_cycle", 0.005, "", 0.0, 0.4, null=0.0, symbol="r", title="loss in the first cycle"),
        persistence("fatigue", "loss"),
        share("fatigue_plastic_share", 0.0, symbol="p", title="plastic share of the loss"),
    ),
    apply=apply,
    starts=({"fatigue_per_cycle": 0.03},),
    laws=("phase_cycle", "phase_half_cycle"),
)
