"""Removal of the camera's motion from the markers' positions, by means of the base stick.

A camera that is bumped, sags or shakes shifts the whole picture. The sticks' directions do not change, but the axis
moves in the picture: circles whose centre shifts look like ellipses, and so like a tilt. The base stick is fixed, so
its motion is that of the picture, and is subtracted from all positions. Changes of scale that both sticks' lengths show
together are removed, too: a camera that comes nearer enlarges the whole picture. Where the base moves by no more than
its own noise nothing is subtracted: that would only add the base's noise to the other markers.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from torsight.core.optics.camera import Intrinsics
from torsight.core.optics.geometry import carried, pixel_from_ray, ray_from_pixel
from torsight.core.optics.hanging import USUAL_PX
from torsight.core.series import BY_CHANCE, bridged, robust_sigma, runs
from torsight.core.tracks import MarkerTracks
from torsight.core.units import Flags, Floats
from tracker.angle.length_noise import LEAST_FRAMES, LengthWitness, by_direction, witness
from tracker.angle.reference_direction import SIDE, steady_direction, steps_of_mean
from tracker.follow.camera_state import SHAKE_PX
from tracker.innovation import SIGMAS
from tracker.stick_direction import turned_by

_MOVED: Final = 1.5
"""Smallest motion (rms over the film) that is removed, over the noise of one frame."""
_FELT_PX: Final = 5.0 * USUAL_PX
"""Smallest motion (rms over the film) that is removed: compression moves a marker at rest by a fifth of this."""
_BUMP_PX: Final = 1.5 * SHAKE_PX
"""Smallest step of the base's place that counts as a bump of the camera: 1.5 times the standard deviation of the
shaking that the tracker is required to bear."""


class Unmoved(NamedTuple):
    """The markers as a fixed camera would have seen them.

    ``tracks`` have the camera's shift and change of scale removed. While the base is hidden, the variance of the shift
    is added to the covariance of a moving marker that is seen alone: the direction from both markers does not depend on
    it. ``paths``, for fitting the moving markers' circles, are also turned back about the base where the camera rolled
    (angles are taken against the base in any case, and include its errors). A circle depends on positions: while the
    base is hidden, the variances of shift, turn and scale are added to the covariances of all markers. ``shift_px2``
    (n,) is the variance, along each axis, of the subtracted shift, an error that all markers of a frame share;
    ``turn_rad2`` (n,) is the variance of the angle by which ``paths`` are turned back.
    """

    tracks: MarkerTracks
    paths: MarkerTracks
    shift_px2: Floats
    turn_rad2: Floats


def unmoved(tracks: MarkerTracks, intrinsics: Intrinsics | None = None, *, pixel_aspect: float = 1.0) -> Unmoved:
    """Return the tracks as a fixed camera would have seen them.

    With a known lens the motion is subtracted from the rays, since a small rotation of the camera shifts these;
    otherwise from the positions in the picture.
    """
    flat, covariance, pixel = flattened(tracks, intrinsics, pixel_aspect)
    flat, size_variance = as_far(flat, covariance, pixel=pixel)
    hidden = np.asarray(np.isnan(flat[:, :2, 0]).all(axis=1))
    step, variance = picture_shift(flat[:, :2], covariance[:, :2], pixel=pixel)
    if not (size_variance.any() or step.any()):
        return Unmoved(tracks, tracks, variance, variance)
    flat = flat - step[:, None]
    seen, loose = _seen(flat), np.where(hidden, variance, 0.0)
    alone = (seen[:, 2] != seen[:, 3]) * loose / pixel**2
    spread = tracks.covariance_px2.copy()
    spread[:, 2:] += alone[:, None, None, None] * np.eye(2)
    still = replace(tracks, position_px=_in_picture(flat, intrinsics, pixel_aspect), covariance_px2=spread)
    turned, turn_rad2 = upright(flat, covariance, pixel=pixel)
    away2 = np.sum(np.square(flat - np.nanmedian(_middle(flat[:, :2]), axis=0)), axis=-1)
    off = loose[:, None] + (turn_rad2 + size_variance)[:, None] * away2
    shared_px2 = np.where(hidden[:, None], off, 0.0) / pixel**2
    paths = replace(
        still,
        position_px=_in_picture(turned, intrinsics, pixel_aspect),
        covariance_px2=tracks.covariance_px2 + shared_px2[..., None, None] * np.eye(2),
    )
    return Unmoved(still, paths, variance / pixel**2, turn_rad2)


def flattened(tracks: MarkerTracks, intrinsics: Intrinsics | None, pixel_aspect: float) -> tuple[Floats, Floats, float]:
    """Return rays, or positions in square pixels (n, 4, 2), their covariances, and the size of a pixel in that unit."""
    if intrinsics is None:
        stretch = np.array([pixel_aspect, 1.0])
        return tracks.position_px * stretch, tracks.covariance_px2 * np.outer(stretch, stretch), 1.0
    rays, slopes = ray_from_pixel(tracks.position_px, intrinsics)
    return rays, carried(tracks.covariance_px2, slopes), 1.0 / float(intrinsics.matrix[0, 0])


def _in_picture(flat: Floats, intrinsics: Intrinsics | None, pixel_aspect: float) -> Floats:
    """Return the pixel positions of coordinates from :func:`flattened`: its inverse."""
    return flat / np.array([pixel_aspect, 1.0]) if intrinsics is None else pixel_from_ray(flat, intrinsics)


def as_far(position: Floats, covariance: Floats, *, pixel: float = 1.0) -> tuple[Floats, Floats]:
    """Return positions (n, 4, 2) as from a camera at a constant distance, and the variance (n,) of their scale.

    A camera that comes nearer makes both sticks longer, while the errors of their lengths are independent. So the slope
    of the moving stick's length over the base's, fitted together with the effect of its direction, is the camera's
    share in the variance of the base's length; the same share of every change of that length is attributed to the
    camera, and removed by scaling about the base's middle. The variance is zero where nothing is removed.
    ``covariance`` and ``pixel`` are as for :func:`upright`.
    """
    base, moving = _lengths(position, covariance, 0), _lengths(position, covariance, 2)
    nothing = np.zeros(len(position))
    told = np.isfinite(base.residual) & ~base.outlier
    known = told & np.isfinite(moving.residual) & ~moving.outlier
    if known.sum() < LEAST_FRAMES:
        return position, nothing
    longer = np.where(told, base.residual / base.length, np.nan)
    offset = position[known, 3] - position[known, 2]
    beside = by_direction(np.arctan2(offset[:, 1], offset[:, 0]))
    both = np.stack([longer[known], np.hypot(*offset.T) / moving.length], axis=1)
    x, y = (both - beside @ np.linalg.lstsq(beside, both, rcond=None)[0]).T
    # Second differences have six times the variance of white noise.
    slope = _slope(x, y, noise=robust_sigma(np.diff(longer[known], 2)) / math.sqrt(6.0))
    share, changed = float(np.clip(slope, 0.0, 1.0)), float(np.var(longer[known]))
    if not share * changed > max(_MOVED**2 * (1.0 - share) * changed, (_FELT_PX * pixel / base.length) ** 2):
        return position, nothing
    noise = 0.5 * np.trace(covariance[:, 0] + covariance[:, 1], axis1=1, axis2=2) / base.length**2
    size, variance = _followed(share * longer, noise)
    # While the base is not seen its middle is interpolated.
    about = np.stack([bridged(part) for part in _middle(position[:, :2]).T], axis=1)[:, None]
    return np.asarray(about + (position - about) / (1.0 + size)[:, None, None]), variance


def _slope(x: Floats, y: Floats, *, noise: float) -> float:
    """Return the slope of y (n,) over x (n,), whose own white noise, a standard deviation, would flatten it.

    The noise's share in the sum of squares is subtracted where the rest is more than chance (the method of moments for
    errors in variables: Fuller, Measurement error models, 1987, section 1.2).
    """
    square, white = float(x @ x), len(x) * noise**2
    rest = square - white
    return float(x @ y) / (rest if rest > SIGMAS * math.sqrt(2.0 / len(x)) * white else max(square, 1e-18))


def _lengths(position: Floats, covariance: Floats, first: int) -> LengthWitness:
    """Return the statistics of the length of the stick whose inner marker is ``first``, all frames as in motion."""
    stick = [(position[:, marker], covariance[:, marker]) for marker in (first, first + 1)]
    return witness(stick, moves=np.ones(len(position), np.bool_), turns=first > 0)


def picture_shift(base: Floats, covariance: Floats, *, pixel: float = 1.0) -> tuple[Floats, Floats]:
    """Return the shift (n, 2) of the base stick from its place at the start, and the larger variance (n,) of x and y.

    Both are interpolated where the base is not seen, and zero in a film in which the shift is no more than noise.

    A moving camera shifts both markers (n, 2, 2), NaN where not seen; a marker that moves alone was misread.
    ``covariance`` (n, 2, 2, 2) is that of the fits, ``pixel`` the size of a pixel in the unit of the positions.
    """
    place = _middle(base)
    known, nothing = np.isfinite(place[:, 0]), (np.zeros_like(place), np.zeros(len(place)))
    if not known.any():
        return nothing
    noise = _noise(base, covariance) * max(_lengths(base, covariance, 0).scale, 1.0) ** 2
    # The first tenth of the film defines the base's place: a camera is calibrated before it is moved.
    start = np.median(place[known][: max(1, round(0.1 * known.sum()))], axis=0)
    step, variance = np.zeros_like(place), np.zeros(len(place))
    for axis in range(2):
        away = place[:, axis] - start[axis]
        step[:, axis], spread = _followed(away, noise[:, axis])
        variance = np.maximum(variance, spread)
    offset = base[:, 1] - base[:, 0]
    # One misread marker moves the middle by half as much as the offset: a quarter of the offset's variance.
    usual = np.maximum(np.median(noise[known], axis=0), 0.25 * np.var(offset[_seen(offset)], axis=0))
    if not (np.var(step[known], axis=0) > np.maximum(_MOVED**2 * usual, (_FELT_PX * pixel) ** 2)).any():
        return nothing
    return step, variance


def bumps(base_px: Floats) -> list[tuple[int, float]]:
    """Return the frames at which the base stick (n, 2, 2) moved permanently in the picture, and the steps' sizes, px.

    A bumped camera shifts both base markers. Where one of them does not move, the other was misread or has come off its
    stick.
    """
    known = np.flatnonzero(_seen(base_px).all(axis=1))
    if len(known) < 2 * SIDE + 1:
        return []
    step_px = np.linalg.norm(steps_of_mean(base_px[known], SIDE), axis=-1).min(axis=1)
    largest = [begin + int(np.argmax(step_px[begin:end])) for begin, end in runs(step_px > _BUMP_PX)]
    return [(int(known[at + SIDE]), float(step_px[at])) for at in largest]


def upright(position: Floats, covariance: Floats, *, pixel: float = 1.0) -> tuple[Floats, Floats]:
    """Return positions (n, 4, 2) rotated about the base's middle so that the base keeps its direction: camera roll.

    Also the variance (n,) of the rotation angle, zero where nothing is rotated. Positions have the shift removed, and
    are in square pixels or rays; ``covariance`` (n, 4, 2, 2) and ``pixel`` are as for :func:`picture_shift`.
    """
    offset = position[:, 1] - position[:, 0]
    known, nothing = _seen(offset), np.zeros(len(position))
    if not known.any():
        return position, nothing
    usual = np.median(offset[known], axis=0)
    along, across = offset @ usual, offset @ np.array([-usual[1], usual[0]])
    noise = 0.5 * np.trace(covariance[:, 0] + covariance[:, 1], axis1=1, axis2=2) / float(usual @ usual)
    noise *= max(_lengths(position, covariance, 0).scale, 1.0) ** 2
    turn, variance = _followed(np.arctan2(across, along), noise)
    felt = (_FELT_PX * pixel) ** 2 / float(usual @ usual)
    if not np.var(turn[known]) > max(_MOVED**2 * float(np.median(noise[known])), felt):
        return position, nothing
    pivot = np.median(position[known, :2].mean(axis=1), axis=0)
    return pivot + turned_by(position - pivot, -turn[:, None]), variance


def _seen(points: Floats) -> Flags:
    """Return whether both coordinates of points (..., 2) are known."""
    return np.asarray(np.isfinite(points).all(axis=-1), dtype=np.bool_)


def _middle(base: Floats) -> Floats:
    """Return the stick's middle (n, 2); where one marker alone is seen, by interpolation of the stick's offset."""
    offset = base[:, 1] - base[:, 0]
    both = _seen(offset)
    if not both.any():
        return np.full((len(base), 2), np.nan)
    # The offset is interpolated, not its median taken: camera roll turns the stick.
    half = 0.5 * np.stack([bridged(part) for part in offset.T], axis=1)
    one = np.where(np.isfinite(base[:, 0]), base[:, 0] + half, base[:, 1] - half)
    return np.where(both[:, None], base.mean(axis=1), one)


def _noise(base: Floats, covariance: Floats) -> Floats:
    """Return the variance of the middle along both axes (n, 2), from the fits' covariances; NaN where not seen."""
    own = np.diagonal(covariance, axis1=-2, axis2=-1)
    seen = _seen(base)
    total = np.where(seen[..., None], own, 0.0).sum(axis=1)
    count = seen.sum(axis=1)[:, None]
    return np.where(count > 0, total / np.maximum(count, 1) ** 2, np.nan)


def _followed(away: Floats, noise: Floats) -> tuple[Floats, Floats]:
    """Return a coordinate (n,) averaged as far as it is steady, and its variance (n,).

    Gaps, over a bump while the base was hidden, are interpolated; the squared step over each is added to its variance.
    """
    smooth, variance = steady_direction(away, noise)
    known = np.isfinite(away)
    usual = float(np.median(noise[known]))
    # Frames far from the average keep their own value: the instant of a bump.
    apart = known & ~(np.abs(away - smooth) < BY_CHANCE * np.sqrt(usual))
    smooth, variance = np.where(apart, away, smooth), np.where(apart, noise, variance)
    gap = np.isnan(smooth)
    inside = np.flatnonzero(~gap)
    after = np.clip(np.searchsorted(inside, np.arange(len(smooth))), 0, len(inside) - 1)
    across = (smooth[inside[after]] - smooth[inside[np.maximum(after - 1, 0)]]) ** 2
    return bridged(smooth), np.where(gap, across + np.median(variance[inside]), variance)
