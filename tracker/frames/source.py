"""Opens a film, or pictures in a folder or matching a glob, as a source of frames.

A film is decoded packet by packet, so that damage is located: a packet that cannot be decoded becomes a frame without a
picture, and the frames that depend on it, up to the next key frame, are marked as damaged (a decoder fills holes with
stale picture content, on which a marker would be found at its old position).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from torsight.core.errors import ConfigError, InputError
from torsight.core.files.paths import PICTURE_SUFFIXES, AnyPath, files_named
from torsight.core.units import Floats
from tracker.frames.film_source import FilmSource
from tracker.frames.image_sequence import PictureSource

Source = FilmSource | PictureSource


def open_source(source: str | Path, *, fps: float | None = None, timestamps: AnyPath | None = None) -> Source:
    """Open a film, a folder of pictures or a glob.

    Parameters
    ----------
    source : str or Path
        Film, folder, or glob of pictures in the order of their names, with numbers in names compared by value.
    fps : float, optional
        Frame rate of pictures, or the rate at which a film was captured: frame k is then at k / fps, whatever the
        film's own timestamps say (slow motion plays at 30 what was filmed at 240).
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
    if fps is not None and not (np.isfinite(fps) and fps > 0):
        raise ConfigError("is no frame rate", where="--fps", value=fps, limit="above 0")
    if not str(source).strip():
        raise ConfigError("names no film", where="VIDEO", value=repr(str(source)), limit="a film, folder or glob")
    times = None if timestamps is None else read_times(timestamps)
    path, found = Path(source), files_named(source)
    if found == [path] and path.stat().st_size == 0:
        raise InputError("is an empty file", where=str(path), do="record or copy the film again")
    if found != [path] or path.suffix.lower() in PICTURE_SUFFIXES:
        return PictureSource(found, name=str(source), fps=fps, times_s=times)
    return FilmSource(path, fps=fps, times_s=times)


def read_times(path: Path) -> Floats:
    """Return the times (n,) from a table ``frame, time_s``, indexed by frame number; NaN where it has no row."""
    from torsight.core.files.storage import read_table
    from torsight.core.files.tables import frame_numbers, require_increasing

    table = read_table(path, required=("frame", "time_s"))
    time_s = table["time_s"].to_numpy(np.float64)
    require_increasing(time_s, path=path)
    frame = frame_numbers(table, path=path)
    times = np.full(int(frame[-1]) + 1, np.nan)
    times[frame] = time_s
    return times
