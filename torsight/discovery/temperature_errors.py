"""Errors of the conditioned temperatures, drawn so that they can be driven through the model.

Most of the time the conditioning knows a temperature far better than one sample does. At the top of a half-cycle it
does not: a ramp ends there between two samples, and behind a late sensor its end is rounded off. Where the change is
incomplete, that error decides how far the spring has changed, and it stays in the angle until the next heating.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from torsight.actuator.drive import Drive

Array = NDArray[np.float64]

_ALIKE_S: Final = 3.0
_NOISE_SHARE: Final = 0.5
"""How well a top is known, in standard deviations of one sample ..."""
_SAMPLE_SHARE: Final = 0.5
_LATE_SHARE: Final = 0.03
"""... and in time: shares of the sampling interval and of the sensor's lag, times the ramp's slope."""
_TOP_C: Final = 1.0
_RAMP_C: Final = (5.0, 0.3)


@dataclass(frozen=True, slots=True, eq=False)
class TemperatureErrors:
    """One draw for both springs.

    Attributes
    ----------
    smooth_c : two (n,) float64
        What the conditioning leaves, alike over a few seconds.
    tops : two (n,) float64
        A bump of random height at the top of every half-cycle; one standard deviation is 1.
    noise_c : float
        Standard deviation of a top by the noise alone, °C.
    slope_c_s : two (n,) float64
        Slope of the ramp that leads to each half-cycle's top, °C/s.
    interval_s : float
        Sampling interval.
    """

    smooth_c: tuple[Array, Array]
    tops: tuple[Array, Array]
    noise_c: float
    slope_c_s: tuple[Array, Array]
    interval_s: float

    def with_tops(self, late_s: float) -> tuple[Array, Array]:
        """Return the errors with those of the tops behind a sensor of this lag, °C."""
        time_s = _SAMPLE_SHARE * self.interval_s + _LATE_SHARE * late_s
        a, b = (
            smooth + top * np.hypot(self.noise_c, slope * time_s)
            for smooth, top, slope in zip(self.smooth_c, self.tops, self.slope_c_s, strict=True)
        )
        return a, b


def draw_errors(drive: Drive, rng: np.random.Generator) -> TemperatureErrors:
    """Draw errors of the sizes that a drive's conditioning tells."""
    interval_s = float(np.median(np.diff(drive.time_s)))
    smooth, tops, slopes = [], [], []
    for spring, temp_c in enumerate((drive.temp_a_c, drive.temp_b_c)):
        alike = gaussian_filter1d(rng.standard_normal(len(drive)), _ALIKE_S / interval_s, mode="nearest")
        smooth.append(drive.temp_sigma_c * alike / max(float(np.std(alike)), 1e-12))
        bump, slope = np.zeros(len(drive)), np.zeros(len(drive))
        for label in np.unique(drive.cycles.half[drive.cycles.active == spring]):
            rows = drive.cycles.half == label
            top_c = float(np.max(temp_c[rows]))
            bump[rows] = rng.standard_normal() * np.exp(-(top_c - temp_c[rows]) / _TOP_C)
            slope[rows] = _ramp(drive.time_s[rows], temp_c[rows], top_c)
        tops.append(bump)
        slopes.append(slope)
    return TemperatureErrors(
        smooth_c=(smooth[0], smooth[1]),
        tops=(tops[0], tops[1]),
        noise_c=_NOISE_SHARE * drive.noise_c,
        slope_c_s=(slopes[0], slopes[1]),
        interval_s=interval_s,
    )


def with_errors(drive: Drive, added_c: tuple[Array, Array]) -> Drive:
    """Return the drive with errors on its temperatures and on their slopes."""
    slopes = [np.gradient(error, drive.time_s) for error in added_c]
    return replace(
        drive,
        temp_a_c=drive.temp_a_c + added_c[0],
        temp_b_c=drive.temp_b_c + added_c[1],
        rate_a_c_s=drive.rate_a_c_s + slopes[0],
        rate_b_c_s=drive.rate_b_c_s + slopes[1],
    )


def _ramp(time_s: Array, temp_c: Array, top_c: float) -> float:
    """Return the slope with which a half-cycle comes to its top, °C/s."""
    low, high = (int(np.argmax(temp_c >= top_c - below_c)) for below_c in _RAMP_C)
    return float((temp_c[high] - temp_c[low]) / max(time_s[high] - time_s[low], 1e-9)) if high > low else 0.0
