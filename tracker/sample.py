"""Frames from chosen places of a film, without decoding what lies between: for a look before the whole is tracked."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

from tracker.film import FilmSource, luma_of
from tracker.pictures import PictureSource
from tracker.source import Damage, Frame


@dataclass(frozen=True, slots=True, eq=False)
class Stamps:
    """When every frame of a source is shown.

    Attributes
    ----------
    time_s : (n,) float64
        From 0, in the order of display.
    pts : (n,) int64
        The container's own stamps; numbers of the pictures where there is no container.
    """

    time_s: NDArray[np.float64]
    pts: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.pts)


def read_stamps(source: FilmSource | PictureSource) -> Stamps:
    """Return the stamps of all frames; a film's are read from its packets, which are not decoded."""
    if isinstance(source, PictureSource):
        rate = float(source.describe()["fps"] or 1.0)
        number = np.arange(len(source.paths), dtype=np.int64)
        return Stamps(number / rate, number)
    with av.open(str(source.path), metadata_errors="ignore") as container:
        stream = container.streams.video[0]
        base = float(stream.time_base or 1e-3)
        pts: list[int] = []
        # What comes before a damage is what there is to sample.
        with contextlib.suppress(av.error.FFmpegError):
            pts.extend(int(packet.pts) for packet in container.demux(stream) if packet.pts is not None and packet.size)
    ordered = np.unique(np.array(pts, dtype=np.int64))
    return Stamps((ordered - ordered[0]) * base if len(ordered) else np.empty(0), ordered)


class Clip:
    """Some frames of a source in a row, numbered from 0, as a source of their own.

    Parameters
    ----------
    source : FilmSource or PictureSource
        What the frames are taken from.
    stamps : Stamps
        From :func:`read_stamps`.
    first, count : int
        Which frames.
    """

    def __init__(self, source: FilmSource | PictureSource, stamps: Stamps, *, first: int, count: int) -> None:
        self._source = source
        self._stamps = stamps
        self.first = first
        self.count = min(count, len(stamps) - first)
        self.damage = Damage()
        self.name = f"{source.name}, frames {first} to {first + self.count - 1}"

    def files(self) -> list[Path]:
        """Return the files that the frames come from."""
        return self._source.files()

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height as displayed."""
        return self._source.size_px

    @property
    def frame_count(self) -> int | None:
        """Number of frames of the clip."""
        return self.count

    @property
    def pixel_aspect(self) -> float:
        """Width of a pixel over its height as displayed."""
        return self._source.pixel_aspect

    def describe(self) -> dict[str, Any]:
        """Return what is known of the whole source."""
        return self._source.describe()

    def __iter__(self) -> Iterator[Frame]:
        """Give the frames of the clip; what cannot be decoded is left out."""
        source = self._source
        pictures = self._pictures(source) if isinstance(source, PictureSource) else self._decoded(source)
        for index, (number, luma) in enumerate(pictures):
            yield Frame(index, float(self._stamps.time_s[number]), luma)

    def _pictures(self, source: PictureSource) -> Iterator[tuple[int, NDArray[np.uint8] | None]]:
        # The depth of the whole row: a few pictures of it may be darker than the rest.
        for frame in PictureSource(
            source.paths[self.first : self.first + self.count], name=self.name, bits=source.bits
        ):
            yield self.first + frame.index, frame.luma

    def _decoded(self, source: FilmSource) -> Iterator[tuple[int, NDArray[np.uint8]]]:
        rotation = int(source.describe().get("rotation_deg", 0))
        wanted = self._stamps.pts[self.first : self.first + self.count]
        with av.open(str(source.path), metadata_errors="ignore") as container:
            stream = container.streams.video[0]
            if self.first:
                # Backward: to the key frame that the first wanted frame hangs on.
                container.seek(int(wanted[0]), stream=stream, backward=True)
            try:
                for frame in container.decode(stream):
                    if frame.pts is None or frame.pts < wanted[0]:
                        continue
                    if frame.pts > wanted[-1]:
                        return
                    yield int(np.searchsorted(self._stamps.pts, frame.pts)), luma_of(frame, rotation=rotation)
            except av.error.FFmpegError as error:
                self.damage.add(self.first, 0.0, f"cannot be decoded here ({error.strerror or error})")
