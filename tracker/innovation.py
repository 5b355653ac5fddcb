"""The one test by which what was found is held against what was predicted: χ² of the innovation (compiled).

An innovation is a vector of differences between found and predicted, each over its standard deviation. It passes where
its χ² is one that three standard deviations of a normal variable allow (Bar-Shalom, Li & Kirubarajan, Estimation with
Applications to Tracking and Navigation, 2001, section 5.4).
"""

from __future__ import annotations

import math
from typing import Final

from torsight.core.compiled import shared

SIGMAS: Final = 3.0
"""Standard deviations of a normal variable that are allowed: 99.73 % of what is right passes."""
SURE: Final = math.erf(SIGMAS / math.sqrt(2.0))
"""The probability of that: what is as probable is settled."""
LIMITS: Final = (9.0, 11.83, 14.16, 16.25, 18.21, 20.06, 21.85)
"""Quantiles of χ² with one to seven degrees of freedom for the same probability."""


@shared
def passes(chi_squared: float, freedom: int) -> bool:
    """Return whether what was found is what was predicted; False for what is not finite."""
    return bool(chi_squared <= LIMITS[freedom - 1])
