"""Evenly sampled, smoothed signals of a record: value and slope on a regular grid, with a mask of known points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.ndimage import binary_erosion

from torsight.core.series import usual_step
from torsight.core.units import Flags, Floats

WINDOW_S: Final = 2.0
"""Time over which a log is smoothed: eight rows at 4 Hz. Half and twice this value move a clock by 0.24 of its standard
deviations at most (benchmarks/sync/constants.py)."""
_FINEST_STEP_S: Final = WINDOW_S / 40
"""Finest step of the grid: smoothing removes all finer details."""


@dataclass(frozen=True, slots=True, eq=False)
class EvenSignal:
    """A signal on an even grid, smoothed (n,), with its rate per second, and one standard deviation of each.

    ``known`` is false inside gaps that are too long to bridge. ``noise`` is that of one raw sample, ``point_sigma``
    that of one point of the grid before smoothing.
    """

    start_s: float
    step_s: float
    value: Floats
    slope: Floats
    value_sigma: float
    slope_sigma: float
    known: Flags
    noise: float
    point_sigma: float

    @property
    def time_s(self) -> Floats:
        """Times of the points."""
        return self.start_s + self.step_s * np.arange(len(self.value), dtype=np.float64)

    def at(self, time_s: Floats) -> tuple[Floats, Floats, Flags]:
        """Return value and slope at given times, and the mask of the times at which they are known."""
        place = (time_s - self.start_s) / self.step_s
        left = np.clip(np.floor(np.nan_to_num(place)).astype(np.int64), 0, len(self.value) - 2)
        part = place - left
        inside = (place >= 0) & (place <= len(self.value) - 1)
        known = inside & self.known[left] & self.known[left + 1]
        value = self.value[left] + part * (self.value[left + 1] - self.value[left])
        slope = self.slope[left] + part * (self.slope[left + 1] - self.slope[left])
        return value, slope, known


def even_signal(time_s: Floats, value: Floats, *, noise: float, window_s: float, max_gap_s: float) -> EvenSignal | None:
    """Return samples of a given ``noise`` averaged onto an even grid and smoothed by a local parabola.

    Both steps are symmetric in time, so that they cause no shift. None where fewer than a dozen samples are known.
    """
    known = np.isfinite(value) & np.isfinite(time_s)
    at_s, there = time_s[known], value[known]
    if len(at_s) < 12:
        return None
    usual_s = usual_step(at_s)
    step_s = max(_FINEST_STEP_S, usual_s)
    count = int((at_s[-1] - at_s[0]) / step_s) + 1
    grid_s = at_s[0] + step_s * np.arange(count)
    filled = np.interp(grid_s, at_s, there)
    per_point = 1
    # From this ratio on there are, rounded, two samples or more per point.
    if step_s > 1.5 * usual_s:
        per_point = max(1, round(step_s / usual_s))
        filled = _binned(at_s, there, grid_s, step_s, filled)
    right = np.clip(np.searchsorted(at_s, grid_s), 1, len(at_s) - 1)
    bridged = at_s[right] - at_s[right - 1] <= max_gap_s
    # An odd number, no larger than that of the grid's points.
    points = min(2 * max(2, round(window_s / step_s / 2.0)) + 1, count - 1 + count % 2)
    smooth, value_spread = _local_parabola(filled, points, slope=False)
    slope, slope_spread = _local_parabola(filled, points, slope=True)
    scale = noise / np.sqrt(per_point)
    return EvenSignal(
        start_s=float(at_s[0]),
        step_s=step_s,
        value=smooth,
        slope=slope / step_s,
        value_sigma=scale * value_spread,
        slope_sigma=scale * slope_spread / step_s,
        # Beside a gap the smoothing window extends into the gap.
        known=np.asarray(binary_erosion(bridged, np.ones(3, np.bool_), border_value=1)),
        noise=noise,
        point_sigma=scale,
    )


def _local_parabola(values: Floats, points: int, *, slope: bool) -> tuple[Floats, float]:
    """Return value or slope per point of the least-squares parabola through each point's neighbours, and its spread.

    ``points`` is the odd number of neighbours; at the ends the parabola of the first or last window is used. The spread
    is the standard deviation of the result for values of standard deviation one.
    """
    # Imported here: nearly every command imports this module, and scipy.signal takes half a second.
    from scipy.signal import savgol_coeffs, savgol_filter

    found = savgol_filter(values, points, 2, deriv=int(slope))
    return found, float(np.linalg.norm(savgol_coeffs(points, 2, deriv=int(slope))))


def _binned(at_s: Floats, there: Floats, grid_s: Floats, step_s: float, filled: Floats) -> Floats:
    """Return the means of the samples around each grid point; a straight line is reproduced."""
    index = np.rint((at_s - grid_s[0]) / step_s).astype(np.int64)
    inside = (index >= 0) & (index < len(grid_s))
    count = np.bincount(index[inside], minlength=len(grid_s))
    mean = np.bincount(index[inside], weights=there[inside], minlength=len(grid_s)) / np.maximum(count, 1)
    mean_s = np.bincount(index[inside], weights=at_s[inside], minlength=len(grid_s)) / np.maximum(count, 1)
    # The mean of samples that are uneven in their bin is shifted along the local slope to the bin's middle.
    local = np.gradient(filled, step_s)
    return np.where(count > 0, mean + local * (grid_s - mean_s), filled)
