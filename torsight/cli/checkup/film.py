"""A film before it is tracked: a stretch of it in which the rig moves is tracked, the rest is only sampled."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from torsight.cli.checkup.finding import Finding, refusal
from torsight.core.camera import Camera, require_size
from torsight.core.errors import NoResultError, TorsightError
from torsight.core.progress import Progress, silent
from torsight.core.units import DEG
from tracker.account import account
from tracker.doubts import doubts
from tracker.hints import MarkerHints
from tracker.orient import orient
from tracker.plane import Orientation
from tracker.sample import Clip, Stamps, read_stamps
from tracker.source import open_source
from tracker.start import find_start, sticks_in
from tracker.tilt import KNOWN
from tracker.track import TrackResult, track_film

Picture = NDArray[np.uint8]

PLACES: Final = 17
"""Frames over the whole film that are looked at for motion."""
_LOOKED_AT: Final = (4, 8, 12, 16)
"""Those of them in which the markers are looked for, which costs as much as tracking a thousand frames."""
_SMALL_PX: Final = 160
_STEP_GREY: Final = 25
CLIP: Final = 400
"""Frames that are tracked."""
MODEL_ERROR_DEG: Final = 0.2
"""What the plain model itself leaves on a good record: an angle that is known better than this limits nothing."""
_FAST_DEG: Final = 5.0
_SMEAR_PX: Final = 0.5
_IRREGULAR: Final = 0.02


@dataclass(slots=True)
class FilmCheck:
    """What was found about one film.

    Attributes
    ----------
    findings : list of Finding
        In the order in which they were found.
    content : dict
        Measured figures, for a script.
    duration_s : float
        Length; 0 where it is not known.
    """

    findings: list[Finding] = field(default_factory=list)
    content: dict[str, Any] = field(default_factory=dict)
    duration_s: float = 0.0


def check_film(
    video: str,
    *,
    about: str = "film",
    fps: float | None = None,
    timestamps: Path | None = None,
    hints: MarkerHints | None = None,
    camera: Camera | None = None,
    progress: Progress = silent,
) -> FilmCheck:
    """Look at a film: times, markers in frames over its whole length, and a tracked stretch of its motion."""
    check = FilmCheck()
    try:
        source = open_source(video, fps=fps, timestamps=timestamps)
        if camera is not None:
            require_size(camera.intrinsics, source.size_px, where="the film")
        stamps = read_stamps(source)
        check.content |= source.describe()
        _look_at_times(check, about, stamps, declared=source.frame_count, given=timestamps or fps)
        start = find_start(source, hints, progress=progress)
        # Points without a dot cannot be found by themselves in the middle of the film.
        first = 0 if start.kind == "texture" else _first_frame(source, stamps, check, about, progress)
        _track_clip(check, about, Clip(source, stamps, first=first, count=CLIP), stamps, hints, camera, progress)
    except TorsightError as error:
        check.findings.append(refusal(about, error))
    return check


def _look_at_times(check: FilmCheck, about: str, stamps: Stamps, *, declared: int | None, given: object) -> None:
    step = np.diff(stamps.time_s)
    if len(step) == 0:
        return
    usual = float(np.median(step))
    check.duration_s = float(stamps.time_s[-1] + usual)
    irregular = float(np.mean(np.abs(step - usual) > 0.2 * usual))
    check.content |= {
        "frames": len(stamps),
        "duration_s": check.duration_s,
        "frame_interval_s": {"median": usual, "min": float(step.min()), "max": float(step.max())},
        "irregular_share": irregular,
    }
    if declared is not None and len(stamps) < 0.98 * declared:
        text = f"holds {len(stamps)} of {declared} declared frames: it was cut or damaged."
        check.findings.append(Finding(about, "limits", text, "copy it from the camera again"))
    if irregular > _IRREGULAR and not given:
        text = (
            f"has a varying frame rate ({100 * irregular:.0f} % of the steps differ from {1e3 * usual:.1f} ms, the "
            f"longest is {1e3 * step.max():.0f} ms); every frame is taken at its own stamp."
        )
        check.findings.append(Finding(about, "note", text, "fix the frame rate, or give the true times as timestamps"))
    if step.max() > max(10.0 * usual, 1.0):
        at = float(stamps.time_s[int(np.argmax(step))])
        text = f"stands still for {step.max():.1f} s at {at:.1f} s."
        check.findings.append(Finding(about, "limits", text, "film without pauses"))


def _first_frame(source: Any, stamps: Stamps, check: FilmCheck, about: str, progress: Progress) -> int:
    """Return where the tracked stretch begins: around the largest change between two sampled frames."""
    count = len(stamps)
    if count <= CLIP:
        return 0
    places = np.linspace(0, count - 1, PLACES).astype(int).tolist()
    seen: dict[int, Picture] = {}
    found = []
    for number, place in enumerate(places):
        progress("sampling frames", number, PLACES)
        luma = _luma_at(source, stamps, place)
        if luma is None:
            continue
        seen[place] = _small(luma)
        if number in _LOOKED_AT:
            found.append(sticks_in(luma) is not None)
    progress("sampling frames", PLACES, PLACES)
    check.content["sampled"] = {"frames": len(found), "with_markers": sum(found)}
    if not all(found):
        text = f"shows all four markers in {sum(found)} of {len(found)} frames that were looked at over its length."
        advice = "keep hands and wires off the markers, and the light on; where the sticks cross they hide each other"
        check.findings.append(Finding(about, "note" if 2 * sum(found) >= len(found) else "limits", text, advice))
    if len(seen) < 2:
        return 0
    low, high = max(pairwise(sorted(seen)), key=lambda ends: _changed(seen[ends[0]], seen[ends[1]]))
    while high - low > CLIP:
        middle = (low + high) // 2
        luma = _luma_at(source, stamps, middle)
        if luma is None:
            break
        seen[middle] = _small(luma)
        low, high = max(((low, middle), (middle, high)), key=lambda ends: _changed(seen[ends[0]], seen[ends[1]]))
    return max(0, min((low + high) // 2 - CLIP // 2, count - CLIP))


def _luma_at(source: Any, stamps: Stamps, place: int) -> Picture | None:
    frame = next(iter(Clip(source, stamps, first=place, count=1)), None)
    return None if frame is None or frame.luma is None else frame.luma.copy()


def _small(luma: Picture) -> Picture:
    height, width = luma.shape
    size = (_SMALL_PX, max(1, round(_SMALL_PX * height / width)))
    return np.asarray(cv2.resize(luma, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)


def _changed(one: Picture, other: Picture) -> float:
    """Return the share of the picture in which the brightness differs by more than noise and light make it."""
    return float(np.mean(cv2.absdiff(one, other) > _STEP_GREY))


def _track_clip(
    check: FilmCheck,
    about: str,
    clip: Clip,
    stamps: Stamps,
    hints: MarkerHints | None,
    camera: Camera | None,
    progress: Progress,
) -> None:
    """Track a stretch and take over what the tracker says of it."""
    try:
        result = track_film(clip, markers=hints if clip.first == 0 else None, progress=progress)
    except NoResultError as error:
        if clip.count < len(stamps):
            text = f"nothing is seen to move in {clip.name.rpartition(', ')[2]}, where the markers differ most."
            check.findings.append(Finding(about, "limits", text, "check that the moving stick's markers are in sight"))
            return
        check.findings.append(refusal(about, error))
        return
    orientation = orient(result.tracks, camera, pixel_aspect=clip.pixel_aspect)
    told = account(result, orientation, doubts=doubts(result))
    names = ("markers", "frames", "noise", "compression", "tilt")
    check.content["tracked"] = {"first_frame": clip.first, **{name: told[name] for name in names if name in told}}
    sigma = told["noise"]["angle_sigma_deg"]
    if sigma["median"] is not None:
        level = "limits" if sigma["median"] > MODEL_ERROR_DEG else "fine"
        bound = "" if sigma["bound"] is None else f" (bound of its noise {sigma['bound']:.4f}°)"
        text = f"angle known to {sigma['median']:.4f}°{bound}: {_markers_text(told)}."
        check.findings.append(Finding(about, level, text, angle_deg=sigma["median"]))
    for words in told["advice"]:
        text, _, advice = words.partition(": ")
        level = "limits" if "frames have no angle" in words or "light was off" in words else "note"
        check.findings.append(Finding(about, level, text.rstrip(".") + ".", advice.rstrip("."), sigma["median"]))
    _look_at_tilt(check, about, told, camera)
    _look_at_speed(check, about, result, orientation, told["markers"]["shutter_share_of_frame"])


def _markers_text(told: Mapping[str, Any]) -> str:
    markers, noise = told["markers"], told["noise"]
    return (
        f"dots of {markers['radius_px']:.1f} px radius, {markers['stick_length_px']:.0f} px apart, contrast "
        f"{noise['marker_contrast_grey']:.0f} and noise {noise['picture_noise_grey']:.1f} grey levels"
    )


def _look_at_tilt(check: FilmCheck, about: str, told: Mapping[str, Any], camera: Camera | None) -> None:
    tilt = told.get("tilt", {})
    if camera is not None and camera.pose is not None:
        return
    if not tilt.get("known", False) or tilt.get("error_it_can_make_deg", 0.0) > KNOWN / DEG:
        text = (
            "without a camera file the tilt is learned from the markers' own circles, and this stretch does not show "
            "it; a tilt of 10° that stays unknown bends the angle by 0.4°."
        )
        check.findings.append(
            Finding(about, "note", text, "calibrate the camera with one picture of the board on the disk")
        )


def _look_at_speed(check: FilmCheck, about: str, result: TrackResult, orientation: Orientation, shutter: float) -> None:
    """Say how far things move from frame to frame and while the shutter is open."""
    angles = orientation.angles
    known = angles.valid & angles.branch_certain
    time_s, angle_deg = angles.time_s[known], angles.angle_rad[known] / DEG
    outer = result.tracks.position_px[:, 3]
    if len(time_s) < 3:
        return
    step_deg = float(np.nanquantile(np.abs(np.diff(angle_deg)), 0.99))
    rate_deg_s = float(np.nanquantile(np.abs(np.diff(angle_deg) / np.diff(time_s)), 0.99))
    moved = np.hypot(*np.diff(outer, axis=0).T)
    step_px = float(np.nanquantile(moved, 0.99)) if np.isfinite(moved).any() else 0.0
    range_deg = float(np.ptp(angle_deg))
    smear_px = shutter * step_px
    check.content["motion"] = {
        "range_deg": range_deg,
        "rate_deg_s": rate_deg_s,
        "step_deg": step_deg,
        "step_px": step_px,
        "smear_px": smear_px,
    }
    if step_deg > _FAST_DEG:
        text = f"turns by up to {step_deg:.1f}° from one frame to the next ({rate_deg_s:.0f}°/s)."
        check.findings.append(
            Finding(about, "limits", text, f"film faster: {_FAST_DEG:g}° per frame and less are safe")
        )
    if smear_px > _SMEAR_PX:
        text = (
            f"smears the outer marker by {smear_px:.1f} px: the shutter is open for {100 * shutter:.0f} % of a frame."
        )
        check.findings.append(Finding(about, "note", text, "shorten the exposure, with more light"))
