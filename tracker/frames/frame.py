"""The interface of every source of frames, and the record of damage found in it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from torsight.core.errors import InputError
from torsight.core.units import Floats

DEFAULT_FPS: Final = 30.0
"""Frame rate of pictures for which none is given."""
SLOW_MOTION: Final = (2, 4, 8, 16, 32)
"""Factors of slow motion: cameras film 60, 120, 240, 480 or 960 frames a second and play them at 30."""


REPORT_EVERY: Final = 100
"""Frames after which progress is reported: some hundredths of a second of work."""


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """One frame as displayed.

    Attributes
    ----------
    index : int
        From 0, without gaps.
    time_s : float
        On the film's clock; the first frame of the file is at 0 unless a table of times is given.
    luma : (h, w) uint8 or None
        Brightness; a view that is only valid until the next frame is read. None where the frame could not be decoded.
    damaged : bool
        True where the picture, or one that it was predicted from, was not decoded whole.
    """

    index: int
    time_s: float
    luma: NDArray[np.uint8] | None
    damaged: bool = False


@dataclass(slots=True)
class Damage:
    """Damage found while a source was read."""

    entries: list[dict[str, Any]] = field(default_factory=list)

    def add(self, frame: int, time_s: float, text: str, *, kind: str = "damage") -> None:
        """Add an entry, unless there is one of the same kind at the same frame."""
        if not any(entry["frame"] == frame and entry["kind"] == kind for entry in self.entries):
            self.entries.append({"frame": frame, "time_s": time_s, "kind": kind, "text": text})


class FrameSource(Protocol):
    """A source of frames: a film or a sequence of pictures. It can be iterated over more than once."""

    damage: Damage
    name: str

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height as displayed."""

    @property
    def frame_count(self) -> int | None:
        """Number of frames that the file declares, or None."""

    @property
    def pixel_aspect(self) -> float:
        """Width of a pixel over its height as displayed."""

    def files(self) -> list[Path]:
        """Return the files that the frames come from."""

    def __iter__(self) -> Iterator[Frame]:
        """Yield the frames in display order."""

    def describe(self) -> dict[str, Any]:
        """Return the properties of the source, for ``track.json``."""


def pictures_of(frames: Iterable[Frame], indices: Iterable[int]) -> dict[int, NDArray[np.uint8]]:
    """Return some of the frames' pictures by number; those that cannot be decoded are left out."""
    wanted, found = set(indices), dict[int, NDArray[np.uint8]]()
    for frame in frames if wanted else ():
        if frame.index in wanted and frame.luma is not None:
            found[frame.index] = frame.luma.copy()
        if frame.index >= max(wanted):
            break
    return found


class GivenTimes:
    """Times of frames as given by the user: a table ``times_s`` (n,), NaN where it has no row, or a rate ``fps``."""

    def __init__(self, *, fps: float | None, times_s: Floats | None, name: str) -> None:
        self.fps = fps
        self.name = name
        self.times_s = times_s

    def __bool__(self) -> bool:
        """Whether a table or a rate was given."""
        return self.fps is not None or self.times_s is not None

    def of(self, index: int) -> float | None:
        """Return the time of a frame, None where no times were given; without a row for it :class:`InputError`."""
        if self.times_s is None:
            return None if self.fps is None else index / self.fps
        if index < len(self.times_s) and np.isfinite(self.times_s[index]):
            return float(self.times_s[index])
        raise InputError(
            "has no time for this frame",
            where=f"table of timestamps for {self.name}, frame {index}",
            limit=f"one row for every frame; the table ends with frame {len(self.times_s) - 1}",
            do="complete the table, or track without it",
        )

    def note_rows_left(self, damage: Damage, count: int) -> None:
        """Note rows of the table after the last frame: it may be of another film, or frames may be missing."""
        if self.times_s is None or len(self.times_s) <= count:
            return
        known = np.isfinite(self.times_s)
        damage.add(
            max(count - 1, 0),
            float(self.times_s[count - 1]) if count else 0.0,
            f"the table of timestamps has {int(known.sum())} rows for {count} frames: the last "
            f"{int(known[count:].sum())} are not used; if frames were lost while filming, every time after the first "
            "lost one is wrong",
            kind="timestamps",
        )
