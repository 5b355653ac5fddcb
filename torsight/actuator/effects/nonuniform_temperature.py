r"""The wire's ends and contacts are cooler than its middle.

.. math:: ξ = (1 − w) ξ(T) + w ξ(T − ΔT)

T temperature at the sensor (°C), w cooler share of the wire, ΔT its temperature difference (°C). Both parts carry the
same torque. Predicted residual: the end of the stroke is smeared and its corners are rounded; heating ends later.
Source: end conduction of heated wires, e.g. Incropera and DeWitt, Fundamentals of Heat and Mass Transfer, ch. 3 (fins).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from torsight.actuator.effects import Effect, Parameter, Ports, Values


def apply(ports: Ports, values: Values) -> Ports:
    """Split every section of the wire into a warm and a cooler part."""
    share, drop_c = values["cool_share"], values["cool_drop_c"]
    if share == 0.0:
        return ports
    return replace(
        ports,
        section_weight=np.concatenate([ports.section_weight * (1.0 - share), ports.section_weight * share]),
        section_drop_c=np.concatenate([ports.section_drop_c, ports.section_drop_c + drop_c]),
        section_drop_share=np.tile(ports.section_drop_share, 2),
    )


EFFECT = Effect(
    id="nonuniform_temperature",
    family="heat",
    acts_on="phase",
    title="part of the wire is cooler than the sensor",
    parameters=(
        Parameter("cool_share", 0.2, "", 0.0, 0.9, null=0.0, symbol="w", title="cooler share of the wire"),
        Parameter("cool_drop_c", 6.0, "°C", 0.0, 40.0, null=0.0, symbol="ΔT", title="temperature difference"),
    ),
    apply=apply,
    starts=({"cool_share": 0.1, "cool_drop_c": 12.0}, {"cool_share": 0.5, "cool_drop_c": 3.0}),
)
