"""One patch from frame to frame: its predicted and its measured position."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from torsight.core.units import Floats
from tracker.appearance.lucas_kanade import RATE, Point
from tracker.checkpoint import Kept
from tracker.follow.judgement import SOON
from tracker.follow.motion_model import STALE
from tracker.patches.align import Fit, Patch, cut_out
from tracker.patches.ink import Doubt, Ink
from tracker.patches.warps import place, similarity, size_of, turn_of
from tracker.rows import SEEN

_REACH_PX: Final = 32
"""Largest motion of a patch between two frames: twice the fastest motion that the tracker is required to follow."""
_LEVELS: Final = 3
"""Pyramid levels of the optical flow: with windows of 21 px they cover the largest motion of a patch."""
_WINDOW_PX: Final = 21
_STOP: Final = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 15, 0.03)
_BACK_PX: Final = 1.0
"""Largest forward-backward error of the flow at a point that was followed. A first guess need not be better."""
AS_USUAL: Final = 0.05
"""A correlation less than this below the usual one is as good, and needs no second starting point."""
_GOOD: Final = 1.0 - (1.0 - AS_USUAL) ** 2
"""Residual variance, over the template's, of a fit whose correlation is ``AS_USUAL`` below one."""
KEPT: Final = 0.7
"""Smallest share of a patch that has to be seen, so that an occluder of the rest is clearly in the minority."""

Judge = Callable[[Fit], str]
"""Takes a patch's fit, and returns the reason for rejecting it, empty where it is accepted."""


class PatchTrack(Kept):
    """A patch, its last warp, and its usual correlation.

    ``points`` (n, 2) of the template are followed by optical flow; ``warp`` is that of the last frame in which the
    patch was seen, or the initial guess; ``lost`` counts frames since then; ``usual`` is the running mean of the
    correlation, ``learnt`` the mean residuals of a drawn template, None for a template taken from the film.
    """

    kept = ("warp", "lost", "usual", "learnt", "doubt", "_history", "_corner", "_seen")

    def __init__(self, patch: Patch, points: Floats, warp: Floats) -> None:
        self.warp = warp
        self.lost = 0
        self.usual = 1.0
        self._history: list[tuple[float, Floats]] = []
        self._seen: NDArray[np.uint8] | None = None
        self._corner = (0, 0)
        self.replace(patch, points, 1.0)

    def predict(self, time_s: float) -> Floats:
        """Return the patch's warp at a time, extrapolated from its last motion."""
        if len(self._history) < 2 or self.lost > STALE:
            return self.warp
        (t2, before), (t1, last) = self._history
        share = (time_s - t1) / (t1 - t2)
        (x1, y1), (x2, y2) = place(last), place(before)
        turn = math.remainder(turn_of(last) - turn_of(before), math.tau)
        back = similarity(-x1, -y1)
        moved = similarity(x1 + share * (x1 - x2), y1 + share * (y1 - y2), turn_rad=share * turn)
        return moved @ back @ last

    def follow(self, luma: NDArray[np.uint8], time_s: float, judge: Judge) -> tuple[Fit | None, str]:
        """Return the patch's fit in the next frame, and the reason for rejecting it (empty where it is accepted).

        The fit starts from the predicted warp, then from that by optical flow, then from the last warp.
        """
        best: Fit | None = None
        ahead = self.predict(time_s)
        why = "lost" if self.patch.in_picture(ahead, luma) else "outside"
        for guess in self._guesses(luma, ahead):
            fit = self.patch.align(luma, guess, self.learnt, self.doubt)
            if fit is None:
                continue
            reason = judge(fit)
            if best is None or (why and not reason) or (reason == why and fit.likeness > best.likeness):
                best, why = fit, reason
            if not why and best.likeness > self.usual - AS_USUAL:
                break
        return best, why

    def _guesses(self, luma: NDArray[np.uint8], ahead: Floats) -> Iterator[Floats]:
        yield ahead
        flown = self._flow(luma, ahead)
        if flown is not None:
            yield flown
        if len(self._history) > 1:
            yield self.warp

    def _flow(self, luma: NDArray[np.uint8], ahead: Floats) -> Floats | None:
        """Return the warp by Lucas-Kanade optical flow from the last frame; None where the patch was not seen there."""
        if self._seen is None or self.lost > 1:
            return None
        half = self._seen.shape[0] // 2
        now = np.ascontiguousarray(cut_out(luma, self._corner[0] + half, self._corner[1] + half, half))
        start, guess = (self._points_px(warp) for warp in (self.warp, ahead))
        options: dict[str, Any] = {
            "winSize": (_WINDOW_PX, _WINDOW_PX),
            "maxLevel": _LEVELS,
            "criteria": _STOP,
            "flags": cv2.OPTFLOW_USE_INITIAL_FLOW,
        }
        there, good, _ = cv2.calcOpticalFlowPyrLK(self._seen, now, start, guess, **options)
        back, also, _ = cv2.calcOpticalFlowPyrLK(now, self._seen, there, start.copy(), **options)
        apart = np.hypot(*(back - start).reshape(-1, 2).T)
        kept = (good.ravel() > 0) & (also.ravel() > 0) & (apart < _BACK_PX)
        if kept.sum() < 2:
            return None
        one, two = (points.reshape(-1, 2)[kept].astype(np.float64) for points in (start, there))
        return _carried(one + self._corner, two + self._corner) @ self.warp

    def _points_px(self, warp: Floats) -> NDArray[np.float32]:
        seen = warp @ self.points
        return np.ascontiguousarray((seen[:2] / seen[2]).T - self._corner, dtype=np.float32).reshape(-1, 1, 2)

    def take(self, luma: NDArray[np.uint8], time_s: float, fit: Fit) -> None:
        """Accept a fit: update warp, usual correlation and residuals, and keep the picture for the flow."""
        if self.lost:
            self._history = self._history[-1:] if self.lost <= SOON else []
        self.usual += RATE * (fit.likeness - self.usual) if self._seen is not None else fit.likeness - self.usual
        if self.learnt is not None:
            self.learnt.take(fit.left, fit.weight, fit.residual / fit.gain)
        if self.doubt is not None:
            self.doubt.take(fit.left, fit.weight)
        self.warp, self.lost = fit.warp, 0
        self._history = [*self._history[-1:], (time_s, fit.warp)]
        half = math.ceil(math.sqrt(2.0) * self.patch.half_px * size_of(fit.warp)) + _REACH_PX
        x, y = (round(value) for value in place(fit.warp))
        self._corner = (x - half, y - half)
        self._seen = cut_out(luma, x, y, half).copy()

    def replace(self, patch: Patch, points: Floats, size: float) -> None:
        """Replace the template by one of the same object that is ``size`` times as large."""
        self.patch = patch
        self.learnt = Ink(patch.count) if patch.soft else None
        self.doubt = None if patch.soft else Doubt(patch.count, _GOOD * patch.spread**2)
        self.points = np.vstack([np.asarray(points, dtype=np.float64).T, np.ones(len(points))])
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


def _carried(one: Floats, two: Floats) -> Floats:
    """Return the similarity transform (3, 3) that maps points (n, 2) to others with least squares."""
    a, b = (points[:, 0] + 1j * points[:, 1] for points in (one, two))
    from_mean, to_mean = a - a.mean(), b - b.mean()
    factor = np.vdot(from_mean, to_mean) / max(float(np.vdot(from_mean, from_mean).real), 1e-12)
    shift = b.mean() - factor * a.mean()
    return similarity(shift.real, shift.imag, turn_rad=float(np.angle(factor)), scale=float(abs(factor)))
