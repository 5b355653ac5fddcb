r"""What friction held at the start of the record is not quite what the home rule says.

.. math:: τ^A(φ_0) = τ^B(φ_0) + η \, τ_f(φ_0), \qquad −1 ≤ η ≤ 1

A record starts at its first measured angle, both springs cold. τ^A is the torque of the spring that is driven first,
τ_f the friction torque there and η the share of it that holds: 1 by the rule (it was unwound until friction held it),
−1 where friction came to hold the other way. How far the spring was wound before is a value of its own
(:mod:`torsight.actuator.effects.start_winding`). No effect of the rig: what came before the record is not in the
record, and an error here spoils the first half-cycle. So the discovery always fits η beside the characterised values
and never names it. Source: the paper, section 4.2 (the home position, 'exclusively determined by the properties of the
actuator').
"""

from __future__ import annotations

from typing import Final

from torsight.actuator.effects import Effect, Values
from torsight.actuator.ports import Ports
from torsight.core.parameter import Parameter


def apply(ports: Ports, values: Values) -> Ports:
    """Change what friction holds at the start."""
    return ports.changed(home_hold=ports.home_hold * values["home_hold"])


EFFECT: Final = Effect(
    id="home_torque",
    family="start",
    acts_on="friction",
    title="what friction held at the start",
    parameters=(
        Parameter(
            name="home_hold",
            value=1.0,
            unit="",
            lower=-1.0,
            upper=1.0,
            sigma=0.5,
            null=1.0,
            symbol="η",
            title="share of the friction that holds at the start",
        ),
    ),
    apply=apply,
    starts=({"home_hold": 0.0},),
)
