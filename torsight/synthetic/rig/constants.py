"""Constants of the rig for the compiled integrator: one flat record, with every effect at its null unless it is on."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final, NamedTuple, get_type_hints

import numpy as np
from numpy.typing import NDArray

from torsight.core.compiled import lending
from torsight.core.units import DEG, Floats
from torsight.synthetic.effects.hidden import NonuniformTemperature
from torsight.synthetic.effects.mechanisms import HiddenEffect, UnlikeSprings
from torsight.synthetic.effects.rig_laws import NODES, SLOTS, RigLaw
from torsight.synthetic.keys import constants_of
from torsight.synthetic.rig.rig_values import RigValues

ONSET_SCALE_RAD: Final = 100.0 * DEG
"""Torques that grow past an onset are given at this distance from it."""


class Constants(NamedTuple):
    """All numbers of one rig, SI units and °C; forms are small integers (0 is the usual law).

    Constants of hidden effects have their nulls as defaults.
    """

    k_a: float
    k_m: float
    k_s: float
    theta_cr: float
    theta_p: float
    stress_per_nm: float
    a_s: float
    a_width: float
    m_s: float
    m_width: float
    c_a: float
    c_m: float
    tau_c: float
    inertia: float
    damping: float
    bristle: float
    room_c: float
    resistance: float
    capacity: float
    to_room: float
    to_body: float
    between: float
    body_capacity: float
    body_to_room: float
    gain_p: float
    gain_i: float
    current_max: float
    quantum_c: float
    between_more: float = 0.0
    lag_s: float = 0.0
    lag_b_s: float = 0.0
    lag_stages: int = 1
    sensor_gain: float = 1.0
    sensor_form: int = 0
    bulge_c: float = 0.0
    crosstalk: int = 0
    crosstalk_share: float = 1.0
    zone_scale: float = 5.0
    zone_form: int = 0
    coil: float = 0.0
    coil_onset: float = 0.0
    coil_form: int = 0
    viscous: float = 0.0
    viscous_form: int = 0
    position: float = 0.0
    position_phase: float = 0.0
    position_form: int = 0
    stiff: float = 0.0
    stiff_onset: float = 0.0
    stiff_form: int = 0
    fatigue: float = 0.0
    fatigue_cycles: float = 1.0
    fatigue_form: int = 0
    creep: float = 0.0
    creep_onset: float = 1.0
    bias: float = 0.0
    gravity: float = 0.0
    gravity_phase: float = 0.0
    grease: float = 0.0
    static_excess: float = 0.0
    static_ageing: float = 1.0
    asymmetry: float = 0.0
    r_step: float = 0.0
    r_start: float = 0.0
    r_width: float = 1.0
    latent: float = 0.0
    stop_low: float = -1e9
    stop_high: float = 1e9
    stop_stiffness: float = 0.0
    imbalance: float = 0.0
    local: float = 0.0
    local_angle: float = 0.0
    local_width: float = 1.0
    local_form: int = 0
    bend: float = 0.0
    tanaka: float = 0.0
    loop_memory: float = 0.0
    c_a_scale: float = 1.0
    c_m_scale: float = 1.0
    drift_heating: float = 0.0
    drift_cooling: float = 0.0


_WHOLE: Final = frozenset(name for name, kind in get_type_hints(Constants).items() if kind is int)


def to_records(constants: Constants, effects: Mapping[str, HiddenEffect], laws: Sequence[RigLaw]) -> NDArray[np.void]:
    """Return the constants as two records, with spring A's and with B's values, as the compiled functions take them.

    ``law`` holds each law's values on its nodes, one row per slot; a slot with ``law_step`` 0 is empty.
    """
    layout: list[Any] = [(name, np.int64 if name in _WHOLE else np.float64) for name in Constants._fields]
    layout += [("law", np.float64, (len(SLOTS), NODES)), ("law_start", np.float64, len(SLOTS))]
    records = np.zeros(2, dtype=[*layout, ("law_step", np.float64, len(SLOTS))])
    for record, own in zip(records, (constants, _second(constants, effects)), strict=True):
        for name, value in own._asdict().items():
            record[name] = value
    for item in laws:
        if (item.port, item.driver) in SLOTS:
            row = SLOTS[item.port, item.driver]
            for number in {"a": (0,), "b": (1,), "both": (0, 1)}[item.spring]:
                records["law"][number, row] = item.on_nodes()
                records["law_start"][number, row] = item.start
                records["law_step"][number, row] = (item.stop - item.start) / (NODES - 1)
    return records


def _second(constants: Constants, effects: Mapping[str, HiddenEffect]) -> Constants:
    """Return the constants with spring B's values."""
    effect = effects.get("unlike_springs")
    if not isinstance(effect, UnlikeSprings):
        return constants
    scaled = {name: getattr(constants, name) * effect.modulus_scale for name in ("k_a", "k_m", "k_s")}
    return constants._replace(a_s=constants.a_s + effect.a_shift_c, m_s=constants.m_s + effect.m_shift_c, **scaled)


@lending
def has_law(c: Any, slot: int) -> bool:
    """Return whether a rig has a law in a slot."""
    return bool(c.law_step[slot] != 0.0)


@lending
def law(c: Any, slot: int, x: float) -> float:
    """Return a law's value, linear between nodes and constant beyond the ends; 0 where the slot is empty."""
    if not has_law(c, slot):
        return 0.0
    place = min(max((x - c.law_start[slot]) / c.law_step[slot], 0.0), NODES - 1.0)
    node = min(int(place), NODES - 2)
    part = place - node
    return float((1.0 - part) * c.law[slot, node] + part * c.law[slot, node + 1])


def pack(
    values: RigValues, sections: Iterable[Any], *, presliding_rad: float, effects: Mapping[str, HiddenEffect]
) -> Constants:
    """Return a rig's constants from its springs and friction, sections of the scene, and its hidden effects."""
    plain: dict[str, Any] = {
        "k_a": values.rig.k_austenite,
        "k_m": values.rig.k_martensite,
        "k_s": values.rig.k_stress_induced,
        "theta_cr": values.rig.theta_cr_rad,
        "theta_p": values.rig.theta_p_rad,
        "stress_per_nm": values.rig.stress_per_torque,
        "a_s": values.rig.a_start_c,
        "a_width": values.rig.a_finish_c - values.rig.a_start_c,
        "m_s": values.rig.m_start_c,
        "m_width": values.rig.m_start_c - values.rig.m_finish_c,
        "c_a": values.rig.c_austenite,
        "c_m": values.rig.c_martensite,
        "tau_c": values.rig.tau_c_nm,
        "bristle": values.rig.tau_c_nm / presliding_rad,
    }
    for section in sections:
        plain |= constants_of(section)
    for effect in effects.values():
        plain |= effect.constants()
    return Constants(**plain)


def zones(effects: Mapping[str, HiddenEffect]) -> tuple[Floats, Floats]:
    """Return the weights of the wire's zones and their temperatures below that of the middle, °C."""
    effect = effects.get("nonuniform_temperature")
    if not isinstance(effect, NonuniformTemperature):
        return np.ones(1), np.zeros(1)
    if effect.form == "two_zone":
        return np.array([1.0 - effect.share, effect.share]), np.array([0.0, effect.cooler_c])
    # A parabola from the middle to the end, seven points of equal length.
    place = (np.arange(7, dtype=np.float64) + 0.5) / 7.0
    return np.full(7, 1.0 / 7.0), effect.cooler_c * place**2
