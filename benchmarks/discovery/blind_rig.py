"""The rigs of the blind suite: declared and true values, temperature programmes, and the records made of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from torsight.actuator.spec import ActuatorSpec, actuator_from
from torsight.core.records import SyncedTable, TemperatureLog
from torsight.core.units import DEG
from torsight.synthetic.effects.hidden import HIDDEN, ClockOffset
from torsight.synthetic.effects.mechanisms import HiddenEffect
from torsight.synthetic.effects.rig_laws import RigLaw
from torsight.synthetic.rig.moving_rig import RigRecord, Sensor, Setup, reading_angle, simulate_rig
from torsight.synthetic.rig.protocol import HalfCycle, Protocol
from torsight.synthetic.rig.rig_values import REFERENCE, RigValues, declared_from, draw_values

Array = NDArray[np.float64]

ROOM_C: Final = 23.4
STEP_S: Final = 0.05
EVERY: Final = 5
"""Samples of the rig per row of a record: four rows a second."""
_TURNED_DEG: Final = (3.0, 25.0)


@dataclass(frozen=True, slots=True, eq=False)
class Record:
    """What is handed to the discovery, and what it does not see.

    Attributes
    ----------
    table : SyncedTable
        Four cycles.
    spec : ActuatorSpec
        Declared values.
    later : TemperatureLog
        What was done next, another programme; its angle is the truth as a camera would read it.
    later_angle_rad : (m,) float64
        That truth.
    truth : mapping
        True values under public names, ``zero_deg`` among them.
    sizes_deg : mapping
        What each hidden piece changes in the angle, root mean square.
    shown_deg : mapping
        What of that neither values nor another piece can imitate (:mod:`shown`).
    details : mapping
        Numbers of hidden effects.
    law : RigLaw or None
        The hidden law.
    """

    table: SyncedTable
    spec: ActuatorSpec
    later: TemperatureLog
    later_angle_rad: Array
    truth: Mapping[str, float]
    sizes_deg: Mapping[str, float] = field(default_factory=dict)
    shown_deg: Mapping[str, float] = field(default_factory=dict)
    details: Mapping[str, Mapping[str, object]] = field(default_factory=dict)
    law: RigLaw | None = None


@dataclass(frozen=True, slots=True, eq=False)
class DrawnRig:
    """Everything of a case but what is hidden."""

    declared: Mapping[str, object]
    values: RigValues
    record: Protocol
    later: Protocol
    sensor: Sensor
    angle_noise_deg: float
    zero_deg: float
    seed: int


Hidden = tuple[Mapping[str, Mapping[str, object]], tuple[RigLaw, ...]]
"""Effects by id with their numbers, and laws."""


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw a number whose logarithm is uniform."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def draw_rig(rng: np.random.Generator, *, turned: bool | None) -> DrawnRig:
    """Draw a rig, its programme and its noise; whether its sticks' zero is off, too, where that is not said."""
    tables: dict[str, dict[str, float]] = {name: dict(table) for name, table in REFERENCE.items()}
    material = tables["material"]
    shift_c = rng.uniform(-3.0, 3.0)
    for name in ("A_s_c", "A_f_c", "M_s_c", "M_f_c"):
        material[name] = round(material[name] + shift_c, 1)
    for name, spread in (("E_A_gpa", 0.08), ("E_M_gpa", 0.08), ("E_S_gpa", 0.08), ("theta_cr_deg", 0.06)):
        material[name] = round(material[name] * (1.0 + rng.uniform(-spread, spread)), 2)
    tables["assembly"]["theta_p_deg"] = round(rng.uniform(1000.0, 1150.0))
    tables["friction"]["tau_c_mnm"] = round(rng.uniform(0.5, 1.0), 2)
    declared = declared_from(tables, where="blind suite")
    off = rng.random() < 1.0 / 3.0
    zero_deg = rng.uniform(*_TURNED_DEG) * (1.0 if rng.random() < 0.5 else -1.0)
    prelude = tuple(_half_cycle(rng, s, shift_c, full=rng.random() < 0.6) for s in (0, 1))
    return DrawnRig(
        declared=declared.to_toml(),
        values=draw_values(declared, given={}, rng=rng),
        record=replace(draw_programme(rng, shift_c, cycles=4), prelude=prelude),
        later=draw_programme(rng, shift_c, cycles=2),
        sensor=Sensor(sample_s=STEP_S, noise_c=log_uniform(rng, 0.02, 0.1)),
        angle_noise_deg=log_uniform(rng, 0.02, 0.1),
        zero_deg=zero_deg if (off if turned is None else turned) else 0.0,
        seed=int(rng.integers(2**31)),
    )


def draw_programme(rng: np.random.Generator, shift_c: float, *, cycles: int) -> Protocol:
    """Return cycles at their own rates, one heating in four incomplete, the first cycle whole."""
    halves = tuple(
        _half_cycle(rng, spring, shift_c, full=cycle == 0 or rng.random() < 0.75)
        for cycle in range(cycles)
        for spring in (0, 1)
    )
    return Protocol(halves, 20.0, 1.0, home=False)


def _half_cycle(rng: np.random.Generator, spring: int, shift_c: float, *, full: bool) -> HalfCycle:
    peak_c = shift_c + (rng.uniform(72.0, 80.0) if full else rng.uniform(57.0, 64.0))
    ramp_s = (peak_c - ROOM_C) / log_uniform(rng, 0.1, 0.35)
    reference = np.array([[0.0, np.nan], [ramp_s, peak_c]])
    return HalfCycle(spring, reference, ramp_s + rng.uniform(5.0, 40.0), rng.uniform(200.0, 280.0))


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """A run of record and later programme: film times, angle as read, rig, first sample of the later one."""

    read_rad: Array
    signals: RigRecord
    split: int

    @property
    def angle_deg(self) -> Array:
        """The record's angle row by row, °."""
        return self.read_rad[: self.split : EVERY] / DEG


def run_rig(rig: DrawnRig, hidden: Hidden) -> Run:
    """Run record and later programme in one go, so that what the rig remembers goes on; noise is the same each time."""
    effects, laws = hidden
    made: dict[str, HiddenEffect] = {
        name: HIDDEN[name](**{key: value for key, value in details.items() if key != "wander"})
        for name, details in effects.items()
    }
    whole = replace(rig.record, half_cycles=(*rig.record.half_cycles, *rig.later.half_cycles))
    rng = np.random.default_rng(rig.seed)
    signals = simulate_rig(rig.values, whole, effects=made, laws=laws, setup=Setup(sensor=rig.sensor), rng=rng)
    read_rad = reading_angle(signals.angle_rad, signals.time_s, made, laws) + rig.zero_deg * DEG
    return Run(read_rad, signals, round(rig.record.duration_s / STEP_S))


def temperature_rows(run: Run, details: Mapping[str, Mapping[str, object]]) -> NDArray[np.int64]:
    """Return the sample whose temperatures a merged table shows at each sample: a clock's error moves them."""
    rows = np.arange(len(run.read_rad))
    clock = details.get("clock_offset")
    if clock is None:
        return rows
    plain = ClockOffset(**{key: float(str(value)) for key, value in clock.items() if key != "wander"})
    time_s = run.signals.time_s
    swing = float(str(clock.get("wander", 0.0))) * np.sin(2.0 * np.pi * time_s / time_s[run.split])
    at_s = (time_s - plain.offset_s * (1.0 + swing)) / (1.0 + plain.drift_ppm * 1e-6)
    at: NDArray[np.int64] = np.clip(np.rint(at_s / STEP_S).astype(np.int64), 0, len(rows) - 1)
    return at


def on_log_clock(rig: DrawnRig, hidden: Hidden) -> Array:
    """Return the record's angle, °, beside the temperatures that the merged table shows: a clock's error moves it."""
    run = run_rig(rig, hidden)
    rows = np.arange(0, run.split, EVERY)
    moved = np.clip(2 * rows - temperature_rows(run, hidden[0])[rows], 0, len(run.read_rad) - 1)
    angle_deg: Array = run.read_rad[moved] / DEG
    return angle_deg


def seen(run: Run, rig: DrawnRig, details: Mapping[str, Mapping[str, object]]) -> Record:
    """Return the merged table of a run and the later log with the true angle; a clock's error stays in the table."""
    rng = np.random.default_rng(rig.seed + 1)
    signals, rows = run.signals, np.arange(0, run.split, EVERY)
    logged = temperature_rows(run, details)
    table = SyncedTable(
        time_s=signals.time_s[rows],
        angle_rad=run.read_rad[rows] + rig.angle_noise_deg * DEG * rng.standard_normal(len(rows)),
        angle_sigma_rad=np.full(len(rows), rig.angle_noise_deg * DEG),
        temp_a_c=signals.temp_a_c[logged[rows]],
        temp_b_c=signals.temp_b_c[logged[rows]],
    )
    # What comes later is on the log's own clock, as predictions are.
    tail = np.arange(run.split, len(run.read_rad), EVERY)
    later = TemperatureLog(
        time_s=signals.time_s[tail] - signals.time_s[tail[0]],
        temp_a_c=signals.temp_a_c[tail],
        temp_b_c=signals.temp_b_c[tail],
    )
    spec = actuator_from(rig.declared, where="blind suite")
    truth = {**rig.values.public, "zero_deg": rig.zero_deg}
    return Record(table, spec, later, run.read_rad[tail], truth)
