"""Paths of the dots of a picture in the frames after it: each dot is followed separately, without a model of sticks."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import cv2
import numpy as np

from torsight.core.units import Flags, Floats
from tracker.appearance.dot_fit import Dot
from tracker.appearance.lucas_kanade import READING, Luma, Places
from tracker.follow.marker import Marker, looks_of
from tracker.follow.reading import glance_at
from tracker.follow.state import MARKER, RIG
from tracker.rows import SEEN

NOWHERE: Final = complex(math.nan, math.nan)
"""Position of a dot that is not seen."""
_LEVELS: Final = 3
"""Pyramid levels for dots that moved further than their radius: they are found up to 8 radii away."""


class DotPaths:
    """The dots of a picture (h, w), followed one by one, but for those ``at_rest`` (d,), which are known to stay.

    The starting points for reading a dot are its first position plus the picture's shift, its last position plus its
    last step, and the result of pyramidal Lucas–Kanade from the last frame. A lost dot is found again at its first or
    its last position. ``dots`` are those that can be read: not at the border. ``places`` (n, d), complex, px, are their
    positions in the picture and in every frame after it, NaN where not seen, ``covariance`` (n, d, 3) xx, xy, yy, px².
    """

    def __init__(self, luma: Luma, dots: Sequence[Dot], at_rest: Flags) -> None:
        markers: list[Marker] = []
        self.dots: list[Dot] = []
        follows: list[bool] = []
        for dot, rests in zip(dots, at_rest.tolist(), strict=True):
            marker = Marker(dot)
            reading = marker.read(luma, dot.x_px, dot.y_px)
            if reading is not None:
                marker.begin(reading)
                follows.append(not rests)
                self.dots.append(dot)
                markers.append(marker)
        self._markers = np.concatenate([np.zeros(0, MARKER), *(marker.record for marker in markers)])
        self._follows = np.array(follows, bool)
        self._looks = looks_of(markers)
        self._first = self._markers["x"] + 1j * self._markers["y"]
        self._last, self._step, self._shift = self._first.copy(), np.zeros_like(self._first), 0.0j
        self._seen = np.ones(len(self._first), bool)
        self._radius_px: Floats = self._markers["shape"]["radius"]
        self._before: Luma = luma.copy()
        self._rows = [self._first.copy()]
        self._spread = [np.zeros((len(self._first), 3))]
        # A rig whose exposure is not known yet.
        self._out, self._rig = np.zeros(len(self._first), READING), np.zeros(1, RIG)[0]

    @property
    def places(self) -> Places:
        """Positions of the dots in every frame."""
        return np.array(self._rows)

    def places_after(self, count: int) -> Places:
        """Return the positions of the dots in a frame, by its number after the picture; none before it is followed."""
        return self._rows[count] if count < len(self._rows) else np.zeros(0, complex)

    @property
    def covariance(self) -> Floats:
        """Covariances of the positions."""
        return np.array(self._spread)

    def add(self, luma: Luma | None) -> None:
        """Follow the dots into the next frame; None for one without a usable picture."""
        now, spread = self._first.copy(), np.zeros((len(self._first), 3))
        now[self._follows] = NOWHERE
        if luma is not None:
            homes, ahead = self._first + self._shift, self._last + self._step
            # The first position comes last once the dot has left it to others.
            gone = self._seen & (np.abs(ahead - homes) > self._radius_px)
            tried = np.where(gone, [ahead, homes], [homes, ahead]).T
            tried[~self._follows] = NOWHERE
            self._read(luma, tried, now, spread)
            missed = np.flatnonzero(np.isnan(now) & self._seen)
            if len(missed):
                tried = np.full((len(now), 1), NOWHERE)
                for index in missed.tolist():
                    tried[index] = self._look_further(luma, index, ahead)
                self._read(luma, tried, now, spread)
            seen = np.isfinite(now)
            self._step = np.where(seen & self._seen, now - self._last, 0.0)
            self._last = np.where(seen, now, self._last)
            self._seen = seen
            if seen.any():
                went = now - self._first
                self._shift = complex(median_known(went.real), median_known(went.imag))
            np.copyto(self._before, luma)
        self._rows.append(now)
        self._spread.append(spread)

    def _read(self, luma: Luma, tried: Places, now: Places, spread: Floats) -> None:
        """Read every dot at the first of its positions (d, k) at which it is found; store those that are."""
        out = self._out
        glance_at(luma, self._markers, self._looks, tried, self._last, self._rig, out)
        found = out["state"] == SEEN
        now[found], spread[found] = (out["x"] + 1j * out["y"])[found], out["covariance"][found]

    def _look_further(self, luma: Luma, index: int, ahead: Places) -> complex:
        """Return the position to which pyramidal Lucas–Kanade follows a dot's surroundings from the last frame."""
        half = math.ceil(2.0 * self._radius_px[index])
        from_to = np.array([[at[index].real, at[index].imag] for at in (self._last, ahead)], np.float32)
        # Only the part of the picture that the coarsest level looks at, with a window of the dot's own size.
        far = half << _LEVELS
        left, top = np.maximum(from_to.min(axis=0).astype(int) - far, 0).tolist()
        right, bottom = (from_to.max(axis=0).astype(int) + far).tolist()
        part = np.s_[top:bottom, left:right]
        before, guess = (from_to - np.array([left, top], np.float32)).reshape(2, 1, 1, 2)
        found, status, _ = cv2.calcOpticalFlowPyrLK(
            self._before[part],
            luma[part],
            before,
            guess.copy(),
            winSize=(2 * half + 1, 2 * half + 1),
            maxLevel=_LEVELS,
            flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
        )
        x, y = found.ravel().tolist()
        return complex(x + left, y + top) if status.item() else NOWHERE


def median_known(values: Floats) -> Floats:
    """Return the median of the finite values along the first axis, 0 where there are none."""
    last = np.isfinite(values).sum(axis=0, keepdims=True) - 1
    if not (last >= 0).any():
        return np.zeros(values.shape[1:])
    # NaN is sorted last; numpy's nanmedian works on masked arrays, and takes six times as long.
    ordered = np.sort(values, axis=0)
    low, high = (np.take_along_axis(ordered, np.maximum(at // 2, 0), axis=0) for at in (last, last + 1))
    return np.asarray(np.where(last >= 0, 0.5 * (low + high), 0.0)[0])
