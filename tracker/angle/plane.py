"""From positions in planes across the axis to the actuator angle: both sticks' directions and their variances."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np

from torsight.core.frozen import Frozen
from torsight.core.series import known_median
from torsight.core.tracks import MarkerTracks, StickAngles, mean_sigma
from torsight.core.units import DEG, Flags, Floats
from torsight.core.words.shown import Shown
from tracker.angle.length_noise import LengthWitness, in_motion, witness
from tracker.angle.reference_direction import steady_direction
from tracker.angle.single_marker import single_marker_direction
from tracker.angle.unwrap import unwrap
from tracker.repeated_pictures import over_repeats, repeats
from tracker.stick_direction import Points, stick_direction

FLOOR_PX: Final = 0.003
"""Position error by the pixels' own pattern, which no averaging removes: measured over radii of 3 to 12 px and sharp to
soft lenses."""

_FROZEN: Final = 0.8
"""Largest error that a codec freezes in a base at rest, over that of markers in motion: 0.43 to 0.79 for x264 at CRF 12
to 30, from its fastest preset to its default one, on the films of benchmarks/tracking/stereo.py."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Orientation(Frozen, Shown):
    """The angle of a film and how it was determined.

    Attributes
    ----------
    angles : StickAngles
        The actuator angle, frame by frame.
    position_mm : (n, 4, 3) float64 or None
        Markers in space, where a camera file gives the scale.
    report : mapping
        For ``track.json``: method, noise, tilt.
    error_scale : (n, 2) float64
        Errors of base and moving markers over the standard deviations of their fits, frame by frame.
    systematic_rad2 : (n,) float64 or None
        Part of the angle's variance that does not come from the positions: by the uncertainty of tilt and read-out.
    """

    angles: StickAngles
    position_mm: Floats | None
    error_scale: Floats
    report: Mapping[str, Any] = field(default_factory=dict)
    systematic_rad2: Floats | None = None

    def with_report(self, **entries: Any) -> Orientation:
        """Return the orientation with further entries for ``track.json``."""
        return replace(self, report={**self.report, **entries})

    def facts(self) -> dict[str, str]:
        """Return the angle, its uncertainty and the method."""
        return {**self.angles.facts(), "method": str(self.report.get("method", ""))}

    def _columns(self) -> dict[str, Any]:
        return dict(self.angles.to_frame())

    def _draw(self, axes: Any) -> None:
        self.angles.plot(axes)

    def with_errors(self, tracks: MarkerTracks) -> MarkerTracks:
        """Return the tracks with covariances scaled to the errors that the sticks' lengths show."""
        return replace(tracks, covariance_px2=scaled_covariance(tracks.covariance_px2, self.error_scale))


def scaled_covariance(covariance_px2: Floats, scale: Floats) -> Floats:
    """Return the covariances (n, 4, 2, 2) of the markers' positions, scaled by their sticks' errors, with the floor.

    ``scale`` (n, 2) holds the errors of base and moving markers over the standard deviations of their fits.
    """
    squared = np.repeat(scale, 2, axis=1)[..., None, None] ** 2
    return np.asarray(covariance_px2 * squared + FLOOR_PX**2 * np.eye(2))


def from_plane(
    tracks: MarkerTracks,
    plane: list[Points],
    *,
    position_mm: Floats | None,
    method: str,
    across: float = 1.0,
    systematic_rad2: Floats | None = None,
    errors: StickErrors | None = None,
) -> Orientation:
    """Return the angle from the markers' positions in planes across the axis.

    ``across`` is the ratio of the errors across the moving stick to those along it, which its length shows;
    ``systematic_rad2`` (n,) is variance of the angle that the positions do not show, such as by an unknown tilt.
    ``errors`` are those of the positions, by default from the lengths of the sticks over the whole film.
    """
    errors = errors or stick_errors(tracks, plane, across=across)
    base_scale, scale = errors.scale.T
    base_rad, base_variance = stick_direction(plane[0], plane[1])
    base_rad[errors.base.outlier] = np.nan
    moving = moving_direction(plane, scale, outlier=errors.moving.outlier)
    if systematic_rad2 is not None:
        moving = replace(moving, variance_rad2=moving.variance_rad2 + systematic_rad2)
    found = against_base(
        tracks,
        moving,
        (base_rad, base_variance * base_scale**2),
        errors=errors,
        floor_rad2=sum(floor_of(tracks)),
        position_mm=position_mm,
        method=method,
    )
    return replace(found, systematic_rad2=systematic_rad2)


@dataclass(frozen=True, slots=True, eq=False)
class StickErrors:
    """Errors of a film's positions, estimated from the lengths of both sticks and the moving one's circles.

    ``scale`` (n, 2) are the errors of base and moving markers over the standard deviations of their fits.
    """

    base: LengthWitness
    moving: LengthWitness
    scale: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Moving:
    """The moving stick's direction (n,) and its variance; NaN where not known.

    ``alone`` (n,) marks frames in which it comes from a single marker; ``bound_rad2`` is the median variance by the
    pictures' noise alone.
    """

    angle_rad: Floats
    variance_rad2: Floats
    alone: Flags
    bound_rad2: float


def stick_errors(tracks: MarkerTracks, plane: list[Points], *, across: float = 1.0) -> StickErrors:
    """Return the errors that the sticks' lengths show in planes across the axis; ``across`` as in `from_plane`."""
    base_moves, moves = in_motion(tracks.position_px[:, :2]), in_motion(tracks.position_px[:, 2:])
    base = witness(plane[:2], moves=base_moves)
    moving = witness(plane[2:], moves=moves)
    # The codec freezes the base's noise longest: its hidden error is inferred from the moving stick at rest.
    hidden = _FROZEN * moving.still
    of_base = np.where(base_moves, max(base.scale, moving.scale), max(base.still, hidden))
    of_moving = across * np.where(moves, moving.scale, moving.still)
    return StickErrors(base, moving, np.stack([of_base, of_moving], axis=1))


def joined_errors(parts: Sequence[StickErrors | None], counts: Sequence[int], main: int) -> StickErrors:
    """Return the errors in successive parts of a film, of which ``main`` is the longest, with their frames' ``counts``.

    Where a part has none they are as in the main one.
    """
    found, usual = [one or parts[main] for one in parts], parts[main]
    assert usual is not None  # noqa: S101 - for the type checker: the longest part has errors

    def whole(stick: int) -> LengthWitness:
        own = [(one.base, one.moving)[stick] if one else None for one in parts]
        flags = [
            np.zeros(count, np.bool_) if one is None else one.outlier for one, count in zip(own, counts, strict=True)
        ]
        left = [np.zeros(count) if one is None else one.residual for one, count in zip(own, counts, strict=True)]
        return replace((usual.base, usual.moving)[stick], residual=np.concatenate(left), outlier=np.concatenate(flags))

    scale = [
        np.broadcast_to(np.median(one.scale, axis=0), (count, 2)) if part is None else one.scale
        for one, part, count in zip(found, parts, counts, strict=True)
        if one is not None
    ]
    return StickErrors(whole(0), whole(1), np.concatenate(scale))


def moving_direction(plane: list[Points], scale: Floats, *, outlier: Flags | None = None) -> Moving:
    """Return the moving stick's direction from positions in planes across the axis, their errors times ``scale`` (n,).

    Frames of ``outlier`` (n,) are left out.
    """
    moving_rad, bound = stick_direction(plane[2], plane[3])
    if outlier is not None:
        moving_rad[outlier] = np.nan
    one_rad, one_rad2 = single_marker_direction((scaled(plane[2], scale), scaled(plane[3], scale)), moving_rad)
    one = np.isfinite(one_rad)
    return Moving(
        angle_rad=np.where(one, one_rad, moving_rad),
        variance_rad2=np.where(one, one_rad2, bound * scale**2),
        alone=one,
        bound_rad2=known_median(bound),
    )


def against_base(
    tracks: MarkerTracks,
    moving: Moving,
    base: Points,
    *,
    errors: StickErrors,
    floor_rad2: float,
    position_mm: Floats | None,
    method: str,
) -> Orientation:
    """Return the actuator angle: the moving stick's direction against the base's, which is averaged and interpolated.

    ``base`` is the base's direction (n,), NaN where not known, and its variance (n,); ``floor_rad2`` is variance that
    averaging does not reduce. ``errors``, ``position_mm`` and ``method`` are for the report.
    """
    steady_rad, steady_variance = steady_direction(_continuous(base[0]), base[1])
    variance = moving.variance_rad2 + steady_variance + floor_rad2 + tracks.choice_rad2
    angle_rad, certain = unwrap(tracks.time_s, moving.angle_rad - steady_rad)
    reached_px = mean_sigma(scaled_covariance(tracks.covariance_px2, errors.scale))
    repeated = repeats(tracks.position_px[:, 2:], reached_px[:, 2:])
    angle_rad, between_rad2 = over_repeats(tracks.time_s, angle_rad, repeated)
    variance = variance + between_rad2
    valid = np.isfinite(angle_rad) & np.isfinite(variance)
    angles = StickAngles(
        frame=tracks.frame,
        time_s=tracks.time_s,
        angle_rad=np.where(valid, angle_rad, np.nan),
        # Where the number of turns is not certain the angle may be off by one turn: the sigma includes that.
        sigma_rad=np.where(valid, np.sqrt(variance) + np.where(certain, 0.0, 2.0 * np.pi), np.nan),
        valid=valid,
        branch_certain=certain,
    )
    noise = {
        "error_over_white_noise": {"base": errors.base.scale, "moving": errors.moving.scale},
        "impossible_lengths": {"base": int(errors.base.outlier.sum()), "moving": int(errors.moving.outlier.sum())},
        "angle_bound_deg": float(np.sqrt(moving.bound_rad2)) / DEG if valid.any() else None,
    }
    report = {
        "method": method,
        "noise": noise,
        "from_one_marker": int((valid & moving.alone).sum()),
        "repeated_pictures": int(repeated.sum()),
    }
    return Orientation(angles, position_mm, errors.scale, report)


def variance_by(angle: Callable[[Floats], Floats], values: Floats, covariance: Floats) -> Floats:
    """Return the variance (n,) of an angle (n,) by the covariance (p, p) of the values (p,) that it is computed from.

    To first order, with central differences over one standard deviation of each value.
    """
    known = np.flatnonzero(np.diag(covariance) > 0.0)
    if not len(known):
        return np.zeros_like(angle(values))
    sigma = np.sqrt(np.diag(covariance)[known])
    steps = np.zeros((len(known), len(values)))
    steps[np.arange(len(known)), known] = sigma
    change = np.stack([angle(values + step) - angle(values - step) for step in steps], axis=-1)
    slopes = 0.5 * np.angle(np.exp(1j * change))
    # Slopes are per standard deviation, so that the values may have different units.
    correlation = covariance[np.ix_(known, known)] / np.outer(sigma, sigma)
    return np.asarray(np.einsum("ni,ij,nj->n", slopes, correlation, slopes))


def scaled(points: Points, scale: float | Floats) -> Points:
    """Return positions with their errors multiplied by ``scale``, one number or one for each frame (n,)."""
    return points[0], points[1] * np.reshape(scale, (-1, 1, 1)) ** 2


def floor_of(tracks: MarkerTracks) -> tuple[float, float]:
    """Return the variance of both sticks' directions that averaging does not reduce, rad²."""
    found: list[float] = []
    for first in (0, 2):
        offset = tracks.position_px[:, first + 1] - tracks.position_px[:, first]
        length = known_median(np.hypot(*offset.T))
        found.append(2.0 * FLOOR_PX**2 / length**2 if length > 0.0 else 0.0)
    return found[0], found[1]


def _continuous(angle_rad: Floats) -> Floats:
    """Return a direction (n,) that hardly changes, without jumps by whole turns."""
    known = np.isfinite(angle_rad)
    if not known.any():
        return angle_rad
    middle = np.angle(np.mean(np.exp(1j * angle_rad[known])))
    return np.asarray(middle + np.angle(np.exp(1j * (angle_rad - middle))), dtype=np.float64)
