"""The true errors of positions, estimated from the stick's own length.

The covariance from a dot's fit holds for noise that is independent from pixel to pixel. Compression makes errors that
are correlated over the whole dot, which the fit cannot see. The distance between the two markers of a stick is
constant, so its scatter over the film is the true error along the stick, whatever its cause.

A codec repeats a picture in which nothing moves, including its noise: at rest the length does not scatter, however
large its error. So the errors of motion are estimated from frames in motion, and bound those at rest from below.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from torsight.core.series import FEWEST, robust_sigma
from torsight.core.units import Flags, Floats
from tracker.stick_direction import Points

LEAST_FRAMES: Final = 30
"""Frames in motion, or at rest, from which the size of their errors is estimated: to an eighth."""
_STILL_FRAMES: Final = 11
_STILL_PX: Final = 0.2
"""A stick rests while its markers keep within ``_STILL_PX`` over ``_STILL_FRAMES``."""


@dataclass(frozen=True, slots=True, eq=False)
class LengthWitness:
    """Statistics of a stick's length: its mean, and its ``residual`` (n,) after the changes by tilt and lens.

    ``scale`` is the standard deviation of the length, over that predicted by the fits' covariances, while the stick
    moves in the picture (at rest, where too few frames are in motion); ``still`` is the same at rest (in motion, where
    too few frames are at rest). ``outlier`` (n,) are the frames in which the length is impossible.
    """

    length: float
    residual: Floats
    scale: float
    still: float
    outlier: Flags


def in_motion(position_px: Floats) -> Flags:
    """Return the frames (n,) in which a stick moves in the picture, from its markers (n, 2, 2), NaN where not seen."""
    n = len(position_px)
    side = min(_STILL_FRAMES, n)
    if side == 0:
        return np.zeros(0, bool)
    window = [position_px[first : first + n - side + 1] for first in range(side)]
    # A marker that is not seen at all in a window is ignored.
    extent = np.fmax.reduce(np.fmax.reduce(window) - np.fmin.reduce(window), axis=(1, 2))
    rests = np.convolve(extent < _STILL_PX, np.ones(side)) > 0.0
    # The first and last three frames of a motion are within the limit, but no longer frozen by the codec.
    return np.asarray(np.convolve(~rests, np.ones(2 * 3 + 1))[3 : n + 3] > 0.0)


def witness(stick: Sequence[Points], *, moves: Flags, turns: bool = True) -> LengthWitness:
    """Compare the scatter of a stick's length over the film with that predicted by its markers' covariances.

    ``stick`` are its inner and outer marker in one plane, any unit, NaN where not known; ``moves`` (n,) is as in
    :func:`in_motion`. ``turns`` is false for the base: a rolling camera turns it in the picture without a change of its
    length, so no dependence of the length on the direction is fitted.
    """
    (inner, inner_covariance), (outer, outer_covariance) = stick
    offset = outer - inner
    length = np.hypot(offset[:, 0], offset[:, 1])
    unit = offset / length[:, None]
    variance = np.einsum("ni,nij,nj->n", unit, inner_covariance + outer_covariance, unit)
    known = np.isfinite(length) & np.isfinite(variance) & (variance > 0)
    residual = np.full(len(length), np.nan)
    outlier = np.zeros(len(length), bool)
    if known.sum() < LEAST_FRAMES:
        # Too few frames for a dependence on the direction: what it changes counts as error.
        usual = float(np.median(length[known])) if known.any() else np.nan
        residual[known] = length[known] - usual
        scale = max(1.0, robust_sigma(residual[known] / np.sqrt(variance[known]))) if known.any() else 1.0
        return LengthWitness(usual, residual, scale, scale, outlier)
    angle = np.arctan2(offset[known, 1], offset[known, 0])
    kinds = [kind for kind in (moves[known], ~moves[known]) if kind.any()]
    weight = _weights(moves[known])
    use = np.ones(int(known.sum()), bool)
    left = np.zeros(len(use))
    spreads = [0.0]
    for _ in range(3):
        left = length[known] - _smooth(angle * turns, length[known], weight * use)
        spreads = [robust_sigma(left[kind & use]) for kind in kinds]
        for kind, spread in zip(kinds, spreads, strict=True):
            # Normal errors are hardly ever beyond four standard deviations: the fit is of the others.
            use[kind] = np.abs(left[kind]) < max(4.0 * spread, 1e-9)
            if not use[kind].any():
                use[kind] = True
    residual[known] = left
    # Neither frames at rest alone nor a few frames show how large an error may be.
    told = [spread for kind, spread in zip(kinds, spreads, strict=True) if kind.sum() >= FEWEST]
    noise = float(np.sqrt(np.median(variance[known])))
    outlier[known] = np.abs(left) > max(8.0 * max(told), 6.0 * noise)
    scale, still = _scales(left**2 / variance[known], use, moves[known])
    return LengthWitness(float(np.mean(length[known][use])), residual, scale, still, outlier)


def _weights(moves: Flags) -> Floats:
    """Return the frames' weights in the fit of the length over the direction.

    At rest one frozen error is repeated in many frames: together they have a hundredth of the weight of those in
    motion, and so count only in directions in which the stick never moved.
    """
    moving, resting = int(moves.sum()), int((~moves).sum())
    if moving < LEAST_FRAMES:
        return np.ones(len(moves))
    return np.where(moves, 1.0, min(1.0, 0.01 * moving / max(resting, 1)))


def _scales(square: Floats, use: Flags, moves: Flags) -> tuple[float, float]:
    """Return the likeliest scale of errors in motion and at rest, from squared residuals over their variances (n,)."""

    def over(part: Flags) -> float:
        return float(np.sqrt(np.mean(square[part])))

    motion, rest = use & moves, use & ~moves
    overall = over(use)
    scale = over(motion) if motion.sum() >= LEAST_FRAMES else overall
    if FEWEST <= motion.sum() < LEAST_FRAMES:
        scale = max(overall, over(motion))
    if rest.sum() < LEAST_FRAMES:
        return scale, scale
    # A frozen error does not scatter, but is as large as the noise that the codec froze.
    return scale, max(over(rest), min(1.0, scale))


def by_direction(angle: Floats) -> Floats:
    """Return the basis functions (n, 5) of a length's dependence on its direction (n,) in the picture."""
    return np.stack([np.ones_like(angle), np.cos(angle), np.sin(angle), np.cos(2 * angle), np.sin(2 * angle)], axis=1)


def _smooth(angle: Floats, length: Floats, weight: Floats) -> Floats:
    """Return the length as a function of direction: tilt and lens change it once and twice per turn."""
    basis = by_direction(angle)
    weighted = weight[:, None] * basis
    ridge = 1e-4 * float(weight.sum()) * np.diag([0.0, 1.0, 1.0, 1.0, 1.0])
    # Around the mean, so that the weak ridge pulls the terms, not the length, towards zero.
    middle = float(np.median(length[weight > 0.0]))
    found = np.linalg.solve(weighted.T @ basis + ridge, weighted.T @ (length - middle))
    return np.asarray(middle + basis @ found, dtype=np.float64)
