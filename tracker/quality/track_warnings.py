"""Warnings of a track whose angles may be wrong: exchanged sticks or markers, a moving axis, a damaged file."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Iterator, Mapping
from typing import Any, Final

import numpy as np

from torsight.core.series import BY_CHANCE, known_median
from torsight.core.tracks import MarkerTracks, StickAngles, mean_sigma
from torsight.core.words.wording import capital, counted
from tracker.angle.axis_of_circles import away_px, axis_px, direction_of
from tracker.angle.camera_motion import unmoved
from tracker.angle.plane import Orientation
from tracker.angle.views import longest_view
from tracker.detect.marker_file import STICKS
from tracker.follow.camera_state import circle_sigma_px
from tracker.follow.judgement import MOVED_RAD
from tracker.innovation import LIMITS, SIGMAS, SURE
from tracker.rows import CODE
from tracker.track import TrackResult

_WANDERS: Final = 0.25
"""Share of frames with markers off their circles above which a fixed axis is doubted: a marker that is misread now and
then causes fewer."""
_FEW: Final = 2
"""Fewest frames with both sticks that prove which one turns."""


def doubts(result: TrackResult) -> list[str]:
    """Return warnings that have to be read before the angles are used; most tracks have none."""
    still = unmoved(longest_view(result.tracks)).tracks
    if result.report["markers"]["given"]:
        found = exchanged(result)[0] or _missing_base(result)
    else:
        found = itertools.chain(_rival_markers(result), _faint_markers(result))
    return [
        *found,
        *_off_their_stick(result.report["markers"], still),
        *_repeated_texture(result),
        *_moving_axis(still),
        *_file_faults(result),
    ]


@functools.lru_cache(maxsize=2)
def exchanged(result: TrackResult) -> tuple[list[str], bool]:
    """Return warnings of given sticks or markers that the film shows to be exchanged, and whether angles are wrong.

    Both the warnings and ``track.json`` ask, for one film or a pair.
    """
    markers = result.report["markers"]
    if not markers["given"]:
        return [], False
    sticks = _exchanged_sticks(result.tracks)
    # Either end of a tag may be nearer to the axis, depending on how it was attached: it has no inner marker.
    if sticks or "tag" in str(markers["kind"]):
        return sticks, bool(sticks)
    return _exchanged_markers(result.tracks)


def doubts_of_tilt(orientation: Orientation) -> list[str]:
    """Return a warning where the camera's tilt is not known and its effect is larger than the noise."""
    tilt, systematic_rad2 = orientation.report.get("tilt", {}), orientation.systematic_rad2
    sure = orientation.angles.valid & orientation.angles.branch_certain
    if tilt.get("known", True) or systematic_rad2 is None or not sure.any():
        return []
    wrong = float(np.mean(systematic_rad2[sure]))
    noise = max(float(np.mean(orientation.angles.sigma_rad[sure] ** 2)) - wrong, 0.0)
    if wrong <= noise:
        return []
    wrong_deg, noise_deg = np.rad2deg(np.sqrt([wrong, noise]))
    arc_deg = min(np.rad2deg(np.ptp(orientation.angles.angle_rad[sure])), 360.0)
    words = (
        f"The camera's tilt is not known: the moving stick covers {arc_deg:.0f} degrees of a turn, and its markers' "
        f"paths do not show the tilt. A camera that does not look along the axis makes the angle wrong by some "
        f"{wrong_deg:.2g} degrees, and the noise is {noise_deg:.2g}. Give a camera file with the pose, or let the "
        "stick turn further once, with the camera where it is."
    )
    return [words]


def doubts_of_turns(angles: StickAngles) -> list[str]:
    """Return a warning of angles whose number of whole turns is not certain, from the frame at which this begins."""
    unsure = angles.valid & ~angles.branch_certain
    if not unsure.any():
        return []
    words = (
        f"The number of whole turns is not certain from {angles.time_s[np.argmax(unsure)]:.2f} s on: the motion around "
        f"a gap allows more than one. {counted(int(unsure.sum()), 'angle')} may be off by a multiple of 360 degrees, "
        "and their sigma includes it. Keep a marker of the moving stick in sight, and film in one piece."
    )
    return [words]


def doubts_of_length(result: TrackResult, orientation: Orientation) -> list[str]:
    """Return a warning for each stick of dots whose length varies by more than readings of its dots can be wrong.

    A reading lies on its dot: anywhere on a disc of radius R its coordinates have a standard deviation of R/2.
    """
    markers, reached_px = result.report["markers"], mean_sigma(orientation.with_errors(result.tracks).covariance_px2)
    words = []
    for stick, first in zip(STICKS, (0, 2), strict=True):
        error_px = known_median(reached_px[:, first : first + 2])
        if markers["kind"] == "dot" and error_px > 0.5 * markers["radius_px"]:
            words.append(
                f"The two markers of the {stick} stick do not move as one body: their distance varies by some "
                f"{error_px:.1f} px, and their dots have a radius of {markers['radius_px']:.1f} px. The angles are "
                "wrong if one of them is no marker. Look in track.png, and pick the markers with 'torsight markers'."
            )
    return words


def _rival_markers(result: TrackResult) -> Iterator[str]:
    """Yield warnings of other possible markers: other dots, or the same ones with inner and outer exchanged."""
    markers = result.report["markers"]
    if rivals := markers.get("rivals", []):
        others = " or ".join(f"{_in_words(rival)} ({rival['probability']:.0%})" for rival in rivals)
        yield (
            f"Other dots look like the sticks' markers, and neither the picture nor the motion rules them out: "
            f"{_in_words(markers['taken'])} were taken ({markers['taken']['probability']:.0%}); it may be {others}. "
            "The angles are wrong if so. track.png shows both; pick the markers with "
            "'torsight markers', or cover the other dots while filming."
        )
    opposite = markers.get("opposite_probability", 0.0)
    if opposite > 1.0 - SURE:
        yield (
            f"The stick turns too little to show which of a stick's dots is the inner one: with a probability of "
            f"{opposite:.0%} all angles are off by 180 degrees. Pick the markers with "
            "'torsight markers', or let the stick turn further."
        )


def _in_words(couple: Mapping[str, Any]) -> str:
    places = {stick: " and ".join(f"[{x:.0f}, {y:.0f}]" for x, y in couple[stick]) for stick in STICKS}
    return f"base {places['base']} with moving {places['moving']}"


def _faint_markers(result: TrackResult) -> Iterator[str]:
    """Yield a warning if the dots that were taken for the markers have little contrast."""
    if result.report["markers"].get("faint"):
        yield (
            "The dots that were taken for the markers hardly stand out: they may be something else. Look in track.png "
            "whether they are the markers, and pick these with 'torsight markers' if not."
        )


def _exchanged_sticks(tracks: MarkerTracks) -> list[str]:
    """Return a warning if the stick given as base turns while the one given as moving rests."""
    sticks = [direction_of(tracks, first) for first in (0, 2)]
    both = np.flatnonzero(np.isfinite(sticks[0][0]) & np.isfinite(sticks[1][0]))
    if len(both) <= _FEW:
        return []
    turned = [np.abs(np.angle(np.exp(1j * (turn[both] - turn[both[0]])))) for turn, _ in sticks]
    limit = max(MOVED_RAD, *(BY_CHANCE * float(np.median(np.sqrt(variance[both]))) for _, variance in sticks))
    against = int((turned[0] > limit + 3.0 * turned[1]).sum())
    if against < _FEW or (turned[1] > limit + 3.0 * turned[0]).any():
        return []
    words = (
        f"The sticks seem to be exchanged: in {counted(against, 'frame')} the base has turned, by up to "
        f"{np.rad2deg(turned[0].max()):.1f} degrees, while the moving stick has turned by no more than "
        f"{np.rad2deg(turned[1].max()):.1f}; the angles are wrong if so. Exchange base and moving in the marker file."
    )
    return [words]


def _has_turned(tracks: MarkerTracks) -> bool:
    """Return whether the moving stick has turned against the base: then they are not exchanged."""
    sticks = [direction_of(tracks, first)[0] for first in (0, 2)]
    turn = (sticks[1] - sticks[0])[np.isfinite(sticks[0] + sticks[1])]
    return len(turn) > _FEW and bool(np.abs(np.angle(np.exp(1j * (turn - turn[0])))).max() > SIGMAS * MOVED_RAD)


def _missing_base(result: TrackResult) -> Iterator[str]:
    """Yield a warning if the base is mostly not found at its given position: the stick given may be the moving one."""
    # Dots that are read as no dots are missing for that reason.
    if _has_turned(result.tracks) or "base" in result.report["markers"].get("not_on_one_stick", {}):
        return
    state = result.rows["state"]
    usable = ~np.isin(state, (CODE["dark"], CODE["damaged"])).any(axis=1)
    # Both markers have to be missing: the other stick may lie over one of them.
    gone = usable & (state[:, :2] != CODE["seen"]).all(axis=1)
    gone &= np.isin(state[:, :2], (CODE["lost"], CODE["hidden"])).any(axis=1)
    # A stick that turns is seen where it was given at first.
    if not (usable & ~gone).any() or 2 * gone.sum() < usable.sum():
        return
    yield (
        f"The base is not where it was given in {gone.sum()} of {counted(int(usable.sum()), 'frame')}, so the angles "
        "rest on few frames. Exchange base and moving in the marker file if the base given is the stick that turns."
    )


def _exchanged_markers(tracks: MarkerTracks) -> tuple[list[str], bool]:
    """Return a warning of inner markers that are further out than the outer ones, and whether angles are wrong."""
    axis = axis_px(tracks)
    if axis is None:
        return [], False
    found: list[str] = []
    for name, (inner, outer), first in zip(STICKS, away_px(tracks, axis).reshape(2, 2).tolist(), (0, 2), strict=True):
        offset = tracks.position_px[:, first + 1] - tracks.position_px[:, first]
        length = np.hypot(*offset[tracks.valid[:, first : first + 2].all(axis=1)].T)
        # With the axis between a stick's markers either of them may be meant as the inner one.
        if len(length) and inner - outer > 0.5 * float(np.median(length)):
            found.append(
                f"the markers of the {name} stick are exchanged (its inner marker is {inner:.0f} px from the axis, "
                f"its outer one {outer:.0f} px)"
            )
    if not found:
        return [], False
    what = "every angle is off by 180 degrees" if len(found) == 1 else "the angles hold, but not the markers' names"
    words = " and ".join(found)
    sentence = f"{capital(words)}: {what}. Exchange the two positions in the marker file."
    return [sentence], len(found) == 1


def _off_their_stick(markers: Mapping[str, Any], tracks: MarkerTracks) -> Iterator[str]:
    """Yield a warning for a stick whose two given dots look unlike, and lie on a line that misses the axis.

    Markers lie on the middle line of a stick to within about their radius; ``tracks`` are as by a fixed camera.
    """
    unlike = markers.get("not_on_one_stick", {})
    axis = axis_px(tracks) if unlike else None
    for name, first in zip(STICKS, (0, 2), strict=True) if axis is not None else ():
        both = np.flatnonzero(tracks.valid[:, first : first + 2].all(axis=1))
        if name in unlike and len(both):
            away, along = tracks.position_px[both[0], first] - axis, np.diff(tracks.position_px[both[0]], axis=0)[first]
            beside_px = float(abs(away[0] * along[1] - away[1] * along[0]) / np.hypot(*along))
            if beside_px > SIGMAS * markers["radius_px"]:
                yield (
                    f"The two dots given for the {name} stick may not be on one stick: {unlike[name]}, and the line "
                    f"through them passes the axis at {beside_px:.0f} px. All angles are off by the same amount if one "
                    "of them is no marker. Look in track.png, and mend the marker file."
                )


def _repeated_texture(result: TrackResult) -> Iterator[str]:
    """Yield a warning if the moving stick's texture is repeated nearby: marks of a scale, teeth of a wheel."""
    turn_deg = result.report["markers"].get("looks_alike_turned_by_deg")
    if turn_deg is None:
        return
    yield (
        f"The texture around the points of the moving stick is repeated: turned by {turn_deg:.0f} degrees it looks the "
        "same. Where the stick is fast or covered one place may be taken for another, and the angle is wrong. Choose "
        "points that look like nothing near them."
    )


def _moving_axis(tracks: MarkerTracks) -> Iterator[str]:
    """Yield a warning if the moving stick turns about no fixed axis: it rolls, is carried, or was misread at times.

    The markers' distances from the axis are tested as :mod:`tracker.follow` tests those of a marker found again;
    ``tracks`` are as by a fixed camera.
    """
    axis = axis_px(tracks)
    both = np.flatnonzero(tracks.valid[:, 2:].all(axis=1) & tracks.valid[:, :2].any(axis=1))
    if axis is None or not len(both):
        return
    away = np.linalg.norm(tracks.position_px[both, 2:] - axis, axis=-1)
    usual = np.median(away, axis=0)
    sigma_px = np.array([circle_sigma_px(px, 0.0) for px in usual.tolist()])
    chi_squared = np.sum(np.square((away - usual) / sigma_px), axis=1)
    off = int(np.sum(chi_squared > LIMITS[1]))
    if off < _WANDERS * len(both):
        return
    yield (
        f"The moving stick does not turn about a fixed axis: in {off} of {counted(len(both), 'frame')} its "
        "markers are off the circles that the other frames show. Angles are those of a stick on a fixed axis; check in "
        "track.png that the markers were followed."
    )


def _file_faults(result: TrackResult) -> Iterator[str]:
    """Yield warnings of faults in the film, the pictures or the table of times, as noted by the source."""
    yield from (f"{capital(entry['text'])}." for entry in result.damage if entry["kind"] != "damage")
    if "note" in result.report["source"]:
        yield f"{capital(result.report['source']['note'])}."
    damage = [entry for entry in result.damage if entry["kind"] == "damage"]
    if damage:
        lost = int((result.rows["state"] == CODE["damaged"]).any(axis=1).sum())
        frames = f" {counted(lost, 'frame')} could not be used." if lost else ""
        more = f" (and {len(damage) - 1} more)" if len(damage) > 1 else ""
        yield f"The file is damaged: {damage[0]['text']}{more}.{frames} Copy it from the camera again."
