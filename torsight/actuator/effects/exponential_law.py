r"""The transformation follows Tanaka's exponential.

.. math:: u → (1 − s_e) \, u + s_e \, u_e, \qquad 1 − \cos π u_e = 2 \, (1 − e^{−u \ln 100})

u place in the law's window, 0 at its start and 1 at its end, where 1 % of the exponential remains; u_e the place at
which the cosine of Liang and Rogers has transformed the same share as the exponential; s_e weight of the exponential,
1: Tanaka's law. Predicted residual: motion begins with a jump of its speed and ends slowly, on heating and on cooling.
Source: Tanaka, Res Mechanica 18 (1986) 251.
"""

from __future__ import annotations

from typing import Final

from torsight.actuator.effects import Effect, Parameter, Ports, Values
from torsight.actuator.laws.phase_window import exponential_lead
from torsight.actuator.stepping.phase import PLACES

_LEAD: Final = exponential_lead(PLACES)


def apply(ports: Ports, values: Values) -> Ports:
    """Let the transformation run ahead of the cosine by the exponential's lead."""
    lead = values["exponential_share"] * _LEAD
    return ports.with_lead(lead, lead)


EFFECT = Effect(
    id="exponential_law",
    family="material",
    acts_on="phase",
    title="the transformation follows Tanaka's exponential",
    parameters=(
        Parameter("exponential_share", 0.5, "", 0.0, 1.2, null=0.0, symbol="s_e", title="share of the exponential law"),
    ),
    apply=apply,
    starts=({"exponential_share": 1.0},),
    laws=("phase_temp_active_c",),
)
