"""Paths of the dots of a picture in the frames after it: each dot is followed separately, without a model of sticks."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from torsight.core.units import Flags, Floats
from tracker.appearance.dot_fit import Dot
from tracker.appearance.lucas_kanade import READING, Luma
from tracker.appearance.motion_blur import smear_slack
from tracker.follow.marker import Marker
from tracker.follow.reading import glance_at
from tracker.follow.state import RIG

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
        self._markers: list[Marker] = []
        self.dots: list[Dot] = []
        self._followed: list[int] = []
        for dot, rests in zip(dots, at_rest.tolist(), strict=True):
            marker = Marker(dot)
            reading = marker.read(luma, dot.x_px, dot.y_px)
            if reading is not None:
                marker.begin(reading)
                self._followed += [] if rests else [len(self.dots)]
                self.dots.append(dot)
                self._markers.append(marker)
        self._first = np.array([complex(one.x_px, one.y_px) for one in self._markers], np.complex128)
        self._last, self._step, self._shift = self._first.copy(), np.zeros_like(self._first), 0.0j
        self._seen = np.ones(len(self._first), bool)
        self._radius_px = np.array([marker.radius_px for marker in self._markers])
        self._before: Luma = luma.copy()
        self._rows = [self._first.copy()]
        self._spread = [np.zeros((len(self._first), 3))]
        self._out, self._rig = np.zeros(1, READING)[0], np.zeros(1, RIG)[0]

    @property
    def places(self) -> NDArray[np.complex128]:
        """Positions of the dots in every frame."""
        return np.array(self._rows)

    @property
    def covariance(self) -> Floats:
        """Covariances of the positions."""
        return np.array(self._spread)

    def add(self, luma: Luma | None) -> None:
        """Follow the dots into the next frame; None for one without a usable picture."""
        now, spread = self._first.copy(), np.zeros((len(self._first), 3))
        now[self._followed] = complex(math.nan, math.nan)
        if luma is not None:
            homes, ahead = self._first + self._shift, self._last + self._step
            # The first position comes last once the dot has left it to others.
            gone = self._seen & (np.abs(ahead - homes) > self._radius_px)
            tried = np.where(gone, [ahead, homes], [homes, ahead]).T.tolist()
            missed = [index for index in self._followed if not self._read(luma, index, tried[index], now, spread)]
            self._look_further(luma, [index for index in missed if self._seen[index]], ahead, now, spread)
            seen = np.isfinite(now)
            self._step = np.where(seen & self._seen, now - self._last, 0.0)
            self._last = np.where(seen, now, self._last)
            self._seen = seen
            if seen.any():
                went = (now - self._first)[seen]
                self._shift = complex(np.median(went.real), np.median(went.imag))
            np.copyto(self._before, luma)
        self._rows.append(now)
        self._spread.append(spread)

    def _read(
        self, luma: Luma, index: int, tried: Sequence[complex], now: NDArray[np.complex128], spread: Floats
    ) -> bool:
        """Read a dot from the first starting point at which it is found; return whether it is found."""
        marker, out = self._markers[index], self._out
        for place in tried:
            # The exposure is not known yet.
            slack = smear_slack(self._rig, abs(place - self._last[index]))
            if glance_at(luma, marker.record[0], marker.look, (place.real, place.imag), slack, out):
                now[index], spread[index] = complex(out["x"], out["y"]), out["covariance"]
                return True
        return False

    def _look_further(
        self, luma: Luma, missed: list[int], ahead: NDArray[np.complex128], now: NDArray[np.complex128], spread: Floats
    ) -> None:
        """Read dots at the positions to which pyramidal Lucas–Kanade follows their surroundings from the last frame."""
        flags = cv2.OPTFLOW_USE_INITIAL_FLOW
        for index in missed:
            half = math.ceil(2.0 * self._markers[index].radius_px)
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
                flags=flags,
            )
            if status.item():
                x, y = found.ravel().tolist()
                self._read(luma, index, (complex(x + left, y + top),), now, spread)
