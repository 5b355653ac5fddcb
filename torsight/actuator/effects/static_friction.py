r"""Friction at rest exceeds sliding friction and grows with the time at rest.

.. math:: τ_s = τ_c (1 + e (1 − e^{−(t_r/t_0)^p}))

e excess after a long rest, t_r time at rest, t_0 time of growth (s). p = 1: contacts grow at one rate; less: at many
rates (similar to the logarithm of the time over a decade or two); more: growth sets in late. Predicted residual: motion
starts late and with a jump. Source: Dieterich, Pure Appl. Geophys. 116 (1978) 790.

When the disk breaks loose, it jumps to where sliding friction balances the springs (s = 0). Its inertia carries it past
this balance by s times the jump, where friction holds it until the torque has risen again. The distance that the disk
would have slid without the drop of the friction is no part of the jump. Without damping s = 1: the energy that the
springs release is dissipated by friction alone (Rabinowicz, Friction and Wear of Materials (1995), chapter 4).
"""

from __future__ import annotations

import numpy as np

from torsight.actuator.effects import Effect, Parameter, Ports, Values, share
from torsight.actuator.ports import DWELL_DECADES


def apply(ports: Ports, values: Values) -> Ports:
    """Set the growth of the friction at rest, and the part of a jump that inertia adds."""
    rest_s = 10.0**DWELL_DECADES - 1.0
    left = np.exp(-((rest_s / values["static_time_s"]) ** values["static_power"]))
    return ports.with_dwell(1.0 + values["static_excess"] * (1.0 - left)).changed(swing=values["static_swing"])


EFFECT = Effect(
    id="static_friction",
    family="friction",
    acts_on="friction",
    title="friction that grows at rest",
    parameters=(
        Parameter(
            "static_excess", 0.3, "", 0.0, 5.0, null=0.0, symbol="e", title="excess of friction after a long rest"
        ),
        Parameter("static_time_s", 60.0, "s", 1.0, 600.0, sigma=60.0, symbol="t_0", title="time of friction's growth"),
        Parameter("static_power", 1.0, "", 0.3, 4.0, sigma=0.5, symbol="p", title="power of the growth"),
        share("static_swing", 0.0, symbol="s", title="part of a jump that inertia adds"),
    ),
    apply=apply,
    jumps=True,
    # Motion begins with a jump: from half or twice the excess the residual's gradient hardly points to the optimum.
    starts=tuple({"static_excess": excess} for excess in (0.1, 0.2, 0.4, 0.8)),
    laws=("friction_dwell_s",),
)
