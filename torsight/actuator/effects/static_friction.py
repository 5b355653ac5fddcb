r"""Friction at rest exceeds sliding friction and grows with the rest.

.. math:: τ_s = τ_c (1 + e (1 − e^{−t_r/t_0}))

e excess after a long rest, t_r time at rest, t_0 time of growth (s). Predicted residual: motion starts late and with a
jump. Source: Dieterich, Pure Appl. Geophys. 116 (1978) 790.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from torsight.actuator.effects import Effect, Values
from torsight.actuator.ports import DWELL_DECADES, Ports
from torsight.core.parameter import Parameter


def apply(ports: Ports, values: Values) -> Ports:
    """Set excess and time."""
    rest_s = 10.0**DWELL_DECADES - 1.0
    return ports.with_dwell(1.0 + values["static_excess"] * (1.0 - np.exp(-rest_s / values["static_time_s"])))


EFFECT: Final = Effect(
    id="static_friction",
    family="friction",
    acts_on="friction",
    title="friction that grows at rest",
    parameters=(
        Parameter(
            name="static_excess",
            value=0.3,
            unit="",
            lower=0.0,
            upper=5.0,
            null=0.0,
            symbol="e",
            title="excess of friction after a long rest",
        ),
        Parameter(
            name="static_time_s",
            value=60.0,
            unit="s",
            lower=1.0,
            upper=600.0,
            sigma=60.0,
            symbol="t_0",
            title="time in which it grows",
        ),
    ),
    apply=apply,
    # Motion begins with a jump: from far off the residual hardly says which way the excess should go.
    starts=({"static_excess": 0.6}, {"static_excess": 1.0}),
    laws=("friction_dwell_s",),
)
