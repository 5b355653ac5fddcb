"""Models of tilt and read-out, averaged over their evidence; the part of a tilt and of a read-out that is corrected."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from statistics import NormalDist
from typing import Any, Final

import numpy as np

from torsight.core.units import Floats
from tracker.angle.row_time import SHARE_PRIOR
from tracker.angle.tilt.paths import CIRCLES, PACES
from tracker.innovation import SIGMAS

LAG: Final = 10.0
"""Prior: lag behind the motion over the usual size of a marker's errors. A camera that averages noise over frames makes
dots lag by 0.2 px (drawn films in little light, benchmarks/tracking/hardships.py), a codec alone by a tenth of that,
which is a competing prior."""
KNOWN: Final = np.deg2rad(0.2)
"""Standard deviation of the angle, by the tilt's uncertainty, up to which the estimated tilt is corrected in full, even
if it is zero. A known plane may be wrong by as much: were it taken as exact, its error would look like a read-out."""
_SHOWN: Final = (4.0, SIGMAS**2)
"""χ² of the stretch against zero above which part of it, and all of it, is corrected: two and three standard
deviations."""
_BELIEVED: Final = math.erf(math.sqrt(0.5 * _SHOWN[0]))
"""Probability of a read-out above which part of it is corrected: two standard deviations, as for the stretch."""
_LENS: Final = [0, 1, 2, 3, 4]
"""Indices, among the values, of tilt and lens."""
READOUT: Final = (5, 6)
"""Indices, among the values, of the read-outs along x and y."""
_INVERSE: Final = np.arange(-0.9995, 1.0, 0.001)
"""Grid, over the inverse of a read-out longer than a frame, for its evidence: finer than any read-out's uncertainty."""


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


@dataclass(frozen=True, slots=True, eq=False)
class Fitted:
    """Fit of one model: its log evidence, its values (p,), and their covariance."""

    evidence: float
    values: Floats
    covariance: Floats

    def marginal(self) -> Fitted:
        """Return the model of tilt, lens and read-outs, marginalised over the other values."""
        kept = np.s_[: CIRCLES.start]
        return replace(self, values=self.values[kept], covariance=self.covariance[kept, kept])

    def with_less_lag(self) -> Fitted:
        """Return the model with the narrower prior of the lag, that of a codec alone."""
        places, sharper = list(range(CIRCLES.stop, CIRCLES.stop + len(PACES))), 1.0 - LAG**-2
        # The narrow prior divided by the wide one is a Gaussian around a lag of zero.
        found = self._near_zero(places, 1.0 / sharper)
        return replace(found, evidence=found.evidence + len(places) * math.log(LAG / math.sqrt(sharper)))

    def without(self, places: Sequence[int]) -> Fitted:
        """Return the model in which the values at ``places``, read-outs, are zero (Savage-Dickey density ratio)."""
        kept, found = np.delete(np.arange(len(self.values)), places), self._near_zero(list(places), 0.0)
        evidence = found.evidence + len(places) * math.log(SHARE_PRIOR)
        return Fitted(evidence, found.values[kept], found.covariance[np.ix_(kept, kept)])

    def _near_zero(self, places: list[int], variance: float) -> Fitted:
        """Return the model given that the values at ``places`` are zero to within a variance.

        The evidence is times the density of that, but for a factor of 2π under the root for each value.
        """
        value, across = self.values[places], self.covariance[places]
        spread = across[:, places] + variance * np.eye(len(places))
        back = np.linalg.solve(spread, np.column_stack([value, across]))
        evidence = self.evidence - 0.5 * float(value @ back[:, 0] + np.linalg.slogdet(spread)[1])
        return Fitted(evidence, self.values - across.T @ back[:, 0], self.covariance - across.T @ back[:, 1:])

    def possible(self) -> tuple[Fitted, float]:
        """Return the model whose last value is a possible read-out, and the log evidence of other effects like it.

        A read-out is no longer than a frame, and uniformly distributed up to that. A longer one is another effect that
        depends on speed and position: its prior probability is 1 − ``_BELIEVED``, and its prior density falls with the
        square of its size.
        """
        share, variance = float(self.values[-1]), float(self.covariance[-1, -1])
        # Likelihood of the paths alone: the posterior without the fit's prior.
        alone = 1.0 / max(1.0 / variance - SHARE_PRIOR**-2, 1e-9)
        middle, sigma = share * alone / variance, math.sqrt(alone)
        fitted = NormalDist(0.0, math.hypot(sigma, SHARE_PRIOR)).pdf(middle)
        paths = NormalDist(middle, sigma)
        shorter = 0.5 * (paths.cdf(1.0) - paths.cdf(-1.0))
        # Integrated over the inverse of the length, in which the prior is uniform.
        longer = 0.5 * float(np.mean(np.exp(-0.5 * ((1.0 / _INVERSE - middle) / sigma) ** 2))) * paths.pdf(middle)
        tiny = np.finfo(float).tiny
        within, beyond = (
            math.log(max(one, tiny) / max(fitted, tiny)) for one in (_BELIEVED * shorter, (1.0 - _BELIEVED) * longer)
        )
        return replace(self, evidence=self.evidence + within), self.evidence + beyond


def best_readout(found: list[Fitted], arc_rad: float) -> Tilt:
    """Return the tilt with the read-out that explains the paths best: along x, along y, or none."""
    none = [item.without(READOUT) for item in found]
    possible = [[item.without([place]).possible() for item in found] for place in READOUT[::-1]]
    rolling = [[item for item, _ in items] for items in possible]
    other = [beyond for items in possible for _, beyond in items]
    evidence = np.array([*(_total(items) for items in (none, *rolling)), np.logaddexp.reduce(other)])
    belief = np.exp(evidence - evidence.max())
    belief /= belief.sum()
    return averaged(none, arc_rad, rolling, belief[1:3])


def _total(found: Sequence[Fitted]) -> float:
    """Return the log of the models' summed evidence."""
    return float(np.logaddexp.reduce([item.evidence for item in found]))


def averaged(none: list[Fitted], arc_rad: float, rolling: Sequence[list[Fitted]], belief: Floats) -> Tilt:
    """Return the tilt averaged over all priors, weighted by evidence, as far as the motion determines it.

    ``belief`` (2,) are the probabilities of a read-out along x and y; the part of each that is not corrected counts in
    the covariance.
    """
    shown = np.maximum(0.0, (belief - _BELIEVED) / (1.0 - _BELIEVED))
    values, covariance, unseen = np.zeros(7), np.zeros((7, 7)), np.zeros(7)
    for items, part, more, places in (
        (none, 1.0 - shown.sum(), 0.0, _LENS),
        *zip(rolling, shown, belief - shown, ([*_LENS, place] for place in READOUT), strict=True),
    ):
        for item in items:
            w, own, spread = math.exp(item.evidence - _total(items)), np.zeros(7), np.zeros((7, 7))
            own[places], spread[np.ix_(places, places)] = item.values, item.covariance
            spread += np.outer(own, own)
            values, covariance = values + part * w * own, covariance + part * w * spread
            unseen[places[-1]] += more * w * spread[places[-1], places[-1]]
    covariance += np.diag(unseen) - np.outer(values, values)
    share = _corrected_share(values[:2], covariance[:2, :2])
    left = (1.0 - share) * np.append(values[:5], [0.0, 0.0])
    return Tilt(values - left, covariance + np.outer(left, left), arc_rad, share, float(shown.sum()))


def _corrected_share(stretch: Floats, covariance: Floats) -> float:
    """Return the share of a stretch (2,) to be corrected, a continuous function from 0 to 1."""
    sigma = float(np.sqrt(0.5 * np.trace(covariance)))
    chi_squared = float(stretch @ np.linalg.solve(covariance, stretch))
    shown = (chi_squared - _SHOWN[0]) / (_SHOWN[1] - _SHOWN[0])
    return float(np.clip(max(shown, 2.0 - sigma / KNOWN), 0.0, 1.0))
