"""Frames whose picture repeats the one before: of a film converted to another frame rate, or of a camera in low light.

A repeated picture shows the stick where it was, under a timestamp at which it was further on. A codec freezes a picture
in which little moves, so a repeat does not show in the pictures, but in the motion: between two steps in the same
direction the markers do not step at all.

A repeat stands in for a picture that is missing, and all others are at their timestamps: the step after it is longer.
Or it is inserted, and the step after it is as long as any: then all pictures were taken at another rate, of 24 a second
shown as 30, say, and each of them is shown up to a frame after it was taken.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from torsight.core.series import bridged, runs
from torsight.core.units import Flags, Floats
from tracker.innovation import SIGMAS

MOST: Final = 3
"""Most repeats of one picture: cameras fall to 7.5 pictures a second in low light, of the usual 30. A stick that rests
for longer between two steps is taken to rest."""


def repeats(position_px: Floats, sigma_px: Floats) -> Flags:
    """Return the frames (n,) in which the picture is a repeat, by the motion of the moving stick's markers.

    ``position_px`` (n, 2, 2) are the markers' positions, NaN where not seen, and ``sigma_px`` (n, 2) their standard
    deviations. In a film with repeats, frames without a step at a turning point, or at either end, are repeats, too.
    """
    step = np.diff(position_px, axis=0)
    size = np.linalg.norm(step, axis=-1)
    noise = SIGMAS * np.hypot(sigma_px[1:], sigma_px[:-1])
    known, found = np.isfinite(size).any(axis=1), np.zeros(len(position_px), bool)
    with np.errstate(invalid="ignore"):
        moves = size > 2.0 * noise
        stands, slow = (np.asarray((np.isnan(size) | (size <= limit)).all(axis=1)) for limit in (noise, 2.0 * noise))
    count = [0, 0]
    for kind, frames in enumerate((stands & known, slow & known & ~stands)):
        for first, end in runs(frames):
            if end - first > MOST:
                continue
            before, after = moves[first - 1] & (first > 0), moves[end % len(step)] & (end < len(step))
            ahead = before & after & (np.sum(step[first - 1] * step[end % len(step)], axis=-1) > 0.0)
            count[kind] += bool(ahead.any())
            if kind == 0:
                found[first + 1 : end + 1] = bool((before | after).any())
    # A jerky motion has steps of any size: as many of up to twice the noise as of up to the noise.
    return found & (count[0] > count[1] + SIGMAS * math.sqrt(count[1]))


def over_repeats(time_s: Floats, angle_rad: Floats, repeated: Flags) -> tuple[Floats, Floats]:
    """Return the angle (n,) interpolated over repeated pictures, and the variance (n,) that they add.

    The standard deviation in a repeat is the largest motion nearby since the picture was new: the stick may have
    stopped. Where repeats are inserted, every frame's angle may be that of an instant up to a frame before: uniformly
    distributed, with a third of the square of the frame's step as its mean square.
    """
    known = np.isfinite(angle_rad)
    new, again = np.flatnonzero(known & ~repeated), np.flatnonzero(known & repeated)
    between, variance = angle_rad.copy(), np.zeros(len(angle_rad))
    if len(again) and len(new) > 2:
        speed, before = np.diff(angle_rad[new]) / np.diff(time_s[new]), np.maximum(np.searchsorted(new, again) - 1, 0)
        step = np.minimum(before, len(speed) - 1)
        since_s = time_s[again] - time_s[new[before]]
        between[again] = angle_rad[again] + speed[step] * since_s
        fastest = np.abs(np.pad(speed, 1, mode="edge"))[step[:, None] + np.arange(3)].max(axis=1)
        variance[again] = np.square(fastest * since_s)
        if _are_inserted(angle_rad, repeated):
            variance += np.gradient(bridged(between)) ** 2 / 3.0
    return between, variance


def _are_inserted(angle_rad: Floats, repeated: Flags) -> bool:
    """Return whether the steps after repeats are as long as their neighbours, and not longer by the repeats."""
    off = np.zeros(2)
    for first, end in runs(repeated):
        around = np.arange(first - 2, first), np.arange(end, end + 2)
        index = np.concatenate(around)
        if index[0] >= 0 and index[-1] < len(angle_rad) and not repeated[index].any():
            before, across, after = np.diff(angle_rad[index])
            usual = 0.5 * (before + after)
            off += np.nan_to_num([(across - usual) ** 2, (across - (end - first + 1) * usual) ** 2])
    return bool(off[0] < off[1])
