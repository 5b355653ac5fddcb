"""How wrong positions really are: the stick's own length as the witness.

The fit of a dot tells its error for noise that is independent from pixel to pixel. Compression makes errors that hang
together over the whole dot, which the fit cannot see. The distance between the two markers of a stick is constant, so
its scatter over the film is the true error along the stick, whatever its cause.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

_LEAST_FRAMES: Final = 30
_CLIP: Final = 4.0


@dataclass(frozen=True, slots=True, eq=False)
class LengthWitness:
    """What the length of a stick says.

    Attributes
    ----------
    length : float
        Its mean.
    residual : (n,) float64
        Length less what tilt and lens make of it, NaN where not known.
    scale : float
        Standard deviation of the length over what the fits' covariances predict.
    outlier : (n,) bool
        Frames in which the length is impossible.
    """

    length: float
    residual: NDArray[np.float64]
    scale: float
    outlier: NDArray[np.bool_]


def witness(
    inner: NDArray[np.float64],
    outer: NDArray[np.float64],
    covariance_inner: NDArray[np.float64],
    covariance_outer: NDArray[np.float64],
) -> LengthWitness:
    """Compare a stick's length over the film with what its markers' covariances predict.

    Parameters
    ----------
    inner, outer : (n, 2) float64
        Positions in one plane, any unit; NaN where not known.
    covariance_inner, covariance_outer : (n, 2, 2) float64
        Their covariances from the fits.
    """
    offset = outer - inner
    length = np.hypot(offset[:, 0], offset[:, 1])
    unit = offset / length[:, None]
    variance = np.einsum("ni,nij,nj->n", unit, covariance_inner + covariance_outer, unit)
    known = np.isfinite(length) & np.isfinite(variance) & (variance > 0)
    residual = np.full(len(length), np.nan)
    outlier = np.zeros(len(length), bool)
    if known.sum() < _LEAST_FRAMES:
        return LengthWitness(float(np.nanmean(length)) if known.any() else np.nan, residual, 1.0, outlier)
    angle = np.arctan2(offset[known, 1], offset[known, 0])
    use = np.ones(int(known.sum()), bool)
    left = np.zeros(len(use))
    for _ in range(3):
        left = length[known] - _smooth(angle, length[known], use)
        spread = 1.4826 * float(np.median(np.abs(left[use])))
        use = np.abs(left) < max(_CLIP * spread, 1e-9)
        if not use.any():
            use[:] = True
            break
    residual[known] = left
    outlier[known] = np.abs(left) > max(8.0 * spread, 6.0 * float(np.sqrt(np.median(variance[known]))))
    scale = float(np.sqrt(np.mean(left[use] ** 2) / np.mean(variance[known][use])))
    return LengthWitness(float(np.mean(length[known][use])), residual, scale, outlier)


def _smooth(angle: NDArray[np.float64], length: NDArray[np.float64], use: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return the part of the length that follows the direction: tilt and lens change it once and twice per turn."""
    basis = np.stack([np.ones_like(angle), np.cos(angle), np.sin(angle), np.cos(2 * angle), np.sin(2 * angle)], axis=1)
    weight = basis[use]
    ridge = 1e-4 * len(weight) * np.diag([0.0, 1.0, 1.0, 1.0, 1.0])
    # Around the mean, so that the weak ridge pulls the terms, not the length, towards zero.
    middle = float(np.median(length[use]))
    found = np.linalg.solve(weight.T @ weight + ridge, weight.T @ (length[use] - middle))
    return np.asarray(middle + basis @ found, dtype=np.float64)
