"""Half-cycles of a record: which spring is driven when.

A half-cycle is the heating and cooling of one spring. It lasts until the other spring starts to be heated, or the same
one again after it has cooled. The log's heating switches decide where it has them, else the temperatures: the driven
spring is the hotter one at the top of a rise, and warming by its neighbour is no drive.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from torsight.core.errors import InputError, NoResultError
from torsight.core.series import APART, BY_CHANCE, extremes, runs, scatter
from torsight.core.units import DEG, Flags, Floats, Ints

# benchmarks/actuator/half_cycles.py measures what half and twice of these constants do: no half-cycle's spring changes,
# and no start but those that are named.
_TURN_C: Final = 1.0
_RISE_C: Final = 4.0
"""By how much a temperature goes back where it turns, and rises where its spring is heated; more where it is noisy."""
_LIFT_C: Final = 0.25
"""How far above its rest a temperature is when its heating has begun. Starts of 95 half-cycles in 100 are within 4.9 s,
within 4.2 s with half of it and 8.5 s with twice of it."""
_BEFORE_S: Final = 40.0
"""A heating that is not seen in the temperature after so long would not be one. With half of it a jump is passed over
in one of 25 half-cycles that have one."""
_JUMP_S: Final = 2.0
_JUMP_RAD: Final = 0.4 * DEG
"""What the angle moves by within two seconds is a jump from so much, or so many sigmas of its noise."""
_STILL_SHARE: Final = 0.25
"""Share of the jump by which a rest may move before it."""
_REST_ROWS: Final = 4
_COLD_SHARE: Final = 0.2
"""Share of its heating below which a spring no longer moves by itself: it has cooled."""


def turn_of(noise_c: float) -> float:
    """Return by how much the temperature goes back where it turns, °C."""
    return max(_TURN_C, APART * noise_c)


@dataclass(frozen=True, slots=True)
class Heating:
    """One rise of one spring's temperature: spring (0 A, 1 B), rows of its start and top, the start's temperature."""

    spring: int
    start: int
    top: int
    base_c: float
    top_c: float


def by_role(active: NDArray[np.int8], of_a: Floats, of_b: Floats) -> tuple[Floats, Floats]:
    """Return what belongs to the spring that is driven in each row, and what belongs to the other one."""
    is_a = active == 0
    return np.where(is_a, of_a, of_b), np.where(is_a, of_b, of_a)


@dataclass(frozen=True, slots=True, eq=False)
class HalfCycles:
    """The chain of half-cycles of a record: which spring is driven in each row (n,; 0 A, 1 B), and in which half-cycle.

    ``springs`` are the driven ones of each half-cycle; ``switched`` says whether the log's heating switches told the
    starts.
    """

    active: NDArray[np.int8]
    half: Ints
    springs: tuple[int, ...]
    switched: bool = False

    def counts(self) -> Ints:
        """Return, for each half-cycle, how often its spring had been heated before."""
        seen = [0, 0]
        out = []
        for spring in self.springs:
            out.append(seen[spring])
            seen[spring] += 1
        return np.array(out, np.int64)


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

    Raises
    ------
    InputError
        When both springs are heated, but only together.
    NoResultError
        When neither spring is ever heated.
    """
    temps = (temp_a_c, temp_b_c)
    switched = False
    if heat_a is not None and heat_b is not None and (heat_a.any() or heat_b.any()):
        heatings, switched = _switched(temps, (heat_a, heat_b)), True
    else:
        heatings = _driven(temps, rise_c=max(_RISE_C, 2.0 * BY_CHANCE * noise_c), turn_c=turn_of(noise_c))
    if not any(item.top_c - item.base_c >= _RISE_C for item in heatings):
        raise _unheated(temps, where=where)
    chained = _merged(heatings, temps)
    if not switched:
        chained = _placed(chained, temps, margin_c=max(_LIFT_C, BY_CHANCE * noise_c))
    return _chain(chained, len(temp_a_c), switched=switched)


def begun_with_a_jump(
    cycles: HalfCycles, time_s: Floats, angle_rad: Floats, temps_c: tuple[Floats, Floats]
) -> HalfCycles:
    """Begin half-cycles where the angle jumps out of a rest shortly before the temperature shows that heat is on.

    A sensor shows heat some seconds after the switch. The plain rig stands still until the wire is hot; where torques
    shift as soon as one spring is switched for the other, the angle tells the switch better. While the last one is
    still warm, a jump is its own return.
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
    """Return the row at which an angle jumps out of a rest; None where it does not."""
    if len(time_s) < 2 * _REST_ROWS:
        return None
    noise = scatter(angle_rad, order=1)
    least = max(_JUMP_RAD, APART * noise)
    later = np.searchsorted(time_s, time_s + _JUMP_S, side="right") - 1
    way = np.abs(angle_rad[later] - angle_rad)
    quick = np.flatnonzero(way >= least)
    if len(quick) == 0 or quick[0] < _REST_ROWS:
        return None
    rest, after = np.split(angle_rad, quick[:1])
    if float(np.ptp(rest)) > _STILL_SHARE * way.max() + APART * noise:
        return None
    return len(rest) + int(np.argmax(np.abs(after - np.median(rest)) > 0.5 * least))


def _unheated(temps: tuple[Floats, Floats], *, where: str) -> InputError | NoResultError:
    """Return what to say of a record in which no spring is driven on its own."""
    span = [float(np.max(t) - np.min(t)) for t in temps]
    value = f"temperatures that change by {span[0]:.1f} °C (A) and {span[1]:.1f} °C (B)"
    if min(span) >= _RISE_C:
        return InputError(
            "both springs are heated at once, and none on its own",
            where=where,
            value=value,
            limit=f"a rise of {_RISE_C:g} °C or more of one spring over the other",
            do="heat one spring at a time, or check that the two temperature columns are two sensors",
        )
    return NoResultError(
        "neither spring is heated",
        where=where,
        value=value,
        limit=f"a rise of {_RISE_C:g} °C or more of the driven spring over the other",
        do="record at least one heating and cooling",
    )


def _switched(temps: tuple[Floats, Floats], heat: tuple[Flags, Flags]) -> list[Heating]:
    """Return the stretches in which one switch is on."""
    found = []
    for spring in (0, 1):
        for start, end in runs(heat[spring] & ~heat[1 - spring]):
            top = start + int(np.argmax(temps[spring][start:end]))
            found.append(Heating(spring, start, top, float(temps[spring][start]), float(temps[spring][top])))
    return sorted(found, key=lambda item: item.start)


def _driven(temps: tuple[Floats, Floats], *, rise_c: float, turn_c: float) -> list[Heating]:
    """Return the rises of either spring that its own heating made."""
    found: list[Heating] = []
    for spring in (0, 1):
        own, other = temps[spring], temps[1 - spring]
        for start, top in pairwise(extremes(own, turn_c)):
            rise = own[top] - own[start]
            if rise >= rise_c and own[top] > other[top] and rise > other[top] - other[start]:
                found.append(Heating(spring, start, top, float(own[start]), float(own[top])))
    return sorted(found, key=lambda item: item.top)


def _merged(heatings: list[Heating], temps: tuple[Floats, Floats]) -> list[Heating]:
    """Join rises of one spring between which it has not cooled: holds, pauses, partial reheats."""
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
    """Move every start to where the temperature leaves its lowest for good, after the last half-cycle's top.

    Before that the spring rests (or is warmed by its neighbour), and the neighbour still cools.
    """
    placed = heatings[:1]
    for before, item in pairwise(heatings):
        own = temps[item.spring][before.top : item.top + 1]
        low = int(np.flatnonzero(own <= own.min() + margin_c)[-1])
        # Within the margin the rise has begun already: back to its foot.
        while low > 0 and own[low - 1] < own[low]:
            low -= 1
        placed.append(Heating(item.spring, before.top + low, item.top, item.base_c, item.top_c))
    return placed


def _chain(heatings: list[Heating], n: int, *, switched: bool) -> HalfCycles:
    active, half = np.empty(n, np.int8), np.empty(n, np.int64)
    starts = [0]
    for before, item in pairwise(heatings):
        # Warming by the neighbour may have begun before: a half-cycle starts after the last one's top.
        starts.append(max(item.start, before.top + 1))
    bounds = [*starts, n]
    for number, item in enumerate(heatings):
        active[bounds[number] : bounds[number + 1]] = item.spring
        half[bounds[number] : bounds[number + 1]] = number
    return HalfCycles(active, half, tuple(item.spring for item in heatings), switched)
