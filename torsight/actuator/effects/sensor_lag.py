r"""The sensor follows the wire late.

.. math:: τ \, dT_m/dt = T − T_m

T_m measured, T wire temperature (°C), τ lag of the sensor (s). The wire's temperature comes out of the same local fits
that take the noise out (:mod:`torsight.actuator.conditioning`): the noise is not differentiated. Predicted residual: of
opposite sign on heating and cooling, growing with the rate; none where the temperature rests. Source: first-order
contact thermometry, e.g. Michalski et al., Temperature Measurement (2001), ch. 15.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from torsight.actuator.effects import Effect, Values
from torsight.actuator.ports import Ports
from torsight.core.parameter import Parameter


def apply(ports: Ports, values: Values) -> Ports:
    """Undo the lag of both sensors."""
    added_a, added_b = ports.sensors.lag_correction(values["lag_s"])
    return replace(ports, temp_a_c=ports.temp_a_c + added_a, temp_b_c=ports.temp_b_c + added_b)


EFFECT: Final = Effect(
    id="sensor_lag",
    family="sensor",
    acts_on="temperature",
    title="the sensor follows the wire late",
    parameters=(Parameter(name="lag_s", value=3.0, unit="s", lower=0.0, upper=60.0, null=0.0),),
    apply=apply,
    order=-1,
    starts=({"lag_s": 10.0},),
)
