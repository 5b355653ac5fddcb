"""Half-cycles of a record: which spring is driven when.

A half-cycle is the heating and cooling of one spring. It lasts until the heating of the other spring begins, or until
the same spring is heated again after it has cooled. Half-cycles follow from the log's heating switches where it has
them, else from the temperatures: the driven spring is the hotter one at the top of a rise, so that a spring which is
only warmed by its neighbour does not count as driven.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise, zip_longest
from typing import Final

import numpy as np
from numpy.typing import NDArray

from torsight.actuator.record.turns import REVERSAL_C
from torsight.core.errors import InputError, NoResultError
from torsight.core.series import APART, BY_CHANCE, extremes, runs, scatter
from torsight.core.units import DEG, Flags, Floats, Ints

# benchmarks/actuator/half_cycles.py measures the effect of half and twice of these constants: no half-cycle's spring
# changes, and no start but those that are mentioned.
TURN_C: Final = 1.0
"""Least reversal of a temperature at a turn, larger for a noisy temperature."""
_BEFORE_S: Final = 40.0
"""Longest time between a jump of the angle and the visible heating that causes it. With half this value a jump is
missed in one of 25 half-cycles that have one."""
_JUMP_S: Final = 2.0
_JUMP_RAD: Final = 0.4 * DEG
"""Least motion of the angle within two seconds that counts as a jump, larger for a noisy angle; the rest before it
moves by less."""
_COLD_SHARE: Final = 0.2
"""Share of its temperature's rise below which a spring counts as cooled: it no longer moves the disk."""


def turn_of(noise_c: float) -> float:
    """Return the least reversal of a temperature that counts as a turn, °C."""
    return max(TURN_C, APART * noise_c)


@dataclass(frozen=True, slots=True)
class Heating:
    """One rise of one spring's temperature: spring (0 A, 1 B), rows and temperatures of its start and its top."""

    spring: int
    start: int
    top: int
    base_c: float
    top_c: float


def by_role(active: NDArray[np.int8], of_a: Floats, of_b: Floats) -> tuple[Floats, Floats]:
    """Return the series (n,) of the driven spring of each row, and the series of the other spring."""
    is_a = active == 0
    return np.where(is_a, of_a, of_b), np.where(is_a, of_b, of_a)


@dataclass(frozen=True, slots=True, eq=False)
class HalfCycles:
    """The half-cycles of a record: the driven spring (0 A, 1 B) and the number of the half-cycle of each row (n,).

    ``springs`` are the driven springs of the half-cycles; ``switched`` is true where the log's heating switches
    determine the starts.
    """

    active: NDArray[np.int8]
    half: Ints
    springs: tuple[int, ...]
    switched: bool = False

    @property
    def begins(self) -> Ints:
        """The first row of each half-cycle; for a part of the rows, where it would begin among them."""
        return np.searchsorted(self.half, np.arange(len(self.springs)))

    def counts(self) -> Ints:
        """Return the number of earlier heatings of the driven spring for each half-cycle."""
        is_b = np.array(self.springs, np.int64)
        return np.where(is_b == 1, np.cumsum(is_b), np.cumsum(1 - is_b)) - 1


def half_cycles(
    temp_a_c: Floats,
    temp_b_c: Floats,
    *,
    heat_a: Flags | None = None,
    heat_b: Flags | None = None,
    noise_c: float = 0.0,
    where: str = "record",
) -> HalfCycles:
    """Split a record into half-cycles.

    Raises InputError when both springs are heated, but only together, or when a switch is on while the other spring
    warms; NoResultError when neither spring is ever heated.
    """
    temps = (temp_a_c, temp_b_c)
    switched = False
    if heat_a is not None and heat_b is not None and (heat_a.any() or heat_b.any()):
        heatings, switched = _switched(temps, (heat_a, heat_b)), True
        _require_own_rise(_merged(heatings, temps), temps, (heat_a, heat_b), where=where)
    else:
        heatings = _driven(temps, rise_c=max(REVERSAL_C, 2.0 * BY_CHANCE * noise_c), turn_c=turn_of(noise_c))
    if not any(item.top_c - item.base_c >= REVERSAL_C for item in heatings):
        raise _unheated(temps, where=where)
    chained = _merged(heatings, temps)
    if not switched:
        chained = _placed(chained, temps, margin_c=BY_CHANCE * noise_c)
    return _chain(chained, len(temp_a_c), switched=switched)


def begun_with_a_jump(
    cycles: HalfCycles, time_s: Floats, angle_rad: Floats, temps_c: tuple[Floats, Floats]
) -> HalfCycles:
    """Move the start of half-cycles to jumps of the angle out of a rest, shortly before the temperature rises.

    A sensor shows a heating some seconds after the switch. The plain rig rests until the wire is hot; but where torques
    change as soon as the other spring is switched on, the angle shows the switch more precisely. While the spring that
    was driven before is still warm, a jump is its return stroke and does not count.
    """
    if cycles.switched:
        return cycles
    half, last = cycles.half.copy(), 0
    for start in (np.flatnonzero(np.diff(cycles.half)) + 1).tolist():
        cooling = temps_c[cycles.active[start - 1]][last:start]
        warm = np.flatnonzero(cooling > cooling.min() + _COLD_SHARE * np.ptp(cooling))
        after = last + 1 + (int(warm[-1]) if len(warm) else 0)
        first = max(after, int(np.searchsorted(time_s, time_s[start] - _BEFORE_S)))
        rows = first + np.flatnonzero(np.isfinite(angle_rad[first : start + 1]))
        jump = _jump(time_s[rows], angle_rad[rows])
        last = start if jump is None else int(rows[jump])
        half[last:start] = cycles.half[start]
    return replace(cycles, active=np.array(cycles.springs, np.int8)[half], half=half)


def _jump(time_s: Floats, angle_rad: Floats) -> int | None:
    """Return the row at which an angle jumps out of a rest; None without a jump."""
    if len(time_s) < 2:
        return None
    least = max(_JUMP_RAD, APART * scatter(angle_rad, order=1))
    later = np.searchsorted(time_s, time_s + _JUMP_S, side="right") - 1
    motion = np.abs(angle_rad[later] - angle_rad)
    quick = np.flatnonzero(motion >= least)
    if len(quick) == 0 or quick[0] == 0:
        return None
    rest, after = np.split(angle_rad, quick[:1])
    if float(np.ptp(rest)) >= least:
        return None
    return len(rest) + int(np.argmax(np.abs(after - np.median(rest)) > 0.5 * least))


def _unheated(temps: tuple[Floats, Floats], *, where: str) -> InputError | NoResultError:
    """Return the error for a record in which no spring is driven alone."""
    span = [float(np.max(t) - np.min(t)) for t in temps]
    value = f"temperatures that change by {span[0]:.1f} °C (A) and {span[1]:.1f} °C (B)"
    if min(span) >= REVERSAL_C:
        return InputError(
            "both springs are heated simultaneously, and neither alone",
            where=where,
            value=value,
            limit=f"a rise of {REVERSAL_C:g} °C or more of one spring over the other",
            do="heat one spring at a time, or check that the two temperature columns are two sensors",
        )
    limit = f"a rise of {REVERSAL_C:g} °C or more of the driven spring over the other"
    do = "record at least one heating and cooling"
    return NoResultError("neither spring is heated", where=where, value=value, limit=limit, do=do)


def _switched(temps: tuple[Floats, Floats], heat: tuple[Flags, Flags]) -> list[Heating]:
    """Return the heatings by the switches: the intervals in which only one switch is on."""
    found = []
    for spring in (0, 1):
        for start, end in runs(heat[spring] & ~heat[1 - spring]):
            top = start + int(np.argmax(temps[spring][start:end]))
            found.append(Heating(spring, start, top, float(temps[spring][start]), float(temps[spring][top])))
    return sorted(found, key=lambda item: item.start)


def _require_own_rise(
    heatings: list[Heating], temps: tuple[Floats, Floats], heat: tuple[Flags, Flags], *, where: str
) -> None:
    """Refuse a switch with which, over all its heatings, the other spring warms and its own one warms less."""
    rises_c = np.zeros((2, 2))  # by the spring that is said to be heated, of both springs
    for item, later in zip_longest(heatings, heatings[1:]):
        end = len(temps[0]) if later is None else later.start
        on = item.start + np.flatnonzero(heat[item.spring][item.start : end])
        rises_c[item.spring] += [np.max(temp_c[on]) - temp_c[item.start] for temp_c in temps]
    for spring in (0, 1):
        own_c, other_c = rises_c[spring, spring], rises_c[spring, 1 - spring]
        if other_c > max(own_c, REVERSAL_C):
            name, other = "ab"[spring], "ab"[1 - spring]
            raise InputError(
                f"spring {other.upper()} warms while spring {name.upper()} is said to be heated",
                where=f"{where}, column heat_{name}",
                value=f"rises of {other_c:.1f} °C (temp_{other}_c) and {own_c:.1f} °C (temp_{name}_c)",
                limit="the larger rise for the spring that is heated",
                do="exchange heat_a and heat_b, or the temperatures; without switches the temperatures decide",
            )


def _driven(temps: tuple[Floats, Floats], *, rise_c: float, turn_c: float) -> list[Heating]:
    """Return the heatings by the temperatures: the rises of either spring that its own heating causes."""
    found: list[Heating] = []
    for spring in (0, 1):
        own, other = temps[spring], temps[1 - spring]
        for start, top in pairwise(extremes(own, turn_c)):
            rise = own[top] - own[start]
            if rise >= rise_c and own[top] > other[top] and rise > other[top] - other[start]:
                found.append(Heating(spring, start, top, float(own[start]), float(own[top])))
    return sorted(found, key=lambda item: item.top)


def _merged(heatings: list[Heating], temps: tuple[Floats, Floats]) -> list[Heating]:
    """Join rises of one spring between which the spring has not cooled: holds, pauses, partial reheats."""
    kept: list[Heating] = []
    for item in heatings:
        last = kept[-1] if kept else None
        if last is not None and last.spring == item.spring:
            lowest = float(np.min(temps[item.spring][last.top : item.top + 1]))
            if lowest > last.base_c + _COLD_SHARE * (last.top_c - last.base_c):
                top = last if last.top_c >= item.top_c else item
                kept[-1] = Heating(item.spring, last.start, top.top, last.base_c, top.top_c)
                continue
        kept.append(item)
    return kept


def _placed(heatings: list[Heating], temps: tuple[Floats, Floats], *, margin_c: float) -> list[Heating]:
    """Move every start to the row at which the temperature finally leaves its minimum since the last half-cycle's top.

    Before this row the spring rests (or is warmed by its neighbour, or with the room), and the neighbour still cools.
    """
    placed = heatings[:1]
    for before, item in pairwise(heatings):
        own = _without_drift(temps[item.spring][before.top : item.top + 1], margin_c=margin_c)
        low = int(np.flatnonzero(own <= own.min() + margin_c)[-1])
        # At the margin the rise has begun already: go back to its foot, over which a rest may drift by a hundredth of
        # the heating's rate, 1 °C in an hour before 2 °C a minute.
        least_c = 0.01 * float(np.max(np.diff(own[low : low + 2]), initial=0.0))
        while low > 0 and own[low] - own[low - 1] > least_c:
            low -= 1
        placed.append(Heating(item.spring, before.top + low, item.top, item.base_c, item.top_c))
    return placed


def _without_drift(temp_c: Floats, *, margin_c: float) -> Floats:
    """Return a temperature that rests and then rises to its last row (n,), less the drift of its rest.

    The drift is the line from the minimum to the row that lies furthest below the line from the minimum to the top. A
    line that rises by less than the margin does not matter; one that would be warm at the top is a part of the heating.
    """
    row = np.arange(len(temp_c)) - int(np.argmin(temp_c))
    risen = temp_c - np.min(temp_c)
    knee = int(np.argmax(np.where(row > 0, risen[-1] * row / max(row[-1], 1) - risen, 0.0)))
    if row[knee] <= 0 or risen[knee] < margin_c:
        return temp_c
    drift = risen[knee] * row / row[knee]
    return temp_c - drift if drift[-1] < _COLD_SHARE * risen[-1] else temp_c


def _chain(heatings: list[Heating], n: int, *, switched: bool) -> HalfCycles:
    # Warming by the neighbour may have begun earlier: a half-cycle starts after the top of the one before.
    starts = [max(item.start, before.top + 1) for before, item in pairwise(heatings)]
    springs = tuple(item.spring for item in heatings)
    half = np.repeat(np.arange(len(heatings)), np.diff([0, *starts, n]))
    return HalfCycles(np.array(springs, np.int8)[half], half, springs, switched)
