"""Tilt without a camera file: the moving markers go around circles, and the picture shows ellipses.

The mapping of a plane seen obliquely to the picture is a homography. The image of two circles about one centre
determines it up to a rotation and a scale, which do not change angles; parallel planes share it, so it holds for the
base stick's directions, too. The fit estimates a stretch (e1, e2), ψ²/4 for a tilt ψ, the perspective (l1, l2), and the
lens's radial distortion k, with the circles' centre, radii, and the angle between both markers.

The camera's tilt is not known beforehand, so a prior of a small tilt and one of a large tilt compete, weighted by their
evidence (Laplace's approximation). The paths' errors are correlated over many frames (see
:mod:`torsight.core.optics.hanging`): over a short arc they look like an ellipse, and the covariance includes that.

Only a tilt that the motion determines is corrected: one that is no larger than its uncertainty is left uncorrected,
and added to the covariance. A stick that hardly turns determines no tilt: its markers' noise alone has a shape.

A rolling shutter (:mod:`tracker.angle.row_time`) is fitted in addition: read-out along x, read-out along y, and a
global shutter are three models, weighted by their evidence as well, against any other effect that depends on speed and
position and would look like a read-out longer than a frame. The lag by a codec, or by a camera that averages noise over
frames, is also fitted: both repeat the last picture as long as a pixel changes little, so that a marker lags behind,
the more the faster it moves until its pixels change much, and the angle between both markers differs between the two
senses of rotation, wherever the markers are in the picture. The dependence of the lag on the speed is free, and the
evidence decides whether the lag is that of a codec alone. Motion blur changes the angle between the markers with the
speed, equally for both senses: the position found for a blurred marker, a bent tag most of all, lies a little beside
the middle of its path. Such errors lie along the circles, where the stick's length does not show them: residuals across
the arms, including the lag, beyond those along the arms count in the angle's uncertainty.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from statistics import NormalDist
from typing import Any, Final

import numpy as np

from torsight.core.minimise import least_squares
from torsight.core.optics.circles import near
from torsight.core.optics.hanging import USUAL_PX, direction_bins, spread_rows, whitening
from torsight.core.series import correlation_time, rms
from torsight.core.units import Flags, Floats, Ints
from tracker.angle.row_time import SHARE_PRIOR, Readout, circles, turning, way_round
from tracker.stick_direction import Points, stick_direction

_STRETCHES: Final = (0.003, 0.03)
_BELIEF: Final = (0.3, 0.7)
"""Prior standard deviations of the stretch (tilts of 6 and 20 degrees), and the prior probability of each. The small
tilt has the lower probability: a short arc hardly shows 10 degrees, and must not make a tilt of zero look certain. More
priors, from 1.6 to 32 degrees, make the same errors, and sigmas a tenth smaller (benchmarks/tracking/tilt.py)."""
_PERSPECTIVE: Final = 0.8
"""Prior: change of scale across half the picture, over the square root of the stretch: both come from one tilt."""
_BENDING: Final = 0.04
"""Prior: displacement by the lens at half the picture's width, as a share of it."""
_LAG: Final = 10.0
"""Prior: lag behind the motion over the usual size of a marker's errors. A camera that averages noise over frames makes
dots lag by 0.2 px (drawn films in little light, benchmarks/tracking/hardships.py), a codec alone by a tenth of that,
which is a competing prior."""
_PACES: Final = 3.0 ** np.arange(-3.0, 2.0)
"""Nodes of the lag over the speed, in rms speeds: linear in the speed's logarithm between them, constant outside."""
_CIRCLES: Final = np.s_[7:12]
"""Indices, among the values, of the circles' centre, the near marker's arm, the far one's radius, and the near one's
offset across its arm. Before them are tilt, lens and read-outs, behind them the coefficients of lag and motion blur."""
_FEWEST: Final = 12
KNOWN: Final = np.deg2rad(0.2)
"""Standard deviation of the angle, by the tilt's uncertainty, up to which the estimated tilt is corrected in full, even
if it is zero. A known plane may be wrong by as much: were it taken as exact, its error would look like a read-out."""
_SHOWN: Final = (4.0, 9.0)
"""χ² of the stretch against zero above which part of it, and all of it, is corrected: two and three standard
deviations."""
_BELIEVED: Final = math.erf(math.sqrt(0.5 * _SHOWN[0]))
"""Probability of a read-out above which part of it is corrected: two standard deviations, as for the stretch."""
_TURNED_RAD: Final = np.deg2rad(3.0)
"""Arc whose sagitta equals a marker's usual errors (0.03 px at 100 px from the axis): a shorter one shows no shape."""
_ENOUGH: Final = 1e-3
"""Gain in χ² below which the fit stops: a thirtieth of a standard deviation."""


@dataclass(frozen=True, slots=True, eq=False)
class Tilt:
    """Orientation of the plane of motion relative to the picture, and the read-out time of the picture.

    ``values`` (7,) are e1, e2, l1, l2, k in units of half the picture's width from its middle, and the read-out time
    along x, and along y, over the time between two frames, negative for backwards, one of them zero; ``covariance``
    includes the priors. ``arc_rad`` is the part of a turn that the paths cover, ``share`` the part of the best-fitting
    tilt that is in ``values`` (1 where the paths determine the tilt, 0 where they do not), ``rolling`` how clearly the
    paths show a rolling shutter (0 to 1); ``across`` is the ratio of the errors across the stick to those along it,
    which its length shows, at least 1.
    """

    values: Floats
    covariance: Floats
    arc_rad: float
    share: float
    rolling: float = 0.0
    across: float = 1.0

    @property
    def known(self) -> bool:
        """Whether the paths determine the tilt; otherwise the picture's plane is used uncorrected."""
        return self.share > 0.0

    @property
    def sigma(self) -> float:
        """Standard deviation of the stretch: also that of the angle's error, rad, which has two periods per turn."""
        return float(np.sqrt(0.5 * np.trace(self.covariance[:2, :2])))

    def report(self) -> dict[str, Any]:
        """Return the entry of ``track.json`` on the tilt."""
        stretch = float(np.hypot(*self.values[:2]))
        return {
            "known": self.known,
            "from": "the markers' own ellipses" if self.known else "nothing: the track covers too little of a turn",
            "tilt_deg": float(np.rad2deg(2.0 * np.sqrt(stretch))) if self.known else None,
            "share_taken_out": self.share,
            "arc_deg": float(np.rad2deg(self.arc_rad)),
            "error_it_can_make_deg": float(np.rad2deg(self.sigma)),
        }


def fit_tilt(inner: Points, outer: Points, readout: Readout, *, half_px: float, known: bool = False) -> Tilt:
    """Fit the tilt and the read-out to the paths of the moving stick's markers.

    ``inner`` and ``outer`` are positions (n, 2) from the picture's middle in units of half its width (``half_px``
    pixels), y up, NaN where not known, with covariances; in square pixels, or in the plane of motion where that is
    ``known``: then the tilt returned is zero, and only the read-out estimated.
    """
    stick = outer[0] - inner[0]
    seen = np.asarray(np.isfinite(stick).all(axis=1), dtype=np.bool_)
    direction = np.arctan2(stick[:, 1], stick[:, 0])
    lead, rate = readout.lead_rad(direction), turning(readout.time_s, direction)[0]
    speed = np.abs(lead).max(axis=1, initial=0.0)
    # The fast frames determine the read-out, the others the parameters that do not depend on speed.
    fast = speed > rms(speed[seen]) if seen.any() else np.zeros(len(speed), np.bool_)
    rows = spread_rows(direction, seen, apart=fast)
    priors = [_prior(stretch) for stretch in _STRETCHES]
    if known:
        priors = [np.append(np.full(5, KNOWN), priors[0][5:])]
    turned = _turned(direction[seen])
    if len(rows) < _FEWEST or turned < _TURNED_RAD:
        nothing = [_Found(0.0, np.zeros(7), np.diag(prior[:7] ** 2)) for prior in priors]
        return _told_of(_blended([item.without(_READ) for item in nothing], turned, ([], []), np.zeros(2)), known=known)
    points, spread = (np.stack(part, axis=1)[rows] for part in zip(inner, outer, strict=True))
    (centre, *arms), _ = circles(points, direction[rows])
    order = np.argsort(np.abs(arms))
    between = float(np.angle(arms[order[1]]) - np.angle(arms[order[0]]))
    # Frames with the same direction and sense of rotation carry the same information.
    alike = 4 * direction_bins(direction[rows]) + 2 * fast[rows] + (lead[rows].sum(axis=1) > 0.0)
    usual = USUAL_PX / half_px
    way = way_round(direction, float(np.sqrt(np.nanmedian(stick_direction(inner, outer)[1]))))[rows]
    pace = rate[rows] / max(rms(rate[rows]), 1e-12)
    carried = usual * np.column_stack([way[:, None] * _by_pace(np.abs(pace)), pace**2])
    ahead = (order[1] - order[0]) * lead[rows]
    paths = _Paths(points[:, order], spread[:, order], direction[rows], way, ahead, carried, alike, between)
    start = np.array([*np.zeros(7), centre.real, centre.imag, *np.sort(np.abs(arms)), 0.0, *np.zeros(carried.shape[1])])
    start, paths = _without_far(paths, start, priors[-1])
    found: list[_Found] = []
    weigh = paths.weighing(start, usual=usual)
    for prior, belief in zip(priors, _BELIEF, strict=False):
        values, covariance, chi_squared = _fit(paths, start, prior, weigh)
        evidence = _evidence(covariance, chi_squared, prior) + math.log(belief)
        wide = _Found(evidence, values, covariance)
        found += [wide.marginal(), wide.with_less_lag().marginal()]
        start = values
    tilt = _best_readout(found, turned)
    # The other values given the read-out that is returned: an uncertain read-out is no error of a marker.
    out = np.array(_READ)
    off = tilt.values[out] - values[out]
    told = values + covariance[:, out] @ np.linalg.solve(covariance[np.ix_(out, out)], off)
    return _told_of(replace(tilt, across=paths.across(told)), known=known)


def _told_of(tilt: Tilt, *, known: bool) -> Tilt:
    """Return the tilt to be corrected: for a known plane the read-out alone, marginalised over the plane's error."""
    if not known:
        return tilt
    told = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0])
    return replace(tilt, values=told * tilt.values, covariance=np.outer(told, told) * tilt.covariance)


@dataclass(frozen=True, eq=False)
class _Paths:
    """Both markers' positions (n, 2, 2) and covariances (n, 2, 2, 2), the stick's direction (n,), the far one's lead.

    The marker that is nearer to the axis comes first; ``between_rad`` is about the angle from its arm to the far one's.
    For the lead (n, 2) of the far marker see :meth:`tracker.angle.row_time.Readout.lead_rad`. ``way`` (n,) is the sense
    of rotation. ``carried`` (n, k) are the regressors of the offset along the circle by codec and motion blur, of the
    usual size in the unit of the positions: a lag at each of ``_PACES``, with the sign of the sense, and the speed's
    square. Residuals of frames with the same number ``alike`` (n,) are averaged: single frames scatter more along the
    motion than across it, and over a short arc a map that exchanges both would gain by that alone.
    """

    points: Floats
    covariance: Floats
    direction_rad: Floats
    way: Floats
    lead_rad: Floats
    carried: Floats
    alike: Ints
    between_rad: float

    def rows(self, kept: Flags) -> _Paths:
        """Return some of the frames."""
        return replace(self, **{item.name: getattr(self, item.name)[kept] for item in fields(self)[:-1]})

    def averaged(self, left: Floats) -> Floats:
        """Return the sums (m, q) of residuals (n, q) over each group of frames, over the root of the group's size."""
        group, root = self._groups
        columns = left.shape[1]
        places = group[:, None] * columns + np.arange(columns)
        return np.bincount(places.ravel(), left.ravel()).reshape(-1, columns) / root

    @cached_property
    def _groups(self) -> tuple[Ints, Floats]:
        """Index of every frame's group (n,), and the square roots of the groups' sizes (m, 1)."""
        _, group, count = np.unique(self.alike, return_inverse=True, return_counts=True)
        return group, np.sqrt(count)[:, None]

    def misfit(self, values: Floats) -> Floats:
        """Return the markers' residuals (n, 3) in units of white noise; see :meth:`off`."""
        away, variance = self.off(values)
        return np.asarray(away / np.sqrt(variance))

    def off(self, values: Floats) -> tuple[Floats, Floats]:
        """Return the markers' residuals (n, 3), and their variances (n, 3) by white noise.

        The residuals are those of the near marker along its arm, of the far one's radius, and of the near marker across
        its arm, relative to the far one's direction: the angle between both arms would be undefined where the near
        marker lies on the axis. The noise is that of the picture, propagated through the map: a map that shrinks must
        not gain by making all residuals smaller.
        """
        (x, y), (xx, xy, yx, yy) = _mapped(*self._places, values)
        away = (x - values[7]) + 1j * (y - values[8])
        far = np.abs(away[:, 1])
        out = (away[:, 1] / far)[:, None] * np.exp([-1j * self.between_rad, 0.0])
        along = self._variance(out.real * xx + out.imag * yx, out.real * xy + out.imag * yy)
        aside = self._variance(out.real * yx - out.imag * xx, out.real * yy - out.imag * xy)
        # Rate of turn in the plane over that in the picture: the map's determinant over its squared change of length.
        determinant = 0.25 * (xx.sum(axis=1) * yy.sum(axis=1) - xy.sum(axis=1) * yx.sum(axis=1))
        ahead = determinant * self._square / _square(x, y) * (self.lead_rad @ values[5:7])
        near = away[:, 0] * np.conj(out[:, 0]) * np.exp(1j * ahead)
        share = values[9] / values[10]
        beside = near.imag - values[11] + self.carried @ values[_CIRCLES.stop :] * np.hypot(1.0, share)
        return (
            np.column_stack([near.real - values[9], far - values[10], beside]),
            np.column_stack([along, aside[:, 0] + share**2 * aside[:, 1]]),
        )

    def across(self, values: Floats) -> float:
        """Return the ratio of the errors across the stick to those along it, which its length shows, at least 1.

        A common displacement of both markers, by play of the axis or a trembling camera, does not turn the stick. It is
        as large along the arms as across them, so the mean square along the arms, with the same weight of the far
        marker, is subtracted. The excess counts as far as it is larger than chance (the positive part of James and
        Stein's estimate).
        """
        away, variance = self.off(values)
        share = values[9] / values[10]
        # Lag and motion blur are errors of the angle, though fitted here, except for their mean over all frames.
        carried = self.carried @ values[_CIRCLES.stop :] * np.hypot(1.0, share)
        away[:, 2] -= carried - carried.mean()
        alike = (away[:, 0] - share * away[:, 1]) / np.sqrt(variance[:, 0] + share**2 * variance[:, 1])
        left = np.column_stack([away[:, 2] / np.sqrt(variance[:, 2]), alike])
        across, along = np.square(left[near(left)]).T
        more, usual = float(np.mean(across) - np.mean(along)), float(np.mean(along))
        chance = 2.0 * float(np.var(along)) * correlation_time([along - usual]) / len(along)
        return math.sqrt(1.0 + max(more - chance / more, 0.0)) if more > 0.0 else 1.0

    def _variance(self, by_x: Floats, by_y: Floats) -> Floats:
        """Return the variances (n, 2) of linear combinations of each marker's coordinates, with these coefficients."""
        xx, both, yy = self._spreads
        return np.asarray(by_x**2 * xx + by_x * by_y * both + by_y**2 * yy)

    @cached_property
    def _places(self) -> tuple[Floats, Floats]:
        return np.ascontiguousarray(self.points[..., 0]), np.ascontiguousarray(self.points[..., 1])

    @cached_property
    def _spreads(self) -> tuple[Floats, Floats, Floats]:
        own = self.covariance
        return own[..., 0, 0].copy(), own[..., 0, 1] + own[..., 1, 0], own[..., 1, 1].copy()

    @cached_property
    def _square(self) -> Floats:
        return _square(*self._places)

    def weighing(self, values: Floats, *, usual: float) -> Callable[[Floats], Floats]:
        """Return a function that whitens averaged residuals (m, q); ``usual`` is the usual correlated error."""
        # The harmonic mean of the variances: frames of uncertain position, where the base was hidden, count little.
        white = float(np.sqrt(0.5 / np.mean(1.0 / np.trace(self.covariance, axis1=2, axis2=3))))
        whiten = whitening(self.direction_rad, self.misfit, values, usual=usual / white, way=self.way)
        mean = self.averaged(np.eye(len(whiten))) @ np.linalg.inv(whiten)
        factor = np.linalg.inv(np.linalg.cholesky(mean @ mean.T))
        return lambda left: np.asarray(factor @ left)


def _square(x: Floats, y: Floats) -> Floats:
    """Return the squared distance (n,) between both markers (n, 2)."""
    return np.asarray((x[:, 1] - x[:, 0]) ** 2 + (y[:, 1] - y[:, 0]) ** 2)


def _without_far(paths: _Paths, start: Floats, prior: Floats) -> tuple[Floats, _Paths]:
    """Return a first fit, and the paths without frames whose residuals are outliers."""
    values = start
    for _ in range(3):
        values, _, _ = _fit(paths, values, prior, lambda left: left)
        kept = near(paths.misfit(values))
        if kept.all() or kept.sum() < _FEWEST:
            break
        paths = paths.rows(kept)
    return values, paths


def _fit(
    paths: _Paths, start: Floats, prior: Floats, weigh: Callable[[Floats], Floats]
) -> tuple[Floats, Floats, float]:
    def residuals(values: Floats) -> Floats:
        return np.concatenate(
            [weigh(paths.averaged(paths.misfit(values))).ravel(), np.delete(values, _CIRCLES) / prior]
        )

    return least_squares(residuals, start, enough=_ENOUGH)


def _by_pace(pace: Floats) -> Floats:
    """Return the weights (n, k) that interpolate a function at speeds (n,) from its values at ``_PACES``."""
    at = np.log(np.clip(pace, _PACES[0], _PACES[-1]))
    return np.stack([np.interp(at, np.log(_PACES), one) for one in np.eye(len(_PACES))], axis=1)


def _prior(stretch: float) -> Floats:
    perspective = _PERSPECTIVE * np.sqrt(stretch)
    carried = (*(_LAG for _ in _PACES), 1.0)
    return np.array([stretch, stretch, perspective, perspective, _BENDING, SHARE_PRIOR, SHARE_PRIOR, *carried])


def _evidence(covariance: Floats, chi_squared: float, prior: Floats) -> float:
    """Return the log evidence of a prior (Laplace's approximation), without the constants that all priors share."""
    scale = np.sqrt(np.diag(covariance))
    volume = float(np.linalg.slogdet(covariance / np.outer(scale, scale))[1]) + 2.0 * float(np.sum(np.log(scale)))
    return 0.5 * volume - 0.5 * chi_squared - float(np.sum(np.log(prior)))


_STANDS, _READ = [0, 1, 2, 3, 4], (5, 6)
"""Indices among the values of tilt and lens, and of both read-outs."""
_INVERSE: Final = np.arange(-0.9995, 1.0, 0.001)
"""Grid, over the inverse of a read-out longer than a frame, for its evidence: finer than any read-out's uncertainty."""


@dataclass(frozen=True, slots=True, eq=False)
class _Found:
    """Fit of one model: its log evidence, its values (p,), and their covariance."""

    evidence: float
    values: Floats
    covariance: Floats

    def marginal(self) -> _Found:
        """Return the model of tilt, lens and read-outs, marginalised over the other values."""
        kept = np.s_[: _CIRCLES.start]
        return replace(self, values=self.values[kept], covariance=self.covariance[kept, kept])

    def with_less_lag(self) -> _Found:
        """Return the model with the narrower prior of the lag, that of a codec alone."""
        lag = np.s_[_CIRCLES.stop : _CIRCLES.stop + len(_PACES)]
        value, sharper = self.values[lag], 1.0 - _LAG**-2
        # The narrow prior divided by the wide one is a Gaussian around a lag of zero.
        spread = self.covariance[lag, lag] + np.eye(len(value)) / sharper
        back = np.linalg.solve(spread, np.column_stack([value, self.covariance[lag]]))
        carried = self.covariance[:, lag] @ back
        shrunk = float(np.linalg.slogdet(sharper * spread)[1])
        evidence = self.evidence + len(value) * math.log(_LAG) - 0.5 * (shrunk + float(value @ back[:, 0]))
        return _Found(evidence, self.values - carried[:, 0], self.covariance - carried[:, 1:])

    def without(self, places: Sequence[int]) -> _Found:
        """Return the model in which the values at ``places``, read-outs, are zero (Savage-Dickey density ratio)."""
        out = list(places)
        kept = [place for place in range(len(self.values)) if place not in out]
        between = self.covariance[np.ix_(kept, out)]
        own = self.covariance[np.ix_(out, out)]
        back = np.linalg.solve(own, np.column_stack([self.values[out], between.T]))
        carried = between @ back
        evidence = self.evidence - 0.5 * float(self.values[out] @ back[:, 0] + np.linalg.slogdet(own)[1])
        values = self.values[kept] - carried[:, 0]
        covariance = self.covariance[np.ix_(kept, kept)] - carried[:, 1:]
        return _Found(evidence + len(out) * float(np.log(SHARE_PRIOR)), values, covariance)

    def possible(self) -> tuple[_Found, float]:
        """Return the model whose last value is a possible read-out, and the log evidence of other effects like it.

        A read-out is no longer than a frame, and uniformly distributed up to that. A longer one is another effect that
        depends on speed and position: its prior probability is 1 − ``_BELIEVED``, and its prior density falls with the
        square of its size.
        """
        share, variance = float(self.values[-1]), float(self.covariance[-1, -1])
        # Likelihood of the paths alone: the posterior without the fit's prior.
        alone = 1.0 / max(1.0 / variance - SHARE_PRIOR**-2, 1e-9)
        middle, sigma = share * alone / variance, math.sqrt(alone)
        said = NormalDist(0.0, math.hypot(sigma, SHARE_PRIOR)).pdf(middle)
        paths = NormalDist(middle, sigma)
        shorter = 0.5 * (paths.cdf(1.0) - paths.cdf(-1.0))
        # Integrated over the inverse of the length, in which the prior is uniform.
        longer = 0.5 * float(np.mean(np.exp(-0.5 * ((1.0 / _INVERSE - middle) / sigma) ** 2))) * paths.pdf(middle)
        tiny = np.finfo(float).tiny
        within, beyond = (
            math.log(max(one, tiny) / max(said, tiny)) for one in (_BELIEVED * shorter, (1.0 - _BELIEVED) * longer)
        )
        return replace(self, evidence=self.evidence + within), self.evidence + beyond


def _best_readout(found: list[_Found], arc_rad: float) -> Tilt:
    """Return the tilt with the read-out that explains the paths best: along x, along y, or none."""
    none = [item.without(_READ) for item in found]
    possible = [[item.without([place]).possible() for item in found] for place in _READ[::-1]]
    rolling = [[item for item, _ in items] for items in possible]
    other = [beyond for items in possible for _, beyond in items]
    evidence = np.array([*(_total(items) for items in (none, *rolling)), np.logaddexp.reduce(other)])
    belief = np.exp(evidence - evidence.max())
    belief /= belief.sum()
    return _blended(none, arc_rad, rolling, belief[1:3])


def _total(found: Sequence[_Found]) -> float:
    """Return the log of the models' summed evidence."""
    return float(np.logaddexp.reduce([item.evidence for item in found]))


def _blended(none: list[_Found], arc_rad: float, rolling: Sequence[list[_Found]], belief: Floats) -> Tilt:
    """Return the tilt averaged over all priors, weighted by evidence, as far as the motion determines it.

    ``belief`` (2,) are the probabilities of a read-out along x and y; the part of each that is not corrected counts in
    the covariance.
    """
    shown = np.maximum(0.0, (belief - _BELIEVED) / (1.0 - _BELIEVED))
    values, covariance, unseen = np.zeros(7), np.zeros((7, 7)), np.zeros(7)
    for items, part, more, places in (
        (none, 1.0 - shown.sum(), 0.0, _STANDS),
        *zip(rolling, shown, belief - shown, ([*_STANDS, place] for place in _READ), strict=True),
    ):
        for item in items:
            w, own, spread = math.exp(item.evidence - _total(items)), np.zeros(7), np.zeros((7, 7))
            own[places], spread[np.ix_(places, places)] = item.values, item.covariance
            spread += np.outer(own, own)
            values, covariance = values + part * w * own, covariance + part * w * spread
            unseen[places[-1]] += more * w * spread[places[-1], places[-1]]
    covariance += np.diag(unseen) - np.outer(values, values)
    share = _told(values[:2], covariance[:2, :2])
    left = (1.0 - share) * np.append(values[:5], [0.0, 0.0])
    return Tilt(values - left, covariance + np.outer(left, left), arc_rad, share, float(shown.sum()))


def _told(stretch: Floats, covariance: Floats) -> float:
    """Return the share of a stretch (2,) to be corrected, a continuous function from 0 to 1."""
    sigma = float(np.sqrt(0.5 * np.trace(covariance)))
    chi_squared = float(stretch @ np.linalg.solve(covariance, stretch))
    shown = (chi_squared - _SHOWN[0]) / (_SHOWN[1] - _SHOWN[0])
    return float(np.clip(max(shown, 2.0 - sigma / KNOWN), 0.0, 1.0))


def rectify(points: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Return points (..., 2) as seen along the axis, up to a rotation and a scale, and the derivatives (..., 2, 2)."""
    flat, slopes = _mapped(points[..., 0], points[..., 1], values)
    return np.stack(flat, axis=-1), np.stack(slopes, axis=-1).reshape(*points.shape, 2)


def _mapped(x: Floats, y: Floats, values: Floats) -> tuple[tuple[Floats, Floats], tuple[Floats, ...]]:
    """Return the mapped x and y, and the derivatives of the new x by x and y, and of the new y by x and y."""
    e1, e2, l1, l2, k = values[:5].tolist()
    bend = 1.0 + k * (x * x + y * y)
    u, v = x * bend, y * bend
    deep = 1.0 / (1.0 + l1 * u + l2 * v)
    flat_x, flat_y = ((1.0 + e1) * u + e2 * v) * deep, (e2 * u + (1.0 - e1) * v) * deep
    x_u, y_u = (1.0 + e1 - l1 * flat_x) * deep, (e2 - l1 * flat_y) * deep
    x_v, y_v = (e2 - l2 * flat_x) * deep, (1.0 - e1 - l2 * flat_y) * deep
    u_x, both, v_y = bend + 2.0 * k * x * x, 2.0 * k * x * y, bend + 2.0 * k * y * y
    slopes = (x_u * u_x + x_v * both, x_u * both + x_v * v_y, y_u * u_x + y_v * both, y_u * both + y_v * v_y)
    return (flat_x, flat_y), slopes


def _turned(direction_rad: Floats) -> float:
    """Return the smallest arc, rad, that contains all directions."""
    if len(direction_rad) == 0:
        return 0.0
    turn = np.sort(direction_rad % (2.0 * np.pi))
    return float(2.0 * np.pi - np.diff(turn, append=turn[0] + 2.0 * np.pi).max())
