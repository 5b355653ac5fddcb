r"""The room warms up or swings, and the sensors' readings with it.

.. math:: T_m = T + d \, t + \sum_k b_k \sin(k π t / t_e)

T_m measured, T wire temperature, t time since the record began, t_e its length, d drift (°C/h), b_k the waves of the
record (°C; none after it). Both sensors alike. Predicted residual: motion begins and ends at readings that wander from
half-cycle to half-cycle. Source: cold-junction errors, e.g. Nicholas and White, Traceable Temperatures (2001), ch. 8.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from torsight.actuator.effects import Effect, Values
from torsight.actuator.ports import Ports
from torsight.core.parameter import Parameter

_HOUR_S: Final = 3600.0
_WAVES: Final = tuple(f"room_wave_{k}_c" for k in range(1, 7))


def apply(ports: Ports, values: Values) -> Ports:
    """Take the drift off both sensors."""
    since_s = ports.time_s - ports.record_began_s
    whole_s = ports.history.elapsed_s if ports.history.after_record else since_s[-1]
    place = np.minimum(since_s / max(whole_s, 1.0), 1.0)
    drift_c = values["room_drift_c_h"] * since_s / _HOUR_S
    for k, name in enumerate(_WAVES, 1):
        drift_c = drift_c + values[name] * np.sin(k * np.pi * place)
    return replace(ports, temp_a_c=ports.temp_a_c - drift_c, temp_b_c=ports.temp_b_c - drift_c)


EFFECT: Final = Effect(
    id="room_drift",
    family="unnamed",
    acts_on="temperature",
    title="temperature readings that drift",
    parameters=(
        Parameter(name="room_drift_c_h", value=0.5, unit="°C/h", lower=-50.0, upper=50.0, sigma=2.0, null=0.0),
        *(Parameter(name=name, value=0.0, unit="°C", lower=-20.0, upper=20.0, sigma=1.0, null=0.0) for name in _WAVES),
    ),
    apply=apply,
    drivers=("time_s",),
)
