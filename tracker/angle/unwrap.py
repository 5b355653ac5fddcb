"""From angles within one turn to the whole angle, across gaps by the motion on both sides.

Between two instants with known speeds v0 and v1, T apart, a motion whose acceleration never exceeds A covers
(v0 + v1)/2 · T, give or take A · T²/4. A speed is the mean over a time S on its side, and at the rim of the gap it may
be another by A · S/2: give or take A · S T/2 more. A is what the film itself shows. Where only one whole number of
turns lies in that range the turn is certain.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from torsight.core.units import Flags, Floats, Ints

_BASE_S: Final = 0.15
"""Time over which accelerations are looked at: shorter, and noise would be taken for motion."""
_SIDE_S: Final = 2.0 * _BASE_S
"""Time on each side of a gap from which the speed is taken: an acceleration's, from end to end."""
_SAFETY: Final = 2.0
_LEAST_RAD_S2: Final = math.radians(2.0)
"""Acceleration that is always allowed for."""
_SLACK_RAD: Final = 0.3


def unwrap(time_s: Floats, angle_rad: Floats) -> tuple[Floats, Flags]:
    """Return the unwrapped angle (NaN stays NaN) and where its whole turn is certain.

    The first known angle is taken within (−π, π]. Once a turn is uncertain, so are all later angles.
    """
    whole = np.full_like(angle_rad, np.nan)
    certain = np.ones(len(angle_rad), bool)
    known = np.flatnonzero(np.isfinite(angle_rad))
    if len(known) == 0:
        return whole, certain
    typical_s = float(np.median(np.diff(time_s))) if len(time_s) > 1 else 1.0
    breaks = np.flatnonzero((np.diff(known) > 1) | (np.diff(time_s[known]) > 1.5 * typical_s)) + 1
    runs = np.split(known, breaks)
    locals_ = [np.unwrap(angle_rad[run]) for run in runs]
    limit = _acceleration(time_s, runs, locals_, typical_s)
    sure = True
    for number, run in enumerate(runs):
        local = locals_[number]
        if number == 0:
            # The same direction within (−π, π].
            local = local + math.pi - (math.pi - local[0]) % math.tau - local[0]
        else:
            before = runs[number - 1][-1]
            ahead = _speed_ahead(time_s, runs, locals_, number)
            behind = _speed_behind(time_s, whole, int(before))
            turns, clear = _turns(
                gap_s=float(time_s[run[0]] - time_s[before]),
                step_rad=float(local[0] - whole[before]),
                behind=behind,
                ahead=ahead,
                limit=limit,
            )
            local = local + 2.0 * np.pi * turns
            sure = sure and clear
            certain[before + 1 : run[0]] = sure
        whole[run] = local
        certain[run] = sure
    certain[known[-1] + 1 :] = sure
    return whole, certain


def _turns(
    *, gap_s: float, step_rad: float, behind: float | None, ahead: float | None, limit: float
) -> tuple[float, bool]:
    """Return how many turns to add after a gap, and whether no other number is possible."""
    speeds = [speed for speed in (behind, ahead) if speed is not None]
    expected = gap_s * sum(speeds) / len(speeds) if speeds else 0.0
    turns = float(np.round((expected - step_rad) / (2.0 * np.pi)))
    if len(speeds) == 2:
        spread = limit * gap_s**2 / 4.0
    elif speeds:
        spread = limit * gap_s**2 / 2.0
    else:
        return turns, False
    spread += limit * _SIDE_S * gap_s / 2.0
    miss = abs(step_rad + 2.0 * np.pi * turns - expected)
    spread += _SLACK_RAD
    return turns, miss <= spread < 2.0 * np.pi - miss


def _acceleration(time_s: Floats, runs: list[Ints], angles: list[Floats], typical_s: float) -> float:
    """Return the largest acceleration that the film shows, with a margin; infinite where it shows none."""
    found: list[float] = []
    for lag in {max(1, round(_BASE_S / typical_s)), max(1, round(2.0 * _BASE_S / typical_s))}:
        for run, angle in zip(runs, angles, strict=True):
            if len(run) <= 2 * lag:
                continue
            t = time_s[run]
            first = (angle[lag:-lag] - angle[: -2 * lag]) / (t[lag:-lag] - t[: -2 * lag])
            second = (angle[2 * lag :] - angle[lag:-lag]) / (t[2 * lag :] - t[lag:-lag])
            found.append(float(np.max(np.abs(second - first) / (0.5 * (t[2 * lag :] - t[: -2 * lag])))))
    return max(_SAFETY * max(found), _LEAST_RAD_S2) if found else math.inf


def _speed_behind(time_s: Floats, whole: Floats, last: int) -> float | None:
    """Return the speed before a gap, from what is known up to frame ``last``."""
    first = int(np.searchsorted(time_s, time_s[last] - _SIDE_S))
    index = first + np.flatnonzero(np.isfinite(whole[first : last + 1]))
    return _slope(time_s[index], whole[index])


def _speed_ahead(time_s: Floats, runs: list[Ints], angles: list[Floats], number: int) -> float | None:
    """Return the speed after a gap; runs that follow each other closely count together."""
    times: list[float] = []
    values: list[float] = []
    step_s = float(np.median(np.diff(time_s)))
    until_s = time_s[runs[number][0]] + _SIDE_S
    for run, angle in zip(runs[number:], angles[number:], strict=True):
        shift = 0.0
        if times:
            if time_s[run[0]] - times[-1] > 4.0 * step_s:
                break
            speed = 0.0 if len(values) < 2 else (values[-1] - values[-2]) / (times[-1] - times[-2])
            expected = values[-1] + speed * (time_s[run[0]] - times[-1])
            shift = 2.0 * np.pi * np.round((expected - angle[0]) / (2.0 * np.pi))
        early = time_s[run] <= until_s
        times += list(time_s[run][early])
        values += list(angle[early] + shift)
        if not early.all():
            break
    return _slope(np.array(times), np.array(values))


def _slope(time_s: Floats, angle_rad: Floats) -> float | None:
    if len(time_s) < 2:
        return None
    t = time_s - time_s.mean()
    return float(t @ (angle_rad - angle_rad.mean()) / (t @ t))
