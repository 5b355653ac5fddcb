"""Reliability of a film's angles: the share of frames with an angle, and the probability of the chosen markers.

Below nine tenths of the frames there is a warning. Below a half, or where other dots may equally be the markers, there
is no result.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final

from torsight.core.errors import NoResultError
from torsight.core.tracks import LEAST_SURE, USUAL_SHARE

LEAST: Final = 0.5
"""Share of the frames below which a command ends with exit code 4, by the contract."""
WHY: Final = {
    "hand": "something lies over a marker",
    "sticks": "the sticks are too close to each other",
    "light": "the light is off",
    "flicker": "the light flickers",
    "glare": "light glares on the markers",
    "picture": "a marker is outside the picture",
    "marker": "a marker was not found again",
    "texture": "the texture around a marker was lost",
    "unlike": "the given points are not like dots on a plain stick",
    "file": "the frame is damaged",
    "late": "the markers are not in sight yet",
    "shutter": "the markers are smeared by their motion",
    "speed": "the stick is too fast for the search",
    "focus": "the picture is out of focus",
    "interlaced": "the film is interlaced",
    "jump": "the picture jumps",
}
"""Words for the causes of :mod:`tracker.quality.gaps`."""


def few_angles(account: Mapping[str, Any], *, where: str) -> NoResultError | None:
    """Return the error of a film in which less than nine tenths of the frames have an angle, by its ``track.json``.

    :func:`is_no_result` says whether that ends a command.
    """
    share = _share(account)
    if share >= USUAL_SHARE:
        return None
    frames = account["frames"]
    why = next(iter(frames.get("causes", {})), "")
    advice = gap_words(account) or "look at track.png: it shows what was read, and where not"
    return NoResultError(
        "few frames have an angle" if share >= LEAST else "less than half of the frames have an angle",
        where=where,
        value=f"{frames['with_angle']} of {frames['total']}, {100.0 * share:.0f} %"
        + (f"; most of the others: {WHY[why]}" if why in WHY else ""),
        limit=f"{100.0 * (USUAL_SHARE if share >= LEAST else LEAST):.0f} % or more",
        do=advice,
    )


def unsure_markers(account: Mapping[str, Any], *, where: str) -> NoResultError | None:
    """Return the error where nothing shows which dots are the markers, or which the inner ones, by ``track.json``."""
    sure = _sure(account)
    if sure >= LEAST_SURE:
        return None
    films = [film.get("markers") or {} for film in (account, account.get("right_film") or {})]
    if any(markers.get("rivals") for markers in films):
        what = "other dots may equally be the markers"
    elif max(float(markers.get("opposite_probability", 0.0)) for markers in films) > 0.5 * (1.0 - sure):
        what = "nothing shows which marker of a stick is the inner one"
    else:
        what = "no four dots move as markers on two sticks do"
    return NoResultError(
        what,
        where=where,
        value=f"those that were taken are the right ones with a probability of {100.0 * sure:.0f} %",
        limit=f"{100.0 * LEAST_SURE:.0f} % or more",
        do=f"pick them with 'torsight markers {where}' and name its file with --markers, or cover all other dots",
    )


def gap_words(account: Mapping[str, Any]) -> str:
    """Return the advice on frames without an angle from ``track.json``; doubts about the track come first."""
    advice = [str(words) for words in account.get("advice") or []]
    about = next((words for words in advice if "frames have no angle" in words), "")
    # A doubt about the track is listed before its gaps and is their cause: sticks exchanged, a damaged file.
    first = advice[0] if advice and about != advice[0] and about in advice[1:2] else about.partition(": ")[2]
    return (first or next(iter(advice), "")).rstrip(".")


def is_no_result(account: Mapping[str, Any]) -> bool:
    """Return whether a command ends without a result (exit code 4), because its angles are not reliable enough."""
    return _share(account) < LEAST or _sure(account) < LEAST_SURE


def _sure(account: Mapping[str, Any]) -> float:
    """Return the probability that the chosen markers of a film, or of both films, are the right ones."""
    films = (account, account.get("right_film") or {})
    return math.prod(float((film.get("markers") or {}).get("probability", 1.0)) for film in films)


def _share(account: Mapping[str, Any]) -> float:
    frames = account.get("frames") or {}
    # An existing table of angles may come with another program's track.json.
    if not frames.get("total") or "with_angle" not in frames:
        return 1.0
    return float(frames["with_angle"]) / int(frames["total"])
