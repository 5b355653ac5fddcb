"""Cases of the blind suite: records of a rig with its own integrator and its own forms of the effects.

Every case is a seed. From it come the rig's values (each off by its declared uncertainty), the protocol (rates, peaks,
incomplete heatings, holds), the hidden effects with their form and size, and the noise. Seeds below ``REPORT_FROM``
are for work; the others are looked at for the report only. In the part for usual sizes nothing is scaled down: effects
have the sizes that they usually have on a rig, however many degrees that is.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from torsight.actuator.model import ActuatorModel
from torsight.actuator.spec import ActuatorSpec, actuator_from
from torsight.core.records import SyncedTable, TemperatureLog
from torsight.core.units import DEG
from torsight.synthetic.effects.hidden import HIDDEN, ClockOffset
from torsight.synthetic.effects.mechanisms import HiddenEffect
from torsight.synthetic.rig.moving_rig import RigRecord, Sensor, Setup, reading_angle, simulate_rig
from torsight.synthetic.rig.protocol import HalfCycle, Protocol
from torsight.synthetic.rig.rig_values import RigValues, declared_from, draw_values

Array = NDArray[np.float64]
Draw = Callable[[np.random.Generator], dict[str, object]]

REPORT_FROM: Final = 10_000
"""Seeds from here on are for the report."""
USUAL_FROM: Final = 20_000
"""Seeds from here on are for the report at usual sizes."""
ROOM_C: Final = 23.4
_STEP_S: Final = 0.05
_EVERY: Final = 5
_ANGLE_NOISE_DEG: Final = 0.06
_SIZE_DEG: Final = (0.5, 20.0)


def _log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _either(rng: np.random.Generator, value: float) -> float:
    return value if rng.random() < 0.5 else -value


LIBRARY: Final[Mapping[str, Draw]] = {
    "sensor_lag": lambda g: {"lag_s": g.uniform(2, 15), "form": g.choice(["first_order", "first_order", "two_stage"])},
    "sensor_gain": lambda g: {
        "gain": g.uniform(0.9, 0.95) if g.random() < 0.7 else g.uniform(1.035, 1.06),
        "form": g.choice(["linear", "linear", "curved"]),
    },
    "clock_offset": lambda g: {"offset_s": _either(g, _log_uniform(g, 1, 12)), "drift_ppm": g.normal(0, 50)},
    "heat_crosstalk": lambda g: {"conductance_w_per_k": _log_uniform(g, 0.008, 0.03)},
    "nonuniform_temperature": lambda g: {
        "cooler_c": g.uniform(3, 12),
        "share": g.uniform(0.1, 0.4),
        "form": g.choice(["two_zone", "profile"]),
    },
    "coil_friction": lambda g: {
        "rise_mnm": _log_uniform(g, 0.08, 0.4),
        "onset_deg": g.uniform(600, 700),
        "form": g.choice(["linear", "quadratic", "exponential"]),
    },
    "viscous_friction": lambda g: {
        "viscous_mnm_s_per_rad": _log_uniform(g, 2, 20),
        "form": g.choice(["linear", "power"]),
    },
    "position_friction": lambda g: {
        "amplitude": g.uniform(0.15, 0.5),
        "phase_rad": g.uniform(-3, 3),
        "form": g.choice(["sine", "flattened"]),
    },
    "stiffening": lambda g: {
        "rise_mnm": _log_uniform(g, 0.1, 0.6),
        "onset_deg": g.uniform(600, 700),
        "form": g.choice(["cubic", "third_slope", "quadratic"]),
    },
    "eccentricity": lambda g: {
        "amplitude_deg": g.uniform(0.6, 3.0),
        "phase_rad": g.uniform(-3, 3),
        "form": g.choice(["sine", "lever"]),
    },
    "fatigue": lambda g: {
        "loss": g.uniform(0.006, 0.03),
        "form": g.choice(["geometric", "saturating"]),
        "cycles": g.uniform(1, 4),
    },
    "marker_slip": lambda g: {"time_s": g.uniform(0.15, 0.85), "step_deg": _either(g, g.uniform(2, 8))},
}
"""The twelve effects of the contract, with their usual sizes."""

OUTSIDE: Final[Mapping[str, tuple[Draw, tuple[str, ...]]]] = {
    "creep": (lambda g: {"relaxation": g.uniform(0.02, 0.06)}, ("dwell_s", "time_s", "temp_passive_c")),
    "torque_bias": (lambda g: {"bias_mnm": _either(g, g.uniform(0.1, 0.3))}, ("direction", "angle_deg")),
    "gravity": (
        lambda g: {"amplitude_mnm": g.uniform(0.1, 0.3), "phase_rad": g.uniform(-3, 3)},
        ("angle_deg",),
    ),
    "grease_temperature": (
        lambda g: {"per_k": g.uniform(0.04, 0.12)},
        ("temp_passive_c", "temp_active_c", "direction"),
    ),
    "backlash": (lambda g: {"gap_deg": g.uniform(2, 6)}, ("direction",)),
    "static_friction": (lambda g: {"excess": g.uniform(0.3, 0.8), "ageing_s": 60.0}, ("dwell_s", "angle_rate_deg_s")),
    "direction_friction": (lambda g: {"asymmetry": _either(g, g.uniform(0.15, 0.4))}, ("direction",)),
    "r_phase": (lambda g: {"step_deg": g.uniform(15, 40)}, ("temp_active_c", "temp_passive_c")),
    "thermistor_curve": (lambda g: {"bulge_c": _either(g, g.uniform(0.6, 2.0))}, ("temp_active_c",)),
    "end_stop": (
        lambda g: {"angle_deg": g.uniform(195, 220), "stiffness_mnm_per_rad": g.uniform(1, 5)},
        ("angle_deg",),
    ),
    "imbalance": (lambda g: {"excess": _either(g, g.uniform(0.03, 0.1))}, ("direction", "angle_deg")),
    "hard_stop": (
        lambda g: {
            "angle_deg": g.uniform(185, 220),
            "stiffness_mnm_per_rad": _log_uniform(g, 3, 100),
            "side": g.choice(["both", "positive", "negative"]),
        },
        ("angle_deg",),
    ),
    "room_drift": (
        lambda g: {
            "rate_c_h": _either(g, g.uniform(0.5, 3)),
            "swing_c": g.uniform(0, 0.4),
            "period_h": g.uniform(0.4, 2),
        },
        ("time_s",),
    ),
    "latent_heat": (lambda g: {"latent_c_s": g.uniform(20, 200)}, ("angle_rate_deg_s", "temp_rate_c_s")),
    "local_torque": (
        lambda g: {
            "height_mnm": _either(g, g.uniform(0.1, 0.4)),
            "angle_deg": g.uniform(-150, 150),
            "width_deg": g.uniform(10, 40),
            "form": g.choice(["bump", "magnet"]),
        },
        ("angle_deg",),
    ),
    "reading_drift": (
        lambda g: {"rate_deg_h": _either(g, g.uniform(2, 10)), "settles_h": _log_uniform(g, 0.2, 10)},
        ("time_s",),
    ),
}
"""Effects outside the library, each with the variables that are right answers for its first driver."""
_RIG_NAME: Final = {"hard_stop": "end_stop"}


@dataclass(frozen=True, slots=True)
class Case:
    """One case: kind (``clean``, ``single``, ``double``, ``outside``), seed, ids, and whether the model errs a bit.

    At usual sizes nothing is scaled down.
    """

    kind: str
    seed: int
    effects: tuple[str, ...] = ()
    model_error: bool = False
    usual: bool = False

    @property
    def name(self) -> str:
        """Short name."""
        return f"{self.kind}-{'+'.join(self.effects) or 'none'}{'-bent' if self.model_error else ''}-{self.seed}"


@dataclass(frozen=True, slots=True, eq=False)
class Record:
    """What is handed to the discovery, and what it does not see."""

    table: SyncedTable
    spec: ActuatorSpec
    later: TemperatureLog
    later_angle_rad: Array
    truth: Mapping[str, float]
    size_deg: float
    details: Mapping[str, Mapping[str, object]] = field(default_factory=dict)
    sizes_deg: Mapping[str, float] = field(default_factory=dict)


def suite(part: str) -> list[Case]:
    """Return the cases of a part: ``work`` (small), ``report`` (60 clean, 12 × 6 single, 20 double, 32 outside).

    And ``usual``: 12 × 3 single and 30 double at usual sizes.

    Kinds and effects alternate, so that any first so many cases are a fair sample of the whole.
    """
    seed = {"work": 0, "report": REPORT_FROM, "usual": USUAL_FROM}[part]
    usual = part == "usual"
    counts = {"work": (12, 4, 12, 32), "report": (60, 6, 20, 32), "usual": (0, 3, 30, 0)}[part]
    clean = [Case("clean", seed + i, model_error=i % 2 == 1, usual=usual) for i in range(counts[0])]
    single = [
        Case("single", seed + 1000 + 20 * j + i, (name,), model_error=(i + j) % 2 == 1, usual=usual)
        for i in range(counts[1])
        for j, name in enumerate(LIBRARY)
    ]
    rng = np.random.default_rng(seed)
    names = list(LIBRARY)
    double = []
    for i in range(counts[2]):
        pair = tuple(names[k] for k in sorted(rng.choice(len(names), 2, replace=False).tolist()))
        double.append(Case("double", seed + 2000 + i, pair, model_error=i % 2 == 1, usual=usual))
    nameless = list(OUTSIDE)
    outside = [
        Case("outside", seed + 3000 + i, (nameless[i % len(nameless)],), model_error=i % 2 == 1, usual=usual)
        for i in range(counts[3])
    ]
    kinds = (clean, single, double, outside)
    places = [((i + 0.5) / len(cases), k, case) for k, cases in enumerate(kinds) for i, case in enumerate(cases)]
    return [case for _, _, case in sorted(places, key=lambda item: item[:2])]


def make_record(case: Case) -> Record:
    """Run the rig of a case.

    The size of an effect is how far the plain model with the rig's own values misses the angle at the temperatures that
    the sensors read (95 % of the time less). Where an effect alone is outside 0.5 to 20°, its strength is scaled; at
    usual sizes only where it is less.
    """
    least_deg, most_deg = _SIZE_DEG[0], np.inf if case.usual else _SIZE_DEG[1]
    rng = np.random.default_rng(case.seed)
    values = draw_values(declared_from({}, where="suite"), given={}, rng=rng)
    record, later = _protocols(rng)
    error = {"kinetics_shape": {"bend": _either(rng, rng.uniform(0.005, 0.015))}} if case.model_error else {}
    noise_seed = int(rng.integers(2**31))
    details: dict[str, dict[str, object]] = {}
    sizes_deg: dict[str, float] = {}
    for name in case.effects:
        details[name] = _drawn(name, rng, record.duration_s)
        for _ in range(4):
            alone = _record(_run(values, record, later, {name: details[name]}, noise_seed), values, {}, noise_seed)
            sizes_deg[name] = alone.size_deg
            if least_deg <= alone.size_deg <= most_deg:
                break
            wanted_deg = _log_uniform(rng, 2.0 * _SIZE_DEG[0], 0.75 * _SIZE_DEG[1])
            details[name] = _scaled(name, details[name], wanted_deg / max(alone.size_deg, 0.1))
        else:
            # The strength that is used in the end has not been measured yet.
            alone = _record(_run(values, record, later, {name: details[name]}, noise_seed), values, {}, noise_seed)
            sizes_deg[name] = alone.size_deg
    whole = _record(_run(values, record, later, error | details, noise_seed), values, details, noise_seed)
    return replace(whole, sizes_deg=sizes_deg)


def _size_deg(table: SyncedTable, spec: ActuatorSpec, truth: Mapping[str, float]) -> float:
    model = ActuatorModel(spec)
    drive = model.prepare(table)
    own = {p.name: truth[p.name] for p in model.parameters}
    miss = np.abs(model.simulate(drive, own).angle_rad - drive.angle_rad) / DEG
    return float(np.nanquantile(miss, 0.95))


def _drawn(name: str, rng: np.random.Generator, duration_s: float) -> dict[str, object]:
    draw = LIBRARY[name] if name in LIBRARY else OUTSIDE[name][0]
    made = {key: str(value) if isinstance(value, str) else float(str(value)) for key, value in draw(rng).items()}
    if name == "marker_slip":
        made["time_s"] = float(made["time_s"]) * duration_s
    return made


def _scaled(name: str, details: Mapping[str, object], factor: float) -> dict[str, object]:
    """Return an effect whose strength (its first number, from where the effect vanishes) is scaled."""
    strength = next(iter(details))
    if name == "marker_slip":
        strength = "step_deg"
    elif name in {"end_stop", "hard_stop"}:
        strength = "stiffness_mnm_per_rad"
    null = 1.0 if name == "sensor_gain" else 0.0
    limited = min(max(factor, 0.1), 5.0)
    most = 0.9 if name in {"position_friction", "direction_friction"} else np.inf
    scaled = null + limited * (float(str(details[strength])) - null)
    return {**details, strength: float(np.clip(scaled, -most, most))}


def _protocols(rng: np.random.Generator) -> tuple[Protocol, Protocol]:
    """Return the record's protocol (two to four cycles) and the later one's (two cycles), both with one incomplete."""
    cycles = int(rng.integers(2, 5))
    incomplete = int(rng.integers(cycles)) if rng.random() < 0.9 else -1
    record = [_half_cycle(rng, spring, full=i != incomplete) for i in range(cycles) for spring in (0, 1)]
    later = [_half_cycle(rng, spring, full=i == 0) for i in range(2) for spring in (0, 1)]
    return Protocol(tuple(record), 20.0, 1.0, home=True), Protocol(tuple(later), 20.0, 1.0, home=False)


def _half_cycle(rng: np.random.Generator, spring: int, *, full: bool) -> HalfCycle:
    peak_c = rng.uniform(71.0, 80.0) if full else rng.uniform(58.0, 62.5)
    ramp_s = (peak_c - ROOM_C) / _log_uniform(rng, 0.08, 0.25)
    reference = np.array([[0.0, np.nan], [ramp_s, peak_c]])
    return HalfCycle(spring, reference, ramp_s + rng.uniform(8.0, 45.0), rng.uniform(260.0, 350.0))


@dataclass(frozen=True, slots=True, eq=False)
class _Run:
    time: Array
    angle: Array
    temps: tuple[Array, Array]
    split: int


def _run(
    values: RigValues,
    record: Protocol,
    later: Protocol,
    effects: Mapping[str, dict[str, object]],
    noise_seed: int,
) -> _Run:
    """Run record and later protocol in one go, so that what the rig remembers goes on."""
    made: dict[str, HiddenEffect] = {
        name: HIDDEN[_RIG_NAME.get(name, name)](**details)  # type: ignore[arg-type]
        for name, details in effects.items()
    }
    whole = Protocol((*record.half_cycles, *later.half_cycles), record.rest_s, 1.0, home=True)
    rng = np.random.default_rng(noise_seed)
    setup = Setup(sensor=Sensor(sample_s=_STEP_S, noise_c=0.02))
    run: RigRecord = simulate_rig(values, whole, effects=made, setup=setup, rng=rng)
    angle = reading_angle(run.angle_rad, run.time_s, made)
    temps = (run.temp_a_c, run.temp_b_c)
    clock = made.get("clock_offset")
    if isinstance(clock, ClockOffset):
        at = (run.time_s - clock.offset_s) / (1.0 + clock.drift_ppm * 1e-6)
        nearest = np.clip(np.rint(at / _STEP_S).astype(np.int64), 0, len(run) - 1)
        temps = (temps[0][nearest], temps[1][nearest])
    return _Run(run.time_s, angle, temps, round(record.duration_s / _STEP_S))


def _record(run: _Run, values: RigValues, details: Mapping[str, dict[str, object]], noise_seed: int) -> Record:
    rng = np.random.default_rng(noise_seed + 1)
    rows = np.arange(0, run.split, _EVERY)
    noisy = run.angle[rows] + _ANGLE_NOISE_DEG * DEG * rng.standard_normal(len(rows))
    table = SyncedTable(
        time_s=run.time[rows],
        angle_rad=noisy,
        angle_sigma_rad=np.full(len(rows), _ANGLE_NOISE_DEG * DEG),
        temp_a_c=run.temps[0][rows],
        temp_b_c=run.temps[1][rows],
    )
    # What comes later is logged without the clock's error: predictions are on the log's own clock.
    tail = np.arange(run.split, len(run.time), _EVERY)
    offset = float(details.get("clock_offset", {}).get("offset_s", 0.0))  # type: ignore[arg-type]
    moved = np.clip(tail + round(offset / _STEP_S), 0, len(run.time) - 1)
    later = TemperatureLog(
        time_s=run.time[tail] - run.time[tail[0]], temp_a_c=run.temps[0][moved], temp_b_c=run.temps[1][moved]
    )
    spec = actuator_from(declared_from({}, where="suite").to_toml(), where="suite")
    truth = {"zero_deg": 0.0, **values.public}
    return Record(table, spec, later, run.angle[tail], truth, _size_deg(table, spec, truth), details)
