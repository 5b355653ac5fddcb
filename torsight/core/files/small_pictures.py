"""Pictures as arrays: shrinking for display or comparison, and encoding as the bytes of a file."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

Pixels = NDArray[np.uint8]


def shrunk(pixels: Pixels, longest_px: int) -> Pixels:
    """Return a picture (h, w, …) shrunk to at most ``longest_px``, by means over areas, which keep thin marks."""
    scale = longest_px / max(pixels.shape[:2])
    if scale >= 1.0:
        return pixels
    size = (max(1, round(scale * pixels.shape[1])), max(1, round(scale * pixels.shape[0])))
    return np.asarray(cv2.resize(pixels, size, interpolation=cv2.INTER_AREA), np.uint8)


def encoded(pixels: Pixels, suffix: str, *, quality: int | None = None) -> bytes:
    """Return a picture encoded as ``.png``, or as ``.jpg`` or ``.webp`` with a quality up to 100."""
    kind = cv2.IMWRITE_WEBP_QUALITY if suffix == ".webp" else cv2.IMWRITE_JPEG_QUALITY
    options = () if quality is None else (kind, quality)
    return bytes(cv2.imencode(suffix, pixels, options)[1].tobytes())
