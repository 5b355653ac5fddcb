"""Detection of records that begin within a transformation, and of the rows that are affected.

Every half-cycle of the model begins with both springs as martensite. A film that starts when a spring is hot shows the
end of a transformation without its beginning, and this error remains in the angle until the springs are cold.
"""

from __future__ import annotations

import numpy as np

from torsight.actuator.drive import Drive
from torsight.actuator.record.segments import turn_of
from torsight.actuator.simulation import Simulation
from torsight.actuator.springs import Rig
from torsight.core.units import Flags


def begins_within(drive: Drive, simulation: Simulation, rig: Rig) -> bool:
    """Return whether at the first row the driven spring recovers already, or the other one has not cooled down.

    Only the first row of ``simulation`` is used.
    """
    driven = drive.cycles.springs[0]
    recovers = (simulation.xi_a, simulation.xi_b)[driven][0] < 1.0
    other_nm = (simulation.torque_b_nm, simulation.torque_a_nm)[driven][0]
    finish_c = rig.m_finish_c + other_nm * rig.stress_per_torque / rig.c_martensite
    return bool(recovers or not _cold(drive, finish_c)[1 - driven][0])


def first_cold_row(drive: Drive, rig: Rig) -> int:
    """Return the first row at which both springs are martensite under any torque; without one, the number of rows."""
    a, b = _cold(drive, rig.m_finish_c)
    both = a & b
    return int(np.argmax(both)) if both.any() else len(drive)


def _cold(drive: Drive, finish_c: float) -> tuple[Flags, Flags]:
    """Return the masks (n,) of the rows at which A and B are martensite, as completely as they get in this record."""
    slack_c = turn_of(drive.noise_c)
    a, b = (temp_c <= max(finish_c, float(temp_c.min()) + slack_c) for temp_c in (drive.temp_a_c, drive.temp_b_c))
    return a, b
