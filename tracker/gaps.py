"""Why frames have no angle, and what to do about it: hands, the marker itself, the picture, shutter, light, or file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from torsight.core.series import runs
from torsight.core.tracks import StickAngles
from tracker.track import TrackResult

_FELT: Final = 0.02
"""Share of the frames without an angle from which something is said."""
_SMEARED: Final = 0.4
"""Smear, in radii of a dot, from which dots are no longer recognised in every frame."""
_AROUND: Final = 15
"""Steps on each side of a gap that tell how fast the stick was."""
_DO: Final = {
    "hands": "keep hands and wires off the markers.",
    "file": "the film's file is damaged there; copy it from the camera again.",
    "light": "the light was off; use a steady lamp.",
    "marker": (
        "a marker was lost and not found again; look in track.png whether it is a dark or light dot that stands out "
        "all around it, and give the places with 'torsight markers'."
    ),
    "picture": "a marker leaves the picture; film from further away.",
    "sticks": "the sticks pass so close to each other that their markers mix; mount them further apart.",
}
_CAUSE: Final = {
    "damaged": "file",
    "dark": "light",
    "lost": "marker",
    "outside": "picture",
    "shadowed": "sticks",
}
"""What stands behind a marker's state; hands for all others."""


def gap_advice(frames: Mapping[str, Any], result: TrackResult, angles: StickAngles) -> list[str]:
    """Return what would give more frames an angle, a sentence or none.

    Parameters
    ----------
    frames : mapping
        From :func:`tracker.account.frame_account`.
    result : TrackResult
        The markers.
    angles : StickAngles
        The angle made of them.
    """
    if not frames["total"] or frames["without_angle"] <= _FELT * frames["total"]:
        return []
    why: Mapping[str, int] = frames["why"]
    words = ", ".join(f"{count} {name}" for name, count in why.items())
    most = max(why, key=lambda name: why[name])
    cause = _CAUSE.get(most, "hands")
    smear_px = smear_around_gaps_px(result, angles) if cause in {"hands", "marker"} else 0.0
    if smear_px > _SMEARED * float(result.report["markers"]["radius_px"]):
        do = (
            f"the moving stick is fast there and its markers are smeared over {smear_px:.0f} px; film with a shorter "
            "shutter time and more light, or move more slowly."
        )
    else:
        do = _DO[cause]
    return [f"{frames['without_angle']} of {frames['total']} frames have no angle ({words}): {do}"]


def smear_around_gaps_px(result: TrackResult, angles: StickAngles) -> float:
    """Return how far the moving outer marker travels while the shutter is open, around frames without an angle, px."""
    share = float(result.report["markers"]["shutter_share_of_frame"] or 0.0)
    place = result.tracks.position_px[:, 3]
    step = np.hypot(*np.diff(place, axis=0).T)
    known = np.flatnonzero(np.isfinite(step))
    around: list[float] = []
    for begin, end in runs(~angles.valid):
        at, past = np.searchsorted(known, (begin, end))
        near = np.concatenate([known[max(0, at - _AROUND) : at], known[past : past + _AROUND]])
        if len(near):
            around += [float(step[near].max())] * (end - begin)
    return share * float(np.median(around)) if around else 0.0
