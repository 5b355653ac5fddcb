"""The nodes of the laws, chosen from the range of the driver that a record covers."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from torsight.actuator.drive import Drive
from torsight.actuator.laws.acts import DIFFERING
from torsight.actuator.laws.phase_window import BRANCH, OWN_STEPS
from torsight.actuator.record.turns import REVERSAL_C
from torsight.core.series import usual_step
from torsight.core.units import DEG, Floats

_NODES: Final = 37
"""Number of nodes. A wave five times per turn over the paper's range of 466° needs five nodes a period. Over
temperatures, a cubic spline through 37 nodes misses a random function whose length is a tenth of the range by 0.01 % of
its size, through 19 nodes by 0.3 %; a function of size 4 °C is up to 60° of angle."""
_BEYOND: Final = (0.12, 0.3)
"""Nodes beyond the range that a record covers, in shares of this range: there a law returns to its prior. Further out a
model of this record is not to be trusted."""
COLDEST: Final = len(_BEYOND)
"""Index of the node at the lowest temperature that the record covers."""


class Nodes(NamedTuple):
    """Increasing values (k,) of a driver, and the range of the driver that the record covers."""

    values: Floats
    low: float
    high: float


def _over(low: float, high: float, count: int) -> Nodes | None:
    """Return evenly spaced nodes from ``low`` to ``high`` and a few beyond; None for an empty range."""
    span = high - low
    if not span > 0.0:
        return None
    beyond = span * np.array(_BEYOND)
    return Nodes(np.concatenate([low - beyond[::-1], np.linspace(low, high, count), high + beyond]), low, high)


def angle_nodes(drive: Drive) -> Nodes | None:
    """Return nodes over the angles as read, degrees."""
    angle_deg = drive.angle_rad[np.isfinite(drive.angle_rad)] / DEG
    return _over(float(angle_deg.min()), float(angle_deg.max()), _NODES)


def winding_nodes(drive: Drive) -> Nodes | None:
    """Return nodes over the windings of both springs, degrees beyond θ_P/2."""
    angle_deg = np.abs(drive.angle_rad[np.isfinite(drive.angle_rad)] / DEG)
    return _over(-float(angle_deg.max()), float(angle_deg.max()), _NODES)


def active_nodes(drive: Drive) -> Nodes | None:
    """Return nodes over the driven spring's temperature, °C."""
    active_c = drive.temps_by_role()[0]
    return _over(float(active_c.min()), float(active_c.max()), _NODES)


def phase_nodes(_drive: Drive) -> Nodes:
    """Return nodes over the steps of the phase law's angle (:func:`phase_steps`), heating before cooling."""
    nodes = np.concatenate([OWN_STEPS, BRANCH + OWN_STEPS])
    return Nodes(nodes, nodes[0], nodes[-1])


def passive_nodes(drive: Drive) -> Nodes | None:
    """Return nodes over the other spring's temperature, °C; None where it hardly warms up."""
    passive_c = drive.temps_by_role()[1]
    low, high = float(passive_c.min()), float(np.quantile(passive_c, 0.99))
    return _over(low, high, _NODES) if high - low > REVERSAL_C else None


def rate_nodes(drive: Drive) -> Nodes | None:
    """Return nodes over the temperatures' rates, °C/s."""
    return _over_rates(np.concatenate([drive.rate_a_c_s, drive.rate_b_c_s]))


def active_rate_nodes(drive: Drive) -> Nodes | None:
    """Return nodes over the rate of the driven spring's temperature, °C/s."""
    return _over_rates(drive.rates_by_role()[0])


def _over_rates(rate_c_s: Floats) -> Nodes | None:
    low, high = np.quantile(rate_c_s, [0.002, 0.998])
    return _over(float(low), float(high), _NODES)


def speed_nodes(drive: Drive) -> Nodes | None:
    """Return nodes over speeds in °/s, denser at low speeds."""
    good = np.isfinite(drive.angle_rad)
    time_s, angle_deg = drive.time_s[good], drive.angle_rad[good] / DEG
    every = max(1, round(2.0 / usual_step(time_s)))
    speed = np.abs(np.diff(angle_deg[::every]) / np.diff(time_s[::every]))
    fastest = float(np.quantile(speed, 0.998)) if len(speed) else 0.0
    return Nodes(fastest * np.linspace(0.0, 1.1, _NODES) ** 2, 0.0, fastest) if fastest > 0.0 else None


def dwell_nodes(drive: Drive) -> Nodes | None:
    """Return nodes over rests, in decades of seconds."""
    longest_s = float(np.max(np.bincount(drive.cycles.half))) * usual_step(drive.time_s)
    decades = float(np.log10(1.0 + longest_s))
    return Nodes(np.linspace(0.0, decades, 9), 0.0, decades)


def time_nodes(drive: Drive) -> Nodes | None:
    """Return nodes over the record's time, s."""
    first, last = float(drive.time_s[0]), float(drive.time_s[-1])
    return Nodes(np.linspace(first, last, _NODES), first, last) if last > first else None


def half_nodes(drive: Drive) -> Nodes | None:
    """Return the numbers of the half-cycles from 0, including later records' half-cycles."""
    count = len(drive.cycles.springs)
    return _counted(count) if count > 2 else None


def cycle_nodes(drive: Drive) -> Nodes | None:
    """Return the numbers of a spring's own cycles from 0, including later records' cycles."""
    count = int(drive.cycles.counts().max()) + 1
    return _counted(count) if count > 1 else None


def _counted(count: int) -> Nodes:
    # Half of them lie beyond the record, where the prior alone determines mean and variance.
    return Nodes(np.arange(2 * count, dtype=np.float64), 0.0, count - 1.0)


def unlike_nodes(drive: Drive) -> Nodes | None:
    """Return the indices of the values in which two springs may differ; None where only one spring is driven."""
    both = len(set(drive.cycles.springs)) > 1
    return Nodes(np.arange(float(DIFFERING)), 0.0, DIFFERING - 1.0) if both else None


def signs(_drive: Drive) -> Nodes:
    """Return the two directions."""
    return Nodes(np.array([-1.0, 1.0]), -1.0, 1.0)
