"""Cases whose missing piece has no form of the library: laws drawn at random, effects in another usual form, pairs.

Every case is a seed. From it come the declared rig, its true values (each off by its declared uncertainty), where the
sticks' zero is, how the springs were wound before the record, the programme of four cycles (rates, tops, incomplete
heatings) and another one for the later record, the noise, and what is hidden. A law's or an effect's strength is found
by running the rig with and without it until it changes the angle by the wanted size (root mean square). 300 cases for
work and 300 that are looked at for a report only: 100 clean, 100 laws, 50 forms, 50 pairs each.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Final, NamedTuple

import numpy as np
from cases import LIBRARY, Draw
from numpy.typing import NDArray

from torsight.actuator.spec import ActuatorSpec, actuator_from
from torsight.core.records import SyncedTable, TemperatureLog
from torsight.core.units import DEG, MNM
from torsight.synthetic.hidden import HIDDEN, ClockOffset, HiddenEffect
from torsight.synthetic.laws import RigLaw, draw_law, factor_for
from torsight.synthetic.protocol import HalfCycle, Protocol
from torsight.synthetic.rig import RigRecord, Sensor, reading_angle, simulate_rig
from torsight.synthetic.values import REFERENCE, RigValues, declared_from, draw_values

Array = NDArray[np.float64]
Key = tuple[str, str]

FIRST_SEED: Final = {"work": 100_000, "report": 200_000}
COUNTS: Final = {"clean": 100, "law": 100, "form": 50, "pair": 50}
ROOM_C: Final = 23.4
_STEP_S: Final = 0.05
_EVERY: Final = 5
_SIZE_DEG: Final = (0.3, 10.0)
_WITHIN: Final = 0.1
_TURNED_DEG: Final = 25.0


class Place(NamedTuple):
    """Where a hidden law acts, as an answer may say it; names that are members of the same family; springs.

    ``steepest`` bounds the slope in units of the driver as the rig has it, ``most`` the size.
    """

    ports: tuple[str, ...]
    drivers: tuple[str, ...]
    names: tuple[str, ...]
    most: float
    springs: tuple[str, ...] = ("both",)


PLACES: Final[Mapping[Key, Place]] = {
    ("torque", "angle"): Place(
        ("torque",), ("angle_deg",), ("gravity", "stray_torque", "local_torque", "end_stop", "end_stops"), 1.0 * MNM
    ),
    ("friction", "angle"): Place(("friction",), ("angle_deg",), ("position_friction",), 0.85),
    ("friction", "temperature"): Place(("friction",), ("temp_active_c",), ("warm_friction",), 0.85),
    ("friction", "rate"): Place(("friction",), ("angle_rate_deg_s",), ("viscous_friction",), 4.0),
    ("friction", "dwell"): Place(("friction",), ("dwell_s",), ("static_friction",), 4.0),
    ("reading", "angle"): Place(("reading",), ("angle_deg",), ("eccentricity",), 30.0 * DEG),
    ("reading", "time"): Place(("reading",), ("time_s",), ("reading_drift",), 30.0 * DEG),
    ("temperature", "temperature"): Place(
        ("temperature",),
        ("temp_active_c", "temp_passive_c", "temp_c"),
        ("sensor_gain", "thermistor_curve"),
        6.0,
        ("a", "b", "both"),
    ),
    ("temperature", "temp_rate"): Place(
        ("temperature",), ("temp_rate_c_s",), ("sensor_lag",), 12.0, ("a", "b", "both")
    ),
    ("winding", "winding"): Place(("winding",), ("winding_deg",), ("stiffening",), 1.0 * MNM, ("a", "b", "both")),
    ("loading", "winding"): Place(
        ("loading", "winding"), ("winding_deg",), ("stiffening",), 1.0 * MNM, ("a", "b", "both")
    ),
    ("recoverable", "half_cycle"): Place(
        ("recoverable", "winding", "phase"), ("half_cycle", "cycle"), ("fatigue",), 0.4
    ),
    ("recoverable", "cycle"): Place(("recoverable", "winding", "phase"), ("cycle", "half_cycle"), ("fatigue",), 0.4),
    ("values", "spring"): Place(("values",), ("spring",), ("unlike_springs", "spring_values"), 1.0),
}
"""Where random laws act, by the rig's port and driver."""

_STEEPEST: Final = {
    ("temperature", "temperature"): 0.6,
    # Of K_S: the springs' stiffness stays positive, and a loading curve nowhere as steep as K_M.
    ("torque", "angle"): 1.0,
    ("winding", "winding"): 0.8,
    ("loading", "winding"): 0.6,
}

FORMS: Final[Mapping[str, tuple[Draw, ...]]] = {
    "sensor_lag": (lambda _: {"lag_s": 6.0, "form": "two_stage"},),
    "sensor_gain": (lambda _: {"gain": 0.95, "form": "curved"},),
    "clock_offset": (lambda g: {"offset_s": float(g.choice([-3.0, 3.0])), "wander": g.uniform(0.3, 0.7)},),
    "heat_crosstalk": (lambda g: {"conductance_w_per_k": 0.02, "share": g.uniform(0.3, 0.7)},),
    "nonuniform_temperature": (lambda _: {"cooler_c": 8.0, "form": "profile"},),
    "coil_friction": (
        lambda g: {"rise_mnm": 0.2, "onset_deg": g.uniform(600, 680), "form": "quadratic"},
        lambda g: {"rise_mnm": 0.2, "onset_deg": g.uniform(600, 680), "form": "exponential"},
    ),
    "viscous_friction": (lambda _: {"viscous_mnm_s_per_rad": 5.0, "form": "power"},),
    "position_friction": (lambda g: {"amplitude": 0.3, "phase_rad": g.uniform(-3, 3), "form": "flattened"},),
    "stiffening": (
        lambda g: {"rise_mnm": 0.2, "onset_deg": g.uniform(600, 680), "form": "bend"},
        lambda g: {"rise_mnm": 0.2, "onset_deg": g.uniform(600, 680), "form": "quadratic"},
    ),
    "eccentricity": (lambda g: {"amplitude_deg": 2.0, "phase_rad": g.uniform(-3, 3), "form": "lever"},),
    "fatigue": (
        lambda g: {"loss": 0.05, "form": "saturating", "cycles": g.uniform(1, 3)},
        lambda g: {"loss": 0.05, "form": "plastic", "cycles": g.uniform(1, 3)},
    ),
    "marker_slip": (lambda g: {"step_deg": 4.0, "time_s": g.uniform(0.15, 0.85), "lasts_s": g.uniform(3, 20)},),
}
"""The library's effects in forms that are usual, too, and not the library's; the first number is the strength."""

_STRONGEST: Final = {
    "lag_s": 25.0, "gain": 0.75, "offset_s": 20.0, "conductance_w_per_k": 0.06, "cooler_c": 25.0, "rise_mnm": 2.0,
    "viscous_mnm_s_per_rad": 60.0, "amplitude": 0.9, "amplitude_deg": 15.0, "loss": 0.3, "step_deg": 25.0,
}  # fmt: skip
"""Largest strength, by its key (a gain: the smallest)."""


@dataclass(frozen=True, slots=True)
class Case:
    """One case.

    Attributes
    ----------
    kind : str
        ``clean``, ``law``, ``form`` or ``pair``.
    seed : int
        Everything follows from it.
    effects : tuple of str
        Ids of hidden effects.
    law : (str, str) or None
        Port and driver of a hidden law, in the rig's words (:data:`PLACES`).
    """

    kind: str
    seed: int
    effects: tuple[str, ...] = ()
    law: Key | None = None

    @property
    def name(self) -> str:
        """Short name."""
        hidden = "-over-".join(self.law) if self.law else "+".join(self.effects) or "none"
        return f"{self.kind}-{hidden}-{self.seed}"


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
    details: Mapping[str, Mapping[str, object]] = field(default_factory=dict)
    law: RigLaw | None = None


@dataclass(frozen=True, slots=True, eq=False)
class _Rig:
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


def suite(part: str) -> list[Case]:
    """Return the cases of ``work`` or ``report``; any first so many are a fair sample of the whole."""
    seed = FIRST_SEED[part]
    rng = np.random.default_rng(seed)
    names, places = list(FORMS), list(PLACES)
    made = {
        "clean": [Case("clean", seed + i) for i in range(COUNTS["clean"])],
        "law": [Case("law", seed + 1000 + i, law=places[i % len(places)]) for i in range(COUNTS["law"])],
        "form": [Case("form", seed + 2000 + i, (names[i % len(names)],)) for i in range(COUNTS["form"])],
        "pair": [
            Case("pair", seed + 3000 + i, tuple(names[k] for k in sorted(rng.choice(len(names), 2, replace=False))))
            for i in range(COUNTS["pair"])
        ],
    }
    order = [((i + 0.5) / len(cases), k, case) for k, cases in enumerate(made.values()) for i, case in enumerate(cases)]
    return [case for _, _, case in sorted(order, key=lambda item: item[:2])]


def singles(part: str, count: int) -> list[Case]:
    """Return cases of one effect each in the library's own form, for trials."""
    names = list(LIBRARY)
    return [Case("single", FIRST_SEED[part] + 4000 + i, (names[i % len(names)],)) for i in range(count)]


def make_record(case: Case, *, turned: bool | None = None) -> Record:
    """Run the rig of a case; ``turned`` says whether the sticks' zero is off (drawn where left out)."""
    rng = np.random.default_rng(case.seed)
    rig = _draw_rig(rng, turned=turned)
    plain = _run(rig, ({}, ()))
    details: dict[str, Mapping[str, object]] = {}
    laws: tuple[RigLaw, ...] = ()
    sizes_deg: dict[str, float] = {}
    wanted_deg = [_log_uniform(rng, *_SIZE_DEG) for _ in range(2)]
    if case.law is not None:
        details, laws, sizes_deg[case.name] = _drawn_law(case.law, rng, rig, plain, wanted_deg=wanted_deg[0])
    for name, wanted in zip(case.effects, wanted_deg, strict=False):
        drawn = _drawn_effect(name, case.kind, rng, rig.record.duration_s)
        details[name], sizes_deg[name] = _sized(name, drawn, rig, plain, wanted_deg=wanted)
    made = _record(_run(rig, (details, laws)), rig, details)
    return replace(made, sizes_deg=sizes_deg, details=details, law=laws[0] if laws else None)


def _log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _draw_rig(rng: np.random.Generator, *, turned: bool | None) -> _Rig:
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
    zero_deg = rng.uniform(3.0, _TURNED_DEG) * (1.0 if rng.random() < 0.5 else -1.0)
    prelude = tuple(_half_cycle(rng, s, shift_c, full=rng.random() < 0.6) for s in (0, 1))
    return _Rig(
        declared=declared.to_toml(),
        values=draw_values(declared, given={}, rng=rng),
        record=replace(_programme(rng, shift_c, cycles=4), prelude=prelude),
        later=_programme(rng, shift_c, cycles=2),
        sensor=Sensor(sample_s=_STEP_S, noise_c=_log_uniform(rng, 0.02, 0.1)),
        angle_noise_deg=_log_uniform(rng, 0.02, 0.1),
        zero_deg=zero_deg if (off if turned is None else turned) else 0.0,
        seed=int(rng.integers(2**31)),
    )


def _programme(rng: np.random.Generator, shift_c: float, *, cycles: int) -> Protocol:
    """Return cycles at their own rates, one heating in four incomplete, the first cycle whole."""
    halves = tuple(
        _half_cycle(rng, spring, shift_c, full=cycle == 0 or rng.random() < 0.75)
        for cycle in range(cycles)
        for spring in (0, 1)
    )
    return Protocol(halves, 20.0, 1.0, home=False)


def _half_cycle(rng: np.random.Generator, spring: int, shift_c: float, *, full: bool) -> HalfCycle:
    peak_c = shift_c + (rng.uniform(72.0, 80.0) if full else rng.uniform(57.0, 64.0))
    ramp_s = (peak_c - ROOM_C) / _log_uniform(rng, 0.1, 0.35)
    reference = np.array([[0.0, np.nan], [ramp_s, peak_c]])
    return HalfCycle(spring, reference, ramp_s + rng.uniform(5.0, 40.0), rng.uniform(200.0, 280.0))


@dataclass(frozen=True, slots=True, eq=False)
class _Run:
    """A run of record and later programme: film times, angle as read, rig, first sample of the later one."""

    read_rad: Array
    signals: RigRecord
    split: int


def _run(rig: _Rig, hidden: Hidden) -> _Run:
    effects, laws = hidden
    made: dict[str, HiddenEffect] = {
        name: HIDDEN[name](**{key: value for key, value in details.items() if key != "wander"})  # type: ignore[arg-type]
        for name, details in effects.items()
    }
    whole = replace(rig.record, half_cycles=(*rig.record.half_cycles, *rig.later.half_cycles))
    rng = np.random.default_rng(rig.seed)
    signals = simulate_rig(rig.values, whole, effects=made, laws=laws, sensor=rig.sensor, rng=rng)
    read_rad = reading_angle(signals.angle_rad, signals.time_s, made, laws) + rig.zero_deg * DEG
    return _Run(read_rad, signals, round(rig.record.duration_s / _STEP_S))


def _temperature_rows(run: _Run, details: Mapping[str, Mapping[str, object]]) -> NDArray[np.int64]:
    """Return the sample whose temperatures a merged table shows at each sample: a clock's error moves them."""
    rows = np.arange(len(run.read_rad))
    clock = details.get("clock_offset")
    if clock is None:
        return rows
    plain = ClockOffset(**{key: float(str(value)) for key, value in clock.items() if key != "wander"})
    time_s = run.signals.time_s
    swing = float(str(clock.get("wander", 0.0))) * np.sin(2.0 * np.pi * time_s / time_s[run.split])
    at_s = (time_s - plain.offset_s * (1.0 + swing)) / (1.0 + plain.drift_ppm * 1e-6)
    return np.clip(np.rint(at_s / _STEP_S).astype(np.int64), 0, len(rows) - 1)


def _record(run: _Run, rig: _Rig, details: Mapping[str, Mapping[str, object]]) -> Record:
    rng = np.random.default_rng(rig.seed + 1)
    signals, rows = run.signals, np.arange(0, run.split, _EVERY)
    logged = _temperature_rows(run, details)
    table = SyncedTable(
        time_s=signals.time_s[rows],
        angle_rad=run.read_rad[rows] + rig.angle_noise_deg * DEG * rng.standard_normal(len(rows)),
        angle_sigma_rad=np.full(len(rows), rig.angle_noise_deg * DEG),
        temp_a_c=signals.temp_a_c[logged[rows]],
        temp_b_c=signals.temp_b_c[logged[rows]],
    )
    # What comes later is on the log's own clock, as predictions are.
    tail = np.arange(run.split, len(run.read_rad), _EVERY)
    later = TemperatureLog(
        time_s=signals.time_s[tail] - signals.time_s[tail[0]],
        temp_a_c=signals.temp_a_c[tail],
        temp_b_c=signals.temp_b_c[tail],
    )
    spec = actuator_from(rig.declared, where="blind suite")
    truth = {**rig.values.public, "zero_deg": rig.zero_deg}
    return Record(table, spec, later, run.read_rad[tail], truth)


def _size_deg(rig: _Rig, plain: _Run, hidden: Hidden) -> float:
    """Return what something hidden changes in the angle of the record, ° root mean square."""
    other = _run(rig, hidden)
    # A clock's error moves the temperatures; the angle that belongs to them moves as much.
    moved = plain.read_rad[_temperature_rows(plain, hidden[0])]
    return float(np.sqrt(np.mean((other.read_rad - moved)[: plain.split] ** 2))) / DEG


def _drawn_effect(name: str, kind: str, rng: np.random.Generator, duration_s: float) -> dict[str, object]:
    """Draw an effect's numbers: in another usual form, in the library's range of forms, or (pairs) in either."""
    other = kind == "form" or (kind == "pair" and rng.random() < 0.5)
    choice = FORMS[name][int(rng.integers(len(FORMS[name])))] if other else LIBRARY[name]
    made = {key: str(value) if isinstance(value, str) else float(str(value)) for key, value in choice(rng).items()}
    if kind == "single" and "form" in made:
        del made["form"]
    if name == "marker_slip":
        made = {"step_deg": made["step_deg"], **made, "time_s": float(made["time_s"]) * duration_s}
    return dict(made)


def _sized(
    name: str, drawn: Mapping[str, object], rig: _Rig, plain: _Run, *, wanted_deg: float
) -> tuple[dict[str, object], float]:
    """Return an effect's numbers with the strength that makes the wanted size, and the size."""
    strength = next(iter(drawn))
    null = 1.0 if strength == "gain" else 0.0
    own = float(str(drawn[strength])) - null
    most = abs(_STRONGEST[strength] - null) / abs(own)
    sizes: dict[float, float] = {}

    def scaled(factor: float) -> dict[str, object]:
        return {**drawn, strength: null + factor * own}

    def size(factor: float) -> float:
        sizes[factor] = _size_deg(rig, plain, ({name: scaled(factor)}, ()))
        return sizes[factor]

    factor = factor_for(wanted_deg, size, first=1.0, most=most, within=_WITHIN)
    return scaled(factor), sizes.get(factor) or size(factor)


def _drawn_law(
    place: Key, rng: np.random.Generator, rig: _Rig, plain: _Run, *, wanted_deg: float
) -> tuple[dict[str, Mapping[str, object]], tuple[RigLaw, ...], float]:
    """Return a random law (springs of unlike values stand as an effect of the rig) and its size."""
    rule = PLACES[place]
    sizes: dict[float, float] = {}
    hidden: Callable[[float], tuple[dict[str, Mapping[str, object]], tuple[RigLaw, ...]]]
    if place == ("values", "spring"):
        a, m, e = rng.uniform(-1.0, 1.0, 3).tolist()
        hidden = lambda f: (  # noqa: E731
            {
                "unlike_springs": {
                    "a_shift_c": 4.0 * f * a,
                    "m_shift_c": 4.0 * f * m,
                    "modulus_scale": 1.0 + 0.2 * f * e,
                }
            },
            (),
        )
        most, first = rule.most, 0.2
    else:
        spring = str(rng.choice(rule.springs))
        start, stop = _range(place, plain, rig)
        law = draw_law(*place, start=start, stop=stop, rng=rng, spring=spring)
        steepest = _STEEPEST.get(place, np.inf) * (rig.values.stiffness_s if place[1] in ("angle", "winding") else 1.0)
        slope = float(np.max(np.abs(np.gradient(law.values)))) * (len(law.values) - 1) / (stop - start)
        most = min(rule.most, steepest / slope)
        first = 0.1 * most
        hidden = lambda f: ({}, (law.scaled(f),))  # noqa: E731

    def size(factor: float) -> float:
        sizes[factor] = _size_deg(rig, plain, hidden(factor))
        return sizes[factor]

    factor = factor_for(wanted_deg, size, first=first, most=most, within=_WITHIN)
    return *hidden(factor), sizes.get(factor) or size(factor)


def _range(place: Key, plain: _Run, rig: _Rig) -> tuple[float, float]:
    """Return the range of a law's driver: what the rig without it goes through, record and later one."""
    signals = plain.signals
    angle_rad, half_rad = signals.angle_rad, 0.5 * rig.values.theta_p_rad
    reach_rad = float(np.max(np.abs(angle_rad))) + 10.0 * DEG
    hottest_c = float(max(signals.wire_a_c.max(), signals.wire_b_c.max()))
    halves = float(signals.half_cycle.max() + 1)
    return {
        "angle": (-reach_rad, reach_rad),
        "temperature": (ROOM_C, hottest_c),
        "rate": (0.0, float(np.quantile(np.abs(signals.rate_rad_s), 0.999))),
        "dwell": (0.0, 300.0),
        "time": (0.0, float(signals.time_s[-1])),
        "temp_rate": (-1.4, 0.4),
        "winding": (half_rad - reach_rad, half_rad + reach_rad),
        "half_cycle": (0.0, halves - 1.0),
        "cycle": (0.0, 0.5 * halves - 1.0),
    }[place[1]]
