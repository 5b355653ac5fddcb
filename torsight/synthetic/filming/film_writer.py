"""Writing films: H.264, FFV1, MJPEG or a folder of pictures, from 8-bit luma, with exact timestamps."""

from __future__ import annotations

import contextlib
import queue
import shutil
import tempfile
import threading
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any, Final, Self

import av
import numpy as np
from av.video.reformatter import ColorRange
from numpy.typing import NDArray

from torsight.core.errors import OutputError
from torsight.core.files.small_pictures import encoded
from torsight.core.files.storage import atomic_path, not_written
from torsight.synthetic.scene import FilmSettings

Luma = NDArray[np.uint8]

TICKS: Final = {
    "h264": Fraction(1, 90000),
    "ffv1": Fraction(1, 1000),
    "mjpeg": Fraction(1, 1000),
    "png": Fraction(1, 90000),
}
"""Resolution of the frames' timestamps (Matroska counts milliseconds)."""

SUFFIXES: Final = {"h264": ".mp4", "ffv1": ".mkv", "mjpeg": ".mkv", "png": ""}


@contextlib.contextmanager
def open_film(path: Path, settings: FilmSettings, size_px: tuple[int, int]) -> Iterator[_Pictures | Encoder]:
    """Give a writer for a film that appears at ``path`` when it is complete."""
    if settings.codec == "png":
        with _open_folder(path) as folder_writer:
            yield folder_writer
        return
    with atomic_path(path) as temporary, Encoder(temporary, settings, size_px) as encoder:
        yield encoder


@contextlib.contextmanager
def _open_folder(path: Path) -> Iterator[_Pictures]:
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = Path(tempfile.mkdtemp(prefix=f".{path.name}.", dir=path.parent))
    try:
        yield _Pictures(temporary)
        temporary.chmod(0o755)
        if path.is_dir():
            shutil.rmtree(path)
        temporary.replace(path)
    except OSError as error:
        raise not_written(path, error) from error
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


class _Pictures:
    """Writes the frames as pictures into a folder, in their order."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._count = 0

    def add(self, tick: int, luma: Luma) -> None:
        del tick
        (self._folder / f"{self._count:06d}.png").write_bytes(encoded(luma, ".png"))
        self._count += 1


class Encoder:
    """Encodes in a separate thread, so that drawing and encoding share the cores."""

    def __init__(self, path: Path, settings: FilmSettings, size_px: tuple[int, int]) -> None:
        self._codec = settings.codec
        self._tick = TICKS[settings.codec]
        name = "mp4" if settings.codec == "h264" else "matroska"
        # bitexact: no dates, versions or random identifiers in the container.
        self._container = av.open(str(path), "w", format=name, options={"fflags": "+bitexact"})
        self._stream: Any = self._add_stream(settings, size_px)
        # Long enough to keep both sides busy, and only some megabytes: drawing waits where the encoder is slower.
        self._queue: queue.Queue[tuple[int, Luma] | None] = queue.Queue(maxsize=16)
        self._failure: BaseException | None = None
        self._thread = threading.Thread(target=self._run, name="film encoder", daemon=True)

    def _add_stream(self, settings: FilmSettings, size_px: tuple[int, int]) -> Any:
        rate = Fraction(settings.fps).limit_denominator(100000)
        codec, options = {
            "h264": ("libx264", {"crf": str(settings.crf), "preset": "veryfast", "x264-params": "threads=2"}),
            "ffv1": ("ffv1", {"level": "3"}),
            "mjpeg": ("mjpeg", {}),
        }[settings.codec]
        stream: Any = self._container.add_stream(codec, rate=rate, options=options)
        stream.width, stream.height = size_px
        stream.pix_fmt = {"h264": "yuv420p", "ffv1": "gray", "mjpeg": "yuvj420p"}[settings.codec]
        context = stream.codec_context
        context.time_base = self._tick
        context.flags |= 1 << 23  # AV_CODEC_FLAG_BITEXACT
        if settings.codec != "ffv1":
            context.color_range = ColorRange.JPEG
        if settings.codec == "mjpeg":
            context.qmin = context.qmax = 2
        return stream

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, kind: object, *rest: object) -> None:
        self._queue.put(None)
        self._thread.join()
        self._container.close()
        if kind is None and self._failure is not None:
            raise OutputError(
                f"film cannot be written ({self._failure})", where=str(self._container.name)
            ) from self._failure

    def add(self, tick: int, luma: Luma) -> None:
        """Hand a frame to the encoder."""
        self._queue.put((tick, luma))

    def _run(self) -> None:
        item = None
        try:
            while (item := self._queue.get()) is not None:
                self.encode(*item)
            self._container.mux(self._stream.encode(None))
        except Exception as error:  # noqa: BLE001 - handed to the caller's thread
            self._failure = error
            # The other thread may wait for room in the queue.
            while item is not None:
                item = self._queue.get()

    def encode(self, tick: int, luma: Luma) -> None:
        """Encode a frame at a time in ticks of the container, in the thread of the encoder."""
        if self._codec == "ffv1":
            frame = av.VideoFrame.from_ndarray(luma, format="gray")
        else:
            # The grey levels are the luma plane unchanged; both colour planes are neutral.
            height, width = luma.shape
            planes = np.full((height * 3 // 2, width), 128, np.uint8)
            planes[:height] = luma
            frame = av.VideoFrame.from_ndarray(planes, format=self._stream.pix_fmt)
            frame.color_range = self._stream.codec_context.color_range
        frame.pts = tick
        frame.time_base = self._tick
        self._container.mux(self._stream.encode(frame))
