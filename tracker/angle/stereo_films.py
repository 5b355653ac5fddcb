"""Both films of a stereo pair: which frames belong together, and which markers are the same point in both."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from torsight.core.errors import NoResultError
from torsight.core.optics.camera import Camera, Intrinsics, Pose, RightCamera, require_second, require_size
from torsight.core.optics.circles import Sight, axis_basis
from torsight.core.optics.geometry import (
    SpacePoints,
    epipolar_distance_px,
    rotation_matrix,
    rotation_vector,
    triangulate,
)
from torsight.core.series import BY_CHANCE, known_median, robust_sigma
from torsight.core.tracks import MARKERS, MarkerTracks
from torsight.core.units import Flags, Floats, Ints
from tracker.angle.camera_motion import unmoved
from tracker.angle.length_noise import LEAST_FRAMES, in_motion
from tracker.angle.plane import StickErrors, scaled_covariance
from tracker.stick_direction import Points

MISREAD: Final = BY_CHANCE**2
"""χ², over the usual one, above which a marker was misread or is not the same point in both films."""
_APART: Final = 0.2
"""Distance from the other film's epipolar line, over the stick's length, above which two positions are not of the same
marker: exchanged markers are about the stick's length away from it, those of a badly calibrated pair a few pixels."""


@dataclass(frozen=True, slots=True, eq=False)
class Film:
    """One film of the pair, with its camera's motion removed, resampled to the left film's frames.

    ``rotation`` and ``shift`` take points from the left camera's coordinates to those of this film's camera;
    ``shift_px2`` and ``turn_rad2`` (n,) are the variances of the camera motion that was removed.
    """

    tracks: MarkerTracks
    intrinsics: Intrinsics
    rotation: Floats
    shift: Floats
    shift_px2: Floats
    turn_rad2: Floats

    @property
    def camera(self) -> RightCamera:
        """The camera, as the second one of the pair."""
        return RightCamera(self.intrinsics, rotation_vector(self.rotation), self.shift)

    @property
    def covariance_px2(self) -> Floats:
        """Each marker's covariance (n, 4, 2, 2), with the shift's variance added but for the base, which defines it."""
        covariance = self.tracks.covariance_px2.copy()
        covariance[:, 2:] += self.shift_px2[:, None, None, None] * np.eye(2)
        return covariance

    def pose(self, direction: Floats, point: Floats) -> Pose:
        """Return this camera's pose relative to a world whose z axis is the rotation axis."""
        u, v = axis_basis(direction)
        turn = self.rotation @ np.stack((u, v, direction), axis=1)
        return Pose(rotation_vector(turn), self.rotation @ point + self.shift, 0.0, 0.0)

    def sight(self) -> Sight:
        """Return the lines of sight to the moving stick's markers."""
        return Sight.of(
            self.tracks.position_px[:, 2:],
            self.tracks.covariance_px2[:, 2:],
            self.intrinsics,
            shared_px2=self.shift_px2,
            rotation=self.rotation,
            shift=self.shift,
        )

    def without(self, gone: Flags) -> Film:
        """Return the film with the positions ``gone`` (n, 4) removed."""
        tracks = replace(
            self.tracks,
            position_px=np.where(gone[..., None], np.nan, self.tracks.position_px),
            covariance_px2=np.where(gone[..., None, None], np.nan, self.tracks.covariance_px2),
            valid=self.tracks.valid & ~gone,
        )
        return replace(self, tracks=tracks)

    def scaled(self, errors: StickErrors) -> Film:
        """Return the film with covariances scaled by its sticks' lengths, without sticks of impossible length."""
        covariance = scaled_covariance(self.tracks.covariance_px2, errors.scale)
        gone = np.repeat(np.stack((errors.base.outlier, errors.moving.outlier), axis=1), 2, axis=1)
        return replace(self, tracks=replace(self.tracks, covariance_px2=covariance)).without(gone)


def films_of(left: MarkerTracks, right: MarkerTracks, camera: Camera) -> list[Film]:
    """Return both films in the frames of the left one, with each camera's motion removed.

    Raises ConfigError when the camera file has no second camera, or is for another picture size.
    """
    second = require_second(camera, where=camera.source)
    require_size(camera, left.size_px, film="the left film")
    require_size(camera, right.size_px, film="the right film", right=second)
    other = _matching(left, right)
    there = other >= 0
    films = []
    for tracks, intrinsics, rotation, shift, rows in (
        (left, camera.intrinsics, np.eye(3), np.zeros(3), np.arange(len(left))),
        (right, second.intrinsics, rotation_matrix(second.rvec), second.tvec_mm, other),
    ):
        still = unmoved(tracks, intrinsics)
        paths = replace(
            left,
            position_px=still.paths.position_px[rows],
            # Unscaled: the variance of the shift is added later, as an error that both markers share.
            covariance_px2=tracks.covariance_px2[rows],
            valid=tracks.valid[rows],
            size_px=tracks.size_px,
            choice_rad2=tracks.choice_rad2,
        )
        films.append(Film(paths, intrinsics, rotation, shift, still.shift_px2[rows], still.turn_rad2[rows]))
    return [films[0], films[1].without(np.broadcast_to(~there[:, None], (len(left), 4)))]


def _matching(left: MarkerTracks, right: MarkerTracks) -> Ints:
    """Return the index (n,) of each left frame's simultaneous right frame; −1 where none is within half a frame."""
    nearest = np.clip(np.searchsorted(right.time_s, left.time_s), 1, max(1, len(right) - 1))
    nearest = np.minimum(nearest, len(right) - 1)
    before = np.maximum(nearest - 1, 0)
    closer = np.abs(right.time_s[before] - left.time_s) <= np.abs(right.time_s[nearest] - left.time_s)
    index = np.where(closer, before, nearest).astype(np.int64)
    step_s = float(np.median(np.diff(left.time_s))) if len(left) > 1 else np.inf
    return np.where(np.abs(right.time_s[index] - left.time_s) <= 0.5 * step_s, index, -1)


def triangulated(films: list[Film]) -> SpacePoints:
    """Return the markers (n, 4) in space."""
    left, right = films
    return triangulate(
        left.tracks.position_px,
        right.tracks.position_px,
        left=left.intrinsics,
        right=right.camera,
        left_covariance_px2=left.covariance_px2,
        right_covariance_px2=right.covariance_px2,
    )


def same_points(films: list[Film]) -> tuple[list[Film], SpacePoints]:
    """Return the films without markers that are not the same point in both, and the points in space.

    Raises NoResultError when a marker is never seen in both films simultaneously, or is not the same point in both.
    """
    space = triangulated(films)
    for marker, name in enumerate(MARKERS):
        if not np.isfinite(space.chi_squared[:, marker]).any():
            raise NoResultError(
                "is never seen in both films at once",
                where=f"stereo pair, {name.replace('_', ' ')} marker",
                do="check that both films show the rig and start at the same time",
            )
    _require_same_markers(films)
    # Compression makes errors larger than the fits' covariances in all frames: hence χ² relative to its usual value.
    usual = _usual(space.chi_squared, in_motion(films[0].tracks.position_px[:, 2:]))
    off = space.chi_squared > MISREAD * max(1.0, usual)
    films = [film.without(off) for film in films]
    return films, replace(space, position_mm=np.where(off[..., None], np.nan, space.position_mm))


def _require_same_markers(films: list[Film]) -> None:
    """Raise an error for films whose markers have different names, or a camera file of another pair."""
    left, right = films
    distance = epipolar_distance_px(
        left.tracks.position_px, right.tracks.position_px, left=left.intrinsics, right=right.camera
    )
    position = left.tracks.position_px
    limit_px = _APART * known_median(np.linalg.norm(position[:, 1::2] - position[:, ::2], axis=-1))
    for marker, name in enumerate(MARKERS):
        apart_px = known_median(distance[:, marker].max(axis=-1))
        if apart_px > limit_px:
            raise NoResultError(
                "is not the same point in both films",
                where=f"stereo pair, {name.replace('_', ' ')} marker",
                value=f"{apart_px:.1f} px beside the line on which the other film puts it",
                limit=f"{limit_px:.1f} px",
                do="check that the camera file is of this pair, that left and right are not exchanged, and that the "
                "marker file names inner and outer, base and moving markers as they are found without it",
            )


def _usual(chi_squared: Floats, moves: Flags) -> float:
    """Return the usual size of χ² (n, 4), or that in motion where it is larger: at rest a codec freezes noise."""
    known = np.isfinite(chi_squared)
    if not known.any():
        return np.nan
    usual = robust_sigma(np.sqrt(chi_squared[known])) ** 2
    known[~moves] = known[:, :2] = False
    return max(usual, robust_sigma(np.sqrt(chi_squared[known])) ** 2) if known.sum() >= LEAST_FRAMES else usual


def fused(planes: list[list[Points]]) -> list[Points]:
    """Return each marker's mean position over the cameras that see it, weighted by inverse covariance."""
    fused = []
    for marker in range(4):
        total, weighted = np.zeros((len(planes[0][marker][0]), 2, 2)), np.zeros((len(planes[0][marker][0]), 2))
        for plane in planes:
            position, covariance = plane[marker]
            known = np.asarray(np.isfinite(position).all(axis=1) & np.isfinite(covariance).all(axis=(1, 2)))
            weight = np.linalg.inv(np.where(known[:, None, None], covariance, np.eye(2))) * known[:, None, None]
            total += weight
            weighted += np.einsum("nij,nj->ni", weight, np.where(known[:, None], position, 0.0))
        seen = np.asarray(total[:, 0, 0] > 0.0)
        covariance = np.linalg.inv(np.where(seen[:, None, None], total, np.eye(2)))
        covariance[~seen] = np.nan
        fused.append((np.einsum("nij,nj->ni", covariance, weighted), covariance))
    return fused
