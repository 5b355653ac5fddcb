"""Temperature programmes that an experimenter can carry out on the actuator, and the logs that they would give.

A programme is a chain of half-cycles. In each of them one spring is driven through legs (a temperature, the rate to get
there, a hold) and then cools freely. How fast the spring cools, and how far the other spring follows, is estimated from
the given record: dT/dt = −α (T − T_room) + κ (T_other − T) for each of the two wires.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from torsight.actuator.drive import Drive
from torsight.actuator.record.conditioning import Readings
from torsight.actuator.record.segments import HalfCycles, turn_of
from torsight.actuator.record.sensors import Sensors
from torsight.actuator.record.slow_log import SLOW_S
from torsight.actuator.record.turns import turns_of
from torsight.core.units import Floats, Ints

STEP_S: Final = 0.5 * SLOW_S
"""Time between rows of a planned log: half the longest at which a record's corners are still resolved."""
_MEASURED_ROUNDING_S: Final = (0.5, 20.0)
"""Bounds of the time constant with which a wire's free cooling begins, as estimated from a record: a row of the plan,
and half the time that a wire takes to cool (45 s); a heater that fades for longer is another programme."""


@dataclass(frozen=True, slots=True)
class Leg:
    """Drive a spring to a temperature at a rate, and hold it there."""

    to_c: float
    rate_c_per_s: float
    hold_s: float = 0.0


@dataclass(frozen=True, slots=True)
class HalfCyclePlan:
    """Heating and cooling of one spring: words after 'heat a spring', legs, and the time of cooling after them."""

    words: str
    legs: tuple[Leg, ...]
    cool_s: float

    @property
    def top_c(self) -> float:
        """Highest temperature of the half-cycle."""
        return max(leg.to_c for leg in self.legs)


@dataclass(frozen=True, slots=True)
class Heat:
    """Thermal model of both springs and their sensors, estimated from the given record.

    It consists of the losses to the room and to the other spring, the room's temperature, and the time constant with
    which a reading follows a corner.
    """

    to_room_per_s: float
    between_per_s: float
    room_c: float
    rounding_s: float

    @classmethod
    def of(cls, drive: Drive) -> Heat:
        """Estimate the model: the loss from the driven spring's cooling, the exchange from the other spring's rate."""
        active, passive = drive.temps_by_role()
        active_rate, passive_rate = drive.rates_by_role()
        falling = (active_rate < -0.02) & (active > drive.room_c + 0.2 * np.ptp(active))
        above, apart = active - drive.room_c, active - passive
        to_room, between = 0.02, 0.0
        for _ in range(3 if falling.any() else 1):
            if falling.any():
                loss = -(active_rate[falling] + between * apart[falling]) / above[falling]
                to_room = float(np.clip(np.median(loss), 1e-3, 0.2))
            gained = passive_rate + to_room * (passive - drive.room_c)
            between = float(np.clip(apart @ gained / max(float(apart @ apart), 1e-9), 0.0, 0.05))
        return cls(to_room, between, drive.room_c, _rounding_s(drive, to_room))

    def cooling_s(self, from_c: float, to_c: float) -> float:
        """Return the time that a wire takes to cool freely, s."""
        return math.log(max(from_c - self.room_c, 1.0) / max(to_c - self.room_c, 0.5)) / self.to_room_per_s


def _rounding_s(drive: Drive, to_room_per_s: float) -> float:
    """Return the time constant τ of the corners at which a driven spring's reading turns from rising to falling.

    The wire's temperature falls immediately at the rate of its loss of heat. Behind a first-order sensor the slope goes
    from a tenth to half of that rate in τ ln (0.9 / 0.5).
    """
    found = []
    for _, rows, temp, rate in drive.half_cycles():
        top = int(np.argmax(temp))
        time_s = drive.time_s[rows] - drive.time_s[rows][top]
        free = -to_room_per_s * (float(temp[top]) - drive.room_c)
        ends = np.flatnonzero((time_s > -30.0) & (time_s < 60.0) & (rate <= 0.5 * free))
        if top < 5 or free > -0.05 or not len(ends):
            continue
        before = np.flatnonzero(rate[: ends[0]] >= 0.1 * free)
        if len(before):
            found.append((time_s[ends[0]] - time_s[before[-1]]) / math.log(0.9 / 0.5))
    return float(np.clip(np.median(found) if found else 1.0, *_MEASURED_ROUNDING_S))


@dataclass(frozen=True, slots=True)
class Programme:
    """Half-cycles in order, A first and then in turn, each with its plan."""

    half_cycles: tuple[HalfCyclePlan, ...]

    def completes(self, full_c: float) -> bool:
        """Return whether each spring is heated fully at least once, as the reference of all incomplete heatings."""
        return all(any(plan.top_c >= full_c for plan in self.half_cycles[spring::2]) for spring in (0, 1))

    def play(self, heat: Heat) -> Played:
        """Return the readings of both springs under the programme, with corners rounded by the sensors."""
        wires, segments = _Wires(heat), []
        # The film first shows the angle of the unheated actuator, for 20 s.
        wires.lead(0, [None] * round(20.0 / STEP_S))
        for number, plan in enumerate(self.half_cycles):
            for leg in (*plan.legs, None):
                start_c, change_c, hold = wires.temps_c[number % 2][-1], 0.0, 0
                wanted: list[float | None] = [None] * max(1, round(plan.cool_s / STEP_S))
                if leg is not None:
                    change_c, hold = leg.to_c - start_c, round(leg.hold_s / STEP_S)
                    ramp = max(1, round(abs(change_c) / leg.rate_c_per_s / STEP_S))
                    wanted = [start_c + change_c * min(1.0, k / ramp) for k in range(1, ramp + hold + 1)]
                wires.lead(number, wanted)
                segments.append(
                    {
                        "spring": "ab"[number % 2],
                        "action": "cool" if leg is None else "heat" if change_c > 0.0 else "lead down",
                        "from_c": round(start_c, 1),
                        "to_c": round(wires.temps_c[number % 2][-1] if leg is None else leg.to_c, 1),
                        "rate_c_per_s": None if leg is None else round(math.copysign(leg.rate_c_per_s, change_c), 3),
                        "hold_s": STEP_S * hold,
                        "duration_s": STEP_S * len(wanted),
                    }
                )
        keep = math.exp(-STEP_S / heat.rounding_s)
        a_c, b_c = (_followed(np.array(one), keep) for one in wires.temps_c)
        time_s = STEP_S * np.arange(len(wires.driven), dtype=np.float64)
        driven, half = np.array(wires.driven, np.int8), np.array(wires.half, np.int64)
        return Played(time_s, a_c, b_c, driven, half, tuple(segments), heat.room_c)


@dataclass(frozen=True, slots=True, eq=False)
class Played:
    """A programme sample by sample: readings of both sensors (n,).

    ``driven`` is the spring that is switched on (0 A, 1 B, −1 none), ``half`` the number of the half-cycle,
    ``segments`` are as in ``discovery.json``.
    """

    time_s: Floats
    temp_a_c: Floats
    temp_b_c: Floats
    driven: NDArray[np.int8]
    half: Ints
    segments: tuple[Mapping[str, Any], ...]
    room_c: float

    def drive(self, *, start_angle_rad: float) -> Drive:
        """Return the programme as a drive without measured angles; exact readings need no conditioning."""
        n = len(self.time_s)
        rates = (np.gradient(self.temp_a_c, self.time_s), np.gradient(self.temp_b_c, self.time_s))
        springs = tuple(number % 2 for number in range(int(self.half[-1]) + 1))
        unknown, temps_c, least_c = np.full(n, np.nan), (self.temp_a_c, self.temp_b_c), turn_of(0.0)
        step_s = float(np.median(np.diff(self.time_s)))
        exact_a, exact_b = (Readings(self.time_s, temp_c, 0.0, 1.0, step_s, 0.0) for temp_c in temps_c)
        return Drive(
            time_s=self.time_s,
            temp_a_c=self.temp_a_c,
            temp_b_c=self.temp_b_c,
            rate_a_c_s=rates[0],
            rate_b_c_s=rates[1],
            temp_sigma_c=np.zeros(n),
            peaks_a_c=np.zeros(n),
            peaks_b_c=np.zeros(n),
            noise_c=0.0,
            reading_s=step_s,
            cycles=HalfCycles((self.half % 2).astype(np.int8), self.half, springs),
            angle_rad=unknown,
            angle_sigma_rad=unknown,
            start_angle_rad=start_angle_rad,
            room_c=self.room_c,
            known=np.ones(n, bool),
            sensors=_ExactSensors(
                self.time_s, (exact_a, exact_b), np.arange(n), temps_c, np.zeros(n), least_c, (0.0, 0.0)
            ),
            turning=(turns_of(self.temp_a_c, least_c), turns_of(self.temp_b_c, least_c)),
        )


class _ExactSensors(Sensors):
    """Readings without noise: a lag τ hides τ dT/dt of the wire's temperature."""

    def lag_correction(self, spring: int, lag_s: float) -> Floats:
        """Return the difference of a wire's temperature from its sensor's."""
        return np.asarray(lag_s * np.gradient(self.driven_c[spring], self.time_s))


class _Wires:
    """Temperatures of two wires step by step, the spring that is switched on (−1: none), and the half-cycle."""

    def __init__(self, heat: Heat) -> None:
        self._heat = heat
        self.temps_c: tuple[list[float], list[float]] = [heat.room_c], [heat.room_c]
        self.driven, self.half = [-1], [0]

    def lead(self, number: int, wanted_c: Sequence[float | None]) -> None:
        """Drive the wire of a half-cycle along a course of temperatures, one per step; None: not heated."""
        heat = self._heat
        for wanted in wanted_c:
            last = self.temps_c[0][-1], self.temps_c[1][-1]
            for spring, (own, other) in enumerate((last, last[::-1])):
                rate = heat.to_room_per_s * (heat.room_c - own) + heat.between_per_s * (other - own)
                free_c = own + STEP_S * rate
                # A heater can only heat: it cannot make a wire cool faster than freely.
                led = spring == number % 2 and wanted is not None
                self.temps_c[spring].append(max(wanted, free_c) if led and wanted is not None else free_c)
            self.driven.append(-1 if wanted is None else number % 2)
            self.half.append(number)


def _followed(values: Floats, keep: float) -> Floats:
    """Return the readings of a first-order sensor that starts in equilibrium."""
    # Imported only where an experiment is planned: it takes half a second.
    from scipy.signal import lfilter

    read, _ = lfilter([1.0 - keep], [1.0, -keep], values, zi=[keep * values[0]])
    return read.astype(np.float64)  # type: ignore[no-any-return]
