"""Errors of the conditioned temperatures, drawn so that they can be driven through the model.

Where the transformation is incomplete, the error of a half-cycle's highest temperature (its top) determines how far the
spring has transformed, and this error stays in the angle until the next heating. The smoother gives a top's standard
deviation: larger at the end of a ramp than where the temperature is held. Errors of level and slope are independent: a
temperature that looks level over the last seconds may still rise within its noise. On clean records the errors of tops
have a mean square of 0.7 in units of the resulting standard deviation (benchmarks/discovery/tops.py).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
from scipy.ndimage import gaussian_filter1d

from torsight.actuator.drive import Drive
from torsight.actuator.record.holds import LEAST_HOLD_S
from torsight.actuator.record.log_noise import NEGLIGIBLE_C
from torsight.actuator.record.ripple import UNSURE
from torsight.actuator.record.sensors import Added, Pair
from torsight.core.series import rms, usual_step
from torsight.core.units import Floats, Ints

_TOP_C: Final = 1.0
"""Distance below a top over which its error decreases by e. The resulting errors of the angle change by 2 % with half
and twice this value (benchmarks/discovery/tops.py, --constants)."""
_DRAWS: Final = 6
"""Number of draws: they give a sample's standard deviation to three parts in ten (1/√12), and its mean over a record to
a few hundredths (benchmarks/discovery/tops.py, --constants)."""


class TemperatureErrors(NamedTuple):
    """One draw: errors that remain after the conditioning, correlated over a few seconds, and persistent errors.

    Persistent errors are those of every half-cycle's top and of the height of a ripple's peaks.
    """

    smooth: Added
    lasting: Added


def draw_errors(drive: Drive, *, seed: int) -> list[TemperatureErrors]:
    """Return draws of errors with the standard deviations of a drive's conditioning."""
    rng, tops, rows = np.random.default_rng(seed), list(_tops(drive)), _rows_of_tops(drive)
    return [TemperatureErrors(_smooth(drive, rng), Added(_lasting(drive, tops, rng), *rows)) for _ in range(_DRAWS)]


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


def _lasting(drive: Drive, tops: Sequence[tuple[int, Floats]], rng: np.random.Generator) -> Pair:
    height = UNSURE * rng.standard_normal()
    lasting = height * np.array([drive.peaks_a_c, drive.peaks_b_c])
    for spring, error_c in tops:
        lasting[spring] += rng.standard_normal() * error_c
    return lasting[0], lasting[1]


def lasting_errors(drive: Drive) -> list[Added]:
    """Return one standard deviation of every persistent error, for both springs."""
    none, rows = np.zeros(len(drive)), _rows_of_tops(drive)
    tops = [(error_c, none) if spring == 0 else (none, error_c) for spring, error_c in _tops(drive)]
    peaks_c = (drive.peaks_a_c, drive.peaks_b_c)
    ripple = [(UNSURE * peaks_c[0], UNSURE * peaks_c[1])] if any(one.any() for one in peaks_c) else []
    return [Added(error_c, *rows) for error_c in (*tops, *ripple)]


def _rows_of_tops(drive: Drive) -> tuple[Ints, Ints]:
    """Return the rows (k,) in which the half-cycles begin, and those of their tops."""
    found = [(int(rows[0]), turn) for rows, _, turn in _heatings(drive)]
    begins, tops = np.array(found, np.int64).reshape(-1, 2).T
    return begins, tops


def _heatings(drive: Drive) -> Iterator[tuple[Ints, int, int]]:
    """Yield every half-cycle's rows (k,), its driven spring, and the last row of that spring's highest temperature."""
    for label in np.unique(drive.cycles.half):
        rows = np.flatnonzero(drive.cycles.half == label)
        spring = int(drive.cycles.active[rows[0]])
        driven_c = (drive.temp_a_c, drive.temp_b_c)[spring][rows]
        yield rows, spring, int(rows[len(rows) - 1 - int(np.argmax(driven_c[::-1]))])


def _tops(drive: Drive) -> Iterator[tuple[int, Floats]]:
    """Yield the driven spring of every half-cycle, and one standard deviation of its top's level and of its last rise.

    Each is an error (n,) in °C of that spring's temperature.
    """
    for rows, spring, turn in _heatings(drive):
        driven_c, time_s = (drive.temp_a_c, drive.temp_b_c)[spring], drive.time_s
        level, rise = np.zeros(len(drive)), np.zeros(len(drive))
        level[rows] = drive.temp_sigma_c[turn] * np.exp(-(driven_c[turn] - driven_c[rows]) / _TOP_C)
        # Over the shortest hold the rise is as uncertain as the level: 0.4 of one sample's noise at four rows a second
        # (from the slope of 17 samples, at their end).
        rise[rows] = level[rows] * np.clip((time_s[rows] - time_s[turn]) / LEAST_HOLD_S + 1.0, 0.0, 1.0)
        yield spring, level
        yield spring, rise


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
