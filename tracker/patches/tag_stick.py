"""A stick in every frame, measured on an ArUco or AprilTag tag, whose template is drawn."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from torsight.core.units import Floats
from tracker.appearance.lucas_kanade import READING, Point
from tracker.checkpoint import Kept
from tracker.detect.fiducials import MODULE_PX, FoundTag, bits_of, find_tags
from tracker.follow.follower import nothing
from tracker.patches.align import Fit, Look, Patch
from tracker.patches.patch_track import AS_USUAL, KEPT, PatchTrack, put
from tracker.patches.warps import place, size_of
from tracker.rows import CODE

_ALIKE: Final = 0.85
"""Smallest correlation with a tag. A tag with modules of 6 px under motion blur of 10 px keeps 0.88; one of which half
is covered falls below 0.75."""
_ITS_BITS: Final = 0.75
"""Smallest correlation of the modules inside the black border (blurred as above: 0.85). Another number has about 0."""
_GREW: Final = 1.25
"""Change of size above which a tag's template is rendered again."""
_SOFT: Final = (0.7, 1.0, 1.3, 1.7, 2.2, 3.0)
"""Blurs of the template, in steps of the grid, that are tried when a tag is first found. The sharpest picture has 0.7:
a pixel's own width (0.3) and the sampling (0.65). Between these values the fit estimates the sharpness."""
_QUIET: Final = 0.5
"""Width, in modules, of the white margin around the tag that belongs to the template: further out, the blurred rim of
the paper, one module away, would be taken for the tag's."""
_MOST_SIDE: Final = 48
"""Most points along a side that are compared: more make the fit slower, and hardly better."""


@dataclass(frozen=True, slots=True)
class Tag:
    """One tag: its family, its number, its side in px where it was found, and its blur in steps of the grid.

    The template's plane has its origin in the tag's middle, x along the top edge to the right as printed upright, y
    down; the unit is a pixel.
    """

    family: str
    number: int
    side_px: float
    soft: float = _SOFT[1]

    @classmethod
    def of(cls, family: str, found: FoundTag, luma: NDArray[np.uint8]) -> Tag:
        """Return the tag that was found, with the mean length of its edges and the blur that explains it best."""
        edges = found.corners_px - np.roll(found.corners_px, 1, axis=0)
        side_px = float(np.hypot(edges[:, 0], edges[:, 1]).mean())
        tags = [cls(family, found.number, side_px, soft) for soft in _SOFT]
        fits = [tag.patch().align(luma, tag.warp_of(found)) for tag in tags]
        return max(zip(tags, fits, strict=True), key=lambda one: one[1].likeness if one[1] else -1.0)[0]

    @property
    def spacing_px(self) -> float:
        """Distance between neighbouring points of the template, px."""
        return max(1.0, self.side_px / _MOST_SIDE)

    def patch(self) -> Patch:
        """Return the tag's template as a patch."""
        modules = len(bits_of(self.family, self.number))
        module_px = self.side_px / modules
        return Patch(
            self.look(),
            half_px=0.5 * self.side_px + _QUIET * module_px,
            spacing_px=self.spacing_px,
            freedom=8,
            soft=True,
            within_px=0.5 * self.side_px - module_px,
        )

    def look(self) -> Look:
        """Return the tag's brightness as a function of position, 0 for black and 1 for white."""
        bits = np.pad(bits_of(self.family, self.number), 2, constant_values=True)
        module_px = self.side_px / (len(bits) - 4)
        step = MODULE_PX / module_px
        drawn = np.repeat(np.repeat(bits, MODULE_PX, axis=0), MODULE_PX, axis=1).astype(np.float32)
        fine: NDArray[np.float32] = np.asarray(
            cv2.GaussianBlur(drawn, (0, 0), self.soft * self.spacing_px * step), dtype=np.float32
        )
        middle = 0.5 * (len(fine) - 1)

        def brightness(x: Floats, y: Floats) -> Floats:
            columns, rows = (np.asarray(axis * step + middle, np.float32).reshape(-1, 1) for axis in (x, y))
            seen = cv2.remap(fine, columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
            return np.asarray(seen, dtype=np.float64).ravel()

        return brightness

    def corners(self) -> Floats:
        """Return the corners (4, 2) in the template's plane, in :class:`tracker.detect.fiducials.FoundTag`'s order."""
        half = 0.5 * self.side_px
        return half * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])

    def ends(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Return the two markers in the template's plane: the middles of the tag's left and right edge."""
        half = 0.5 * self.side_px
        return (-half, 0.0), (half, 0.0)

    def warp_of(self, found: FoundTag) -> Floats:
        """Return the warp (3, 3) that maps the template's corners to those found."""
        warp = cv2.getPerspectiveTransform(self.corners().astype(np.float32), found.corners_px.astype(np.float32))
        return np.asarray(warp, dtype=np.float64)


class TagStick(Kept):
    """A stick with a tag, found by OpenCV's detector, then followed.

    Its markers are the middles of the tag's left and right edge, so that the stick points along the tag's own x axis.
    """

    drawn = True

    def __init__(self, family: str, number: int) -> None:
        self.family, self.number = family, number
        self._found: tuple[Tag, PatchTrack] | None = None

    @property
    def radius_px(self) -> float:
        """Half the tag's side, px."""
        return 0.5 * self.length_px

    window_px = 0.0

    @property
    def half_px(self) -> float:
        """Half the width of the stick, px, which is at least that of its markers."""
        return self.radius_px

    @property
    def length_px(self) -> float:
        """The tag's side, px."""
        return math.nan if self._found is None else self._found[0].side_px * size_of(self._found[1].warp)

    def step(self, luma: NDArray[np.uint8], time_s: float, shift: Floats) -> NDArray[np.void]:
        """Return the readings (2,) of both markers in the next frame."""
        del shift
        fit, why = (None, "lost") if self._found is None else self._found[1].follow(luma, time_s, self._judge)
        if why:
            again, still = self._detect(luma, time_s)
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
        if fit.likeness < _ALIKE or fit.inside < _ITS_BITS:
            return "lost"
        return "hidden" if fit.kept < KEPT else ""

    def _detect(self, luma: NDArray[np.uint8], time_s: float) -> tuple[Fit | None, str]:
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
        fit = track.near(luma, tag.warp_of(found[0]), time_s)
        why = "outside" if fit is None else self._judge(fit)
        # What covers a corner moves it, and distorts the whole tag to fit: only the likeness then shows it.
        alike = track.usual - AS_USUAL if track.followed else 0.0
        if why == "hidden" or (fit is not None and not why and fit.likeness > alike):
            return (None, why) if why else (fit, "")
        # The sharpness of the picture may have changed since the template was rendered.
        sharp = Tag.of(self.family, found[0], luma)
        patch = sharp.patch()
        fit = patch.align(luma, sharp.warp_of(found[0]))
        if fit is None or self._judge(fit) or fit.likeness < alike:
            return None, why or "hidden"
        track.replace(patch, sharp.side_px / tag.side_px)
        self._found = sharp, track
        return fit, ""

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
