"""Detection of single frames with an impossible angle, in which something other than the stick was tracked."""

from __future__ import annotations

from typing import Final

import numpy as np

from torsight.core.series import APART, scatter
from torsight.core.units import Flags, Floats

_LEAST_RAD: Final = 1e-5
"""Least scatter of an angle: differences below this value are rounding errors."""


def wrong_frames(angle_rad: Floats, sigma_rad: Floats) -> Flags:
    """Return the mask (n,) of rows whose angle is an outlier among its neighbours: a wrong frame, not a motion.

    An outlier differs from the median of seven rows by more than ``APART`` times the largest of their median absolute
    deviation, the row's own sigma and the angle's scatter. A step or the start of a motion is no outlier: the median of
    seven rows lies on one of its sides. In seven records of another rig, 163,000 rows, a threshold of four takes 19
    right rows for wrong, eight none; of frames that are 2° to 90° wrong eight finds 97 %, sixteen 95 %.
    """
    good = np.flatnonzero(np.isfinite(angle_rad))
    out = np.zeros(len(angle_rad), np.bool_)
    if len(good) < 9:
        return out
    angle = angle_rad[good]
    windows = np.lib.stride_tricks.sliding_window_view(np.pad(angle, 3, mode="edge"), 7)
    middle = np.median(windows, axis=1)
    spread = np.median(np.abs(windows - middle[:, None]), axis=1)
    floor = max(scatter(angle), _LEAST_RAD)
    limit = APART * np.maximum(np.maximum(spread, sigma_rad[good]), floor)
    out[good] = np.abs(angle - middle) > np.where(np.isfinite(limit), limit, np.inf)
    return out
