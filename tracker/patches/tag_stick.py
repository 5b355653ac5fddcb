"""A stick in every frame by a tag on it."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from tracker.appearance.lucas_kanade import READING
from tracker.detect.tags import FoundTag, find_tags
from tracker.patches.align import Fit, Patch
from tracker.patches.patch_track import PatchTrack
from tracker.patches.stick import KEPT, Point, nothing, put
from tracker.patches.tag_template import Tag
from tracker.patches.warps import Floats, place, size_of
from tracker.rows import CODE

_ALIKE: Final = 0.85
"""Least correlation with a tag. A tag with modules of 6 px that is smeared over 10 px keeps 0.88; one of which half is
covered falls below 0.75."""
_ITS_BITS: Final = 0.75
"""Least correlation of the modules inside the black border (smeared as above: 0.85). Another number has about 0."""
_STEP: Final = 8.0
"""Least grey levels from black to white: below it H.264 flattens a tag."""
_GREW: Final = 1.25
"""Change of size from which a tag's template is made anew."""


class TagStick:
    """A stick with a tag: found by OpenCV's detector, then followed.

    Its markers are the middles of the tag's left and right edge, so that the stick points along the tag's own x axis.

    Parameters
    ----------
    family : str
        See :func:`tracker.detect.tags.family_of`.
    number : int
        The tag's.
    """

    def __init__(self, family: str, number: int) -> None:
        self.family, self.number = family, number
        self._tag: Tag | None = None
        self._track: PatchTrack | None = None

    @property
    def radius_px(self) -> float:
        """Half the tag's side."""
        return 0.5 * self.length_px

    @property
    def length_px(self) -> float:
        """The tag's side."""
        return math.nan if self._tag is None or self._track is None else self._tag.side_px * size_of(self._track.warp)

    @property
    def shutter_share(self) -> float:
        """Not told by a tag."""
        return 0.0

    def step(self, luma: NDArray[np.uint8], time_s: float, shift: Floats) -> NDArray[np.void]:
        """Return what is read of both markers in the next frame."""
        del shift
        fit, why = (None, "lost") if self._track is None else self._track.follow(luma, time_s, self._judge)
        if why:
            again, still = self._detect(luma)
            fit, why = (again, "") if again is not None else (fit, still or why)
        if why or fit is None or self._tag is None or self._track is None:
            self.miss(time_s)
            return nothing(CODE[why or "lost"])
        self._track.take(luma, time_s, fit)
        readings = _of_plane(fit, self._track.patch, self._tag.ends())
        self._resize()
        return readings

    def miss(self, time_s: float) -> None:
        """Pass over a frame that shows nothing."""
        del time_s
        if self._track is not None:
            self._track.miss()

    def _judge(self, fit: Fit) -> str:
        if fit.gain < _STEP or fit.likeness < _ALIKE or fit.inside < _ITS_BITS:
            return "lost"
        return "hidden" if fit.kept < KEPT else ""

    def _detect(self, luma: NDArray[np.uint8]) -> tuple[Fit | None, str]:
        """Look for the tag in the whole picture."""
        found = [tag for tag in find_tags(luma, self.family) if tag.number == self.number]
        if not found:
            return None, ""
        if self._track is not None and len(found) > 1:
            x, y = place(self._track.warp)
            found.sort(key=lambda one: float(np.hypot(*(one.corners_px.mean(axis=0) - (x, y)))))
        tag, track = self._tag, self._track
        if tag is None or track is None:
            tag, track = self._begin(found[0], luma)
        fit = track.patch.align(luma, tag.warp_of(found[0]))
        why = "outside" if fit is None else self._judge(fit)
        return (None, why) if why else (fit, "")

    def _begin(self, found: FoundTag, luma: NDArray[np.uint8]) -> tuple[Tag, PatchTrack]:
        self._tag = tag = Tag.of(self.family, found, luma)
        self._track = track = PatchTrack(tag.patch(), tag.corners(), tag.warp_of(found))
        return tag, track

    def _resize(self) -> None:
        """Make the template anew where the tag's size in the picture has changed."""
        if self._tag is None or self._track is None:
            return
        size = size_of(self._track.warp)
        if not 1.0 / _GREW < size < _GREW:
            self._tag = Tag(self.family, self.number, self._tag.side_px * size, self._tag.soft)
            self._track.replace(self._tag.patch(), self._tag.corners(), size)

    def to_state(self) -> dict[str, Any]:
        """Return what :meth:`restore` needs."""
        if self._tag is None or self._track is None:
            return {}
        return {"side_px": self._tag.side_px, "soft": self._tag.soft, "track": self._track.to_state()}

    def restore(self, state: dict[str, Any]) -> None:
        """Go back to a noted state, exactly."""
        self._tag = self._track = None
        if state:
            self._tag = Tag(self.family, self.number, float(state["side_px"]), float(state["soft"]))
            self._track = PatchTrack(self._tag.patch(), self._tag.corners(), np.eye(3))
            self._track.restore(state["track"])


def _of_plane(fit: Fit, patch: Patch, ends: tuple[Point, Point]) -> NDArray[np.void]:
    """Return two points of one patch as readings.

    Both come from one fit, so their errors are correlated, for which tracks have no place. The angle is made of their
    difference: each has half of the covariance of that.
    """
    one, two = (patch.slope(fit.warp, end) for end in ends)
    covariance = 0.5 * (two - one) @ fit.covariance @ (two - one).T
    readings = np.zeros(2, READING)
    for index, end in enumerate(ends):
        put(readings, index, fit, place(fit.warp, end), covariance, spread=patch.spread)
    return readings
