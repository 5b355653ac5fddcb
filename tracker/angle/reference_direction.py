"""The base stick's direction: a reference that hardly moves, and so can be averaged, and interpolated over gaps."""

from __future__ import annotations

from typing import Final

import numpy as np

from torsight.core.series import BY_CHANCE, bridged, robust_sigma, runs
from torsight.core.units import Floats

SIDE: Final = 8
"""Frames before and after a step whose means are compared: shaking of 2 px changes such a mean by 0.7 px."""
_LAGS: Final = (1, 2, 5, 10, 25, 50, 100, 200)
"""Lags, in frames, at which drift is estimated: each about twice the previous one, up to half of ``_LONGEST``."""
_LONGEST: Final = 2 * _LAGS[-1]
"""Frames on each side that are averaged at most."""


def steady_direction(angle_rad: Floats, variance_rad2: Floats) -> tuple[Floats, Floats]:
    """Return the base's direction (n,) in every frame and its variance (n,).

    Where the direction, continuous and NaN where not seen, scatters no more than its own noise ``variance_rad2`` (n,),
    it is averaged over as many frames as its drift allows; true shaking is kept. In frames in which the base is not
    seen the mean is interpolated, with a variance by how much the direction changes over such gaps elsewhere; where
    both sides differ by more than noise (the camera was bumped meanwhile) the direction there is NaN.
    """
    known = np.isfinite(angle_rad)
    if not known.any():
        return np.full_like(angle_rad, np.nan), np.full_like(angle_rad, np.nan)
    noise = float(np.median(variance_rad2[known]))
    # Noise that never changes (a codec repeats a still picture) does not average out.
    changing = min(noise, 0.5 * float(np.mean(np.diff(angle_rad[known]) ** 2))) if known.sum() > 1 else noise
    smooth = np.full_like(angle_rad, np.nan)
    variance = np.full_like(angle_rad, np.nan)
    for first, last in _segments(angle_rad, noise - changing + changing / SIDE):
        part = slice(first, last)
        seen = known[part]
        half, drift, shaking, apparent = _character(angle_rad[part][seen], noise)
        away = np.maximum(_bridge_variance(angle_rad[part], noise), shaking)
        mean, count = _running_mean(angle_rad[part], half)
        share = shaking / (shaking + noise)
        kept = np.where(seen, share * (angle_rad[part] - mean), 0.0)
        smooth[part] = mean + np.nan_to_num(kept)
        hidden = max(0.0, noise - apparent)
        averaged = apparent / np.maximum(count, 1.0) * 2.0
        variance[part] = hidden + averaged + drift * half / 6.0 + np.where(seen, share * noise, away)
    return smooth, np.minimum(variance, np.where(known, np.maximum(variance_rad2, 1e-18), np.inf))


def _segments(angle_rad: Floats, variance: float) -> list[tuple[int, int]]:
    """Return the stretches (first, stop) between bumps, at which the direction changes permanently.

    A gap that holds a bump belongs to neither side. ``variance`` is that of a mean over ``SIDE`` frames.
    """
    known = np.flatnonzero(np.isfinite(angle_rad))
    values, parts, first = angle_rad[known], list[tuple[int, int]](), 0
    if len(values) > 4 * SIDE:
        jump = np.abs(steps_of_mean(values, SIDE))
        limit = BY_CHANCE * max(np.sqrt(2.0 * max(variance, 1e-18)), robust_sigma(jump))
        for begin, end in runs(jump > limit):
            bump = begin + int(np.argmax(jump[begin:end])) + SIDE
            parts.append((first, int(known[bump - 1]) + 1))
            first = int(known[bump])
    return [*parts, (first, len(angle_rad))]


def steps_of_mean(values: Floats, side: int) -> Floats:
    """Return the mean of the next ``side`` values minus that of the ``side`` values before, (n − 2 side + 1, …)."""
    total = np.concatenate([np.zeros_like(values[:1]), np.cumsum(values, axis=0)])
    mean = (total[side:] - total[:-side]) / side
    return np.asarray(mean[side:] - mean[:-side], dtype=np.float64)


def _character(values: Floats, noise: float) -> tuple[int, float, float, float]:
    """Return the averaging half-width in frames, drift per frame (a variance), and variances of shaking and of noise.

    The noise is that which changes from frame to frame, at most ``noise``.
    """
    if len(values) < 4:
        return 0, 0.0, 0.0, noise
    lags = [lag for lag in _LAGS if 3 * lag < len(values)] or [1]
    half_squares = np.array([0.5 * np.mean((values[lag:] - values[:-lag]) ** 2) for lag in lags])
    scatter = float(half_squares[0])
    drift = 0.0
    if len(lags) > 1:
        growth = np.diff(half_squares) / np.diff(lags)
        drift = max(0.0, 2.0 * float(np.median(growth)))
    shaking = max(0.0, scatter - noise)
    shaking = shaking if shaking > 0.5 * noise else 0.0
    apparent = min(scatter, noise)
    # Minimises the variance of the mean, noise / (2 h), plus that by drift, drift · h / 6.
    half = _LONGEST if drift <= 0 else int(np.sqrt(3.0 * max(apparent, 1e-18) / drift))
    return int(np.clip(half, 1, _LONGEST)), drift, shaking, apparent


def _bridge_variance(values: Floats, noise: float) -> Floats:
    """Return the variance (n,) of linear interpolation between known values, from how much the values change.

    From the semivariogram γ, half the mean square of the change over a lag, less the noise (Matheron, Principles of
    geostatistics, Econ. Geol. 58, 1963): 2 Σ wᵢ γ(hᵢ) − Σ wᵢ wⱼ γ(hᵢⱼ) for weights w of the values at distances h.
    """
    known, index = np.flatnonzero(np.isfinite(values)), np.arange(len(values))
    seen = values[known]
    lags = [lag for lag in _LAGS if lag < len(seen)]
    change = [max(0.0, 0.5 * float(np.mean((seen[lag:] - seen[:-lag]) ** 2)) - noise) for lag in lags]
    after = np.clip(np.searchsorted(known, index), 0, len(known) - 1)
    before = np.clip(np.searchsorted(known, index, side="right") - 1, 0, len(known) - 1)
    since, until = np.abs(index - known[before]), np.abs(known[after] - index)
    share = np.where(after > before, since / np.maximum(since + until, 1), 0.0)
    by_since, by_until, by_gap = (np.interp(gap, [0, *lags], [0.0, *change]) for gap in (since, until, since + until))
    between = 2.0 * ((1.0 - share) * by_since + share * by_until - share * (1.0 - share) * by_gap)
    return np.asarray(between, dtype=np.float64)


def _running_mean(values: Floats, half: int) -> tuple[Floats, Floats]:
    """Return the mean of the known values over ±half frames (interpolated where there is none), and their number."""
    known = np.isfinite(values)
    middle = float(np.nanmean(values)) if known.any() else 0.0
    total = np.concatenate([[0.0], np.cumsum(np.where(known, values - middle, 0.0))])
    number = np.concatenate([[0.0], np.cumsum(known)])
    index = np.arange(len(values))
    first, last = np.maximum(0, index - half), np.minimum(len(values), index + half + 1)
    count = number[last] - number[first]
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = middle + (total[last] - total[first]) / count
    empty = count == 0
    if not empty.all():
        mean = bridged(mean)
        count[empty] = 1.0
    return mean, count
