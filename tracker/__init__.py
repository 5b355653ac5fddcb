"""From a film of two sticks to the angle between them, frame by frame, each with its uncertainty."""

from tracker.account import account
from tracker.hints import MarkerHints, read_markers
from tracker.orient import orient
from tracker.plane import Orientation
from tracker.source import Frame, FrameSource, open_source
from tracker.stereo import orient_pair
from tracker.track import TrackResult, track_film

__all__ = [
    "Frame",
    "FrameSource",
    "MarkerHints",
    "Orientation",
    "TrackResult",
    "account",
    "open_source",
    "orient",
    "orient_pair",
    "read_markers",
    "track_film",
]
