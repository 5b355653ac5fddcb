r"""A wire that transforms absorbs or releases latent heat: it is cooler or warmer than at the sensor.

.. math:: T = T_m + ℓ \, dξ/dt

T wire temperature, T_m measured, ξ martensite fraction of the same spring, ℓ temperature difference per rate of ξ
(°C s). Predicted residual: the motion is late in proportion to the rate of transformation; none at rest. Source: Leo,
Shield and Bruno, Acta Metall. Mater. 41 (1993) 2477.
"""

from __future__ import annotations

from torsight.actuator.effects import Effect, Parameter, Ports, Values


def apply(ports: Ports, values: Values) -> Ports:
    """Set the temperature difference per rate of transformation."""
    return ports.changed(latent_c_s=ports.latent_c_s + values["latent_c_s"])


EFFECT = Effect(
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
