# The names of tracker for editors and type checkers; they are imported on first use.

from tracker.angle.orient import orient as orient
from tracker.angle.plane import Orientation as Orientation
from tracker.angle.stereo import orient_pair as orient_pair
from tracker.detect.marker_file import MarkerHints as MarkerHints
from tracker.detect.marker_file import read_markers as read_markers
from tracker.frames.frame import Frame as Frame
from tracker.frames.frame import FrameSource as FrameSource
from tracker.frames.source import open_source as open_source
from tracker.quality.account import account as account
from tracker.track import TrackResult as TrackResult
from tracker.track import track_film as track_film
