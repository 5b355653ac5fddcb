"""Causes of frames without an angle, and advice on each."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from torsight.core.series import runs
from torsight.core.tracks import FEW, StickAngles
from torsight.core.units import Flags, Ints
from torsight.core.words.wording import capital, counted
from tracker.detect.marker_file import STICKS
from tracker.detect.moving_part import LOOKED_AT, SHARPER
from tracker.follow.motion_model import STALE
from tracker.quality.gap_pictures import ALIKE, SMEARED, Pictures, Seen, jumps_at, look_at_gaps, usual_step_deg
from tracker.quality.light import GLARES, Flicker, flicker_of, glare_at_loss
from tracker.rows import CODE
from tracker.track import TrackResult

_SECOND: Final = 0.25
"""Share of the frames without an angle above which a second cause is named."""
_DO: Final = {
    "hand": "something lies over the markers, or light glares on them; keep hands, wires and glare off them.",
    "glare": (
        "light glares on the markers: {glare:.0%} of the pixels around one are saturated as it is lost; move the lamp "
        "or the camera aside, soften the light (a sheet of paper before the lamp), or use matt markers."
    ),
    "flicker": "{flicker}",
    "file": "the film's file is damaged there; copy it from the camera again.",
    "light": "the light was off; use a steady lamp.",
    "late": (
        "the markers are found from frame {first_frame} on, {first_s:.1f} s into the film; start filming when the "
        "rig stands in the picture with its light on, or cut off the beginning."
    ),
    "marker": (
        "a marker was lost and not found again; look in track.png whether it is a dark or light dot that stands out "
        "all around it, and give the places with 'torsight markers'."
    ),
    "texture": (
        "the texture around a marker was lost: it changed, glared or left the picture; choose points with clear "
        "structure all around them, or stick dots or tags on."
    ),
    "tag": (
        "a tag was not seen: something lay over it, or it is too small, blurred by motion, or without its white "
        "border; keep it whole in sight, and print it larger if its modules are smaller than 4 px."
    ),
    "unlike": (
        "the points given for a stick do not look like two dots on a plain stick, and are not found again as such; if "
        'they are on print or other texture, set kind = "texture" for this stick in the marker file, else pick its '
        "dots with 'torsight markers'."
    ),
    "picture": "a marker leaves the picture; film from further away.",
    "sticks": (
        "one stick lies over the other's markers, or so close to them that they mix; mount the moving stick on the "
        "camera's side and the sticks further apart."
    ),
    "shutter": (f"the moving stick is fast there and its markers are blurred over {{smear_px:.0f}} px; {SHARPER}."),
    "speed": (
        "the moving stick is too fast there for the search: it turns by some {step_deg:.0f} degrees from one frame "
        "to the next, up to {usual_deg:.1f} were followed; film more frames a second, or move more slowly."
    ),
    "focus": (
        "the picture is out of focus there; lock the focus on the sticks before filming, and keep anything nearer "
        "out of the picture."
    ),
    "jump": (
        "the picture jumps at {jump_s:.2f} s: a part of the film is missing there, "
        "or the camera was moved; film in one piece, with the camera fixed, and cut nothing out."
    ),
    "interlaced": (
        "the film is interlaced without saying so: every second row shows another instant; film progressively (25p "
        "or 30p instead of 50i or 60i), or give one field of every frame as pictures."
    ),
}
_OF_STATE: Final = {"damaged": "file", "dark": "light", "outside": "picture", "shadowed": "sticks", "lost": "marker"}
"""Cause that a marker's state implies; a hand for all other states."""
_UNCLEAR: Final = ("lost", "hidden", "impossible")
"""States that blur, speed and interlacing lead to as well: their cause is found in the pictures."""


@dataclass(frozen=True, slots=True)
class Causes:
    """Causes of frames without an angle: their number by cause (keys of ``_DO``), the commonest first.

    ``figures`` are the numbers in the advice; ``flicker`` is the lamp's, whether frames are lost by it or not.
    """

    count: dict[str, int] = field(default_factory=dict)
    figures: dict[str, float] = field(default_factory=dict)
    flicker: Flicker | None = None

    def advice(self, cause: str) -> str:
        """Return the advice on one of the causes."""
        words = "" if self.flicker is None else self.flicker.words
        return _DO[cause].format(**self.figures, flicker=words)


def find_causes(
    result: TrackResult, angles: StickAngles, states: Sequence[str], *, pictures: Pictures | None = None
) -> Causes:
    """Return the causes of the frames without an angle.

    ``states`` are the markers' states in each of these frames, from :func:`tracker.quality.account.gap_states`. Without
    ``pictures``, which returns frames by number, blur, speed and interlacing are not distinguished from a hand.
    """
    unknown = np.flatnonzero(~angles.valid)
    flicker = flicker_of(result.rows)
    if len(unknown) == 0:
        return Causes(flicker=flicker)
    markers = result.report["markers"]
    first = int(markers.get("first_frame", 0))
    # On a stick without dots its texture or tag is lost, whichever of its points is missing.
    kinds = str(markers.get("kind", ""))
    without_dots = next((kind for kind in ("texture", "tag") if kind in kinds), None)
    figures = {"first_frame": first, "first_s": float(angles.time_s[min(first, len(angles) - 1)] - angles.time_s[0])}
    glared = _glared(unknown, states, result, pictures, figures)
    count: Counter[str] = Counter()
    unclear: list[int] = []
    unlike = _without_unlike(result)
    jumped = _jumped(unknown[~np.isin(states, ("dark", "damaged"))], result, angles, pictures, figures)
    late = first > 0 and not (pictures and _base_was_there(first, result, pictures))
    for index, state in zip(unknown.tolist(), states, strict=True):
        if index < first and state == "lost" and late:
            count["late"] += 1
        elif state == "dark" and flicker is not None:
            count["flicker"] += 1
        elif state in (*_UNCLEAR, "shadowed") and unlike[index]:
            count["unlike"] += 1
        elif glared and state in (*_UNCLEAR, "shadowed"):
            count["glare"] += 1
        elif index in jumped:
            count["jump"] += 1
        elif state in _UNCLEAR:
            unclear.append(index)
        else:
            count[_OF_STATE.get(state, "hand")] += 1
    for index, cause in zip(unclear, _of_unclear(unclear, result, angles, pictures, figures), strict=True):
        state = states[int(np.searchsorted(unknown, index))]
        count[cause or without_dots or _OF_STATE.get(state, "hand")] += 1
    return Causes(dict(count.most_common()), figures, flicker)


def _jumped(
    unknown: Ints, result: TrackResult, angles: StickAngles, pictures: Pictures | None, figures: dict[str, float]
) -> frozenset[int]:
    """Return those of the frames ``unknown`` that are missing since a jump of the picture; store the longest gap's.

    The longest gaps are examined, as many as pictures elsewhere: few of them only where they leave the turn uncertain,
    or where the base lies elsewhere after them.
    """
    gaps = [(begin, end) for begin, end in runs(~angles.valid) if begin >= 2 and begin in unknown]
    last = len(angles) - 1
    base, sure = result.tracks.position_px[:, :2], np.append(angles.branch_certain, True)
    if gaps and gaps[-1][1] > last and np.isfinite(base[gaps[-1][0]]).all():
        # The camera has not moved, and the moving stick is not found again: it is covered.
        gaps.pop()
    if len(unknown) <= FEW * len(angles):
        radius_px = float(result.report["markers"]["radius_px"])
        away = {begin: np.hypot(*(base[min(end, last)] - base[begin - 1]).T).min() > radius_px for begin, end in gaps}
        gaps = [(begin, end) for begin, end in gaps if away[begin] or sure[begin - 1] > sure[end]]
    if pictures is None or not gaps:
        return frozenset()
    ends = dict(sorted(gaps, key=lambda one: one[0] - one[1])[:LOOKED_AT])
    jumps = jumps_at({begin: _beside(angles.valid, begin) for begin in ends}, result.tracks, angles, pictures)
    if jumps:
        figures["jump_s"] = float(angles.time_s[jumps[0]])
    return frozenset(index for begin in jumps for index in range(begin, ends[begin]))


def _beside(known: Flags, begin: int) -> tuple[int, int]:
    """Return the middles of the longest runs of ``known`` frames before and after a gap, or after it the last frame.

    A hand may still be in the picture as the gap under it ends.
    """
    seen = [(end - first, (first + end) // 2) for first, end in runs(known)]
    before, after = ([one for one in seen if (one[1] < begin) == sooner] for sooner in (True, False))
    return max(before)[1], max(after, default=(0, len(known) - 1))[1]


def _base_was_there(first: int, result: TrackResult, pictures: Pictures) -> bool:
    """Return whether the base's markers look in the film's first frame as in the frame ``first``, where they are found.

    Then the rig stands in the picture from the start, and the moving stick is not found for another reason.
    """
    found, reach = pictures([0, first]), math.ceil(2.0 * float(result.report["markers"]["radius_px"]))
    places = result.tracks.position_px[first, :2]
    if len(found) < 2 or not np.isfinite(places).all():
        return False
    for x, y in np.rint(places).astype(int).tolist():
        part = np.s_[max(y - reach, 0) : y + reach + 1, max(x - reach, 0) : x + reach + 1]
        if not np.corrcoef(found[0][part].ravel(), found[first][part].ravel())[0, 1] > ALIKE:
            return False
    return True


def _without_unlike(result: TrackResult) -> Flags:
    """Return the frames (n,) without a stick whose given dots look unlike, if more than half of all frames are."""
    unlike = result.report["markers"].get("not_on_one_stick", {})
    gone = (result.rows["state"] != CODE["seen"]).reshape(-1, 2, 2).any(axis=2)
    counts = np.array([name in unlike for name in STICKS]) & (gone.mean(axis=0) > 0.5)
    return np.asarray((gone & counts).any(axis=1))


def _glared(
    unknown: Ints,
    states: Sequence[str],
    result: TrackResult,
    pictures: Pictures | None,
    figures: dict[str, float],
) -> bool:
    """Return whether there is glare on the markers as they are lost, and store its share in ``figures``."""
    missed = np.zeros(len(result.rows), np.bool_)
    # A stick lost under glare may be predicted anywhere, also under the other stick: hence "shadowed".
    missed[unknown[np.isin(states, (*_UNCLEAR, "shadowed"))]] = True
    if pictures is None or missed.sum() <= FEW * len(missed):
        return False
    figures["glare"] = share = glare_at_loss(missed, result, pictures, range(4))
    return share > GLARES


def _of_unclear(
    unclear: Sequence[int],
    result: TrackResult,
    angles: StickAngles,
    pictures: Pictures | None,
    figures: dict[str, float],
) -> list[str | None]:
    """Return the cause of each unclear frame from the pictures of some, or from motion blur nearby; None if unknown."""
    if not unclear:
        return []
    smear_px = smear_around_gaps_px(result, angles)
    radius_px, length_px = (float(result.report["markers"][name]) for name in ("radius_px", "stick_length_px"))
    smeared = smear_px > SMEARED * radius_px
    figures["smear_px"] = smear_px
    if pictures is None or len(unclear) <= FEW * len(angles):
        return ["shutter" if smeared else None] * len(unclear)
    usual_deg = usual_step_deg(angles)
    seen = look_at_gaps(np.array(unclear, np.int64), result.tracks, angles, pictures)
    causes = [one.cause(usual_deg=usual_deg, radius_px=radius_px, length_px=length_px) for one in seen]
    if not causes:
        return ["shutter" if smeared else None] * len(unclear)
    figures["usual_deg"] = usual_deg
    sharp = float(np.median([one.smear_px for one in seen])) < SMEARED * radius_px
    commonest, _ = Counter(causes).most_common(1)[0]
    if commonest is None and smeared and not sharp:
        # The exposure learned from fast readings decides, unless the pictures are sharp.
        commonest = "shutter"
    _note_speed([one for one, cause in zip(seen, causes, strict=True) if cause == commonest], figures)
    return [commonest] * len(unclear)


def _note_speed(seen: Sequence[Seen], figures: dict[str, float]) -> None:
    """Store the stick's turn per frame and its motion blur in the pictures that show the cause."""
    steps = [abs(one.step_deg) for one in seen if one.step_deg is not None]
    if steps:
        figures["step_deg"] = float(np.median(steps))
        figures["smear_px"] = max(figures["smear_px"], float(np.median([one.smear_px for one in seen])))


def gap_advice(frames: Mapping[str, Any], causes: Causes) -> list[str]:
    """Return advice by which more frames would have an angle: a sentence for each of at most two causes, or none.

    ``frames`` is from :func:`tracker.quality.account.frame_account`.
    """
    if not frames["total"] or frames["without_angle"] <= FEW * frames["total"] or not causes.count:
        return []
    words = ", ".join(f"{count} {name}" for name, count in frames["why"].items())
    head = f"{frames['without_angle']} of {frames['total']} frames have no angle ({words}): "
    (first, _), *others = causes.count.items()
    told = [head + causes.advice(first)]
    for name, count in others[:1]:
        if count > _SECOND * frames["without_angle"]:
            told.append(f"{counted(count, 'frame')} of these have none for another reason: {causes.advice(name)}")
    return told


def jump_advice(told: Sequence[str], causes: Causes) -> list[str]:
    """Return advice on a jump of the picture, unless it is among what is ``told`` already; or none."""
    if "jump" not in causes.count or any(causes.advice("jump") in text for text in told):
        return []
    return [capital(causes.advice("jump"))]


def lone_marker_advice(result: TrackResult, angles: StickAngles, *, pictures: Pictures | None = None) -> list[str]:
    """Return advice on frames in which the moving stick's angle comes from one of its markers alone; or none."""
    told: list[str] = []
    seen = result.rows["state"][:, 2:] == CODE["seen"]
    for end, name in enumerate(("inner", "outer")):
        alone = angles.valid & ~seen[:, end] & seen[:, 1 - end]
        if alone.sum() <= FEW * len(angles):
            continue
        share = 0.0 if pictures is None else glare_at_loss(alone, result, pictures, [2 + end])
        do = (
            _DO["glare"].format(glare=share)
            if share > GLARES
            else "keep it in the picture and clear of hands, wires and glare, and film with a shorter shutter time "
            "where it is blurred by motion."
        )
        told.append(
            f"The moving stick's {name} marker is not seen in {alone.sum()} of {counted(len(angles), 'frame')}, whose "
            f"angle comes from the other one alone and is less certain: {do}"
        )
    return told


def flicker_advice(causes: Causes) -> list[str]:
    """Return advice on flicker that increases the errors without making any frame too dark; or none."""
    flicker = causes.flicker
    if flicker is None or "flicker" in causes.count or not flicker.felt:
        return []
    return [f"{capital(flicker.words)} Now dim frames err {flicker.error:.1f} times as much as bright ones."]


def smear_around_gaps_px(result: TrackResult, angles: StickAngles) -> float:
    """Return the moving outer marker's path during the exposure, around frames without an angle, px."""
    share = float(result.report["markers"]["shutter_share_of_frame"] or 0.0)
    place = result.tracks.position_px[:, 3]
    step = np.hypot(*np.diff(place, axis=0).T)
    known = np.flatnonzero(np.isfinite(step))
    around: list[float] = []
    for begin, end in runs(~angles.valid):
        at, past = np.searchsorted(known, (begin, end))
        near = np.concatenate([known[max(0, at - STALE) : at], known[past : past + STALE]])
        if len(near):
            around += [float(step[near].max())] * (end - begin)
    return share * float(np.median(around)) if around else 0.0
