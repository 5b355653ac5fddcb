"""Markers and angle frame by frame: finding the markers, following them, reporting events."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, Final, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from torsight.core.errors import NoResultError
from torsight.core.optics.camera import Camera
from torsight.core.progress import THOUGHT_S
from torsight.core.tracks import FEW, MARKERS, MarkerTracks, mean_sigma
from torsight.core.units import Floats
from torsight.viewer.live.frames.intake import Picture
from torsight.viewer.live.measure.angle import LiveAngle
from torsight.viewer.live.measure.model_watch import STEP_S
from torsight.viewer.live.measure.which_markers import ENDS, OTHERS, Decision, WhichMarkers
from tracker.detect.marker_file import MarkerHints
from tracker.follow.follower import Follower
from tracker.frames.frame import DEFAULT_FPS, Damage, Frame
from tracker.initialise import find_start
from tracker.innovation import SURE
from tracker.rows import CODE, STATES
from tracker.stick_direction import square
from tracker.track import told_by_motion

_LOOK_EVERY_S: Final = 0.5 * THOUGHT_S
"""Interval between searches for the markers until they are found."""
_REPORT_AFTER: Final = math.ceil(math.log(3600.0 * DEFAULT_FPS) / -math.log(FEW))
"""Frames for which a marker must be lost, or found again, before that is reported: n successive frames are missed once
in FEW⁻ⁿ by chance, if few are missed, and that shall be no more often than once in an hour."""
_EARLIER_MOST: Final = round(3600.0 / STEP_S)
"""Positions kept from the time before anything moves, an hour: their angles become known with the first motion."""
_SAME: Final = [0, 1, 2, 3]
"""Indices of the followed markers in the order of ``MARKERS``."""
_LOST_EARLY_S: Final = 2.0 * _LOOK_EVERY_S
"""Time after which a start is rejected, two searches, if its markers are lost before anything has moved."""

_Mend = tuple[int, list[int] | MarkerTracks]
"""New order of a number of first rows, or their replacement from the row in which the markers were found."""
Tell = Callable[[float, int, str, str], None]
"""Takes time (s), frame, kind and words of an event."""


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """Measurement of one frame; NaN where not seen or not known.

    The markers (4, 2) in the order of ``MARKERS`` with their covariances (4, 2, 2), the angle with its sigma, and with
    a calibrated camera the positions in space (4, 3).
    """

    position_px: Floats
    covariance_px2: Floats
    angle_rad: float
    sigma_rad: float
    position_mm: Floats | None


class EarlierAngle(NamedTuple):
    """An angle that became known later: of a frame before the moving stick was known."""

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
    """Finds the markers, follows them, and computes the angle of each frame.

    Hints give the positions of the markers in the first frame; ``name`` is that of the source, for messages; ``tell``
    takes the events.
    """

    def __init__(
        self, hints: MarkerHints | None, camera: Camera | None, *, name: str, tell: Tell, pixel_aspect: float = 1.0
    ) -> None:
        self.which: WhichMarkers | None = None
        """Decides which dots are the markers; None where the user marked them."""
        self.undecided = False
        self.anew = False
        """Whether the angles so far belong to other markers; the reader resets this flag."""
        self._mends: list[_Mend] = []
        self._order, self._exchanged = _SAME, [False, False]
        self._began = 0
        self._hints = hints
        self._name = name
        self._tell = tell
        self._new_angle = partial(LiveAngle, camera, pixel_aspect=pixel_aspect)
        self._angle = self._new_angle()
        self._follower: Follower | None = None
        self._looked_s = -math.inf
        self._away = np.zeros(4, np.int64)
        self._reported = np.zeros(4, bool)
        self._lost_since_s: float | None = None
        self._still: deque[tuple[float, Floats, Floats]] = deque(maxlen=_EARLIER_MOST)
        self._earlier: list[EarlierAngle] = []

    @property
    def found(self) -> bool:
        """Whether markers have been found."""
        return self._follower is not None

    def step(self, frame: Picture) -> Seen:
        """Process the next frame; ConfigError or NoResultError when given markers are not found."""
        if self._follower is None:
            self._start(frame)
        follower = self._follower
        if follower is None:
            return Seen(np.full((4, 2), np.nan), np.full((4, 2, 2), np.nan), math.nan, math.nan, None)
        knew = follower.moving
        picture = Frame(frame.index, frame.time_s, frame.luma, damaged=frame.damaged or frame.dropped)
        row = follower.step(picture)
        if knew is None and follower.moving is not None:
            self._tell(frame.time_s, frame.index, "motion", "the moving stick shows; the angle counts from here")
        if self._decide(frame, picture) and self._follower is not None:
            follower = self._follower
            row = follower.step(picture)
        order = self._ordered(frame.index)
        state = row["state"][order]
        position = np.where((state == CODE["seen"])[:, None], row["position_px"][order], np.nan)
        covariance = square(row["covariance_px2"][order])
        if not frame.dropped:
            self._watch(frame, state)
        if knew is None and follower.moving is not None:
            self._look_back(order)
        if follower.moving is None:
            if not frame.dropped:
                self._give_up_early(frame, state)
                self._keep_still(frame.time_s, position, covariance)
            return Seen(position, covariance, math.nan, math.nan, None)
        angle, sigma, position_mm = self._angle.step(frame.time_s, position, covariance)
        return Seen(position, covariance, angle, sigma, position_mm)

    def _start(self, frame: Picture) -> None:
        """Begin to follow the markers, if a search is due and finds them."""
        if frame.luma is None or frame.damaged or frame.time_s - self._looked_s < _LOOK_EVERY_S:
            return
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
            return
        self._follower = start.follower()
        self._began, self._order, self._exchanged = frame.index, _SAME, [False, False]
        self._mends.clear()
        if start.choice is not None:
            self.which, self.undecided = WhichMarkers(frame.luma), True
        words = "found the four markers" + ("" if start.moving is not None else "; which stick moves is not known yet")
        self._tell(frame.time_s, frame.index, "found", words)

    def _ordered(self, rows: int) -> list[int]:
        """Return the indices of the followed markers in the order of ``MARKERS``; ``rows`` have the previous order."""
        moving = None if self._follower is None else self._follower.moving
        base = 0 if moving is None else 1 - moving
        order = [2 * stick + (end ^ int(self._exchanged[stick])) for stick in (base, 1 - base) for end in (0, 1)]
        if order != self._order:
            self._mends.append((rows, [self._order.index(marker) for marker in order]))
            self._order = order
        return order

    def _settle(self, which: WhichMarkers, decision: Decision, rows: int, follower: Follower | None) -> None:
        """Continue with the decided markers; if others were followed, the last ``rows`` rows are replaced."""
        self.undecided = False
        tracks = which.tracks(decision)
        if decision.base is None:
            self._mends.append((rows, tracks))
            self._order, self._exchanged, self._follower = _SAME, [False, False], follower
        elif any(decision.exchanged):
            self._exchanged = list(decision.exchanged[:: -1 if decision.base else 1])
        else:
            return
        what = OTHERS if decision.base is None else ENDS
        self._tell(float(tracks.time_s[-1]), rows - 1, "motion", f"{what}; the angle is of these, from the start")
        self.anew, self._angle = True, self._new_angle()
        self._still.clear()
        for one in zip(tracks.time_s.tolist(), tracks.position_px, tracks.covariance_px2, strict=True):
            self._keep_still(*one)
        self._look_back(_SAME)

    def _decide(self, frame: Picture, picture: Frame) -> bool:
        """Decide which dots are the markers if that is due; return whether other dots are followed from now on."""
        if self.which is None or not self.undecided or not self.which.add(picture):
            return False
        decision = self.which.decide()
        follower = self._follower
        if not self.which.sure:
            return False
        if decision.base is None:
            follower = self.which.follower(decision)
        if follower is None or follower.moving is None:
            return False
        before, self._follower = self._follower, follower
        self._settle(self.which, decision, frame.index + 1, follower)
        return follower is not before

    def end(self, rows: int) -> None:
        """Decide from the whole record of ``rows`` rows which dots are the markers, if no decision was sure before."""
        if self.which is not None and self.undecided and rows > self._began + 1:
            decision = self.which.decide()
            self._settle(self.which, decision, rows, self._follower)
            if decision.base is not None:
                self._ordered(rows)

    def chosen(self, tracks: MarkerTracks) -> tuple[MarkerTracks, dict[str, Any]]:
        """Return the markers of a record in the order decided from all frames, with the probability of this choice."""
        if self.which is None:
            return tracks, {}
        order, report, variance_rad2 = told_by_motion(tracks, self.which.choice, radius_px=self.which.radius_px)
        last_s, last = float(tracks.time_s[-1]), len(tracks) - 1
        if order != _SAME:
            self._tell(last_s, last, "motion", f"{ENDS}; the angle is of these, from the start")
        if not report["probability"] > SURE:
            words = f"that these are the markers has a probability of {report['probability']:.2g}"
            self._tell(last_s, last, "motion", f"{words}; name them with --markers to be sure")
        markers = {name: getattr(tracks, name)[:, order] for name in ("position_px", "covariance_px2", "valid")}
        return replace(tracks, **markers, choice_rad2=variance_rad2), {"markers": report}

    def mended(self, values: Floats) -> Floats:
        """Return the recorded markers (rows, 4, x, y and sigma), corrected by the decisions made since."""
        # Dots that were followed before were given up.
        values[: self._began] = np.nan
        for rows, change in self._mends:
            if isinstance(change, MarkerTracks):
                sigma_px = mean_sigma(change.covariance_px2)
                values[self._began : rows] = np.concatenate([change.position_px, sigma_px[..., None]], axis=2)
            else:
                values[self._began : rows] = values[self._began : rows, change]
        return values

    def earlier(self) -> list[EarlierAngle]:
        """Return, once, the angles of frames before the moving stick was known, a few per second."""
        found, self._earlier = self._earlier, []
        return found

    def _keep_still(self, time_s: float, position: Floats, covariance: Floats) -> None:
        if not self._still or time_s - self._still[-1][0] >= STEP_S:
            self._still.append((time_s, position, covariance))

    def _look_back(self, order: list[int]) -> None:
        """Compute the angles of the frames in which nothing had moved yet."""
        for time_s, position, covariance in self._still:
            angle, sigma, _ = self._angle.step(time_s, position[order], covariance[order])
            if math.isfinite(angle):
                self._earlier.append(EarlierAngle(time_s, angle, sigma))
        self._still.clear()

    def _watch(self, frame: Picture, state: NDArray[np.uint8]) -> None:
        """Report each loss and each return of a marker, once."""
        seen = state == CODE["seen"]
        self._away = np.where(seen, np.minimum(self._away, 0) - 1, np.maximum(self._away, 0) + 1)
        for marker in range(4):
            if self._away[marker] == _REPORT_AFTER and not self._reported[marker]:
                self._reported[marker] = True
                why = STATES[int(state[marker])]
                self._tell(frame.time_s, frame.index, "occlusion", f"{MARKERS[marker]} is {why}")
            elif self._away[marker] == -_REPORT_AFTER and self._reported[marker]:
                self._reported[marker] = False
                self._tell(frame.time_s, frame.index, "found", f"{MARKERS[marker]} is found again")

    def _give_up_early(self, frame: Picture, state: NDArray[np.uint8]) -> None:
        """Search for the markers again where the found ones are lost before anything has moved."""
        if (state == CODE["seen"]).all():
            self._lost_since_s = None
        elif self._lost_since_s is None:
            self._lost_since_s = frame.time_s
        elif frame.time_s - self._lost_since_s > _LOST_EARLY_S and self._hints is None:
            self._tell(frame.time_s, frame.index, "lost", "these were not the markers; looking again")
            self._follower, self._lost_since_s, self.undecided = None, None, False
            self._still.clear()
            self._away[:], self._reported[:] = 0, False


def warm_up() -> None:
    """Follow four drawn dots briefly, so that everything is loaded and compiled before the first frame arrives."""
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
        tracker.step(Picture(index / 30.0, luma, index=index))
