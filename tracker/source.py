"""Frames one after the other: of a film, or of pictures in a folder or under a glob.

A film is decoded packet by packet, so that damage is seen where it is: a packet that cannot be decoded becomes a frame
without a picture, and what hangs on it, up to the next key frame, is marked as damaged (a decoder fills holes with
stale picture content, on which a marker would be found at its old place).
"""

from __future__ import annotations

import glob
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from torsight.core.errors import ConfigError, InputError
from torsight.core.paths import PICTURE_SUFFIXES, AnyPath, missing_file, require_content

if TYPE_CHECKING:
    from tracker.film import FilmSource
    from tracker.pictures import PictureSource

DEFAULT_FPS: Final = 30.0
"""Frame rate of pictures for which none is given."""


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """One frame as displayed.

    Attributes
    ----------
    index : int
        From 0, none missing.
    time_s : float
        On the film's clock; the first frame of the file is at 0 unless a table of times is given.
    luma : (h, w) uint8 or None
        Brightness; a view that is only valid until the next frame is asked for. None where nothing could be decoded.
    damaged : bool
        True where the picture, or one that it was predicted from, was not decoded whole.
    """

    index: int
    time_s: float
    luma: NDArray[np.uint8] | None
    damaged: bool = False


@dataclass(slots=True)
class Damage:
    """What was found damaged while a source was read."""

    entries: list[dict[str, Any]] = field(default_factory=list)

    def add(self, frame: int, time_s: float, text: str, *, kind: str = "damage") -> None:
        """Note one place, unless something of this kind already stands at the same frame."""
        if not any(entry["frame"] == frame and entry["kind"] == kind for entry in self.entries):
            self.entries.append({"frame": frame, "time_s": time_s, "kind": kind, "text": text})


class FrameSource(Protocol):
    """What gives frames: a film or a row of pictures. Can be gone through more than once."""

    damage: Damage
    name: str

    def files(self) -> list[Path]:
        """Return the files that the frames come from."""

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height as displayed."""

    @property
    def frame_count(self) -> int | None:
        """Number of frames that the file declares, where it does."""

    @property
    def pixel_aspect(self) -> float:
        """Width of a pixel over its height as displayed."""

    def __iter__(self) -> Iterator[Frame]:
        """Give the frames in the order in which they are displayed."""

    def describe(self) -> dict[str, Any]:
        """Return what is known of the source, for ``track.json``."""


def open_source(
    source: str | Path, *, fps: float | None = None, timestamps: AnyPath | None = None
) -> FilmSource | PictureSource:
    """Open a film, a folder of pictures or a glob.

    Parameters
    ----------
    source : str or Path
        Film, folder, or glob of pictures in the order of their names.
    fps : float, optional
        Frame rate of pictures, or the rate at which a film was captured: frame k is then at k / fps, whatever the
        film's own stamps say (slow motion plays at 30 what was filmed at 240).
    timestamps : str or Path, optional
        Table ``frame, time_s`` with the time of every frame.

    Raises
    ------
    ConfigError
        When ``fps`` is no positive number.
    InputError
        When there is no such file, it is empty, or nothing in it can be decoded.
    """
    timestamps = None if timestamps is None else Path(timestamps)
    from tracker.film import FilmSource
    from tracker.pictures import PictureSource

    if fps is not None and not (np.isfinite(fps) and fps > 0):
        raise ConfigError("is no frame rate", where="--fps", value=fps, limit="above 0")
    times = None if timestamps is None else _read_times(timestamps)
    path = Path(source)
    if path.is_dir():
        found = sorted(item for item in path.iterdir() if item.suffix.lower() in PICTURE_SUFFIXES)
        return PictureSource(found, name=str(source), fps=fps, times_s=times)
    if not path.exists():
        if any(character in str(source) for character in "*?["):
            # glob.glob, not Path.glob: the pattern may be absolute and hold wildcards in its folders.
            matches = [Path(name) for name in sorted(glob.glob(str(source)))]  # noqa: PTH207
            return PictureSource(matches, name=str(source), fps=fps, times_s=times)
        raise missing_file(path)
    if path.stat().st_size == 0:
        raise InputError("is an empty file", where=str(path), do="record or copy the film again")
    require_content(path)
    if path.suffix.lower() in PICTURE_SUFFIXES:
        return PictureSource([path], name=str(source), fps=fps, times_s=times)
    return FilmSource(path, fps=fps, times_s=times)


def _read_times(path: Path) -> NDArray[np.float64]:
    """Read ``frame, time_s``; index by frame number, NaN where the table has no row."""
    from torsight.core.storage import read_table
    from torsight.core.tables import frame_numbers, require_increasing

    table = read_table(path, required=("frame", "time_s"))
    time_s = table["time_s"].to_numpy(np.float64)
    require_increasing(time_s, path=path)
    frame = frame_numbers(table, path=path)
    times = np.full(int(frame[-1]) + 1, np.nan)
    times[frame] = time_s
    return times


def note_rows_left(damage: Damage, times_s: NDArray[np.float64] | None, count: int) -> None:
    """Note that a table of times goes on after the last frame: it may be of another film, or frames may be missing."""
    if times_s is None or len(times_s) <= count:
        return
    rows = int(np.isfinite(times_s[count:]).sum())
    damage.add(
        max(count - 1, 0),
        float(times_s[count - 1]) if count else 0.0,
        f"the table of --timestamps has {int(np.isfinite(times_s).sum())} rows for {count} frames: the last {rows} are "
        "not used; if frames were lost while filming, every time after the first lost one is wrong",
        kind="timestamps",
    )


def time_from_table(times_s: NDArray[np.float64], index: int, *, name: str) -> float:
    """Return the time of a frame from a table of times.

    Raises
    ------
    InputError
        When the table has no row for this frame.
    """
    if index < len(times_s) and np.isfinite(times_s[index]):
        return float(times_s[index])
    raise InputError(
        "has no time for this frame",
        where=f"--timestamps for {name}, frame {index}",
        limit=f"one row for every frame; the table ends with frame {len(times_s) - 1}",
        do="complete the table, or leave --timestamps away",
    )
