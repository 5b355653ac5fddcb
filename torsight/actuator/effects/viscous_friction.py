r"""Grease: friction grows with speed.

.. math:: τ_f = τ_c + b ω_0 (|\dot φ| / ω_0)^m, \qquad ω_0 = 1 rad/s

b viscous coefficient at 1 rad/s (mN·m·s/rad), m power (1: a Newtonian oil; below 1: shear-thinning grease). Predicted
residual: it grows with the speed, and its sign follows the direction; it vanishes soon after the temperature becomes
constant. Source: Coulomb and viscous friction, e.g. Armstrong-Hélouvry et al., Automatica 30 (1994) 1083; power-law
fluids (Ostwald and de Waele).
"""

from __future__ import annotations

from torsight.actuator.effects import Effect, Parameter, Ports, Values
from torsight.core.units import MNM


def apply(ports: Ports, values: Values) -> Ports:
    """Set coefficient and power."""
    viscous_nms = values["viscous_mnm_s_per_rad"] * MNM
    return ports.changed(viscous_nms=viscous_nms, viscous_power=values["viscous_power"])


EFFECT = Effect(
    id="viscous_friction",
    family="friction",
    acts_on="friction",
    title="friction grows with speed",
    parameters=(
        Parameter(
            "viscous_mnm_s_per_rad", 3.0, "mN·m·s/rad", 0.0, 2000.0, null=0.0, symbol="b", title="viscous coefficient"
        ),
        Parameter("viscous_power", 1.0, "", 0.3, 1.5, sigma=0.2, symbol="m", title="power of the speed"),
    ),
    apply=apply,
    starts=({"viscous_mnm_s_per_rad": 20.0},),
    laws=("friction_angle_rate_deg_s",),
)
