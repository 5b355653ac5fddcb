"""The families of laws: each a port of the model with a variable on which a law at this port may depend."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

from torsight.actuator.drive import Drive
from torsight.actuator.laws import acts, banks, nodes
from torsight.actuator.laws.acts import Curve
from torsight.actuator.laws.nodes import Nodes
from torsight.actuator.ports import Ports
from torsight.core.law import Kernel
from torsight.core.units import Floats


@dataclass(frozen=True, slots=True)
class Family:
    """A port with a driver."""

    id: str
    """``<port>_<driver>``, with the spring where the law acts on one spring."""
    port: str
    driver: str
    unit: str
    title: str
    """As in :class:`torsight.core.law.Law`, as is ``spring``."""
    stage: str
    """Stage at which the law acts: ``clock``, ``temperature``, ``phase``, ``torque``, ``friction`` or ``reading``."""
    apply: Callable[[Ports, Curve], Ports]
    """From ports and the law as a function of its driver to ports."""
    nodes: Callable[[Drive], Nodes | None]
    """From a prepared record to the nodes; None where the record does not cover the driver."""
    scale: float
    """A size that matters, in ``unit``; for torques a share of τ_c."""
    kernels: Callable[[Floats], tuple[Kernel, ...]]
    """From nodes to the bank."""
    spring: str = "both"
    time_like: bool = False
    """True where the driver only counts time or cycles."""
    over: str = ""
    """Meaning of the nodes, in a few words, where they are not values of the driver."""
    read: Callable[[Ports, Floats], Floats] | None = None
    """The inverse of ``apply``: from ports and values of the driver (k,) to the values of the law that acted on
    them."""


_ALL: Final = (
    Family("torque_angle_deg", "torque", "angle_deg", "mN·m", "stray torque over the angle", "torque", acts.stray,
           nodes.angle_nodes, 0.1, banks.waves, read=acts.stray_of),
    Family("winding_winding_deg", "winding", "winding_deg", "mN·m", "a spring's torque over its winding", "torque",
           acts.winding("both"), nodes.winding_nodes, 0.1, banks.wound),
    *(Family(f"winding_{one}_winding_deg", "winding", "winding_deg", "mN·m",
             f"spring {one.upper()}'s torque over its winding", "torque", acts.winding(one), nodes.winding_nodes, 0.1,
             banks.wound, spring=one) for one in "ab"),
    Family("winding_time_s", "winding", "time_s", "", "a cold spring's torque over time", "torque", acts.relaxing,
           nodes.time_nodes, 0.01, banks.relaxing, time_like=True),
    Family("loading_winding_deg", "winding", "winding_deg", "mN·m", "the loading curve over the winding", "torque",
           acts.loading("both"), nodes.winding_nodes, 0.1, banks.wound),
    *(Family(f"loading_{one}_winding_deg", "winding", "winding_deg", "mN·m",
             f"spring {one.upper()}'s loading curve over the winding", "torque", acts.loading(one),
             nodes.winding_nodes, 0.1, banks.wound, spring=one) for one in "ab"),
    Family("loading_alone_winding_deg", "winding", "winding_deg", "mN·m",
           "the loading curve over the winding, recoverable angle as before", "torque",
           acts.loading("both", follows=0.0), nodes.winding_nodes, 0.1, banks.wound),
    Family("friction_angle_deg", "friction", "angle_deg", "", "friction over the angle", "friction",
           acts.friction_angle, nodes.angle_nodes, 0.1, banks.waves, read=acts.friction_of),
    Family("friction_temp_active_c", "friction", "temp_active_c", "", "friction over the driven spring's temperature",
           "friction", acts.friction_active, nodes.active_nodes, 0.1, banks.plain),
    Family("friction_temp_passive_c", "friction", "temp_passive_c", "", "friction over the other spring's temperature",
           "friction", acts.friction_passive, nodes.passive_nodes, 0.1, banks.plain),
    Family("friction_temp_rate_c_s", "friction", "temp_rate_c_s", "", "friction over the rate of the driven spring's"
           " temperature", "friction", acts.friction_temp_rate, nodes.active_rate_nodes, 0.1, banks.plain),
    Family("friction_angle_rate_deg_s", "friction", "angle_rate_deg_s", "", "friction over the rate of the angle",
           "friction", acts.friction_speed, nodes.speed_nodes, 0.1, banks.from_zero),
    Family("friction_dwell_s", "friction", "dwell_s", "", "friction over the time at rest", "friction",
           acts.friction_dwell, nodes.dwell_nodes, 0.1, banks.from_zero, read=acts.dwell_of),
    Family("friction_direction", "friction", "direction", "", "friction over the direction", "friction",
           acts.friction_direction, nodes.signs, 0.1, banks.antisymmetric),
    Family("friction_cycle", "friction", "cycle", "", "friction over the half-cycles", "friction", acts.friction_cycle,
           nodes.half_nodes, 0.1, banks.counted, time_like=True),
    Family("reading_angle_deg", "reading", "angle_deg", "°", "the reading over the angle", "reading",
           acts.reading_angle, nodes.angle_nodes, 0.3, banks.waves, spring="", read=acts.reading_of),
    Family("reading_time_s", "reading", "time_s", "°", "the reading over time", "reading", acts.reading_time,
           nodes.time_nodes, 0.3, banks.drifting, spring="", time_like=True),
    Family("temperature_temp_active_c", "temperature", "temp_active_c", "°C", "the wires' temperatures over themselves",
           "temperature", acts.temperature("both"), nodes.active_nodes, 0.3, banks.plain),
    *(Family(f"temperature_{one}_temp_active_c", "temperature", "temp_active_c", "°C",
             f"wire {one.upper()}'s temperature over itself", "temperature", acts.temperature(one), nodes.active_nodes,
             0.3, banks.from_room, spring=one) for one in "ab"),
    Family("temperature_temp_rate_c_s", "temperature", "temp_rate_c_s", "°C", "the wires' temperatures over their rate",
           "temperature", acts.temperature_rate("both"), nodes.rate_nodes, 0.3, banks.through_zero),
    *(Family(f"temperature_{one}_temp_rate_c_s", "temperature", "temp_rate_c_s", "°C",
             f"wire {one.upper()}'s temperature over its rate", "temperature", acts.temperature_rate(one),
             nodes.rate_nodes, 0.3, banks.through_zero, spring=one) for one in "ab"),
    Family("temperature_time_s", "temperature", "time_s", "°C", "the wires' temperatures over time", "temperature",
           acts.temperature_time("both"), nodes.time_nodes, 0.3, banks.drifting, time_like=True),
    *(Family(f"temperature_{one}_time_s", "temperature", "time_s", "°C", f"wire {one.upper()}'s temperature over time",
             "temperature", acts.temperature_time(one), nodes.time_nodes, 0.3, banks.relaxing, spring=one,
             time_like=True) for one in "ab"),
    Family("temperature_cycle", "temperature", "cycle", "°C",
           "the transformation temperatures over a spring's own cycles", "phase", acts.temperature_cycle,
           nodes.cycle_nodes, 0.3, banks.counted),
    Family("clock_time_s", "temperature", "time_s", "s", "the temperature log's clock over time", "clock",
           acts.clock, nodes.time_nodes, 1.0, banks.wandering),
    Family("phase_half_cycle", "phase", "cycle", "", "the recoverable angle over the half-cycles", "phase",
           acts.theta_l_half, nodes.half_nodes, 0.03, banks.counted),
    Family("phase_cycle", "phase", "cycle", "", "the recoverable angle over a spring's own cycles", "phase",
           acts.theta_l_cycle, nodes.cycle_nodes, 0.03, banks.counted),
    Family("phase_temp_active_c", "phase", "temp_active_c", "", "the phase law over the temperature", "phase",
           acts.phase_lead, nodes.phase_nodes, 0.05, banks.leading,
           over="steps through the window of heating, then of cooling"),
    Family("values_spring", "values", "spring", "°C", "spring B's values", "phase", acts.differing,
           nodes.unlike_nodes, 1.0, banks.unlike, spring="b"),
)  # fmt: skip
FAMILIES: Final[Mapping[str, Family]] = {family.id: family for family in _ALL}
"""All families by id."""
