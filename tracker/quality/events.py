"""Events of a film in the order of time, with a sentence for each."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from torsight.core.series import runs
from torsight.core.tracks import MARKERS, StickAngles
from torsight.core.units import Flags, Ints
from tracker.angle.camera_motion import bumps
from tracker.rows import CODE

if TYPE_CHECKING:
    from tracker.track import TrackResult

_KINDS: Final = {
    "hidden": ("occlusion", "{name} is covered or blurred"),
    "lost": ("lost", "{name} is not found"),
    "outside": ("occlusion", "{name} is outside the picture"),
    "shadowed": ("crossing", "the other stick is over {name} or next to it"),
}


def find_events(rows: NDArray[np.void], angles: StickAngles, damage: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the events: covered and lost markers, darkness, damage, bumps of the camera, uncertain turns.

    ``rows`` are those of the film, markers in the order of :data:`torsight.core.tracks.MARKERS`; ``damage`` are the
    entries reported by the source.
    """
    events = [dict(entry) for entry in damage]
    dark = (rows["state"] == CODE["dark"]).any(axis=1)
    events += [event(angles, run, "light", "the light is off") for run in _runs(dark)]
    for marker, name in enumerate(MARKERS):
        events += _of_marker(rows["state"][:, marker], angles, name.replace("_", " "))
    base = np.where((rows["state"][:, :2] == CODE["seen"])[..., None], rows["position_px"][:, :2], np.nan)
    events += [
        event(angles, np.array([frame]), "bump", f"the camera was moved: {size_px:.1f} px in the picture")
        for frame, size_px in bumps(base)
    ]
    events += _angle_events(angles)
    return sorted(events, key=lambda one: (one["frame"], one["kind"]))


def events_of_right(right: TrackResult, angles: StickAngles) -> list[dict[str, Any]]:
    """Return the events of the right film of a stereo pair, with the left film's frame numbers.

    ``angles`` are those from both films, at the left film's frames.
    """
    time_s = right.rows["time_s"]
    if len(angles) == 0:
        return []
    at = np.clip(np.searchsorted(angles.time_s, time_s), 0, len(angles) - 1)
    # Only whether there is an angle matters here: events of the angle itself are reported with the left film.
    known = np.zeros(len(time_s))
    seen = StickAngles(np.arange(len(time_s)), time_s, known, known, angles.valid[at], np.ones(len(time_s), np.bool_))
    events = [one for one in find_events(right.rows, seen, right.damage) if one["kind"] != "angle unknown"]
    for one in events:
        one["text"] = f"right film: {one['text']}"
        for key in {"frame", "end_frame"} & one.keys():
            one[key] = int(at[min(one[key], len(at) - 1)])
    return events


def _of_marker(state: NDArray[np.uint8], angles: StickAngles, name: str) -> list[dict[str, Any]]:
    away = (state != CODE["seen"]) & (state != CODE["dark"]) & (state != CODE["damaged"])
    events: list[dict[str, Any]] = []
    for run in _runs(away):
        if len(run) == 1 and angles.valid[run[0]]:
            # A marker missing in a single frame that has its angle all the same is no event.
            continue
        counts = np.bincount(state[run], minlength=len(CODE))
        reason = max(_KINDS, key=lambda key: int(counts[CODE[key]]))
        kind, words = _KINDS[reason]
        events.append(event(angles, run, kind, words.format(name=name)))
        if kind != "crossing" and run[-1] + 1 < len(state):
            back = run[-1] + 1
            events.append(event(angles, np.array([back]), "found", f"{name} is found again"))
    return events


def _angle_events(angles: StickAngles) -> list[dict[str, Any]]:
    events = [
        event(angles, run, "angle unknown", f"no angle for {len(run)} frames")
        for run in _runs(~angles.valid)
        if len(run) > 1
    ]
    unsure = np.flatnonzero(~angles.branch_certain)
    if len(unsure):
        words = "from here on the number of turns is not certain: the motion around a gap allows more than one"
        events.append(event(angles, unsure[:1], "turn uncertain", words))
    return events


def event(angles: StickAngles, run: Ints, kind: str, text: str) -> dict[str, Any]:
    """Return the entry of ``track.json`` for an event that lasts for a run of frames."""
    first, last = int(run[0]), int(run[-1])
    return {
        "time_s": float(angles.time_s[first]),
        "frame": first,
        "kind": kind,
        "text": text,
        "end_time_s": float(angles.time_s[last]),
        "end_frame": last,
    }


def _runs(flag: Flags) -> list[Ints]:
    return [np.arange(begin, end) for begin, end in runs(flag)]
