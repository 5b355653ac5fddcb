r"""The sensor follows the wire late.

.. math:: τ \, dT_m/dt = T − T_m

T_m measured, T wire temperature (°C), τ lag of the sensor (s). Undone by T = T_m + τ dT_m/dt with the slope of the
same local fits that take the noise out. Predicted residual: of opposite sign on heating and cooling, growing with the
rate; none where the temperature rests. Source: first-order contact thermometry, e.g. Michalski et al., Temperature
Measurement (2001), ch. 15.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from torsight.actuator.effects import Effect, Values
from torsight.actuator.ports import Ports
from torsight.core.parameter import Parameter

Array = NDArray[np.float64]


def wire_temperature(temp_c: Array, rate_c_s: Array, *, lag_s: float) -> Array:
    """Return T = T_m + τ dT_m/dt, °C."""
    return temp_c + lag_s * rate_c_s


def apply(ports: Ports, values: Values) -> Ports:
    """Undo the lag of both sensors."""
    lag_s = values["lag_s"]
    return ports.with_temperatures(lambda temp, rate: (wire_temperature(temp, rate, lag_s=lag_s), rate))


EFFECT: Final = Effect(
    id="sensor_lag",
    family="sensor",
    acts_on="temperature",
    title="the sensor follows the wire late",
    parameters=(Parameter(name="lag_s", value=3.0, unit="s", lower=0.0, upper=60.0, null=0.0),),
    apply=apply,
    starts=({"lag_s": 10.0},),
)
