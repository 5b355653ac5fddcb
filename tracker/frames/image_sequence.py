"""A sequence of pictures as a source of frames.

Cameras of 10, 12 and 14 bits store their values in the low bits of 16. The bit depth in use is estimated from pictures
spread over the sequence, and all pictures have the same scale: individual scales would cause flicker.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from torsight.core.errors import InputError
from torsight.core.files.paths import PICTURE_SUFFIXES, require_ordinary
from torsight.core.units import Floats
from torsight.core.words.wording import counted
from tracker.frames.frame import DEFAULT_FPS, Damage, Frame, GivenTimes

_DEPTHS: Final = (8, 10, 12, 14, 16)
"""Bits per pixel of cameras."""


class PictureSource:
    """Pictures in the order given, all of one size; ``name`` is used in messages.

    ``times_s`` (n,) take precedence over ``fps``; ``bits``, the depth of pictures with two bytes per pixel, is
    estimated from the pictures unless given. An empty sequence, a first picture that cannot be read, or a Git LFS
    pointer raises :class:`InputError`.
    """

    def __init__(
        self,
        paths: Sequence[Path],
        *,
        name: str,
        fps: float | None = None,
        times_s: Floats | None = None,
        bits: int | None = None,
    ) -> None:
        self.name = name
        self.paths = tuple(paths)
        self.damage = Damage()
        self.given = GivenTimes(fps=fps, times_s=times_s, name=name)
        if not self.paths:
            raise InputError(
                "has no pictures",
                where=name,
                limit=", ".join(PICTURE_SUFFIXES),
                do="name a film, or a folder or glob of pictures",
            )
        first = _read(self.paths[0])
        if first is None:
            require_ordinary(self.paths[0])
            raise InputError("is not a readable picture", where=str(self.paths[0]), do="record it again")
        self.size_px = (first.shape[1], first.shape[0])
        self.frame_count = len(self.paths)
        self.pixel_aspect = 1.0
        self.bits = bits or (_bits_in_use(self.paths) if first.dtype == np.uint16 else None)

    def __repr__(self) -> str:
        width, height = self.size_px
        return f"PictureSource({self.name}, {width} × {height} px, {counted(len(self.paths), 'picture')})"

    def files(self) -> list[Path]:
        """Return the files that the frames come from."""
        return list(self.paths)

    def time_s(self, index: int) -> float:
        """Return the time of a picture: as given by the user, or at 30 pictures a second."""
        given_s = self.given.of(index)
        return index / DEFAULT_FPS if given_s is None else given_s

    def __iter__(self) -> Iterator[Frame]:
        """Yield one frame per picture; one that cannot be read has no luma."""
        for index, path in enumerate(self.paths):
            time_s = self.time_s(index)
            picture = _read(path)
            luma = None if picture is None else self._to_bytes(picture, index, time_s)
            if luma is None:
                self.damage.add(index, time_s, f"{path.name} is not a readable picture")
            elif (luma.shape[1], luma.shape[0]) != self.size_px:
                raise InputError(
                    "has another size than the first picture",
                    where=f"{path}, frame {index}",
                    value=f"{luma.shape[1]} × {luma.shape[0]}",
                    limit=f"{self.size_px[0]} × {self.size_px[1]}",
                    do="keep one size per folder",
                )
            yield Frame(index, time_s, luma, damaged=luma is None)
        self.given.note_rows_left(self.damage, len(self.paths))

    def keep(self, indices: Iterable[int]) -> None:
        """Do nothing: no pictures are cached, since single pictures are read again as fast."""

    def pictures(self, indices: Iterable[int]) -> dict[int, NDArray[np.uint8]]:
        """Return some pictures by number; those that cannot be read are left out."""
        read = {index: _read(self.paths[index]) for index in indices}
        return {
            index: picture.astype(np.uint8, copy=False) if picture.dtype == np.uint8 else self._scaled(picture)
            for index, picture in read.items()
            if picture is not None
        }

    def _scaled(self, picture: Picture) -> NDArray[np.uint8]:
        """Return a picture of two bytes per pixel with one byte, values above the depth in use clipped."""
        return np.asarray(np.minimum(picture >> ((self.bits or _DEPTHS[-1]) - 8), 255), dtype=np.uint8)

    def _to_bytes(self, picture: Picture, index: int, time_s: float) -> NDArray[np.uint8]:
        """Return a picture with one byte per pixel; values above the depth in use are clipped and reported."""
        if picture.dtype == np.uint8:
            return picture.astype(np.uint8, copy=False)
        bits = self.bits or _DEPTHS[-1]
        top = int(picture.max())
        told = any(entry["kind"] == "clipped" and entry["frame"] < index for entry in self.damage.entries)
        if top >= 1 << bits and not told:
            self.damage.add(
                index,
                time_s,
                f"picture {index} holds values up to {top}, but those looked at need {bits} bits only, up to "
                f"{(1 << bits) - 1}: from here on what is brighter is clipped; pictures of one camera setting belong "
                "into a folder of their own",
                kind="clipped",
            )
        return self._scaled(picture)

    def describe(self) -> dict[str, Any]:
        """Return format, size and rate of the pictures."""
        content: dict[str, Any] = {
            "kind": "pictures",
            "format": self.paths[0].suffix.lower().lstrip("."),
            "codec": "jpeg" if self.paths[0].suffix.lower() in (".jpg", ".jpeg", ".webp", ".jp2") else "none",
            "width_px": self.size_px[0],
            "height_px": self.size_px[1],
            "fps": None if self.given.times_s is not None else self.given.fps or DEFAULT_FPS,
        }
        if self.bits is not None:
            content["bits_in_use"] = self.bits
        if not self.given:
            content["note"] = f"no frame rate was given: {DEFAULT_FPS:g} a second are taken; give it with --fps"
        return content


Picture = NDArray[np.uint8] | NDArray[np.uint16]


def _bits_in_use(paths: Sequence[Path]) -> int:
    """Return the smallest bit depth of a camera that holds the brightest value of 24 pictures of the sequence."""
    chosen = np.unique(np.linspace(0, len(paths) - 1, 24).astype(np.int64))
    pictures = [_read(paths[index]) for index in chosen]
    top = max(int(picture.max()) for picture in pictures if picture is not None and picture.dtype == np.uint16)
    return next(bits for bits in _DEPTHS if top < 1 << bits)


def _read(path: Path) -> Picture | None:
    """Return the brightness of a picture, with one byte per pixel or two; None where it cannot be read."""
    try:
        data = np.fromfile(path, dtype=np.uint8)
    except OSError:
        return None
    if data.size == 0:
        return None
    try:
        picture = cv2.imdecode(data, cv2.IMREAD_GRAYSCALE | cv2.IMREAD_ANYDEPTH)
        if picture is not None and picture.dtype not in (np.uint8, np.uint16):
            picture = cv2.imdecode(data, cv2.IMREAD_GRAYSCALE)
    except cv2.error:
        return None
    if picture is None:
        return None
    return np.asarray(picture, dtype=np.uint16) if picture.dtype == np.uint16 else np.asarray(picture, dtype=np.uint8)
