"""Choice of the markers among the dots of the first picture, and of each stick's inner marker, by their motion."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from torsight.core.progress import ATTENTION_S
from torsight.core.tracks import MarkerTracks
from tracker.couples import Choice, Couple
from tracker.detect.dots import find_and_refuse
from tracker.detect.given_positions import LOOKED_AT
from tracker.detect.sticks import is_clear
from tracker.follow.followed_dots import DotState
from tracker.follow.follower import Follower
from tracker.follow.marker import markers_on
from tracker.follow.motion_model import STALE
from tracker.frames.frame import Frame
from tracker.hypotheses import Weighing
from tracker.innovation import SURE
from tracker.track import told_by_motion

OTHERS: Final = "as they move, other dots than those of the first picture are the markers"
ENDS: Final = "as they move, a marker that was called the inner one is the outer one"
UNDECIDED: Final = "which dots are the markers, and which of a stick's is the inner one, is not decided until they move"


@dataclass(frozen=True, slots=True, eq=False)
class Decision:
    """The couple of sticks that is most likely by the motion so far, inner markers first.

    ``base`` is the index of the followed stick that is the base, None where other sticks are followed; ``exchanged``
    (2,) is true, for base and moving stick, where the marker followed as the inner one is the outer one.
    """

    couple: Couple
    base: int | None
    exchanged: list[bool]


class WhichMarkers:
    """Weighs the couples of sticks that a picture may show, as later frames arrive.

    ``choice`` is the last chosen couple; ``sure``: this choice, and that of the inner markers, is final.
    """

    def __init__(self, luma: NDArray[np.uint8]) -> None:
        self._first = luma.copy()
        self._weighing = Weighing(self._first, [dot for dot in find_and_refuse(luma)[0] if is_clear(dot)])
        self.choice = Choice.of(self._weighing.weighed())
        self.sure = False
        self._followed = self.choice.taken
        self._frames, self._due, self._due_s = 0, STALE, 0.0
        self._was_sure = False

    @property
    def radius_px(self) -> float:
        """Usual radius of a marker."""
        sticks = (self.choice.taken.base, self.choice.taken.moving)
        return float(np.median([dot.radius_px for stick in sticks for dot in (stick.inner, stick.outer)]))

    def add(self, frame: Frame) -> bool:
        """Follow all candidates into the next frame; return whether it is time to decide."""
        self._weighing.add(frame)
        if not self._frames:
            self._due_s = frame.time_s
        self._frames += 1
        due = self._frames >= self._due or frame.time_s >= self._due_s + ATTENTION_S
        if due:
            self._due, self._due_s = 2 * self._frames, frame.time_s
        return due or self.sure

    def follower(self, decision: Decision) -> Follower | None:
        """Return a follower of the decided markers, if the last frame shows the moving stick.

        The base is taken at its last known position.
        """
        tracks = self.tracks(decision)
        places, valid = tracks.position_px, tracks.valid
        if not valid[-1, 2:].all() or not valid.any(axis=0).all():
            return None
        sticks = (decision.couple.base, decision.couple.moving)
        markers = [marker for stick in sticks for marker in markers_on(self._first, stick)]
        for index, marker in enumerate(markers):
            marker.record["x"], marker.record["y"] = places[valid[:, index], index][-1]
        return Follower([DotState(markers)], moving=1)

    def decide(self) -> Decision:
        """Decide from the frames seen so far which dots are the markers.

        A decision is sure once two in succession agree: what fits a short stretch may not fit a longer one. It uses at
        most as many frames as the search for markers in a film, because the next frame waits for the decision.
        """
        every = 1 + self._frames // LOOKED_AT[-1]
        self.choice = Choice.of(self._weighing.weighed())
        taken = self.choice.taken
        tracks = self._weighing.tracks(taken, every=every)
        order, report, _ = told_by_motion(tracks, self.choice, radius_px=self.radius_px)
        sure = taken.probability * (1.0 - report["opposite_probability"]) > SURE
        self.sure, self._was_sure = sure and self._was_sure, sure
        sticks = [stick.turned() if order[2 * i] % 2 else stick for i, stick in enumerate((taken.base, taken.moving))]
        couple = replace(taken, base=sticks[0], moving=sticks[1])
        self.choice = replace(self.choice, taken=couple)
        followed = (self._followed.base, self._followed.moving)
        pairs = [[stick.is_of(other) for other in followed] for stick in sticks]
        base = 0 if pairs == [[True, False], [False, True]] else 1 if pairs == [[False, True], [True, False]] else None
        ends = zip(sticks, followed[::-1] if base else followed, strict=True)
        exchanged = [base is not None and stick.inner is not other.inner for stick, other in ends]
        return Decision(couple, base, exchanged)

    def tracks(self, decision: Decision) -> MarkerTracks:
        """Return the tracks of these markers in all frames since the picture."""
        return self._weighing.tracks(decision.couple)
