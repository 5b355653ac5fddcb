"""Frames from chosen parts of a film, without decoding those in between: for checks before the whole is tracked."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import islice
from typing import Final

import av
import numpy as np
from numpy.typing import NDArray

from torsight.core.errors import reason_of
from torsight.core.progress import Progress, silent
from torsight.core.units import Floats, Ints
from tracker.frames.display import Closed, luma_of
from tracker.frames.film_source import FilmSource
from tracker.frames.frame import REPORT_EVERY, Damage, Frame, pictures_of
from tracker.frames.image_sequence import PictureSource
from tracker.frames.source import Source

DECODED_PX: Final = 3e9
"""Pixels of a film up to which it is decoded completely to read its timestamps: 10,000 frames of VGA, about four
seconds at the 1.0 to 1.5 ns per pixel that lightly compressed H.264 costs."""


@dataclass(frozen=True, slots=True, eq=False)
class Timestamps:
    """Display times of all frames of a source: ``time_s`` (n,), from 0, in display order.

    ``pts`` (n,) are the container's own timestamps, or the pictures' numbers; None where the container has none, so
    that seeking is impossible. ``decoded``: the frames were counted by decoding, not from the container's packets;
    ``hidden``: the number of frames that are not shown.
    """

    time_s: Floats
    pts: Ints | None
    decoded: bool
    hidden: int = 0

    def __len__(self) -> int:
        return len(self.time_s)


def read_timestamps(source: Source, *, progress: Progress = silent) -> Timestamps:
    """Return the timestamps of all frames, with the same times as in :func:`tracker.track.track_film`.

    A short film is decoded completely, and damage noted in ``source.damage``; for a long one only the packets that its
    edit list shows are listed.
    """
    if isinstance(source, PictureSource):
        number = range(source.frame_count)
        return Timestamps(np.array([source.time_s(at) for at in number]), np.array(number, np.int64), decoded=True)
    about = source.frame_count or (source.span_s or 0.0) * (source.rate_fps or 0.0)
    if not about or about * np.prod(source.size_px) <= DECODED_PX:
        return _decoded(source, about=int(about), progress=progress)
    pts: list[int] = []
    hidden = 0
    # Only the part before any damage can be sampled.
    with source.open() as container, contextlib.suppress(av.error.FFmpegError):
        for packet in container.demux(source.stream(container)):
            hidden += bool(packet.is_discard)
            if packet.pts is not None and packet.size and not packet.is_discard:
                pts.append(int(packet.pts))
    ordered = np.unique(np.array(pts, dtype=np.int64))
    if len(ordered) == 0:
        return _decoded(source, about=int(about), progress=progress)
    hidden += source.repeated(ordered.tolist())
    return Timestamps(source.times_of(ordered), ordered, decoded=False, hidden=hidden)


def _decoded(source: FilmSource, *, about: int, progress: Progress) -> Timestamps:
    """Return the timestamps of a film by decoding it completely."""
    times: list[float] = []
    for frame in source:
        times.append(frame.time_s)
        if frame.index % REPORT_EVERY == 0:
            progress("reading the film", frame.index, max(about, frame.index + 1))
    progress("reading the film", len(times), len(times))
    known = [pts for pts in source.pts if pts is not None]
    pts = np.array(known, np.int64) if len(known) == len(times) and (np.diff(known) > 0).all() else None
    return Timestamps(np.array(times), pts, decoded=True)


class Clip:
    """``count`` frames of a source from the ``first``, numbered from 0, as a source of their own."""

    def __init__(self, source: Source, timestamps: Timestamps, *, first: int, count: int) -> None:
        self._source = source
        self._timestamps = timestamps
        self.first = first
        self.frame_count = min(count, len(timestamps) - first)
        self.size_px, self.pixel_aspect = source.size_px, source.pixel_aspect
        self.files, self.describe = source.files, source.describe
        self.damage = Damage()
        self.name = f"{source.name}, frames {first} to {first + self.frame_count - 1}"

    def __iter__(self) -> Iterator[Frame]:
        """Yield the frames of the clip; frames that cannot be decoded are left out."""
        source = self._source
        pictures = self._pictures(source) if isinstance(source, PictureSource) else self._decoded(source)
        for index, (number, luma) in enumerate(pictures):
            yield Frame(index, float(self._timestamps.time_s[number]), luma)

    def pictures(self, indices: Iterable[int]) -> dict[int, NDArray[np.uint8]]:
        """Return some frames of the clip by number; those that cannot be decoded are left out."""
        return pictures_of(self, indices)

    def _pictures(self, source: PictureSource) -> Iterator[tuple[int, NDArray[np.uint8] | None]]:
        # The bit depth of the whole sequence: the pictures of the clip may be darker than the rest.
        for frame in PictureSource(
            source.paths[self.first : self.first + self.frame_count], name=self.name, bits=source.bits
        ):
            yield self.first + frame.index, frame.luma

    def _decoded(self, source: FilmSource) -> Iterator[tuple[int, NDArray[np.uint8] | None]]:
        pts = self._timestamps.pts
        if pts is None:
            for frame in islice(source, self.first, self.first + self.frame_count):
                yield frame.index, None if frame.damaged else frame.luma
            return
        wanted, closed = pts[self.first : self.first + self.frame_count], Closed()
        with source.open() as container:
            stream = source.stream(container)
            stream.thread_type = "AUTO"
            if self.first:
                # Backward: to the key frame on which the first wanted frame depends.
                container.seek(int(wanted[0]), stream=stream, backward=True)
            try:
                for frame in container.decode(stream):
                    if frame.pts is None or frame.pts < wanted[0]:
                        continue
                    if frame.pts > wanted[-1]:
                        return
                    yield int(np.searchsorted(pts, frame.pts)), closed(luma_of(frame, source.display))
            except av.error.FFmpegError as error:
                time_s = float(self._timestamps.time_s[self.first])
                self.damage.add(self.first, time_s, f"cannot be decoded here ({reason_of(error)})")
