r"""The sensor's curve errs between two fixed points.

.. math:: T_m = T + b \, (T − T_1)(T_2 − T) / ((T_2 − T_1)/2)^2

T_m measured, T wire temperature (°C), b largest error (K), T_1 = 20 °C and T_2 = 100 °C. Predicted residual: a function
of the driven temperature. Source: Steinhart and Hart, Deep-Sea Res. 15 (1968) 497.
"""

from __future__ import annotations

from typing import Final

from torsight.actuator.effects import Array, Effect, Values
from torsight.actuator.ports import Ports
from torsight.core.parameter import Parameter

_LOW_C: Final = 20.0
_HIGH_C: Final = 100.0


def curve_error(temp_c: Array) -> Array:
    """Return the error per kelvin of its largest value, at measured temperatures."""
    return (temp_c - _LOW_C) * (_HIGH_C - temp_c) / (0.5 * (_HIGH_C - _LOW_C)) ** 2


def apply(ports: Ports, values: Values) -> Ports:
    """Take the error off both sensors."""
    bulge_c = values["curve_bulge_c"]
    return ports.with_temperatures(lambda temp, rate: (temp - bulge_c * curve_error(temp), rate))


EFFECT: Final = Effect(
    id="thermistor_curve",
    family="unnamed",
    acts_on="temperature",
    title="an error of the sensor's curve",
    parameters=(Parameter(name="curve_bulge_c", value=0.7, unit="°C", lower=-20.0, upper=20.0, null=0.0),),
    apply=apply,
    starts=({"curve_bulge_c": -0.7},),
    drivers=("temp_active_c",),
)
