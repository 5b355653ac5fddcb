"""A film as a source of frames, decoded to luma only."""

from __future__ import annotations

import functools
import heapq
import itertools
from collections.abc import Iterable, Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any, Final

import av
import numpy as np
from numpy.typing import NDArray

from torsight.core.errors import InputError
from tracker.source import DEFAULT_FPS, Damage, Frame, note_rows_left, time_from_table

# Formats whose first plane is the luma, one byte per pixel.
_PLANAR: Final = ("yuv4", "yuvj4", "yuva4", "gray", "nv12", "nv21", "nv16", "nv24")
# Formats whose first plane is the luma in the low bits of two bytes.
_DEEP: Final = {"10le": 2, "12le": 4, "14le": 6, "16le": 8}

_FROM_KEY: Final = 300
"""Frames that are decoded at most to reach one that was sought: encoders set a key frame every 250 at the latest."""


class FilmSource:
    """A film file; every pass over it decodes it again.

    Raises
    ------
    InputError
        When the file is no film, has no video, or its codec cannot be decoded here.
    """

    def __init__(
        self,
        path: Path,
        *,
        fps: float | None = None,
        times_s: NDArray[np.float64] | None = None,
    ) -> None:
        self.path = path
        self.name = str(path)
        self.damage = Damage()
        self._fps = fps
        self._times_s = times_s
        self._rotation = 0
        self._pts: list[int | None] = []
        with self._open() as container:
            stream = self._stream(container)
            self._size_px = (int(stream.codec_context.width), int(stream.codec_context.height))
            self._count = int(stream.frames) or None
            aspect = stream.sample_aspect_ratio
            self._aspect = float(aspect) if aspect else 1.0
            self._rate = _number(stream.average_rate)
            self._about: dict[str, Any] = {
                "kind": "film",
                "format": str(container.format.name),
                "codec": str(stream.codec_context.name),
                "pixel_format": str(stream.codec_context.pix_fmt),
                "bit_rate_kbps": _kilo(stream.bit_rate or container.bit_rate),
                "fps": self._rate,
            }
            self._look_at_first(container, stream)

    def _look_at_first(self, container: Any, stream: Any) -> None:
        """Decode until one frame comes out: proof that there is a picture, and how it is turned for display."""
        message = "no frame in it"
        try:
            for packet in container.demux(stream):
                try:
                    frames = packet.decode()
                except av.error.InvalidDataError as error:
                    message = str(error)
                    continue
                if frames:
                    self._rotation = int(frames[0].rotation or 0) % 360
                    self._size_px = (frames[0].width, frames[0].height)
                    if self._rotation in (90, 270):
                        self._size_px = self._size_px[::-1]
                        self._aspect = 1.0 / self._aspect
                    return
        except (av.error.FFmpegError, OSError) as error:
            message = str(error)
        raise InputError(
            f"holds no frame that can be decoded ({message})",
            where=self.name,
            value=f"codec {self._about['codec']}",
            do="convert it with ffmpeg, or copy it from the camera again",
        )

    def files(self) -> list[Path]:
        """Return the files that the frames come from."""
        return [self.path]

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height as displayed."""
        return self._size_px

    @property
    def frame_count(self) -> int | None:
        """Number of frames that the file declares, where it does."""
        return self._count

    @property
    def pixel_aspect(self) -> float:
        """Width of a pixel over its height as displayed."""
        return self._aspect

    def describe(self) -> dict[str, Any]:
        """Return format, codec, bit rate, size and rate of the film."""
        about: dict[str, Any] = {**self._about, "width_px": self._size_px[0], "height_px": self._size_px[1]}
        if self._rotation:
            about["rotation_deg"] = self._rotation
        if abs(self._aspect - 1.0) > 1e-6:
            about["pixel_aspect"] = self._aspect
        return about

    def __iter__(self) -> Iterator[Frame]:
        """Give the frames in display order; packets that could not be decoded as frames without luma."""
        reader = _Reader()
        with self._open() as container:
            stream = self._stream(container)
            stream.thread_type = "AUTO"
            base = stream.time_base or Fraction(1, 1000)
            start = stream.start_time
            index = 0
            self._pts = []
            last_s = -np.inf
            for pts, luma, damaged in reader.pictures(container, stream, rotation=self._rotation):
                if start is None and pts is not None:
                    start = pts
                self._pts.append(pts)
                time_s = self._time_s(index, pts, start, base, last_s)
                last_s = time_s
                if damaged or luma is None:
                    self._note(index, time_s, reader, missing=luma is None)
                if luma is not None and (luma.shape[1], luma.shape[0]) != self._size_px:
                    raise InputError(
                        "changes its picture size",
                        where=f"{self.name}, frame {index}",
                        value=f"{luma.shape[1]} × {luma.shape[0]}",
                        limit=f"{self._size_px[0]} × {self._size_px[1]}",
                        do="cut the film where its size changes",
                    )
                yield Frame(index, time_s, luma, damaged=damaged or luma is None)
                index += 1
        self._note_end(index, last_s, reader)

    def pictures(self, indices: Iterable[int]) -> dict[int, NDArray[np.uint8]]:
        """Return some frames of the last pass again, by their numbers; those that cannot be decoded are left out.

        Frames that cannot be sought, in a damaged film or one without an index, are all taken from one further pass.
        """
        wanted = set(indices)
        stamps = {index: self._pts[index] for index in wanted if index < len(self._pts)}
        sought = {index: None if pts is None else self._sought(pts) for index, pts in stamps.items()}
        found = {index: luma for index, luma in sought.items() if luma is not None}
        left = wanted - set(found)
        for frame in self if left else ():
            if frame.index in left and frame.luma is not None:
                found[frame.index] = frame.luma.copy()
            if frame.index >= max(left):
                break
        return found

    def _sought(self, pts: int) -> NDArray[np.uint8] | None:
        """Return the frame with a time stamp by seeking to the key frame before it; None where that does not work."""
        with self._open() as container:
            stream = self._stream(container)
            stream.thread_type = "AUTO"
            try:
                container.seek(pts, stream=stream)
                for frame in itertools.islice(container.decode(stream), _FROM_KEY):
                    if frame.pts == pts:
                        return luma_of(frame, rotation=self._rotation).copy()
                    if frame.pts is not None and frame.pts > pts:
                        break
            except (av.error.FFmpegError, OSError):
                pass  # damaged here: a pass from the start knows which frames are whole
        return None

    def _time_s(self, index: int, pts: int | None, start: int | None, base: Fraction, last_s: float) -> float:
        if self._times_s is not None:
            return time_from_table(self._times_s, index, name=self.name)
        if self._fps is not None:
            return index / self._fps
        step = 1.0 / (self._rate or DEFAULT_FPS)
        if pts is None or start is None:
            return last_s + step if np.isfinite(last_s) else 0.0
        # Rounded once, as the fraction would be.
        time_s = (pts - start) * base.numerator / base.denominator
        # Two frames with one stamp: some containers' clocks are coarser than the frame rate.
        return time_s if time_s > last_s else last_s + 1e-3 * step

    def _note(self, index: int, time_s: float, reader: _Reader, *, missing: bool) -> None:
        if reader.in_damage and not missing:
            return
        reader.in_damage = True
        text = "could not be decoded" if missing else "was decoded with errors"
        more = f" ({reader.message})" if reader.message else ""
        self.damage.add(index, time_s, f"frame {index} {text}{more}; nothing is taken from here to the next key frame")

    def _note_end(self, count: int, last_s: float, reader: _Reader) -> None:
        note_rows_left(self.damage, self._times_s, count)
        if reader.fatal:
            self.damage.add(
                count,
                last_s,
                f"the film cannot be read past frame {count - 1} ({reader.fatal}); what came before is kept",
            )
        elif self._count is not None and count < self._count - reader.hidden:
            self.damage.add(
                count,
                last_s,
                f"the film ends after frame {count - 1}, but {self._count} frames are declared: it was cut",
            )

    def _open(self) -> Any:
        try:
            return av.open(self.name, metadata_errors="ignore")
        except (av.error.FFmpegError, OSError) as error:
            raise InputError(
                f"is not a film that can be read ({error.strerror or error})",
                where=self.name,
                do="check that the copy is whole; a film whose recording was cut off may be mended with ffmpeg",
            ) from error

    def _stream(self, container: Any) -> Any:
        streams = container.streams.video
        if not streams:
            raise InputError("has no video stream", where=self.name, do="name the film")
        if streams[0].codec_context is None or not hasattr(streams[0].codec_context, "width"):
            raise InputError("has a codec that cannot be decoded here", where=self.name, do="convert it with ffmpeg")
        return streams[0]


class _Reader:
    """One pass of decoding: keeps account of packets that gave no frame."""

    def __init__(self) -> None:
        self.message = ""
        self.fatal = ""
        self.hidden = 0
        self.in_damage = False
        self._waiting: list[int] = []
        self._errors = 0

    def pictures(
        self, container: Any, stream: Any, *, rotation: int
    ) -> Iterator[tuple[int | None, NDArray[np.uint8] | None, bool]]:
        """Give ``(pts, luma or None, damaged)`` in display order."""
        damaged = False
        for frame in self._decoded(container, stream):
            for pts in self._missing_before(frame.pts):
                damaged = True
                yield pts, None, True
            if frame.key_frame and not frame.is_corrupt:
                damaged = False
                self.in_damage = False
            damaged = damaged or bool(frame.is_corrupt)
            yield frame.pts, luma_of(frame, rotation=rotation), damaged

    def _decoded(self, container: Any, stream: Any) -> Iterator[Any]:
        packets = container.demux(stream)
        while True:
            try:
                packet = next(packets)
            except StopIteration:
                return
            except (av.error.FFmpegError, OSError) as error:
                self.fatal = str(error.strerror or error)
                # What the decoder still holds was read before the damage.
                yield from self._flush(stream)
                return
            if packet.pts is not None and packet.size:
                heapq.heappush(self._waiting, packet.pts)
            if getattr(packet, "is_corrupt", False):
                self._errors += 1
                self.message = "a packet is marked as corrupt"
            try:
                yield from packet.decode()
            except (av.error.InvalidDataError, av.error.FFmpegError) as error:
                self._errors += 1
                self.message = str(error.strerror or error)

    def _flush(self, stream: Any) -> Iterator[Any]:
        try:
            yield from stream.decode(None)
        except (av.error.FFmpegError, EOFError):
            return

    def _missing_before(self, pts: int | None) -> Iterator[int]:
        """Give the stamps of packets before ``pts`` that gave no frame, once an error has been met.

        Without an error such packets are frames that are not meant to be shown.
        """
        if pts is None:
            return
        while self._waiting and self._waiting[0] < pts:
            lost = heapq.heappop(self._waiting)
            if self._errors:
                yield lost
            else:
                self.hidden += 1
        while self._waiting and self._waiting[0] == pts:
            heapq.heappop(self._waiting)


def luma_of(frame: Any, *, rotation: int) -> NDArray[np.uint8]:
    """Return the brightness of a frame, a view of the decoder's memory where possible."""
    name = frame.format.name
    bits = _bits_below(name)
    if bits == 0:
        plane = frame.planes[0]
        rows = np.frombuffer(plane, np.uint8).reshape(-1, plane.line_size)
        luma = rows[: frame.height, : frame.width]
    elif bits is not None:
        plane = frame.planes[0]
        deep = np.frombuffer(plane, np.uint16).reshape(-1, plane.line_size // 2)
        luma = (deep[: frame.height, : frame.width] >> bits).astype(np.uint8)
    else:
        luma = frame.to_ndarray(format="gray")
    if rotation:
        luma = np.ascontiguousarray(np.rot90(luma, rotation // 90))
    return luma


@functools.cache
def _bits_below(name: str) -> int | None:
    """Return how many bits the luma of a pixel format has below a byte's; None where it has no plane of its own."""
    if name.startswith(_PLANAR) and not name.endswith(("le", "be")) and name not in ("gray16", "gray10"):
        return 0
    return _DEEP.get(name[-4:]) if name.startswith(("yuv4", "gray1")) else None


def _kilo(value: int | None) -> float | None:
    return None if not value else value / 1000.0


def _number(value: Fraction | None) -> float | None:
    return None if not value else float(value)
