"""Strokes of the actuator on the film: their times, directions, and the times at which they pass given angles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from sync.log.outliers import noise_c
from sync.log.timestamps import longest_gap_s
from sync.signals.even_signal import WINDOW_S, EvenSignal, even_signal
from torsight.core.series import BY_CHANCE, constant_runs, extent, usual_step
from torsight.core.tracks import StickAngles
from torsight.core.units import DEG, Floats

_MIN_STROKE_RAD: Final = 3.0 * DEG
"""Least length of a stroke. Half and twice this value give the same clock (benchmarks/sync/constants.py)."""
_WINDOW_S: Final = 0.5 * WINDOW_S
"""Time over which a film's angle is smoothed where its noise allows it, half of that of a log. Half this value moves a
clock by 0.2 of its standard deviations at most, twice by 1.0 (benchmarks/sync/constants.py)."""
_PAUSE_SHARE: Final = 0.15
"""A pause shorter than this share of the longer motion beside it does not end a stroke: it is stick-slip."""
_LONGEST_PAUSE_S: Final = 5.0
"""Pause from which it must also be short against the shorter motion: half of it at most. Half and twice of both values
give the same clock (benchmarks/sync/constants.py)."""
_NOISE_PER_STEP: Final = 0.05
"""More frames are combined until noise shifts the crossing by less than this share of the time between frames. Half and
twice this value move a clock by 0.12 of its standard deviations at most (benchmarks/sync/constants.py)."""


@dataclass(frozen=True, slots=True, eq=False)
class Stroke:
    """One motion from rest to rest: film times of its begin and end, angles before and after it.

    ``travel_rad`` (n,) is the travel from the start, growing from 0, at film times ``time_s``; ``frame_travel_rad``
    (m,) is the same at the original frames, with the standard deviation ``travel_sigma_rad`` in one frame.
    """

    begin_s: float
    end_s: float
    start_rad: float
    stop_rad: float
    time_s: Floats
    travel_rad: Floats
    frame_s: Floats
    frame_travel_rad: Floats
    travel_sigma_rad: float

    @property
    def sign(self) -> int:
        """+1 where the angle grows."""
        return 1 if self.stop_rad > self.start_rad else -1

    @property
    def length_rad(self) -> float:
        """The length of the stroke, positive."""
        return abs(self.stop_rad - self.start_rad)

    def crossing_s(self, level_rad: Floats) -> tuple[Floats, Floats]:
        """Return the film times at which the travel first passes given levels, and their sigmas; NaN if it does not."""
        highest = np.maximum.accumulate(self.travel_rad)
        at = np.searchsorted(highest, level_rad, side="left")
        inside = (at > 0) & (at < len(highest))
        right = np.clip(at, 1, len(highest) - 1)
        low, high = highest[right - 1], highest[right]
        part = (level_rad - low) / np.maximum(high - low, 1e-15)
        near_s = self.time_s[right - 1] + part * (self.time_s[right] - self.time_s[right - 1])
        found = np.full((2, len(level_rad)), np.nan)
        for index in np.flatnonzero(inside):
            found[:, index] = crossing_time(
                self.frame_s,
                self.frame_travel_rad,
                float(level_rad[index]),
                near_s=float(near_s[index]),
                noise_rad=self.travel_sigma_rad,
            )
        return found[0], found[1]


def find_strokes(angles: StickAngles) -> tuple[Stroke, ...]:
    """Return the strokes of a film in order; empty where nothing moves beyond the noise.

    Frames without an angle are bridged over at most two seconds (five frames if that is longer); a stroke that extends
    into a longer gap is cut there.
    """
    usable = angles.valid & np.isfinite(angles.angle_rad)
    time_s, angle = angles.time_s[usable], angles.angle_rad[usable]
    if len(time_s) < 20:
        return ()
    # So long a window that noise does not move as far within it as the shortest stroke (the slope of a straight line).
    noise = noise_c(angle)
    noisy_s = 12.0 * usual_step(time_s) * (BY_CHANCE * noise / _MIN_STROKE_RAD) ** 2
    window_s = max(_WINDOW_S, noisy_s)
    signal = even_signal(time_s, angle, noise=noise, window_s=window_s, max_gap_s=longest_gap_s(time_s))
    if signal is None:
        return ()
    low, high = extent(signal.value)
    floor_rad = max(_MIN_STROKE_RAD, 0.01 * (high - low), 2.0 * BY_CHANCE * signal.noise)
    span_s = float(time_s[-1] - time_s[0])
    # A speed that covers less than a fiftieth of the range in the whole film is creep or drift, no motion.
    slowest = max(BY_CHANCE * signal.slope_sigma, 0.02 * (high - low) / max(span_s, 1.0))
    moving = np.where(signal.known & (np.abs(signal.slope) > slowest), np.sign(signal.slope), 0.0)
    runs = [
        (begin, end)
        for begin, end in _joined(moving, signal.step_s)
        if abs(signal.value[end - 1] - signal.value[begin]) > 0.5 * floor_rad
    ]
    strokes = []
    for index, (begin, end) in enumerate(runs):
        earlier = runs[index - 1][1] if index else 0
        later = runs[index + 1][0] if index + 1 < len(runs) else len(moving)
        stroke = _stroke(signal, (time_s, angle), begin, end, earlier=earlier, later=later, sign=float(moving[begin]))
        if stroke is not None and stroke.length_rad >= floor_rad:
            strokes.append(stroke)
    return tuple(strokes)


def _joined(moving: Floats, step_s: float) -> list[tuple[int, int]]:
    """Return begin and end of motions (n,: −1, 0, 1); motions in one direction with a short pause are joined."""
    joined: list[tuple[int, int]] = []
    for begin, end in (run for run in constant_runs(moving) if moving[run[0]] != 0):
        if joined and moving[joined[-1][0]] == moving[begin]:
            earlier = joined[-1]
            pause = begin - earlier[1]
            shorter = min(end - begin, earlier[1] - earlier[0])
            longer = max(end - begin, earlier[1] - earlier[0])
            if pause <= max(_PAUSE_SHARE * longer, 2) and (pause * step_s < _LONGEST_PAUSE_S or shorter > 2 * pause):
                joined[-1] = (earlier[0], end)
                continue
        joined.append((begin, end))
    return joined


def _stroke(
    signal: EvenSignal, frames: tuple[Floats, Floats], begin: int, end: int, *, earlier: int, later: int, sign: float
) -> Stroke | None:
    """Return one stroke, with the rests on both sides up to its neighbours; None if it is too short or inconsistent."""
    margin = max(2, round(1.0 / signal.step_s))
    # The first slow motion is below the speed threshold: the rest ends well before the detected begin.
    lead = max(margin, (end - begin) // 3)
    first = max(begin - lead, min(earlier + margin, begin))
    last = min(end + lead, max(later - margin, end), len(signal.value))
    if last - first < 8:
        return None
    start = _rest_level(signal, min(earlier + margin, first), first + max(1, (begin - first) // 4), begin)
    stop = _rest_level(signal, last - max(1, (last - end) // 4), max(later - margin, last), end - 1)
    if (stop - start) * sign <= 0:
        return None
    time_s = signal.time_s
    frame_s, frame_rad = frames
    seen = slice(*np.searchsorted(frame_s, [time_s[first], time_s[last - 1]]))
    return Stroke(
        begin_s=float(time_s[begin]),
        end_s=float(time_s[end - 1]),
        start_rad=start,
        stop_rad=stop,
        time_s=time_s[first:last],
        travel_rad=sign * (signal.value[first:last] - start),
        frame_s=frame_s[seen],
        frame_travel_rad=sign * (frame_rad[seen] - start),
        travel_sigma_rad=signal.noise,
    )


def _rest_level(signal: EvenSignal, begin: int, end: int, otherwise: int) -> float:
    piece = signal.value[max(begin, 0) : end][signal.known[max(begin, 0) : end]]
    return float(np.median(piece)) if len(piece) else float(signal.value[min(otherwise, len(signal.value) - 1)])


def crossing_time(
    time_s: Floats, travel_rad: Floats, level_rad: float, *, near_s: float, noise_rad: float
) -> tuple[float, float]:
    """Return the time near ``near_s`` at which the travel passes a level, and its standard deviation, s.

    Smoothing rounds the onset of a motion, where the speed jumps within a frame or two: it is good enough to detect a
    motion, not to time it. Here only as many frames are combined as the noise of the angle requires, and the
    uncertainty between frames counts as an error of the time.

    NaN where the frames around do not determine it, because they end or the travel does not grow there. ``travel_rad``
    (n,) is the travel at each frame of the stroke, ``noise_rad`` its standard deviation.
    """
    # One more than the coefficients of a parabola.
    count = 4
    while True:
        found = _with(time_s, travel_rad, level_rad, near_s=near_s, noise_rad=noise_rad, count=count)
        if found is None:
            return float("nan"), float("nan")
        at_s, noise_s, unseen_s, step_s = found
        if noise_s <= max(_NOISE_PER_STEP * step_s, unseen_s) or 2 * count > len(time_s):
            return at_s, float(np.hypot(noise_s, unseen_s))
        count *= 2


def _with(
    time_s: Floats, travel_rad: Floats, level_rad: float, *, near_s: float, noise_rad: float, count: int
) -> tuple[float, float, float, float] | None:
    """Return the time, its error from noise, its error from the motion between frames, and the frames' distance.

    The error between frames is half of the difference between a straight line and a parabola through them.
    """
    right = int(np.searchsorted(time_s, near_s))
    first, last = right - count // 2, right + count // 2
    if first < 0 or last > len(time_s):
        return None
    x, y = time_s[first:last] - near_s, travel_rad[first:last] - level_rad
    step_s = float(x[-1] - x[0]) / (count - 1)
    line = np.polyfit(x, y, 1)
    powers = np.vander(x / step_s, 3, increasing=True)
    coefficient = np.linalg.lstsq(powers, y, rcond=None)[0]
    reach_s = 0.5 * float(x[-1] - x[0])
    root_s = _root(coefficient, reach_s / step_s) * step_s
    if line[0] <= 0.0 or not np.isfinite(root_s):
        return None
    speed = float(coefficient[1] + 2.0 * coefficient[2] * root_s / step_s) / step_s
    if speed <= 0.0:
        return None
    straight_s = float(np.clip(-line[1] / line[0], -reach_s, reach_s))
    gain = float(np.sqrt((np.linalg.inv(powers.T @ powers))[0, 0]))
    return near_s + root_s, noise_rad * gain / speed, 0.5 * abs(straight_s - root_s), step_s


def _root(coefficient: NDArray[np.floating[Any]], reach: float) -> float:
    """Return the root of a parabola nearest to 0, in units of the step; NaN where there is none within reach."""
    level, slope, bend = (float(value) for value in coefficient)
    if abs(bend) * reach < 1e-6 * abs(slope):
        root = -level / slope if slope else float("nan")
    else:
        inside = slope**2 - 4.0 * bend * level
        if inside < 0.0:
            return float("nan")
        # The increasing branch, computed without the difference of nearly equal numbers.
        root = -2.0 * level / (slope + float(np.sqrt(inside)))
    return root if abs(root) <= reach else float("nan")
