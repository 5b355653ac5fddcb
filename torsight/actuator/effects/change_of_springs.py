r"""The disk stays where it is, wholly or in part, when the other spring's turn comes.

.. math:: τ_2 → τ_2 + κ \, (τ_2^* - τ_2)

τ_2 torque of the spring that is driven next, τ_2^* the nearest torque at which friction holds the disk, κ held share
(0: the disk gives way until friction holds it; 1: it does not move). A spring that has cooled may carry more than its
loading curve; the paper begins every half-cycle with both springs on this curve, and does not say what becomes of the
balance at the change. It is no effect of the rig, so discovery always fits κ beside the characterised values and never
names it. Source: the paper, section 4.2, and equation (21), in which τ_1 is what the other spring and friction hold.
"""

from __future__ import annotations

from torsight.actuator.effects import Effect, Ports, Values, unknown_share


def apply(ports: Ports, values: Values) -> Ports:
    """Hold the disk at a change of springs."""
    return ports.changed(change_held=values["change_held"])


EFFECT = Effect(
    id="change_of_springs",
    family="form",
    acts_on="phase",
    title="rest at a change of springs",
    parameters=(
        unknown_share("change_held", symbol="κ", title="share of the rest at a change of springs that is held"),
    ),
    apply=apply,
)
