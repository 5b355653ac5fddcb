"""One patch from frame to frame: where it should be, and where it is."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from tracker.appearance.lucas_kanade import Point
from tracker.follow.judgement import SOON
from tracker.follow.learning import RATE
from tracker.follow.motion_model import STALE
from tracker.patches.align import Fit, Patch
from tracker.patches.warps import Floats, place, similarity, turn_of
from tracker.rows import SEEN

AS_USUAL: Final = 0.05
"""A correlation this near the usual one is as good, and needs no second guess."""
KEPT: Final = 0.7
"""Least share of a patch that has to be seen: what lies over the rest is then outvoted by far."""

Judge = Callable[[Fit], str]
"""Takes how a patch was found and returns why it is not taken; empty where it is."""


class PatchTrack:
    """A patch, where it was last, and how well it usually fits.

    ``warp`` is where it is, was seen last, or is looked for first; ``lost`` counts frames since it was seen; ``usual``
    is the running mean of its correlation, 0 until it was seen.
    """

    def __init__(self, patch: Patch, warp: Floats) -> None:
        self.patch = patch
        self.warp = warp
        self.lost = 0
        self.usual = 0.0
        self._history: list[tuple[float, Floats]] = []

    def predict(self, time_s: float) -> Floats:
        """Return where its last motion carries it."""
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
        """Return how it is found from where it was, and why it is not taken (empty where it is)."""
        best: Fit | None = None
        ahead = self.predict(time_s)
        why = "lost" if self.patch.in_picture(ahead, luma) else "outside"
        for guess in (ahead, self.warp) if len(self._history) > 1 else (ahead,):
            fit = self.patch.align(luma, guess)
            if fit is None:
                continue
            reason = judge(fit)
            if best is None or (why and not reason) or (reason == why and fit.likeness > best.likeness):
                best, why = fit, reason
            if not why and best.likeness > self.usual - AS_USUAL:
                break
        return best, why

    def take(self, time_s: float, fit: Fit) -> None:
        """Note where it is."""
        if self.lost:
            self._history = self._history[-1:] if self.lost <= SOON else []
        self.usual += (RATE if self.usual else 1.0) * (fit.likeness - self.usual)
        self.warp, self.lost = fit.warp, 0
        self._history = [*self._history[-1:], (time_s, fit.warp)]

    def replace(self, patch: Patch, size: float) -> None:
        """Take a template of the same thing that is ``size`` times as large."""
        self.patch = patch
        smaller = np.diag([1.0 / size, 1.0 / size, 1.0])
        self.warp = self.warp @ smaller
        self._history = [(time_s, warp @ smaller) for time_s, warp in self._history]

    def miss(self) -> None:
        """Note that it was not seen."""
        self.lost += 1

    def to_state(self) -> dict[str, Any]:
        """Return what :meth:`restore` needs."""
        return {
            "warp": self.warp.tolist(),
            "lost": self.lost,
            "usual": self.usual,
            "history": [[time_s, warp.tolist()] for time_s, warp in self._history],
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Go back to a noted state, exactly."""
        self.warp = np.array(state["warp"], dtype=np.float64)
        self.lost, self.usual = int(state["lost"]), float(state["usual"])
        self._history = [(float(time_s), np.array(warp, dtype=np.float64)) for time_s, warp in state["history"]]


def put(readings: NDArray[np.void], index: int, fit: Fit, at: Point, covariance: Floats, *, spread: float) -> None:
    """Put a fit into readings as that of a point of its template."""
    own = readings[index]
    own["x"], own["y"] = at
    own["covariance"] = covariance[0, 0], covariance[0, 1], covariance[1, 1]
    own["light"], own["contrast"], own["step"] = fit.light, fit.gain, fit.gain * 2.0 * spread
    own["residual"], own["state"] = fit.residual, SEEN
