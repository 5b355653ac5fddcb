"""Tilt without a camera file: the moving markers go around circles, and the picture shows ellipses.

A plane seen from aside is shown by a homography. The image of two circles about one centre fixes it up to a turn and
a scale, which do not change angles; planes parallel to it share it, so the base stick's directions follow too. What
is fitted: a stretch (e1, e2), ψ²/4 for a tilt ψ, the perspective (l1, l2), and the lens's radial bending k, with the
circles' centre, radii, and the angle between both markers.

How much a camera is tilted nobody knows beforehand, so several priors of the tilt compete, from none that matters to
30 degrees, and count by how well they explain the paths (the evidence in Laplace's form). The paths' errors hang
together over many frames (see :mod:`torsight.core.optics.hanging`): over a short arc they look like an ellipse, and
what is not known is in the covariance.

Nothing is taken out but what the motion tells: a tilt that is no larger than what is not known of it stays in, and in
the covariance. A stick that hardly turns tells nothing: its markers' noise alone has a shape.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from torsight.core.minimise import least_squares
from torsight.core.optics.circles import near
from torsight.core.optics.hanging import USUAL_PX, hanging_errors, spread_rows
from tracker.follow.rotation_axis import circle_equations

Floats = NDArray[np.float64]

_STRETCHES: Final = (0.0002, 0.003, 0.01, 0.03, 0.08)
_BELIEF: Final = (0.02, 0.08, 0.25, 0.4, 0.25)
"""Priors of the stretch (tilts of 1.6, 6, 11, 20 and 32 degrees), and what is thought of each beforehand. Little
is staked on a camera that is straight: a short arc hardly shows 10 degrees, and must not be sure of none."""
_PERSPECTIVE: Final = 0.8
"""Change of scale across half the picture, over the root of the stretch: both come from one tilt."""
_BENDING: Final = 0.04
"""Prior: displacement by the lens at half the picture's width, as a share of it."""
_FEWEST: Final = 12
KNOWN: Final = 1.0 / 300.0
"""A tilt of which no more is left than can make 0.2 degrees is taken out, be it none."""
_SHOWN: Final = (4.0, 9.0)
"""χ² of the stretch against none from which some of it is taken out, and all: two and three standard deviations."""
_TURNED_RAD: Final = np.deg2rad(3.0)
"""Arc that bulges by a marker's usual errors (0.03 px at 100 px from the axis): a shorter one shows no shape."""
_RIDGE: Final = 1e-9
"""Weight of circles of no size about the picture's middle, in frames: for paths that do not fix them."""
_ENOUGH: Final = 1e-3
"""Gain in χ² that is not worth another step: a thirtieth of a standard deviation."""


@dataclass(frozen=True, slots=True, eq=False)
class Tilt:
    """How the plane of motion lies in the picture.

    Attributes
    ----------
    values : (5,) float64
        e1, e2, l1, l2, k; lengths in units of half the picture's width, from its middle.
    covariance : (5, 5) float64
        Their covariance, with the priors.
    arc_rad : float
        How much of a turn the paths cover.
    share : float
        How much of the tilt that explains the paths best is in ``values``: 1 where they tell it, 0 where they do not.
    """

    values: Floats
    covariance: Floats
    arc_rad: float
    share: float

    @property
    def known(self) -> bool:
        """Whether the paths tell the tilt; else the picture's plane stands."""
        return self.share > 0.0

    @property
    def sigma(self) -> float:
        """Standard deviation of the stretch; of the angle, in rad, twice per turn."""
        return float(np.sqrt(0.5 * np.trace(self.covariance[:2, :2])))

    def report(self) -> dict[str, Any]:
        """Return what ``track.json`` says of it."""
        stretch = float(np.hypot(*self.values[:2]))
        return {
            "known": self.known,
            "from": "the markers' own ellipses" if self.known else "nothing: the track covers too little of a turn",
            "tilt_deg": float(np.rad2deg(2.0 * np.sqrt(stretch))) if self.known else None,
            "share_taken_out": self.share,
            "arc_deg": float(np.rad2deg(self.arc_rad)),
            "error_it_can_make_deg": float(np.rad2deg(self.sigma)),
        }


def fit_tilt(
    inner: Floats, outer: Floats, covariance_inner: Floats, covariance_outer: Floats, *, half_px: float
) -> Tilt:
    """Fit the tilt to the paths of the moving stick's markers.

    Parameters
    ----------
    inner, outer : (n, 2) float64
        Positions from the picture's middle in units of half its width, y up, square pixels; NaN where not known.
    covariance_inner, covariance_outer : (n, 2, 2) float64
        Their covariances.
    half_px : float
        Half the picture's width in pixels.
    """
    known = np.asarray(np.isfinite(inner).all(axis=1) & np.isfinite(outer).all(axis=1), dtype=np.bool_)
    stick = outer - inner
    direction = np.arctan2(stick[:, 1], stick[:, 0])
    rows = spread_rows(direction, known)
    turned = _turned(direction[known])
    if len(rows) < _FEWEST or turned < _TURNED_RAD:
        return _blended([(0.0, np.zeros(5), np.diag(_prior(stretch) ** 2)) for stretch in _STRETCHES], turned)
    points = np.stack([inner[rows], outer[rows]], axis=1)
    spread = np.stack([covariance_inner[rows], covariance_outer[rows]], axis=1)
    paths = _Paths(points, 0.5 * np.trace(spread, axis1=2, axis2=3), direction[rows])
    start = np.concatenate([np.zeros(5), _circles(points)])
    start, paths = _without_far(paths, start)
    found: list[tuple[float, Floats, Floats]] = []
    weigh = paths.weighing(start, usual=USUAL_PX / half_px)
    for stretch in _STRETCHES:
        prior = _prior(stretch)
        values, covariance, chi_squared = _fit(paths, start, prior, weigh)
        found.append((_evidence(covariance, chi_squared, prior), values[:5], covariance[:5, :5]))
        start = values
    return _blended(found, _arc(direction[rows]))


@dataclass(frozen=True, slots=True, eq=False)
class _Paths:
    """Both markers' positions (n, 2, 2), their variances (n, 2), and the stick's direction (n,)."""

    points: Floats
    variance: Floats
    direction_rad: Floats

    def misfit(self, values: Floats) -> Floats:
        """Return by how much both radii and the angle between are off (n, 3), in units of white noise.

        The noise is that of the picture, carried along: a map that shrinks must not gain by making all errors smaller.
        """
        flat, slopes = rectify(self.points, values[:5])
        away = flat - values[5:7]
        radius = np.hypot(away[..., 0], away[..., 1])
        angle = np.arctan2(away[..., 1], away[..., 0])
        outwards = away / radius[..., None]
        round_ = np.stack([-outwards[..., 1], outwards[..., 0]], axis=-1)
        deep, wide = (np.sum(_times(way, slopes) ** 2, axis=-1) * self.variance for way in (outwards, round_))
        apart = np.angle(np.exp(1j * (angle[:, 1] - angle[:, 0] - values[9])))
        across = np.sqrt(np.sum(wide / radius**2, axis=1))
        return np.column_stack([(radius - values[7:9]) / np.sqrt(deep), apart / across])

    def weighing(self, values: Floats, *, usual: float) -> Callable[[Floats], Floats]:
        """Return what makes the misfits independent."""
        white = float(np.sqrt(np.median(self.variance)))
        whiten = hanging_errors(self.direction_rad, self.misfit, values, usual=usual / white).whiten
        return lambda left: np.asarray(whiten @ left)


def _without_far(paths: _Paths, start: Floats) -> tuple[Floats, _Paths]:
    """Return a first fit and the paths without frames that are far off it."""
    prior = _prior(_STRETCHES[-1])
    values = start
    for _ in range(3):
        values, _, _ = _fit(paths, values, prior, lambda left: left)
        kept = near(paths.misfit(values))
        if kept.all() or kept.sum() < _FEWEST:
            break
        paths = _Paths(paths.points[kept], paths.variance[kept], paths.direction_rad[kept])
    return values, paths


def _fit(
    paths: _Paths, start: Floats, prior: Floats, weigh: Callable[[Floats], Floats]
) -> tuple[Floats, Floats, float]:
    def residuals(values: Floats) -> Floats:
        return np.concatenate([weigh(paths.misfit(values)).ravel(), values[:5] / prior])

    return least_squares(residuals, start, enough=_ENOUGH)


def _prior(stretch: float) -> Floats:
    perspective = _PERSPECTIVE * np.sqrt(stretch)
    return np.array([stretch, stretch, perspective, perspective, _BENDING])


def _evidence(covariance: Floats, chi_squared: float, prior: Floats) -> float:
    """Return the logarithm of how well a prior explains the paths, less what all have in common."""
    scale = np.sqrt(np.diag(covariance))
    volume = float(np.linalg.slogdet(covariance / np.outer(scale, scale))[1]) + 2.0 * float(np.sum(np.log(scale)))
    return 0.5 * volume - 0.5 * chi_squared - float(np.sum(np.log(prior)))


def _blended(found: list[tuple[float, Floats, Floats]], arc_rad: float) -> Tilt:
    """Return what all priors say together, each by its evidence, as far as the motion tells it."""
    evidence = np.array([item[0] for item in found]) + np.log(_BELIEF)
    weight = np.exp(evidence - evidence.max())
    weight /= weight.sum()
    values = sum((w * item[1] for w, item in zip(weight, found, strict=True)), np.zeros(5))
    covariance = np.zeros((5, 5))
    for w, (_, own, spread) in zip(weight, found, strict=True):
        covariance += w * (spread + np.outer(own - values, own - values))
    share = _told(values[:2], covariance[:2, :2])
    left = (1.0 - share) * values
    return Tilt(values - left, covariance + np.outer(left, left), arc_rad, share)


def _told(stretch: Floats, covariance: Floats) -> float:
    """Return how much of a stretch (2,) is to be taken out: without a jump from all of it to none."""
    sigma = float(np.sqrt(0.5 * np.trace(covariance)))
    chi_squared = float(stretch @ np.linalg.solve(covariance, stretch))
    shown = (chi_squared - _SHOWN[0]) / (_SHOWN[1] - _SHOWN[0])
    return float(np.clip(max(shown, 2.0 - sigma / KNOWN), 0.0, 1.0))


def rectify(points: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Return points (..., 2) as they would be seen straight from above, up to a turn and a scale.

    Also the derivatives (..., 2, 2).
    """
    e1, e2, l1, l2, k = values
    x, y = points[..., 0], points[..., 1]
    bend = 1.0 + k * (x * x + y * y)
    u, v = x * bend, y * bend
    depth = 1.0 + l1 * u + l2 * v
    flat_x, flat_y = ((1.0 + e1) * u + e2 * v) / depth, (e2 * u + (1.0 - e1) * v) / depth
    by_u = np.stack([(1.0 + e1 - l1 * flat_x) / depth, (e2 - l1 * flat_y) / depth], axis=-1)
    by_v = np.stack([(e2 - l2 * flat_x) / depth, (1.0 - e1 - l2 * flat_y) / depth], axis=-1)
    xx, xy, yy = bend + 2.0 * k * x * x, 2.0 * k * x * y, bend + 2.0 * k * y * y
    slopes = np.stack(
        [by_u * xx[..., None] + by_v * xy[..., None], by_u * xy[..., None] + by_v * yy[..., None]], axis=-1
    )
    return np.stack([flat_x, flat_y], axis=-1), slopes


def _times(rows: Floats, matrices: Floats) -> Floats:
    """Return rows (..., 2) times matrices (..., 2, 2)."""
    return rows[..., :1] * matrices[..., 0, :] + rows[..., 1:] * matrices[..., 1, :]


def _circles(points: Floats) -> Floats:
    """Return a first guess of centre, radii, and the angle between both markers, for circles as they are seen."""
    stick = points[:, 1] - points[:, 0]
    normal, right = circle_equations(points, np.arctan2(stick[:, 1], stick[:, 0]))
    found = np.linalg.solve(normal + _RIDGE * np.eye(6), right)
    arms = found[2:].reshape(2, 2)
    angles = np.arctan2(arms[:, 1], arms[:, 0])
    return np.concatenate([found[:2], np.hypot(arms[:, 0], arms[:, 1]), [angles[1] - angles[0]]])


def _turned(direction_rad: Floats) -> float:
    """Return the arc that holds all directions."""
    if len(direction_rad) == 0:
        return 0.0
    turn = np.sort(direction_rad % (2.0 * np.pi))
    return float(2.0 * np.pi - np.diff(turn, append=turn[0] + 2.0 * np.pi).max())


def _arc(direction_rad: Floats) -> float:
    """Return how much of a turn is seen, in steps of ten degrees."""
    turn = direction_rad % (2.0 * np.pi)
    return float(len(np.unique((turn / (2.0 * np.pi) * 36).astype(np.int64))) * np.pi / 18.0)
