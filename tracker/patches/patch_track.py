"""One patch from frame to frame: its predicted and its measured position."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from torsight.core.units import Floats
from tracker.appearance.lucas_kanade import RATE, Point
from tracker.checkpoint import Kept
from tracker.follow.judgement import SOON
from tracker.follow.motion_model import STALE
from tracker.patches.align import Fit, Patch
from tracker.patches.exposure import Exposure
from tracker.patches.ink import Doubt, Ink
from tracker.patches.warps import carried, twist
from tracker.rows import SEEN

AS_USUAL: Final = 0.05
"""A correlation less than this below the usual one is as good."""
_GOOD: Final = 1.0 - (1.0 - AS_USUAL) ** 2
"""Residual variance, over the template's, of a fit whose correlation is ``AS_USUAL`` below one."""
KEPT: Final = 0.7
"""Smallest share of a patch that has to be seen, so that an occluder of the rest is clearly in the minority."""

Judge = Callable[[Fit], str]
"""Takes a patch's fit, and returns the reason for rejecting it, empty where it is accepted."""


class PatchTrack(Kept):
    """A patch, its last warp, and its usual correlation.

    ``warp`` is that of the last frame in which the patch was seen, or the initial guess, ``ahead`` what was predicted
    for the last frame; ``lost`` counts frames since the patch was seen, ``followed`` is whether it ever was.
    ``usual`` and ``gain`` are running means of correlation and contrast, ``learnt`` the mean residuals of a drawn
    template, None for a template taken from the film; ``exposure`` is that of the pictures of the patch.
    """

    kept = ("warp", "lost", "usual", "gain", "learnt", "doubt", "_history", "followed", "exposure")

    def __init__(self, patch: Patch, warp: Floats) -> None:
        self.warp = self.ahead = warp
        self.lost = 0
        self.usual = self.gain = 1.0
        self._history: list[tuple[float, Floats]] = []
        self.followed = False
        self.exposure = Exposure(drawn=patch.soft)
        self.replace(patch, 1.0)

    def predict(self, time_s: float) -> Floats:
        """Return the patch's warp at a time, extrapolated from its last motion."""
        if len(self._history) < 2 or self.lost > STALE:
            return self.warp
        (t2, before), (t1, last) = self._history
        return last @ carried((time_s - t1) / (t1 - t2) * twist(before, last))

    def follow(self, luma: NDArray[np.uint8], time_s: float, judge: Judge) -> tuple[Fit | None, str]:
        """Return the patch's fit in the next frame, from the predicted warp, and why it is rejected (empty if not)."""
        self.ahead = self.predict(time_s)
        fit = self.near(luma, self.ahead, time_s)
        if fit is None:
            return None, "lost" if self.patch.in_picture(self.ahead, luma) else "outside"
        return fit, judge(fit)

    def near(self, luma: NDArray[np.uint8], guess: Floats, time_s: float) -> Fit | None:
        """Return the fit of the patch near a guess, blurred by its motion since the last frame."""
        before = self._history[-1] if self._history and not self.lost else None
        for _ in range(2):
            smear = self.exposure.smear(self.patch, before, time_s) if before else None
            fit = self.patch.align(luma, guess, self.learnt, self.doubt, smear)
            # A first look at the motion blur is a reason to look again.
            if fit is None or before is None or not self.exposure.learn(self.patch, fit, before, time_s):
                break
            guess = fit.warp
        return fit

    def take(self, time_s: float, fit: Fit) -> None:
        """Accept a fit: update warp, usual correlation and residuals."""
        if self.lost:
            self._history = self._history[-1:] if self.lost <= SOON else []
        self.usual += RATE * (fit.likeness - self.usual) if self.followed else fit.likeness - self.usual
        self.gain += RATE * (fit.gain - self.gain)
        if self.learnt is not None:
            self.learnt.take(fit.left, fit.weight, fit.residual / fit.gain)
        if self.doubt is not None:
            self.doubt.take(fit.left, fit.weight)
        self.warp, self.lost, self.followed = fit.warp, 0, True
        self._history = [*self._history[-1:], (time_s, fit.warp)]

    def replace(self, patch: Patch, size: float) -> None:
        """Replace the template by one of the same object that is ``size`` times as large."""
        self.patch = patch
        self.learnt = Ink(patch.count) if patch.soft else None
        self.doubt = None if patch.soft else Doubt(patch.count, _GOOD * patch.spread**2)
        smaller = np.diag([1.0 / size, 1.0 / size, 1.0])
        self.warp = self.warp @ smaller
        self._history = [(time_s, warp @ smaller) for time_s, warp in self._history]

    def miss(self) -> None:
        """Count a frame in which the patch was not seen."""
        self.lost += 1


def put(readings: NDArray[np.void], index: int, fit: Fit, at: Point, covariance: Floats, *, spread: float) -> None:
    """Store a fit as the reading of a marker, at position ``at`` with a covariance (2, 2), px and px²."""
    own = readings[index]
    own["x"], own["y"] = at
    own["covariance"] = covariance[0, 0], covariance[0, 1], covariance[1, 1]
    own["light"], own["contrast"], own["step"] = fit.light, fit.gain, fit.gain * 2.0 * spread
    own["residual"], own["state"] = fit.residual, SEEN
