r"""What friction acts on gives way elastically before it slides.

.. math:: τ_f = \frac{τ_c}{N} \sum_i f_i, \qquad −1 ≤ f_i = f_{i,0} + \frac{φ − φ_0}{z_i} ≤ 1

.. math:: z_i = z \, (1 + s \, (\frac{2i − 1}{N} − 1)), \qquad i = 1 … N

z by how far the disk turns under growing torque before it slides (°), in the mean over N = 5 elements, s spread: 0 all
yield together, 1 from the start on. Asperities, grease, a soft seat of the bearing, the shaft.
Predicted residual: where the model has the disk at rest it turns by up to 2z as the torque on it changes, and begins
to slide later. Source: Iwan, J. Appl. Mech. 33 (1966) 893; presliding friction, Dahl, Aerospace TOR-0158 (1968).
"""

from __future__ import annotations

from typing import Final

from torsight.actuator.effects import Effect, Values
from torsight.actuator.ports import Ports
from torsight.core.parameter import Parameter
from torsight.core.units import DEG


def apply(ports: Ports, values: Values) -> Ports:
    """Give the friction elastic seats."""
    return ports.changed(seat_rad=values["presliding_deg"] * DEG, seat_spread=values["presliding_spread"])


EFFECT: Final = Effect(
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
