"""Stretches of a film, tracked as in a run: the share of frames with an angle, its uncertainty, and the speed."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import chain
from typing import Any, Final

import numpy as np

from torsight.cli.checkup.finding import RESIDUAL_DEG, Check
from torsight.cli.track import LEAST, WHY, gap_words, unsure_markers
from torsight.core.errors import NoResultError
from torsight.core.optics.camera import Camera
from torsight.core.progress import Progress
from torsight.core.tracks import USUAL_SHARE
from torsight.core.units import DEG
from torsight.core.words.wording import counted
from tracker.angle.orient import orient
from tracker.angle.plane import Orientation
from tracker.angle.tilt.models import KNOWN
from tracker.detect.marker_file import MarkerHints
from tracker.frames.sample import Clip
from tracker.initialise import Start
from tracker.quality.account import account
from tracker.quality.track_warnings import doubts, doubts_of_turns
from tracker.track import TrackResult, track_film

CLIP: Final = 400
"""Frames of a stretch: a share of nine tenths with an angle is then known to √(0.9 · 0.1 / 400) = 1.5 %."""
_FAST_DEG: Final = 5.0
"""Motion from frame to frame up to which the markers are surely followed: a marker 100 px from the axis moves by 9 px,
by less than half of what is followed on films of benchmarks/tracking/hardships.py (20 px, smeared)."""
_SMEAR_PX: Final = 0.5
"""Motion of a marker while the shutter is open above which the smear is reported, px: it adds 0.5² / 12 to the square
of an edge's blur, 4 % for the 0.7 px of an ordinary lens."""


def track_stretches(
    check: Check,
    clips: Sequence[Clip],
    start: Start,
    *,
    total: int,
    hints: MarkerHints | None,
    camera: Camera | None,
    progress: Progress,
) -> None:
    """Track stretches of a film of ``total`` frames, and add the results to its check, as findings and as figures.

    The first clip begins where a run begins, with the markers that a run would find; the last clip has the largest
    motion. ``hints`` hold for the film's first frame.
    """
    tracked: list[tuple[Clip, TrackResult, Orientation]] = []
    errors: list[NoResultError] = []
    for clip in clips:
        try:
            result = track_film(clip, markers=hints if clip.first == 0 else None, progress=progress)
        except NoResultError as error:
            errors.append(error)
            continue
        tracked.append((clip, result, orient(result.tracks, camera, pixel_aspect=clip.pixel_aspect)))
    if not tracked:
        check.refuse(_nothing(clips, errors, total=total))
        return
    accounts = [
        account(result, orientation, doubts=(), pictures=clip.pictures) for clip, result, orientation in tracked
    ]
    clip, result, orientation = tracked[-1]
    names = ("markers", "frames", "noise", "compression", "tilt")
    last = {name: accounts[-1][name] for name in names if name in accounts[-1]}
    check.content["tracked"] = {"first_frame": clip.first, **last}
    taken = [clip for clip, _, _ in tracked]
    _look_at_coverage(check, accounts, taken, start, total=total, given=hints is not None)
    if start.doubtful:
        places = ", ".join(f"[{marker.x_px:.0f}, {marker.y_px:.0f}]" for marker in start.markers)
        faint = f"the dots at {places} in frame {start.frame} hardly stand out"
        advice = "look at them with 'torsight markers', and pick the markers there"
        check.add("limits", f"{faint}: they may be something else than the markers.", advice)
    where = clips[0].name.rpartition(", ")[0]
    # People get complete sentences, each from the first stretch that gives it.
    said = (doubts_of_turns(orientation.angles) + doubts(result) for _, result, orientation in tracked)
    for words in dict.fromkeys(chain.from_iterable(said)):
        check.add("limits", words)
    unsure = [lacking for one in accounts if (lacking := unsure_markers(one, where=where)) is not None]
    for lacking in unsure[:1]:
        check.refuse(lacking)
    _look_at_account(check, accounts)
    _look_at_tilt(check, accounts[-1], camera)
    _look_at_speed(check, result, orientation, accounts[-1]["markers"]["shutter_share_of_frame"] or 0.0)


def _nothing(clips: Sequence[Clip], errors: Sequence[NoResultError], *, total: int) -> NoResultError:
    """Return the error that no stretch gave an angle."""
    if sum(clip.frame_count for clip in clips) >= total:
        return errors[0]
    tried = " and ".join(f"{clip.first} to {clip.first + clip.frame_count - 1}" for clip in clips)
    return NoResultError(
        "no frame has an angle in the tracked stretches, at the start of a run and where the picture changes most",
        where=f"{clips[0].name.rpartition(', ')[0]}, frames {tried}",
        value=errors[-1].what,
        do=errors[-1].do,
    )


def _look_at_coverage(
    check: Check, accounts: Sequence[Mapping[str, Any]], clips: Sequence[Clip], start: Start, *, total: int, given: bool
) -> None:
    """Report how many frames have an angle, extrapolated to the whole film."""
    frames = sum(one["frames"]["total"] for one in accounts)
    known = sum(one["frames"]["with_angle"] for one in accounts)
    before = 0 if given else start.frame
    if len(clips) == 1 and clips[0].first == 0 and frames >= before:
        # Frames before the markers are visible were tracked as well.
        share = known / frames if frames else 0.0
    else:
        share = known / frames * (total - before) / total
    numbers = {"tracked_frames": frames, "with_angle": known, "before_markers": before, "expected_share": share}
    check.content["coverage"] = numbers
    text = f"{known} of {counted(frames, 'frame')} that were tracked have an angle"
    if before:
        text += f"; the markers are first seen in frame {before}, {100 * before / total:.0f} % into the film"
    why = sum((Counter(one["frames"]["causes"]) for one in accounts), Counter[str]())
    most = max(why, key=lambda name: why[name], default="")
    if most in WHY:
        text += f"; most of the others: {WHY[most]}"
    advice = next((words for one in accounts if (words := gap_words(one))), "")
    if share >= USUAL_SHARE:
        check.add("fine", f"{text}.")
    elif share >= LEAST:
        check.add("limits", f"{text}.", advice)
    else:
        lacking = NoResultError(
            "less than half of the frames would have an angle",
            where=clips[0].name.rpartition(", ")[0],
            value=text,
            limit=f"{100 * LEAST:.0f} % or more of the film",
            do=advice or "look at track.png of 'torsight track'",
        )
        check.refuse(lacking)


def _look_at_account(check: Check, accounts: Sequence[Mapping[str, Any]]) -> None:
    """Turn the tracker's account of the stretches into findings: accuracy of the angle, and advice."""
    sigma = accounts[-1]["noise"]["angle_sigma_deg"]
    if sigma["median"] is not None:
        level = "limits" if sigma["median"] > RESIDUAL_DEG else "fine"
        bound = "" if sigma["bound"] is None else f" (bound of its noise {sigma['bound']:.4f}°)"
        text = f"angle known to {sigma['median']:.4f}°{bound}: {_markers_text(accounts[-1])}."
        check.add(level, text, angle_deg=sigma["median"])
    seen: set[str] = set()
    for words in (words for one in reversed(accounts) for words in one["advice"]):
        text, _, advice = words.partition(": ")
        # Two stretches give the same advice with other figures: those of the stretch with the largest motion are used.
        same = re.sub(r"[\d.]+", "", text)
        if same in seen:
            continue
        seen.add(same)
        level = "limits" if "frames have no angle" in words or "light was off" in words else "note"
        check.add(level, text.rstrip(".") + ".", advice.rstrip("."), sigma["median"])


def _markers_text(summary: Mapping[str, Any]) -> str:
    markers, noise = summary["markers"], summary["noise"]
    length_px = markers["stick_length_px"]
    what = {
        "dot": f"dots of {markers['radius_px']:.1f} px radius, {length_px:.0f} px apart",
        "tag": f"tags of {length_px:.0f} px along a side",
    }.get(str(markers["kind"]), f"markers {length_px:.0f} px apart")
    contrast, residual = noise["marker_contrast_grey"], noise["picture_noise_grey"]
    return f"{what}, contrast {contrast:.0f} and noise {residual:.1f} grey levels"


def _look_at_tilt(check: Check, summary: Mapping[str, Any], camera: Camera | None) -> None:
    tilt = summary.get("tilt", {})
    if camera is not None and camera.pose is not None:
        return
    if not tilt.get("known", False) or tilt.get("error_it_can_make_deg", 0.0) > KNOWN / DEG:
        text = (
            "without a camera file the tilt is estimated from the markers' own circles, and this stretch does not show "
            "it; an unknown tilt of 10° changes the angle by up to 0.4°."
        )
        check.add("note", text, "calibrate the camera with one picture of the board on the disk")


def _look_at_speed(check: Check, result: TrackResult, orientation: Orientation, shutter: float) -> None:
    """Report the motion from frame to frame and while the shutter is open."""
    angles = orientation.angles
    known = angles.valid & angles.branch_certain
    time_s, angle_deg = angles.time_s[known], angles.angle_rad[known] / DEG
    outer = result.tracks.position_px[:, 3]
    if len(time_s) < 3:
        return
    next_to = np.diff(np.flatnonzero(known)) == 1
    step_deg = float(np.quantile(np.abs(np.diff(angle_deg))[next_to], 0.99)) if next_to.any() else 0.0
    rate_deg_s = float(np.nanquantile(np.abs(np.diff(angle_deg) / np.diff(time_s)), 0.99))
    moved = np.hypot(*np.diff(outer, axis=0).T)
    step_px = float(np.nanquantile(moved, 0.99)) if np.isfinite(moved).any() else 0.0
    smear_px = shutter * step_px
    motion = {"range_deg": float(np.ptp(angle_deg)), "rate_deg_s": rate_deg_s, "step_deg": step_deg}
    check.content["motion"] = motion | {"step_px": step_px, "smear_px": smear_px}
    if step_deg > _FAST_DEG:
        text = f"turns by up to {step_deg:.1f}° from one frame to the next ({rate_deg_s:.0f}°/s)."
        check.add("limits", text, f"film faster: {_FAST_DEG:g}° per frame and less are safe")
    if smear_px > _SMEAR_PX:
        text = (
            f"smears the outer marker by {smear_px:.1f} px: the shutter is open for {100 * shutter:.0f} % of a frame."
        )
        check.add("note", text, "shorten the exposure, with more light")
