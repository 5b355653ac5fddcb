"""The variables on which a missing effect may depend, row by row."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from torsight.actuator.drive import Drive
from torsight.core.series import bridged
from torsight.core.units import Flags, Floats, Ints
from torsight.discovery.actuator.kept_rows import REST_SPEED_DEG_S


def actuator_drivers(drive: Drive, rows: Ints, angle_deg: Floats, rest: Flags) -> Mapping[str, Floats]:
    """Return the drivers of the contract at the kept rows.

    ``angle_deg`` is the measured or modelled angle in these rows, ``rest`` marks the rows at rest. ``direction`` is +1
    or −1, at rest the last of both; ``dwell_s`` the time since the angle last moved (0 in motion); ``cycle`` the number
    of earlier heatings of the driven spring.
    """
    time_s = drive.time_s[rows]
    active, passive = drive.temps_by_role()
    angle = bridged(angle_deg)
    rate = np.where(rest, 0.0, _rate(time_s, angle))
    return {
        "angle_deg": angle,
        "angle_rate_deg_s": rate,
        "temp_active_c": active[rows],
        "temp_passive_c": passive[rows],
        "temp_rate_c_s": drive.rates_by_role()[0][rows],
        "time_s": time_s - time_s[0],
        "cycle": drive.cycles.counts()[drive.cycles.half[rows]].astype(np.float64),
        "dwell_s": _since(time_s, moving=~rest),
        "direction": _last_sign(rate),
    }


def _rate(time_s: Floats, angle: Floats) -> Floats:
    """Return the angle's slope over five seconds before and after each row, °/s."""
    low = np.searchsorted(time_s, time_s - 5.0)
    high = np.searchsorted(time_s, time_s + 5.0, side="right") - 1
    span = time_s[high] - time_s[low]
    return np.where(span > 0.0, (angle[high] - angle[low]) / np.where(span > 0.0, span, 1.0), 0.0)


def _since(time_s: Floats, *, moving: Flags) -> Floats:
    last = np.maximum.accumulate(np.where(moving, time_s, -np.inf))
    return np.where(np.isfinite(last), time_s - last, time_s - time_s[0])


def _last_sign(rate: Floats) -> Floats:
    index = np.where(np.abs(rate) > REST_SPEED_DEG_S, np.arange(len(rate)), 0)
    return np.sign(rate[np.maximum.accumulate(index)])
