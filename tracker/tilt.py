"""Tilt without a camera file: the moving markers go around circles, and the picture shows ellipses.

A plane seen from aside is shown by a homography. The image of two circles about one centre fixes it up to a turn and
a scale, which do not change angles; planes parallel to it share it, so the base stick's directions follow too. What
is fitted: a stretch (e1, e2), ψ²/4 for a tilt ψ, the perspective (l1, l2), and the lens's radial bending k, with the
circles' centre, radii, and the angle between both markers. How filming is commonly done stands as a prior on the
first five; where the track covers little of a turn it is all that is known, and its width is what the tilt may do to
the angle.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from torsight.core.axis import thinned
from torsight.core.minimise import least_squares

Floats = NDArray[np.float64]

_STRETCH: Final = 0.01
"""Prior: tilts of some 11 degrees; ψ²/4."""
_PERSPECTIVE: Final = 0.06
"""Prior: change of scale across half the picture."""
_BENDING: Final = 0.02
"""Prior: displacement by the lens at half the picture's width, as a share of it."""
_FEWEST: Final = 12
_KNOWN: Final = 1.0 / 3.0
"""The tilt counts as known where the paths narrow the prior to this share."""


@dataclass(frozen=True, slots=True, eq=False)
class Tilt:
    """How the plane of motion lies in the picture.

    Attributes
    ----------
    values : (5,) float64
        e1, e2, l1, l2, k; lengths in units of half the picture's width, from its middle.
    covariance : (5, 5) float64
        Their covariance, with the prior.
    arc_rad : float
        How much of a turn the paths cover.
    known : bool
        Whether the paths tell the tilt, or the prior stands alone.
    """

    values: Floats
    covariance: Floats
    arc_rad: float
    known: bool

    def report(self) -> dict[str, Any]:
        """Return what ``track.json`` says of it."""
        stretch = float(np.hypot(*self.values[:2]))
        sigma = float(np.sqrt(0.5 * np.trace(self.covariance[:2, :2])))
        return {
            "known": self.known,
            "from": "the markers' own ellipses" if self.known else "nothing: the track covers too little of a turn",
            "tilt_deg": float(np.rad2deg(2.0 * np.sqrt(stretch))) if self.known else None,
            "arc_deg": float(np.rad2deg(self.arc_rad)),
            "error_it_can_make_deg": float(np.rad2deg(sigma)),
        }


def fit_tilt(inner: Floats, outer: Floats, covariance_inner: Floats, covariance_outer: Floats, *, half: float) -> Tilt:
    """Fit the tilt to the paths of the moving stick's markers.

    Parameters
    ----------
    inner, outer : (n, 2) float64
        Positions from the picture's middle, y up, square pixels; NaN where not known.
    covariance_inner, covariance_outer : (n, 2, 2) float64
        Their covariances.
    half : float
        Half the picture's width, the unit of length of the fit.
    """
    known = np.asarray(np.isfinite(inner).all(axis=1) & np.isfinite(outer).all(axis=1), dtype=np.bool_)
    prior = np.array([_STRETCH, _STRETCH, _PERSPECTIVE, _PERSPECTIVE, _BENDING])
    nothing = Tilt(np.zeros(5), np.diag(prior**2), 0.0, known=False)
    rows = thinned(known)
    if len(rows) < _FEWEST:
        return nothing
    points = np.stack([inner[rows], outer[rows]], axis=1) / half
    spread = np.stack([covariance_inner[rows], covariance_outer[rows]], axis=1) / half**2
    arc = _arc(points)
    start = np.concatenate([np.zeros(5), _circles(points)])
    variance = 0.5 * np.trace(spread, axis1=2, axis2=3)

    def residuals(values: Floats) -> Floats:
        away = rectify(points, values[:5]) - values[5:7]
        radius, angle = np.hypot(away[..., 0], away[..., 1]), np.arctan2(away[..., 1], away[..., 0])
        apart = np.angle(np.exp(1j * (angle[:, 1] - angle[:, 0] - values[9])))
        sigma = np.sqrt(variance)
        across = np.sqrt(np.sum(variance / radius**2, axis=1))
        error = np.column_stack([(radius - values[7:9]) / sigma, apart / across])
        return np.concatenate([error.ravel(), values[:5] / prior])

    values, covariance, chi_squared = least_squares(residuals, start)
    freedom = 3 * len(rows) - 5
    covariance = covariance * max(1.0, chi_squared / freedom)
    # A misfit must not make the answer less sure than the prior alone is.
    shrink = np.minimum(1.0, prior / np.sqrt(np.diag(covariance)[:5]))
    covariance = covariance[:5, :5] * np.outer(shrink, shrink)
    sigma = float(np.sqrt(0.5 * np.trace(covariance[:2, :2])))
    return Tilt(values[:5], covariance, arc, known=sigma < _KNOWN * _STRETCH)


def rectify(points: Floats, values: Floats) -> Floats:
    """Return points (..., 2) as they would be seen straight from above, up to a turn and a scale."""
    e1, e2, l1, l2, k = values
    x, y = points[..., 0], points[..., 1]
    bend = 1.0 + k * (x * x + y * y)
    x, y = x * bend, y * bend
    depth = 1.0 + l1 * x + l2 * y
    return np.stack([((1.0 + e1) * x + e2 * y) / depth, (e2 * x + (1.0 - e1) * y) / depth], axis=-1)


def _circles(points: Floats) -> Floats:
    """Return a first guess of centre, radii, and the angle between both markers, for circles as they are seen."""
    stick = points[:, 1] - points[:, 0]
    turn = np.arctan2(stick[:, 1], stick[:, 0])
    cos, sin = np.cos(turn), np.sin(turn)
    normal, right = np.eye(6) * 1e-9, np.zeros(6)
    for marker in range(2):
        for axis, (along, across) in enumerate(((cos, -sin), (sin, cos))):
            columns = np.zeros((len(points), 6))
            columns[:, axis] = 1.0
            columns[:, 2 + 2 * marker], columns[:, 3 + 2 * marker] = along, across
            normal += columns.T @ columns
            right += columns.T @ points[:, marker, axis]
    found = np.linalg.solve(normal, right)
    arms = found[2:].reshape(2, 2)
    angles = np.arctan2(arms[:, 1], arms[:, 0])
    return np.concatenate([found[:2], np.hypot(arms[:, 0], arms[:, 1]), [angles[1] - angles[0]]])


def _arc(points: Floats) -> float:
    """Return how much of a turn is seen, in steps of ten degrees."""
    stick = points[:, 1] - points[:, 0]
    turn = np.arctan2(stick[:, 1], stick[:, 0]) % (2.0 * np.pi)
    return float(len(np.unique((turn / (2.0 * np.pi) * 36).astype(np.int64))) * np.pi / 18.0)
