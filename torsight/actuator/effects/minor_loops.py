r"""A wire remembers where its last transformation ended: after an incomplete one the phase law is not merely scaled.

.. math:: ξ = (1 − m) \, ξ_{LR} + m \, ξ_w, \qquad ξ_w = \min(ξ_0, 1 − d) \; \text{or} \; \max(ξ_0, d)

on heating or on cooling; ξ0 fraction at which this transformation began, d transformed share by the law of a complete
transformation, ξ_LR the law of Liang and Rogers (13, 14), scaled to the remaining share; m memory: with 0 the
transformation begins at the start of its window, with 1 when the complete loop reaches ξ0.
Predicted residual: none where every transformation begins from full martensite or full austenite; after an incomplete
heating the cooling comes later than modelled. Source: Bekker and Brinson, Acta Mater. 46 (1998) 3649 (both hypotheses);
Preisach's model is m = 1 where all parts of the wire have hysteresis of equal width.
"""

from __future__ import annotations

from torsight.actuator.effects import Effect, Parameter, Ports, Values


def apply(ports: Ports, values: Values) -> Ports:
    """Let a transformation after an incomplete one begin later."""
    return ports.changed(loop_memory=values["loop_memory"])


EFFECT = Effect(
    id="minor_loops",
    family="material",
    acts_on="phase",
    title="minor loops of another form",
    parameters=(Parameter("loop_memory", 0.5, "", 0.0, 1.0, null=0.0, symbol="m", title="memory of the whole loop"),),
    apply=apply,
)
