"""A row of pictures as a source of frames."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from torsight.core.errors import InputError
from tracker.source import DEFAULT_FPS, PICTURE_SUFFIXES, Damage, Frame, time_from_table


class PictureSource:
    """Pictures in the order of their names, all of one size.

    Raises
    ------
    InputError
        When there is no picture, or the first one cannot be read.
    """

    def __init__(
        self,
        paths: Sequence[Path],
        *,
        name: str,
        fps: float | None = None,
        times_s: NDArray[np.float64] | None = None,
    ) -> None:
        self.name = name
        self.paths = tuple(paths)
        self.damage = Damage()
        self.fps_given = fps is not None or times_s is not None
        self._fps = fps or DEFAULT_FPS
        self._times_s = times_s
        if not self.paths:
            raise InputError(
                "has no pictures",
                where=name,
                limit=", ".join(PICTURE_SUFFIXES),
                do="name a film, or a folder or glob of pictures",
            )
        first = _read(self.paths[0])
        if first is None:
            raise InputError("is not a readable picture", where=str(self.paths[0]), do="record it again")
        self._size_px = (first.shape[1], first.shape[0])

    def files(self) -> list[Path]:
        """Return the files that the frames come from."""
        return list(self.paths)

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height."""
        return self._size_px

    @property
    def frame_count(self) -> int | None:
        """Number of pictures."""
        return len(self.paths)

    @property
    def pixel_aspect(self) -> float:
        """Pictures have square pixels."""
        return 1.0

    def __iter__(self) -> Iterator[Frame]:
        """Give one frame per picture; one that cannot be read has no luma."""
        for index, path in enumerate(self.paths):
            time_s = (
                index / self._fps if self._times_s is None else time_from_table(self._times_s, index, name=self.name)
            )
            luma = _read(path)
            if luma is None:
                self.damage.add(index, time_s, f"{path.name} is not a readable picture")
            elif (luma.shape[1], luma.shape[0]) != self._size_px:
                raise InputError(
                    "has another size than the first picture",
                    where=f"{path}, frame {index}",
                    value=f"{luma.shape[1]} × {luma.shape[0]}",
                    limit=f"{self._size_px[0]} × {self._size_px[1]}",
                    do="keep one size per folder",
                )
            yield Frame(index, time_s, luma, damaged=luma is None)

    def describe(self) -> dict[str, Any]:
        """Return what is known of the pictures."""
        content: dict[str, Any] = {
            "kind": "pictures",
            "format": self.paths[0].suffix.lower().lstrip("."),
            "codec": "jpeg" if self.paths[0].suffix.lower() in (".jpg", ".jpeg", ".webp", ".jp2") else "none",
            "width_px": self._size_px[0],
            "height_px": self._size_px[1],
            "fps": None if self._times_s is not None else self._fps,
        }
        if not self.fps_given:
            content["note"] = f"no frame rate was given: {DEFAULT_FPS:g} pictures per second are taken"
        return content


def _read(path: Path) -> NDArray[np.uint8] | None:
    try:
        data = np.fromfile(path, dtype=np.uint8)
    except OSError:
        return None
    if data.size == 0:
        return None
    try:
        picture = cv2.imdecode(data, cv2.IMREAD_GRAYSCALE)
    except cv2.error:
        return None
    return None if picture is None else np.asarray(picture, dtype=np.uint8)
