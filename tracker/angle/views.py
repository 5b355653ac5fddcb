"""Views of a rig in one film: a camera that is picked up and put down elsewhere sees it from another side.

Between the views the base turns in the picture. The tilt is that of one view; while the camera is carried it changes
from frame to frame, and is not known.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from torsight.core.series import BY_CHANCE, robust_sigma, runs
from torsight.core.tracks import MarkerTracks
from tracker.angle.reference_direction import SIDE, steps_of_mean
from tracker.follow.judgement import MOVED_RAD
from tracker.stick_direction import Points


class View(NamedTuple):
    """Frames ``first`` to ``end`` of a film, in which the camera stands or is ``carried``."""

    first: int
    end: int
    carried: bool

    @property
    def rank(self) -> tuple[bool, int]:
        """Its place among the views: those in which the camera stands come first, and of these the longest."""
        return not self.carried, self.end - self.first

    def of(self, tracks: MarkerTracks) -> MarkerTracks:
        """Return the tracks in these frames."""
        return _with_frames(tracks, *(values[self.first : self.end] for values in _by_frame(tracks)))


def joined(parts: Sequence[MarkerTracks]) -> MarkerTracks:
    """Return the tracks of successive parts of one film."""
    return _with_frames(parts[0], *map(np.concatenate, zip(*map(_by_frame, parts), strict=True)))


def _by_frame(tracks: MarkerTracks) -> tuple[NDArray[Any], ...]:
    return tracks.frame, tracks.time_s, tracks.position_px, tracks.covariance_px2, tracks.valid


def _with_frames(tracks: MarkerTracks, *by_frame: NDArray[Any]) -> MarkerTracks:
    frame, time_s, position_px, covariance_px2, valid = by_frame
    return replace(
        tracks, frame=frame, time_s=time_s, position_px=position_px, covariance_px2=covariance_px2, valid=valid
    )


def views_of(tracks: MarkerTracks) -> list[View]:
    """Return the views of a film in their order, one for a camera that stays where it is."""
    offset = tracks.position_px[:, 1] - tracks.position_px[:, 0]
    known, count = np.flatnonzero(np.isfinite(offset).all(axis=1)), len(tracks)
    if len(known) <= 2 * SIDE:
        return [View(0, count, carried=False)]
    turn_rad = np.unwrap(np.arctan2(offset[known, 1], offset[known, 0]))
    steps = steps_of_mean(turn_rad, SIDE)
    # Second differences show the noise of single frames, whether the camera is carried or not.
    noise = robust_sigma(np.diff(turn_rad, 2)) / math.sqrt(6.0)
    # A camera that turns by as much as no base does changes the angle by half of it times the tilt: by 0.2 degrees at a
    # tilt of 20 degrees, up to which an estimated tilt counts as known. A camera that comes nearer keeps its tilt.
    limit = max(MOVED_RAD, BY_CHANCE * noise * math.sqrt(2.0 / SIDE))
    edges, whole = list[int](), np.array([-1, *known, count])
    for begin, end in runs(np.abs(steps) > limit):
        # The views reach as far as the base is as in their own frames beside the step.
        stop = end + 2 * SIDE - 1
        before, after = (
            begin + np.flatnonzero(np.abs(turn_rad[begin:stop] - turn_rad[at : at + SIDE].mean()) > limit)
            for at in (begin, stop - SIDE)
        )
        # Frames between them without the base are those in which it goes.
        edges += [whole[before[0]] + 1, whole[after[-1] + 2]]
    edges = [*np.maximum.accumulate(edges).tolist(), count]
    found, first = list[View](), 0
    for number, end in enumerate(edges):
        carried = number % 2 == 1 or end - first < SIDE
        if carried and found and found[-1].carried:
            found[-1] = found[-1]._replace(end=end)
        elif end > first:
            found.append(View(first, end, carried))
        first = end
    return found


def longest_view(tracks: MarkerTracks) -> MarkerTracks:
    """Return the tracks in the longest of the views."""
    return max(views_of(tracks), key=lambda one: one.rank).of(tracks)


def in_one_plane(views: list[View], planes: list[list[Points]]) -> list[Points]:
    """Return the positions in the planes of all views, one after the other, turned and scaled so that the base is one.

    While the camera is carried that holds frame by frame.
    """
    bases = [plane[1][0] - plane[0][0] for plane in planes]
    usual = [np.nanmedian(base, axis=0) if np.isfinite(base).any() else np.full(2, np.nan) for base in bases]
    first = next(base for base in usual if np.isfinite(base).all())
    found = []
    for view, plane, base, middle in zip(views, planes, bases, usual, strict=True):
        own = base if view.carried else np.broadcast_to(middle, base.shape)
        # NaN where the base is not seen.
        with np.errstate(invalid="ignore"):
            turn = complex(*first) / (own[:, 0] + 1j * own[:, 1])
        by = np.stack([np.stack([turn.real, -turn.imag], axis=-1), np.stack([turn.imag, turn.real], axis=-1)], axis=-2)
        found.append([(np.einsum("nij,nj->ni", by, at), by @ spread @ np.swapaxes(by, 1, 2)) for at, spread in plane])
    return [
        (np.concatenate([at for at, _ in marker]), np.concatenate([spread for _, spread in marker]))
        for marker in zip(*found, strict=True)
    ]
