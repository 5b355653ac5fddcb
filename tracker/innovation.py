"""The single test of measurements against predictions: χ² of the innovation (compiled).

An innovation is a vector of differences between measured and predicted values, each over its standard deviation. It
passes where its χ² is below the quantile that corresponds to three standard deviations of a normal variable
(Bar-Shalom, Li & Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001, section 5.4).
"""

from __future__ import annotations

import math
from typing import Final

from torsight.core.compiled import shared

SIGMAS: Final = 3.0
"""Allowed standard deviations of a normal variable: 99.73 % of correct measurements pass."""
SURE: Final = math.erf(SIGMAS / math.sqrt(2.0))
"""The probability of that: a hypothesis that is as probable counts as certain."""
LIMITS: Final = (9.0, 11.83, 14.16, 16.25, 18.21, 20.06, 21.85)
"""Quantiles of χ² with one to seven degrees of freedom for the same probability."""


@shared
def passes(chi_squared: float, freedom: int) -> bool:
    """Return whether an innovation passes the test; False where χ² is NaN."""
    return bool(chi_squared <= LIMITS[freedom - 1])
