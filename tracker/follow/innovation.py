"""The one test by which what was found is held against what was predicted: χ² of the innovation (compiled).

An innovation is a vector of differences between found and predicted, each over its standard deviation. It passes where
its χ² is one that three standard deviations of a normal variable allow: 99.73 % (Bar-Shalom, Li & Kirubarajan,
Estimation with Applications to Tracking and Navigation, 2001, section 5.4).
"""

from __future__ import annotations

from typing import Final

from torsight.core.compiled import lending

_LIMITS: Final = (9.0, 11.83, 14.16, 16.25, 18.21, 20.06, 21.85)
"""99.73 % quantiles of χ² with one to seven degrees of freedom."""


@lending
def passes(chi_squared: float, freedom: int) -> bool:
    """Return whether what was found is what was predicted; False for what is not finite."""
    return bool(chi_squared <= _LIMITS[freedom - 1])
