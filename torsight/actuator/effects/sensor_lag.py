r"""The sensor follows the wire late.

.. math:: (1 − q_T) τ_T \, dT_m(t)/dt = T(t − q_T τ_T) − T_m(t)

T_m measured, T wire temperature (°C), τ_T lag of the sensor on a ramp (s); q_T share of the lag that is a pure delay: 0
for a single time constant; two equal time constants act like q_T = 1 − 1/√2, three like q_T = 1 − 1/√3 (same mean and
spread of the impulse response). A sensor in a sheath has two: its q_T is one standard deviation of the prior. The
smoother that removes the noise also estimates the wire's temperature (:mod:`torsight.actuator.record.smoother`), so
that the noise is not differentiated; it also shows whether the log's corners are as rounded as those of a slow sensor.
Predicted residual: of opposite sign on heating and cooling, growing with the temperature's rate; none where the
temperature is constant. Source: first-order contact thermometry, e.g. Michalski et al., Temperature Measurement
(2001), ch. 15.
"""

from __future__ import annotations

from torsight.actuator.drive import Drive
from torsight.actuator.effects import Effect, Parameter, Ports, Values
from torsight.core.units import Floats


def apply(ports: Ports, values: Values) -> Ports:
    """Undo the lag of both sensors."""
    delay_s, lag_s = _parts_s(values)
    if delay_s != 0.0:
        ports = ports.read_at(ports.log_time_s + delay_s)
    return ports.behind_sensors(lag_s, lag_s)


def seen(drive: Drive, fitted_s: Floats, values: Values) -> float:
    """Return the log-likelihood ratio of the logged temperatures for the time constant, against no lag."""
    del fitted_s
    lag_s = _parts_s(values)[1]
    return drive.sensors.log_evidence(lag_s, lag_s)


def _parts_s(values: Values) -> tuple[float, float]:
    """Return the pure delay and the time constant, s."""
    delay_s = values["lag_delay_share"] * values["lag_s"]
    return delay_s, values["lag_s"] - delay_s


EFFECT = Effect(
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
    seen=seen,
    starts=({"lag_s": 10.0},),
    laws=("temperature_temp_rate_c_s",),
)
