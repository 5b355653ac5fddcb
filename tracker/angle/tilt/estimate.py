"""Fit of tilt and read-out to the paths of the moving stick's markers."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from torsight.core.minimise import least_squares
from torsight.core.optics.circles import near
from torsight.core.optics.hanging import USUAL_PX, direction_bins, spread_rows
from torsight.core.series import rms
from torsight.core.units import Floats
from tracker.angle.row_time import SHARE_PRIOR, Readout, circles, way_round
from tracker.angle.tilt.models import KNOWN, LAG, READOUT, Fitted, Tilt, averaged, best_readout
from tracker.angle.tilt.paths import CIRCLES, PACES, Paths, by_pace, rectify
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
_FEWEST: Final = CIRCLES.stop
"""Fewest frames: as many as there are values of tilt, lens, read-outs and circles."""
_TURNED_RAD: Final = np.deg2rad(3.0)
"""Arc whose sagitta equals a marker's usual errors (0.03 px at 100 px from the axis): a shorter one shows no shape."""


def fit_tilt(inner: Points, outer: Points, readout: Readout, *, half_px: float, known: bool = False) -> Tilt:
    """Fit the tilt and the read-out to the paths of the moving stick's markers.

    ``inner`` and ``outer`` are positions (n, 2) from the picture's middle in units of half its width (``half_px``
    pixels), y up, NaN where not known, with covariances; in square pixels, or in the plane of motion where that is
    ``known``: then the tilt returned is zero, and only the read-out estimated.
    """
    stick = outer[0] - inner[0]
    seen = np.asarray(np.isfinite(stick).all(axis=1), dtype=np.bool_)
    direction = np.arctan2(stick[:, 1], stick[:, 0])
    rate = readout.turning(direction, np.zeros(2), np.array([0.0, 1.0]))[0]
    lead = readout.lead_rad(rate)
    speed = np.abs(lead).max(axis=1, initial=0.0)
    # The fast frames determine the read-out, the others the parameters that do not depend on speed.
    fast = speed > rms(speed[seen]) if seen.any() else np.zeros(len(speed), np.bool_)
    rows = spread_rows(direction, seen, apart=fast)
    priors = [_prior(stretch) for stretch in _STRETCHES]
    if known:
        priors = [np.append(np.full(5, KNOWN), priors[0][5:])]
    turned = _turned(direction[seen])
    if len(rows) < _FEWEST or turned < _TURNED_RAD:
        nothing = [Fitted(0.0, np.zeros(7), np.diag(prior[:7] ** 2)).without(READOUT) for prior in priors]
        return _in_plane(averaged(nothing, turned, ([], []), np.zeros(2)), known=known)
    points, spread = (np.stack(part, axis=1)[rows] for part in zip(inner, outer, strict=True))
    (centre, *arms), _ = circles(points, direction[rows])
    order = np.argsort(np.abs(arms))
    between = float(np.angle(arms[order[1]]) - np.angle(arms[order[0]]))
    # Frames with the same direction and sense of rotation carry the same information.
    alike = 4 * direction_bins(direction[rows]) + 2 * fast[rows] + (lead[rows].sum(axis=1) > 0.0)
    usual = USUAL_PX / half_px
    way = way_round(direction, float(np.sqrt(np.nanmedian(stick_direction(inner, outer)[1]))))[rows]
    pace = rate[rows, 0] / max(rms(rate[rows, 0]), 1e-12)
    carried = usual * np.column_stack([way[:, None] * by_pace(np.abs(pace)), pace**2])
    outwards = order[1] - order[0]
    ahead = outwards * lead[rows]
    paths = Paths(points[:, order], spread[:, order], direction[rows], way, ahead, carried, alike, between)
    start = np.array([*np.zeros(7), centre.real, centre.imag, *np.sort(np.abs(arms)), 0.0, *np.zeros(carried.shape[1])])
    start, paths, kept = _without_far(paths, start, priors[-1])
    found: list[Fitted] = []
    weigh = paths.weighing(start, usual=usual)
    # A first fit gives the stick's directions in the plane, and the instants of them, from which its speed is derived.
    start, _, _ = _fit(paths, start, priors[-1], weigh)
    at = [rectify(part[0], start)[0] for part in (inner, outer)]
    flat, share = at[1] - at[0], np.clip(start[list(READOUT)], -1.0, 1.0)
    rate, _ = readout.turning(np.arctan2(flat[:, 1], flat[:, 0]), share, np.array(arms))
    paths = replace(paths, lead_rad=outwards * readout.lead_rad(rate)[rows[kept]])
    for prior, belief in zip(priors, _BELIEF, strict=False):
        values, covariance, chi_squared = _fit(paths, start, prior, weigh)
        evidence = _evidence(covariance, chi_squared, prior) + math.log(belief)
        wide = Fitted(evidence, values, covariance)
        found += [wide.marginal(), wide.with_less_lag().marginal()]
        start = values
    tilt = best_readout(found, turned)
    # The other values given the read-out that is returned: an uncertain read-out is no error of a marker.
    out = np.array(READOUT)
    off = tilt.values[out] - values[out]
    given = values + covariance[:, out] @ np.linalg.solve(covariance[np.ix_(out, out)], off)
    return _in_plane(replace(tilt, across=paths.across(given)), known=known)


def _in_plane(tilt: Tilt, *, known: bool) -> Tilt:
    """Return the tilt to be corrected: for a known plane the read-out alone, marginalised over the plane's error."""
    if not known:
        return tilt
    kept = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0])
    return replace(tilt, values=kept * tilt.values, covariance=np.outer(kept, kept) * tilt.covariance)


def _without_far(paths: Paths, start: Floats, prior: Floats) -> tuple[Floats, Paths, NDArray[np.intp]]:
    """Return a first fit, and the paths without frames whose residuals are outliers, with the others' indices."""
    values, rows = start, np.arange(len(paths.way))
    for _ in range(3):
        values, _, _ = _fit(paths, values, prior, lambda left: left)
        kept = near(paths.misfit(values))
        if kept.all() or kept.sum() < _FEWEST:
            break
        paths, rows = paths.rows(kept), rows[kept]
    return values, paths, rows


def _fit(paths: Paths, start: Floats, prior: Floats, weigh: Callable[[Floats], Floats]) -> tuple[Floats, Floats, float]:
    def residuals(values: Floats) -> Floats:
        return np.concatenate([weigh(paths.averaged(paths.misfit(values))).ravel(), np.delete(values, CIRCLES) / prior])

    return least_squares(residuals, start)


def _prior(stretch: float) -> Floats:
    perspective = _PERSPECTIVE * np.sqrt(stretch)
    carried = (*(LAG for _ in PACES), 1.0)
    return np.array([stretch, stretch, perspective, perspective, _BENDING, SHARE_PRIOR, SHARE_PRIOR, *carried])


def _evidence(covariance: Floats, chi_squared: float, prior: Floats) -> float:
    """Return the log evidence of a prior (Laplace's approximation), without the constants that all priors share."""
    scale = np.sqrt(np.diag(covariance))
    volume = float(np.linalg.slogdet(covariance / np.outer(scale, scale))[1]) + 2.0 * float(np.sum(np.log(scale)))
    return 0.5 * volume - 0.5 * chi_squared - float(np.sum(np.log(prior)))


def _turned(direction_rad: Floats) -> float:
    """Return the smallest arc, rad, that contains all directions."""
    if len(direction_rad) == 0:
        return 0.0
    turn = np.sort(direction_rad % (2.0 * np.pi))
    return float(2.0 * np.pi - np.diff(turn, append=turn[0] + 2.0 * np.pi).max())
