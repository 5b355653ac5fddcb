"""Tracking of two sticks of any kinds through a film, frame by frame."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from torsight.core.units import Floats
from tracker.appearance.lucas_kanade import RATE, READING, Luma
from tracker.checkpoint import Kept
from tracker.follow.camera_state import TURN_RAD, base_shift
from tracker.follow.followed_dots import DotState
from tracker.follow.judgement import MOVED_RAD, to_strip
from tracker.follow.learning import write_row
from tracker.follow.redetect import direction, place_of
from tracker.follow.rotation_axis import turned
from tracker.frames.frame import Frame
from tracker.innovation import SIGMAS
from tracker.rows import DAMAGED, DARK, LOST, ROW, SEEN, SHADOWED
from tracker.stick_direction import square, stick_direction

_DARK_SHARE: Final = 0.4
"""Share of the usual brightness of the picture below which the light is off: dots no longer show then."""


class Stick(Protocol):
    """Reads both markers of one stick, or all four of two, frame by frame."""

    drawn: bool
    """Whether the stick's template is drawn: its residuals in a blurred picture are then not noise alone."""

    def step(self, luma: NDArray[np.uint8], time_s: float, shift: Floats) -> NDArray[np.void]:
        """Return the readings (n,) of the stick's markers in the next frame, records of READING with their states.

        ``shift`` (2,) is that of the picture since the start, px, as last measured on the base.
        """

    def miss(self, time_s: float) -> None:
        """Skip a frame without a usable picture."""

    @property
    def radius_px(self) -> float:
        """Size of a marker, px."""

    @property
    def window_px(self) -> float:
        """Distance from a marker within which another stick displaces it unnoticed, px; 0 where that is noticed."""

    @property
    def half_px(self) -> float:
        """Half the width of the stick, px, as far as its markers show it."""

    @property
    def length_px(self) -> float:
        """Distance between both markers, px."""

    def to_state(self) -> dict[str, Any]:
        """Return the state that :meth:`restore` needs."""

    def restore(self, state: Mapping[str, Any]) -> None:
        """Restore a saved state exactly."""


def nothing(state: int, *, markers: int = 2) -> NDArray[np.void]:
    """Return empty readings of some markers with a state that says why there are none."""
    readings = np.zeros(markers, READING)
    readings["state"] = state
    return readings


class Follower(Kept):
    """Follows two sticks; ``moving`` is the index of the one that moves, None until it is known.

    The dots of two sticks are followed together. Sticks with tags or texture are followed separately, the base first
    where it is known: their markers cannot be mistaken for those of the other stick.
    """

    kept = ("moving", "_brightness", "_noise", "_shift", "_zero", "_starts", "_last", "sticks")

    def __init__(self, sticks: Sequence[Stick], *, moving: int | None) -> None:
        self.sticks = list(sticks)
        self.moving: int | None = None
        self._drawn = all(stick.drawn for stick in sticks)
        self._brightness = 0.0
        self._noise: float | None = None
        self._shift, self._zero = np.zeros(2), np.full((2, 2), np.nan)
        dots = sticks[0] if len(sticks) == 1 else None
        self._starts = np.array(dots.starts_rad if isinstance(dots, DotState) else [math.nan, math.nan])
        self._last = self._starts.copy()
        self._rows = np.zeros(1, ROW)
        if moving is not None:
            self._name_moving(moving)

    def step(self, frame: Frame) -> NDArray[np.void]:
        """Follow the sticks into the next frame and return its row, which the next frame overwrites."""
        if frame.luma is None or frame.damaged:
            return self._row(self._pass(frame.time_s, DAMAGED), frame.time_s)
        # One row in sixteen gives the picture's brightness as accurately as all of them.
        level = cv2.mean(frame.luma[::16])[0]
        return self._row(self._read(frame.luma, frame.time_s, level), frame.time_s, level)

    def pass_over(self, frame: Frame) -> NDArray[np.void]:
        """Return the row of a frame before the sticks were found, which the next frame overwrites."""
        return self._row(nothing(LOST, markers=4), frame.time_s)

    def _row(self, readings: NDArray[np.void], time_s: float, level: float = 0.0) -> NDArray[np.void]:
        write_row(readings, self._rows, time_s, level)
        row: NDArray[np.void] = self._rows[0]
        return row

    def _read(self, luma: Luma, time_s: float, level: float) -> NDArray[np.void]:
        if level < _DARK_SHARE * self._brightness:
            return self._pass(time_s, DARK)
        self._brightness = level if self._brightness == 0.0 else self._brightness + RATE * (level - self._brightness)
        parts: list[NDArray[np.void]] = []
        for number, stick in enumerate(self.sticks):
            parts.append(stick.step(luma, time_s, self._shift))
            if len(self.sticks) > 1 and self.moving is not None and number != self.moving:
                self._follow_shift(parts[-1])
        if len(parts) > 1 and self.moving is not None:
            self._note_covered(parts[1 - self.moving], parts[self.moving])
        readings = parts[0] if len(parts) == 1 else np.concatenate(parts)
        if self._drawn:
            self._share_noise(readings)
        if self.moving is None:
            self.look_for_motion(readings)
        return readings

    def _follow_shift(self, base: NDArray[np.void]) -> None:
        """Update the picture's shift from the base's displacement since it was first seen."""
        seen = base["state"] == SEEN
        at = np.stack([base["x"], base["y"]], axis=1)
        self._zero = np.where(np.isnan(self._zero) & seen[:, None], at - self._shift, self._zero)
        base_shift(base, self._zero, self._shift)

    def _note_covered(self, base: NDArray[np.void], moving: NDArray[np.void]) -> None:
        """Set markers of the base that the moving stick reaches to the state ``shadowed``."""
        one, other = self.sticks if self.moving else self.sticks[::-1]
        if not one.window_px or moving["state"].any():
            return
        reach_px = one.window_px + other.half_px
        ends = place_of(moving[0]), place_of(moving[1])
        for reading in base:
            if reading["state"] == SEEN and to_strip(place_of(reading), *ends, 0.0) < reach_px:
                reading["state"] = SHADOWED

    def _share_noise(self, readings: NDArray[np.void]) -> None:
        """Scale covariances to the same noise for both tags: the larger residual of a blurred tag is not noise.

        For a tag that is seen alone the noise is at most that of the last frame with both.
        """
        seen = readings["state"] == SEEN
        if not seen.any():
            return
        # Never zero: a residual is at least the rounding of the picture.
        residual = readings["residual"][seen]
        noise = float(residual.min())
        if seen.all() or self._noise is None:
            self._noise = noise
        readings["covariance"][seen] *= np.square(min(noise, self._noise) / residual)[:, None]

    def _pass(self, time_s: float, state: int) -> NDArray[np.void]:
        for stick in self.sticks:
            stick.miss(time_s)
        return nothing(state, markers=4)

    def look_for_motion(self, readings: NDArray[np.void]) -> None:
        """Decide which stick moves: the one that turns by more than the other, which may have turned with the camera.

        Turns are counted from the frame in which a stick was found again: after a gap the dots may be others, unless
        they lie on the circles of a stick whose axis is known.
        """
        now = [
            math.nan if readings["state"][i : i + 2].any() else direction(*map(place_of, readings[i : i + 2]))
            for i in (0, 2)
        ]
        dots = self.sticks[0]
        sure = dots.scene.sticks["axis"]["known"] if isinstance(dots, DotState) and len(self.sticks) == 1 else 0
        back = (np.isnan(self._last) & np.isfinite(now) & np.logical_not(sure)).any()
        self._last = np.array(now)
        self._starts = np.where(np.isnan(self._starts) | back, now, self._starts)
        angles = [turned(one, first) for one, first in zip(now, self._starts.tolist(), strict=True)]
        at, covariance = np.stack([readings["x"], readings["y"]], axis=1), square(readings["covariance"])
        inner, outer = (at[::2], covariance[::2]), (at[1::2], covariance[1::2])
        # Noise of the difference of two directions; NaN for markers that are not seen.
        with np.errstate(invalid="ignore", divide="ignore"):
            noise = SIGMAS * np.sqrt(2.0 * stick_direction(inner, outer)[1])
        for stick in (0, 1):
            other = SIGMAS * TURN_RAD if math.isnan(now[1 - stick]) else angles[1 - stick]
            if angles[stick] > MOVED_RAD + noise[stick] + 3.0 * other and not math.isnan(self._starts[1 - stick]):
                self._name_moving(stick)

    def _name_moving(self, moving: int) -> None:
        """Set which stick moves."""
        self.moving = moving
        for stick in self.sticks:
            if isinstance(stick, DotState):
                stick.name_moving(moving)

    def report(self) -> dict[str, Any]:
        """Return figures for ``track.json``: sizes of markers and sticks, and the exposure, which only dots show."""
        dots = (stick.shutter for stick in self.sticks if isinstance(stick, DotState))
        share, limits = min(dots, key=lambda one: one[1][1] - one[1][0], default=(None, (0.0, 1.0)))
        return {
            "radius_px": float(np.nanmedian([stick.radius_px for stick in self.sticks])),
            "stick_length_px": float(np.nanmedian([stick.length_px for stick in self.sticks])),
            "shutter_share_of_frame": share,
            "shutter_share_limits": limits,
        }
