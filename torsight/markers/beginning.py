"""The first seconds of a film as a film of their own: what the check on the page follows the picks through."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from torsight.core.errors import NoResultError, TorsightError
from torsight.core.tracks import MARKERS, USUAL_SHARE, MarkerTracks
from torsight.core.units import DEG
from torsight.core.words.wording import counted, listed
from torsight.markers.drawing import SHOWN_PX
from tracker.detect.marker_file import MarkerHints, read_markers

if TYPE_CHECKING:
    from tracker.frames.frame import Frame, FrameSource

MOST_FRAMES: Final = 1000
"""Frames that a check follows at most: one at 1000 frames a second ends after a second, not after minutes."""
_SHOWN: Final = 61
"""Frames of a check that the page plays; the points are followed in all."""


class Beginning:
    """A source of the frames of the first seconds of another source."""

    def __init__(self, source: FrameSource, *, seconds: float) -> None:
        self.name = source.name
        self.damage = source.damage
        self._source = source
        self._seconds = seconds

    def files(self) -> list[Path]:
        """Return the files that the frames come from."""
        return self._source.files()

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height as displayed."""
        return self._source.size_px

    @property
    def frame_count(self) -> int | None:
        """How many frames there are is not known before they are read."""
        return None

    @property
    def pixel_aspect(self) -> float:
        """Width of a pixel over its height as displayed."""
        return self._source.pixel_aspect

    def describe(self) -> dict[str, Any]:
        """Return what is known of the film."""
        return self._source.describe()

    def __iter__(self) -> Iterator[Frame]:
        """Give the frames up to the first one that is too late."""
        start_s: float | None = None
        for frame in self._source:
            start_s = frame.time_s if start_s is None else start_s
            if frame.time_s - start_s > self._seconds or frame.index >= MOST_FRAMES:
                return
            yield frame


@dataclass(frozen=True, slots=True, eq=False)
class Followed:
    """What became of picked points in the first seconds.

    Attributes
    ----------
    frame : (k,) int64
        The frames that are shown, from all that were followed.
    time_s : (k,) float64
        Their times.
    pictures : tuple of bytes
        The same frames as JPEG.
    position_px : (k, 4, 2) float64
        The points in them; NaN where not seen.
    angle_deg : (k,) float64
        The angle; NaN where it is not known.
    count : int
        Frames that were followed.
    seen : (4,) int64
        In how many of them each point was seen.
    turned_deg : (2,) float64
        By how much the line through each stick's points turned from its one extreme to the other; NaN where not seen.
    verdict : str
        One sentence.
    warnings : tuple of str
        What does not look right.
    """

    frame: NDArray[np.int64]
    time_s: NDArray[np.float64]
    pictures: tuple[bytes, ...]
    position_px: NDArray[np.float64]
    angle_deg: NDArray[np.float64]
    count: int
    seen: NDArray[np.int64]
    turned_deg: NDArray[np.float64]
    verdict: str
    warnings: tuple[str, ...]

    def to_page(self) -> dict[str, Any]:
        """Return what the page shows, without the pictures; None for NaN."""
        return {
            "frames": [
                {
                    "frame": int(frame),
                    "time_s": float(time_s),
                    "points": {name: _known(point) for name, point in zip(MARKERS, points, strict=True)},
                    "angle_deg": None if np.isnan(angle) else float(angle),
                }
                for frame, time_s, points, angle in zip(
                    self.frame, self.time_s, self.position_px, self.angle_deg, strict=True
                )
            ],
            "count": self.count,
            "seen": {name: int(count) for name, count in zip(MARKERS, self.seen, strict=True)},
            "verdict": self.verdict,
            "warnings": list(self.warnings),
        }


def follow_beginning(source: FrameSource, hints: MarkerHints, *, seconds: float) -> Followed:
    """Follow picked markers through the first seconds of a film, as ``torsight track`` would.

    Raises
    ------
    ConfigError, NoResultError
        When the tracker cannot start from them.
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
    shown = np.unique(np.linspace(0, count - 1, _SHOWN).round().astype(np.int64))
    seen = tracks.valid.sum(axis=0)
    turned_deg = np.array([_turned_deg(tracks, first) for first in (0, 2)])
    unseen = [
        f"{name.replace('_', ' ')} in {count - n}"
        for name, n in zip(MARKERS, seen.tolist(), strict=True)
        if n < USUAL_SHARE * count
    ]
    if unseen:
        warnings.insert(0, f"Of {counted(count, 'frame')} a marker was not seen: {listed(unseen)}.")
    return Followed(
        frame=tracks.frame[shown],
        time_s=tracks.time_s[shown],
        pictures=_pictures(part, shown),
        position_px=np.where(tracks.valid[shown, :, None], tracks.position_px[shown], np.nan),
        angle_deg=angles.angle_rad[shown] / DEG,
        count=count,
        seen=seen,
        turned_deg=turned_deg,
        verdict=_verdict(int(angles.valid.sum()), tracks, which_moves(part, hints), turned_deg),
        warnings=tuple(warnings),
    )


def _verdict(known: int, tracks: MarkerTracks, moving: int | None, turned_deg: NDArray[np.float64]) -> str:
    count, lasted_s = len(tracks), float(tracks.time_s[-1] - tracks.time_s[0])
    told = f"{known} of {counted(count, 'frame')} ({lasted_s:.1f} s) have an angle"
    if moving is None:
        return f"{told}; neither stick has turned yet: follow a longer stretch to see which one moves."
    if moving == 0:
        return f"{told}, but the stick picked as base is the one that turns: exchange base and moving."
    return f"{told}; the moving stick turned by {turned_deg[1]:.1f}°."


def which_moves(source: FrameSource, hints: MarkerHints) -> int | None:
    """Return which stick moves, 0 for the one given as base and 1 for the other; None where neither does yet."""
    from tracker.initialise import find_start

    follower = find_start(source, hints).follower(motion_tells=True)
    for frame in source:
        follower.step(frame)
        if follower.moving is not None:
            return follower.moving
    return None


def name_sticks(source: FrameSource, sticks_px: NDArray[np.float64], *, seconds: float) -> NDArray[np.float64] | None:
    """Return the markers (4, 2) of two sticks (2, 2, 2) in their order, base first; None where neither moves yet.

    The sticks' markers are those of the first frame, inner ones first; so many seconds of the film are looked at.
    """
    one, two = sticks_px.tolist()
    try:
        moving = which_moves(Beginning(source, seconds=seconds), read_markers({"base": one, "moving": two}))
    except TorsightError:
        return None
    return None if moving is None else np.array([*one, *two] if moving else [*two, *one])


def _turned_deg(tracks: MarkerTracks, first: int) -> float:
    offset = tracks.position_px[:, first + 1] - tracks.position_px[:, first]
    offset = offset[tracks.valid[:, first] & tracks.valid[:, first + 1]]
    if not len(offset):
        return float("nan")
    return float(np.ptp(np.unwrap(np.arctan2(offset[:, 1], offset[:, 0])))) / DEG


def _pictures(source: Beginning, shown: NDArray[np.int64]) -> tuple[bytes, ...]:
    """Return some frames as JPEG, shrunk to what a page shows; a frame that cannot be decoded as an empty picture."""
    wanted = set(shown.tolist())
    return tuple(
        jpeg(frame.luma if frame.luma is not None else np.zeros(source.size_px[::-1], np.uint8))
        for frame in source
        if frame.index in wanted
    )


def jpeg(luma: NDArray[np.uint8]) -> bytes:
    """Return a frame as JPEG, shrunk to what a page shows."""
    import cv2

    scale = SHOWN_PX / max(luma.shape)
    if scale < 1.0:
        size = (round(scale * luma.shape[1]), round(scale * luma.shape[0]))
        luma = np.asarray(cv2.resize(luma, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
    done, data = cv2.imencode(".jpg", luma, [cv2.IMWRITE_JPEG_QUALITY, 85])
    assert done  # noqa: S101 - a grey picture can always be encoded
    return data.tobytes()


def _known(point: NDArray[np.float64]) -> list[float] | None:
    return None if np.isnan(point).any() else [float(point[0]), float(point[1])]


def seconds_of(seconds: Any) -> float:
    """Return how many seconds to follow from what a page sends; three where it sends nothing usable."""
    usable = isinstance(seconds, (int, float)) and 0.0 < float(seconds) <= 60.0
    return float(seconds) if usable else 3.0
