"""Two sticks of any kinds through a film, each by itself: no tag or texture is taken for another stick's marker."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from tracker.linear import Reading
from tracker.patches.sticks import Stick
from tracker.patches.tag_stick import TagStick
from tracker.rules import DARK, SPARSE
from tracker.sight import between, direction, make_row
from tracker.source import Frame

_MOVED_RAD: Final = math.radians(1.0)
"""A stick that turned by this much, and three times as much as the other, is the moving one."""
_RATE: Final = 0.05
"""Share of a new frame in the usual brightness."""


@dataclass(frozen=True, slots=True)
class StickName:
    """Which stick one is: its number, and the numbers of its markers."""

    stick: int

    @property
    def indices(self) -> tuple[int, int]:
        """Numbers of its markers."""
        return 2 * self.stick, 2 * self.stick + 1


class StickFollower:
    """Follows two sticks through a film.

    Parameters
    ----------
    sticks : two Stick
        The base first where it is known.
    moving : int or None
        Which stick moves (0 or 1); None until it shows.
    """

    def __init__(self, sticks: Sequence[Stick], *, moving: int | None) -> None:
        self.sticks = list(sticks)
        self.moving: StickName | None = None
        self.base: StickName | None = None
        self._brightness = 0.0
        self._starts: list[float | None] = [None, None]
        if moving is not None:
            self._name(moving)

    def step(self, frame: Frame) -> NDArray[np.void]:
        """Follow the sticks into the next frame and return its row."""
        if frame.luma is None or frame.damaged:
            return self._pass(frame.time_s, "damaged")
        level = float(frame.luma[::SPARSE, ::SPARSE].mean())
        if level < DARK * self._brightness:
            return self._pass(frame.time_s, "dark")
        self._brightness = level if self._brightness == 0.0 else self._brightness + _RATE * (level - self._brightness)
        readings: list[Reading | None] = []
        reasons: list[str] = []
        for stick in self.sticks:
            seen, why = stick.step(frame.luma, frame.time_s)
            readings += [None if reason else reading for reading, reason in zip(seen, why, strict=True)]
            reasons += why
        if all(isinstance(stick, TagStick) for stick in self.sticks):
            _share_noise(readings)
        if self.moving is None:
            self._look_for_motion(readings)
        return make_row(frame.time_s, readings, reasons)

    def _pass(self, time_s: float, reason: str) -> NDArray[np.void]:
        for stick in self.sticks:
            stick.miss()
        return make_row(time_s, [None] * 4, [reason] * 4)

    def _look_for_motion(self, readings: Sequence[Reading | None]) -> None:
        turned: list[float] = []
        for stick in (0, 1):
            a, b = readings[2 * stick], readings[2 * stick + 1]
            if a is None or b is None:
                return
            now_rad = direction((a.x_px, a.y_px), (b.x_px, b.y_px))
            first_rad = self._starts[stick]
            self._starts[stick] = first_rad = now_rad if first_rad is None else first_rad
            turned.append(between(now_rad, first_rad))
        for stick in (0, 1):
            if turned[stick] > _MOVED_RAD + 3.0 * turned[1 - stick]:
                self._name(stick)
                return

    def _name(self, moving: int) -> None:
        self.base, self.moving = StickName(1 - moving), StickName(moving)

    def settle(self) -> None:
        """Do nothing: all that was learned is in the sticks."""

    def report(self) -> dict[str, float]:
        """Return sizes for ``track.json``: of markers and sticks, and the shutter, which only dots tell."""
        return {
            "radius_px": float(np.nanmedian([stick.radius_px for stick in self.sticks])),
            "stick_length_px": float(np.nanmedian([stick.length_px for stick in self.sticks])),
            "shutter_share_of_frame": max(stick.shutter_share for stick in self.sticks),
        }

    def to_state(self) -> dict[str, Any]:
        """Return everything that :meth:`restore` needs to go on in the same way."""
        return {
            "moving": None if self.moving is None else self.moving.stick,
            "brightness": self._brightness,
            "starts": self._starts,
            "sticks": [stick.to_state() for stick in self.sticks],
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Go back to a noted state, exactly."""
        if state["moving"] is not None:
            self._name(int(state["moving"]))
        self._brightness = float(state["brightness"])
        self._starts = [None if start is None else float(start) for start in state["starts"]]
        for stick, content in zip(self.sticks, state["sticks"], strict=True):
            stick.restore(content)


def _share_noise(readings: Sequence[Reading | None]) -> None:
    """Take the noise of the picture for the same on both tags: what a smeared one leaves beyond it is no noise."""
    seen = [reading for reading in readings if reading is not None]
    noise = min((reading.residual for reading in seen), default=0.0)
    for reading in seen:
        share = (noise / max(reading.residual, 1e-6)) ** 2
        reading.xx_px2, reading.xy_px2, reading.yy_px2 = (
            share * value for value in (reading.xx_px2, reading.xy_px2, reading.yy_px2)
        )
