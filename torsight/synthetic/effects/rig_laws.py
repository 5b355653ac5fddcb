"""Laws of any shape at one place of the rig, each a function of one variable.

A law is a table over its driver. Each law of the compiled integrator has a slot there; laws of the recoverable angle
and of the reading act before and after the integrator. Values are added, or are a relative change:

==============  ====================================================  ======================================
port            drivers                                               value
==============  ====================================================  ======================================
torque          angle φ (rad)                                         added torque, N·m
friction        angle, temperature of the driven spring (°C), angle   relative change of the Coulomb torque
                rate (rad/s), dwell (time at rest, s; at its end)
reading         angle, time (s)                                       added to the angle that is read, rad
temperature     temperature, temp_rate (K/s)                          wire less sensor, K
phase           temperature minus its shift by stress                 added to the phase law's temperature, K
winding         winding θ of the spring itself (rad)                  added torque, N·m, in both directions
loading         winding                                               added to the loading curve past θ_cr, N·m
recoverable     half_cycle, cycle (of the spring itself)              relative change of θ_L
==============  ====================================================  ======================================
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from torsight.core.errors import ConfigError
from torsight.core.units import Floats, Ints

NODES: Final = 256
"""Nodes of a law in the integrator: linear interpolation errs by 2e-4 of the size of a law of the shortest length."""

SLOTS: Final[Mapping[tuple[str, str], int]] = {
    ("torque", "angle"): 0,
    ("friction", "angle"): 1,
    ("friction", "temperature"): 2,
    ("friction", "rate"): 3,
    ("friction", "dwell"): 4,
    ("temperature", "temperature"): 5,
    ("temperature", "temp_rate"): 6,
    ("winding", "winding"): 7,
    ("loading", "winding"): 8,
    ("phase", "temperature"): 9,
}
"""Rows of the integrator's table of laws, by port and driver."""
OUTSIDE: Final = (("reading", "angle"), ("reading", "time"), ("recoverable", "half_cycle"), ("recoverable", "cycle"))
"""Laws that act outside the integrator."""


@dataclass(frozen=True, eq=False)
class RigLaw:
    """One law of a rig: its port and driver (see the module), with values at equal distances.

    The ends of the driver's range are in SI units and °C, beyond them the value is constant; values (n,) are in the
    port's unit. ``spring`` is ``a``, ``b`` or ``both``, for a port that each spring has.
    """

    port: str
    driver: str
    start: float
    stop: float
    values: Floats
    spring: str = "both"

    def __post_init__(self) -> None:
        known = (*SLOTS, *OUTSIDE)
        if (self.port, self.driver) not in known or not self.stop > self.start or len(self.values) < 2:
            raise ConfigError(
                "is no law of the rig",
                where=f"law of {self.port} over {self.driver}",
                value=f"{len(self.values)} values from {self.start:g} to {self.stop:g}",
                limit="; ".join(f"{port} over {driver}" for port, driver in known),
            )

    def __call__(self, driver: Floats) -> Floats:
        """Return the law's values (n,) at values of its driver."""
        nodes = np.linspace(self.start, self.stop, len(self.values))
        return np.asarray(np.interp(driver, nodes, self.values), np.float64)

    def on_nodes(self) -> Floats:
        """Return the values on the integrator's nodes."""
        return self(np.linspace(self.start, self.stop, NODES))

    def scaled(self, factor: float) -> RigLaw:
        """Return the law with all values multiplied."""
        return replace(self, values=self.values * factor)


def recoverable_share(laws: Iterable[RigLaw], *, half_cycle: Ints, cycle: Floats) -> Floats:
    """Return the factor (n,) of θ_L in each half-cycle, from its number and the spring's own cycle number."""
    share = np.ones(len(cycle))
    for item in laws:
        if item.port == "recoverable":
            number = np.maximum(half_cycle, 0).astype(np.float64) if item.driver == "half_cycle" else cycle
            share *= 1.0 + item(number)
    return share


def read_with(laws: Iterable[RigLaw], *, angle_rad: Floats, time_s: Floats) -> Floats:
    """Return the sum (n,) of the laws of the reading, rad."""
    added = np.zeros(len(angle_rad))
    for item in laws:
        if item.port == "reading":
            added += item(angle_rad if item.driver == "angle" else time_s)
    return added
