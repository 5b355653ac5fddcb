"""Markers and angle frame by frame: finding the markers, following them, telling what happened."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from torsight.core.errors import NoResultError
from torsight.core.optics.camera import Camera
from torsight.core.progress import THOUGHT_S
from torsight.core.tracks import MARKERS
from torsight.core.units import Floats
from torsight.viewer.live.frames.intake import LiveFrame
from torsight.viewer.live.measure.angle import LiveAngle
from torsight.viewer.live.measure.model_watch import STEP_S
from tracker.detect.marker_file import MarkerHints
from tracker.follow.follower import Follower
from tracker.frames.frame import Damage, Frame
from tracker.initialise import find_start
from tracker.rows import CODE, STATES
from tracker.stick_direction import square

_LOOK_EVERY_S: Final = 0.5 * THOUGHT_S
"""How often markers are looked for until they are seen."""
_TELL_AFTER: Final = 3
"""Frames for which a marker must be away, or back, before it is reported: of frames that show it 98 times in 100, three
in a row miss it by chance once in 0.02⁻³ = 125,000, an hour at 35 per second."""
_EARLIER_MOST: Final = round(3600.0 / STEP_S)
"""Of the time before anything moves, an hour's worth of positions is kept: their angles are known once it does."""
_LOST_EARLY_S: Final = 2.0 * _LOOK_EVERY_S
"""A start whose markers are lost for two looks before anything moved was a wrong one."""

Tell = Callable[[float, int, str, str], None]
"""Takes time (s), frame, kind and words of an event."""


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """What one frame showed; NaN where it is not seen or not known.

    The markers (4, 2) in the order of ``MARKERS`` with their covariances (4, 2, 2), the angle with its sigma, and with
    a calibrated camera the positions in space (4, 3).
    """

    position_px: Floats
    covariance_px2: Floats
    angle_rad: float
    sigma_rad: float
    position_mm: Floats | None


class EarlierAngle(NamedTuple):
    """An angle that came to be known later: of a frame before the moving stick showed."""

    time_s: float
    angle_rad: float
    sigma_rad: float


@dataclass(slots=True)
class _OneFrame:
    """A single frame as a source, for the search of the markers."""

    frame: Frame
    name: str
    size_px: tuple[int, int]
    frame_count: int | None = 1
    pixel_aspect: float = 1.0
    damage: Damage = field(default_factory=Damage)

    def __iter__(self) -> Iterator[Frame]:
        yield self.frame

    def describe(self) -> dict[str, Any]:
        return {}

    def files(self) -> list[Path]:
        return []


class LiveTracker:
    """Finds the markers, follows them, and makes the angle of each frame.

    Hints say where the markers are in the first frame; ``name`` is the source's, for messages; ``tell`` takes the
    events.
    """

    def __init__(
        self, hints: MarkerHints | None, camera: Camera | None, *, name: str, tell: Tell, pixel_aspect: float = 1.0
    ) -> None:
        self.swapped = 0
        """How many of the first rows call the base stick moving."""
        self._hints = hints
        self._name = name
        self._tell = tell
        self._angle = LiveAngle(camera, pixel_aspect=pixel_aspect)
        self._follower: Follower | None = None
        self._looked_s = -math.inf
        self._away = np.zeros(4, np.int64)
        self._told = np.zeros(4, bool)
        self._lost_since_s: float | None = None
        self._still: deque[tuple[float, Floats, Floats]] = deque(maxlen=_EARLIER_MOST)
        self._earlier: list[EarlierAngle] = []

    @property
    def found(self) -> bool:
        """Whether markers have been found."""
        return self._follower is not None

    def step(self, frame: LiveFrame) -> Seen:
        """Take the next frame.

        Raises
        ------
        ConfigError, NoResultError
            When markers were given and are not there.
        """
        if self._follower is None and not self._start(frame):
            return _nothing()
        follower = self._follower
        if follower is None:
            return _nothing()
        knew = follower.moving
        row = follower.step(Frame(frame.index, frame.time_s, frame.luma, damaged=frame.damaged or frame.dropped))
        if knew is None and follower.moving is not None:
            self._now_moving(frame, follower.moving)
        swapped = follower.moving == 0
        order = [2, 3, 0, 1] if swapped else [0, 1, 2, 3]
        state = row["state"][order]
        position = np.where((state == CODE["seen"])[:, None], row["position_px"][order], np.nan)
        covariance = square(row["covariance_px2"][order])
        if not frame.dropped:
            self._watch(frame, state)
        if knew is None and follower.moving is not None:
            self._look_back([2, 3, 0, 1] if swapped else [0, 1, 2, 3])
        if follower.moving is None:
            if not frame.dropped:
                self._give_up_early(frame, state)
                self._keep_still(frame.time_s, position, covariance)
            return Seen(position, covariance, math.nan, math.nan, None)
        angle, sigma, position_mm = self._angle.step(frame.time_s, position, covariance)
        return Seen(position, covariance, angle, sigma, position_mm)

    def _start(self, frame: LiveFrame) -> bool:
        if frame.luma is None or frame.damaged or frame.time_s - self._looked_s < _LOOK_EVERY_S:
            return False
        first_look = self._looked_s == -math.inf
        self._looked_s = frame.time_s
        height, width = frame.luma.shape
        source = _OneFrame(Frame(0, frame.time_s, frame.luma), self._name, (width, height))
        try:
            start = find_start(source, self._hints)
        except NoResultError as error:
            if self._hints is not None and "tag" not in self._hints.kinds:
                raise
            if first_look:
                self._tell(frame.time_s, frame.index, "lost", f"{error.what}; looking on")
            return False
        self._follower = start.follower()
        words = "found the four markers" + ("" if start.moving is not None else "; the stick that moves will tell")
        self._tell(frame.time_s, frame.index, "found", words)
        return True

    def _now_moving(self, frame: LiveFrame, moving: int) -> None:
        if moving == 0:
            self.swapped = frame.index
        self._tell(frame.time_s, frame.index, "motion", "the moving stick shows; the angle counts from here")

    def earlier(self) -> list[EarlierAngle]:
        """Return, once, the angles of frames before the moving stick showed, some a second."""
        found, self._earlier = self._earlier, []
        return found

    def _keep_still(self, time_s: float, position: Floats, covariance: Floats) -> None:
        if not self._still or time_s - self._still[-1][0] >= STEP_S:
            self._still.append((time_s, position, covariance))

    def _look_back(self, order: list[int]) -> None:
        """Give the frames in which nothing had moved yet their angles."""
        for time_s, position, covariance in self._still:
            angle, sigma, _ = self._angle.step(time_s, position[order], covariance[order])
            if math.isfinite(angle):
                self._earlier.append(EarlierAngle(time_s, angle, sigma))
        self._still.clear()

    def _watch(self, frame: LiveFrame, state: NDArray[np.uint8]) -> None:
        """Tell of each marker that goes and comes back, once."""
        seen = state == CODE["seen"]
        self._away = np.where(seen, np.minimum(self._away, 0) - 1, np.maximum(self._away, 0) + 1)
        for marker in range(4):
            if self._away[marker] == _TELL_AFTER and not self._told[marker]:
                self._told[marker] = True
                why = STATES[int(state[marker])]
                self._tell(frame.time_s, frame.index, "occlusion", f"{MARKERS[marker]} is {why}")
            elif self._away[marker] == -_TELL_AFTER and self._told[marker]:
                self._told[marker] = False
                self._tell(frame.time_s, frame.index, "found", f"{MARKERS[marker]} is found again")

    def _give_up_early(self, frame: LiveFrame, state: NDArray[np.uint8]) -> None:
        """Look for the markers anew where those that were found are lost before anything has moved."""
        if (state == CODE["seen"]).all():
            self._lost_since_s = None
        elif self._lost_since_s is None:
            self._lost_since_s = frame.time_s
        elif frame.time_s - self._lost_since_s > _LOST_EARLY_S and self._hints is None:
            self._tell(frame.time_s, frame.index, "lost", "these were not the markers; looking again")
            self._follower, self._lost_since_s = None, None
            self._still.clear()
            self._away[:], self._told[:] = 0, False


def _nothing() -> Seen:
    return Seen(np.full((4, 2), np.nan), np.full((4, 2, 2), np.nan), math.nan, math.nan, None)


def warm_up() -> None:
    """Follow four drawn dots for a moment: what is loaded on first use is loaded before the first frame comes."""
    cv2.setNumThreads(1)
    tracker = LiveTracker(None, None, name="warm-up", tell=lambda *_: None)
    for index in range(12):
        luma = np.full((240, 320), 90, np.uint8)
        for start_rad, turn_rad in ((2.6, 0.0), (0.4, 0.02 * index)):
            ends = [
                (160 + radius * math.cos(start_rad + turn_rad), 120 - radius * math.sin(start_rad + turn_rad))
                for radius in (20, 36, 84, 100)
            ]
            corner = [(round(16 * x), round(16 * y)) for x, y in ends]
            cv2.line(luma, corner[0], corner[3], 220, 18, cv2.LINE_AA, 4)
            for place in corner[1:3]:
                cv2.circle(luma, place, 16 * 5, 30, -1, cv2.LINE_AA, 4)
        tracker.step(LiveFrame(index, index / 30.0, luma, 0.0))
