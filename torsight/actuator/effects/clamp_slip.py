r"""A spring's fixed end slips in its clamp.

.. math:: θ_P' = θ_P − |s| \, H(t − t_s)

s angle by which the fixed end of A (s > 0) or of B (s < 0) slips (°), t_s time of the slip (s). From then on, also in
later records, the spring's winding is reduced by the slip. Predicted residual: none at the slip itself, as long as
friction holds the disk; from the next stroke on the disk rests about half of the slip further in the direction in which
the other spring pulls, and the strokes are slightly shorter or longer. Source: slip of wire ends in clamps, a usual
defect of torsion and bending rigs.
"""

from __future__ import annotations

import numpy as np

from torsight.actuator.effects import Effect, Parameter, Ports, Values, marker_slip
from torsight.core.units import DEG


def apply(ports: Ports, values: Values) -> Ports:
    """Unwind the spring whose end slips; a later record begins with the spring unwound."""
    by = values["clamp_slip_deg"] * DEG
    at_s = -np.inf if ports.history.after_record else values["clamp_slip_time_s"]
    return ports.with_slip(abs(by) * marker_slip.step(ports.time_s, at_s=at_s), spring="a" if by > 0.0 else "b")


EFFECT = Effect(
    id="clamp_slip",
    family="mechanics",
    acts_on="torque",
    title="a spring's end slipped in its clamp",
    parameters=(
        Parameter("clamp_slip_deg", 2.0, "°", -360.0, 360.0, null=0.0, symbol="s", title="slip (A's end: above 0)"),
        Parameter("clamp_slip_time_s", 0.0, "s", -1e7, 1e7, symbol="t_s", title="time of the slip"),
    ),
    apply=apply,
    event="clamp_slip_time_s",
)
