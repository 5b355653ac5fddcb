"""The first seconds of a film as a separate film, through which the page's check follows the picked markers."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from torsight.core.errors import NoResultError, TorsightError
from torsight.core.files.small_pictures import encoded, shrunk
from torsight.core.files.storage import plain
from torsight.core.tracks import MARKERS, USUAL_SHARE, MarkerTracks
from torsight.core.units import DEG, Floats, Ints
from torsight.core.words.wording import counted, listed
from tracker.detect.marker_file import MarkerHints, read_markers

if TYPE_CHECKING:
    from tracker.frames.frame import Frame, FrameSource

MOST_FRAMES: Final = 1000
"""Largest number of frames of a check: a film of 1000 frames a second is followed for a second, not for minutes."""
SHOWN_PX: Final = 960
"""Longer side of a frame in the page or in a picture: smaller ones are enlarged, larger ones shrunk."""


class Beginning:
    """A source of the frames of the first seconds of another source."""

    def __init__(self, source: FrameSource, *, seconds: float) -> None:
        self.name, self.damage = source.name, source.damage
        self.size_px, self.pixel_aspect = source.size_px, source.pixel_aspect
        # The number of frames is not known before they are read.
        self.frame_count: int | None = None
        self.files, self.describe = source.files, source.describe
        self._source = source
        self._seconds = seconds

    def __iter__(self) -> Iterator[Frame]:
        """Give the frames up to the limits of time and number."""
        start_s: float | None = None
        for frame in self._source:
            start_s = frame.time_s if start_s is None else start_s
            if frame.time_s - start_s > self._seconds or frame.index >= MOST_FRAMES:
                return
            yield frame


def follow_beginning(
    source: FrameSource, hints: MarkerHints, *, seconds: float
) -> tuple[dict[str, Any], tuple[bytes, ...]]:
    """Follow picked markers through the first seconds of a film, as ``torsight track`` would.

    First the content for the page: of each shown frame its number, time, points and angle, None where not seen or not
    known; the number of followed frames, and in how many each point was seen; a summary in one sentence, and warnings.
    Then the shown frames as JPEG.

    Raises ConfigError or NoResultError when the tracker cannot start from them.
    """
    from tracker.angle.orient import orient
    from tracker.quality.track_warnings import doubts
    from tracker.track import track_film

    part = Beginning(source, seconds=seconds)
    result = track_film(part, markers=hints)
    tracks = result.tracks
    count = len(tracks)
    if count == 0:
        raise NoResultError("the film ends before anything can be followed", where=source.name)
    warnings = list(doubts(result))
    angles = orient(tracks, None, pixel_aspect=source.pixel_aspect).angles
    # The points are followed in all frames; the page plays sixty-one of them.
    shown = np.unique(np.linspace(0, count - 1, 61).round().astype(np.int64))
    seen = tracks.valid.sum(axis=0)
    unseen = [
        f"{name.replace('_', ' ')} in {count - n}"
        for name, n in zip(MARKERS, seen.tolist(), strict=True)
        if n < USUAL_SHARE * count
    ]
    if unseen:
        warnings.insert(0, f"Of {counted(count, 'frame')} a marker was not seen: {listed(unseen)}.")
    content: dict[str, Any] = plain(
        {
            "frames": [
                {
                    "frame": tracks.frame[k],
                    "time_s": tracks.time_s[k],
                    "points": {
                        name: point if good else None
                        for name, point, good in zip(MARKERS, tracks.position_px[k], tracks.valid[k], strict=True)
                    },
                    "angle_deg": angles.angle_rad[k] / DEG,
                }
                for k in shown
            ],
            "count": count,
            "seen": dict(zip(MARKERS, seen, strict=True)),
            "verdict": _verdict(int(angles.valid.sum()), tracks, which_moves(part, hints)),
            "warnings": warnings,
        }
    )
    return content, _pictures(part, shown)


def _verdict(known: int, tracks: MarkerTracks, moving: int | None) -> str:
    count, lasted_s = len(tracks), float(tracks.time_s[-1] - tracks.time_s[0])
    told = f"{known} of {counted(count, 'frame')} ({lasted_s:.1f} s) have an angle"
    if moving is None:
        return f"{told}; neither stick has turned yet: follow a longer stretch to see which one moves."
    if moving == 0:
        return f"{told}, but the stick picked as base is the one that turns: exchange base and moving."
    return f"{told}; the moving stick turned by {_turned_deg(tracks):.1f}°."


def which_moves(source: FrameSource, hints: MarkerHints) -> int | None:
    """Return the index of the stick that moves, 0 for the given base and 1 for the other; None where neither moves."""
    from tracker.initialise import find_start

    follower = find_start(source, hints).follower(motion_tells=True)
    for frame in source:
        follower.step(frame)
        if follower.moving is not None:
            return follower.moving
    return None


def name_sticks(source: FrameSource, sticks_px: Floats, *, seconds: float) -> Floats | None:
    """Return the markers (4, 2) of two sticks (2, 2, 2) in their order, base first; None where neither moves yet.

    The sticks' markers are those of the first frame, inner ones first; the first ``seconds`` of the film are searched.
    """
    one, two = sticks_px.tolist()
    try:
        moving = which_moves(Beginning(source, seconds=seconds), read_markers({"base": one, "moving": two}))
    except TorsightError:
        return None
    return None if moving is None else np.array([*one, *two] if moving else [*two, *one])


def name_tags(source: FrameSource, *, seconds: float) -> dict[str, Any] | None:
    """Return the content of the marker file of a film whose tags are found automatically.

    None where they are not, or where neither moves in the first ``seconds`` of the film.
    """
    from tracker.track import track_film

    try:
        found = track_film(Beginning(source, seconds=seconds)).report["markers"]
    except TorsightError:
        return None
    return {key: found[key] for key in ("kind", "family", "base_id", "moving_id")} if found["kind"] == "tag" else None


def _turned_deg(tracks: MarkerTracks) -> float:
    """Return the range of the moving stick's angle, degrees; NaN where the stick is not seen."""
    offset = (tracks.position_px[:, 3] - tracks.position_px[:, 2])[tracks.valid[:, 2:].all(axis=1)]
    if not len(offset):
        return float("nan")
    return float(np.ptp(np.unwrap(np.arctan2(offset[:, 1], offset[:, 0])))) / DEG


def _pictures(source: Beginning, shown: Ints) -> tuple[bytes, ...]:
    """Return some frames as JPEG, shrunk to the page's size; a frame that cannot be decoded as an empty picture."""
    wanted, empty = set(shown.tolist()), np.zeros(source.size_px[::-1], np.uint8)
    lumas = (empty if frame.luma is None else frame.luma for frame in source if frame.index in wanted)
    return tuple(encoded(shrunk(luma, SHOWN_PX), ".jpg", quality=85) for luma in lumas)


def seconds_of(seconds: Any) -> float:
    """Return the duration of a check, s, from the page's request; three seconds for an unusable value."""
    usable = isinstance(seconds, (int, float)) and 0.0 < float(seconds) <= 60.0
    return float(seconds) if usable else 3.0
