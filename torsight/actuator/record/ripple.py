r"""Ripple of a wire's temperature that its log is too slow to show: pulses of the heater.

A transformation that only advances follows the peaks of a ripple, and what takes the noise out of a log takes the
ripple out with it. Noise is the same all along a log; what the readings scatter by beyond it over some seconds is a
ripple. Of a sine of the standard deviation s the peaks stand :math:`\sqrt 2 s` above the mean, of a triangle
:math:`\sqrt 3 s`. How sharp they are is not known, and a heater's current may as well disturb the sensor alone: one
standard deviation of the peaks' height is half of it.
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
"""Over so many seconds a scatter is measured: 32 readings of a log of four a second, which tell it to an eighth. Later
records of rigs with pulsed heaters are predicted as well, to 3 %, with half or twice of it
(benchmarks/actuator/pulsed_heaters.py)."""
UNSURE: Final = 0.5
"""One standard deviation of the height, as a share of it: from a disturbed sensor (0) to peaks that are sharper."""
_SHARPEST: Final = 2.0
"""No peak is higher than so many medians of what a ripple is off by: √2 for a sine, 2 for a triangle."""


_NEW: Final = 2.0 / 3.0
"""Share of the readings that differ from the one before: half of those that are held for two rows or more, and nearly
all of a ripple's that is larger than the last digit."""


def ripple_peaks(time_s: Floats, temp_c: Floats, found_c: Floats, noise_c: float, alike: float) -> Floats:
    """Return by how much the wire's peaks stand above its mean temperature (n,), °C.

    Parameters
    ----------
    time_s : (n,) float64
        Increasing.
    temp_c, found_c : (n,) float64
        Readings, and the temperature that was found in them.
    noise_c : float
        Standard deviation of the readings' noise, last digit included.
    alike : float
        Over how many rows that is correlated.
    """
    left_c = temp_c - found_c
    rows = min(len(left_c), max(1, round(OVER_S / usual_step(time_s))))
    first = rows // 2
    inside = np.clip(np.arange(len(left_c)), first, first + len(left_c) - rows)
    # A corner of the temperature is a few values far off: no more than noise or the sharpest peak is.
    usual = median_filter(np.abs(left_c), rows)[inside]
    most_c = np.maximum(REACH * noise_c, _SHARPEST * usual)
    square = uniform_filter1d(np.minimum(np.abs(left_c), most_c) ** 2, rows)[inside]
    # Readings that are held for several rows are stairs, which stand off a ramp as a ripple would.
    new = uniform_filter1d((np.diff(temp_c, prepend=np.nan) != 0.0).astype(np.float64), rows)[inside]
    square[new < _NEW] = 0.0
    by_noise = noise_c**2 * (1.0 + BY_CHANCE * math.sqrt(2.0 * alike / rows))
    # A heating that ends has its ripple up to the end: of the stretches that hold a reading the most restless counts.
    beyond = maximum_filter1d(np.maximum(square - by_noise, 0.0), rows, mode="nearest")
    return np.asarray(np.sqrt(2.0 * beyond))
