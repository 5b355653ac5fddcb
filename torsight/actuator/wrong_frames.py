"""Readings of the angle that belong to no motion: a marker was taken for another one, or a hand passed."""

from __future__ import annotations

from typing import Final

import numpy as np

from torsight.core.series import APART, scatter
from torsight.core.series.outliers import outliers
from torsight.core.units import Flags, Floats

_LEAST_RAD: Final = 1e-5
"""Least scatter of an angle: differences below this value are rounding errors."""


def wrong_frames(time_s: Floats, angle_rad: Floats, sigma_rad: Floats) -> Flags:
    """Return the mask (n,) of rows whose angle is an outlier among its neighbours: a wrong frame, not a motion.

    An outlier is further off its neighbours' line than ``APART`` times the row's own sigma and the angle's scatter.
    """
    known = angle_rad[np.isfinite(angle_rad)]
    return outliers(time_s, angle_rad, APART * np.fmax(sigma_rad, max(scatter(known), _LEAST_RAD)))
