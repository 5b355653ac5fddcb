r"""The R-phase: a small early step of torque that reverses at nearly the same temperature.

.. math:: τ_R = K_M θ_R \, (1 − \cos π x) / 2, \quad x = (T − T_R) / w \in [0, 1]

θ_R recoverable angle of the step (°), T_R temperature at which the step begins, w its width (°C), for each spring at
its own temperature. Predicted residual: an early start of the stroke, which reverses as the spring cools. Source:
Otsuka and Ren, Prog. Mater. Sci. 50 (2005) 511, section 3.
"""

from __future__ import annotations

import numpy as np

from torsight.actuator.effects import Effect, Parameter, Ports, Values
from torsight.core.units import DEG


def apply(ports: Ports, values: Values) -> Ports:
    """Add the step's torque to that of either spring."""
    start_c, width_c = values["r_phase_start_c"], values["r_phase_width_c"]
    whole_nm = ports.rig.k_martensite * values["r_phase_deg"] * DEG
    places = (np.clip((temp_c - start_c) / width_c, 0.0, 1.0) for temp_c in (ports.temp_a_c, ports.temp_b_c))
    side_a_nm, side_b_nm = (whole_nm * (0.5 * (1.0 - np.cos(np.pi * place))) for place in places)
    return ports.changed(side_a_nm=side_a_nm, side_b_nm=side_b_nm)


EFFECT = Effect(
    id="r_phase",
    family="material",
    acts_on="torque",
    title="a small early step of either spring",
    parameters=(
        Parameter("r_phase_deg", 10.0, "°", 0.0, 360.0, null=0.0, symbol="θ_R", title="recoverable angle of the step"),
        Parameter("r_phase_start_c", 26.0, "°C", 0.0, 60.0, sigma=5.0, symbol="T_R", title="start of the step"),
        Parameter("r_phase_width_c", 12.0, "°C", 1.0, 40.0, sigma=5.0, symbol="w", title="width of the step"),
    ),
    apply=apply,
)
