"""Causes visible in the pictures of frames without an angle: interlacing, blur, too fast a stick, or none of these.

The sticks' region of a picture is resampled over the angle about the axis. The difference from the median of all
pictures examined shows the moving stick as a peak, as wide as the stick. From one frame to the next the peak moves by
the stick's turn, and a long exposure widens it by a share of that turn. Neither happens under a hand.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from torsight.core.tracks import MarkerTracks, StickAngles
from torsight.core.units import DEG, Floats, Ints
from tracker.angle.axis_of_circles import axis_px
from tracker.detect.moving_part import LOOKED_AT, MOVED_PX, edges_in, moved_in
from tracker.detect.sticks import crossing_point
from tracker.follow.motion_model import jump_px
from tracker.innovation import SIGMAS
from tracker.repeated_pictures import MOST

Luma = NDArray[np.uint8]
Pictures = Callable[[Iterable[int]], dict[int, Luma]]

COMBED: Final = 2.0
"""Energy of second differences between neighbouring rows, over that between neighbouring rows of a field, where
something moved: 1 for noise, below 1 for edges and blur, 4 and more where two fields are of two instants."""
BLURRED: Final = 0.6
"""Steepness of the edges, over that in frames with an angle, below which a picture is out of focus."""
FAST: Final = 2.0
"""Turn from one frame to the next, over the largest one that was followed, above which the stick is too fast."""
LEAST_FAST_DEG: Final = SIGMAS
"""Smallest turn from one frame to the next that is told from none: turns are measured to one degree."""
JUMP: Final = 2.0 * FAST
"""Change at once over that before and afterwards where the picture jumps: a stick that is too fast changes ``FAST``
times as many pixels."""
_OVER: Final = 0.6
"""Share of the pixels that differ from before a gap, and also from after it, above which something lies over the
sticks: nearly all of a hand's do; of a stick that is elsewhere at once half at most, those of its new place."""
SMEARED: Final = 0.4
"""Motion blur, in radii of a dot, above which dots are no longer recognised in every frame."""
ALIKE: Final = 0.5
"""Smallest correlation of two profiles or two parts of pictures that show the same object, or of the brightness with
itself a period later: half of the variance is common."""


@dataclass(frozen=True, slots=True)
class Seen:
    """Measurements in the picture of one frame without an angle.

    ``combed``: see :data:`COMBED`; ``sharpness``: steepness of its edges over that in frames with an angle;
    ``step_deg``: turn of the stick to the next frame, None where no stick is recognised in both; ``step_px``: the outer
    marker's path by that turn, 0 where it is not known; ``smear_px``: width of the stick's edges at its outer marker,
    minus that in frames with an angle.
    """

    combed: float
    sharpness: float
    step_deg: float | None
    step_px: float
    smear_px: float

    def cause(self, *, usual_deg: float, radius_px: float, length_px: float) -> str | None:
        """Return the cause: ``interlaced``, ``focus``, ``shutter`` or ``speed``; None where the picture shows none.

        ``usual_deg`` is the largest turn between frames that were followed, ``radius_px`` that of the dots,
        ``length_px`` that of a stick.
        """
        if self.combed > COMBED:
            return "interlaced"
        if self.sharpness < BLURRED:
            return "focus"
        if self.step_deg is None or abs(self.step_deg) < LEAST_FAST_DEG:
            return None
        # Beyond the search's reach a stick is followed only at constant speed; the turn is measured to a column of the
        # layout, one degree.
        beyond = self.step_px >= SIGMAS * jump_px(length_px, 1)
        if abs(self.step_deg) < (usual_deg - 1.0 if beyond else FAST * usual_deg):
            return None
        return "shutter" if self.smear_px > SMEARED * radius_px else "speed"


def look_at_gaps(unknown: Ints, tracks: MarkerTracks, angles: StickAngles, pictures: Pictures) -> list[Seen]:
    """Return measurements in the pictures of some of the frames ``unknown`` (n,), whose angle is missing unexplained.

    ``pictures`` returns pictures of frames by number.
    """
    held = _over_the_stroke(angles)
    if not len(unknown) or not held:
        return []
    chosen = spread_over(unknown)
    found = pictures(sorted({*chosen.tolist(), *(chosen + 1).tolist(), *held} & set(range(len(angles)))))
    reference = [found[index] for index in held if index in found]
    if not reference:
        return []
    layout = _Layout.of(tracks, [*found.values()], reference)
    edges = float(np.median([_steepness(picture) for picture in reference]))
    width_deg = float(np.median([layout.width_deg(picture) for picture in reference])) if layout else 0.0
    seen: list[Seen] = []
    for index in chosen.tolist():
        picture, after = found.get(index), found.get(index + 1)
        if picture is None or after is None:
            continue
        step_deg = layout.step_deg(picture, after) if layout else None
        step_px = 0.0 if layout is None or step_deg is None else abs(step_deg) * DEG * layout.outer_px
        smear_px = (layout.width_deg(picture) - width_deg) * DEG * layout.outer_px if layout else 0.0
        seen.append(Seen(combed(picture, after), _steepness(picture) / max(edges, 1e-9), step_deg, step_px, smear_px))
    return seen


def jumps_at(
    gaps: Mapping[int, tuple[int, int]], tracks: MarkerTracks, angles: StickAngles, pictures: Pictures
) -> list[int]:
    """Return those frames at which the picture jumps, of the first ones of gaps.

    Each gap has a frame well before it, and one well after it. At a jump the moving stick turns at once, or
    many pixels change at once, and neither does before or afterwards for longer than pictures are repeated: a part of
    the film is missing there, or the camera was moved meanwhile. A stick moves in more than one frame. A hand may come
    within one, but neither of the two other frames shows it.
    """
    held = _over_the_stroke(angles)
    around = {begin: range(max(begin - 2 - MOST, 0), begin + 2 + MOST) for begin in gaps}
    wanted = {*held, *itertools.chain(*around.values(), *gaps.values())}
    shown = pictures(sorted(wanted & set(range(len(angles)))))
    reference = [shown[index] for index in held if index in shown]
    layout = _Layout.of(tracks, reference, reference)
    found = []
    for begin, frames in around.items():
        near = {index: (shown[index - 1], shown[index]) for index in frames[1:] if {index - 1, index} <= shown.keys()}
        if begin not in near or not set(gaps[begin]) <= shown.keys():
            continue
        pixels = {index: float(moved_in(*step).sum()) for index, step in near.items()}
        new, left = (moved_in(shown[begin], shown[index]) for index in gaps[begin])
        over = (new & left).sum() > _OVER * new.sum()
        turns_deg = {index: abs((layout and layout.step_deg(*step)) or 0.0) for index, step in near.items()}
        if _is_alone(turns_deg, begin, LEAST_FAST_DEG) or (_is_alone(pixels, begin, MOVED_PX) and not over):
            found.append(begin)
    return found


def _is_alone(changes: Mapping[int, float], frame: int, least: float) -> bool:
    """Return whether the change to a frame is large, and those to the other ones are not."""
    return changes[frame] > JUMP * max([least, *(change for index, change in changes.items() if index != frame)])


def _over_the_stroke(angles: StickAngles) -> list[int]:
    """Return some frames from all over the stroke: the moving stick vanishes in the median of their pictures."""
    known = np.flatnonzero(angles.valid)
    return list(map(int, spread_over(known[np.argsort(angles.angle_rad[known])])))


def spread_over(frames: Ints) -> Ints:
    """Return at most ``LOOKED_AT`` of some frames (n,), evenly spaced."""
    return frames[np.unique(np.linspace(0, len(frames) - 1, LOOKED_AT).astype(int))] if len(frames) else frames


def combed(picture: Luma, other: Luma) -> float:
    """Return the combing of a picture's rows where the picture differs from another one; see :data:`COMBED`."""
    moved = moved_in(picture, other)[2:-2]
    if moved.sum() < MOVED_PX:
        return 0.0
    rows = picture.astype(np.float32)
    near = rows[1:-3] - 2.0 * rows[2:-2] + rows[3:-1]
    field = rows[:-4] - 2.0 * rows[2:-2] + rows[4:]
    return float(np.sum(near[moved] ** 2) / max(float(np.sum(field[moved] ** 2)), 1e-9))


def _steepness(picture: Luma) -> float:
    """Return the median gradient at a picture's edges, over the change of brightness across each edge, 1/px."""
    gradient, change = edges_in(picture)
    edge = gradient >= np.percentile(gradient, 99.0)
    return float(np.median(gradient[edge] / np.maximum(change[edge], 1.0)))


@dataclass(frozen=True, slots=True, eq=False)
class _Layout:
    """Polar resampling of the ring between the moving stick's markers, one column per degree, and its background.

    ``stick`` is the foreground's mean in pictures with an angle.
    """

    x: NDArray[np.float32]
    y: NDArray[np.float32]
    ground: NDArray[np.float32]
    outer_px: float
    stick: float = 0.0

    @classmethod
    def of(cls, tracks: MarkerTracks, pictures: Sequence[Luma], reference: Sequence[Luma]) -> _Layout | None:
        """Return the layout, its background the median of some pictures; ``reference`` are pictures with an angle."""
        centre = _centre(tracks)
        if centre is None or not pictures:
            return None
        away = [np.hypot(*(tracks.position_px[tracks.valid[:, index], index] - centre).T) for index in (2, 3)]
        inner, outer = sorted(float(np.median(one)) if len(one) else np.nan for one in away)
        if not outer - inner > 2.0:
            return None
        turn = np.deg2rad(np.arange(360.0))[None, :]
        radius = np.linspace(inner, outer, 24)[:, None]
        x = (centre[0] + radius * np.cos(turn)).astype(np.float32)
        y = (centre[1] + radius * np.sin(turn)).astype(np.float32)
        laid = [cv2.remap(picture, x, y, cv2.INTER_LINEAR) for picture in pictures]
        own = cls(x, y, np.median(laid, axis=0).astype(np.float32), outer)
        return replace(own, stick=float(np.median([own.profile(picture).mean() for picture in reference])))

    def profile(self, picture: Luma) -> Floats:
        laid = cv2.remap(picture, self.x, self.y, cv2.INTER_LINEAR)
        return np.asarray(np.abs(laid - self.ground).mean(axis=0), dtype=np.float64)

    def width_deg(self, picture: Luma) -> float:
        """Return the width, degrees, of the stick's edges in the outer half of the ring."""
        laid = np.abs(cv2.remap(picture, self.x, self.y, cv2.INTER_LINEAR) - self.ground)[len(self.x) // 2 :]
        slope = np.abs(laid[:, 2:] - laid[:, :-2]).max(axis=1) / 2.0
        return float(np.median(laid.max(axis=1) / np.maximum(slope, 1e-3)))

    def step_deg(self, one: Luma, other: Luma) -> float | None:
        """Return the foreground's rotation from one picture to the other, degrees; None where they do not match.

        It has to be as large as the stick is: a hand is larger, and little is left under one that is the background.
        """
        profiles = [self.profile(picture) for picture in (one, other)]
        if not all(ALIKE * self.stick < values.mean() < self.stick / ALIKE for values in profiles):
            return None
        first, second = (values - values.mean() for values in profiles)
        total = float(np.sqrt(np.sum(first**2) * np.sum(second**2)))
        spectrum = np.conj(np.fft.rfft(first)) * np.fft.rfft(second)
        match = np.fft.irfft(spectrum, len(first)) / max(total, 1e-9)
        best = int(np.argmax(match))
        return None if match[best] < ALIKE else float((best + 180) % 360 - 180)


def _centre(tracks: MarkerTracks) -> Floats | None:
    """Return the axis in the picture (2,), or the crossing of both sticks where the stick has turned too little."""
    axis = axis_px(tracks)
    if axis is not None:
        return axis
    whole = np.flatnonzero(tracks.valid.all(axis=1))
    if not len(whole):
        return None
    crossing = crossing_point(*tracks.position_px[whole[len(whole) // 2]].tolist())
    return None if crossing is None else np.array(crossing)


def usual_step_deg(angles: StickAngles) -> float:
    """Return the 95th percentile of the turn between two neighbouring frames that have an angle, degrees."""
    both = angles.valid[1:] & angles.valid[:-1]
    step = np.abs(np.diff(angles.angle_rad)[both]) / DEG
    return float(np.percentile(step, 95.0)) if len(step) else 0.0
