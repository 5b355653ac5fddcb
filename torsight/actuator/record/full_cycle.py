"""A temperature log of one full cycle of an actuator: A is heated and cooled completely, then B."""

from __future__ import annotations

from typing import Final

import numpy as np

from torsight.actuator.springs import Rig
from torsight.actuator.stepping.closed_form import stable_cycle
from torsight.core.records import TemperatureLog

_RAMP_S: Final = 200.0
"""Duration of one heating or cooling: the plain model does not depend on it, and a sensor's lag is much shorter."""


def full_cycle(rig: Rig) -> tuple[TemperatureLog, float]:
    """Return the log, one row per second, and the angle at which the stable cycle begins, rad.

    When cold, a spring is full martensite without stress; when hot, full austenite under the stress at the stroke's
    end. A quarter of the transformation's width beyond both makes them complete.
    """
    cycle = stable_cycle(rig)
    torque_nm = rig.loading_torque(rig.theta_p_rad - cycle.theta_2_rad) + rig.tau_c_nm
    hot_c = rig.a_finish_c + torque_nm * rig.stress_per_torque / rig.c_austenite
    hot_c += 0.25 * (rig.a_finish_c - rig.a_start_c)
    cold_c = rig.m_finish_c - 0.25 * (rig.m_start_c - rig.m_finish_c)
    edges_s, edges_c = _RAMP_S * np.arange(5), [cold_c, hot_c, cold_c]
    time_s = np.arange(0.0, edges_s[-1] + 1.0)
    a_c, b_c = np.interp(time_s, edges_s[:3], edges_c), np.interp(time_s, edges_s[2:], edges_c)
    return TemperatureLog(time_s, a_c, b_c), cycle.theta_1_rad - 0.5 * rig.theta_p_rad
