"""What a row of a record is worth to a fit.

The reading noise of the angle is independent from row to row. Other errors are not: what noise is left in the
temperature lasts for seconds and, once it has driven the one-way transformation, for the whole rest that follows; and
whatever the model lacks is alike over many rows. So every row gets the variance that independent rows would have to
have for sums over many of them to be as uncertain as they are: the reading's, and every other error's times the number
of rows over which it lasts. What the temperature's noise does to the angle is seen by driving the model with
temperatures that are off by it. What is left in the residual beyond that shows as its variance and correlation time.
"""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from torsight.actuator.drive import Drive
from torsight.core.series import scatter
from torsight.core.units import DEG

Array = NDArray[np.float64]

LEVEL_SIGMA_RAD: Final = 0.05 * DEG
"""No level at rest is known better than this: friction gives way before it slides, masses overshoot, sticks settle."""
_RUN_ON: Final = 0.05
"""Share of a jump by which a mass that is let go may run on. A spring that cooled above its loading curve gives way
when the other one's heating starts; the model stops where the torques meet, and the half-cycle goes on from there."""
_DRAWS: Final = 16
_ALIKE_S: Final = 2.5
_LASTS_S: Final = 2.0 * math.sqrt(math.pi) * _ALIKE_S
_STEADY_C: Final = 1e-3
_SPIKE: Final = 8.0


def noisy_drives(drive: Drive) -> tuple[Drive, ...]:
    """Return drives whose temperatures are off by errors like those that conditioning left; none where it left none."""
    from scipy.ndimage import gaussian_filter1d

    if float(np.max(drive.temp_sigma_c)) < _STEADY_C:
        return ()
    rng = np.random.default_rng(0)
    width = _ALIKE_S / float(np.median(np.diff(drive.time_s)))
    made = []
    for _ in range(_DRAWS):
        smooth = gaussian_filter1d(rng.standard_normal((2, len(drive))), width, axis=1, mode="nearest")
        # A filter over this width leaves white noise with this standard deviation.
        unit = smooth * math.sqrt(2.0 * math.sqrt(math.pi) * width)
        error = drive.understated * drive.temp_sigma_c * unit
        made.append(replace(drive, temp_a_c=drive.temp_a_c + error[0], temp_b_c=drive.temp_b_c + error[1]))
    return tuple(made)


def row_sigma(drive: Drive, angle_rad: Array, off_rad: Array) -> Array:
    """Return the standard deviation that every row has if all count as independent, rad.

    Parameters
    ----------
    drive : Drive
        The record.
    angle_rad : (n,) float64
        The modelled angle: where it stands still an error lasts as long as it does.
    off_rad : (k, n) float64
        What errors of the temperature do to the modelled angle; k may be 0.
    """
    from scipy.ndimage import maximum_filter1d

    interval_s = float(np.median(np.diff(drive.time_s)))
    lasts = np.full(len(drive), max(1.0, _LASTS_S / interval_s))
    still = np.concatenate([[True], np.abs(np.diff(angle_rad)) < 1e-9])
    edges = np.flatnonzero(np.diff(still.astype(np.int8))) + 1
    level = np.zeros(len(drive))
    for first, last in pairwise([0, *edges.tolist(), len(drive)]):
        if still[first]:
            lasts[first:last] = np.maximum(lasts[first:last], last - first)
            level[first:last] = LEVEL_SIGMA_RAD**2 * lasts[first:last]
    driven = np.mean(off_rad**2, axis=0) if len(off_rad) else np.zeros(len(drive))
    # A motion that starts a little earlier or later is off by as much as the rows beside its start and its end are.
    beside = maximum_filter1d(driven, 1 + 2 * round(_ALIKE_S / interval_s), mode="nearest")
    driven = np.where(still, driven, beside)
    for first, last in _half_cycles(drive):
        jump_rad = abs(float(angle_rad[first] - angle_rad[first - 1])) if first else 0.0
        level[first:last] += (_RUN_ON * jump_rad) ** 2 * (last - first)
    reading = np.where(np.isfinite(drive.angle_sigma_rad), drive.angle_sigma_rad, 0.0)
    reading = np.maximum(reading, reading_floor(drive))
    return np.asarray(np.sqrt(reading**2 + driven * lasts + level))


def _half_cycles(drive: Drive) -> list[tuple[int, int]]:
    """Return the first row of every half-cycle and the one after its last."""
    starts = np.flatnonzero(np.diff(drive.cycles.half)) + 1
    return list(pairwise([0, *starts.tolist(), len(drive)]))


def reading_floor(drive: Drive) -> float:
    """Return the least standard deviation that the angle's own scatter allows to believe, rad."""
    angle = drive.angle_rad[np.isfinite(drive.angle_rad)]
    if len(angle) < 8:
        return 1e-4
    return max(0.7 * scatter(angle), 1e-5)


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
