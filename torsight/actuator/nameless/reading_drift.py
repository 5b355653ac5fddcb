r"""What is read drifts: a camera's mount or a stick's glue creeps, the room warms up.

.. math:: φ_{read} = φ + d \, (t − t_0)

d drift (°/h), t_0 the record's start. Predicted residual: grows with time, alike at rest and in motion, at any angle
and temperature. Source: long-term stability of cameras, e.g. Luhmann et al., Close-Range Photogrammetry and 3D Imaging
(2020), ch. 7.
"""

from __future__ import annotations

from typing import Final

from torsight.actuator.effects import Effect, Values
from torsight.actuator.ports import Ports
from torsight.core.parameter import Parameter
from torsight.core.units import DEG

_HOUR_S: Final = 3600.0


def apply(ports: Ports, values: Values) -> Ports:
    """Add the drift since the record's first row."""
    rate_rad_s, start_s = values["reading_drift_deg_h"] * DEG / _HOUR_S, ports.record_began_s
    return ports.with_reading(lambda phi_rad, time_s: phi_rad + rate_rad_s * (time_s - start_s))


EFFECT: Final = Effect(
    id="reading_drift",
    family="unnamed",
    acts_on="reading",
    title="a reading that drifts",
    parameters=(Parameter(name="reading_drift_deg_h", value=1.0, unit="°/h", lower=-360.0, upper=360.0, null=0.0),),
    apply=apply,
    drivers=("time_s",),
)
