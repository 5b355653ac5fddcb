"""Protocol of the rig: half-cycles of heating and cooling, as commands and references sample by sample."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from torsight.core.errors import ConfigError
from torsight.core.files.config import get_number, get_tables, get_text
from torsight.core.files.storage import check_keys
from torsight.core.units import Floats, Ints
from torsight.synthetic.keys import key, read_section


@dataclass(frozen=True, slots=True)
class Timing:
    """Section [protocol]: the pace, and how often; the half-cycles are a list of their own."""

    time_factor: float = key(
        1.0, "scales every duration and the rig's heat capacities; 1 is the paper's pace", lower=1e-3, upper=100.0
    )
    repeat: int = key(1, "how often the list of half-cycles is run", lower=1, upper=1000)
    rest_s: float = key(20.0, "rest before the first half-cycle", lower=0.0, upper=1e5)
    home: bool = key(default=True, text="heat and cool both springs before the record, as in the paper's homing")


@dataclass(frozen=True, slots=True)
class HalfCycle:
    """One spring (0 A, 1 B) heated to a reference and left to cool, with the times switched on and off.

    The reference (n, 2) holds times since switching on, s, and temperatures, °C, joined by lines; a NaN at time 0
    stands for the reading at that moment.
    """

    spring: int
    reference: Floats
    heat_s: float
    cool_s: float


@dataclass(frozen=True, slots=True)
class Protocol:
    """All half-cycles in order, with their real durations; a prelude replaces the homing before the record."""

    half_cycles: tuple[HalfCycle, ...]
    rest_s: float
    time_factor: float
    home: bool
    prelude: tuple[HalfCycle, ...] = ()

    @property
    def duration_s(self) -> float:
        """Time from the first rest to the end of the last cooling."""
        return self.rest_s + sum(item.heat_s + item.cool_s for item in self.half_cycles)


@dataclass(frozen=True, slots=True, eq=False)
class Commands:
    """The protocol sample by sample (n,).

    It holds the commands (0 rest, 1 or 2 spring A or B on, −1 or −2 its cooling), the temperature reference where a
    spring is on, the number of earlier heatings of this spring, and the number of the half-cycle, −1 during homing and
    the first rest. ``recorded`` is the first sample of the record, after homing.
    """

    command: Ints
    reference_c: Floats
    cycle: Floats
    half_cycle: Ints
    recorded: int


_HALF_CYCLE: Final = ("spring", "peak_c", "ramp_s", "heat_s", "cool_s", "points")
_PAPER: Final = ({"spring": "a"}, {"spring": "b"})


def read_protocol(table: Mapping[str, Any], *, where: str) -> Protocol:
    """Read the table [protocol]; without half-cycles those of the paper are used: A, then B.

    A half-cycle has ``spring`` ("a" or "b"), ``peak_c``, ``ramp_s`` (time to reach it), ``heat_s`` (time switched on,
    600) and ``cool_s`` (300); ``points`` = [[s, °C], …] replaces peak and ramp by any reference. All times are
    multiplied by the time factor.

    Raises ConfigError for an unknown key, a value out of range, or points that do not increase in time.
    """
    place = f"{where}, [protocol]"
    check_keys(table, ("time_factor", "repeat", "rest_s", "home", "half_cycle"), where=place)
    timing = read_section(Timing, {name: table[name] for name in table if name != "half_cycle"}, where=place)
    given = get_tables({"half_cycle": _PAPER, **table}, "half_cycle", where=f"{where}, [protocol]", required=True)
    items = [_half_cycle(item, timing, where=spot) for item, spot in given]
    return Protocol(
        half_cycles=tuple(items) * timing.repeat,
        rest_s=timing.rest_s * timing.time_factor,
        time_factor=timing.time_factor,
        home=timing.home,
    )


def _half_cycle(table: Mapping[str, Any], timing: Timing, *, where: str) -> HalfCycle:
    check_keys(table, _HALF_CYCLE, where=where)
    spring = get_text(table, "spring", where=where, choices=("a", "b"))
    heat_s = get_number(table, "heat_s", where=where, default=600.0, lower=1e-3)
    cool_s = get_number(table, "cool_s", where=where, default=300.0, lower=1e-3)
    if "points" in table:
        points = _points(table["points"], where=where)
    else:
        ramp_s = get_number(table, "ramp_s", where=where, default=heat_s * 5.0 / 6.0, lower=1e-3)
        peak_c = get_number(table, "peak_c", where=where, default=80.0, lower=-50.0, upper=300.0)
        points = np.array([[0.0, np.nan], [ramp_s, peak_c]])
    scaled = points * np.array([timing.time_factor, 1.0])
    factor = timing.time_factor
    return HalfCycle(spring="ab".index(spring), reference=scaled, heat_s=heat_s * factor, cool_s=cool_s * factor)


def _points(value: Any, *, where: str) -> Floats:
    try:
        points = np.array(value, np.float64)
    except (TypeError, ValueError):
        points = np.empty(0)
    if points.ndim != 2 or points.shape[1] != 2 or not np.all(np.isfinite(points)):
        raise ConfigError("'points' is not a list of pairs", where=where, value=repr(value), limit="[[s, °C], …]")
    if np.any(np.diff(points[:, 0]) <= 0) or points[0, 0] < 0:
        raise ConfigError("times in 'points' do not increase", where=where, value=repr(value))
    if points[0, 0] > 0.0:
        points = np.vstack([[0.0, np.nan], points])
    return points


def homing(time_factor: float) -> tuple[HalfCycle, HalfCycle]:
    """Return the half-cycles that bring the rig to its home: A, then B, fully heated and cooled at the paper's pace."""
    reference = np.array([[0.0, np.nan], [500.0 * time_factor, 95.0]])
    return tuple(HalfCycle(spring, reference, 600.0 * time_factor, 450.0 * time_factor) for spring in (0, 1))  # type: ignore[return-value]


def commands(protocol: Protocol, *, sample_s: float, room_c: float, before_s: float, after_s: float) -> Commands:
    """Return the commands, one per sample of the controller, with a rest before and after the protocol.

    A ramp without a first point starts at the room's temperature.
    """
    parts: list[tuple[int, float, HalfCycle | None, int, int]] = []
    before = protocol.prelude or (homing(protocol.time_factor) if protocol.home else ())
    for item in before:
        parts += [(1 + item.spring, item.heat_s, item, 0, -1), (-1 - item.spring, item.cool_s, None, 0, -1)]
    recorded = sum(round(part[1] / sample_s) for part in parts)
    parts.append((-1 - before[-1].spring if before else 0, before_s + protocol.rest_s, None, 0, -1))
    count = [0, 0]
    for number, item in enumerate(protocol.half_cycles):
        cycle = count[item.spring]
        count[item.spring] += 1
        parts.append((1 + item.spring, item.heat_s, item, cycle, number))
        parts.append((-1 - item.spring, item.cool_s, None, cycle, number))
    last = parts[-1]
    parts.append((last[0], after_s, None, last[3], last[4]))
    samples = [round(part[1] / sample_s) for part in parts]
    references = []
    for (_, _, heated, _, _), size in zip(parts, samples, strict=True):
        points = np.array([[0.0, np.nan]]) if heated is None else heated.reference
        time_s, temp_c = np.where(np.isnan(points), room_c, points).T
        references.append(np.interp(np.arange(size) * sample_s, time_s, temp_c))
    orders, cycles, half_cycles = (np.repeat([part[place] for part in parts], samples) for place in (0, 3, 4))
    return Commands(orders, np.concatenate(references), cycles.astype(np.float64), half_cycles, recorded)
