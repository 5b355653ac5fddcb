"""One pass of decoding a film, which keeps account of packets that yield no frame."""

from __future__ import annotations

import contextlib
import heapq
from collections.abc import Iterator
from typing import Any

import av

from torsight.core.errors import reason_of
from tracker.frames.display import Closed, Display, Luma, luma_of


class Decoder:
    """One pass of decoding.

    ``message`` is the decoder's last error on a packet, ``fatal`` the error that ended the pass before the end of the
    file. ``hidden`` counts packets that are not meant to be shown: those that an edit list discards, and those without
    a picture of their own; ``interlaced`` counts frames that hold two instants. ``in_damage``: the frame decoded last
    depends on one that could not be decoded whole.
    """

    def __init__(self) -> None:
        self.message = ""
        self.fatal = ""
        self.hidden = 0
        self.in_damage = False
        self.interlaced = 0
        self._waiting: list[int] = []
        self._errors = 0

    def pictures(
        self, container: Any, stream: Any, *, display: Display
    ) -> Iterator[tuple[int | None, Luma | None, bool]]:
        """Yield ``(pts, luma or None, damaged)`` in display order."""
        damaged, closed = False, Closed()
        for frame in self._decoded(container, stream):
            for pts in self._missing_before(frame.pts):
                damaged = True
                yield pts, None, True
            if frame.key_frame and not frame.is_corrupt:
                damaged = False
                self.in_damage = False
            damaged = damaged or bool(frame.is_corrupt)
            self.interlaced += bool(frame.interlaced_frame)
            yield frame.pts, closed(luma_of(frame, display)), damaged

    def _decoded(self, container: Any, stream: Any) -> Iterator[Any]:
        packets = container.demux(stream)
        while True:
            try:
                packet = next(packets)
            except StopIteration:
                return
            except (av.error.FFmpegError, OSError) as error:
                self.fatal = reason_of(error)
                # Frames that the decoder still holds were read before the damage.
                with contextlib.suppress(av.error.FFmpegError, EOFError):
                    yield from stream.decode(None)
                return
            if packet.is_discard:
                # Outside the edit list: decoded, because other frames depend on it, but not yielded.
                self.hidden += 1
            elif packet.pts is not None and packet.size:
                heapq.heappush(self._waiting, packet.pts)
            if packet.is_corrupt:
                self._errors += 1
                self.message = "a packet is marked as corrupt"
            try:
                yield from packet.decode()
            except (av.error.InvalidDataError, av.error.FFmpegError) as error:
                self._errors += 1
                self.message = reason_of(error)

    def _missing_before(self, pts: int | None) -> Iterator[int]:
        """Yield the timestamps of packets before ``pts`` that yielded no frame, once an error has occurred.

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
