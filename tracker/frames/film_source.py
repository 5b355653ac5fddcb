"""A film as a source of frames, decoded to luma only."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Collection, Iterable, Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any, Final

import av
import numpy as np
from numpy.typing import NDArray

from torsight.core.errors import InputError, reason_of
from torsight.core.units import Floats, Ints
from tracker.frames.decoder import Decoder
from tracker.frames.display import Display, display_of, luma_of, transfer_of
from tracker.frames.frame import DEFAULT_FPS, SLOW_MOTION, Damage, Frame, GivenTimes, pictures_of

_CAPTURE_KEYS: Final = ("com.android.capture.fps",)
"""Metadata keys in which phones store the capture rate of a slow-motion film (Android's MediaRecorder)."""


class FilmSource:
    """A film file; every pass over it decodes it again.

    ``given`` are times that replace the film's own timestamps, ``display`` is the rotation and mirroring of its frames;
    for the rest see :class:`tracker.frames.frame.FrameSource`. A file that is no film, has no video stream, or a codec
    that cannot be decoded here raises :class:`InputError`.
    """

    def __init__(self, path: Path, *, fps: float | None = None, times_s: Floats | None = None) -> None:
        self.path = path
        self.name = str(path)
        self.damage = Damage()
        self.given = GivenTimes(fps=fps, times_s=times_s, name=self.name)
        self.display = Display()
        self.pts: list[int | None] = []
        self._keep: frozenset[int] = frozenset()
        self._kept: dict[int, NDArray[np.uint8]] = {}
        with self.open() as container:
            stream = self.stream(container)
            self.size_px = (int(stream.codec_context.width), int(stream.codec_context.height))
            self.frame_count = int(stream.frames) or None
            self.pixel_aspect = float(stream.sample_aspect_ratio or 1.0)
            self.rate_fps = float(stream.average_rate) if stream.average_rate else None
            self.tick_s = float(stream.time_base or 0)
            whole_s = stream.duration * stream.time_base if stream.duration else 0
            self.span_s = float(whole_s or (container.duration or 0) / av.time_base) or None
            # Containers without a frame count declare a length; with several streams it may be that of the sound.
            self._declared_s = self.span_s if len(container.streams) == 1 else None
            self._start_s = float((stream.start_time or 0) * (stream.time_base or 0))
            bit_rate = stream.bit_rate or container.bit_rate
            self._about: dict[str, Any] = {
                "kind": "film",
                "format": str(container.format.name),
                "codec": str(stream.codec_context.name),
                "pixel_format": str(stream.codec_context.pix_fmt),
                "bit_rate_kbps": bit_rate / 1000.0 if bit_rate else None,
                "fps": self.rate_fps,
            }
            self._note_streams(container, stream)
            self._note_slow_motion(container, stream)
            self._look_at_first(container, stream)

    def __repr__(self) -> str:
        width, height = self.size_px
        return f"FilmSource({self.name}, {width} × {height} px, {self.frame_count or 'uncounted'} frames)"

    def _look_at_first(self, container: Any, stream: Any) -> None:
        """Decode one frame: it proves that there is a picture, and has the display matrix."""
        message = "no frame in it"
        try:
            for packet in container.demux(stream):
                try:
                    frames = packet.decode()
                except av.error.InvalidDataError as error:
                    message = str(error)
                    continue
                if frames:
                    self.display = display_of(frames[0], stream.codec_context)
                    self._about["pixel_format"] = str(frames[0].format.name)
                    if (transfer := transfer_of(frames[0])) is not None:
                        self._about["transfer"] = transfer
                    self.size_px = (frames[0].width, frames[0].height)
                    if self.display.transposed:
                        self.size_px = self.size_px[::-1]
                        self.pixel_aspect = 1.0 / self.pixel_aspect
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

    def describe(self) -> dict[str, Any]:
        """Return format, codec, bit rate, size and rate of the film."""
        about: dict[str, Any] = {**self._about, "width_px": self.size_px[0], "height_px": self.size_px[1]}
        about |= self.display.describe()
        if not self.given:
            about["tick_s"] = self.tick_s
        if self.given.fps is not None:
            about["capture_fps"] = self.given.fps
        if self.pixel_aspect != 1.0:
            about["pixel_aspect"] = self.pixel_aspect
        return about

    def __iter__(self) -> Iterator[Frame]:
        """Yield the frames in display order; packets that could not be decoded are frames without luma."""
        decoder = Decoder()
        with self.open() as container:
            stream = self.stream(container)
            stream.thread_type = "AUTO"
            base = stream.time_base or Fraction(1, 1000)
            start = stream.start_time
            index = 0
            self.pts = []
            self._kept = {}
            last_s = -np.inf
            for pts, luma, damaged in decoder.pictures(container, stream, display=self.display):
                if start is None and pts is not None:
                    start = pts
                self.pts.append(pts)
                time_s = self._time_s(index, pts, start, base, last_s)
                last_s = time_s
                if damaged or luma is None:
                    self._note(index, time_s, decoder, missing=luma is None)
                if luma is not None and (luma.shape[1], luma.shape[0]) != self.size_px:
                    raise InputError(
                        "changes its picture size",
                        where=f"{self.name}, frame {index}",
                        value=f"{luma.shape[1]} × {luma.shape[0]}",
                        limit=f"{self.size_px[0]} × {self.size_px[1]}",
                        do="cut the film where its size changes",
                    )
                if luma is not None and index in self._keep:
                    self._kept[index] = luma.copy()
                yield Frame(index, time_s, luma, damaged=damaged or luma is None)
                index += 1
        self._note_end(index, last_s, decoder)

    def times_of(self, pts: Ints) -> Floats:
        """Return the times (n,) of all frames from their timestamps, s, or from the table or rate that was given."""
        if self.given:
            return np.array([self.given.of(index) for index in range(len(pts))])
        return np.asarray((pts - pts[0]) * self.tick_s, dtype=np.float64)

    def repeated(self, pts: Iterable[int | None]) -> int:
        """Return the largest number of AVI chunks, numbered by the timestamps, that only repeat the last picture."""
        known = [number for number in pts if number is not None]
        if not known or self._about["format"] != "avi":
            return 0
        # The last frame may be shown for as long as the longest other one.
        chunks = known[-1] - known[0] + int(np.diff(known).max(initial=1))
        return max(chunks - len(known), 0)

    def keep(self, indices: Iterable[int]) -> None:
        """Cache these frames in memory during the next pass, for :meth:`pictures`."""
        self._keep = frozenset(indices)

    def pictures(self, indices: Iterable[int]) -> dict[int, NDArray[np.uint8]]:
        """Return some frames of the last pass by number; those that cannot be decoded are left out.

        Where seeking fails, in a damaged film or one without an index, the frames come from one further pass.
        """
        wanted = set(indices)
        found = {index: self._kept[index] for index in wanted & set(self._kept)}
        timestamps = {index: self.pts[index] for index in wanted - set(found) if index < len(self.pts)}
        sought = self._sought({pts for pts in timestamps.values() if pts is not None})
        found |= {index: sought[pts] for index, pts in timestamps.items() if pts in sought}
        return found | pictures_of(self, wanted - set(found))

    def _sought(self, timestamps: Collection[int]) -> dict[int, NDArray[np.uint8]]:
        """Return frames by timestamp, by seeking to the key frames before them; without those that fail.

        Frames that follow the same key frame are decoded together: an encoder may set the next one only after 250.
        """
        found: dict[int, NDArray[np.uint8]] = {}
        if not timestamps:
            return found
        waiting = sorted(timestamps, reverse=True)
        with self.open() as container:
            stream = self.stream(container)
            stream.thread_type = "AUTO"
            while waiting:
                first = waiting[-1]
                # Damage ends this search: only a pass from the start detects which frames are whole.
                with contextlib.suppress(av.error.FFmpegError, OSError):
                    container.seek(first, stream=stream)
                    for frame in (frame for frame in container.decode(stream) if frame.pts is not None):
                        while waiting and waiting[-1] < frame.pts:
                            waiting.pop()
                        if waiting and waiting[-1] == frame.pts:
                            found[waiting.pop()] = luma_of(frame, self.display).copy()
                        # The next wanted frame may follow many more key frames: another seek is faster.
                        if not waiting or (frame.key_frame and waiting[-1] != first):
                            break
                if waiting and waiting[-1] == first:
                    waiting.pop()
        return found

    def _time_s(self, index: int, pts: int | None, start: int | None, base: Fraction, last_s: float) -> float:
        given_s = self.given.of(index)
        if given_s is not None:
            return given_s
        step = 1.0 / (self.rate_fps or DEFAULT_FPS)
        if pts is None or start is None:
            return last_s + step if np.isfinite(last_s) else 0.0
        # Rounded once, by the division, as if computed with fractions.
        time_s = (pts - start) * base.numerator / base.denominator
        # Two frames may have the same timestamp: some containers' clocks are coarser than the frame rate.
        return time_s if time_s > last_s else last_s + 1e-3 * step

    def _note(self, index: int, time_s: float, decoder: Decoder, *, missing: bool) -> None:
        if decoder.in_damage and not missing:
            return
        decoder.in_damage = True
        text = "could not be decoded" if missing else "was decoded with errors"
        more = f" ({decoder.message})" if decoder.message else ""
        self.damage.add(index, time_s, f"frame {index} {text}{more}; nothing is taken from here to the next key frame")

    def _note_end(self, count: int, last_s: float, decoder: Decoder) -> None:
        self.given.note_rows_left(self.damage, count)
        self._note_interlaced(decoder, count)
        text = ""
        if decoder.fatal:
            text = f"the film cannot be read past frame {count - 1} ({decoder.fatal}); what came before is kept"
        elif self.frame_count is not None and count + decoder.hidden + self.repeated(self.pts) < self.frame_count:
            text = f"the film ends after frame {count - 1}, but {self.frame_count} frames are declared: it was cut"
        elif self.frame_count is None and self._declared_s is not None and not self.given:
            steps_s = np.diff(np.array([pts for pts in self.pts if pts is not None])) * self.tick_s
            # The last frame may be shown for as long as the longest other one; another step allows for rounding.
            if len(steps_s) and self._declared_s - last_s > self._start_s + 2.0 * float(steps_s.max()):
                text = (
                    f"the film ends after frame {count - 1}, {last_s:.1f} s into it, but a length of "
                    f"{self._declared_s:.1f} s is declared: it was cut"
                )
        if text:
            self.damage.add(count, last_s, text)

    def _note_interlaced(self, decoder: Decoder, count: int) -> None:
        if not decoder.interlaced:
            return
        part = "" if decoder.interlaced == count else f" in {decoder.interlaced} of its {count} frames"
        text = (
            f"the film is interlaced{part}: of such a frame only the field that is shown first is used, which halves "
            "the resolution down the picture; film progressively (25p or 30p instead of 50i or 60i)"
        )
        self.damage.add(0, 0.0, text, kind="interlaced")

    def open(self) -> Any:
        """Return the film's container, to be closed after use."""
        try:
            return av.open(self.name, metadata_errors="ignore")
        except (av.error.FFmpegError, OSError) as error:
            raise InputError(
                f"is not a film that can be read ({reason_of(error)})",
                where=self.name,
                do="check that the copy is whole; a film whose recording was cut off may be mended with ffmpeg",
            ) from error

    def stream(self, container: Any) -> Any:
        """Return the video stream that a player would show; a cover picture does not count."""
        streams = _films_in(container)
        if not streams:
            others = ", ".join(sorted({stream.type for stream in container.streams})) or "nothing"
            covers = " and a cover picture" if container.streams.video else ""
            raise InputError(
                "has no video stream",
                where=self.name,
                value=f"{others.replace('video', '').strip(', ') or 'nothing else'}{covers}",
                do="name the film",
            )
        best = container.streams.best("video")
        stream = best if best in streams else streams[0]
        if stream.codec_context is None or not hasattr(stream.codec_context, "width"):
            raise InputError("has a codec that cannot be decoded here", where=self.name, do="convert it with ffmpeg")
        return stream

    def _note_streams(self, container: Any, stream: Any) -> None:
        """Note which stream is used where there is more than one."""
        streams = _films_in(container)
        if len(streams) < 2:
            return
        self._about["video_streams"] = len(streams)
        self._about["video_stream"] = streams.index(stream)
        sizes = [f"{one.codec_context.width} × {one.codec_context.height}" for one in streams if one.codec_context]
        text = (
            f"the film holds {len(streams)} video streams ({', '.join(sizes)}), and number {streams.index(stream)}, "
            "which players show, is used; for another one write it into a file of its own"
        )
        self.damage.add(0, 0.0, text, kind="streams")

    def _note_slow_motion(self, container: Any, stream: Any) -> None:
        """Note a capture rate in the metadata that is above the playing rate, unless true times are given."""
        metadata = {**container.metadata, **stream.metadata}
        told = next((metadata[key] for key in _CAPTURE_KEYS if key in metadata), "")
        try:
            capture_fps = float(told)
        except ValueError:
            return
        self._about["camera_says_fps"] = capture_fps
        # Nearer to the least factor of slow motion than to none.
        if not self.rate_fps or not capture_fps > math.sqrt(SLOW_MOTION[0]) * self.rate_fps or self.given:
            return
        text = (
            f"the camera filmed {capture_fps:g} frames a second (its own note in the file) and the film plays "
            f"{self.rate_fps:.4g}: in slow motion every time is wrong by {capture_fps / self.rate_fps:.3g}; give "
            f"--fps {capture_fps:g}"
        )
        self.damage.add(0, 0.0, text, kind="slow motion")


def _films_in(container: Any) -> list[Any]:
    """Return the video streams that are not cover pictures."""
    cover = av.stream.Disposition.attached_pic
    return [stream for stream in container.streams.video if not stream.disposition & cover]
