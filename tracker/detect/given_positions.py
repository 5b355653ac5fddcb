"""Dots at the positions that the user gives in the first frame."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from torsight.core.errors import InputError, NoResultError
from torsight.core.progress import Progress
from torsight.core.tracks import MARKERS
from tracker.appearance.dot_fit import Dot
from tracker.detect.dots import HUGE_PX, dot_near
from tracker.detect.marker_file import MarkerHints
from tracker.detect.sticks import Stick
from tracker.frames.frame import Frame, FrameSource

LOOKED_AT: Final = (0, 1, 2, 4, 8, 15, 30, 45, 60, 90, 120, 180, 240, 300, 450, 600, 900)
"""Frames that are searched for markers until these are found."""
SNAP_PX: Final = 12.0
"""Largest distance of a given position from the centre of its dot, unless it lies inside the dot."""


def decoded(source: FrameSource) -> Iterator[Frame]:
    """Yield the frames of a source that were decoded whole."""
    return (frame for frame in source if frame.luma is not None and not frame.damaged)


def looked_at(source: FrameSource, progress: Progress, *, what: str) -> Iterator[tuple[int, NDArray[np.uint8]]]:
    """Yield number and picture of the frames ``LOOKED_AT``; ``progress`` is called before each of them."""
    for frame in decoded(source):
        if frame.index > LOOKED_AT[-1]:
            return
        if frame.index in LOOKED_AT and frame.luma is not None:
            progress(f"looking for {what}", frame.index, LOOKED_AT[-1])
            yield frame.index, frame.luma


def first_frame(source: FrameSource) -> Frame:
    """Return the first frame that was decoded whole, to which given positions refer (else :class:`InputError`)."""
    frame = next(decoded(source), None)
    if frame is None:
        raise InputError("holds no frame that can be decoded", where=source.name)
    return frame


def given_dots(frame: Frame, hints: MarkerHints, *, sticks: Sequence[int]) -> list[Stick]:
    """Return the dots of each stick near the positions that were given.

    No dot at a position, or two positions at the same dot, raise :class:`NoResultError`.
    """
    assert frame.luma is not None  # noqa: S101 - for the type checker: such frames are passed over
    dots: dict[str, Dot] = {}
    for index in (2 * stick + end for stick in sticks for end in (0, 1)):
        name, (x, y) = MARKERS[index], hints.position_px[index].tolist()
        dot = dot_near(frame.luma, x, y, reach_px=SNAP_PX)
        if dot is None:
            raise NoResultError(
                "there is no round dot next to this position",
                where=f"{hints.where}, {name.replace('_', ', ')} marker",
                value=f"[{x:g}, {y:g}]",
                limit=f"a dot of 3 to {HUGE_PX:g} px radius within {SNAP_PX:g} px, in frame {frame.index}",
                do="mend the position, choose a dot that differs from the stick in a black-and-white picture, or set "
                'kind = "texture" for a point without a dot',
            )
        for other, before in dots.items():
            if math.hypot(before.x_px - dot.x_px, before.y_px - dot.y_px) < 0.5 * dot.radius_px:
                raise NoResultError(
                    f"is next to the same dot as {other}",
                    where=f"{hints.where}, {name.replace('_', ', ')} marker",
                    value=f"[{x:g}, {y:g}]",
                    do="give one position on each dot",
                )
        dots[name] = dot
    found = list(dots.values())
    pairs = zip(found[::2], found[1::2], strict=True)
    return [Stick(one, two, 0.0) for one, two in pairs]
