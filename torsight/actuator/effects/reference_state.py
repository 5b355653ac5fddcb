r"""A standstill within a stroke renews the reference state of the driven spring's torque, wholly or in part.

.. math:: (θ_r, τ_r, ξ_r) → (θ_r, τ_r, ξ_r) + ρ \, (1 - e^{-t/t_0}) \, [(θ, τ, ξ) - (θ_r, τ_r, ξ_r)]

ρ renewed share (0: the stroke continues as if it had not been interrupted; 1: it begins anew), t time for which disk
and transformation stand, t0 0.5 s.
The torque does not change meanwhile; what follows does, because the stiffness multiplies the way from the reference
state. It is no effect of the rig: the paper's rule resets the reference state wherever sticking turns into sliding and
does not say whether a stroke interrupted by a hold of the temperature begins anew. So discovery always fits ρ beside
the characterised values and never names it. Source: the paper, section 3.3, equations (20) to (26).
"""

from __future__ import annotations

from torsight.actuator.effects import Effect, Ports, Values, unknown_share


def apply(ports: Ports, values: Values) -> Ports:
    """Renew the reference state at a standstill."""
    return ports.changed(renewal=values["renewal"])


EFFECT = Effect(
    id="reference_state",
    family="form",
    acts_on="phase",
    title="reference state after a standstill",
    parameters=(unknown_share("renewal", symbol="ρ", title="share of the reference state that a standstill renews"),),
    apply=apply,
)
