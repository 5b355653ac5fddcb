"""Simulation of the rig: from its values and its protocol to signals over time."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from torsight.core.units import DEG, Flags, Floats, Ints
from torsight.synthetic.effects.hidden import Eccentricity, MarkerSlip
from torsight.synthetic.effects.mechanisms import Backlash, HiddenEffect, ReadingDrift, RoomDrift
from torsight.synthetic.effects.rig_laws import RigLaw, read_with, recoverable_share
from torsight.synthetic.keys import key
from torsight.synthetic.rig.integrator import Course, integrate
from torsight.synthetic.rig.protocol import Commands, Protocol, commands
from torsight.synthetic.rig.rig_values import RigValues, pack, to_records, zones
from torsight.synthetic.rig.spring_state import COLUMNS, FACTOR, THETA_MAX, WARMING, XI, loading, unwound_from


@dataclass(frozen=True, slots=True)
class Mechanics:
    """Section [mechanics]: mass and regularised friction."""

    inertia_kg_m2: float = key(
        2e-8, "moment of inertia of what turns, at time factor 1", lower=0.0, upper=1.0, constant="inertia"
    )
    damping_n_m_s: float = key(1e-7, "viscous damping", lower=0.0, upper=1.0, constant="damping")
    presliding_deg: float = key(0.02, "elastic deflection of the friction before it slides", lower=1e-6, upper=5.0)
    substeps: int = key(1, "steps of the integrator per sample of the log", lower=1, upper=1000)


@dataclass(frozen=True, slots=True)
class Thermal:
    """Section [thermal]: heat, and the PI law that drives it. The protocol's time factor scales what sets its pace."""

    room_c: float = key(23.4, "room temperature", lower=-50.0, upper=100.0, constant="room_c")
    resistance_ohm: float = key(0.45, "resistance of one wire", lower=1e-3, upper=1e3, constant="resistance")
    wire_capacity_j_per_k: float = key(
        0.5, "heat capacity of a wire with what sticks to it", lower=1e-4, upper=1e3, constant="capacity"
    )
    wire_to_room_w_per_k: float = key(0.010, "loss of a wire to the room", lower=0.0, upper=10.0, constant="to_room")
    wire_to_body_w_per_k: float = key(
        0.0015, "loss of a wire to the rig's body", lower=0.0, upper=10.0, constant="to_body"
    )
    between_wires_w_per_k: float = key(
        0.0004, "heat passing directly between the wires", lower=0.0, upper=10.0, constant="between"
    )
    body_capacity_j_per_k: float = key(
        1.2, "heat capacity of the body", lower=1e-4, upper=1e5, constant="body_capacity"
    )
    body_to_room_w_per_k: float = key(
        0.010, "loss of the body to the room", lower=0.0, upper=10.0, constant="body_to_room"
    )
    gain_p_a_per_k: float = key(0.10, "proportional gain Kp", lower=0.0, upper=100.0, constant="gain_p")
    gain_i_a_per_k_s: float = key(0.004, "integral gain Ki", lower=0.0, upper=100.0, constant="gain_i")
    current_max_a: float = key(2.5, "limit of the current source", lower=1e-3, upper=100.0, constant="current_max")


@dataclass(frozen=True, slots=True)
class Sensor:
    """Section [sensor]: sampling time, lag, noise and resolution of the temperature readings."""

    sample_s: float = key(0.015, "sampling time of log and controller", lower=1e-3, upper=10.0)
    noise_c: float = key(0.03, "standard deviation of a reading", lower=0.0, upper=10.0)
    quantum_c: float = key(0.01, "step of a reading; 0 for none", lower=0.0, upper=5.0, constant="quantum_c")


@dataclass(frozen=True, slots=True)
class Setup:
    """What a rig is built with beside its springs: masses and friction, heat, and sensors."""

    mechanics: Mechanics = Mechanics()
    thermal: Thermal = Thermal()
    sensor: Sensor = Sensor()


@dataclass(frozen=True, slots=True, eq=False)
class RigRecord:
    """What a rig did, sample by sample (n,) on its own clock; 0 is the first sample.

    The actuator angle φ and its speed; true temperatures of wires and body, and those that the sensors read; heating
    switches and currents; martensite fractions; the friction torque, positive against positive motion; and the number
    of the half-cycle, −1 before the first.
    """

    time_s: Floats
    angle_rad: Floats
    rate_rad_s: Floats
    wire_a_c: Floats
    wire_b_c: Floats
    body_c: Floats
    temp_a_c: Floats
    temp_b_c: Floats
    heat_a: Flags
    heat_b: Flags
    current_a_a: Floats
    current_b_a: Floats
    xi_a: Floats
    xi_b: Floats
    friction_nm: Floats
    half_cycle: Ints

    def __len__(self) -> int:
        return len(self.time_s)

    @property
    def step_s(self) -> float:
        """Time from one sample to the next."""
        return float(self.time_s[1] - self.time_s[0])

    def angle_at(self, time_s: Floats) -> Floats:
        """Return the actuator angle at any instants, rad; held beyond the ends."""
        return between_samples(self.angle_rad, time_s / self.step_s)


def between_samples(values: Floats, place: Floats) -> Floats:
    """Return a sampled signal at places in units of samples: cubic, without overshoot, held beyond the ends."""
    last = len(values) - 1
    place = np.clip(place, 0.0, last - 1e-6)
    index = place.astype(np.int64)
    u = place - index
    start, end = values[index], values[index + 1]
    rise = end - start
    slopes = (end - values[np.maximum(index - 1, 0)], values[np.minimum(index + 2, last)] - start)
    # Fritsch and Carlson's limit: no overshoot where a motion starts or stops within a sample.
    bound = 3.0 * np.abs(rise)
    first, second = (np.where(m * rise > 0, np.clip(0.5 * m, -bound, bound), 0.0) for m in slopes)
    result: Floats = start + u * u * (3 - 2 * u) * rise + u * (1 - u) ** 2 * first + u * u * (u - 1) * second
    return result


def simulate_rig(
    values: RigValues,
    protocol: Protocol,
    *,
    effects: Mapping[str, HiddenEffect] | None,
    laws: Sequence[RigLaw] = (),
    setup: Setup,
    rng: np.random.Generator | None = None,
    before_s: float = 0.0,
    after_s: float = 0.0,
) -> RigRecord:
    """Run a rig through a protocol and return its signals at every sample, homing left out.

    Effects are hidden ones by their ids (:mod:`torsight.synthetic.effects.hidden`); laws have no particular form
    (:mod:`torsight.synthetic.effects.rig_laws`), and those of the reading are not part of the record. Without
    ``rng`` the temperature readings have no noise; the rest before and after is recorded, too.
    """
    effects = effects or {}
    sensor, thermal = setup.sensor, setup.thermal
    constants = scaled_constants(values, protocol, effects, setup=setup)
    orders = commands(protocol, sample_s=sensor.sample_s, room_c=thermal.room_c, before_s=before_s, after_s=after_s)
    count = len(orders.command)
    noise_c = np.zeros((count, 2)) if rng is None else sensor.noise_c * rng.standard_normal((count, 2))
    since_s = sensor.sample_s * np.maximum(np.arange(count) - orders.recorded, 0)
    noise_c += _room_drift(since_s, effects)[:, None]
    start_rad = home_angle(values)
    pair = to_records(constants, effects, laws)
    share = recoverable_share(laws, half_cycle=orders.half_cycle, cycle=orders.cycle)
    rows = integrate(
        pair,
        np.array([start_rad, thermal.room_c, thermal.room_c, thermal.room_c]),
        home_state(pair, start_rad),
        zones(effects),
        Course(orders.command, orders.reference_c, orders.cycle, share, noise_c),
        sensor.sample_s,
        setup.mechanics.substeps,
    )
    return _record(rows, orders, sample_s=sensor.sample_s)


def scaled_constants(
    values: RigValues, protocol: Protocol, effects: Mapping[str, HiddenEffect], *, setup: Setup
) -> dict[str, float]:
    """Return the rig's constants scaled to the protocol's pace.

    Heat capacities and integral time scale with the time factor f, inertia with f², damping with f: a shortened record
    is the paper's record on a faster clock, and equally quasi-static.
    """
    sections = (setup.mechanics, setup.thermal, setup.sensor)
    plain = pack(values, sections, presliding_rad=setup.mechanics.presliding_deg * DEG, effects=effects)
    factor = protocol.time_factor
    paces = {"capacity": factor, "body_capacity": factor, "inertia": factor**2, "damping": factor}
    paced = {name: plain[name] * pace for name, pace in paces.items()}
    return {**plain, **paced, "gain_i": plain["gain_i"] / factor}


def home_angle(values: RigValues) -> float:
    """Return an angle near the home of the stable cycle, rad, from which the homing starts."""
    return min(0.33 * (0.5 * values.rig.theta_p_rad - values.rig.theta_cr_rad) * 1.5, 0.5 * values.rig.theta_p_rad)


def home_state(pair: NDArray[np.void], angle_rad: float) -> Floats:
    """Return both springs as cold martensite at an angle, driven there by B (the model's home).

    Each spring is on its loading curve; where the difference of their torques exceeds the friction torque, A is unwound
    elastically until friction holds the remaining difference.
    """
    state = np.zeros((2, COLUMNS))
    state[:, [FACTOR, WARMING, XI]] = 1.0
    half_rad = 0.5 * pair[0]["theta_p"]
    theta_a, theta_b = half_rad + angle_rad, half_rad - angle_rad
    held_nm = loading(pair[1], theta_b) + pair[0]["tau_c"]
    state[:, THETA_MAX] = unwound_from(pair[0], theta_a, held_nm), theta_b
    return state


def _room_drift(since_s: Floats, effects: Mapping[str, HiddenEffect]) -> Floats:
    """Return the change of both readings due to the room temperature, °C, at times after the start of the record."""
    drift_c = np.zeros_like(since_s)
    for effect in effects.values():
        if isinstance(effect, RoomDrift):
            since_h = since_s / 3600.0
            swing = np.cos(2.0 * math.pi * since_h / effect.period_h) - 1.0
            drift_c += effect.rate_c_h * since_h + effect.swing_c * swing
    return drift_c


def _record(rows: Floats, orders: Commands, *, sample_s: float) -> RigRecord:
    kept = rows[orders.recorded :]
    command = orders.command[orders.recorded :]
    others = {
        "time_s": sample_s * np.arange(len(kept), dtype=np.float64),
        "heat_a": command == 1,
        "heat_b": command == 2,
        "half_cycle": orders.half_cycle[orders.recorded :],
    }
    names = [item.name for item in fields(RigRecord) if item.name not in others]
    return RigRecord(**others, **dict(zip(names, np.ascontiguousarray(kept.T), strict=True)))


def reading_angle(
    angle_rad: Floats, time_s: Floats, effects: Mapping[str, HiddenEffect], laws: Sequence[RigLaw] = ()
) -> Floats:
    """Return the angle (n,) that a perfect camera would read at times on the film's clock, rad.

    Play, eccentricity, a slip and drift, and laws of the reading are added to the actuator's angle φ.
    """
    read = angle_rad + read_with(laws, angle_rad=angle_rad, time_s=time_s)
    for effect in effects.values():
        if isinstance(effect, Backlash):
            read = play(read, effect.gap_deg * DEG)
    for effect in effects.values():
        if isinstance(effect, Eccentricity):
            turned = read + effect.phase_rad
            size = math.sin(effect.amplitude_deg * DEG)
            lever = np.arctan2(size * np.sin(turned), 1.0 - size * np.cos(turned))
            read = read + (lever if effect.form == "lever" else effect.amplitude_deg * DEG * np.sin(turned))
    for effect in effects.values():
        if isinstance(effect, MarkerSlip):
            since_s = time_s - effect.time_s
            done = np.clip(since_s / effect.lasts_s, 0.0, 1.0) if effect.lasts_s > 0.0 else since_s >= 0.0
            read = read + done * effect.step_deg * DEG
        if isinstance(effect, ReadingDrift):
            settles_s = effect.settles_h * 3600.0
            read = read - effect.rate_deg_h / 3600.0 * DEG * settles_s * np.expm1(-np.maximum(time_s, 0.0) / settles_s)
    return read


def play(angle_rad: Floats, gap_rad: float) -> Floats:
    """Return the angle that follows ``angle_rad`` through a play of width ``gap_rad``, started in its middle."""
    out = np.empty_like(angle_rad)
    follower = float(angle_rad[0])
    half = 0.5 * gap_rad
    for i, angle in enumerate(angle_rad.tolist()):
        follower = min(max(follower, angle - half), angle + half)
        out[i] = follower
    return out
