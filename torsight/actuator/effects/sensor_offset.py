r"""Both sensors read too high or too low by the same offset.

.. math:: T_m = T + o

T_m measured, T wire temperature, o offset (°C). A record cannot determine o where the transformation temperatures are
free: a common shift of all four has the same effect. It determines o where they were measured with another sensor.
Predicted residual, with characterised values: a pulse in every motion, equal at its onset and its end.
Source: tolerance of a thermocouple, 1.5 °C for class 1 and 2.5 °C for class 2 (IEC 60584-1, types K and N).
"""

from __future__ import annotations

from torsight.actuator.effects import Effect, Parameter, Ports, Values


def apply(ports: Ports, values: Values) -> Ports:
    """Subtract the offset from both readings."""
    offset_c = values["thermometer_offset_c"]
    return ports.with_temperatures(lambda temp, rate: (temp - offset_c, rate))


EFFECT = Effect(
    id="sensor_offset",
    family="sensor",
    acts_on="temperature",
    title="both sensors read too high or too low",
    parameters=(
        Parameter("thermometer_offset_c", 1.5, "°C", -10.0, 10.0, null=0.0, symbol="o", title="offset of both sensors"),
    ),
    apply=apply,
    starts=({"thermometer_offset_c": -1.5},),
    laws=("temperature_temp_active_c",),
)
