"""A stick in every frame, measured on a tag."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from torsight.core.units import Floats
from tracker.appearance.lucas_kanade import READING, Point
from tracker.checkpoint import Kept
from tracker.detect.fiducials import find_tags
from tracker.follow.follower import nothing
from tracker.patches.align import Fit, Patch
from tracker.patches.patch_track import KEPT, PatchTrack, put
from tracker.patches.tag_template import Tag
from tracker.patches.warps import place, size_of
from tracker.rows import CODE

_ALIKE: Final = 0.85
"""Smallest correlation with a tag. A tag with modules of 6 px under motion blur of 10 px keeps 0.88; one of which half
is covered falls below 0.75."""
_ITS_BITS: Final = 0.75
"""Smallest correlation of the modules inside the black border (blurred as above: 0.85). Another number has about 0."""
_STEP: Final = 8.0
"""Smallest difference of white and black in grey levels: below it H.264 flattens a tag."""
_GREW: Final = 1.25
"""Change of size above which a tag's template is rendered again."""


class TagStick(Kept):
    """A stick with a tag, found by OpenCV's detector, then followed.

    Its markers are the middles of the tag's left and right edge, so that the stick points along the tag's own x axis.
    """

    drawn = True
    shutter_share, shutter_limits = None, (0.0, 1.0)
    """Not estimated from a tag."""

    def __init__(self, family: str, number: int) -> None:
        self.family, self.number = family, number
        self._found: tuple[Tag, PatchTrack] | None = None

    @property
    def radius_px(self) -> float:
        """Half the tag's side, px."""
        return 0.5 * self.length_px

    @property
    def length_px(self) -> float:
        """The tag's side, px."""
        return math.nan if self._found is None else self._found[0].side_px * size_of(self._found[1].warp)

    def step(self, luma: NDArray[np.uint8], time_s: float, shift: Floats) -> NDArray[np.void]:
        """Return the readings (2,) of both markers in the next frame."""
        del shift
        fit, why = (None, "lost") if self._found is None else self._found[1].follow(luma, time_s, self._judge)
        if why:
            again, still = self._detect(luma)
            fit, why = (again, "") if again is not None else (fit, still or why)
        if why or fit is None or self._found is None:
            self.miss(time_s)
            return nothing(CODE[why or "lost"])
        tag, track = self._found
        track.take(time_s, fit)
        readings = _of_plane(fit, track.patch, tag.ends())
        size = size_of(track.warp)
        if not 1.0 / _GREW < size < _GREW:
            tag = Tag(self.family, self.number, tag.side_px * size, tag.soft)
            track.replace(tag.patch(), size)
            self._found = tag, track
        return readings

    def miss(self, time_s: float) -> None:
        """Skip a frame without a usable picture."""
        del time_s
        if self._found is not None:
            self._found[1].miss()

    def _judge(self, fit: Fit) -> str:
        if fit.gain < _STEP or fit.likeness < _ALIKE or fit.inside < _ITS_BITS:
            return "lost"
        return "hidden" if fit.kept < KEPT else ""

    def _detect(self, luma: NDArray[np.uint8]) -> tuple[Fit | None, str]:
        """Search for the tag in the whole picture; return its fit, or the reason for rejecting it ("" if not found)."""
        found = [tag for tag in find_tags(luma, self.family) if tag.number == self.number]
        if not found:
            return None, ""
        if self._found is None:
            tag = Tag.of(self.family, found[0], luma)
            self._found = tag, PatchTrack(tag.patch(), tag.warp_of(found[0]))
        tag, track = self._found
        last_px = place(track.warp)
        found.sort(key=lambda one: float(np.hypot(*(one.corners_px.mean(axis=0) - last_px))))
        fit = track.patch.align(luma, tag.warp_of(found[0]), track.learnt)
        if fit is None:
            # The sharpness of the picture has changed since the template was rendered.
            sharp = Tag.of(self.family, found[0], luma)
            track.replace(sharp.patch(), sharp.side_px / tag.side_px)
            self._found = sharp, track
            fit = track.patch.align(luma, sharp.warp_of(found[0]), track.learnt)
        why = "outside" if fit is None else self._judge(fit)
        return (None, why) if why else (fit, "")

    def to_state(self) -> dict[str, Any]:
        """Return the state that :meth:`restore` needs."""
        if self._found is None:
            return {}
        tag, track = self._found
        return {"side_px": tag.side_px, "soft": tag.soft, "track": track.to_state()}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Restore a saved state exactly."""
        self._found = None
        if state:
            tag = Tag(self.family, self.number, float(state["side_px"]), float(state["soft"]))
            self._found = tag, PatchTrack(tag.patch(), np.eye(3))
            self._found[1].restore(state["track"])


def _of_plane(fit: Fit, patch: Patch, ends: tuple[Point, Point]) -> NDArray[np.void]:
    """Return the readings (2,) of two points of one patch.

    Both come from one fit, so their errors are correlated, which tracks cannot store. The angle is computed from their
    difference: each point gets half of the difference's covariance.
    """
    one, two = (patch.slope(fit.warp, end) for end in ends)
    covariance = 0.5 * (two - one) @ fit.covariance @ (two - one).T
    readings = np.zeros(2, READING)
    for index, end in enumerate(ends):
        put(readings, index, fit, place(fit.warp, end), covariance, spread=patch.spread)
    return readings
