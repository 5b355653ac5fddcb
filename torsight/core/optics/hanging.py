"""Correlated errors of markers: the residuals of a fit repeat with the direction of the stick and do not average out.

Compression, the pixel pattern, uneven light and the edge of a stick next to a dot shift a marker by a few hundredths of
a pixel, similarly for all similar directions of the stick. A fit that treats these errors as white noise finds a
spurious tilt with too small an uncertainty. So the residuals z of a first fit, in units of white noise, are modelled
as::

    cov(z_i, z_j) = a² · (δ_ij + κ² · exp(−|ψ_i − ψ_j| / ℓ) · (1 − p |w_i − w_j| / 2))

with ψ the stick's direction and w, from −1 to 1, its sense of rotation. A codec, or a camera that averages noise over
frames, leaves traces of the last picture, which differ between the two senses (p = 1). κ, ℓ and p (0 or 1) are chosen
by the restricted likelihood (Patterson and Thompson, 1971), which accounts for the degrees of freedom of the fit, with
a weak prior on the usual size of such errors. Among the values within a 95 % interval of the best, those with the
strongest correlation are taken, because short arcs contain few independent errors.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from torsight.core.minimise import jacobian_of
from torsight.core.parameter import REACH
from torsight.core.units import Flags, Floats, Ints

USUAL_PX: Final = 0.02
"""Usual size of a marker's correlated errors, on films from lossless to CRF 30."""
_LENGTHS_RAD: Final = (0.1, 0.35, 1.2)
"""Correlation lengths that are tried, 6° to 70°, spaced by a factor of 3.5; shorter: white noise; longer: an offset."""
_RATIOS: Final = np.geomspace(0.25, 16.0, 7)
"""Ratios of the correlated errors' size to their usual size that are tried."""
_AS_LIKELY: Final = 0.5 * REACH**2
"""Difference of log-likelihood from the best at the end of a 95 % interval (Wilks, 1938)."""
_MOST_ROWS: Final = 160
"""Largest number of rows for estimating the correlation: the time grows with their third power (eigenvectors)."""
_BIN_RAD: Final = np.deg2rad(2.0)
"""Bin width of directions: a third of the shortest correlation length."""


def whitening(
    direction_rad: Floats,
    misfit: Callable[[Floats], Floats],
    values: Floats,
    *,
    usual: float,
    way: Floats | None = None,
) -> Floats:
    """Return the matrix (n, n) that whitens a fit's residuals: to independent ones of unit variance.

    ``misfit`` returns the residuals (n, q) for values (p,), at the stick's directions (n,), and ``usual`` is the usual
    size of correlated errors, both in units of white noise; ``way`` (n,) is the stick's sense of rotation, None if this
    is not modelled.
    """
    error = misfit(values)
    n, q = error.shape
    slopes = jacobian_of(lambda near: misfit(near).ravel(), values).reshape(n, q, -1)
    # Columns of equal length: the values may be in any unit.
    slopes = slopes / np.maximum(np.linalg.norm(slopes, axis=(0, 1)), 1e-300)
    apart = np.abs(np.angle(np.exp(1j * (direction_rad[:, None] - direction_rad[None, :]))))
    alike = [np.ones_like(apart)]
    if way is not None:
        alike.append(1.0 - 0.5 * np.abs(way[:, None] - way[None, :]))
    found: list[tuple[float, float, Floats]] = []
    for length, part in itertools.product(_LENGTHS_RAD, alike):
        # In the basis of the eigenvectors the covariance is diagonal for every ratio.
        share, ways = np.linalg.eigh(np.exp(-apart / length) * part)
        error_along, slopes_along = ways.T @ error, (ways.T @ slopes.reshape(n, -1)).reshape(slopes.shape)
        for ratio in _RATIOS:
            variance = 1.0 + (ratio * usual) ** 2 * np.maximum(share, 0.0)
            flat = (error_along / np.sqrt(variance)[:, None]).ravel()
            columns = (slopes_along / np.sqrt(variance)[:, None, None]).reshape(n * q, -1)
            basis, triangle = np.linalg.qr(columns)
            left = flat - basis @ (basis.T @ flat)
            free = max(n * q - columns.shape[1], 1)
            white = max(1.0, float(np.sqrt(left @ left / free)))
            # The restricted log-likelihood, maximised over the white noise, and the prior of the ratio: within a factor
            # of three, the logarithm's standard deviation is 1.2.
            lost = float(np.sum(np.log(np.maximum(np.abs(np.diag(triangle)), 1e-12))))
            score = -0.5 * q * float(np.sum(np.log(variance))) - lost - free * np.log(white)
            score -= 0.5 * float(left @ left) / white**2 + 0.5 * (np.log(ratio) / 1.2) ** 2
            found.append((score, (white * ratio) ** 2 * length, (ways / np.sqrt(variance)).T / white))
    limit = max(score for score, _, _ in found) - _AS_LIKELY
    likely = [(care, whiten) for score, care, whiten in found if score >= limit]
    return max(likely, key=lambda one: one[0])[1]


def direction_bins(direction_rad: Floats) -> Ints:
    """Return the indices (n,) of the two-degree bins of directions."""
    return np.asarray(np.floor((direction_rad % (2.0 * np.pi)) / _BIN_RAD), dtype=np.int64)


def spread_rows(direction_rad: Floats, known: Flags, *, apart: Flags | None = None) -> NDArray[np.intp]:
    """Return known rows, spread evenly over the stick's directions, because a rest adds no information.

    Rows with different values of ``apart`` (n,) count as different directions.
    """
    rows = np.flatnonzero(known)
    if len(rows) <= _MOST_ROWS:
        return rows
    bins = direction_bins(direction_rad[rows])
    if apart is not None:
        bins = 2 * bins + apart[rows]
    order = np.argsort(bins, kind="stable")
    first = np.searchsorted(bins[order], bins[order])
    count = np.bincount(bins)[bins[order]]
    rank = np.arange(len(rows)) - first
    share = max(1, _MOST_ROWS // len(np.unique(bins)))
    # The same number from every bin, evenly over time.
    kept = (rank * share) // count != ((rank - 1) * share) // count
    return np.sort(rows[order[kept]])
