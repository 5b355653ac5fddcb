"""Lossless grey films for tests, stored as they are: to pack and unpack pictures takes longer than to draw them."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import av
import numpy as np


def write_grey(path: Path, pictures: Iterable[np.ndarray], *, fps: float) -> Path:
    """Write pictures (h, w) uint8 as a film of a whole number of frames per second, and return its path."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream("rawvideo", rate=round(fps))
        stream.pix_fmt = "gray"
        for number, picture in enumerate(pictures):
            if number == 0:
                stream.height, stream.width = picture.shape
            for packet in stream.encode(av.VideoFrame.from_ndarray(picture, format="gray")):
                container.mux(packet)
        for packet in stream.encode(None):
            container.mux(packet)
    return path
