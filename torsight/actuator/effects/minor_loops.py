r"""A wire remembers where it turned: what it does after an incomplete transformation is not the law scaled down.

.. math:: ξ = (1 − m) \, ξ_{LR} + m \, ξ_w, \qquad ξ_w = \min(ξ_0, 1 − d) \; \text{or} \; \max(ξ_0, d)

on heating or on cooling; ξ0 fraction at which this transformation began, d what the law of a whole transformation has
done, ξ_LR the law of Liang and Rogers (13, 14), scaled to what is left; m memory: 0 begins at once, 1 waits until the
whole loop comes by.
Predicted residual: none where every transformation begins from all martensite or all austenite; after an incomplete
heating the cooling comes later than modelled. Source: Bekker and Brinson, Acta Mater. 46 (1998) 3649 (both hypotheses);
Preisach's model is m = 1 where all of the wire's parts are as wide.
"""

from __future__ import annotations

from typing import Final

from torsight.actuator.effects import Effect, Values
from torsight.actuator.ports import Ports
from torsight.core.parameter import Parameter


def apply(ports: Ports, values: Values) -> Ports:
    """Let the transformations after incomplete ones begin later."""
    return ports.changed(loop_memory=values["loop_memory"])


EFFECT: Final = Effect(
    id="minor_loops",
    family="material",
    acts_on="phase",
    title="minor loops of another form",
    parameters=(Parameter("loop_memory", 0.5, "", 0.0, 1.0, null=0.0, symbol="m", title="memory of the whole loop"),),
    apply=apply,
)
