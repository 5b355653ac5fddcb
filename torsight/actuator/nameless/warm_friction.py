r"""Friction falls as the rig warms up: grease.

.. math:: τ_f = τ_c \, e^{−k (T_p − T_{room})}

T_p temperature of the spring that is not driven, the nearest to the shaft's that is logged (°C), k fall per kelvin.
Predicted residual: stroke grows late in a heating and from one half-cycle to the next. Source: viscosity of greases
over temperature, e.g. Lugt, Grease Lubrication in Rolling Bearings (2013), ch. 5.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from torsight.actuator.effects import Effect, Values
from torsight.actuator.ports import Ports
from torsight.core.parameter import Parameter


def apply(ports: Ports, values: Values) -> Ports:
    """Scale the friction."""
    passive_c = np.where(ports.active == 0, ports.temp_b_c, ports.temp_a_c)
    factor = np.exp(-values["friction_per_k"] * (passive_c - ports.room_c))
    return replace(ports, friction_scale=ports.friction_scale * factor)


EFFECT: Final = Effect(
    id="warm_friction",
    family="unnamed",
    acts_on="friction",
    title="friction that changes with the rig's temperature",
    parameters=(Parameter(name="friction_per_k", value=0.03, unit="1/K", lower=-0.5, upper=0.5, null=0.0),),
    apply=apply,
    starts=({"friction_per_k": -0.03},),
    drivers=("temp_passive_c",),
)
