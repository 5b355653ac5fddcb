r"""Grease: friction grows with speed.

.. math:: τ_f = τ_c + b |\dot φ|

b viscous coefficient (mN·m·s/rad). Predicted residual: proportional to the speed, its sign follows the direction;
gone a while after the temperature rests. Source: Coulomb and viscous friction, e.g. Armstrong-Hélouvry et al.,
Automatica 30 (1994) 1083.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from torsight.actuator.effects import Effect, Values
from torsight.actuator.ports import Ports
from torsight.core.parameter import Parameter
from torsight.core.units import MNM


def apply(ports: Ports, values: Values) -> Ports:
    """Add the coefficient."""
    return replace(ports, viscous_nms=ports.viscous_nms + values["viscous_mnm_s_per_rad"] * MNM)


EFFECT: Final = Effect(
    id="viscous_friction",
    family="friction",
    acts_on="friction",
    title="friction grows with speed",
    parameters=(
        Parameter(name="viscous_mnm_s_per_rad", value=3.0, unit="mN·m·s/rad", lower=0.0, upper=2000.0, null=0.0),
    ),
    apply=apply,
    starts=({"viscous_mnm_s_per_rad": 20.0},),
)
