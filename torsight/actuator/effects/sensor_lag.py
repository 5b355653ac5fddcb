r"""The sensor follows the wire late.

.. math:: (1 − q_T) τ_T \, dT_m(t)/dt = T(t − q_T τ_T) − T_m(t)

T_m measured, T wire temperature (°C), τ_T lag of the sensor on a ramp (s); q_T share of the lag that is a pure delay: 0
for a single time constant; two equal time constants act like q_T = 1 − 1/√2, three like q_T = 1 − 1/√3 (same mean and
spread of the impulse response). A sensor in a sheath has two: its q_T is one standard deviation of the prior. The
smoother that removes the noise also estimates the wire's temperature (:mod:`torsight.actuator.record.smoother`), so
that the noise is not differentiated. Predicted residual: of opposite sign on heating and cooling, growing with the
temperature's rate; none where the temperature is constant. Source: first-order contact thermometry, e.g. Michalski et
al., Temperature Measurement (2001), ch. 15.
"""

from __future__ import annotations

from typing import Final

from torsight.actuator.effects import Effect, Values
from torsight.actuator.ports import Ports
from torsight.core.parameter import Parameter


def apply(ports: Ports, values: Values) -> Ports:
    """Undo the lag of both sensors."""
    delay_s = values["lag_delay_share"] * values["lag_s"]
    if delay_s != 0.0:
        ports = ports.read_at(ports.log_time_s + delay_s)
    lag_s = values["lag_s"] - delay_s
    return ports.behind_sensors(lag_s, lag_s)


EFFECT: Final = Effect(
    id="sensor_lag",
    family="sensor",
    acts_on="temperature",
    title="the sensor follows the wire late",
    parameters=(
        Parameter("lag_s", 3.0, "s", 0.0, 60.0, null=0.0, symbol="τ_T", title="lag of the sensor"),
        Parameter(
            "lag_delay_share", 0.0, "", 0.0, 0.6, sigma=0.3, symbol="q_T", title="share of the lag that is pure delay"
        ),
    ),
    apply=apply,
    order=-1,
    starts=({"lag_s": 10.0},),
    laws=("temperature_temp_rate_c_s",),
)
