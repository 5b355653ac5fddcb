"""The picture as a camera would show it that was not moved: the base stick says by how much it was.

A camera that is bumped, sags or shakes shifts the whole picture. Directions do not mind, but the axis is no longer
where it was: circles that shift meanwhile look like ellipses, and so like a tilt. The base stick is fixed, so its
motion is the picture's, and is taken out of all positions. So is what both sticks' lengths do together: a camera that
comes nearer makes all of the picture larger. Where it moves by no more than its own noise nothing is taken out: its
noise would only be added to the others'.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from torsight.core.optics.camera import Intrinsics
from torsight.core.optics.geometry import pixel_from_ray, ray_from_pixel
from torsight.core.optics.hanging import USUAL_PX
from torsight.core.series import BY_CHANCE, runs
from torsight.core.tracks import MarkerTracks
from torsight.core.units import Flags, Floats
from tracker.angle.length_noise import LEAST_FRAMES, LengthWitness, by_direction, witness
from tracker.angle.reference_direction import SIDE, steady_direction, steps_of_mean
from tracker.follow.camera_state import SHAKE_PX
from tracker.innovation import SIGMAS

_MOVED: Final = 1.5
"""Motion (rms over the film) over the noise of one frame from which it is taken out."""
_FELT_PX: Final = 5.0 * USUAL_PX
"""Motion from which it is taken out: compression moves a marker at rest by a fifth of this."""
_START: Final = 0.1
"""Share of the film, at its beginning, where the base is in its place: a camera is calibrated before it is moved."""
_BUMP_PX: Final = 1.5 * SHAKE_PX
"""Step of the base's place from which the camera counts as moved: half as much again as the standard deviation of the
shaking that is asked of the tracker."""


@dataclass(frozen=True, slots=True, eq=False)
class Unmoved:
    """What a camera that was not moved would have seen.

    ``tracks`` are without the shift; what is not known of it while the base is hidden is in the covariance of a moving
    marker that is seen alone: the direction from both does not need it. ``paths`` are turned back about the base as
    well, where the camera was rolled: for the circles of the moving markers (angles are taken against the base in any
    case, and have its errors counted there). A circle needs the place: what is not known of shift and turn while the
    base is hidden is in the covariance of all of them. ``shift_px2`` (n,) is the variance, along each axis, of the
    shift that was taken out, an error that all markers of a frame share; ``turn_rad2`` (n,) that of what ``paths`` are
    turned back by.
    """

    tracks: MarkerTracks
    paths: MarkerTracks
    shift_px2: Floats
    turn_rad2: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Shift:
    """By how much the picture is shifted in every frame from its place at the start: ``step`` (n, 2).

    It is interpolated where the base is not seen. ``variance`` (n,) is of the step along the axis that is known worse;
    ``loose`` (n,) the same where the base is not seen, and nought elsewhere.
    """

    step: Floats
    variance: Floats
    loose: Floats


def unmoved(tracks: MarkerTracks, intrinsics: Intrinsics | None = None, *, pixel_aspect: float = 1.0) -> Unmoved:
    """Return tracks as a camera that was not moved would have seen them.

    With a lens the motion is taken out of the rays, which is what a small turn of the camera does; without one, out of
    the picture.
    """
    flat, covariance, pixel = flattened(tracks, intrinsics, pixel_aspect)
    flat, size_variance = as_far(flat, covariance, pixel=pixel)
    hidden = np.asarray(np.isnan(flat[:, :2, 0]).all(axis=1))
    nothing = np.zeros(len(tracks))
    if size_variance.any():
        tracks = replace(tracks, position_px=_in_picture(flat, intrinsics, pixel_aspect))
    shift = picture_shift(flat[:, :2], covariance[:, :2], pixel=pixel)
    if shift is None:
        shift = Shift(np.zeros((len(tracks), 2)), nothing, nothing)
        if not size_variance.any():
            return Unmoved(tracks, tracks, nothing, nothing)
    flat = flat - shift.step[:, None]
    seen = _seen(flat)
    alone = (seen[:, 2] != seen[:, 3]) * shift.loose / pixel**2
    spread = tracks.covariance_px2.copy()
    spread[:, 2:] += alone[:, None, None, None] * np.eye(2)
    still = replace(tracks, position_px=_in_picture(flat, intrinsics, pixel_aspect), covariance_px2=spread)
    turned, turn_rad2 = upright(flat, covariance, pixel=pixel)
    away2 = np.sum(np.square(flat - np.nanmedian(_middle(flat[:, :2]), axis=0)), axis=-1)
    off = shift.loose[:, None] + (turn_rad2 + size_variance)[:, None] * away2
    shared_px2 = np.where(hidden[:, None], off, 0.0) / pixel**2
    paths = replace(
        still,
        position_px=_in_picture(turned, intrinsics, pixel_aspect),
        covariance_px2=tracks.covariance_px2 + shared_px2[..., None, None] * np.eye(2),
    )
    return Unmoved(still, paths, shift.variance / pixel**2, turn_rad2)


def flattened(tracks: MarkerTracks, intrinsics: Intrinsics | None, pixel_aspect: float) -> tuple[Floats, Floats, float]:
    """Return rays, or positions in square pixels (n, 4, 2), their covariances, and the size of a pixel among them."""
    if intrinsics is None:
        stretch = np.array([pixel_aspect, 1.0])
        return tracks.position_px * stretch, tracks.covariance_px2 * np.outer(stretch, stretch), 1.0
    rays, slopes = ray_from_pixel(tracks.position_px, intrinsics)
    covariance = np.asarray(slopes @ tracks.covariance_px2 @ np.swapaxes(slopes, -1, -2))
    return rays, covariance, 1.0 / float(intrinsics.matrix[0, 0])


def _in_picture(flat: Floats, intrinsics: Intrinsics | None, pixel_aspect: float) -> Floats:
    """Return the pixel positions of what :func:`flattened` makes of them."""
    return flat / np.array([pixel_aspect, 1.0]) if intrinsics is None else pixel_from_ray(flat, intrinsics)


def as_far(position: Floats, covariance: Floats, *, pixel: float = 1.0) -> tuple[Floats, Floats]:
    """Return positions (n, 4, 2) as from a camera that stays as far away, and the variance (n,) of their size.

    One that comes nearer makes both longer; their errors are independent. So the slope of the moving stick's length
    over the base's, beside what its direction makes of it, is the camera's share in the variance of the base's: of
    every change of the base that much is expected to be the camera's. It is taken out about the base's middle. The
    variance is zero where the camera has no share. ``covariance`` and ``pixel`` as for :func:`upright`.
    """
    base, moving = _lengths(position, covariance, 0), _lengths(position, covariance, 2)
    nothing = np.zeros(len(position))
    told = np.isfinite(base.residual) & ~base.outlier
    known = told & np.isfinite(moving.residual) & ~moving.outlier
    if known.sum() < LEAST_FRAMES:
        return position, nothing
    longer = np.where(told, base.residual / base.length, np.nan)
    offset = position[known, 3] - position[known, 2]
    beside = np.column_stack([by_direction(np.arctan2(offset[:, 1], offset[:, 0])), longer[known]])
    slope = np.linalg.lstsq(beside, np.hypot(*offset.T) / moving.length, rcond=None)[0][-1]
    share, changed = float(np.clip(slope, 0.0, 1.0)), float(np.var(longer[known]))
    if not share * changed > max(_MOVED**2 * (1.0 - share) * changed, (_FELT_PX * pixel / base.length) ** 2):
        return position, nothing
    noise = 0.5 * np.trace(covariance[:, 0] + covariance[:, 1], axis1=1, axis2=2) / base.length**2
    size, variance = _followed(share * longer, noise)
    middle, index = _middle(position[:, :2]), np.arange(len(position))
    seen = np.flatnonzero(_seen(middle))
    # While the base is not seen it goes with the picture.
    about = np.stack([np.interp(index, seen, part[seen]) for part in middle.T], axis=1)[:, None]
    return np.asarray(about + (position - about) / (1.0 + size)[:, None, None]), variance


def _lengths(position: Floats, covariance: Floats, first: int) -> LengthWitness:
    """Return what the length of the stick with these two markers says, in all frames alike."""
    inner, outer = ((position[:, marker], covariance[:, marker]) for marker in (first, first + 1))
    return witness(inner[0], outer[0], inner[1], outer[1], moves=np.ones(len(position), np.bool_), turns=first > 0)


def picture_shift(base: Floats, covariance: Floats, *, pixel: float = 1.0) -> Shift | None:
    """Return by how much the base stick is off its place at the start; None where that is no more than noise.

    A camera that moves takes both markers (n, 2, 2), NaN where not seen, along: where one alone goes astray it was
    misread. ``covariance`` (n, 2, 2, 2) is that of the fits, ``pixel`` the size of a pixel in the unit of the
    positions.
    """
    place = _middle(base)
    known = np.isfinite(place[:, 0])
    if not known.any():
        return None
    noise = _noise(base, covariance) * max(_lengths(base, covariance, 0).scale, 1.0) ** 2
    start = _at_the_start(place[known])
    step, variance = np.zeros_like(place), np.zeros(len(place))
    for axis in range(2):
        away = place[:, axis] - start[axis]
        step[:, axis], spread = _followed(away, noise[:, axis])
        variance = np.maximum(variance, spread)
    offset = base[:, 1] - base[:, 0]
    # A quarter of its variance is what one marker that goes astray alone would give the middle.
    usual = np.maximum(np.median(noise[known], axis=0), 0.25 * np.var(offset[_seen(offset)], axis=0))
    if not (np.var(step[known], axis=0) > np.maximum(_MOVED**2 * usual, (_FELT_PX * pixel) ** 2)).any():
        return None
    return Shift(step, variance, np.where(known, 0.0, variance))


def bumps(base_px: Floats) -> list[tuple[int, float]]:
    """Return the frames in which the base stick (n, 2, 2) has moved in the picture for good, and by how much, px.

    A camera that is moved takes both base markers along. Where one of them stands still the other was misread, or has
    come off its stick.
    """
    known = np.flatnonzero(_seen(base_px).all(axis=1))
    if len(known) < 2 * SIDE + 1:
        return []
    step_px = np.linalg.norm(steps_of_mean(base_px[known], SIDE), axis=-1).min(axis=1)
    largest = [begin + int(np.argmax(step_px[begin:end])) for begin, end in runs(step_px > _BUMP_PX)]
    return [(int(known[at + SIDE]), float(step_px[at])) for at in largest]


def upright(position: Floats, covariance: Floats, *, pixel: float = 1.0) -> tuple[Floats, Floats]:
    """Return positions (n, 4, 2) turned back about the base stick by as much as that is turned: a camera was rolled.

    Also the variance (n,) of the turn, nought where nothing is turned. Positions are of an unmoved picture, in square
    pixels; ``covariance`` (n, 4, 2, 2) and ``pixel`` as for :func:`picture_shift`.
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
    cos, sin = np.cos(turn), np.sin(turn)
    back = np.stack([np.stack([cos, -sin], axis=-1), np.stack([sin, cos], axis=-1)], axis=-2)
    return np.asarray((position - pivot) @ back + pivot), variance


def _seen(points: Floats) -> Flags:
    """Return where both coordinates of points (..., 2) are known."""
    return np.asarray(np.isfinite(points).all(axis=-1), dtype=np.bool_)


def _middle(base: Floats) -> Floats:
    """Return the stick's middle (n, 2), also where one marker alone is seen."""
    offset = base[:, 1] - base[:, 0]
    both = _seen(offset)
    if not both.any():
        return np.full((len(base), 2), np.nan)
    # As the stick lies then: a camera that is rolled turns it.
    index = np.arange(len(base))
    half = 0.5 * np.stack([np.interp(index, index[both], part[both]) for part in offset.T], axis=1)
    one = np.where(np.isfinite(base[:, 0]), base[:, 0] + half, base[:, 1] - half)
    return np.where(both[:, None], base.mean(axis=1), one)


def _at_the_start(place: Floats) -> Floats:
    """Return where the stick is (2,) before the camera is moved, from its places (n, 2).

    A camera that shakes about one place is averaged for as long as it does; one that sags or is bumped is not.
    """
    count = max(1, round(_START * len(place)))
    while 2 * count <= len(place):
        apart = np.abs(place[count : 2 * count].mean(axis=0) - place[:count].mean(axis=0))
        if (apart > SIGMAS * np.sqrt(2.0 * np.var(place[: 2 * count], axis=0) / count)).any():
            break
        count *= 2
    return np.asarray(np.median(place[:count], axis=0))


def _noise(base: Floats, covariance: Floats) -> Floats:
    """Return the variance of the middle along both axes (n, 2), by what the fits say; NaN where it is not seen."""
    own = np.diagonal(covariance, axis1=-2, axis2=-1)
    seen = _seen(base)
    total = np.where(seen[..., None], own, 0.0).sum(axis=1)
    count = seen.sum(axis=1)[:, None]
    return np.where(count > 0, total / np.maximum(count, 1) ** 2, np.nan)


def _followed(away: Floats, noise: Floats) -> tuple[Floats, Floats]:
    """Return a coordinate (n,) averaged as far as it rests, and its variance; of all frames."""
    smooth, variance = steady_direction(away, noise)
    known = np.isfinite(away)
    usual = float(np.median(noise[known]))
    # Such a frame stands for itself: the instant of a bump.
    apart = known & ~(np.abs(away - smooth) < BY_CHANCE * np.sqrt(usual))
    smooth, variance = np.where(apart, away, smooth), np.where(apart, noise, variance)
    return _bridged(smooth, variance)


def _bridged(values: Floats, variance: Floats) -> tuple[Floats, Floats]:
    """Fill gaps (of a bump that was not seen) in between: what is on both sides of one differs by how it may be off."""
    known = np.flatnonzero(np.isfinite(values))
    index = np.arange(len(values))
    after = np.clip(np.searchsorted(known, index), 0, len(known) - 1)
    before = np.clip(after - 1, 0, None)
    gap = ~np.isfinite(values)
    across = (values[known[after]] - values[known[before]]) ** 2
    filled = np.where(gap, np.interp(index, known, values[known]), values)
    return filled, np.where(gap, across + np.median(variance[known]), variance)
