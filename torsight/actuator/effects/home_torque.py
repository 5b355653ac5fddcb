r"""What holds the actuator at the start of a record is not quite what the rule says.

.. math:: τ^A(0) ≤ τ^B(0) + h \, τ_f(φ_0)

A record starts at its first measured angle, both springs cold. How far A was wound before (and with it its recoverable
angle) follows from the friction that holds it there; h is that friction as a share of the sliding friction at this
angle, 1 by the rule. No effect of the rig: what came before the record is not in the record, and an error here spoils
the first half-cycles. So the discovery always fits h beside the characterised values and never names it. Source: the
paper, section 4.2 (the home position, 'exclusively determined by the properties of the actuator').
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from torsight.actuator.effects import Effect, Values
from torsight.actuator.ports import Ports
from torsight.core.parameter import Parameter


def held_scale(friction_scale: NDArray[np.float64], *, hold: float) -> NDArray[np.float64]:
    """Return the friction's factors with the one at the start multiplied by h."""
    scale = friction_scale.copy()
    scale[:1] *= hold
    return scale


def apply(ports: Ports, values: Values) -> Ports:
    """Change the friction that holds the first row."""
    return replace(ports, friction_scale=held_scale(ports.friction_scale, hold=values["home_hold"]))


EFFECT: Final = Effect(
    id="home_torque",
    family="start",
    acts_on="friction",
    title="what holds the actuator at the start of the record",
    parameters=(Parameter(name="home_hold", value=1.0, unit="", lower=0.0, upper=3.0, sigma=0.25, null=1.0),),
    apply=apply,
)
