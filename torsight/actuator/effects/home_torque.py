r"""How far a spring was wound before the record is not quite what the home rule says.

.. math:: τ^A(θ_{max}, θ_1) = τ^B + h \, τ_f(φ_0)

A record starts at its first measured angle, both springs cold. How far A was wound before (and with it its recoverable
angle) follows from the friction that stopped it there; h is that friction as a share of the sliding friction at this
angle: 1 by the rule, less than 0 where the friction came to hold the other way. What holds it now is never more than
the friction. No effect of the rig: what came before the record is not in the record, and an error here spoils the first
half-cycles. So the discovery always fits h beside the characterised values and never names it. Source: the paper,
section 4.2 (the home position, 'exclusively determined by the properties of the actuator').
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from torsight.actuator.effects import Effect, Values
from torsight.actuator.ports import Ports
from torsight.core.parameter import Parameter


def apply(ports: Ports, values: Values) -> Ports:
    """Change the friction that stopped the springs."""
    return replace(ports, home_hold=ports.home_hold * values["home_hold"])


EFFECT: Final = Effect(
    id="home_torque",
    family="start",
    acts_on="friction",
    title="how far a spring was wound before the record",
    parameters=(Parameter(name="home_hold", value=1.0, unit="", lower=-1.0, upper=3.0, sigma=0.25, null=1.0),),
    apply=apply,
    # Where the first spring turns out to have been wound less or more, a fit from 1 sees only the nearer slope.
    starts=({"home_hold": 0.25}, {"home_hold": 0.7}, {"home_hold": 1.35}, {"home_hold": 1.7}),
)
