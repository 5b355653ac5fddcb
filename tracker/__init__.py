"""From a film of two sticks to the angle between them, frame by frame, each with its uncertainty."""

from __future__ import annotations

from typing import Final

from torsight.core.lazy import lazily

_HOMES: Final = {
    "Frame": "frames.frame",
    "FrameSource": "frames.frame",
    "MarkerHints": "detect.marker_file",
    "Orientation": "angle.plane",
    "TrackResult": "track",
    "account": "quality.account",
    "open_source": "frames.source",
    "orient": "angle.orient",
    "orient_pair": "angle.stereo",
    "read_markers": "detect.marker_file",
    "track_film": "track",
}

__getattr__, __dir__ = lazily(__name__, _HOMES)
