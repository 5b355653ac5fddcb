"""Rendered templates of ArUco and AprilTag tags."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from torsight.core.units import Floats
from tracker.detect.fiducials import FoundTag, bits_of
from tracker.patches.align import Look, Patch

_FINE: Final = 8
"""Steps per module of the drawing from which a tag's template is sampled."""
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
        step = _FINE / module_px
        drawn = np.repeat(np.repeat(bits, _FINE, axis=0), _FINE, axis=1).astype(np.float32)
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
