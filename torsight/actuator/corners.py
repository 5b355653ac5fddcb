"""Corners of a noisy temperature, found to a fraction of a sample.

A local window of one side that reaches past a corner by a sample or two carries the slope on: an overshoot of a few
hundredths of a degree, which a one-way transformation would keep. So around every change of slope both sides are fitted
at once: a parabola, and from the corner's time on a further parabola, that starts there with a new slope. A slow
sensor rounds corners: the change is then the response of a first-order lag to such a bend, with its time constant among
those that are tried, and what is left of the corner before decays with the same constant.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_SURE: Final = 7.0
"""A change of slope is looked at when it exceeds this many of its sigmas."""
_ROUNDED: Final = 9.0
"""A rounded corner is believed when it lowers the sum of squares by this many variances."""
_HALF_WINDOWS: Final = (160, 100, 60, 36, 22)
_LAGS: Final = (2.0, 5.0, 10.0, 18.0, 30.0, 50.0)


@dataclass(frozen=True, slots=True, eq=False)
class _Bend:
    """A fit around one corner: its place, lag (samples), coefficients and sum of squares."""

    at: float
    lag: float
    coefficients: Array
    error: float


def mend_corners(
    time: Array,
    temp_c: Array,
    sides: Array,
    *,
    sigma_c: float,
    smallest: int,
    value: Array,
    rate: Array,
    left_over: Array,
) -> None:
    """Replace value, slope (per sample) and sigma around every corner by a fit of both its sides, in place.

    Parameters
    ----------
    time : (n,) float64
        Times in units of the sample interval.
    temp_c : (n,) float64
        As measured.
    sides : (2, 3, n) float64
        For the window before and after each sample: slope, its variance, the window's length.
    sigma_c : float
        Noise.
    smallest : int
        Length of the smallest window.
    value, rate, left_over : (n,) float64
        What to mend.
    """
    corners = _candidates(sides, smallest)
    for number, corner in enumerate(corners):
        first = corners[number - 1] + smallest if number else 0
        last = corners[number + 1] - smallest if number + 1 < len(corners) else len(temp_c) - 1
        for half_window in _HALF_WINDOWS:
            rows = np.arange(max(first, corner - half_window), min(last, corner + half_window) + 1)
            before, after = corner - rows[0], rows[-1] - corner
            if min(before, after) < 2 * smallest:
                continue
            bend = _fit(time[rows] - time[corner], temp_c[rows] - temp_c[corner], sigma_c)
            if bend.error <= sigma_c**2 * (len(rows) + 3.0 * np.sqrt(2.0 * len(rows))):
                _write(bend, rows, corner, time, temp_c, sigma_c, (value, rate, left_over))
                break


def _candidates(sides: Array, smallest: int) -> list[int]:
    """Return the samples at which the slopes before and after differ for certain."""
    jump = np.abs(sides[1, 0] - sides[0, 0]) / np.sqrt(sides[0, 1] + sides[1, 1])
    reach = 3 * smallest
    found: list[int] = []
    for k in np.flatnonzero(jump > _SURE):
        near = jump[max(0, k - reach) : k + reach + 1]
        if jump[k] >= near.max() and (not found or k - found[-1] > reach):
            found.append(int(k))
    return found


def _basis(t: Array, at: float, lag: float) -> tuple[Array, Array]:
    """Return the functions of a bend at ``at`` and their slopes, each (len(t), 5 or 6)."""
    u = np.maximum(t - at, 0.0)
    one, line = np.ones_like(t), t - at
    if lag == 0.0:
        shape = [one, line, line**2, u, u**2]
        slope = [0.0 * one, one, 2.0 * line, np.where(t > at, 1.0, 0.0), 2.0 * u]
    else:
        gone = np.exp(-u / lag)
        past = np.exp(-(t - t[0]) / lag)
        response = u - lag * (1.0 - gone)
        shape = [one, line, line**2, response, u**2 - 2.0 * lag * response, past]
        slope = [0.0 * one, one, 2.0 * line, 1.0 - gone, 2.0 * response, -past / lag]
    return np.stack(shape, axis=1), np.stack(slope, axis=1)


def _solve(t: Array, y: Array, at: float, lag: float) -> _Bend:
    shape, _ = _basis(t, at, lag)
    scale = np.linalg.norm(shape, axis=0) + 1e-300
    normal = (shape / scale).T @ (shape / scale)
    normal[np.diag_indices_from(normal)] += 1e-10
    coefficients = np.linalg.solve(normal, (shape / scale).T @ y) / scale
    return _Bend(at, lag, coefficients, float(np.sum((shape @ coefficients - y) ** 2)))


def _fit(t: Array, y: Array, sigma_c: float) -> _Bend:
    """Return the best sharp corner, or a rounded one where that is clearly better."""
    sharp = _best_place(t, y, 0.0, np.linspace(-4.0, 4.0, 17), 0.5)
    rounded = min(
        (_best_place(t, y, lag, np.linspace(-2.0 * lag - 2.0, 2.0, 9), 0.25 * lag) for lag in _LAGS),
        key=lambda bend: bend.error,
    )
    return rounded if rounded.error < sharp.error - _ROUNDED * sigma_c**2 else sharp


def _best_place(t: Array, y: Array, lag: float, places: Array, step: float) -> _Bend:
    places = np.clip(places, t[0] + 3.0, t[-1] - 3.0)
    best = min((_solve(t, y, float(at), lag) for at in places), key=lambda bend: bend.error)
    for share in (0.5, 0.25, 0.125):
        near = [
            _solve(t, y, float(np.clip(best.at + sign * share * step, t[0] + 3.0, t[-1] - 3.0)), lag)
            for sign in (-1, 1)
        ]
        best = min([best, *near], key=lambda bend: bend.error)
    return best


def _write(
    bend: _Bend,
    rows: NDArray[np.int64],
    corner: int,
    time: Array,
    temp_c: Array,
    sigma_c: float,
    out: tuple[Array, Array, Array],
) -> None:
    t = time[rows] - time[corner]
    shape, slope = _basis(t, bend.at, bend.lag)
    covariance = np.linalg.pinv(shape.T @ shape, rcond=1e-10)
    spread = np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", shape, covariance, shape), 0.0))
    # The fit's ends lean on one side only: the local windows there are better.
    reach = (t >= bend.at - max(6.0, 0.5 * (bend.at - t[0]))) & (t <= bend.at + max(6.0, 0.6 * (t[-1] - bend.at)))
    inner = rows[reach]
    out[0][inner] = temp_c[corner] + (shape @ bend.coefficients)[reach]
    out[1][inner] = (slope @ bend.coefficients)[reach]
    out[2][inner] = sigma_c * spread[reach]
