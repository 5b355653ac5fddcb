"""From a film of two sticks to the angle between them, frame by frame, each with its uncertainty."""

from tracker.angle.orient import orient
from tracker.angle.plane import Orientation
from tracker.angle.stereo import orient_pair
from tracker.detect.marker_file import MarkerHints, read_markers
from tracker.frames.frame import Frame, FrameSource
from tracker.frames.source import open_source
from tracker.quality.account import account
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
