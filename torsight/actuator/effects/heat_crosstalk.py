r"""The other spring gets warm enough to start transforming.

The phase law (13, 14) runs in a share w of the other spring, at that spring's own temperature and stress, and its
recovery pulls against the driven spring:

.. math:: τ_p = τ_{mart}(θ_p) + w K(ξ_p) (1 − ξ_p) θ_L(θ_p), \qquad T_p = T_{p,m} + c (T_a − T_{p,m})

T_{p,m} measured temperature of the other spring, T_a of the driven one (°C), c share of the temperature difference that
reaches the other spring's wire but not its sensor. Predicted residual: a threshold; zero while the other spring is
cold, then a shorter stroke and an early return at the hot end. Source: the paper, section 4.2 and its figure 16.
"""

from __future__ import annotations

import numpy as np

from torsight.actuator.effects import Effect, Parameter, Ports, Values


def apply(ports: Ports, values: Values) -> Ports:
    """Let the passive spring transform at its own temperature."""
    a_c, b_c, is_a, leak = ports.temp_a_c, ports.temp_b_c, ports.active == 0, values["heat_leak"]
    temp_a_c = np.where(is_a, a_c, a_c + leak * (b_c - a_c))
    temp_b_c = np.where(is_a, b_c + leak * (a_c - b_c), b_c)
    return ports.changed(temp_a_c=temp_a_c, temp_b_c=temp_b_c, passive_share=values["passive_share"])


EFFECT = Effect(
    id="heat_crosstalk",
    family="heat",
    acts_on="phase",
    title="the other spring gets warm enough to transform",
    parameters=(
        Parameter(
            "passive_share", 0.8, "", 0.0, 1.5, null=0.0, symbol="w", title="share of the other spring that transforms"
        ),
        Parameter(
            "heat_leak", 0.05, "", -0.1, 0.6, sigma=0.15, null=0.0, symbol="c", title="share of the heat that crosses"
        ),
    ),
    apply=apply,
    starts=({"passive_share": 1.0, "heat_leak": 0.2}, {"passive_share": 0.5, "heat_leak": 0.35}),
)
