r"""What friction acts on gives way elastically before it slides.

.. math:: τ_f = \operatorname{clip}(τ_{f,0} + \frac{τ_c}{z} (φ − φ_0), −τ_c, τ_c)

z by how far the disk turns under τ_c before it slides (°): asperities, grease, a soft seat of the bearing, the shaft.
Predicted residual: where the model has the disk at rest it turns by up to 2z as the torque on it changes, and begins
to slide later. Source: Dahl, A solid friction model, Aerospace TOR-0158 (1968); one element of Iwan's,
J. Appl. Mech. 33 (1966) 893.
"""

from __future__ import annotations

from typing import Final

from torsight.actuator.effects import Effect, Values
from torsight.actuator.ports import Ports
from torsight.core.parameter import Parameter
from torsight.core.units import DEG


def apply(ports: Ports, values: Values) -> Ports:
    """Give the friction an elastic seat."""
    return ports.changed(seat_rad=values["presliding_deg"] * DEG)


EFFECT: Final = Effect(
    id="presliding",
    family="friction",
    acts_on="friction",
    title="the disk turns elastically before it slides",
    parameters=(Parameter("presliding_deg", 0.5, "°", 0.0, 90.0, null=0.0, symbol="z", title="turn before sliding"),),
    apply=apply,
    starts=({"presliding_deg": 4.0},),
)
