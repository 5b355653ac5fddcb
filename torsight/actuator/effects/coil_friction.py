r"""Tight coils rub on each other.

.. math:: τ_f = τ_c + k R \sum_{A,B} \left(\frac{(θ − θ_{on})_+}{R}\right)^p

θ winding of either spring, θ_on winding beyond which coils touch (°), k mean rise of friction over the first R = 100°
(mN·m/rad), p exponent (1: a line; more where ever more coils touch). Predicted residual: it grows towards the ends of
the stroke, and its sign follows the direction of motion. Source: the paper, section 4.1, step 2.
"""

from __future__ import annotations

import numpy as np

from torsight.actuator.effects import Effect, Parameter, Ports, Values
from torsight.actuator.ports import REACH_RAD
from torsight.core.units import DEG, MNM


def apply(ports: Ports, values: Values) -> Ports:
    """Add k R Σ ((θ − θ_on)₊ / R)^p of both springs to the friction, the same for both directions."""
    theta_a_rad, onset_rad, power = ports.grid_rad(), values["coil_onset_deg"] * DEG, values["coil_exponent"]
    past_a = np.maximum(0.0, theta_a_rad - onset_rad) / REACH_RAD
    past_b = np.maximum(0.0, ports.rig.theta_p_rad - theta_a_rad - onset_rad) / REACH_RAD
    added = values["coil_friction_mnm_per_rad"] * MNM * REACH_RAD * (past_a**power + past_b**power)
    one = np.ones_like(added)
    return ports.with_friction(one, one, added)


EFFECT = Effect(
    id="coil_friction",
    family="friction",
    acts_on="friction",
    title="tight coils rub on each other",
    parameters=(
        Parameter(
            name="coil_friction_mnm_per_rad",
            value=0.1,
            unit="mN·m/rad",
            lower=0.0,
            upper=20.0,
            null=0.0,
            symbol="k",
            title="rise of friction with the winding",
        ),
        Parameter(
            name="coil_onset_deg",
            value=620.0,
            unit="°",
            lower=100.0,
            upper=2000.0,
            sigma=200.0,
            symbol="θ_on",
            title="winding at which coils touch",
        ),
        Parameter("coil_exponent", 1.0, "", 0.5, 4.0, sigma=0.5, symbol="p", title="power of the rise"),
    ),
    apply=apply,
    starts=({"coil_friction_mnm_per_rad": 0.3, "coil_onset_deg": 690.0}, {"coil_onset_deg": 550.0}),
    laws=("friction_angle_deg",),
)
