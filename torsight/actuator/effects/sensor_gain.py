r"""Imperfect thermal contact: the sensor's reading lies between the temperatures of wire and room.

.. math:: T_m = T_{room} + g (T − T_{room})

T_m measured, T wire temperature (°C), g gain of the contact. Predicted residual: a pulse in heating and in cooling,
none at rest; the onset of motion shifts less than its end. Source: conduction error of contact thermometers, e.g.
Michalski et al., Temperature Measurement (2001), ch. 16.
"""

from __future__ import annotations

from torsight.actuator.effects import Effect, Parameter, Ports, Values


def apply(ports: Ports, values: Values) -> Ports:
    """Undo the gain of both sensors."""
    gain, room_c = values["contact_gain"], ports.room_c
    return ports.with_temperatures(lambda temp, rate: (room_c + (temp - room_c) / gain, rate / gain))


EFFECT = Effect(
    id="sensor_gain",
    family="sensor",
    acts_on="temperature",
    title="the sensor reads between wire and room",
    parameters=(Parameter("contact_gain", 0.97, "", 0.6, 1.4, null=1.0, symbol="g", title="gain of the contact"),),
    apply=apply,
    starts=({"contact_gain": 1.03}, {"contact_gain": 0.92}),
    laws=("temperature_temp_active_c",),
)
