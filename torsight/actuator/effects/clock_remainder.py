r"""The clocks of camera and temperature logger were synchronised, but not exactly.

.. math:: T(t) → T(t) + δ_r \, dT/dt

T temperature in the log (°C), t film time (s), δ_r remaining offset of the log's clock (s). It is no effect of the rig:
every record has its own remainder, and a model without it would need small effects of the temperatures' rate to
compensate for it. So discovery always fits δ_r beside the characterised values and never names it; a larger error of
the clocks is a clock offset. Later records have clocks of their own. Source: computers whose clocks a network
synchronises agree within tens of milliseconds (Mills, RFC 5905).
"""

from __future__ import annotations

from torsight.actuator.effects import Effect, Parameter, Ports, Values


def apply(ports: Ports, values: Values) -> Ports:
    """Read the temperatures slightly later in the log, to first order."""
    ahead_s = values["clock_remainder_s"]
    return ports.with_temperatures(lambda temp, rate: (temp + ahead_s * rate, rate))


EFFECT = Effect(
    id="clock_remainder",
    family="remainder",
    acts_on="temperature",
    title="remaining offset between the clocks of camera and temperature log",
    parameters=(
        Parameter(
            name="clock_remainder_s",
            value=0.0,
            unit="s",
            lower=-0.3,
            upper=0.3,
            sigma=0.03,
            null=0.0,
            symbol="δ_r",
            title="remainder of the clocks' offset",
        ),
    ),
    apply=apply,
    # After the sensors' lag, which reads the log again and would discard this shift.
    order=1,
    is_clock=True,
)
