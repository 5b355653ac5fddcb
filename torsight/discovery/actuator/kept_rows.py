"""The rows of a record that a fit uses, and the rows in which the angle is at rest."""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy.ndimage import median_filter

from torsight.actuator.drive import Drive
from torsight.actuator.record.log_noise import NEGLIGIBLE_C
from torsight.actuator.record.turns import REVERSAL_C, turning_points, turns_of
from torsight.actuator.stepping.kernel import STANDS_S
from torsight.core.series import APART, bridged, means_beside, runs, scatter, usual_step
from torsight.core.units import DEG, Flags, Floats, Ints

REST_SPEED_DEG_S: Final = 0.02
"""Largest speed in a rest, a choice: in the shortest one the angle changes by 0.16°, two steps of the resolution."""
_STOPPED_DEG: Final = 0.5
"""Distance to the angle at rest within which the angle counts as stopped."""


def kept_rows(drive: Drive, way: Floats, at_rest: Flags) -> Ints:
    """Return the indices of the rows that a fit uses: between them the angle or a temperature changes noticeably.

    The stepping is exact for steps of any length over which temperatures rise or fall: rows only have to sample the
    residual. One row is kept for every 5° of angle and every 1 °C (2 °C of the passive spring), every half minute,
    where the driven temperature turns, stops or goes on, at changes of the half-cycle, and around the ends of
    heatings, where an incomplete transformation ends: all rows within two seconds, one every 1.5 s within fifteen. The
    end of a heating is where the driven temperature turns down, where it is highest, and (behind a slow sensor, before
    both) where the angle stops. The same rows are kept where the angle comes to rest or leaves it: steps that contain
    either are not exact where the load changes with time meanwhile (a passive spring that transforms) or friction with
    the speed. ``way`` (n,) is the distance covered (:func:`way_of`), ``at_rest`` (n,) the rows at rest.
    """
    active, _ = drive.temps_by_role()
    interval = usual_step(drive.time_s)
    smooth = _running_median(drive.angle_rad / DEG)
    keep = np.zeros(len(drive), bool)
    keep[np.flatnonzero(np.diff(np.floor(way))) + 1] = True
    keep[_standstills(active, drive)] = True
    turn = np.flatnonzero(np.diff(turning_points(drive.time_s, active, drive.cycles.half, REVERSAL_C)) < 0)
    near, far, second = (max(1, round(span_s / interval)) for span_s in (2.0, 15.0, 1.5))
    for place in [*turn, *_ends_of_rests(at_rest, smooth), *_tops(active, smooth, drive.cycles.half, turn)]:
        keep[max(0, place - near) : place + near] = True
        keep[max(0, place - far) : place + far : second] = True
    change = np.flatnonzero(np.diff(drive.cycles.half))
    keep[change], keep[change + 1] = True, True
    keep[[0, -1]] = True
    return np.flatnonzero(keep)


def _standstills(active: Floats, drive: Drive) -> Ints:
    """Return the rows at which the driven temperature turns, stops (by a hold or a dip) or goes on.

    A transformation only advances: between two rows a dip would hide how far it has come, and how long it stood. The
    temperature stands where it advances beyond all earlier ones by no more than negligible noise a second.
    """
    interval = usual_step(drive.time_s)
    span = max(1, round(STANDS_S / interval))
    kept = turns_of(active, max(APART * drive.noise_c, NEGLIGIBLE_C)).tolist()
    for begin, end in zip(drive.cycles.begins, np.append(drive.cycles.begins[1:], len(drive)), strict=True):
        top = begin + int(np.argmax(active[begin:end]))
        for first, way in ((begin, active[begin:top]), (top, -active[top:end])):
            furthest = np.maximum.accumulate(way)
            slow = np.flatnonzero(furthest[span:] - furthest[:-span] < NEGLIGIBLE_C * span * interval)
            stands = np.zeros(len(way), bool)
            for ahead in range(span + 1):
                stands[slow + ahead] = True
            for start, stop in runs(stands):
                last = int(np.searchsorted(furthest[:stop], furthest[stop - 1]))
                kept += [first + start, first + last, first + stop - 1]
    return np.array(kept)


def _ends_of_rests(at_rest: Flags, angle_deg: Floats) -> list[int]:
    """Return the rows at which the angle comes to rest, and those at which it leaves a rest."""
    found = []
    for start, stop in runs(at_rest):
        ways = angle_deg[start::-1], angle_deg[stop - 1 :]
        before, after = (np.abs(way - way[0]) > _STOPPED_DEG for way in ways)
        found += [start - int(np.argmax(before))] if before.any() else []
        found += [stop - 1 + int(np.argmax(after))] if after.any() else []
    return found


def way_of(drive: Drive) -> Floats:
    """Return the distance (n,) covered since the first row, in steps of angle, temperatures or time."""
    active, passive = drive.temps_by_role()
    angle_deg = _running_median(drive.angle_rad / DEG)
    steps = ((active, 1.0), (passive, 2.0), (angle_deg, 5.0), (drive.time_s, 30.0))
    each = [np.abs(np.diff(values, prepend=values[0])) / step for values, step in steps]
    return np.cumsum(np.max(each, axis=0))


def _tops(active: Floats, angle_deg: Floats, half: Ints, turns: Ints) -> list[int]:
    """Return the rows before each turn at which the driven temperature is highest, and at which the angle stops."""
    found = []
    for turn in turns.tolist():
        first = int(np.searchsorted(half, half[turn]))
        found.append(first + int(np.argmax(active[first : turn + 1])))
        moving = np.flatnonzero(np.abs(angle_deg[first : turn + 1] - angle_deg[turn]) > _STOPPED_DEG)
        if len(moving):
            found.append(first + int(moving[-1]))
    return found


def _running_median(values: Floats) -> Floats:
    """Return the running median over five rows, with gaps interpolated: the motion without the reading noise."""
    return np.asarray(median_filter(bridged(values), 5, mode="nearest"))


def rest_mask(time_s: Floats, observed: Floats, valid: Flags) -> Flags:
    """Return the rows in which the angle is at rest for at least eight seconds.

    A row is at rest if the averages of the angle over half a window before and after it differ by less than 0.02 °/s,
    or by less than the averages' own noise.
    """
    interval = usual_step(time_s)
    half = max(2, round(0.5 * 8.0 / interval))
    filled = np.interp(time_s, time_s[valid], observed[valid])
    noise = scatter(filled)
    before, after, rows = means_beside(filled, half)
    span = 0.5 * rows * interval + 1e-9
    limit = np.maximum(REST_SPEED_DEG_S * span, 4.0 * noise * np.sqrt(2.0 / half))
    kept = np.zeros(len(filled), bool)
    for start, stop in runs(np.abs(after - before) < limit):
        kept[start:stop] = stop - start >= 2 * half
    return kept
