"""Motion blur of one patch, and the exposure as a share of the frame interval, learnt from it."""

from __future__ import annotations

import math

import numpy as np

from torsight.core.units import Floats
from tracker.appearance.lucas_kanade import SHARP_PX
from tracker.appearance.motion_blur import EXPOSURE, SHARES, is_due, learn_exposure
from tracker.checkpoint import Kept
from tracker.patches.align import Fit, Patch, Smear
from tracker.patches.warps import carried, project, twist

Seen = tuple[float, Floats]
"""Time of a frame, s, and the warp (3, 3) of a patch in it."""


class Exposure(Kept):
    """The exposure of the pictures of one patch.

    ``_own`` is the record of :mod:`tracker.appearance.motion_blur`, ``_frame_s`` the shortest interval between two
    frames: no exposure is longer. ``_first`` is the motion (3, 3) in the picture from which the template was taken,
    which is blurred itself; None before it is known.
    """

    kept = ("_own", "_frame_s", "_first")

    def __init__(self, *, drawn: bool) -> None:
        self._own, self._frame_s = np.zeros(1, EXPOSURE), math.inf
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
        first, share = self._first, float(self._own["share"][0])
        if not share or first is None:
            return None
        own = _smeared(patch, first, share)
        return lambda warp: _smeared(patch, self.motion(before, (time_s, warp)), share) - own

    def learn(self, patch: Patch, fit: Fit, before: Seen, time_s: float) -> bool:
        """Compare the exposures in the next picture of a patch; return whether one is known for the first time."""
        motion, own = self.motion(before, (time_s, fit.warp)), self._own[0]
        if self._first is None:
            self._first = motion
        moved_px, known = _moved_px(patch, motion), own["share"] > 0.0
        if moved_px < SHARP_PX or not is_due(own):
            return False
        added = [_smeared(patch, motion, share) - _smeared(patch, self._first, share) for share in SHARES]
        learn_exposure(own, _misfits(patch, fit, np.array(added)), moved_px / (2.0 * patch.half_px))
        return bool(own["share"] > 0.0) and not known


def _moved_px(patch: Patch, motion: Floats) -> float:
    """Return the largest coordinate of the rim's motion (3, 3) in the template's plane, px."""
    return float(np.abs(project(carried(motion), patch.rim) - patch.rim).max())


def _smeared(patch: Patch, motion: Floats, share: float) -> Floats:
    """Return what motion blur by a ``share`` of a motion (3, 3) adds to the template, on its whole grid (side²,)."""
    count = round(share * _moved_px(patch, motion) / patch.spacing_px) + 1
    if count == 1:
        return np.zeros_like(patch.middle)
    # As many points as these have the variance of the whole exposure.
    instants = share * (np.arange(count) - 0.5 * (count - 1)) / math.sqrt(count**2 - 1)
    seen = [patch.look(*project(carried(-instant * motion), patch.grid)) for instant in instants]
    return np.asarray(np.mean(seen, axis=0) - patch.middle)


def _misfits(patch: Patch, fit: Fit, added: Floats) -> Floats:
    """Return the rms residuals (m,), over the gain, of a fit to the template with each of ``added`` (m, side²)."""
    root = np.sqrt(fit.weight)
    q = np.linalg.qr(root[:, None] * patch.blurring)[0]
    left = root * (fit.left + fit.smear - added[:, patch.index])
    return np.asarray(np.sqrt(np.sum(np.square(left - (left @ q) @ q.T), axis=1) / fit.weight.sum()))
