r"""Ripple of a wire's temperature that its log is too slow to show: pulses of the heater.

A transformation that only advances follows the peaks of a ripple, but the smoother removes the ripple together with the
noise. Noise has the same variance throughout a log; an excess scatter of the readings over some seconds is a ripple.
The peaks of a sine with standard deviation s are :math:`\sqrt 2 s` above the mean, those of a triangle
:math:`\sqrt 3 s`. The shape of the peaks is not known, and a heater's current may also disturb the sensor alone: the
standard deviation of the peaks' height is half of the height.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from scipy.ndimage import maximum_filter1d, median_filter, uniform_filter1d

from torsight.core.parameter import REACH
from torsight.core.series import BY_CHANCE, usual_step
from torsight.core.units import Floats

OVER_S: Final = 8.0
"""Window over which the scatter is measured: 32 readings of a log with four a second, which determine it to an eighth.
Predictions of later records of rigs with pulsed heaters are as good, to 3 %, with half or twice this value
(benchmarks/actuator/pulsed_heaters.py)."""
UNSURE: Final = 0.5
"""Relative standard deviation of the height: it covers a disturbed sensor (no ripple) as well as sharper peaks."""


def ripple_peaks(time_s: Floats, temp_c: Floats, found_c: Floats, noise_c: float, alike: float) -> Floats:
    """Return the height (n,) of the wire's peaks above its mean temperature, °C.

    ``temp_c`` (n,) are the readings at times that increase, ``found_c`` (n,) is the smoothed temperature; ``noise_c``
    is the standard deviation of the readings' noise, last digit included, and ``alike`` its correlation length in rows.
    """
    residual_c = temp_c - found_c
    rows = min(len(residual_c), max(1, round(OVER_S / usual_step(time_s))))
    first = rows // 2
    inside = np.clip(np.arange(len(residual_c)), first, first + len(residual_c) - rows)
    # At a corner of the temperature a few residuals are large: limit them to those of noise or of the sharpest peak,
    # whose height in medians of a ripple's absolute deviation is √2 for a sine, 2 for a triangle.
    usual = median_filter(np.abs(residual_c), rows)[inside]
    most_c = np.maximum(REACH * noise_c, 2.0 * usual)
    square = uniform_filter1d(np.minimum(np.abs(residual_c), most_c) ** 2, rows)[inside]
    # Readings that are held for two rows or more form steps, whose residuals on a ramp resemble a ripple: at most every
    # second one differs from the one before. Of a ripple larger than the last digit nearly all do.
    new = uniform_filter1d((np.diff(temp_c, prepend=np.nan) != 0.0).astype(np.float64), rows)[inside]
    square[2.0 * rows * new < rows + 2.0] = 0.0
    by_noise = noise_c**2 * (1.0 + BY_CHANCE * math.sqrt(2.0 * alike / rows))
    # The ripple lasts until the heating ends: of the windows that contain a reading, the one with the largest counts.
    beyond = maximum_filter1d(np.maximum(square - by_noise, 0.0), rows, mode="nearest")
    return np.asarray(np.sqrt(2.0 * beyond))
