r"""The torque that friction held at the start of the record differs from that of the home rule.

.. math:: τ^A(φ_0) = τ^B(φ_0) + η \, τ_f(φ_0), \qquad −1 ≤ η ≤ 1

A record starts at its first measured angle, both springs cold. τ^A is the torque of the spring that is driven first,
τ_f the friction torque at this angle and η the share of τ_f that holds: 1 by the rule (the spring was unwound until
friction held it), −1 where friction holds in the opposite direction. The winding of the spring before the record is a
separate value (:mod:`torsight.actuator.effects.start_winding`). It is no effect of the rig: the record does not show
the state before its start, and an error of this state spoils the first half-cycle. So discovery always fits η beside
the characterised values and never names it. Source: the paper, section 4.2 (the home position, 'exclusively determined
by the properties of the actuator').
"""

from __future__ import annotations

from torsight.actuator.effects import Effect, Parameter, Ports, Values


def apply(ports: Ports, values: Values) -> Ports:
    """Scale the torque that friction holds at the start."""
    return ports.changed(home_hold=ports.home_hold * values["home_hold"])


EFFECT = Effect(
    id="home_torque",
    family="start",
    acts_on="friction",
    title="torque that friction held at the start",
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
