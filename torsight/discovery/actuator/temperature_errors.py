"""Errors of the conditioned temperatures, drawn so that they can be driven through the model.

Where the transformation is incomplete, the error of a half-cycle's highest temperature (its top) determines how far the
spring has transformed, and this error stays in the angle until the next heating. The smoother gives a top's standard
deviation: larger at the end of a ramp than where the temperature is held. Errors of level and slope are independent: a
temperature that looks level over the last seconds may still rise within its noise. On clean records the errors of tops
have a mean square of 0.7 in units of the resulting standard deviation (benchmarks/discovery/tops.py).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from typing import Final

import numpy as np
import scipy.linalg
from scipy.ndimage import gaussian_filter1d

from torsight.actuator.drive import Drive
from torsight.actuator.record.holds import LEAST_HOLD_S
from torsight.actuator.record.log_noise import NEGLIGIBLE_C
from torsight.actuator.record.ripple import UNSURE
from torsight.actuator.record.segments import TURN_C
from torsight.actuator.record.sensors import Added
from torsight.core.series import rms, usual_step
from torsight.core.units import Floats, Ints

_DRAWS: Final = 24
"""Number of draws. A row in which a disk may jump counts as noisy only if a draw moves the jump: the log evidence of
six clean records varies with the seed by 3 units (median; 4 at most), with half as many draws by 5 (54)
(benchmarks/discovery/tops.py, --first 6 --draws)."""


def smooth_errors(drive: Drive, *, seed: int) -> list[Added]:
    """Return draws of the errors that remain after the conditioning, which are correlated over a few seconds."""
    rng = np.random.default_rng(seed)
    return [_smooth(drive, rng) for _ in range(_DRAWS)]


def alike_s(drive: Drive) -> Floats:
    """Return the integrated correlation time (n,) of the errors that the conditioning leaves, s.

    A smoother keeps a constant, and so the spectral density of white noise at low frequencies: the errors' variance
    times their correlation time is that of the readings, with the time between independent readings.
    """
    if drive.noise_c <= NEGLIGIBLE_C:
        return np.zeros(len(drive))
    return _alike_s(drive, drive.temp_sigma_c)


def are_negligible(drive: Drive) -> bool:
    """Return whether all are as read: a log without noise may still miss the height of a top between two rows."""
    return bool(np.max(drive.temp_sigma_c, initial=drive.noise_c) <= NEGLIGIBLE_C)


def _alike_s(drive: Drive, sigma_c: Floats | float) -> Floats:
    """Return the correlation time (n,) of errors with the standard deviation ``sigma_c`` (n,), s."""
    left_over = np.maximum(sigma_c / drive.noise_c, 1e-3)
    return np.asarray(drive.reading_s * np.maximum(left_over**-2, 1.0))


def _smooth(drive: Drive, rng: np.random.Generator) -> Added:
    smooth = np.zeros((2, len(drive)))
    if drive.noise_c > NEGLIGIBLE_C:
        # White noise behind a Gaussian filter of width σ has the integrated correlation time 2 √π σ. Here it is the
        # time of all errors together, weighted with their variances.
        filter_s = float(_alike_s(drive, rms(drive.temp_sigma_c))) / (2.0 * math.sqrt(math.pi))
        white = rng.standard_normal((2, len(drive)))
        alike = gaussian_filter1d(white, filter_s / usual_step(drive.time_s), mode="nearest")
        smooth = drive.temp_sigma_c * alike / np.maximum(np.std(alike, axis=1, keepdims=True), 1e-12)
    return Added((smooth[0], smooth[1]))


def lasting_errors(drive: Drive) -> list[Added]:
    """Return one standard deviation of every persistent error, for both springs.

    Persistent errors are those of every half-cycle's top and of the height of a ripple's peaks.
    """
    tops, found = _rows_of_tops(drive), []
    for rows, error_c in _lasting(drive):
        whole_c = np.zeros((2, len(drive)))
        whole_c[:, rows] = error_c
        found.append(Added((whole_c[0], whole_c[1]), *tops))
    return found


def lasting_sums(drive: Drive) -> list[Added]:
    """Return sums of all persistent errors, each error one standard deviation in size.

    The mean square of the angle's changes by the sums is that by independent errors: the signs of an error in the sums
    are a column of Hadamard's matrix, and the products of two errors with different columns cancel. No two of eight
    successive errors, two of each of four half-cycles' tops, share their signs. Among a few draws the size of an error
    would be a matter of chance.
    """
    tops, signs = _rows_of_tops(drive), scipy.linalg.hadamard(8)
    sums = np.zeros((len(signs), 2, len(drive)))
    for number, (rows, error_c) in enumerate(_lasting(drive)):
        sums[:, :, rows] += np.multiply.outer(signs[:, number % len(signs)], error_c)
    return [Added((a_c, b_c), *tops) for a_c, b_c in sums]


def _rows_of_tops(drive: Drive) -> tuple[Ints, Ints]:
    """Return the rows (k,) in which the half-cycles begin, and those of their tops."""
    found = [(rows.start, turn) for rows, _, turn in _heatings(drive)]
    begins, tops = np.array(found, np.int64).reshape(-1, 2).T
    return begins, tops


def _heatings(drive: Drive) -> Iterator[tuple[slice, int, int]]:
    """Yield every half-cycle's rows, its driven spring, and the last row of that spring's highest temperature."""
    half = drive.cycles.half
    edges = [0, *(np.flatnonzero(np.diff(half)) + 1).tolist(), len(half)]
    for begin, end in pairwise(edges):
        spring = int(drive.cycles.active[begin])
        driven_c = (drive.temp_a_c, drive.temp_b_c)[spring][begin:end]
        yield slice(begin, end), spring, end - 1 - int(np.argmax(driven_c[::-1]))


def _lasting(drive: Drive) -> Iterator[tuple[slice, Floats]]:
    """Yield one standard deviation of every persistent error: its rows, and the errors (2, k) of both springs there.

    Of every half-cycle's top these are the errors of its level and of its last rise. The former decreases by e over the
    least reversal below it; with half and twice of that the errors of the angle change by 2 %
    (benchmarks/discovery/tops.py, --constants).
    """
    for rows, spring, turn in _heatings(drive):
        driven_c, time_s = (drive.temp_a_c, drive.temp_b_c)[spring], drive.time_s
        own = np.arange(2)[:, None] == spring
        level_c = own * drive.temp_sigma_c[turn] * np.exp(-(driven_c[turn] - driven_c[rows]) / TURN_C)
        yield rows, level_c
        # Over the shortest hold the rise is as uncertain as the level: 0.4 of one sample's noise at four rows a second
        # (from the slope of 17 samples, at their end).
        yield rows, level_c * np.clip((time_s[rows] - time_s[turn]) / LEAST_HOLD_S + 1.0, 0.0, 1.0)
    peaks_c = np.array([drive.peaks_a_c, drive.peaks_b_c])
    if peaks_c.any():
        yield slice(None), UNSURE * peaks_c


def with_errors(drive: Drive, *added: Added) -> Drive:
    """Return the drive with errors on its temperatures and on their slopes."""
    error_a_c, error_b_c = (sum(errors) for errors in zip(*(one.error_c for one in added), strict=True))
    return replace(
        drive,
        temp_a_c=drive.temp_a_c + error_a_c,
        temp_b_c=drive.temp_b_c + error_b_c,
        rate_a_c_s=drive.rate_a_c_s + np.gradient(error_a_c, drive.time_s),
        rate_b_c_s=drive.rate_b_c_s + np.gradient(error_b_c, drive.time_s),
        sensors=replace(drive.sensors, errors=added),
    )
