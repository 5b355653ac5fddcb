"""Exposure as a share of the frame interval, learnt from the motion blur of one patch."""

from __future__ import annotations

import math

import numpy as np

from torsight.core.units import Floats
from tracker.appearance.lucas_kanade import RATE, SHARP_PX
from tracker.appearance.motion_blur import CLEAR, LEARNED
from tracker.checkpoint import Kept
from tracker.patches.align import SHARES, Fit, Patch, Smear
from tracker.patches.warps import twist

Seen = tuple[float, Floats]
"""Time of a frame, s, and the warp (3, 3) of a patch in it."""


class Exposure(Kept):
    """The exposure of the pictures of one patch.

    ``share`` is the exposure of the least misfit, ``_misfit`` the running mean of the logarithm of the residual at
    each of ``SHARES`` with the total weight ``_looks``, in which a motion over the whole patch counts fully.
    ``_fast`` counts the pictures in motion. ``_frame_s`` is the shortest interval between two frames: no exposure is
    longer. ``_first`` is the motion (3, 3) in the picture from which the template was taken, which is blurred itself;
    None before it is known.
    """

    kept = ("share", "_misfit", "_looks", "_fast", "_frame_s", "_first")

    def __init__(self, *, drawn: bool) -> None:
        self.share, self._looks, self._frame_s = 0.0, 0.0, math.inf
        self._misfit, self._fast = np.zeros(len(SHARES)), 0
        self._first: Floats | None = np.zeros((3, 3)) if drawn else None

    def motion(self, before: Seen, now: Seen) -> Floats:
        """Return the motion (3, 3) of the template's plane, per frame, between two frames."""
        (start_s, start), (end_s, end) = before, now
        if end_s <= start_s:
            return np.zeros((3, 3))
        self._frame_s = min(self._frame_s, end_s - start_s)
        return self._frame_s / (end_s - start_s) * twist(start, end)

    def smear(self, patch: Patch, before: Seen, time_s: float) -> Smear | None:
        """Return what motion blur since a frame adds to a template; None where no exposure is known."""
        first, share = self._first, self.share
        if not share or first is None:
            return None
        own = patch.smear(first, share)
        return lambda warp: patch.smear(self.motion(before, (time_s, warp)), share) - own

    def learn(self, patch: Patch, fit: Fit, before: Seen, time_s: float) -> bool:
        """Compare the exposures in the next picture of a patch; return whether one is known for the first time."""
        motion, known = self.motion(before, (time_s, fit.warp)), self.share > 0.0
        if self._first is None:
            self._first = motion
        moved_px = patch.moved_px(motion)
        if moved_px < SHARP_PX:
            return False
        # A comparison costs as much as several frames, and the exposure seldom changes.
        self._fast += 1
        if self._fast % (1 + self._fast // LEARNED):
            return False
        misfit = np.log(patch.misfits(fit, patch.smears(motion) - patch.smears(self._first)))
        look = min(1.0, (moved_px / (2.0 * patch.half_px)) ** 2)
        self._looks += look * (1.0 - RATE * self._looks)
        self._misfit += look / self._looks * (misfit - misfit[0] - self._misfit)
        best = int(np.argmin(self._misfit))
        self.share = float(SHARES[best]) if self._misfit[best] < -CLEAR else 0.0
        if self.share and best < len(SHARES) - 1:
            near = slice(best - 1, best + 2)
            bend, slope, _ = np.polyfit(SHARES[near], self._misfit[near], 2)
            self.share = float(-0.5 * slope / bend)
        return self.share > 0.0 and not known
