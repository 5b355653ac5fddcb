"""What a row of a record is worth to a fit.

The reading noise of the angle is independent from row to row. Two more errors are not: what noise is left in the
temperature moves the angle by the slope dφ/dT, and whatever the model lacks is alike over many rows. Both show in the
residual's correlation time: n rows with that time τ hold n/τ pieces of information, and intervals and the balance
between record and priors follow from these, not from n.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from torsight.actuator.drive import Drive
from torsight.core.units import DEG

Array = NDArray[np.float64]

_STEEPEST: Final = 60.0 * DEG
_SPIKE: Final = 8.0


def row_sigma(drive: Drive, angle_rad: Array) -> Array:
    """Return each row's standard deviation, rad: reading noise and what is left of the temperature's.

    ``angle_rad`` is the modelled angle, for the slope dφ/dT.
    """
    temp = np.where(drive.cycles.active == 0, drive.temp_a_c, drive.temp_b_c)
    rise = np.gradient(temp)
    slope = np.abs(np.gradient(angle_rad)) / np.maximum(np.abs(rise), 1e-4)
    left = np.minimum(slope, _STEEPEST) * drive.temp_sigma_c
    reading = np.where(np.isfinite(drive.angle_sigma_rad), drive.angle_sigma_rad, 0.0)
    return np.asarray(np.hypot(np.maximum(reading, reading_floor(drive)), left))


def reading_floor(drive: Drive) -> float:
    """Return the least standard deviation that the angle's own scatter allows to believe, rad."""
    angle = drive.angle_rad[np.isfinite(drive.angle_rad)]
    if len(angle) < 8:
        return 1e-4
    scatter = float(np.median(np.abs(np.diff(angle, 3)))) / 0.6745 / math.sqrt(20.0)
    return float(max(0.7 * scatter, 1e-5))


def spikes(drive: Drive) -> NDArray[np.bool_]:
    """Return the rows whose angle stands apart from its neighbours: a wrong frame, not a motion."""
    good = np.flatnonzero(np.isfinite(drive.angle_rad))
    out = np.zeros(len(drive), np.bool_)
    if len(good) < 9:
        return out
    angle = drive.angle_rad[good]
    windows = np.lib.stride_tricks.sliding_window_view(np.pad(angle, 3, mode="edge"), 7)
    middle = np.median(windows, axis=1)
    spread = np.median(np.abs(windows - middle[:, None]), axis=1)
    limit = _SPIKE * np.maximum(np.maximum(spread, drive.angle_sigma_rad[good]), reading_floor(drive))
    out[good] = np.abs(angle - middle) > np.where(np.isfinite(limit), limit, np.inf)
    return out


def correlation_rows(residual: Array) -> float:
    """Return the integrated correlation time of a whitened residual, in rows (1: independent).

    The sum of the correlation function is cut where five times the time found so far is passed (Sokal's window).
    """
    n = len(residual)
    if n < 8:
        return 1.0
    padded = np.fft.rfft(residual, 2 * n)
    covariance = np.fft.irfft(np.abs(padded) ** 2)[:n]
    if covariance[0] <= 0.0:
        return 1.0
    times = 2.0 * np.cumsum(covariance / covariance[0]) - 1.0
    inside = np.flatnonzero(np.arange(n) >= 5.0 * times)
    at = int(inside[0]) if len(inside) else n - 1
    return float(max(1.0, min(times[at], n / 4.0)))
