r"""The surfaces in contact yield elastically before the disk slides.

.. math:: τ_f = \frac{τ_c}{N} \sum_i f_i, \qquad −1 ≤ f_i = f_{i,0} + \frac{φ − φ_0}{z_i} ≤ 1

.. math:: z_i = z \, (1 + s \, (\frac{2i − 1}{N} − 1)), \qquad i = 1 … N

z angle by which the disk turns under growing torque before it slides (°), averaged over N = 5 elastic elements
(asperities, grease, a soft seat of the bearing, the shaft); s spread of the elements' angles: with 0 all elements yield
together, with 1 the first yields from the start.
Predicted residual: where the model's disk is at rest, the real one turns by up to 2z as the torque changes, and it
begins to slide later. Source: Iwan, J. Appl. Mech. 33 (1966) 893; presliding friction, Dahl, Aerospace TOR-0158 (1968).
"""

from __future__ import annotations

from torsight.actuator.effects import Effect, Parameter, Ports, Values
from torsight.core.units import DEG


def apply(ports: Ports, values: Values) -> Ports:
    """Set the angle and the spread of the friction's elastic elements."""
    return ports.changed(seat_rad=values["presliding_deg"] * DEG, seat_spread=values["presliding_spread"])


EFFECT = Effect(
    id="presliding",
    family="friction",
    acts_on="friction",
    title="the disk turns elastically before it slides",
    parameters=(
        Parameter("presliding_deg", 0.5, "°", 0.0, 90.0, null=0.0, symbol="z", title="turn before sliding"),
        Parameter("presliding_spread", 0.3, "", 0.0, 0.95, sigma=0.4, symbol="s", title="spread of that turn"),
    ),
    apply=apply,
    starts=({"presliding_deg": 4.0},),
)
