r"""The sensors follow their wires late, each with its own time constant.

.. math:: τ_A \, dT_{m,A}(t)/dt = T_A(t) − T_{m,A}(t), \qquad τ_B \, dT_{m,B}(t)/dt = T_B(t) − T_{m,B}(t)

T_m measured, T wire temperature (°C) of either spring, τ_A and τ_B lags of their sensors (s): a sensor that is glued on
with more cement, or lies less close to its wire, lags more. The smoother that removes the noise also estimates the
wires' temperatures (:mod:`torsight.actuator.record.smoother`). Predicted residual: that of a sensor lag, with a
different size in the half-cycles of A and of B. Source: first-order contact thermometry, e.g. Michalski et al.,
Temperature Measurement (2001), ch. 15.
"""

from __future__ import annotations

from torsight.actuator.drive import Drive
from torsight.actuator.effects import Effect, Parameter, Ports, Values
from torsight.core.units import Floats


def apply(ports: Ports, values: Values) -> Ports:
    """Undo the lag of each sensor."""
    return ports.behind_sensors(values["lag_a_s"], values["lag_b_s"])


def seen(drive: Drive, fitted_s: Floats, values: Values) -> float:
    """Return the log-likelihood ratio of the logged temperatures for the time constants, against no lag."""
    del fitted_s
    return drive.sensors.log_evidence(values["lag_a_s"], values["lag_b_s"])


EFFECT = Effect(
    id="unlike_lags",
    family="sensor",
    acts_on="temperature",
    title="the sensors follow their wires late, each with its own lag",
    parameters=tuple(
        Parameter(
            f"lag_{one}_s",
            3.0,
            "s",
            0.0,
            60.0,
            null=0.0,
            symbol=f"τ_{one.upper()}",
            title=f"lag of {one.upper()}'s sensor",
        )
        for one in "ab"
    ),
    apply=apply,
    order=-1,
    seen=seen,
    starts=({"lag_a_s": 1.0, "lag_b_s": 5.0}, {"lag_a_s": 5.0, "lag_b_s": 1.0}),
    laws=("temperature_temp_rate_c_s",),
)
