r"""The clocks of camera and temperature logger differ.

.. math:: t_T = t (1 + ε) + δ

t film time, t_T time of the temperature log at that instant (s), δ offset (s), ε drift (ppm; a crystal keeps within a
few hundred). Predicted residual: proportional to dφ/dt, one sign per direction. Source: affine clock model of network
time synchronisation, e.g. Mills, RFC 5905.
"""

from __future__ import annotations

from torsight.actuator.effects import Effect, Parameter, Ports, Values
from torsight.core.units import PPM


def apply(ports: Ports, values: Values) -> Ports:
    """Read temperatures and half-cycles from the log at the temperature log's times."""
    offset_s, drift_ppm = values["clock_offset_s"], values["clock_drift_ppm"]
    if offset_s == 0.0 and drift_ppm == 0.0:
        return ports
    return ports.at_log_times(ports.time_s * (1.0 + drift_ppm * PPM) + offset_s)


EFFECT = Effect(
    id="clock_offset",
    family="clock",
    acts_on="clock",
    title="the clocks of camera and temperature log differ",
    parameters=(
        Parameter("clock_offset_s", 1.0, "s", -120.0, 120.0, null=0.0, symbol="δ", title="rest of the clocks' offset"),
        Parameter(
            "clock_drift_ppm", 0.0, "ppm", -5e3, 5e3, sigma=200.0, null=0.0, symbol="ε", title="drift of the clocks"
        ),
    ),
    apply=apply,
    starts=({"clock_offset_s": -1.0}, {"clock_offset_s": 5.0}, {"clock_offset_s": -5.0}),
    is_clock=True,
    laws=("clock_time_s",),
)
