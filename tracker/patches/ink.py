"""Corrections to a template, learnt point by point: a drawn tag's uneven ink, and background in a seen patch."""

from __future__ import annotations

import math

import numpy as np

from torsight.core.units import Flags, Floats
from tracker.appearance.lucas_kanade import RATE
from tracker.checkpoint import Kept


class Ink(Kept):
    """Mean and variance of the residuals, over the gain, at the ``count`` points of a template."""

    kept = ("left", "_scatter", "_frames")

    def __init__(self, count: int) -> None:
        self.left, self._scatter, self._frames = np.zeros((3, count))

    @property
    def known(self) -> Flags:
        """Return whether each point (n,) has been seen."""
        return self._frames > 0.0

    @property
    def noise(self) -> float:
        """Return the median point's standard deviation of the residuals, over the gain."""
        return math.sqrt(float(np.median(self._scatter[self.known])))

    def take(self, left: Floats, weight: Floats, sigma: float) -> None:
        """Update mean and variance with a fit's residuals (n,), weighted by ``weight`` (n,); ``sigma`` is their rms."""
        self._frames = np.minimum(self._frames + weight, 1.0 / RATE)
        share, off = weight / np.maximum(self._frames, 1e-9), left - self.left
        # A point seen for the first time starts with the variance of the others.
        self._scatter += share * (np.where(share < 1.0, off**2, sigma**2) - self._scatter)
        self.left += share * off

    def variance(self, sigma: float) -> Floats:
        """Return the variance (n,) of the residual at every point in a frame whose noise is ``sigma``."""
        return np.asarray(sigma**2 + self._scatter, dtype=np.float64)

    def trust(self, left: Floats, weight: Floats) -> Floats:
        """Return the points' weights (n,) by inverse variance: unknown ink adds its variance at points never seen."""
        known = self.known
        if not known.any():
            return np.ones(len(left))
        noise = np.square(left[known]) @ weight[known] / max(float(weight[known].sum()), 1e-9)
        ink = np.square(self.left[known]).mean()
        return np.where(known, 1.0, noise / max(noise + ink, 1e-12))


class Doubt(Kept):
    """Weights of a template's ``count`` points by how constant they are over the film: background is not.

    A point's weight is inverse to its observed residual variance plus ``good``, the variance in a good fit: part of the
    residuals is due to the texture itself, as it looks sharper or darker. The weights are updated whenever the number
    of frames has doubled.
    """

    kept = ("weight", "_square", "_seen", "_frames")

    def __init__(self, count: int, good: float) -> None:
        self._good = good
        self.weight, self._square, self._seen = np.ones((3, count))
        self._square[:] = self._seen[:] = 0.0
        self._frames = 0

    def take(self, left: Floats, weight: Floats) -> None:
        """Add a fit's residuals (n,), over the gain, to every point's variance, as far as the point was not occluded.

        ``weight`` (n,) is that of the fit.
        """
        shown = weight / self.weight
        self._frames += 1
        self._seen += shown
        self._square += shown * np.square(left)
        if self._frames & (self._frames - 1) == 0 and self._frames > 1:
            variance = self._square / np.maximum(self._seen, 1e-9)
            self.weight = self._good / (self._good + variance)
