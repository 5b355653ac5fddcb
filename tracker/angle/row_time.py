"""Rolling shutter: each row of the picture shows a later instant than the row before it.

A marker at row y is seen at its position at t + y τ, with τ the time of a row. It stays on its circle, but is further
along the circle by its speed times the delay. So the angle between both markers, as seen from the axis, changes in
proportion to the speed and with its sign; neither tilt nor lens has this effect. :mod:`tracker.angle.tilt` fits the
row time together with the tilt; this module computes the regressors of that fit from the frames, and removes the delay
from the markers' positions once the row time is known.

Rows may lie along either side of the picture as displayed (a phone held upright stores rows that are shown as columns).
The timestamp of a frame is taken to be that of the row read first, as Android's camera interface defines it
(``SENSOR_TIMESTAMP``).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from torsight.core.parameter import REACH
from torsight.core.tracks import MarkerTracks
from torsight.core.units import Floats
from tracker.innovation import SIGMAS
from tracker.stick_direction import turned_by

Complex = NDArray[np.complex128]

SHARE_PRIOR: Final = 1.0 / np.sqrt(3.0)
"""Prior standard deviation of the read-out time as a share of the time between two frames: that of a uniform
distribution from −1 to 1."""
_ONWARDS: Final = (("right", "left"), ("down", "up"))


@dataclass(frozen=True, slots=True, eq=False)
class Readout:
    """When the moving markers of each frame are read, as fractions of the read-out time.

    ``time_s`` (n,) are the timestamps of the frames, usually ``frame_s`` apart; ``place`` (n, 2, 2) holds, for inner
    and outer marker, x over the picture's width and y over its height, NaN where not seen.
    """

    time_s: Floats
    frame_s: float
    place: Floats
    size_px: tuple[int, int]

    @classmethod
    def of(cls, tracks: MarkerTracks) -> Readout:
        """Return the read-out of a film."""
        frame_s = float(np.median(np.diff(tracks.time_s))) if len(tracks) > 1 else 0.0
        return cls(tracks.time_s, frame_s, tracks.position_px[:, 2:] / np.array(tracks.size_px), tracks.size_px)

    def delay_s(self, share: Floats) -> Floats:
        """Return the delay (n, 2) from a frame's timestamp to the reading of each marker.

        ``share`` (2,) is the read-out time over the time between frames, along x and y, negative where rows are read
        backwards.
        """
        return np.asarray(self.frame_s * ((self.place - (share < 0.0)) @ share))

    def lead_rad(self, rate: Floats) -> Floats:
        """Return the derivative (n, 2) by ``share`` of the angle by which the outer marker leads, at rates (n, 2)."""
        return np.asarray(rate.mean(axis=1)[:, None] * self.frame_s * (self.place[:, 1] - self.place[:, 0]))

    def turning(self, direction_rad: Floats, share: Floats, arms: Complex) -> tuple[Floats, Floats]:
        """Return the rate of turn (n, 2), rad/s, as each marker is read, and its derivative (n,), rad/s².

        Both are those of parabolas through three frames, between which they are interpolated. ``direction_rad`` (n,)
        is that of the line through both markers, NaN where not known, with ``arms`` (2,) from the axis to each, in one
        unit. The line's direction is that of neither reading: it extrapolates their delays as it does their arms.
        """
        delay_s = self.delay_s(share)
        read_s = (delay_s @ (arms * (-1.0, 1.0)) / (arms[1] - arms[0])).real
        known = np.flatnonzero(np.isfinite(direction_rad))
        # Two frames with the same timestamp give no rate.
        known = known[np.diff(np.maximum.accumulate(self.time_s[known]), prepend=-np.inf) > 0.0]
        if len(known) < 3:
            return np.zeros_like(delay_s), np.zeros(len(delay_s))
        step = np.diff((self.time_s + read_s)[known])
        slope = np.diff(np.unwrap(direction_rad[known])) / step
        span = step[1:] + step[:-1]
        bend = np.pad(2.0 * np.diff(slope) / span, 1, mode="edge")
        inside = (slope[:-1] * step[1:] + slope[1:] * step[:-1]) / span
        ends = slope[0] - 0.5 * bend[0] * step[0], slope[-1] + 0.5 * bend[-1] * step[-1]
        index = np.arange(len(read_s))
        rate, change = (np.interp(index, known, part) for part in ([ends[0], *inside, ends[1]], bend))
        # A marker that is seen alone moves as the stick does in the neighbouring frames.
        return rate[:, None] + change[:, None] * np.nan_to_num(delay_s - read_s[:, None]), change

    def at_timestamps(self, points: Sequence[Floats], share: Floats) -> list[Floats]:
        """Return the moving markers, each (n, 2) in a plane across the axis, moved back to their frames' timestamps."""
        inner, outer = points
        if not share.any():
            return [inner, outer]
        delay_s = self.delay_s(share)
        stick = outer - inner
        direction, seen = np.arctan2(stick[:, 1], stick[:, 0]), np.isfinite(stick[:, 0])
        (middle, *arms), _ = circles(np.stack(points, axis=1)[seen], direction[seen])
        rate, change = self.turning(direction, share, np.array(arms))
        back = -rate * delay_s + 0.5 * change[:, None] * delay_s**2
        centre = np.array([middle.real, middle.imag])
        return [centre + turned_by(part - centre, angle) for part, angle in zip(points, back.T, strict=True)]

    def report(self, shares: Floats, sigmas: Floats, *, shown: float) -> dict[str, Any]:
        """Return the entry of ``track.json``: ``shown``, from 0 to 1, is how clearly the film shows a read-out."""
        told: dict[str, Any] = {"known": shown > 0.0, "share_taken_out": shown}
        if told["known"]:
            along = int(np.argmax(np.abs(shares)))
            share, sigma = float(shares[along]), float(sigmas[along])
            row_us = 1e6 * self.frame_s / self.size_px[along]
            told |= {
                "rows_follow": _ONWARDS[along][share < 0.0],
                "row_time_us": row_us * abs(share),
                "row_time_ci95_us": [row_us * (abs(share) - REACH * sigma), row_us * (abs(share) + REACH * sigma)],
                "read_out_ms": 1e3 * self.frame_s * abs(share),
            }
        return told


def way_round(direction_rad: Floats, sigma_rad: float) -> Floats:
    """Return the sense (n,) of a stick's last motion: 1 counter-clockwise, −1 clockwise, between as the sense reverses.

    The sense follows the direction like a drive with play: it reverses once the direction has gone back by more than
    its noise ``sigma_rad`` explains. At rest it is that of the last motion, before the first motion that of the first.
    """
    way, now = np.zeros(len(direction_rad)), 0.0
    known = np.flatnonzero(np.isfinite(direction_rad))
    steps = np.diff(np.unwrap(direction_rad[known])) / max(SIGMAS * sigma_rad, 1e-12)
    for index, step in zip(known[1:].tolist(), steps.tolist(), strict=True):
        way[index] = now = min(max(now + step, -1.0), 1.0)
    first = int(np.argmax(np.abs(way) == 1.0))
    way[:first] = way[first]
    return way


def circles(points: Floats, direction_rad: Floats) -> tuple[Complex, Complex]:
    """Return the common centre and both arms (3,) of markers that go around circles, and their normal matrix (3, 3).

    Least squares of p = c + q exp(i ψ) in the complex plane, linear in c and both q: inner and outer marker (n, 2, 2),
    and the stick's direction ψ (n,), counter-clockwise. Where the paths do not determine them, the solution of the
    smallest norm.
    """
    place, unit = points[..., 0] + 1j * points[..., 1], np.exp(1j * direction_rad)
    n, turned = len(place), unit.sum()
    normal = np.array([[2 * n, turned, turned], [np.conj(turned), n, 0.0], [np.conj(turned), 0.0, n]])
    right = np.concatenate([[place.sum()], np.conj(unit) @ place])
    return np.asarray(np.linalg.pinv(normal, hermitian=True) @ right), normal
