"""The two markers of a stick, and what holds for any stick: the distance between them is constant."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tracker.marker import Marker, Point
from tracker.recover import Found, Region, pairs_at_distance, places_like
from tracker.sight import Sight, direction


class Pair:
    """The two markers of a stick.

    Parameters
    ----------
    markers : four Marker
        All markers of the film.
    stick : int
        Which stick, 0 or 1.
    """

    def __init__(self, markers: Sequence[Marker], stick: int) -> None:
        self.stick = stick
        self.inner, self.outer = markers[2 * stick], markers[2 * stick + 1]
        self.indices = (2 * stick, 2 * stick + 1)
        self.length_px = self.inner.distance(self.outer.x_px, self.outer.y_px)
        self.shortest_px = self.longest_px = self.length_px
        self.start_rad = self.direction_rad

    @property
    def markers(self) -> tuple[Marker, Marker]:
        """Both markers."""
        return self.inner, self.outer

    @property
    def ends(self) -> tuple[Point, Point]:
        """Where both markers are."""
        return (self.inner.x_px, self.inner.y_px), (self.outer.x_px, self.outer.y_px)

    @property
    def direction_rad(self) -> float:
        """Direction from inner to outer marker in the picture (y down)."""
        return direction(*self.ends)

    def check_length(self, sight: Sight) -> None:
        """Refuse the marker that is further from its prediction where the distance is not right."""
        i, j = self.indices
        a, b = sight.good(i), sight.good(j)
        if a is None or b is None:
            return
        length = math.hypot(b.x_px - a.x_px, b.y_px - a.y_px)
        # Seen from aside the distance changes as the stick turns, the more the longer it was not seen.
        stale = min(self.inner.lost + self.outer.lost, 20)
        if abs(length - self.length_px) <= 0.8 + 0.01 * self.length_px * (1.0 + 0.5 * stale):
            return
        if stale == 0 and abs(length - math.dist(sight.predicted[i], sight.predicted[j])) <= 0.8 + 0.01 * length:
            # It turns fast enough, seen from aside, for its length in the picture to change from frame to frame.
            return
        off = [math.hypot(r.x_px - sight.predicted[k][0], r.y_px - sight.predicted[k][1]) for r, k in ((a, i), (b, j))]
        if max(off) > 2.0 * min(off) + 0.5:
            sight.reasons[i if off[0] > off[1] else j] = "hidden"
        else:
            sight.reasons[i] = sight.reasons[j] = "hidden"

    def note_length(self, sight: Sight) -> None:
        """Follow the distance in the picture where both markers were read."""
        a, b = sight.good(self.indices[0]), sight.good(self.indices[1])
        if a is not None and b is not None:
            self.length_px += 0.2 * (math.hypot(b.x_px - a.x_px, b.y_px - a.y_px) - self.length_px)
            self.shortest_px = min(self.shortest_px, self.length_px)
            self.longest_px = max(self.longest_px, self.length_px)

    @property
    def varies(self) -> float:
        """By which share its length in the picture has varied: a measure of how much from aside it is seen."""
        return self.longest_px / self.shortest_px - 1.0

    def look_for(self, luma: NDArray[np.uint8], region: Region) -> list[Found]:
        """Return every pair of dots in a region that could be this stick."""
        light_dot = self.inner.template.shape.contrast > 0
        places = places_like(luma, radius_px=self.inner.radius_px, light_dot=light_dot, region=region)
        return pairs_at_distance(
            luma,
            places,
            inner=self.inner,
            outer=self.outer,
            length_px=0.5 * (self.shortest_px + self.longest_px),
            tolerance_px=1.5 + 0.05 * self.length_px + 0.6 * (self.longest_px - self.shortest_px),
        )

    def to_state(self) -> dict[str, Any]:
        """Return what :meth:`restore` needs."""
        lengths = [self.length_px, self.shortest_px, self.longest_px]
        return {"lengths_px": lengths, "start_rad": self.start_rad}

    def restore(self, state: dict[str, Any]) -> None:
        """Go back to a noted state."""
        self.length_px, self.shortest_px, self.longest_px = (float(value) for value in state["lengths_px"])
        self.start_rad = float(state["start_rad"])
