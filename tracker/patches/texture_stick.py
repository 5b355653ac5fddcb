"""A stick in every frame, measured on the texture around two of its points."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from torsight.core.optics.hanging import USUAL_PX
from torsight.core.units import Floats
from tracker.appearance.lucas_kanade import READING, Point
from tracker.checkpoint import Kept
from tracker.follow.camera_state import SHAKE_PX, circle_misfit, circle_sigma_px
from tracker.follow.judgement import further, rigid_misfit
from tracker.follow.learning import SIZES
from tracker.follow.motion_model import jump_px
from tracker.follow.redetect import SELDOM, Prediction, direction
from tracker.follow.rotation_axis import STANDS_PX, learn_axis, turned
from tracker.follow.state import STICK
from tracker.innovation import passes
from tracker.patches.align import Fit, Patch
from tracker.patches.patch_track import AS_USUAL, KEPT, PatchTrack, put
from tracker.patches.texture import TurnedSearch
from tracker.patches.warps import flatness_of, jacobian, place, similarity, size_of, turn_of
from tracker.rows import CODE

_ALIKE: Final = math.sqrt(0.5)
"""Smallest correlation with texture: half of its variance is explained. Paper next to it or a mere edge stays below."""
_FADED: Final = (0.4, 2.5)
"""Range of the contrast over the mean of the last frames: outside it the texture is not the same."""
_OWN_TURN_RAD: Final = math.radians(12.0)
"""Largest difference between the rotations of a patch and of the line through both points: in a square that is seen at
35 degrees the sides turn by 11 degrees against the diagonals."""


class TextureStick(Kept):
    """A stick with texture around two of its points, each followed by means of its patch in the first frame.

    The points keep their distance, and both patches turn with the line through the points: a patch that slides along an
    edge or onto another object violates one of these. A ``still`` stick is the base, whose direction is constant.
    ``half_px`` is half the width of the stick.
    """

    drawn = False
    kept = ("_own", "_tracks", "_home")

    def __init__(
        self,
        patches: Sequence[Patch],
        points_px: Sequence[Point],
        search: TurnedSearch,
        *,
        still: bool,
        half_px: float,
    ) -> None:
        self._tracks = [PatchTrack(patch, similarity(x, y)) for patch, (x, y) in zip(patches, points_px, strict=True)]
        self._search = search
        self.half_px = half_px
        self._points = list(points_px)
        (x1, y1), (x2, y2) = points_px
        self._offset = np.array([x2 - x1, y2 - y1])
        self._own = np.zeros(1, STICK)
        self._own["length"] = self._own["shortest"] = self._own["longest"] = np.hypot(*self._offset)
        self._own["axis"]["last_rad"] = math.nan
        self._own["still"], self._own["start_rad"] = still, math.atan2(y2 - y1, x2 - x1)
        self._shift, self._home = np.zeros(2), [track.warp for track in self._tracks]

    @property
    def radius_px(self) -> float:
        """Half the radius of a patch, px: the equivalent of a dot's radius."""
        return 0.5 * self._tracks[0].patch.half_px

    @property
    def window_px(self) -> float:
        """Radius of the larger patch, px: what lies over a part of it may look alike."""
        return max(track.patch.half_px for track in self._tracks)

    @property
    def length_px(self) -> float:
        """Distance between both points, px."""
        return float(self._own["length"][0])

    def step(self, luma: NDArray[np.uint8], time_s: float, shift: Floats) -> NDArray[np.void]:
        """Return the readings (2,) of both markers in the next frame."""
        self._shift = shift
        found = [track.follow(luma, time_s, partial(self._judge, track)) for track in self._tracks]
        # In an oblique view the distance changes as the stick turns.
        ahead = [place(track.ahead) for track in self._tracks]
        fits: list[Fit | None] = [None if why else fit for fit, why in found]
        whys = [why for _, why in found]
        for lost, seen in ((0, 1), (1, 0)):
            partner = fits[seen]
            if whys[lost] and partner is not None:
                fits[lost], whys[lost] = self._beside(luma, lost, partner, whys[lost])
        self._judge_together(fits, whys, ahead)
        if all(whys):
            again = self._find(luma, ahead)
            if again is not None:
                fits, whys = [*again], ["", ""]
        if not any(whys):
            fits = self._turned(fits)
        readings = np.zeros(2, READING)
        readings["state"] = [
            CODE[why or "lost"] if why or fit is None else CODE["seen"] for fit, why in zip(fits, whys, strict=True)
        ]
        for index, (track, fit) in enumerate(zip(self._tracks, fits, strict=True)):
            if whys[index] or fit is None:
                track.miss()
            else:
                track.take(time_s, fit)
                slope = track.patch.slope(fit.warp, (0.0, 0.0))
                covariance = slope @ fit.covariance @ slope.T
                put(readings, index, fit, place(fit.warp), covariance, spread=track.patch.spread)
        if not any(whys):
            one, two = (place(track.warp) for track in self._tracks)
            own, length = self._own[0], math.dist(one, two)
            own["length"] = length
            if not own["still"]:
                own["shortest"], own["longest"] = min(own["shortest"], length), max(own["longest"], length)
                (x1, y1), (x2, y2) = (np.array([one, two]) - shift).tolist()
                learn_axis(own["axis"], (x1, y1), (x2, y2))
        return readings

    def miss(self, time_s: float) -> None:
        """Skip a frame without a usable picture."""
        del time_s
        for track in self._tracks:
            track.miss()

    def _judge(self, track: PatchTrack, fit: Fit) -> str:
        if fit.likeness < _ALIKE or not _FADED[0] < fit.gain / track.gain < _FADED[1]:
            return "hidden"
        # In the picture of a camera that comes nearer the whole stick is larger.
        size = size_of(fit.warp) * float(np.hypot(*self._offset)) / self.length_px
        # Within these sizes the shorter axis of a circle's image is no less than half of the longer one.
        if not SIZES[0] < size < SIZES[1] or flatness_of(fit.warp) < SIZES[0] / SIZES[1]:
            return "lost"
        return "hidden" if fit.kept < KEPT else ""

    def _beside(self, luma: NDArray[np.uint8], lost: int, partner: Fit, why: str) -> tuple[Fit | None, str]:
        """Search for one point at the position extrapolated from the other's warp: its place, rotation and shear.

        The warp's errors are extrapolated, too: they give the size of the region that is searched.
        """
        offset = self._offset if lost else -self._offset
        seen = jacobian(partner.warp)
        x, y = (np.array(place(partner.warp)) + seen @ offset).tolist()
        guess = np.array([[*seen[0], x], [*seen[1], y], [0.0, 0.0, 1.0]])
        track, own = self._tracks[lost], self._own[0]
        fit = track.patch.align(luma, guess)
        reason = why if fit is None else self._judge(track, fit)
        if not reason:
            return fit, ""
        # The base's direction is known.
        if own["still"]:
            return None, reason
        slope = self._tracks[1 - lost].patch.slope(partner.warp, (offset[0], offset[1]))
        variance = np.linalg.eigvalsh(slope @ partner.covariance @ slope.T)[-1]
        circle_px = circle_sigma_px(self.length_px, own["longest"] / own["shortest"] - 1.0)
        for warp in self._search.near(luma, lost, guess, math.hypot(circle_px, math.sqrt(variance))):
            fit = track.patch.align(luma, warp)
            # Among many positions a wrong one may reach the lowest correlation: the usual one is required.
            if fit is not None and not self._judge(track, fit) and fit.likeness > track.usual - AS_USUAL:
                return fit, ""
        return None, reason

    def _judge_together(self, fits: list[Fit | None], whys: list[str], ahead: Sequence[Point]) -> None:
        """Reject, in ``whys``, fits that are not consistent with one rigid stick."""
        if self._own[0]["still"]:
            self._judge_rest(fits, whys)
        one, two = fits
        if one is None or two is None or any(whys):
            known = self._own[0]["still"] or self._own[0]["axis"]["known"]
            for end, (fit, track) in enumerate(zip(fits, self._tracks, strict=True)):
                # While its partner is hidden, only the circle shows that a patch slides onto another object; before the
                # circle is known, only the correlation does.
                if fit is not None and not whys[end]:
                    off = circle_misfit(self._own[0], self._shift, place(fit.warp), end)
                    as_usual = known or fit.likeness > track.usual - AS_USUAL
                    whys[end] = "" if as_usual and passes(off**2, 1) else "hidden"
            return
        a, b, lost = place(one.warp), place(two.warp), max(track.lost for track in self._tracks)
        own = self._as_seen(one, two) if lost else self._own[0]
        rigid = rigid_misfit(own, self._shift, a, b, lost, math.dist(*ahead))
        if not (passes(*rigid) and self._turns_along(one, two)):
            # The patch whose correlation falls further below its usual one is wrong; in a repeated pattern, where
            # several positions fit equally well, the one that is further from its predicted position.
            short = [track.usual - fit.likeness for track, fit in zip(self._tracks, (one, two), strict=True)]
            away_px = [math.dist(place(fit.warp), point) for fit, point in zip((one, two), ahead, strict=True)]
            alike = abs(short[0] - short[1]) < AS_USUAL
            for this, other in ((0, 1), (1, 0)):
                right = further(away_px[other], away_px[this]) if alike else short[this] < short[other]
                whys[this] = "" if right else "hidden"

    def _judge_rest(self, fits: Sequence[Fit | None], whys: list[str]) -> None:
        """Reject, in ``whys``, a patch of the base that moves while the other one rests or is not seen.

        A camera moves both. One that comes nearer, or rolls, about a place near the one that moves less, enlarges or
        turns that one.
        """
        seen = {end: fit.warp for end, fit in enumerate(fits) if fit is not None and not whys[end]}
        off_px = [math.dist(place(now), place(self._home[end])) for end, now in seen.items()]
        if len(seen) < 2:
            for end, px in zip(seen, off_px, strict=True):
                whys[end] = "" if passes((px / STANDS_PX) ** 2, 2) else "hidden"
            return
        still = int(off_px[1] < off_px[0])
        now, home, half_px = seen[still], self._home[still], self._tracks[still].patch.half_px
        change = np.array([size_of(now) / size_of(home) - 1.0, turn_of(now) - turn_of(home)]) * half_px / USUAL_PX
        rests = passes(float(change @ change), 2)
        if rests and further(off_px[1 - still], off_px[still]):
            whys[1 - still] = "hidden"
        elif not rests or not passes((off_px[still] / STANDS_PX) ** 2, 2):
            self._home = [*seen.values()]

    def _as_seen(self, one: Fit, two: Fit) -> Any:
        """Return the stick's state with its present length in the picture, predicted from both patches' warps.

        Between two points of a plane the offset in the picture is the template's times the mean of the warp's
        derivatives at both, to second order.
        """
        own = self._own[0]
        if own["still"] or not all(track.patch.turns for track in self._tracks):
            return own
        own = own.copy()
        own["length"] = np.hypot(*(0.5 * (jacobian(one.warp) + jacobian(two.warp)) @ self._offset))
        return own

    def _turn_between(self, one: Fit, two: Fit) -> float:
        """Return the rotation of the line through both points, rad."""
        return direction(place(one.warp), place(two.warp)) - math.atan2(*self._offset[::-1])

    def _turned(self, fits: list[Fit | None]) -> list[Fit | None]:
        """Give patches whose own rotation is not observable that of the line through both points."""
        turn = self._turn_between(*(fit for fit in fits if fit is not None))
        return [
            replace(fit, warp=similarity(*place(fit.warp), turn_rad=turn))
            if fit is not None and not track.patch.turns
            else fit
            for track, fit in zip(self._tracks, fits, strict=True)
        ]

    def _turns_along(self, one: Fit, two: Fit) -> bool:
        """Return whether both patches are rotated as much as the line through both points."""
        turn = self._turn_between(one, two)
        return all(
            not track.patch.turns or turned(turn_of(fit.warp), turn) < _OWN_TURN_RAD
            for track, fit in zip(self._tracks, (one, two), strict=True)
        )

    def _find(self, luma: NDArray[np.uint8], ahead: Sequence[Point]) -> tuple[Fit, Fit] | None:
        """Search for the stick where it may be: a few frames after it was lost that is in the whole picture."""
        # A search around its axis costs 15 times as much as following, and one in the whole picture 100 times.
        lost = min(track.lost for track in self._tracks) + 1
        if lost > 1 and lost % SELDOM:
            return None
        jumped, shaken = (
            Prediction((ahead[0], ahead[1]), sigma_px, self._own[0], self._shift)
            for sigma_px in (jump_px(self.length_px, lost), SHAKE_PX * math.sqrt(2.0))
        )
        found = self._alike(luma, jumped, lost=lost)
        # A shake lasts one frame. In a repeated pattern with several candidates none is chosen.
        near = [pair for pair in found if passes(*shaken.innovation([place(fit.warp) for fit in pair], lost=lost))]
        found = near if near and lost == 1 else found
        return found[0] if len(found) == 1 else None

    def _alike(self, luma: NDArray[np.uint8], expected: Prediction, *, lost: int) -> list[tuple[Fit, Fit]]:
        """Return the fits of both patches at all positions that match the stick, in the order of coarse correlation."""
        height, width = luma.shape
        found: list[tuple[Fit, Fit]] = []
        for warp in self._search.find(luma, expected.region(0, (width, height))):
            one = self._tracks[0].patch.align(luma, warp)
            if one is None or self._judge(self._tracks[0], one):
                continue
            two, why = self._beside(luma, 1, one, "lost")
            if two is None or why or not self._turns_along(one, two):
                continue
            ends, seen = [place(one.warp), place(two.warp)], replace(expected, own=self._as_seen(one, two))
            if not any(self._at(ends, [place(fit.warp) for fit in pair]) for pair in found) and passes(
                *seen.innovation(ends, lost=lost)
            ):
                found.append((one, two))
        return found

    def _at(self, ends: Sequence[Point], others: Sequence[Point]) -> bool:
        """Return whether two pairs of positions are the same to within half a patch's radius."""
        return max(math.dist(*pair) for pair in zip(ends, others, strict=True)) < self.radius_px

    def turn_that_looks_alike_deg(self, first: NDArray[np.uint8]) -> float:
        """Return the smallest rotation after which the stick would look the same, degrees; NaN where there is none.

        ``first`` is the picture from which the patches were taken. The standard deviation of the position in that
        search is the stick's length.
        """
        expected = Prediction((self._points[0], self._points[1]), self.length_px, self._own[0], np.zeros(2))
        others = [[place(fit.warp) for fit in pair] for pair in self._alike(first, expected, lost=1)]
        turns = [
            turned(math.atan2(*np.subtract(two, one)[::-1]), self._own[0]["start_rad"])
            for one, two in others
            if not self._at([one, two], self._points)
        ]
        return math.degrees(min(turns, default=math.nan))
