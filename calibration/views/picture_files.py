"""Pictures and films of a board: grey images with their name, hash and camera."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import av
import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError
from PIL.ExifTags import IFD, Base

from torsight.core.errors import InputError
from torsight.core.files.paths import PICTURE_SUFFIXES, AnyPath, files_named
from torsight.core.files.provenance import file_hash

MOST_FILM_VIEWS: Final = 30
"""Largest number of a film's frames for a lens: beyond it, five more frames reduce the sigma by less than a tenth."""
_FILM_CANDIDATES: Final = 5 * MOST_FILM_VIEWS
"""Number of a film's frames that are searched, to choose among."""


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """One grey picture (h, w) as displayed, named by its file, or by film and number of a frame.

    ``sha256`` is the hash of the file, ``device`` camera and focal length (empty where the file does not state them),
    ``group`` the film of a frame (empty for a picture file).
    """

    name: str
    grey: NDArray[np.uint8]
    sha256: str
    device: str = ""
    group: str = ""

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height."""
        return int(self.grey.shape[1]), int(self.grey.shape[0])


def expand(sources: Sequence[AnyPath]) -> list[Path]:
    """Return the files of pictures, films, folders and globs, each folder and glob in the order of names."""
    files: list[Path] = []
    for source in sources:
        found = files_named(source)
        if not found:
            raise InputError(
                "holds no picture", where=str(source), limit=", ".join(PICTURE_SUFFIXES), do="check the path"
            )
        files += found
    return files


def is_film(path: Path) -> bool:
    """Return whether a file is taken as a film."""
    return path.suffix.lower() not in PICTURE_SUFFIXES


def film_step(files: Sequence[Path]) -> int:
    """Return the step between searched frames of the films, such that the longest film gives some hundred."""
    longest = max((_frame_count(path) for path in files if is_film(path)), default=0)
    return max(1, longest // _FILM_CANDIDATES)


def read_pictures(files: Sequence[Path], *, step: int) -> Iterator[Picture]:
    """Yield every picture, and every ``step``-th frame of every film.

    Raises InputError when a file is neither a picture nor a film that can be decoded.
    """
    for path in files:
        if is_film(path):
            yield from _frames(path, step)
        else:
            yield _picture(path)


def _picture(path: Path) -> Picture:
    digest = file_hash(path)
    # Decoded from bytes: on Windows OpenCV opens no file whose name is not ASCII.
    data = np.fromfile(path, dtype=np.uint8)
    try:
        grey = cv2.imdecode(data, cv2.IMREAD_GRAYSCALE) if data.size else None
    except cv2.error:
        grey = None
    if grey is None:
        raise InputError("is not a readable picture", where=str(path), do="record it again or leave it out")
    return Picture(name=path.name, grey=np.asarray(grey, np.uint8), sha256=digest, device=_device(path))


def _device(path: Path) -> str:
    """Return camera and focal length from the picture's EXIF data, as far as they are stated."""
    try:
        with Image.open(path) as image:
            notes = image.getexif()
            inner = notes.get_ifd(IFD.Exif)
    except (UnidentifiedImageError, OSError, ValueError, SyntaxError):
        return ""
    words = [notes.get(Base.Make), notes.get(Base.Model), inner.get(Base.BodySerialNumber)]
    focal = inner.get(Base.FocalLength)
    if focal:
        words.append(f"{float(focal):g} mm")
    return " ".join(str(word).strip(" \0") for word in words if word)


def _frames(path: Path, step: int) -> Iterator[Picture]:
    """Yield every ``step``-th frame of a film; packets that cannot be decoded are skipped."""
    digest = file_hash(path)
    with _opened(path) as (container, stream):
        stream.thread_type = "AUTO"
        for index, frame in enumerate(_decoded(container, stream)):
            if index % step == 0:
                turned = np.rot90(frame.to_ndarray(format="gray"), k=int(frame.rotation or 0) // 90)
                grey = np.ascontiguousarray(turned)
                yield Picture(name=f"{path.name} frame {index}", grey=grey, sha256=digest, group=path.name)


def _frame_count(path: Path) -> int:
    """Return the number of frames, counted by packets: cheaper than decoding, and right where the header is wrong."""
    with _opened(path) as (container, stream):
        return sum(1 for packet in container.demux(stream) if packet.size)


@contextlib.contextmanager
def _opened(path: Path) -> Iterator[tuple[Any, Any]]:
    """Give the container of a film and its first stream of pictures; a file that cannot be decoded is refused."""
    try:
        with av.open(str(path)) as container:
            yield container, container.streams.video[0]
    except (av.error.FFmpegError, IndexError, OSError) as error:
        raise InputError(
            f"is neither a picture nor a film that can be decoded ({error})",
            where=str(path),
            limit=f"a film, or a picture ({', '.join(PICTURE_SUFFIXES)})",
            do="convert or record it again",
        ) from error


def _decoded(container: Any, stream: Any) -> Iterator[Any]:
    for packet in container.demux(stream):
        try:
            yield from packet.decode()
        except av.error.InvalidDataError:
            continue


def require_same_camera(first: Picture, other: Picture) -> None:
    """Refuse a picture of another size, or one whose file names another camera or focal length."""
    if other.size_px != first.size_px:
        raise InputError(
            "has another size than the first picture",
            where=other.name,
            value=f"{other.size_px[0]} × {other.size_px[1]}",
            limit=f"{first.size_px[0]} × {first.size_px[1]} as {first.name}",
            do="calibrate with pictures of one camera in one mode, uncropped and unscaled",
        )
    if other.device and first.device and other.device != first.device:
        raise InputError(
            "is from another camera or focal length than the first picture",
            where=other.name,
            value=other.device,
            limit=f"{first.device} as {first.name}",
            do="calibrate each camera, and each setting of its zoom, separately",
        )
