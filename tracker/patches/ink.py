"""What a template does not know, learnt point by point: a drawn one its tag's ink, a seen one the ground."""

from __future__ import annotations

import math

import numpy as np

from torsight.core.units import Flags, Floats
from tracker.appearance.lucas_kanade import RATE
from tracker.checkpoint import Kept


class Ink(Kept):
    """What fits leave at the ``count`` points of a template, over the gain: mean and variance, from frames of each."""

    kept = ("left", "_scatter", "_frames")

    def __init__(self, count: int) -> None:
        self.left, self._scatter, self._frames = np.zeros((3, count))

    @property
    def known(self) -> Flags:
        """Return the points (n,) that were seen."""
        return self._frames > 0.0

    @property
    def noise(self) -> float:
        """Return the usual standard deviation of what is left, over the gain."""
        return math.sqrt(float(np.median(self._scatter[self.known])))

    def take(self, left: Floats, weight: Floats, sigma: float) -> None:
        """Take in what a fit left (n,), of each point as far as it shows the tag; ``sigma`` is its usual size."""
        self._frames = np.minimum(self._frames + weight, 1.0 / RATE)
        share, off = weight / np.maximum(self._frames, 1e-9), left - self.left
        # A point that is seen first may be off by as much as others are.
        self._scatter += share * (np.where(share < 1.0, off**2, sigma**2) - self._scatter)
        self.left += share * off

    def variance(self, sigma: float) -> Floats:
        """Return the variance (n,) of what is left at every point in a frame whose noise is ``sigma``."""
        return np.asarray(sigma**2 + self._scatter, dtype=np.float64)

    def trust(self, left: Floats, weight: Floats) -> Floats:
        """Return weights (n,): at a point that was never seen the variance of the ink adds to that of what is left."""
        known = self.known
        if not known.any():
            return np.ones(len(left))
        noise = np.square(left[known]) @ weight[known] / max(float(weight[known].sum()), 1e-9)
        ink = np.square(self.left[known]).mean()
        return np.where(known, 1.0, noise / max(noise + ink, 1e-12))


class Doubt(Kept):
    """How far each of ``count`` points of a template shows the same in all frames: ground beside a stick does not.

    Points weigh as the inverse of the variance that they have shown and of ``good``, which a good fit leaves: what
    texture leaves is in part its own, sharper or darker. Weights are made anew whenever twice as many frames were seen.
    """

    kept = ("weight", "_square", "_seen", "_frames")

    def __init__(self, count: int, good: float) -> None:
        self._good = good
        self.weight, self._square, self._seen = np.ones((3, count))
        self._square[:] = self._seen[:] = 0.0
        self._frames = 0

    def take(self, left: Floats, weight: Floats) -> None:
        """Take in what a fit left (n,), over the gain, at every point as far as nothing lay over it.

        ``weight`` (n,) is that of the fit.
        """
        shown = weight / self.weight
        self._frames += 1
        self._seen += shown
        self._square += shown * np.square(left)
        if self._frames & (self._frames - 1) == 0 and self._frames > 1:
            variance = self._square / np.maximum(self._seen, 1e-9)
            self.weight = self._good / (self._good + variance)
