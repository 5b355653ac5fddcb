r"""A wire that transforms absorbs or releases latent heat: it is cooler or warmer than at the sensor.

.. math:: T = T_m + ℓ \, dξ/dt

T wire temperature, T_m measured, ξ martensite fraction of the same spring, ℓ temperature difference per rate of ξ
(°C s). Predicted residual: the motion is late in proportion to the rate of transformation; none at rest. Source: Leo,
Shield and Bruno, Acta Metall. Mater. 41 (1993) 2477.
"""

from __future__ import annotations

from typing import Final

from torsight.actuator.effects import Effect, Values
from torsight.actuator.ports import Ports
from torsight.core.parameter import Parameter


def apply(ports: Ports, values: Values) -> Ports:
    """Set the temperature difference per rate of transformation."""
    return ports.changed(latent_c_s=ports.latent_c_s + values["latent_c_s"])


EFFECT: Final = Effect(
    id="latent_heat",
    family="heat",
    acts_on="temperature",
    title="latent heat",
    parameters=(
        Parameter(
            name="latent_c_s",
            value=30.0,
            unit="°C s",
            lower=0.0,
            upper=2000.0,
            null=0.0,
            symbol="ℓ",
            title="temperature per rate of transformation",
        ),
    ),
    apply=apply,
)
