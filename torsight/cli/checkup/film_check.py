"""Check of a film before the run: stretches of the film are tracked, the rest is only sampled."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from torsight.cli.checkup.finding import Check
from torsight.cli.checkup.stretch import CLIP, track_stretches
from torsight.core.errors import TorsightError
from torsight.core.files.small_pictures import shrunk
from torsight.core.optics.camera import Camera, require_size
from torsight.core.progress import Progress, silent
from torsight.core.tracks import FEW
from torsight.core.words.wording import counted
from tracker.detect.marker_file import MarkerHints
from tracker.detect.sticks import sticks_in
from tracker.frames.sample import Clip, Timestamps, read_timestamps
from tracker.frames.source import open_source
from tracker.frames.timing import timing
from tracker.initialise import Start, find_start

Picture = NDArray[np.uint8]

PLACES: Final = 17
"""Frames over the whole film compared to find motion: the ends of sixteen parts, of which one is halved twice."""
_LOOKED_AT: Final = range(4, PLACES, 4)
"""Those of these frames in which the markers are searched for, which takes as long as tracking a thousand frames."""
_SMALL_PX: Final = 160
"""Longer side to which a frame is shrunk before it is compared with another: a quarter of VGA's, so that sixteen pixels
are one and single ones no longer count."""
_STEP_GREY: Final = np.iinfo(np.uint8).max // 10
"""Change of brightness that counts as motion: a tenth of what eight bits hold, above noise and flicker."""


def check_film(
    video: str,
    *,
    about: str = "film",
    fps: float | None = None,
    timestamps: Path | None = None,
    hints: MarkerHints | None = None,
    camera: Camera | None = None,
    progress: Progress = silent,
) -> Check:
    """Check a film: its times, the markers in frames over its whole length, and a tracked stretch with motion."""
    check = Check(about)
    try:
        source = open_source(video, fps=fps, timestamps=timestamps)
        if camera is not None:
            require_size(camera, source.size_px, film="the film")
        taken = read_timestamps(source, progress=progress)
        check.content |= source.describe()
        tick_s = check.content.get("tick_s", 0.0)
        _look_at_times(check, taken, tick_s=tick_s, given=timestamps or fps)
        _look_at_file(check, source, taken)
        start = find_start(source, hints, progress=progress)
        firsts = _stretches(check, source, taken, start, hints, progress=progress)
        clips = [Clip(source, taken, first=first, count=CLIP) for first in firsts]
        track_stretches(check, clips, start, total=len(taken), hints=hints, camera=camera, progress=progress)
    except TorsightError as error:
        check.refuse(error)
    return check


def _look_at_times(check: Check, timestamps: Timestamps, *, tick_s: float, given: object) -> None:
    """Report the number of frames, and a frame rate that varies or a film that stands still."""
    rate = timing(timestamps.time_s, tick_s=tick_s)
    if rate.step_s is None or rate.shortest_s is None or rate.longest_s is None:
        return
    check.duration_s = rate.duration_s
    check.content |= {
        "frames": rate.frames,
        "frames_counted_in": "pictures as decoded" if timestamps.decoded else "the container's list",
        "duration_s": rate.duration_s,
        "rate_fps": rate.rate_fps,
        "frame_interval_s": {"median": rate.step_s, "min": rate.shortest_s, "max": rate.longest_s},
        "irregular_share": rate.irregular_share,
    }
    if rate.irregular_share > FEW and not given:
        text = (
            f"has a varying frame rate ({100 * rate.irregular_share:.0f} % of the steps differ from "
            f"{1e3 * rate.step_s:.1f} ms, the longest is {1e3 * rate.longest_s:.0f} ms); every frame is taken at its "
            f"own timestamp."
        )
        check.add("note", text, "fix the frame rate, or give the true times as timestamps")
    if rate.longest_s > max(10.0 * rate.step_s, 1.0):
        at = float(timestamps.time_s[int(np.argmax(np.diff(timestamps.time_s)))])
        check.add("limits", f"stands still for {rate.longest_s:.1f} s at {at:.1f} s.", "film without pauses")


def _look_at_file(check: Check, source: Any, timestamps: Timestamps) -> None:
    """Report the properties of the file that the source has found: damage, fields, further streams, slow motion."""
    entries = source.damage.entries
    for entry in entries:
        if entry["kind"] != "damage":
            text, _, advice = str(entry["text"]).partition("; ")
            check.add("note" if entry["kind"] == "streams" else "limits", f"{text}.", advice)
    damage = [entry for entry in entries if entry["kind"] == "damage"]
    if damage:
        text = f"is damaged in {counted(len(damage), 'place')}: {damage[0]['text']}."
        check.add("limits", text, "copy it from the camera again")
    declared = source.frame_count
    if not timestamps.decoded and declared is not None and len(timestamps) + timestamps.hidden < (1.0 - FEW) * declared:
        text = f"holds {len(timestamps) + timestamps.hidden} of {declared} declared frames: it was cut or damaged."
        check.add("limits", text, "copy it from the camera again")


def _stretches(
    check: Check, source: Any, timestamps: Timestamps, start: Start, hints: MarkerHints | None, *, progress: Progress
) -> list[int]:
    """Return the first frames of the tracked stretches: the start of a run, and the stretch with the largest motion.

    Given positions hold in the first frame only, and points without a dot cannot be found again in a later frame.
    """
    begin = 0 if hints is not None else start.frame
    if len(timestamps) <= CLIP:
        return [0]
    if start.kind != "dot":
        return [begin]
    sought = hints is None and not start.doubtful
    moving = _liveliest(check, source, timestamps, begin=begin, sought=sought, progress=progress)
    return [begin] if abs(moving - begin) < CLIP // 2 else [begin, moving]


def _liveliest(
    check: Check, source: Any, timestamps: Timestamps, *, begin: int, sought: bool, progress: Progress
) -> int:
    """Return the first frame of a stretch around the largest change between two sampled frames.

    ``begin`` is the first frame of a run; ``sought``: whether the markers are searched for in some sampled frames.
    """
    count = len(timestamps)
    places = np.linspace(begin, count - 1, PLACES).astype(int).tolist()
    seen: dict[int, Picture] = {}
    found = []
    for number, place in enumerate(places):
        progress("sampling frames", number, PLACES)
        luma = _luma_at(source, timestamps, place)
        if luma is None:
            continue
        seen[place] = shrunk(luma, _SMALL_PX)
        if sought and number in _LOOKED_AT:
            found.append(sticks_in(luma) is not None)
    progress("sampling frames", PLACES, PLACES)
    if sought:
        check.content["sampled"] = {"frames": len(found), "with_markers": sum(found)}
    if not all(found):
        text = f"shows all four markers in {sum(found)} of {len(found)} frames that were looked at over its length."
        advice = "keep hands and wires off the markers, and the light on; where the sticks cross they hide each other"
        check.add("note" if 2 * sum(found) >= len(found) else "limits", text, advice)
    if len(seen) < 2:
        return 0
    low, high = max(pairwise(sorted(seen)), key=lambda ends: _changed(seen[ends[0]], seen[ends[1]]))
    while high - low > CLIP:
        middle = (low + high) // 2
        luma = _luma_at(source, timestamps, middle)
        if luma is None:
            break
        seen[middle] = shrunk(luma, _SMALL_PX)
        low, high = max(((low, middle), (middle, high)), key=lambda ends: _changed(seen[ends[0]], seen[ends[1]]))
    return max(begin, min((low + high) // 2 - CLIP // 2, count - CLIP))


def _luma_at(source: Any, timestamps: Timestamps, place: int) -> Picture | None:
    frame = next(iter(Clip(source, timestamps, first=place, count=1)), None)
    return None if frame is None or frame.luma is None else frame.luma.copy()


def _changed(one: Picture, other: Picture) -> float:
    """Return the share of the picture in which the brightness differs by more than noise and flicker explain."""
    return float(np.mean(cv2.absdiff(one, other) > _STEP_GREY))
