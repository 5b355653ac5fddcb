"""The half-cycles of which programmes consist: within the range of the given record, and in words."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from torsight.actuator.drive import Drive
from torsight.core.units import Floats
from torsight.discovery.design.programme import HalfCyclePlan, Heat, Leg, Programme


@dataclass(frozen=True, slots=True)
class Habits:
    """Rates and temperatures of the given record, near which the programmes stay.

    The usual and the highest rate of a half-cycle's heating while it transforms the spring, the highest temperature,
    and the temperatures at which a quarter (onset) and a half (middle) of a heating's transformation are done.
    """

    rate_c_per_s: float
    fastest_c_per_s: float
    full_c: float
    onset_c: float
    middle_c: float

    @classmethod
    def of(cls, drive: Drive, fractions: tuple[Floats, Floats]) -> Habits:
        """Estimate the habits from a record and from the martensite fractions of A and B in its model."""
        rates: list[float] = []
        tops: list[float] = []
        onsets: list[float] = []
        middles: list[float] = []
        for spring, rows, temp, slope in drive.half_cycles():
            top = int(np.argmax(temp))
            if top < 5:
                continue
            fraction = fractions[spring][rows][: top + 1]
            rate = slope[: top + 1][(fraction < 1.0) & (temp[: top + 1] < temp[top] - 2.0)]
            rates.append(float(np.median(rate)) if len(rate) else 0.1)
            tops.append(float(temp[top]))
            for level, found in ((0.75, onsets), (0.5, middles)):
                if fraction.min() < level < fraction.max():
                    found.append(float(temp[np.argmax(fraction < level)]))
        full_c = max(tops, default=75.0)
        middle_c = float(np.median(middles)) if middles else full_c - 15.0
        onset_c = float(np.median(onsets)) if onsets else middle_c - 4.0
        usual = max(float(np.median(rates)) if rates else 0.1, 0.02)
        return cls(usual, max([usual, *rates]), full_c, onset_c, middle_c)


def menu(habits: Habits, heat: Heat) -> Mapping[str, HalfCyclePlan]:
    """Return the half-cycles of which programmes consist, by a short name."""
    usual, full_c, middle_c = habits.rate_c_per_s, habits.full_c, habits.middle_c
    slow, fast = min(usual, max(usual / 3.0, 0.03)), min(2.5 * habits.fastest_c_per_s, 0.8)
    cold_s = min(heat.cooling_s(full_c, heat.room_c + 4.0), 900.0)
    warm_s = heat.cooling_s(full_c, heat.room_c + 18.0)

    def plan(words: str, *legs: Leg, cool_s: float = cold_s) -> HalfCyclePlan:
        return HalfCyclePlan(words, legs, cool_s)

    steps_c = np.linspace(habits.onset_c - 4.0, full_c, 6)
    return {
        "usual": plan(f"at {usual:.2g} °C/s to {full_c:.0f} °C", Leg(full_c, usual, 20.0)),
        "slow": plan(f"slowly, at {slow:.2g} °C/s, to {full_c:.0f} °C", Leg(full_c, slow, 20.0)),
        "fast": plan(f"fast, at {fast:.2g} °C/s, to {full_c:.0f} °C", Leg(full_c, fast, 20.0)),
        "hold in the middle": plan(
            f"at {usual:.2g} °C/s to {middle_c:.0f} °C, hold it there for 2 min, go on to {full_c:.0f} °C",
            Leg(middle_c, usual, 120.0),
            Leg(full_c, usual, 20.0),
        ),
        "fast, hold in the middle": plan(
            f"fast, at {fast:.2g} °C/s, to {middle_c:.0f} °C, hold it there for 2 min, go on to {full_c:.0f} °C",
            Leg(middle_c, fast, 120.0),
            Leg(full_c, fast, 20.0),
        ),
        "partial": plan(f"at {usual:.2g} °C/s to {middle_c:.0f} °C only", Leg(middle_c, usual)),
        "partial, fast": plan(f"fast, at {fast:.2g} °C/s, to {middle_c + 3.0:.0f} °C only", Leg(middle_c + 3.0, fast)),
        "partial, held": plan(
            f"at {usual:.2g} °C/s to {middle_c:.0f} °C only, and hold it there for 3 min", Leg(middle_c, usual, 180.0)
        ),
        "stairs": plan(
            f"in steps of a minute, {', '.join(f'{c:.0f}' for c in steps_c)} °C",
            *(Leg(float(c), fast, 60.0) for c in steps_c),
        ),
        "hot hold": plan(
            f"at {usual:.2g} °C/s to {full_c:.0f} °C and hold it there for 5 min", Leg(full_c, usual, 300.0)
        ),
        "slow cooling": plan(
            f"at {usual:.2g} °C/s to {full_c:.0f} °C and lead it down again at {slow:.2g} °C/s",
            Leg(full_c, usual, 20.0),
            Leg(heat.room_c + 15.0, slow),
        ),
        "warm neighbour": plan(
            f"at {usual:.2g} °C/s to {full_c:.0f} °C, and heat the other one before it has cooled",
            Leg(full_c, usual, 20.0),
            cool_s=warm_s,
        ),
        "long rest": plan(
            f"at {usual:.2g} °C/s to {full_c:.0f} °C and then rest for {2.5 * cold_s / 60.0:.0f} min",
            Leg(full_c, usual, 20.0),
            cool_s=2.5 * cold_s,
        ),
    }


def in_words(programme: Programme) -> str:
    """Return a programme as part of a sentence; equal cycles in a row are named once, with their number."""
    plans = programme.half_cycles
    cycles = (plans[first : first + 2] for first in range(0, len(plans), 2))
    return "; then ".join(_cycle_in_words(cycle, len(list(same))) for cycle, same in itertools.groupby(cycles))


def _cycle_in_words(cycle: Sequence[HalfCyclePlan], count: int) -> str:
    times = {1: "once", 2: "twice"}.get(count, f"{count} times")
    if len(set(cycle)) == 1:
        return f"heat A, then B, {cycle[0].words} ({times} each)"
    each = ", and ".join(f"{name} {plan.words}" for name, plan in zip("AB", cycle, strict=False))
    return f"heat {each} ({times})"
