"""Session of the page for picking markers: its requests about the film, and its end; independent of HTTP."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from torsight.core.errors import ConfigError, NoResultError
from torsight.core.files.small_pictures import encoded
from torsight.core.tracks import MARKERS
from torsight.core.units import Floats
from torsight.core.words.colours import BASE_COLOUR, MOVING_COLOUR, hex_of
from torsight.markers.beginning import Beginning, follow_beginning, name_sticks, seconds_of
from torsight.markers.picks import PICKED, SNAPS, content_of, hints_of, place, read_earlier, write_markers
from tracker.detect.marker_file import STICKS

if TYPE_CHECKING:
    from tracker.detect.candidates import Sighting
    from tracker.frames.source import Source

NAMING_S: Final = 10.0
"""Length of the film that is searched to find which of the two sticks moves: films begin with a rest."""


class Session:
    """One film, one marker file to write; ``saved`` is the content of the file, once it is written."""

    def __init__(self, source: Source, *, out: Path) -> None:
        self.source = source
        self.out = out
        self.saved: dict[str, Any] | None = None
        self.first, self.index = first_picture(source)
        self._earlier, self._remark = read_earlier(out)
        self._pictures: tuple[bytes, ...] = ()
        # Checks run the tracker over the one source: one at a time.
        self._busy = threading.Lock()
        self._seen, self._found = find_markers(source, self.first)

    def state(self) -> dict[str, Any]:
        """Return the initial state of the page."""
        height, width = self.first.shape
        found = self._found if self._found is not None else self._seen.sticks_px
        return {
            "film": Path(self.source.name).name,
            "width": width,
            "height": height,
            "frame": self.index,
            "out": str(self.out),
            "markers": list(MARKERS),
            "kinds": list(PICKED),
            "colours": {"base": hex_of(BASE_COLOUR), "moving": hex_of(MOVING_COLOUR)},
            "found": None if found is None else dict(zip(MARKERS, found.reshape(4, 2).tolist(), strict=True)),
            "found_note": self._found_note(),
            "candidates": [
                {"number": one.number, "x": one.x_px, "y": one.y_px, "radius": one.radius_px, "reason": one.reason}
                for one in self._seen.candidates
                if one.is_dot
            ],
            "earlier": self._earlier_picks(),
            "remark": self._remark,
        }

    def _found_note(self) -> str:
        if self._seen.sticks_px is None:
            return f"Not found automatically: {self._seen.reason}. Pick the four markers."
        if self._found is None:
            return "Four markers were found; which stick moves is not known yet. Check base and moving."
        return "Four markers were found automatically. Check that they are right."

    def _earlier_picks(self) -> dict[str, Any] | None:
        if not self._earlier:
            return None
        points = {
            f"{stick}_{end}": self._earlier[stick][number]
            for stick in STICKS
            for number, end in enumerate(("inner", "outer"))
            if stick in self._earlier
        }
        given = self._earlier.get("kind")
        kinds = given if isinstance(given, Mapping) else dict.fromkeys(STICKS, given)
        return {"points": points, "kind": {stick: kind if kind in PICKED else SNAPS for stick, kind in kinds.items()}}

    def place(self, asked: Mapping[str, Any]) -> dict[str, Any]:
        """Return the position of a pick; ``asked`` holds ``x, y, kind`` and ``others``, the other picks by name."""
        x, y = asked.get("x"), asked.get("y")
        if not isinstance(x, (int, float)) or not isinstance(y, (int, float)):
            raise ConfigError("a point is two numbers", value=f"{x!r}, {y!r}")
        others = {str(name): (float(at[0]), float(at[1])) for name, at in dict(asked.get("others") or {}).items()}
        return place(self.first, float(x), float(y), kind=str(asked.get("kind")), others=others)

    def check(self, asked: Mapping[str, Any]) -> dict[str, Any]:
        """Follow the picks through the first seconds and return the result."""
        content = content_of(asked, {})
        with self._busy:
            hints = hints_of(content, self.source)
            found, self._pictures = follow_beginning(self.source, hints, seconds=seconds_of(asked.get("seconds")))
        return found

    def picture(self, number: int) -> bytes | None:
        """Return a frame of the last check by its number, None where there is none."""
        return self._pictures[number] if number < len(self._pictures) else None

    def first_png(self) -> bytes:
        """Return the first frame as a PNG, with every pixel unchanged."""
        return encoded(self.first, ".png")

    def save(self, asked: Mapping[str, Any]) -> dict[str, Any]:
        """Write the marker file, unless the tracker could not start from it."""
        content = content_of(asked, self._earlier)
        with self._busy:
            hints_of(content, self.source)
            size_px = (self.first.shape[1], self.first.shape[0])
            write_markers(self.out, content, film=Path(self.source.name).name, size_px=size_px)
        self.saved = content
        return {"saved": str(self.out)}


def first_picture(source: Source) -> tuple[NDArray[np.uint8], int]:
    """Return the first frame that was decoded completely, and its number."""
    from tracker.detect.given_positions import first_frame

    frame = first_frame(source)
    assert frame.luma is not None  # noqa: S101 - such frames are passed over
    return np.ascontiguousarray(frame.luma).copy(), frame.index


def find_markers(source: Source, first: NDArray[np.uint8]) -> tuple[Sighting, Floats | None]:
    """Return the result of automatic detection in the first frame, and the four markers in their order.

    The order, base first, is None where no markers are found or neither stick moves in the first ten seconds.
    """
    from tracker.detect.candidates import look
    from tracker.detect.given_positions import first_frame
    from tracker.initialise import find_start

    seen = look(first)
    # The motion may select other markers than the picture, also where the picture shows none.
    with contextlib.suppress(NoResultError):
        start = find_start(Beginning(source, seconds=NAMING_S), None)
        if start.choice is not None and start.frame == first_frame(source).index:
            seen = look(first, taken=(start.choice.taken.base, start.choice.taken.moving))
    named = None if seen.sticks_px is None else name_sticks(source, seen.sticks_px, seconds=NAMING_S)
    return seen, named
