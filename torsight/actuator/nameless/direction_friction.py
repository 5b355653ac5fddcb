r"""Friction differs by direction.

.. math:: τ_f = τ_c (1 + a \, \mathrm{sign}(\dot φ))

a asymmetry. Predicted residual: one direction ends early, the other late. Source: asymmetric Coulomb friction, e.g.
Armstrong-Hélouvry et al., Automatica 30 (1994) 1083.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from torsight.actuator.effects import Effect, Values
from torsight.actuator.ports import Ports
from torsight.core.parameter import Parameter


def apply(ports: Ports, values: Values) -> Ports:
    """Raise the friction of a rising angle and lower that of a falling one."""
    asymmetry, one = values["friction_asymmetry"], np.ones_like(ports.grid_rad())
    return ports.with_friction((1.0 - asymmetry) * one, (1.0 + asymmetry) * one)


EFFECT: Final = Effect(
    id="direction_friction",
    family="unnamed",
    acts_on="friction",
    title="friction that differs by direction",
    parameters=(Parameter(name="friction_asymmetry", value=0.1, unit="", lower=-0.95, upper=0.95, null=0.0),),
    apply=apply,
    starts=({"friction_asymmetry": -0.1},),
    drivers=("direction",),
)
